import hashlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.fingerprint import sha256_of_file
from gramoscope.apparatus.inspection import inspect

PRACTICE = Path(__file__).parents[2].parent / "shared" / "captures"


@pytest.mark.parametrize(
    ("name", "shape"), [("practice-clean", (30, 12, 384, 1280)), ("practice-damaged", (32, 4, 448, 1280))]
)
def test_the_practice_captures_are_whole(name, shape):
    if not (PRACTICE / name).is_dir():
        pytest.skip(f"the practice capture {name} is not here")
    capture = open_capture(PRACTICE / name)
    seen = inspect(capture, quick=True)
    group = capture.group(7)
    assert seen.sound
    assert (seen.groups_expected, *group.images.shape) == shape
    assert group.valid.all()
    step_m = np.diff([capture.group(number).arc_start_m[0] for number in (7, 8)])
    np.testing.assert_allclose(step_m, 469.53e-6, rtol=1e-9)


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr", "video"])
def test_several_threads_may_read_at_once(tmp_path, bench, film, write, layout):
    pictures = film(bench)
    capture = open_capture(write(tmp_path / "c", bench, pictures, layout=layout))
    with ThreadPoolExecutor(4) as pool:
        read = list(pool.map(lambda number: capture.group(number).images, [4, 0, 3, 1, 2, 2, 0, 4]))
    np.testing.assert_array_equal(read, pictures[[4, 0, 3, 1, 2, 2, 0, 4]])


def test_groups_come_in_order_and_can_be_a_part(tmp_path, bench, film, write):
    capture = open_capture(write(tmp_path / "c", bench, film(bench)))
    assert [group.number for group in capture.groups()] == [0, 1, 2, 3, 4]
    assert [group.number for group in capture.groups(1, 3)] == [1, 2]
    assert [group.number for group in capture.groups(3, 99)] == [3, 4]


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr", "video"])
def test_the_fingerprint_changes_with_a_single_byte(tmp_path, bench, film, write, layout):
    folder = write(tmp_path / "c", bench, film(bench), layout=layout)
    before = open_capture(folder).fingerprint()
    assert before["capture.toml"] == hashlib.sha256((folder / "capture.toml").read_bytes()).hexdigest()
    path = max((p for p in folder.rglob("*") if p.is_file()), key=lambda p: (p.stat().st_size, p.name))
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 1
    path.write_bytes(data)
    after = open_capture(folder).fingerprint()
    assert before.keys() == after.keys()
    assert len([name for name in before if before[name] != after[name]]) == 1
    assert len(before) == 2 + {"tiff": 5, "png": 15, "zarr": 1, "video": 1}[layout]


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr", "video"])
def test_every_file_belongs_to_one_group_or_to_all(tmp_path, bench, film, write, layout):
    folder = write(tmp_path / "c", bench, film(bench), layout=layout)
    capture = open_capture(folder)
    named = [*capture.common_files(), *(path for number in range(5) for path in capture.files_of_group(number))]
    assert sorted(named) == sorted(path for path in folder.rglob("*") if path.is_file())


def test_a_file_that_is_gone_has_no_sum(tmp_path):
    assert sha256_of_file(tmp_path / "gone") == ""
