"""Splicing: how the head of a stretch lies on the tail of the one before, and the errors that must not pile up."""

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.quality import Quality
from gramoscope.signal_path import Texture, WallTrace
from gramoscope.simulation.render import cut_passage, filmed_group, noise_free_strip
from gramoscope.simulation.scene import Scene, filming_bench
from gramoscope.tonearm.splice import Match, Splice, correlate_strips, lagrange, lattice_peak

PITCH_M = 0.4e-6
SPLICE = Splice(encoder_sigma_m=2e-6)


def _record(rows: int = 60) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    return np.abs(rng.normal(0, 0.5, (rows, 40))), rng.uniform(0, 2 * np.pi, (rows, 40))


def _strip(start_px: float, *, width: int = 143, lower_px: int = 0, stage_m: float = 0.0, nominal_px: float) -> Texture:
    """A window of a texture that is known at every place; `lower_px` rows further down in the picture."""
    frequency, phase = _record()
    columns = start_px + np.arange(width)
    picture = np.cos(frequency[:, :, None] * columns + phase[:, :, None]).sum(axis=1)
    strip = np.roll(np.pad(picture, ((10, 10), (0, 0))), lower_px, axis=0)
    return Texture(strip.astype(np.float32), nominal_px * PITCH_M, PITCH_M, stage_m)


@pytest.mark.parametrize("error_px", [0.0, 0.35, -3.61, 7.5, -14.2])
@pytest.mark.parametrize("nominal_px", [40.0, 61.3])
def test_the_error_of_the_step_is_found_to_a_twentieth_of_a_pixel(error_px: float, nominal_px: float) -> None:
    tail, head = (
        _strip(5000.0, nominal_px=5000.0),
        _strip(5000.0 + nominal_px + error_px, nominal_px=5000.0 + nominal_px),
    )
    match = SPLICE.match(tail, head)
    assert match.error_m / PITCH_M == pytest.approx(error_px, abs=0.05)
    assert match.correlation > 0.9


def test_a_groove_that_moved_a_little_in_the_picture_is_still_recognised() -> None:
    tail, head = _strip(0.0, nominal_px=0.0), _strip(51.2, nominal_px=50.0, lower_px=2)
    assert SPLICE.match(tail, head).error_m / PITCH_M == pytest.approx(1.2, abs=0.05)
    assert np.isnan(SPLICE.match(tail, replace(head, strip=np.roll(head.strip, 4, axis=0))).error_m)


def test_a_move_of_the_stage_is_known_and_allowed_for() -> None:
    # the microscope moved inwards by 9 rows, so the groove moved outwards, to smaller rows, in the picture
    tail, head = _strip(0.0, nominal_px=0.0), _strip(51.2, nominal_px=50.0, lower_px=-9, stage_m=9 * PITCH_M)
    assert SPLICE.match(tail, head).error_m / PITCH_M == pytest.approx(1.2, abs=0.05)
    other_way = replace(head, stage_m=-9 * PITCH_M)
    assert np.isnan(SPLICE.match(tail, other_way).error_m)


def test_strips_that_have_nothing_in_common_are_no_match() -> None:
    tail, rng = _strip(0.0, nominal_px=0.0), np.random.default_rng(4)
    head = replace(tail, strip=rng.normal(size=tail.strip.shape).astype(np.float32), arc_start_m=20e-6)
    assert np.isnan(SPLICE.match(tail, head).error_m)
    blank = replace(head, strip=np.zeros_like(tail.strip))
    assert np.isnan(SPLICE.match(tail, blank).error_m)


def test_a_match_at_the_end_of_the_reach_or_with_hardly_an_overlap_is_not_believed() -> None:
    far = _strip(50.0 + 22.0, nominal_px=50.0)
    assert np.isnan(Splice(reach_m=21.8 * PITCH_M).match(_strip(0.0, nominal_px=0.0), far).error_m)
    assert np.isnan(SPLICE.match(_strip(0.0, nominal_px=0.0), _strip(135.0, nominal_px=135.0)).error_m)


def test_rendered_overlaps_are_matched_to_a_twentieth_of_a_pixel() -> None:
    bench = filming_bench(height_px=430)
    bench = replace(bench, sensor=replace(bench.sensor, width_px=208))
    bench = replace(bench, sequence=replace(bench.sequence, groups=2, frames_per_group=1, group_step_m=55.3e-6))
    scene, pitch_m = Scene(bench, seed=3), bench.sensor.pixel_pitch_m
    passage = cut_passage(np.sin(np.arange(4000) * 0.12), rate_hz=48_000.0, scene=scene)
    strips = []
    for number in range(2):
        picture, first = noise_free_strip(scene, passage, filmed_group(scene, number))
        strips.append(Texture(np.gradient(picture, axis=1).astype(np.float32), first * pitch_m, pitch_m))
    strips[1] = replace(strips[1], arc_start_m=strips[1].arc_start_m - 1.3e-6)
    match = SPLICE.match(*strips)
    assert match.error_m / pitch_m == pytest.approx(1.3e-6 / pitch_m, abs=0.05)


def test_the_correlation_of_strips_is_that_of_their_overlap() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(7, 19)).astype(np.float32), rng.normal(size=(7, 15)).astype(np.float32)
    score = correlate_strips(a, b, np.array([6, -4, 40]), np.array([-2, 3]), 5, np.arange(7))
    p, q = a[:5, 6:], b[2:, :13]
    assert score[0, 0] == pytest.approx((p * q).sum() / np.sqrt((p**2).sum() * (q**2).sum()), rel=1e-5)
    p, q = a[3:, :11], b[:4, 4:]
    assert score[1, 1] == pytest.approx((p * q).sum() / np.sqrt((p**2).sum() * (q**2).sum()), rel=1e-5)
    np.testing.assert_array_equal(score[:, 2], 0)


def test_only_the_rows_asked_for_are_compared() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(7, 19)).astype(np.float32), rng.normal(size=(7, 15)).astype(np.float32)
    some = correlate_strips(a, b, np.array([2]), np.array([1]), 5, np.array([0, 3, 6]))
    p, q = a[[3, 6], 2:17], b[[2, 5], :15]
    assert some[0, 0] == pytest.approx((p * q).sum() / np.sqrt((p**2).sum() * (q**2).sum()), rel=1e-5)


@pytest.mark.parametrize("place", [-0.5, -0.2, 0.0, 0.37])
def test_lagranges_weights_are_those_of_the_polynomial(place: float) -> None:
    nodes = np.arange(-3, 4)
    cubic = np.polynomial.Polynomial([0.3, -1.1, 0.7, 2.0])
    for order, weights in enumerate(lagrange(3, place)):
        expected = cubic.deriv(order)(place) if order else cubic(place)
        assert weights @ cubic(nodes) == pytest.approx(expected)


@pytest.mark.parametrize("row", [-0.45, 0.0, 0.31])
@pytest.mark.parametrize("column", [-0.2, 0.48])
def test_the_peak_of_a_lattice_is_found(row: float, column: float) -> None:
    y, x = np.mgrid[-2:3, -3:4]
    bump = np.exp(-(((y - row) / 2.2) ** 2) - ((x - column) / 2.6) ** 2 - 0.05 * (y - row) * (x - column))
    assert lattice_peak(bump) == pytest.approx((row, column), abs=0.01)
    assert np.isnan(lattice_peak(-bump)).all()
    assert np.isnan(lattice_peak(np.zeros((5, 7)))).all()


def _between_rows(strip: Texture, lower_px: float) -> Texture:
    """The same strip a fraction of a row further down."""
    frequency = np.fft.fftfreq(strip.strip.shape[0])[:, None]
    spectrum = np.fft.fft(strip.strip, axis=0) * np.exp(-2j * np.pi * frequency * lower_px)
    return replace(strip, strip=np.fft.ifft(spectrum, axis=0).real.astype(np.float32))


@pytest.mark.parametrize("lower_px", [-2.3, -0.45, 0.0, 0.2, 1.5])
@pytest.mark.parametrize("stage_px", [0.0, 7.4])
def test_a_move_across_the_groove_that_the_log_does_not_know_is_found(lower_px: float, stage_px: float) -> None:
    # texture across the rows too, so that rows have something to say
    tail = _between_rows(_smooth_strip(0.0), 0.0)
    head = _between_rows(_smooth_strip(51.2), lower_px - stage_px)
    head = replace(head, arc_start_m=50 * PITCH_M, stage_m=stage_px * PITCH_M)
    match = SPLICE.match(tail, head)
    assert match.row_error_m / PITCH_M == pytest.approx(lower_px, abs=0.02)
    assert match.error_m / PITCH_M == pytest.approx(1.2, abs=0.02)


def _smooth_strip(start_px: float, width: int = 143) -> Texture:
    """A strip whose texture is smooth across the rows, and fades out towards its upper and lower edge."""
    rng = np.random.default_rng(8)
    kx, ky, phase = rng.normal(0, 0.5, 400), rng.normal(0, 0.5, 400), rng.uniform(0, 2 * np.pi, 400)
    y, x = np.mgrid[0:64, 0:width]
    picture = sum(np.cos(a * (x + start_px) + b * y + c) for a, b, c in zip(kx, ky, phase, strict=True))
    fade = np.exp(-0.5 * ((y - 31.3) / 8.0) ** 2)
    return Texture((picture * fade).astype(np.float32), start_px * PITCH_M, PITCH_M)


def _traces(true_m: np.ndarray, nominal_m: np.ndarray, *, lost: int | None = None) -> list[WallTrace]:
    nothing = np.full((2, 4), np.nan)
    traces = []
    for number, (true, nominal) in enumerate(zip(true_m, nominal_m, strict=True)):
        seen = _strip(true / PITCH_M, nominal_px=nominal / PITCH_M)
        traces.append(
            WallTrace(
                number=number,
                arc_start_m=float(nominal),
                arc_step_m=4e-6,
                offset_m=nothing,
                offset_sigma_m=nothing,
                slope=nothing,
                slope_sigma=nothing,
                correlation_samples=1.0,
                flags=np.zeros((2, 4), np.uint16),
                head=None if number == lost else seen,
                tail=seen,
            )
        )
    return traces


def test_stretches_are_put_where_they_really_began() -> None:
    nominal_m = 20e-6 * np.arange(8)
    error_m = np.array([0, 1.1, -1.7, 0.4, 2.2, -0.3, 0.9, -2.0]) * 1e-6
    joined = list(SPLICE.join(iter(_traces(nominal_m + error_m, nominal_m))))
    found_m = np.array([trace.arc_start_m for trace, _ in joined])
    assert joined[0][1] is None
    # the encoder, right to 2 µm, pulls a little at a chain that is right to 0.05 µm
    np.testing.assert_allclose(found_m, nominal_m + error_m, atol=0.05e-6)
    assert not any(trace.flags.any() for trace, _ in joined)


def test_a_stretch_without_an_overlap_is_flagged_and_stays_where_the_encoder_says() -> None:
    nominal_m = 20e-6 * np.arange(5)
    error_m = np.array([0, 1.0, 1.5, 1.2, 0.8]) * 1e-6
    joined = list(SPLICE.join(iter(_traces(nominal_m + error_m, nominal_m, lost=2))))
    flagged = [bool((trace.flags & Quality.NO_OVERLAP).any()) for trace, _ in joined]
    assert flagged == [False, False, True, False, False]
    assert joined[2][0].arc_start_m == nominal_m[2]


def test_what_follows_a_jump_of_the_picture_is_moved_back(monkeypatch: pytest.MonkeyPatch) -> None:
    unlogged = [0.0, 4e-9, 1.3e-6, -6e-9, float("nan"), -0.4e-6, 0.2e-6]
    correlation = [0.95, 0.95, 0.95, 0.95, 0.1, 0.95, 0.3]
    found = iter(Match(0.0, c, row) for row, c in zip(unlogged, correlation, strict=True))
    monkeypatch.setattr(Splice, "match", lambda self, tail, head: next(found))
    trace = replace(_traces(np.zeros(1), np.zeros(1))[0], offset_m=np.full((2, 4), 5e-6))
    joined = [t.offset_m for t, _ in SPLICE.join(trace for _ in range(8))]
    moved = 5e-6 - np.array([offset[0, 0] for offset in joined])
    # what may be chance is left alone: a few nanometres, and more where the strips are hardly alike
    np.testing.assert_allclose(moved, [0, 0, 0, 1.3e-6, 1.3e-6, 1.3e-6, 0.9e-6, 0.9e-6], atol=1e-12)


def test_small_errors_of_matches_do_not_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(6)
    groups = 4000
    encoder_m, slip_m = 2e-6 * rng.normal(size=groups), 0.05e-6 * rng.normal(size=groups)
    encoder_m[0] = 0
    # what the overlaps say: the true change of the encoder's error, and a bit of their own
    overlaps = iter(np.diff(encoder_m) + slip_m[1:])
    monkeypatch.setattr(Splice, "match", lambda self, tail, head: Match(next(overlaps), 0.9))
    trace = _traces(np.zeros(1), np.zeros(1))[0]
    found_m = np.array([t.arc_start_m for t, _ in SPLICE.join(trace for _ in range(groups))])
    error = found_m - encoder_m
    walk = np.cumsum(slip_m)
    assert np.abs(walk).max() > 2.5e-6
    # steady state of the filter: √(σ_match σ_encoder) = 0.32 µm
    assert error[200:].std() == pytest.approx(np.sqrt(0.05 * 2) * 1e-6, rel=0.35)
    assert np.abs(error).max() < 1.6e-6
