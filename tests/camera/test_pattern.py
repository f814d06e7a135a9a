from pathlib import Path

import pytest

from gramoscope.camera.pattern import FramePattern, is_inside, require_inside
from gramoscope.errors import ArgumentError


@pytest.mark.parametrize(
    ("text", "layout"),
    [
        ("frames/g{group:06d}.tif", "tiff"),
        ("g{group}.ome.TIFF", "tiff"),
        ("frames/g{group:06d}_f{frame:02d}.png", "images"),
        ("f{frame}/g{group:4d}.tif", "images"),
        ("x{group:03}{frame}.JPEG", "images"),
        ("frames.zarr", "zarr"),
        ("film.v2.mkv", "video"),
    ],
)
def test_the_pattern_tells_the_layout(text, layout):
    assert FramePattern(text).layout == layout


@pytest.mark.parametrize(
    "text",
    [
        "frames/g{number}.tif",
        "frames/g{group!r}.tif",
        "frames/g{group:s}.tif",
        "frames/g{group:999999d}.tif",
        "frames/g{group.real}.tif",
        "frames/g{}.tif",
        "frames/g{group.tif",
        "g{group}.txt",
        "g{group}.png",
        "g{group}.mkv",
        "../g{group}.tif",
        "a/../../g{group}.tif",
        "/g{group}.tif",
        "C:\\g{group}.tif",
        "..\\g{group}.tif",
        "",
        "a\0{group}.tif",
    ],
)
def test_any_other_pattern_is_an_error(text):
    with pytest.raises(ArgumentError):
        FramePattern(text)


def test_groups_that_share_a_file_are_an_error():
    FramePattern("only.tif").require_distinct(groups=1)
    FramePattern("film.mkv").require_distinct(groups=3)
    with pytest.raises(ArgumentError, match=r"\{group\} in it"):
        FramePattern("only.tif").require_distinct(groups=3)


def test_numbers_are_put_into_the_path():
    pattern = FramePattern("frames/g{group:06d}_f{frame:02d}.png")
    assert pattern.path(Path("here"), group=41, frame=7) == Path("here/frames/g000041_f07.png")


def test_a_name_with_dots_is_no_way_out():
    require_inside("frames/..strange..name.csv")


def test_a_link_out_of_the_folder_is_seen(tmp_path):
    inside, outside = tmp_path / "capture", tmp_path / "elsewhere"
    inside.mkdir()
    outside.mkdir()
    (inside / "link").symlink_to(outside)
    assert not is_inside(inside / "link" / "g.tif", inside)
    assert is_inside(inside / "frames" / "g.tif", inside)
