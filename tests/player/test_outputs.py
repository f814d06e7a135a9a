"""The files of a transfer are all there or not at all, and an earlier transfer survives a failed one."""

from __future__ import annotations

import json
import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from matplotlib.figure import Figure

from gramoscope.errors import OutputError
from gramoscope.player import outputs
from gramoscope.player.outputs import Outputs

RATE_HZ = 96_000.0
NAMES = {"flat.wav", "equalised.wav", "report.json", "groove.png"}


def _transfer(folder: Path, *, level: float = 0.2, samples: int = 700, report: Any = None) -> None:
    with Outputs(folder, rate_hz=RATE_HZ) as files:
        for _ in range(3):
            files.flat.write(np.full(samples, level))
            files.equalised.write(np.full(samples, -level))
        files.finish({"level": level} if report is None else report, _picture())


def _picture() -> Figure:
    """Some ten kilobytes that cannot be packed."""
    figure = Figure()
    figure.figimage(np.random.default_rng(1).random((90, 130)))
    return figure


def _content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@contextmanager
def _files_of_at_most(size_bytes: int) -> Iterator[None]:
    """A disk as good as full: no file grows beyond a size."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.fixture
def older(tmp_path: Path) -> Path:
    """A folder with a transfer in it."""
    _transfer(tmp_path / "out", level=0.1)
    return tmp_path / "out"


def test_a_transfer_leaves_its_four_files_and_nothing_else(tmp_path: Path) -> None:
    _transfer(tmp_path / "new" / "deep" / "out")
    out = tmp_path / "new" / "deep" / "out"
    assert set(_content(out)) == NAMES
    assert json.loads((out / "report.json").read_text()) == {"level": 0.2}
    flat, equalised = soundfile.read(out / "flat.wav")[0], soundfile.read(out / "equalised.wav")[0]
    assert flat.size == equalised.size == 2100
    np.testing.assert_allclose(flat, -equalised, atol=2**-22)


def test_until_the_end_of_the_block_nothing_has_its_name(older: Path) -> None:
    before = _content(older)
    with Outputs(older, rate_hz=RATE_HZ) as files:
        files.flat.write(np.ones(5000))
        seen = {name: (older / name).read_bytes() for name in NAMES}
        assert seen == before
        assert all(name.startswith(".") for name in set(_content(older)) - NAMES)


def test_a_new_transfer_replaces_an_older_one_whole(older: Path) -> None:
    before = _content(older)
    _transfer(older, level=0.3)
    after = _content(older)
    assert set(after) == NAMES
    assert all(after[name] != before[name] for name in NAMES - {"groove.png"})


class _PictureThatFails(Figure):
    def __init__(self, error: BaseException) -> None:
        super().__init__()
        self.error = error

    def savefig(self, *_: Any, **__: Any) -> None:
        raise self.error


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), OSError(28, "No space left on device")])
@pytest.mark.parametrize("where", ["in the block", "in the picture"])
@pytest.mark.parametrize("place", ["new", "older"])
def test_whatever_goes_wrong_leaves_things_as_they_were(
    older: Path, tmp_path: Path, error: BaseException, where: str, place: str
) -> None:
    folder = older if place == "older" else tmp_path / "a" / "b"
    before = _content(older)

    def fail() -> None:
        with Outputs(folder, rate_hz=RATE_HZ) as files:
            files.flat.write(np.ones(3000))
            if where == "in the block":
                raise error
            files.equalised.write(np.ones(3000))
            files.finish({}, _PictureThatFails(error))

    with pytest.raises((type(error), OutputError)):
        fail()
    assert _content(older) == before
    assert {path.name for path in tmp_path.iterdir()} == {"out"}, "folders made for it are gone"


def test_a_report_that_cannot_be_written_down_spoils_nothing(older: Path) -> None:
    before = _content(older)
    with pytest.raises(TypeError):
        _transfer(older, report={"what": object()})
    assert _content(older) == before


@pytest.mark.parametrize("size_bytes", [2_000, 7_500], ids=["in the sound", "in the picture"])
def test_a_full_disk_is_said_and_leaves_things_as_they_were(older: Path, size_bytes: int) -> None:
    before = _content(older)
    with _files_of_at_most(size_bytes), pytest.raises(OutputError) as caught:
        _transfer(older, level=0.4)
    assert _content(older) == before
    assert caught.value.needed
    assert "free some space" in caught.value.remedy


def test_a_full_disk_at_the_last_block_of_the_sound_is_noticed(older: Path) -> None:
    before = _content(older)
    whole = (older / "flat.wav").stat().st_size
    with _files_of_at_most(whole - 1), pytest.raises(OutputError):
        _transfer(older, level=0.4)
    assert _content(older) == before


def test_a_folder_that_was_there_and_empty_stays(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with pytest.raises(ValueError, match="no"), Outputs(tmp_path / "out", rate_hz=RATE_HZ):
        raise ValueError("no")
    assert list((tmp_path / "out").iterdir()) == []


def test_a_file_where_the_folder_should_be_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    for folder in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(OutputError) as caught:
            _transfer(folder)
        assert "--out" in caught.value.remedy
    assert (tmp_path / "out").read_text() == "mine"


def test_a_folder_without_permission_is_said(tmp_path: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("nothing is forbidden to root")
    (tmp_path / "out").mkdir()
    (tmp_path / "out").chmod(0o500)
    for folder in (tmp_path / "out", tmp_path / "out" / "deeper"):
        with pytest.raises(OutputError, match="Permission"):
            _transfer(folder)
    (tmp_path / "out").chmod(0o700)
    assert list((tmp_path / "out").iterdir()) == []


def test_a_name_that_one_of_the_files_cannot_have_is_found_out_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "out" / "equalised.wav").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"equalised\.wav"), Outputs(tmp_path / "out", rate_hz=RATE_HZ):
        pytest.fail("the block was entered")
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"equalised.wav"}


def test_what_a_killed_transfer_left_does_not_confuse_the_next(older: Path) -> None:
    # killed without mercy: its temporaries stay, one with the number of this very process
    stale = {f".flat.wav.{os.getpid()}.part": b"RIFF half", ".report.json.99999.part": b"{"}
    for name, content in stale.items():
        (older / name).write_bytes(content)
    _transfer(older, level=0.3)
    assert soundfile.read(older / "flat.wav")[0][0] == pytest.approx(0.3 / 0.5)
    assert set(_content(older)) - NAMES <= {".report.json.99999.part"}


def test_the_report_is_the_last_to_appear_and_the_first_to_go(older: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    commit = outputs.WavWriter.commit

    def watched(self: Any) -> None:
        seen.append((older / "report.json").exists())
        commit(self)

    monkeypatch.setattr(outputs.WavWriter, "commit", watched)
    _transfer(older, level=0.3)
    assert seen == [False, False]
