"""Both walls smoothed together: error bars that are true, holes that are bridged, and a groove that is not lost."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER
from gramoscope.errors import ArgumentError
from gramoscope.quality import Quality
from gramoscope.signal_path import WallTrace
from gramoscope.tonearm.follow import PlaceSmoother, Tonearm
from gramoscope.tonearm.place_samples import _both_directions

LATERAL, VERTICAL = 0, 1
GROUPS = 40


def _dull(f: np.ndarray) -> np.ndarray:
    return 1 / (1 + (f / 700) ** 2) ** 0.75 / (1 + (f / 6000) ** 8)


def _speech(f: np.ndarray) -> np.ndarray:
    """With breath and consonants as recordings have them, 31 dB below the rest and mostly below the readings' noise."""
    return np.hypot(_dull(f), 7e-3 / (1 + (f / 11_000) ** 4))


SPECTRA: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "band-limited": lambda f: ((f > 150) & (f < 6000)) * 1.0,
    "wide": lambda f: ((f > 150) & (f < 10_000)) * 1.0,
    "matern 3/2": lambda f: 1 / (1 + (f / 2000) ** 2),
    "matern 5/2": lambda f: 1 / (1 + (f / 5000) ** 2) ** 1.5,
    "ornstein-uhlenbeck": lambda f: (f < 40e3) / np.sqrt(1 + (f / 2000) ** 2),
    "speech": _speech,
    "dull speech": _dull,
}
WIDE_COST = {"wide": 1.3, "dull speech": 1.35, "1 kHz": 1.4}
"""What it costs to expect breath, and the record's own noise, where there is none, or that it ends gently where it does not.
The tone costs 1.37 where the likelihood is largest; a search that stops short claims less, by chance."""
SURFACE_M_S = 0.03 * 10 ** (-36 / 20)
"""Noise of a record's surface, 36 dB below the loud sounds here: as much as lacquer has, less than shellac."""


def _surface(f: np.ndarray) -> np.ndarray:
    return (f > 150) / (1 + (f / 11_000) ** 4)


def _both(bench: Any, *, groups: int = GROUPS, vertical: float = 0.004, seed: int = 8) -> tuple[Any, Any]:
    return (
        bench.course(SPECTRA["band-limited"], 0.03, groups=groups, seed=seed),
        bench.course(_dull, vertical, groups=groups, seed=seed + 50),
    )


@pytest.mark.parametrize("name", [*SPECTRA, "1 kHz", "4 kHz", "1 kHz on a record", "4 kHz on a record"])
def test_the_claimed_error_is_the_real_one(bench: Any, name: str) -> None:
    claims, errors = [], []
    for seed in (1, 2):
        vertical = bench.course(_speech, 0.02, groups=GROUPS, seed=seed + 50)
        if name in SPECTRA:
            lateral = bench.course(SPECTRA[name], 0.03, groups=GROUPS, seed=seed)
        else:
            lateral = bench.tone(1000.0 * float(name[0]), 0.03, groups=GROUPS)
        if name.endswith("record"):
            noise = bench.course(_surface, SURFACE_M_S, groups=GROUPS, seed=seed + 90)
            lateral = replace(lateral, velocity_m_s=lateral.velocity_m_s + noise.velocity_m_s)
        heard = bench.hear(bench.traces(lateral, vertical, groups=GROUPS, seed=seed), lateral, vertical)
        assert not heard.flags[4:-4].any()
        claims.append([heard.claim(i, heard.measured) ** 2 for i in (LATERAL, VERTICAL)])
        errors.append([heard.error(i, heard.measured) ** 2 for i in (LATERAL, VERTICAL)])
    ratio = np.sqrt(np.mean(claims, axis=0) / np.mean(errors, axis=0))
    # 1.20 is what the prior costs where a spectrum ends like a wall (see `groove_prior`); overlaps add 0.03
    assert 0.8 < ratio[LATERAL] < WIDE_COST.get(name, 1.27)
    assert 0.8 < ratio[VERTICAL] < 1.27


def test_a_prior_that_falls_gently_would_claim_too_much_and_err_more(bench: Any) -> None:
    # the frequencies between music and noise are the prior's: what Matérn's process of order 3/2 would leave in them,
    # 12 dB an octave beyond its corner, is had here by a cut-off that is far away
    lateral, vertical = _both(bench)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    steep, gentle = (
        bench.hear(traces, lateral, vertical, **settings)
        for settings in ({}, {"cutoff_limits_hz": (90_000.0, 100_000.0)})
    )
    assert gentle.error(LATERAL, gentle.measured) > 1.5 * steep.error(LATERAL, steep.measured)
    assert gentle.ratio(LATERAL, gentle.measured) > 1.3


def test_holes_are_bridged_with_an_error_that_is_true(bench: Any, lose: Callable[..., WallTrace]) -> None:
    lateral, vertical = _both(bench, groups=60)
    traces = bench.traces(lateral, vertical, groups=60)
    for number in range(60):
        if number % 4 == 1:
            traces[number] = lose(traces[number], [INNER, OUTER], slice(60, 75))
        if number % 5 == 3:
            traces[number] = lose(traces[number], [INNER], slice(15, 140))
        if number % 7 == 5:
            traces[number] = lose(traces[number], [OUTER], slice(0, None))
    heard = bench.hear(traces, lateral, vertical)
    holes = ((heard.flags & Quality.INTERPOLATED) != 0) & (np.arange(heard.flags.size) < heard.flags.size - 60)
    assert 15 * 13 < holes.sum() < 15 * 25
    assert (heard.flags[holes] == Quality.INTERPOLATED | Quality.NO_STRIPE).all()
    for direction in (LATERAL, VERTICAL):
        assert 0.8 < heard.ratio(direction, heard.measured) < 1.25
        assert 0.65 < heard.ratio(direction, holes) < 1.5
    assert heard.claim(LATERAL, holes) > 5 * heard.claim(LATERAL, heard.measured)
    assert np.isfinite(heard.velocity).all()
    # doing nothing in the holes would leave all of the music
    assert heard.error(LATERAL, holes) < 0.8 * np.std(heard.true[LATERAL, holes])


def test_one_wall_carries_on_where_the_other_is_missing(bench: Any, lose: Callable[..., WallTrace]) -> None:
    lateral, vertical = _both(bench, vertical=0.001)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    for number in range(10, 20):
        traces[number] = lose(traces[number], [OUTER], slice(0, None))
    heard = bench.hear(traces, lateral, vertical)
    alone = np.zeros_like(heard.measured)
    alone[int(10.2 * bench.group_step) : int(19.8 * bench.group_step)] = True
    assert not heard.flags[alone].any()
    assert heard.error(LATERAL, alone) < 1.3e-3
    assert 0.7 < heard.ratio(LATERAL, alone) < 1.4
    both = heard.measured & ~alone
    assert heard.claim(VERTICAL, alone) > 3 * heard.claim(VERTICAL, both)


def test_a_direction_that_nothing_was_seen_of_is_unknown(bench: Any, lose: Callable[..., WallTrace]) -> None:
    lateral, _ = _both(bench)
    still = bench.course(_speech, 0.0, groups=GROUPS, seed=1)
    traces = [lose(trace, [OUTER], slice(0, None)) for trace in bench.traces(lateral, still, groups=GROUPS)]
    heard = bench.hear(traces, lateral, still)
    assert np.isnan(heard.velocity[VERTICAL]).all()
    assert np.isnan(heard.sigma[VERTICAL]).all()
    # the claim has room for what the other direction, here at rest, might have added
    assert 0.8 < heard.ratio(LATERAL, heard.measured) < 1.5
    # and the other way about: with its sign, and on the assumption that the groove moves up and down only
    traces = [lose(trace, [OUTER], slice(0, None)) for trace in bench.traces(still, lateral, groups=GROUPS)]
    heard = bench.hear(traces, still, lateral, direction="vertical")
    assert np.isnan(heard.velocity[LATERAL]).all()
    assert 0.8 < heard.ratio(VERTICAL, heard.measured) < 1.5


# with a third of the samples far off more of the breath drowns that is expected, and claims have room for it
@pytest.mark.parametrize(("amplitude_m", "largest_ratio"), [(10e-6, 1.3), (100e-6, 1.42)])
def test_a_third_of_the_samples_may_be_wild(bench: Any, amplitude_m: float, largest_ratio: float) -> None:
    worse, wrong, ratios = [], [], []
    for seed in range(5):
        lateral, vertical = _both(bench, seed=seed)
        traces, rng = bench.traces(lateral, vertical, groups=GROUPS), np.random.default_rng(seed)
        spoilt = []
        for trace in traces:
            wild = (rng.random(trace.offset_m.shape) < 0.3) * rng.uniform(
                -amplitude_m, amplitude_m, trace.offset_m.shape
            )
            spoilt.append(replace(trace, offset_m=trace.offset_m + wild))
        clean, heard = (bench.hear(one, lateral, vertical) for one in (traces, spoilt))
        worse.append(heard.error(LATERAL, heard.measured) / clean.error(LATERAL, clean.measured))
        off = np.abs(heard.velocity - heard.true) / heard.sigma
        wrong.append(np.mean(off[:, heard.measured] > 5, axis=1))
        ratios.append([heard.ratio(i, heard.measured & (off[i] < 5)) for i in (LATERAL, VERTICAL)])
    # where half of a neighbourhood happens to agree on something else, nobody could tell
    assert np.median(worse) < 4
    assert np.max(np.mean(wrong, axis=0)) < 0.01
    assert np.all(np.mean(ratios, axis=0) > 0.8)
    assert np.all(np.mean(ratios, axis=0) < largest_ratio)
    # both walls wild in three neighbouring samples
    assert ((heard.flags & Quality.OUTLIER) != 0).any()


@pytest.mark.parametrize("walls", [[INNER], [INNER, OUTER]])
@pytest.mark.parametrize(("jump_m", "loudness"), [(5e-6, 1e-4), (5e-6, 3e-3), (40e-6, 0.03)])
def test_a_picture_that_jumps_is_found_again_without_a_sound(
    bench: Any, walls: list[int], jump_m: float, loudness: float
) -> None:
    lateral = bench.course(SPECTRA["band-limited"], loudness, groups=GROUPS, seed=8)
    vertical = bench.course(_speech, min(loudness, 0.002), groups=GROUPS, seed=9)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    for number in range(20, GROUPS):
        offset = traces[number].offset_m.copy()
        offset[walls] += jump_m
        traces[number] = replace(traces[number], offset_m=offset)
    heard = bench.hear(traces, lateral, vertical)
    off = np.abs((heard.velocity - heard.true) / heard.sigma)
    assert off[:, 60:-60].max() < 7
    assert not heard.flags[4:-4].any()
    for direction in (LATERAL, VERTICAL):
        assert heard.ratio(direction, heard.measured) > 0.65


def test_the_first_chord_after_a_silent_start_is_heard(bench: Any) -> None:
    lateral = bench.course(SPECTRA["wide"], 0.09, groups=60, seed=5, loud_from=41)
    vertical = bench.course(_speech, 0.001, groups=60, seed=6)
    # learned from the silence alone, and told by every stretch's own loudness
    heard = bench.hear(bench.traces(lateral, vertical, groups=60), lateral, vertical, learn_groups=38)
    first = int(41 * bench.group_step)
    chord = np.arange(heard.flags.size) > first
    chord &= heard.measured
    assert not heard.flags[chord].any()
    assert heard.error(LATERAL, chord) < 0.02 * np.std(heard.true[LATERAL, chord])
    assert 0.75 < heard.ratio(LATERAL, chord) < 1.35
    silence = heard.measured & (np.arange(heard.flags.size) < first - 4 * bench.group_step)
    assert heard.error(LATERAL, silence) < 3e-4


def test_a_click_in_the_groove_is_heard_and_taken_for_no_damage(bench: Any) -> None:
    quiet = bench.course(SPECTRA["band-limited"], 0.01, groups=GROUPS, seed=5)
    click = np.zeros(quiet.velocity_m_s.size)
    at = np.arange(click.size) / 8 - 20 - 20.5 * bench.group_step
    click += 0.25 * np.exp(-0.5 * (at / 5) ** 2) * np.cos(at / 6)
    lateral = replace(quiet, velocity_m_s=quiet.velocity_m_s + click)
    vertical = bench.course(_speech, 0.001, groups=GROUPS, seed=6)
    heard = bench.hear(bench.traces(lateral, vertical, groups=GROUPS), lateral, vertical)
    there = np.abs(np.arange(heard.flags.size) - 20.5 * bench.group_step) < 20
    assert not (heard.flags[there] & Quality.INTERPOLATED).any()
    assert heard.error(LATERAL, there) < 0.04 * np.abs(heard.true[LATERAL, there]).max()
    assert heard.ratio(LATERAL, there) > 0.35
    # and the claim says that less is known here than elsewhere
    assert heard.claim(LATERAL, there) > 1.5 * heard.claim(LATERAL, heard.measured & ~there)


@pytest.mark.parametrize("wrong_by", [0.7, 1.6])
def test_errors_that_are_claimed_wrongly_are_put_right(bench: Any, wrong_by: float) -> None:
    lateral, vertical = _both(bench, vertical=0.02)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    claimed = [replace(trace, offset_sigma_m=trace.offset_sigma_m / wrong_by) for trace in traces]
    heard = bench.hear(claimed, lateral, vertical)
    for direction in (LATERAL, VERTICAL):
        assert 0.8 < heard.ratio(direction, heard.measured) < 1.3


def test_a_stretch_of_which_hardly_anything_was_seen_is_not_believed(
    bench: Any, lose: Callable[..., WallTrace]
) -> None:
    lateral, vertical = _both(bench)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    glimpse = replace(traces[20], offset_m=traces[20].offset_m + 9e-6)
    traces[20] = lose(lose(glimpse, [INNER, OUTER], slice(0, 70)), [INNER, OUTER], slice(90, None))
    heard = bench.hear(traces, lateral, vertical)
    glimpsed = slice(int(20 * bench.group_step) + 72, int(20 * bench.group_step) + 88)
    assert (heard.flags[glimpsed] & np.uint16(Quality.SPARSE | Quality.INTERPOLATED) == 33).all()
    off = np.abs(heard.velocity - heard.true) / heard.sigma
    assert np.mean(off[:, int(19.5 * bench.group_step) : int(21.5 * bench.group_step)] > 4) < 0.01


def test_overlapping_stretches_do_not_count_twice(bench: Any) -> None:
    same = replace(bench, shared=1.0)
    lateral, vertical = _both(same)
    heard = same.hear(same.traces(lateral, vertical, groups=GROUPS), lateral, vertical)
    place = np.arange(heard.flags.size) % same.group_step
    overlap, alone = heard.measured & (place > 2) & (place < 11), heard.measured & (place > 40) & (place < 120)
    assert heard.claim(LATERAL, overlap) == pytest.approx(heard.claim(LATERAL, alone), rel=0.06)
    assert 0.8 < heard.ratio(LATERAL, overlap) < 1.35
    # without any overlap the claim is the same: nothing was gained by seeing the same errors twice
    apart = replace(same, group_step=165.0)
    plain = apart.hear(apart.traces(lateral, vertical, groups=GROUPS), lateral, vertical)
    assert heard.claim(LATERAL, heard.measured) == pytest.approx(plain.claim(LATERAL, plain.measured), rel=0.05)


def test_a_stretch_that_sits_a_little_off_makes_no_click(bench: Any) -> None:
    lateral, vertical = _both(bench)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    traces[20] = replace(traces[20], offset_m=traces[20].offset_m + 0.1e-6)
    heard = bench.hear(traces, lateral, vertical)
    there = slice(int(19.5 * bench.group_step), int(21.5 * bench.group_step))
    # 0.1 µm over the whole overlap is 2.1 mm/s for 46 µs; in one step it would be twenty
    assert np.abs(heard.velocity - heard.true)[LATERAL, there].max() < 5e-3


@pytest.mark.parametrize("block_groups", [3, 16])
def test_the_size_of_the_blocks_does_not_matter(bench: Any, lose: Callable[..., WallTrace], block_groups: int) -> None:
    lateral, vertical = _both(bench)
    traces, rng = bench.traces(lateral, vertical, groups=GROUPS), np.random.default_rng(3)
    for number in range(2, GROUPS, 5):
        traces[number] = lose(traces[number], [INNER, OUTER], slice(60, 85))
        offset = traces[number + 1].offset_m.copy()
        offset[:, 30:33] += rng.uniform(2e-6, 9e-6)
        traces[number + 1] = replace(traces[number + 1], offset_m=offset)
    settings = {"learn_groups": 12, "corner_limits_hz": (1500.0, 20_000.0)}
    once = bench.hear(traces, lateral, vertical, block_groups=1000, **settings)
    blocks = bench.hear(traces, lateral, vertical, block_groups=block_groups, **settings)
    assert blocks.pieces > 1 == once.pieces
    np.testing.assert_allclose(blocks.velocity, once.velocity, atol=1e-5 * np.abs(once.velocity).max())
    np.testing.assert_allclose(blocks.sigma, once.sigma, rtol=1e-4)
    np.testing.assert_array_equal(blocks.flags, once.flags)
    hasty = bench.hear(traces, lateral, vertical, block_groups=block_groups, lookahead=0.2, **settings)
    assert np.abs(hasty.velocity - once.velocity).max() > 1e-4 * np.abs(once.velocity).max()


def test_it_answers_while_it_listens(bench: Any) -> None:
    lateral, vertical = _both(bench, groups=90)
    traces, taken = bench.traces(lateral, vertical, groups=90), [0]

    def pulled() -> Any:
        for trace in traces:
            taken[0] += 1
            yield trace

    smoother = PlaceSmoother(learn_groups=8, block_groups=8, corner_limits_hz=(1500.0, 20_000.0))
    tonearm = Tonearm(bench.rotation, "lateral", np.pi / 4, traces[-1].arc_start_m, smoother)
    behind = [taken[0] * bench.group_step * bench.step_m - p.arc_start_m for p in tonearm.follow(pulled())]
    assert len(behind) > 8
    # never more than three batches behind what it took
    assert max(behind) < 26 * bench.group_step * bench.step_m


def test_walls_at_different_angles_keep_the_channels_apart(bench: Any) -> None:
    leaning = replace(bench, wall_angles_rad=(np.deg2rad(43.5), np.deg2rad(46.5)))
    lateral = bench.course(SPECTRA["band-limited"], 0.0, groups=GROUPS, seed=1)
    vertical = bench.course(SPECTRA["band-limited"], 0.03, groups=GROUPS, seed=2)
    traces = leaning.traces(lateral, vertical, groups=GROUPS)
    right, wrong = (one.hear(traces, lateral, vertical) for one in (leaning, bench))
    leak = [
        np.vdot(heard.velocity[0], heard.true[1]) / np.vdot(heard.true[1], heard.true[1]) for heard in (right, wrong)
    ]
    assert abs(leak[0]) < 1e-3
    assert leak[1] == pytest.approx((1 / np.tan(np.deg2rad(46.5)) - 1 / np.tan(np.deg2rad(43.5))) / 2, abs=2e-3)


def test_samples_that_were_filled_in_are_not_measurements(bench: Any) -> None:
    lateral, vertical = _both(bench)
    traces = bench.traces(lateral, vertical, groups=GROUPS)
    offset, flags = traces[20].offset_m + 7e-6, traces[20].flags | np.uint16(Quality.SPARSE | Quality.INTERPOLATED)
    traces[20] = replace(traces[20], offset_m=offset, flags=flags)
    heard = bench.hear(traces, lateral, vertical)
    there = slice(int(20.2 * bench.group_step), int(20.9 * bench.group_step))
    assert (heard.flags[there] == Quality.SPARSE | Quality.INTERPOLATED).all()
    assert heard.claim(LATERAL, there) > 0.01


def test_a_passage_begins_at_zero_and_ends_where_it_should(bench: Any) -> None:
    lateral, vertical = _both(bench)
    traces = bench.traces(lateral, vertical, groups=GROUPS)[2:30]
    smoother = PlaceSmoother(block_groups=7)
    assert list(Tonearm(bench.rotation, "lateral", np.pi / 4, 1e-3, smoother).follow([])) == []
    length = 33 * bench.group_step * bench.step_m
    pieces = list(Tonearm(bench.rotation, "lateral", np.pi / 4, length, smoother).follow(traces))
    done = 0
    for piece in pieces:
        assert piece.arc_start_m == pytest.approx(done * bench.step_m, abs=1e-12)
        done += piece.flags.size
    assert done == int(length / bench.step_m) + 1
    flags, sigma = (np.concatenate([getattr(p, n) for p in pieces]) for n in ("flags", "lateral_sigma_m_s"))
    unseen = np.r_[0 : int(2 * bench.group_step) - 1, int(30.2 * bench.group_step) : done]
    assert (flags[unseen] & Quality.INTERPOLATED).all()
    assert sigma[0] > 20 * np.median(sigma)


def test_impossible_smoothers_are_refused() -> None:
    for setting in (
        {"learn_groups": 0},
        {"block_groups": 0},
        {"lookahead": 0.0},
        {"gate": 1.0},
        {"floor_m_s": 0.0},
        {"corner_limits_hz": (5000.0, 300.0)},
        {"cutoff_limits_hz": (0.0, 300.0)},
    ):
        with pytest.raises(ArgumentError):
            PlaceSmoother(**setting)


def test_a_reading_of_either_wall_sees_both_directions() -> None:
    row, gain = np.random.default_rng(4).normal(size=(5, 8)), np.array([-0.9, 1.1, 1.1, -0.9, 1.1])
    np.testing.assert_array_equal(_both_directions(row, gain), np.hstack([row, row * gain[:, None]]))
