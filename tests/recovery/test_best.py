"""A short film read by the recipe `best`: how near it comes to the groove, and whether it knows how near.

Twenty groups of four frames: nine millimetres of groove, a hundredth of a second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from gramoscope.apparatus.bench import Bench, Sequence
from gramoscope.conventions import FloatArray
from gramoscope.pickup.cartridge import Pickup
from gramoscope.player.recipe import load_recipe
from gramoscope.player.workers import spreading
from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup, WallTrace
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.render import cut_passage
from gramoscope.simulation.scene import Scene, filming_bench
from gramoscope.tonearm.follow import Tonearm

GROUPS = 20
RATE_HZ = 48_000.0
BEST = load_recipe("best")
SPOILT, HOLE = 9, slice(350, 900)
WITHOUT_ENDS = slice(600, -600)


@dataclass(frozen=True, eq=False)
class Film:
    """What was cut and what was filmed of it."""

    scene: Scene
    passage: Passage
    groups: list[FrameGroup]


@dataclass(frozen=True, eq=False)
class Heard:
    """What was read, beside the truth, on the grid of the tonearm."""

    pickup: Pickup
    traces: list[WallTrace]
    arc_m: FloatArray
    velocity: FloatArray
    sigma: FloatArray
    true: FloatArray
    flags: np.ndarray

    @property
    def good(self) -> np.ndarray:
        """Measured, not within the ends."""
        inside = np.zeros(self.flags.size, bool)
        inside[WITHOUT_ENDS] = True
        return inside & ((self.flags & Quality.INTERPOLATED) == 0)

    def snr_db(self, away: np.ndarray | None = None) -> float:
        """Of the waveform between 200 Hz and 10 kHz."""
        rate_hz = 1 / float(self.arc_m[1] - self.arc_m[0]) * 0.939336
        sos = butter(2, [200, 10_000], "bandpass", fs=rate_hz, output="sos")
        error, true = (sosfiltfilt(sos, one) for one in (self.velocity - self.true, self.true))
        where = self.good if away is None else self.good & away
        return float(10 * np.log10(np.mean(true[where] ** 2) / np.mean(error[where] ** 2)))


@pytest.fixture(scope="module")
def film(film_group: Callable[[Scene, Passage, int], FrameGroup]) -> Film:
    """Noise like music, louder in the bass than in the treble, at the level of an ordinary 78."""
    sequence = Sequence(groups=GROUPS, frames_per_group=4, frame_step_m=0.8e-6, group_step_m=470e-6)
    scene = Scene(replace(filming_bench(height_px=448), sequence=sequence), groove_middle_m=-1.7e-6, seed=11)
    sos = butter(1, [200, 1500], "bandpass", fs=RATE_HZ, output="sos")
    sound = sosfiltfilt(sos, np.random.default_rng(42).normal(size=1200))
    passage = cut_passage(np.asarray(sound), rate_hz=RATE_HZ, scene=scene)
    with spreading(2) as spread:
        groups = list(spread(lambda number: film_group(scene, passage, number), range(GROUPS)))
    return Film(scene, passage, groups)


def _heard(film: Film, groups: list[FrameGroup], bench: Bench) -> Heard:
    with spreading(2) as spread:
        pickup = BEST.cartridge_for(bench).learn(lambda number: groups[number], GROUPS, spread)
        traces = list(spread(pickup.read, groups))
    arm = Tonearm(bench.rotation, "lateral", bench.disc.wall_angle_rad, bench.passage_length_m, BEST.smoother)
    pieces = list(arm.follow(trace for trace, _ in BEST.splice.join(iter(traces))))
    velocity, sigma, flags = (
        np.concatenate([getattr(piece, name) for piece in pieces])
        for name in ("lateral_velocity_m_s", "lateral_sigma_m_s", "flags")
    )
    arc_m = pieces[0].arc_step_m * np.arange(velocity.size)
    return Heard(pickup, traces, arc_m, velocity, sigma, film.passage.velocity_m_s(arc_m)[0], flags)


@pytest.fixture(scope="module")
def heard(film: Film) -> Heard:
    return _heard(film, film.groups, film.scene.bench)


def test_the_groove_is_found(heard: Heard) -> None:
    assert np.corrcoef(heard.velocity[heard.good], heard.true[heard.good])[0, 1] > 0.996
    # silence would have 0 dB; 32 were measured
    assert heard.snr_db() > 29


def test_claimed_errors_are_the_real_ones(heard: Heard) -> None:
    good = heard.good
    real = np.sqrt(np.mean((heard.velocity - heard.true)[good] ** 2))
    assert 0.7 < np.sqrt(np.mean(heard.sigma[good] ** 2)) / real < 1.4


def test_places_of_both_walls_are_found_and_their_errors_known(film: Film, heard: Heard) -> None:
    for wall in (0, 1):
        error, sigma = [], []
        for trace in heard.traces[1:-1]:
            arc_m = trace.arc_start_m + trace.arc_step_m * np.arange(trace.offset_m.shape[1])
            good = (trace.flags[wall] & Quality.INTERPOLATED) == 0
            assert good.mean() > 0.9
            error.append((trace.offset_m[wall] - film.passage.displacement_m(arc_m)[0])[good])
            sigma.append(trace.offset_sigma_m[wall][good])
        # up to a constant of the wall: its own place at rest
        real, claimed = np.concatenate(error), np.concatenate(sigma)
        real -= np.average(real, weights=claimed**-2)
        assert np.sqrt(np.average(real**2, weights=claimed**-2)) < 0.15e-6
        assert 0.7 < np.sqrt(np.mean((real / claimed) ** 2)) < 1.4


def test_nearly_all_is_measured_by_both_walls(heard: Heard) -> None:
    assert heard.pickup.walls == ("inner", "outer")
    assert heard.good[WITHOUT_ENDS].mean() > 0.99
    assert all(np.isfinite(trace.offset_m).mean() > 0.9 for trace in heard.traces)


def _with_a_hole(group: FrameGroup) -> FrameGroup:
    """Both walls broken off over a fifth of a millimetre."""
    images = group.images.copy()
    rng = np.random.default_rng(5)
    for number, image in enumerate(images):
        gone = slice(HOLE.start - 2 * number, HOLE.stop - 2 * number)
        image[:, gone] = rng.normal(120, 3, image[:, gone].shape).clip(0, 255)
    return replace(group, images=images)


def test_a_hole_in_both_walls_is_flagged_and_bridged_and_hurts_nothing_else(film: Film, heard: Heard) -> None:
    groups = list(film.groups)
    groups[SPOILT] = _with_a_hole(groups[SPOILT])
    holed = _heard(film, groups, film.scene.bench)
    pitch_m = film.scene.bench.sensor.pixel_pitch_m
    start_m = groups[SPOILT].arc_start_m[0]
    from_m, to_m = (start_m + pitch_m * column for column in (HOLE.start, HOLE.stop))
    # the next group sees the end of this one once more; only its own middle is seen but once
    inside = (holed.arc_m > from_m + 20e-6) & (holed.arc_m < min(to_m, start_m + 470e-6) - 20e-6)
    away = (holed.arc_m < from_m - 100e-6) | (holed.arc_m > to_m + 100e-6)
    assert (holed.flags[inside] & Quality.INTERPOLATED != 0).mean() > 0.9
    assert (holed.flags[away][WITHOUT_ENDS] & Quality.INTERPOLATED != 0).mean() < 0.01
    assert np.median(holed.sigma[inside]) > 3 * np.median(holed.sigma[away])
    assert np.abs(holed.velocity[inside]).max() < 2 * np.abs(holed.true).max(), "a bridge, not a bang"
    assert holed.snr_db(away) > heard.snr_db(away) - 1


def test_a_manifest_that_is_a_tenth_wrong_costs_less_than_a_decibel(film: Film, heard: Heard) -> None:
    bench = film.scene.bench
    glass = bench.cover_glass
    assert glass is not None
    wrong = replace(
        bench,
        cover_glass=replace(glass, thickness_m=1.1 * glass.thickness_m),
        focus_below_land_m=0.9 * bench.focus_below_land_m,
        sequence=replace(bench.sequence, frame_step_m=1.1 * bench.sequence.frame_step_m),
    )
    groups = [
        replace(group, arc_start_m=group.arc_start_m[0] + 1.1 * (group.arc_start_m - group.arc_start_m[0]))
        for group in film.groups
    ]
    misled = _heard(film, groups, wrong)
    assert misled.snr_db() > heard.snr_db() - 1
    told = misled.pickup.calibration["focus_shift_um"]
    assert told["manifest"] == pytest.approx(1.1 * 1e6 * glass.shift_m)
    assert told["if_walls_are_as_stated"] == pytest.approx(1e6 * glass.shift_m, rel=0.03)
