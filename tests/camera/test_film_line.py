"""Frames that lie apart are read where they lie, and say the same as frames that lie together."""

import numpy as np
import numpy.typing as npt
import pytest
from numpy.lib.stride_tricks import as_strided

from gramoscope.camera.exposure import Exposure
from gramoscope.camera.film_line import film_line
from gramoscope.camera.frames import Frame, Lost, as_they_lie
from gramoscope.camera.sensor import Sensor
from gramoscope.pickup.overlay import overlay
from gramoscope.pickup.registration import frame_shifts
from gramoscope.pickup.texture.sharpness import sharpness
from gramoscope.signal_path import FrameGroup

SENSOR = Sensor(width_px=80, height_px=40)
GAP = 24


def _apart(images: npt.NDArray[np.uint8], gap: int = GAP) -> list[npt.NDArray[np.uint8]]:
    """The frames of a film, one after the other in one array of bytes, with noise between them."""
    rng, size = np.random.default_rng(5), images[0].size
    room = rng.integers(0, 255, len(images) * (size + gap)).astype(np.uint8)
    frames = [room[k * (size + gap) :][:size].reshape(images[0].shape) for k in range(len(images))]
    for frame, image in zip(frames, images, strict=True):
        frame[:] = image
    return frames


def _film(frames: int = 4) -> npt.NDArray[np.uint8]:
    rng = np.random.default_rng(3)
    wide = np.cumsum(rng.normal(size=(40, 120)), axis=1)
    wide = 128 + 40 * wide / np.abs(wide).max() + 20 * rng.normal(size=(40, 120))
    return np.stack([wide[:, 3 * k : 3 * k + 80] for k in range(frames)]).clip(0, 255).astype(np.uint8)


def test_frames_of_one_file_are_not_copied() -> None:
    images = _film()
    frames = _apart(images)
    found = as_they_lie(frames, sensor=SENSOR)
    assert found is not None
    np.testing.assert_array_equal(found, images)
    assert np.shares_memory(found, frames[2])
    assert found.strides == (80 * 40 + GAP, 80, 1)


@pytest.mark.parametrize(
    ("frames", "sensor"),
    [
        ([*_apart(_film())[:3], Lost("the file ends")], SENSOR),
        ([_apart(_film())[k] for k in (0, 2, 1)], SENSOR),
        (_apart(_film())[::-1], SENSOR),
        ([frame.copy() for frame in _film()], SENSOR),
        ([frame.astype(np.uint16) for frame in _apart(_film())], SENSOR),
        (_apart(_film()), Sensor(width_px=80, height_px=40, columns="backward")),
        (_apart(_film()), Sensor(width_px=80, height_px=40, rows="outward")),
        (_apart(_film()), Sensor(width_px=80, height_px=42)),
        (_apart(_film()), Sensor(width_px=80, height_px=40, bits=12)),
        ([], SENSOR),
    ],
    ids=["lost", "uneven", "backwards", "copies", "type", "columns", "rows", "size", "bits", "none"],
)
def test_frames_that_have_to_be_made_are(frames: list[Frame | Lost], sensor: Sensor) -> None:
    assert as_they_lie(frames, sensor=sensor) is None


def test_frames_of_two_files_do_not_lie_together() -> None:
    one, other = _apart(_film(2)), _apart(_film(2))
    assert as_they_lie([one[0], other[1]], sensor=SENSOR) is None


@pytest.mark.parametrize("gap", [0, GAP])
def test_pixels_of_a_line_are_those_of_the_film(gap: int) -> None:
    images = _film()
    found = as_they_lie(_apart(images, gap), sensor=SENSOR)
    assert found is not None
    line, step = film_line(found)
    assert step == 40 * 80 + gap
    assert line.size == 3 * step + 40 * 80
    assert not line.flags.writeable
    for k, row, column in ((0, 0, 0), (1, 7, 79), (3, 39, 79)):
        assert line[k * step + row * 80 + column] == images[k, row, column]


def test_a_film_whose_pixels_lie_apart_is_copied_into_a_line() -> None:
    images = _film()
    for odd in (images[:, ::-1], images[:, :, ::2], images.transpose(0, 2, 1), as_strided(images, strides=(0, 80, 1))):
        line, step = film_line(odd)
        assert step == odd[0].size
        np.testing.assert_array_equal(line.reshape(odd.shape), odd)


def test_the_pickup_sees_the_same_in_frames_that_lie_apart() -> None:
    images = _film()
    together = FrameGroup(0, images, 3e-6 * np.arange(4), np.zeros(4), 1e-6, 255, np.ones(4, np.bool_))
    lying = as_they_lie(_apart(images), sensor=SENSOR)
    assert lying is not None
    apart = FrameGroup(0, lying, together.arc_start_m, together.stage_m, 1e-6, 255, together.valid)
    shift_px = frame_shifts(together)[0]
    np.testing.assert_allclose(shift_px, 3.0 * np.arange(4), atol=0.2)
    np.testing.assert_array_equal(frame_shifts(apart)[0], shift_px)
    np.testing.assert_array_equal(sharpness(apart.images, shift_px).relative, sharpness(images, shift_px).relative)
    np.testing.assert_array_equal(
        overlay(apart.images, shift_px, np.arange(4)).columns, overlay(images, shift_px, np.arange(4)).columns
    )
    assert Exposure().sort_out(apart)[0].valid.all()
