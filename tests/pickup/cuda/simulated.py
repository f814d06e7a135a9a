"""Each CUDA kernel against the processor's, on tiny pictures. Run by `test_cuda` in a process that simulates CUDA."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.pickup.cuda import film_kernels
from gramoscope.pickup.cuda.ear_there import ear_there
from gramoscope.pickup.cuda.graphics_card import GraphicsCard, drawn
from gramoscope.pickup.device import Film
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.overlay import TILE_COLUMNS, TILE_ROWS, overlay_width
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.pickup.texture.filter_bank import FilterBank
from gramoscope.pickup.texture.following import REACH, channels, places_of, stepped, wide_rows
from gramoscope.pickup.texture.hearing import Ear, listen
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import TEXTURE_PX, StripeStatistics
from gramoscope.pickup.texture.reading import Model, Rules, read
from gramoscope.pickup.texture.samples import samples_of
from gramoscope.pickup.texture.spectrum import Band, filtered
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture.tone import Tone
from gramoscope.signal_path import FrameGroup

CARD = GraphicsCard("simulated")
# each is a thread of the system in the simulator
film_kernels.PAIR_THREADS = 8
HEIGHT, WIDTH, STEP_PX = 18, 90, 7.3
LOST = np.array([True, True, False, True])


def _texture(rng: np.random.Generator, rows: int, columns: int) -> FloatArray:
    return 110 + 55 * ndimage.gaussian_filter(rng.normal(size=(rows, columns)), 1.2) * 4


def _group(dtype: type, valid: np.ndarray = LOST) -> FrameGroup:
    """Frames of one texture that moves, none of them said to be where it is."""
    rng, pitch_m = np.random.default_rng(5), 0.4e-6
    ground = _texture(rng, HEIGHT, 3 * WIDTH)
    at = (np.arange(HEIGHT)[:, None], np.arange(WIDTH) + 20.0)
    seen = [ndimage.map_coordinates(ground, np.broadcast_arrays(at[0], at[1] + k * STEP_PX), order=5) for k in range(4)]
    scale = np.iinfo(dtype).max / 255
    images = np.clip(np.array(seen) * scale, 0, np.iinfo(dtype).max).astype(dtype)
    start_m = np.arange(4) * (STEP_PX + 0.4) * pitch_m
    return FrameGroup(0, images, start_m, np.zeros(4), pitch_m, int(np.iinfo(dtype).max), valid)


def _films(dtype: type, valid: np.ndarray = LOST) -> tuple[Film, Film]:
    group = _group(dtype, valid)
    return CARD.film(group), PROCESSOR.film(group)


def test_the_record_turns_as_far() -> None:
    here, there = _films(np.uint8)
    (shift, step), (shift_, step_) = CARD.frame_shifts(here), PROCESSOR.frame_shifts(there)
    np.testing.assert_allclose(shift_, [0, STEP_PX, 3 * STEP_PX], atol=0.02)
    np.testing.assert_allclose(shift, shift_, atol=1e-5)
    np.testing.assert_allclose(step, step_, atol=1e-5 * 0.4e-6)
    assert np.isnan(step).tolist() == [False, True, True]


def test_a_shift_that_cannot_be_found_is_not_believed() -> None:
    group = _group(np.uint8)
    group.images[1] = 9
    (_, step), (_, step_) = CARD.frame_shifts(CARD.film(group)), PROCESSOR.frame_shifts(PROCESSOR.film(group))
    np.testing.assert_array_equal(np.isnan(step), np.isnan(step_))


def test_one_frame_has_not_turned() -> None:
    shift, step = CARD.frame_shifts(CARD.film(_group(np.uint8, np.array([False, False, True, False]))))
    assert shift.tolist() == [0.0]
    assert np.isnan(step).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_the_picture_is_as_sharp(dtype: type) -> None:
    here, there = _films(dtype)
    shift = np.array([0.0, 7.3, 21.9])
    found = PROCESSOR.sharpness(there, shift)
    assert found.relative.max() > 0.5
    card = CARD.sharpness(here, shift)
    np.testing.assert_allclose(card.relative, found.relative, rtol=2e-4, atol=2e-5)
    assert card.typical == pytest.approx(found.typical, rel=1e-4)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_frames_are_laid_over_each_other(dtype: type) -> None:
    here, there = _films(dtype)
    shift, number = np.array([0.0, 7.3, 21.9]), np.array([0, 1, 3])
    width = overlay_width(WIDTH, shift)
    wanted = np.ones((-(-HEIGHT // TILE_ROWS), -(-width // TILE_COLUMNS)), bool)
    wanted[1, 1] = False
    laid, laid_ = (film.device.overlay(film, shift, number, wanted) for film in (here, there))
    np.testing.assert_array_equal(laid.frames, laid_.frames)
    assert np.count_nonzero(laid_.columns == 0) > 50
    np.testing.assert_allclose(CARD.part(laid.columns, slice(None)), laid_.columns, rtol=2e-6)
    np.testing.assert_allclose(CARD.part(laid.columns, slice(3, 17)), laid_.columns[3:17], rtol=2e-6)


def test_burnt_places_are_found() -> None:
    columns = np.random.default_rng(1).uniform(0, 1, (30, 10)).astype(np.float32)
    here = _kept(columns)
    for level in (0.9, 2.0):
        np.testing.assert_array_equal(CARD.places_brighter(here, level), PROCESSOR.places_brighter(columns, level))


def test_tones_are_the_same() -> None:
    columns = np.random.default_rng(1).uniform(-5, 255, (30, 10)).astype(np.float32)
    tone = Tone(90.0, 0.9)
    seen = CARD.part(CARD.in_tone(_kept(columns), tone), slice(None))
    np.testing.assert_allclose(seen, tone(columns), rtol=1e-5, atol=1e-4)
    here = _kept(columns)
    assert CARD.in_tone(here, Tone()) is here


COLUMNS, ROWS, LENGTH, HALF_PX = 48, 60, 50, 4


def _kept(columns: np.ndarray):  # type: ignore[no-untyped-def]
    from numba import cuda

    return cuda.to_device(columns)


def _ear(stripes: int = 2, channels: int = 3, filters: int = 2, band: Band | None = None) -> Ear:
    """An ear that listens for anything."""
    rng, band = np.random.default_rng(8), Band(0.03, 0.3) if band is None else band
    bins = np.arange(LENGTH // 2 + 1)[band.bins(LENGTH)].size
    return Ear(
        np.arange(stripes),
        np.arange(stripes) % 2,
        (0.02 * rng.normal(size=(stripes, wide_rows(HALF_PX), channels))).astype(np.float32),
        rng.normal(size=(stripes, channels, LANES)).astype(np.float32),
        rng.normal(size=(stripes, bins, filters, channels)).astype(np.float32),
        np.tile(np.array([1, -1], np.float32), (stripes, filters // 2)),
        rng.normal(size=stripes),
        rng.uniform(0.5, 2, stripes),
        np.ones(stripes),
        np.ones(stripes),
        np.array([1.0, -0.4, 0.2, -0.1, 0.05], np.float32),
        HALF_PX,
        band,
        LENGTH,
    )


def _listened(
    ear: Ear, picture: np.ndarray, rows: FloatArray, clear: np.ndarray, limits: tuple[float, float]
) -> tuple[FloatArray, np.ndarray]:
    """By the processor."""
    said, weight = np.empty(rows.shape), np.empty(rows.shape, np.float32)
    listen(picture, rows, clear, ear.half_px, *ear.for_listening, limits, said, weight)
    return said, weight


def _heard(ear: Ear, columns: int, clear: np.ndarray, limits: tuple[float, float]) -> tuple[tuple, tuple]:  # type: ignore[type-arg]
    picture = _texture(np.random.default_rng(3), columns, ROWS).astype(np.float32)
    # one path leaves the picture
    rows = np.array([[14.3], [51.0]]) + 3.5 * np.sin(np.arange(columns) / 9.0)
    stepped(rows, np.empty_like(rows))
    here = CARD.heard(ear, _kept(picture), rows, clear, power_limits=limits)
    return here, _listened(ear, picture, rows, clear, limits)


@pytest.mark.parametrize("band", [Band(0.03, 0.3), Band(0.0, 0.5)], ids=["some bins", "all bins"])
def test_a_stripe_says_the_same(band: Band) -> None:
    clear = np.ones((2, COLUMNS), bool)
    clear[0, 10] = False
    (said, weight), (said_, weight_) = _heard(_ear(band=band), COLUMNS, clear, (0.0, np.inf))
    assert weight_[0].max() > 0
    assert len(np.unique(weight_[0])) > 10, "the weight falls softly"
    assert weight_[1].min() == 1
    np.testing.assert_allclose(weight, weight_, atol=1e-6)
    np.testing.assert_allclose(said, said_, atol=2e-5 * np.abs(said_).max())


def test_a_window_that_is_shorter_than_the_mirror() -> None:
    (said, weight), (said_, weight_) = _heard(_ear(), 3, np.ones((2, 3), bool), (0.0, np.inf))
    np.testing.assert_allclose(weight, weight_, atol=1e-6)
    np.testing.assert_allclose(said, said_, atol=2e-5 * np.abs(said_).max())


def _weight(
    ear: Ear, picture: np.ndarray, rows: FloatArray, clear: np.ndarray, limits: tuple[float, float]
) -> np.ndarray:
    _, weight = drawn(ear_there(ear), _kept(picture), *places_of(rows, HALF_PX + REACH), clear, limits)
    return np.asarray(weight.copy_to_host())


def test_columns_without_the_usual_texture_are_left_out() -> None:
    ear, clear = _ear(stripes=1), np.ones((1, COLUMNS), bool)
    picture = _texture(np.random.default_rng(3), COLUMNS, ROWS).astype(np.float32)
    picture[:20] = 100 + 9 * (picture[:20] - 100)
    rows = np.full((1, COLUMNS), 25.25)
    assert _weight(ear, picture, rows, clear, (0.0, np.inf)).min() > 0.99999, "all are believed without limits"
    white = filtered(channels(picture, rows[0], HALF_PX, ear.basis[0]), _whitener(ear))
    halves = (white @ ear.usual[0]).reshape(COLUMNS, 2, LANES // 2)
    power = ndimage.uniform_filter1d(np.sum(halves**2, axis=2), TEXTURE_PX, axis=0, mode="nearest")
    for limits in ((0.0, 0.99 * power[:, 1].max()), (1.01 * power[:, 0].min(), np.inf)):
        weight = _weight(ear, picture, rows, clear, limits)
        _, weight_ = _listened(ear, picture, rows, clear, limits)
        assert 0 < weight_[0].mean() < 0.99, "some are left out"
        np.testing.assert_allclose(weight, weight_, atol=1e-6)


def _whitener(ear: Ear) -> FloatArray:
    return np.concatenate([ear.half_taps[:0:-1], ear.half_taps]).astype(np.float64)


def _model(layout: StripeLayout, tone: Tone) -> Model:
    ear = _ear()
    banks = [
        FilterBank(ear.basis[i, : wide_rows(HALF_PX)], ear.filters[i], ear.sign[i], 0.1 * ear.usual[i]) for i in (0, 1)
    ]
    stripes = tuple(StripeStatistics(bank, 4.0, 9.0, 0.0, np.ones(9), 1e4) for bank in banks)
    return Model(layout, tone, _whitener(ear), HALF_PX, ear.band, LENGTH, stripes)


def test_a_stretch_is_read_alike_within_a_thousandth_of_its_error() -> None:
    height = 80
    layout = StripeLayout(
        np.array([20.3, 61.6]), np.array([OUTER, INNER]), np.zeros(2), np.full(2, height - 1.0), 41.0, 100.0
    )
    picture = _texture(np.random.default_rng(4), COLUMNS, height).astype(np.float32)
    start = np.tile(np.sin(np.arange(COLUMNS) / 11.0), (2, 1))
    nothing = np.empty((0, 2), np.int64)
    there = Stretch(picture, np.ones(COLUMNS, bool), nothing, start, np.ones((2, COLUMNS)))
    here = replace(there, columns=_kept(picture), device=CARD)
    models, rules = [_model(layout, Tone(110.0, 0.9))], Rules(power_limits=(0.0, np.inf), most_local_surprise=1e9)
    found, found_ = (samples_of(*read(one, models, "lateral", rules), rules) for one in (here, there))
    assert np.isfinite(found_[1]).all()
    assert np.abs(found_[0] - start[:, 3:-1:8][:, : found_[0].shape[1]]).max() > 0.1, "paths were moved"
    np.testing.assert_allclose(found[1], found_[1], rtol=1e-3)
    assert np.max(np.abs(found[0] - found_[0]) / found_[1]) < 1e-3
