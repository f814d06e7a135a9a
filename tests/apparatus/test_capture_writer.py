import errno
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import gramoscope.apparatus.capture_writer as module
from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.capture_writer import CaptureWriter
from gramoscope.errors import ArgumentError, CaptureError, OutputError

LAYOUTS = ["tiff", "png", "zarr", "video"]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("interruption", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_film_leaves_nothing(tmp_path, bench, film, layout, interruption):
    def interrupted():
        with CaptureWriter(tmp_path / "c", bench, layout=layout) as writer:
            writer.write_group(0, film(bench)[0])
            raise interruption

    with pytest.raises(interruption):
        interrupted()
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_while_zarr_writes_on_threads_of_its_own_leaves_nothing(tmp_path, bench, monkeypatch):
    ended = threading.Event()

    def slow_create(root, **keywords):
        def write():
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.2)
            root.mkdir(parents=True)
            ended.set()

        background = threading.Thread(target=write)
        background.start()
        background.join()

    monkeypatch.setattr("gramoscope.camera.frames_zarr.zarr.create_array", slow_create)
    with pytest.raises(KeyboardInterrupt):
        CaptureWriter(tmp_path / "c", bench, layout="zarr")
    assert ended.wait(5)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_there_before_it_is_whole(tmp_path, bench, film):
    with CaptureWriter(tmp_path / "c", bench) as writer:
        for number, images in enumerate(film(bench)):
            writer.write_group(number, images)
            assert not (tmp_path / "c").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["c"]
    assert {path.name for path in (tmp_path / "c").iterdir()} == {"capture.toml", "frames", "frames.csv"}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_full_disk_is_told_and_leaves_nothing(tmp_path, bench, film, write, layout, monkeypatch):
    def full(*args, **kwargs):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(module, "write_manifest", full)
    with pytest.raises(OutputError, match="No space left"):
        write(tmp_path / "c", bench, film(bench), layout=layout)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_capture_is_replaced_only_when_asked(tmp_path, bench, film, write):
    old, new = film(bench), film(bench, seed=12)
    folder = write(tmp_path / "c", bench, old, layout="png")
    with pytest.raises(OutputError, match="a capture in"):
        write(folder, bench, new)
    np.testing.assert_array_equal(open_capture(folder).group(1).images, old[1])
    write(folder, bench, new, overwrite=True)
    np.testing.assert_array_equal(open_capture(folder).group(1).images, new[1])
    assert not list(folder.glob("frames/*.png"))
    assert [path.name for path in tmp_path.iterdir()] == ["c"]


def test_a_film_that_fails_leaves_the_old_capture(tmp_path, bench, film, write):
    folder = write(tmp_path / "c", bench, film(bench))
    with pytest.raises(ArgumentError):
        write(folder, bench, film(bench)[:, :2], overwrite=True)
    assert open_capture(folder).group(4).valid.all()
    assert [path.name for path in tmp_path.iterdir()] == ["c"]


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_folder_with_other_things_is_never_touched(tmp_path, bench, overwrite):
    (tmp_path / "thesis.txt").write_text("three years of work")
    with pytest.raises(OutputError, match="no capture"):
        CaptureWriter(tmp_path, bench, overwrite=overwrite)
    (tmp_path / "file").write_text("a file")
    with pytest.raises(OutputError, match="no capture"):
        CaptureWriter(tmp_path / "file", bench, overwrite=overwrite)
    assert (tmp_path / "thesis.txt").read_text() == "three years of work"


def test_an_empty_folder_may_be_filled(tmp_path, bench, film, write):
    (tmp_path / "c").mkdir()
    assert open_capture(write(tmp_path / "c", bench, film(bench))).group(0).valid.all()


def test_a_place_that_cannot_be_written_is_told(tmp_path, bench):
    (tmp_path / "file").write_text("a file")
    with pytest.raises(OutputError, match="cannot be written"):
        CaptureWriter(tmp_path / "file" / "c", bench)


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr"])
def test_groups_may_come_from_several_threads_in_any_order(tmp_path, bench, film, layout):
    pictures = film(bench)
    with CaptureWriter(tmp_path / "c", bench, layout=layout) as writer, ThreadPoolExecutor(3) as pool:
        list(pool.map(lambda number: writer.write_group(number, pictures[number]), [3, 1, 4, 0, 2]))
    capture = open_capture(tmp_path / "c")
    np.testing.assert_array_equal([group.images for group in capture.groups()], pictures)
    assert capture.problems == ()


def test_what_does_not_fit_the_camera_is_the_callers_mistake(tmp_path, bench, film):
    images = film(bench)[0]
    with CaptureWriter(tmp_path / "c", bench) as writer:
        writer.write_group(0, images)
        for number, wrong in [
            (0, images),
            (5, images),
            (1, images[:, :-1]),
            (1, images.astype(np.float32)),
            (1, images.astype(np.int16)),
            (1, images.astype(np.uint16) + np.uint16(300)),
            (1, np.stack([images] * 3, axis=-1)),
        ]:
            with pytest.raises(ArgumentError):
                writer.write_group(number, wrong)
        writer.write_group(1, images)


def test_a_video_needs_its_groups_in_order(tmp_path, bench, film):
    images = film(bench)[0]
    with CaptureWriter(tmp_path / "c", bench, layout="video") as writer:
        writer.write_group(0, images)
        with pytest.raises(ArgumentError, match="in order"):
            writer.write_group(2, images)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_group_that_was_never_written_is_a_lost_one(tmp_path, bench, film, layout):
    with CaptureWriter(tmp_path / "c", bench, layout=layout) as writer:
        for number, images in enumerate(film(bench)[:4]):
            writer.write_group(number, images)
    capture = open_capture(tmp_path / "c")
    assert [bool(group.valid.all()) for group in capture.groups()] == [True] * 4 + [False]


def test_images_are_not_changed(tmp_path, bench, film, write):
    pictures = film(bench)
    before = pictures.copy()
    write(tmp_path / "c", bench, pictures)
    np.testing.assert_array_equal(pictures, before)


def test_an_unknown_layout_is_named(tmp_path, bench):
    with pytest.raises(ArgumentError, match="tiff or png or zarr or video"):
        CaptureWriter(tmp_path / "c", bench, layout="gif")


def test_a_video_without_pyav_names_the_remedy_and_leaves_nothing(tmp_path, bench, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(CaptureError, match=r"pip install gramoscope\[video\]"):
        CaptureWriter(tmp_path / "c", bench, layout="video")
    assert list(tmp_path.iterdir()) == []
