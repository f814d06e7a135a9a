"""Whatever way a film is kept, the player sees the same frames."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import tifffile
import zarr
from PIL import Image

from gramoscope.apparatus.capture import open_capture
from gramoscope.apparatus.manifest import write_manifest
from gramoscope.conventions import mirror

LAYOUTS = ("tiff", "png", "zarr", "video")


def assert_shows(capture, pictures):
    for group, images in zip(capture.groups(), pictures, strict=True):
        np.testing.assert_array_equal(group.images, images)
        assert all(image.flags.c_contiguous for image in group.images)
        assert group.valid.all()
        assert group.problems == ()


def with_camera(bench, **camera):
    return replace(bench, sensor=replace(bench.sensor, **camera))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("colour", "bits"), list(product(["mono", "rgb"], [8, 12, 16])))
def test_every_layout_gives_the_same_grey_picture(tmp_path, bench, film, write, layout, colour, bits):
    bench = with_camera(bench, colour=colour, bits=bits, columns="backward")
    pictures = film(bench)
    capture = open_capture(write(tmp_path / "c", bench, pictures, layout=layout))
    assert_shows(capture, pictures)
    assert capture.bench == bench
    assert capture.group(2).white_level == 2**bits - 1
    assert capture.group(2).images.dtype == (np.uint8 if bits == 8 else np.uint16)
    assert capture.layout == {"png": "images"}.get(layout, layout)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize(("columns", "rows"), list(product(["forward", "backward"], ["inward", "outward"])))
def test_a_mirrored_film_gives_the_same_picture_and_the_same_bench(tmp_path, bench, film, write, layout, columns, rows):
    bench = with_camera(bench, columns=columns, rows=rows)
    pictures = film(bench)
    capture = open_capture(write(tmp_path / "c", bench, pictures, layout=layout))
    assert_shows(capture, pictures)
    assert capture.bench.glass_edge_row == 29.3
    assert capture.bench.cover_glass.side == "low"


@pytest.mark.parametrize("layout", ["tiff", "png", "zarr"])
def test_a_compressed_film_gives_the_same_picture(tmp_path, bench, film, write, layout):
    pictures = film(bench)
    assert_shows(open_capture(write(tmp_path / "c", bench, pictures, layout=layout, compress=True)), pictures)


def test_mirrored_pictures_lie_mirrored_on_disk(tmp_path, bench, film, write):
    pictures = film(bench)
    folder = write(tmp_path / "c", with_camera(bench, columns="backward", rows="outward"), pictures)
    stored = tifffile.imread(folder / "frames" / "g000003.tif")
    np.testing.assert_array_equal(stored[:, ::-1, ::-1], pictures[3])


def test_colours_become_their_mean(tmp_path, bench, write):
    bench = with_camera(bench, colour="rgb", rows="outward")
    sensor, sequence = bench.sensor, bench.sequence
    shape = (sequence.groups, sequence.frames_per_group, sensor.height_px, sensor.width_px, 3)
    colours = np.random.default_rng(2).integers(0, 256, shape).astype(np.uint8)
    grey = np.floor(colours.mean(axis=-1, dtype=np.float64) + 0.5).astype(np.uint8)
    for layout in LAYOUTS:
        assert_shows(open_capture(write(tmp_path / layout, bench, colours, layout=layout)), grey)


@pytest.fixture
def place(tmp_path, bench):
    """Write a manifest for frames that the test puts there itself; return the folder."""

    def place(frames, **camera):
        (tmp_path / "frames").mkdir(exist_ok=True)
        write_manifest(tmp_path / "capture.toml", with_camera(bench, **camera), frames=frames)
        return tmp_path

    return place


@pytest.mark.parametrize(
    "options",
    [
        {"bigtiff": True},
        {"ome": True},
        {"imagej": True},
        {"byteorder": ">"},
        {"compression": "zlib"},
        {"compression": "zlib", "predictor": True},
        {"photometric": "miniswhite"},
        {"rowsperstrip": 7},
        {"tile": (32, 48)},
    ],
    ids=str,
)
@pytest.mark.parametrize("bits", [8, 16])
def test_tiffs_of_many_kinds_are_read(place, bench, film, options, bits):
    folder = place("frames/g{group:d}.tif", bits=bits)
    pictures = film(with_camera(bench, bits=bits))
    for number, images in enumerate(pictures):
        stored = 2**bits - 1 - images if options.get("photometric") == "miniswhite" else images
        tifffile.imwrite(folder / "frames" / f"g{number}.tif", stored, **{"photometric": "minisblack"} | options)
    assert_shows(open_capture(folder), pictures)


@pytest.mark.parametrize("compression", ["tiff_lzw", "packbits"])
def test_tiffs_that_need_another_decoder_are_read(place, bench, film, compression):
    folder, pictures = place("frames/g{group:d}.tif"), film(bench)
    for number, images in enumerate(pictures):
        first, *others = [Image.fromarray(image) for image in images]
        first.save(folder / "frames" / f"g{number}.tif", compression=compression, save_all=True, append_images=others)
    assert_shows(open_capture(folder), pictures)


@pytest.mark.parametrize(
    "options", [{"planarconfig": "separate", "photometric": "rgb"}, {"ome": True}, {"imagej": True}], ids=str
)
def test_colours_on_planes_of_their_own_are_put_together(place, bench, film, options):
    folder, pictures = place("frames/g{group:d}.tif", colour="rgb"), film(bench).clip(3, 250)
    for number, images in enumerate(pictures):
        planes = np.stack([images - 3, images, images + 3], axis=1)
        axes = {"metadata": {"axes": "TCYX"}} if "photometric" not in options else {}
        kind = {"photometric": "minisblack"} | options
        tifffile.imwrite(folder / "frames" / f"g{number}.tif", planes, **kind, **axes)
    assert_shows(open_capture(folder), pictures)


@pytest.mark.parametrize("suffix", ["tif", "png", "bmp"])
@pytest.mark.parametrize("colour", ["mono", "rgb"])
def test_pictures_of_many_kinds_are_read(place, bench, film, suffix, colour):
    folder = place(f"frames/{{group:02d}}-{{frame}}.{suffix}", colour=colour)
    pictures = film(bench)
    for number, frame in np.ndindex(pictures.shape[:2]):
        image = Image.fromarray(pictures[number, frame])
        path = folder / "frames" / f"{number:02d}-{frame}.{suffix}"
        (image.convert("RGB") if colour == "rgb" else image).save(path)
    assert_shows(open_capture(folder), pictures)


@pytest.mark.parametrize("mode", ["RGBA", "LA", "P"])
def test_opacity_and_palettes_do_no_harm(place, bench, film, mode):
    folder, pictures = place("frames/{group}-{frame}.png"), film(bench)
    for number, frame in np.ndindex(pictures.shape[:2]):
        Image.fromarray(pictures[number, frame]).convert(mode).save(folder / "frames" / f"{number}-{frame}.png")
    assert_shows(open_capture(folder), pictures)


def test_a_jpeg_is_read_as_well_as_it_was_kept(place, bench):
    folder = place("frames/{group}-{frame}.jpg")
    smooth = np.add.outer(np.arange(46), np.arange(71)).astype(np.uint8)
    for number, frame in np.ndindex(5, 3):
        Image.fromarray(smooth).save(folder / "frames" / f"{number}-{frame}.jpg", quality=95)
    assert np.abs(open_capture(folder).group(3).images.astype(int) - smooth).max() <= 3


def test_an_ome_zarr_with_channels_is_read(place, bench, film):
    folder, pictures = place("frames.zarr", columns="backward"), film(bench).clip(3, 250)
    group = zarr.create_group(folder / "frames.zarr")
    axes = [{"name": name} for name in "tczyx"]
    group.attrs["ome"] = {"version": "0.5", "multiscales": [{"axes": axes, "datasets": [{"path": "full/size"}]}]}
    stored = mirror(pictures.reshape(-1, 46, 71), columns="backward", rows="inward")
    array = group.create_array("full/size", shape=(15, 3, 1, 46, 71), chunks=(4, 1, 1, 46, 40), dtype="uint8")
    array[:] = np.stack([stored, stored - 2, stored + 2], axis=1)[:, :, np.newaxis]
    assert_shows(open_capture(folder), pictures)


@pytest.mark.parametrize("nested", [False, True])
def test_a_plain_zarr_array_is_read(place, bench, film, nested):
    folder, pictures = place("frames.zarr"), film(bench)
    store = zarr.create_group(folder / "frames.zarr") if nested else folder / "frames.zarr"
    options = {"shape": (15, 46, 71), "chunks": (4, 20, 71), "dtype": "uint8"}
    array = store.create_array("any", **options) if nested else zarr.create_array(store, **options)
    array[:] = pictures.reshape(-1, 46, 71)
    assert_shows(open_capture(folder), pictures)


def test_one_group_may_lie_in_a_file_without_a_number(tmp_path, bench, film):
    bench = replace(bench, sequence=replace(bench.sequence, groups=1))
    write_manifest(tmp_path / "capture.toml", bench, frames="only.tif")
    pictures = film(bench)
    tifffile.imwrite(tmp_path / "only.tif", pictures[0], photometric="minisblack")
    assert_shows(open_capture(tmp_path), pictures)
