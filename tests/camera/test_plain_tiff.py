"""Pages found in a file's bytes are those that tifffile reads; whatever is not plain is left to it."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import tifffile

from gramoscope.camera.contents import Contents
from gramoscope.camera.frames import Lost
from gramoscope.camera.frames_tiff import read_pages
from gramoscope.camera.plain_tiff import plain_pages
from gramoscope.camera.sensor import Sensor

SHAPE = (5, 24, 32)
SENSOR = Sensor(width_px=32, height_px=24)


def _film(dtype: str = "u1") -> npt.NDArray[Any]:
    return np.random.default_rng(3).integers(0, np.iinfo(dtype).max, SHAPE).astype(dtype)


def _written(path: Path, film: npt.NDArray[Any], *, more: dict[str, Any] | None = None, **kind: Any) -> Path:
    with tifffile.TiffWriter(path, **kind) as tiff:
        for frame in film:
            tiff.write(frame, photometric="minisblack", contiguous=False, metadata=None, **(more or {}))
    return path


def _found(path: Path) -> list[npt.NDArray[Any]]:
    with tifffile.TiffFile(path) as tiff:
        return plain_pages(tiff, Contents().of(path))


@pytest.mark.parametrize("dtype", ["u1", "u2"])
@pytest.mark.parametrize("kind", [{}, {"bigtiff": True}, {"byteorder": ">"}, {"byteorder": ">", "bigtiff": True}])
def test_plain_pages_are_those_that_tifffile_reads(tmp_path: Path, dtype: str, kind: dict[str, Any]) -> None:
    film = _film(dtype)
    path = _written(tmp_path / "film.tif", film, more={"resolution": (300, 300), "datetime": True}, **kind)
    found = _found(path)
    assert len(found) == len(film)
    np.testing.assert_array_equal(np.array(found), tifffile.imread(path))
    np.testing.assert_array_equal(np.array(found), film)


def test_pages_in_one_block_are_found_too(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "film.tif", _film(), photometric="minisblack", metadata=None)
    found = _found(tmp_path / "film.tif")
    assert [page.tolist() for page in found] in ([], _film().tolist())


@pytest.mark.parametrize(
    "more", [{"compression": "zlib"}, {"rowsperstrip": 8}, {"tile": (16, 16)}, {"photometric": "miniswhite"}]
)
def test_what_is_not_plain_is_left_to_tifffile(tmp_path: Path, more: dict[str, Any]) -> None:
    with tifffile.TiffWriter(tmp_path / "film.tif") as tiff:
        for frame in _film():
            tiff.write(frame, **{"photometric": "minisblack", "contiguous": False, "metadata": None, **more})
    assert _found(tmp_path / "film.tif") == []
    read = list(read_pages(tmp_path / "film.tif", Contents(), folder=tmp_path, frames=5, sensor=SENSOR))
    expected = _film() if "photometric" not in more else 255 - _film()
    np.testing.assert_array_equal(np.array(read), expected)


def test_a_page_of_another_size_or_kind_is_noticed(tmp_path: Path) -> None:
    film = _film()
    with tifffile.TiffWriter(tmp_path / "film.tif") as tiff:
        for frame in (film[0], film[1][:12], film[2].astype(np.uint16), film[3]):
            tiff.write(frame, photometric="minisblack", contiguous=False, metadata=None)
    assert _found(tmp_path / "film.tif") == []
    pages = list(read_pages(tmp_path / "film.tif", Contents(), folder=tmp_path, frames=4, sensor=SENSOR))
    assert isinstance(pages[1], Lost)
    assert "32 × 12 pixels" in pages[1].why
    for number in (0, 2, 3):
        np.testing.assert_array_equal(pages[number], film[number])


@pytest.mark.parametrize("kept", [0.3, 0.62, 0.97])
def test_a_file_that_was_cut_off_gives_the_pages_that_are_whole(tmp_path: Path, kept: float) -> None:
    path = _written(tmp_path / "film.tif", _film())
    path.write_bytes(path.read_bytes()[: int(kept * path.stat().st_size)])
    assert _found(path) == []
    pages = list(read_pages(path, Contents(), folder=tmp_path, frames=5, sensor=SENSOR))
    whole = [page for page in pages if not isinstance(page, Lost)]
    assert len(whole) == int(kept * 5)
    np.testing.assert_array_equal(np.array(whole), _film()[: len(whole)])


def test_a_chain_of_directories_that_comes_back_ends(tmp_path: Path) -> None:
    path = _written(tmp_path / "film.tif", _film())
    with tifffile.TiffFile(path) as tiff:
        first, last = tiff.pages[0].offset, tiff.pages[-1]
        end = last.offset + 2 + 12 * len(last.tags)
    data = bytearray(path.read_bytes())
    data[end : end + 4] = int(first).to_bytes(4, "little")
    path.write_bytes(data)
    with tifffile.TiffFile(path) as tiff:
        found = plain_pages(tiff, Contents().of(path))
    np.testing.assert_array_equal(np.array(found[:5]), _film())
    assert len(found) <= path.stat().st_size


@pytest.mark.parametrize("size", [0, 1, 1 << 20, (1 << 20) + 17, 3_000_000])
def test_contents_are_added_up_as_sha256sum_does(tmp_path: Path, size: int) -> None:
    data = np.random.default_rng(size).integers(0, 256, size).astype(np.uint8).tobytes()
    (tmp_path / "a").write_bytes(data)
    contents, plain = Contents(summed=True), Contents()
    assert contents.of(tmp_path / "a").tobytes() == data == plain.of(tmp_path / "a").tobytes()
    assert contents.sums == {tmp_path / "a": hashlib.sha256(data).hexdigest()}
    assert plain.sums == {}
    with pytest.raises(FileNotFoundError):
        contents.of(tmp_path / "b")
