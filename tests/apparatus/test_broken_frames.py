"""What the world does to frames is told, and the rest is read."""

import shutil
import struct
import warnings
from dataclasses import replace

import numpy as np
import pytest
import tifffile
import zarr

from gramoscope.apparatus.capture import open_capture, spans
from gramoscope.errors import ArgumentError, CaptureError, ManifestError, NoFramesError


def lost_frames(group):
    assert not group.images[~group.valid].any()
    return np.flatnonzero(~group.valid).tolist()


def others_are_whole(capture, pictures, *, but):
    for number in set(range(len(pictures))) - {but}:
        group = capture.group(number)
        np.testing.assert_array_equal(group.images, pictures[number])
        assert group.problems == ()
    return True


@pytest.fixture
def filmed(tmp_path, bench, film, write):
    """Return a capture's folder and what it shows."""

    def filmed(layout="tiff", **camera):
        mine = replace(bench, sensor=replace(bench.sensor, **camera))
        pictures = film(mine)
        return write(tmp_path / "c", mine, pictures, layout=layout), pictures

    return filmed


def test_a_missing_group_is_flagged(filmed):
    folder, pictures = filmed()
    (folder / "frames" / "g000002.tif").unlink()
    capture = open_capture(folder)
    group = capture.group(2)
    assert lost_frames(group) == [0, 1, 2]
    assert group.problems == ("frames 0 … 2: g000002.tif is missing",)
    assert others_are_whole(capture, pictures, but=2)


@pytest.mark.parametrize("compress", [False, True])
def test_a_truncated_frame_is_flagged_and_the_rest_is_read(tmp_path, bench, film, write, compress, capfd):
    pictures = film(bench)
    folder = write(tmp_path / "c", bench, pictures, compress=compress)
    path = folder / "frames" / "g000001.tif"
    path.write_bytes(path.read_bytes()[:-1000])
    capture = open_capture(folder)
    group = capture.group(1)
    assert lost_frames(group) == [2]
    np.testing.assert_array_equal(group.images[:2], pictures[1, :2])
    assert len(group.problems) == 1
    assert others_are_whole(capture, pictures, but=1)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("kept", [0, 3, 8, 100, 1000, 3000])
@pytest.mark.parametrize("layout", ["tiff", "png"])
def test_no_length_of_a_truncated_file_raises(filmed, layout, kept, capfd):
    folder, pictures = filmed(layout)
    path = next((folder / "frames").glob("g000003*"))
    path.write_bytes(path.read_bytes()[:kept])
    capture = open_capture(folder)
    group = capture.group(3)
    lost = lost_frames(group)
    assert lost
    assert group.problems
    np.testing.assert_array_equal(group.images[group.valid], pictures[3][group.valid])
    assert others_are_whole(capture, pictures, but=3)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr", "video"])
def test_noise_instead_of_a_file_never_raises(filmed, layout, capfd):
    folder, pictures = filmed(layout)
    files = [p for p in sorted(folder.rglob("*")) if p.is_file() and p.suffix in (".tif", ".png", ".mkv", "")]
    path = files[len(files) // 2]
    data = bytearray(path.read_bytes())
    rng = np.random.default_rng(4)
    middle = len(data) // 2
    data[middle : middle + 300] = rng.bytes(300)
    path.write_bytes(data)
    shown = list(open_capture(folder).groups())
    assert capfd.readouterr() == ("", "")
    for group, images in zip(shown, pictures, strict=True):
        if layout == "png":  # it carries checksums; the others cannot know
            np.testing.assert_array_equal(group.images[group.valid], images[group.valid])


def test_a_frame_of_the_wrong_size_is_flagged(filmed):
    folder, pictures = filmed()
    with tifffile.TiffWriter(folder / "frames" / "g000004.tif") as tiff:
        tiff.write(pictures[4, 0], photometric="minisblack", metadata=None)
        tiff.write(pictures[4, 1, :-1], photometric="minisblack", metadata=None)
        tiff.write(pictures[4, 2], photometric="minisblack", metadata=None)
    capture = open_capture(folder)
    group = capture.group(4)
    assert lost_frames(group) == [1]
    assert "71 × 45 pixels, needed 71 × 46" in group.problems[0]
    np.testing.assert_array_equal(group.images[[0, 2]], pictures[4, [0, 2]])


def test_a_picture_file_of_the_wrong_size_is_flagged(filmed):
    folder, _ = filmed("png")
    from gramoscope.camera.frames_image import write_png

    write_png(folder / "frames" / "g000001_f02.png", np.full((20, 30), 9, np.uint8))
    group = open_capture(folder).group(1)
    assert lost_frames(group) == [2]
    assert group.problems == ("frame 2: 30 × 20 pixels, needed 71 × 46",)


@pytest.mark.parametrize(("pages", "lost", "word"), [(2, [2], "ends after 2 of 3"), (4, [], "more than 3 frames")])
def test_a_wrong_number_of_pages_is_told(filmed, pages, lost, word):
    folder, pictures = filmed()
    stored = np.concatenate([pictures[0], pictures[1]])[:pages]
    tifffile.imwrite(folder / "frames" / "g000000.tif", stored, photometric="minisblack", metadata=None)
    group = open_capture(folder).group(0)
    assert lost_frames(group) == lost
    assert word in group.problems[0]


def test_a_missing_picture_is_flagged(filmed):
    folder, pictures = filmed("png")
    (folder / "frames" / "g000002_f01.png").unlink()
    group = open_capture(folder).group(2)
    assert lost_frames(group) == [1]
    np.testing.assert_array_equal(group.images[[0, 2]], pictures[2, [0, 2]])


def test_pixels_that_are_no_whole_numbers_are_flagged(filmed):
    folder, pictures = filmed()
    stored = pictures[1].astype(np.float32)
    tifffile.imwrite(folder / "frames" / "g000001.tif", stored, photometric="minisblack")
    assert "float32" in open_capture(folder).group(1).problems[0]


def test_a_file_that_claims_to_be_enormous_is_not_decoded(filmed):
    folder, _ = filmed("png")
    path = folder / "frames" / "g000001_f00.png"
    data = bytearray(path.read_bytes())
    data[16:24] = struct.pack(">II", 2**30, 2**30)
    path.write_bytes(data)
    assert lost_frames(open_capture(folder).group(1)) == [0]


def test_eight_bits_in_a_capture_of_twelve_are_scaled_and_told(filmed):
    folder, pictures = filmed(bits=12)
    stored = (pictures[2] >> 4).astype(np.uint8)
    tifffile.imwrite(folder / "frames" / "g000002.tif", stored, photometric="minisblack")
    group = open_capture(folder).group(2)
    assert group.valid.all()
    assert "8 bits where capture.toml says 12" in group.problems[0]
    assert np.abs(group.images.astype(int) - pictures[2]).max() <= 16


def test_a_group_that_was_never_written_to_zarr_is_missing_and_a_black_one_is_not(tmp_path, bench, film, write):
    pictures = film(bench)
    pictures[3] = 0
    folder = write(tmp_path / "c", bench, pictures, layout="zarr")
    shutil.rmtree(folder / "frames.zarr" / "c" / "1")
    capture = open_capture(folder)
    assert lost_frames(capture.group(1)) == [0, 1, 2]
    assert "never written" in capture.group(1).problems[0]
    assert capture.group(3).valid.all()


def test_a_zarr_that_ends_early_is_told(filmed):
    folder, pictures = filmed("zarr")
    zarr.open(folder / "frames.zarr", mode="r+").resize((10, 46, 71))
    capture = open_capture(folder)
    assert lost_frames(capture.group(3)) == [1, 2]
    assert lost_frames(capture.group(4)) == [0, 1, 2]
    np.testing.assert_array_equal(capture.group(2).images, pictures[2])


def test_a_zarr_of_another_size_is_told(filmed):
    folder, _ = filmed("zarr")
    zarr.create_array(folder / "frames.zarr", shape=(15, 40, 71), chunks=(1, 40, 71), dtype="uint8", overwrite=True)[
        :
    ] = 9
    group = open_capture(folder).group(0)
    assert lost_frames(group) == [0, 1, 2]
    assert "71 × 40 pixels, needed 71 × 46" in group.problems[0]


def test_a_truncated_video_plays_as_far_as_it_goes(filmed, capfd):
    folder, pictures = filmed("video")
    path = folder / "frames.mkv"
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    shown = list(open_capture(folder).groups())
    assert capfd.readouterr() == ("", "")
    np.testing.assert_array_equal(shown[0].images, pictures[0])
    np.testing.assert_array_equal(shown[1].images, pictures[1])
    assert lost_frames(shown[4]) == [0, 1, 2]
    assert shown[4].problems == ("frames 0 … 2: the file ends after 0 of 3 frames",)


def test_a_hole_in_a_video_moves_no_frame_out_of_its_place(filmed, capfd):
    folder, pictures = filmed("video")
    path = folder / "frames.mkv"
    data = bytearray(path.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 5000] = bytes(5000)  # longer than a frame: the packet after it is swallowed without a word
    path.write_bytes(data)
    shown = list(open_capture(folder).groups())
    assert lost_frames(shown[2])
    for number in (0, 1, 3, 4):
        np.testing.assert_array_equal(shown[number].images[shown[number].valid], pictures[number][shown[number].valid])
    assert shown[4].valid.all()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr", "video"])
def test_no_frames_at_all_is_an_error(filmed, layout):
    folder, _ = filmed(layout)
    for path in (*folder.glob("frames*/*"), *folder.glob("frames.mkv")):
        if path.name != "zarr.json":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    with pytest.raises(NoFramesError, match="not one frame"):
        open_capture(folder)


@pytest.mark.parametrize("layout", ["zarr", "video"])
def test_something_else_under_the_name_of_the_frames_is_an_error(filmed, layout):
    folder, _ = filmed(layout)
    path = next(folder.glob("frames.[mz]*"))
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    path.mkdir() if layout == "zarr" else path.write_text("not a video")
    with pytest.raises(NoFramesError, match=r"frames\."):
        open_capture(folder)


def test_an_empty_folder_is_an_error(tmp_path):
    with pytest.raises(CaptureError, match=r"no capture\.toml"):
        open_capture(tmp_path)


def test_a_group_that_is_not_there_is_the_callers_mistake(filmed):
    folder, _ = filmed()
    for number in (-1, 5):
        with pytest.raises(ArgumentError, match=f"group {number}"):
            open_capture(folder).group(number)


def test_frames_or_a_log_that_lie_elsewhere_are_an_error(filmed, tmp_path):
    folder, _ = filmed()
    elsewhere = tmp_path / "elsewhere"
    (folder / "frames").rename(elsewhere)
    (folder / "frames").symlink_to(elsewhere)
    with pytest.raises(ManifestError, match="leads out of the capture"):
        open_capture(folder)


def test_a_single_frame_that_lies_elsewhere_is_not_read(filmed, tmp_path):
    folder, _ = filmed()
    path = folder / "frames" / "g000002.tif"
    path.rename(tmp_path / "secret.tif")
    path.symlink_to(tmp_path / "secret.tif")
    group = open_capture(folder).group(2)
    assert lost_frames(group) == [0, 1, 2]
    assert "outside the folder" in group.problems[0]


def test_a_video_without_pyav_names_the_remedy(filmed, monkeypatch):
    folder, _ = filmed("video")
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(CaptureError, match=r"pip install gramoscope\[video\]"):
        open_capture(folder)


def test_the_users_own_warnings_stay_as_they_were(filmed, caplog):
    folder, _ = filmed()
    path = folder / "frames" / "g000001.tif"
    path.write_bytes(path.read_bytes()[:-1000])
    before = list(warnings.filters)
    open_capture(folder).group(1)
    assert warnings.filters == before
    assert not caplog.records
    tifffile.logger().warning("the user's own")
    assert [record.message for record in caplog.records] == ["the user's own"]


@pytest.mark.parametrize(
    ("numbers", "words"), [([4], "frame 4"), ([0, 1], "frames 0 … 1"), ([0, 2, 3, 4, 9], "frames 0, 2 … 4, 9")]
)
def test_frames_are_named_in_few_words(numbers, words):
    assert spans(numbers) == words
