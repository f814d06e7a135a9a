"""Kalman filtering: an index term of the paper that its text never explains. Where we use it, and what it gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from experiments.seed_paper.damage import OneChip
from experiments.seed_paper.page import FOLDER, Claim, Page, percent
from experiments.seed_paper.take import NOISE_RATE_HZ, Take, film_in_memory, noise_sound, short_bench
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.disc.damage import NO_DAMAGE
from gramoscope.listening import ink
from gramoscope.listening.align import pearson_r
from gramoscope.listening.compare import snr_db
from gramoscope.pickup.wall import WallOrientation
from gramoscope.player.recipe import load_recipe
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import WallTrace
from gramoscope.simulation.rig import Rig
from gramoscope.simulation.scene import Scene
from gramoscope.tonearm.directions import observe
from gramoscope.tonearm.follow import Tonearm

FIRST, GROUPS, FRAMES, SEED = 4, 30, 4, 8
CHIPPED_GROUP = 20
NEIGHBOURHOODS_PX = (50.0, 100.0, 200.0)
GATE = 0.5
"""Raw slopes above this (sixteen times an ordinary sound) are left out of the raw sound, as a click remover would."""


@dataclass(frozen=True, eq=False)
class Sound:
    """Velocity and its standard error on the grid of the tonearm, and the truth; metres a second."""

    arc_m: FloatArray
    velocity: FloatArray
    sigma: FloatArray
    true: FloatArray
    measured: BoolArray

    @property
    def used(self) -> BoolArray:
        """Samples that count: finite, at least half a group from either end."""
        far = (self.arc_m > self.arc_m[0] + 0.25e-3) & (self.arc_m < self.arc_m[-1] - 0.25e-3)
        return np.asarray(far & np.isfinite(self.velocity) & np.isfinite(self.sigma))

    @property
    def r(self) -> float:
        """Pearson's r against the truth."""
        return pearson_r(self.true[self.used], self.velocity[self.used])

    @property
    def signal_to_noise_db(self) -> float:
        """Signal to noise ratio, without any gain taken out."""
        return snr_db(self.true[self.used], self.velocity[self.used], gain=1.0)

    @property
    def claimed(self) -> float:
        """Root mean square of the error bars."""
        return float(np.sqrt(np.mean(self.sigma[self.used] ** 2)))

    @property
    def real(self) -> float:
        """Root mean square of the errors."""
        return float(np.sqrt(np.mean((self.velocity - self.true)[self.used] ** 2)))

    @property
    def within_two_sigma(self) -> float:
        """Share of the samples that lie within two standard errors of the truth; 95 % if the bars are true."""
        off = np.abs(self.velocity - self.true)[self.used]
        return float(np.mean(off <= 2 * self.sigma[self.used]))


def film(*, chipped: bool = False, rig: Rig | None = None) -> Take:
    """Film a passage of noise between 200 Hz and 6 kHz, whole or with a chip in one group."""
    bench = short_bench(frames=FRAMES, groups=FIRST + GROUPS)
    middle_m = (CHIPPED_GROUP + 0.5) * bench.sequence.group_step_m
    damage = OneChip(middle_m=middle_m, length_m=0.23e-3) if chipped else NO_DAMAGE
    scene = Scene(bench, seed=SEED, rig=rig or Rig(), damage=damage)
    sound = noise_sound(low_hz=200, high_hz=6000, seconds=0.1, seed=SEED)
    return film_in_memory(sound, NOISE_RATE_HZ, scene, range(FIRST, FIRST + GROUPS))


def traces(take: Take, *, neighbourhood_px: float = 100.0) -> list[WallTrace]:
    """Read all groups and put each where it really begins."""
    recipe = load_recipe("seed-paper")
    pickup = replace(
        recipe.cartridge_for(take.scene.bench), orientation=WallOrientation(neighbourhood_px=neighbourhood_px)
    )
    return [trace for trace, _ in recipe.splice.join(pickup.read(group) for group in take.groups)]


def smoothed(take: Take, stretches: Sequence[WallTrace]) -> Sound:
    """Return the sound of the tonearm: Kalman filter forwards, smoother backwards."""
    bench = take.scene.bench
    tonearm = Tonearm(
        bench.rotation, "lateral", bench.disc.wall_angle_rad, bench.passage_length_m, load_recipe("seed-paper").smoother
    )
    pieces = list(tonearm.follow(stretches))
    arc = np.concatenate([p.arc_start_m + np.arange(p.flags.size) * p.arc_step_m for p in pieces])
    velocity, sigma, flags = (
        np.concatenate([getattr(p, name) for p in pieces])
        for name in ("lateral_velocity_m_s", "lateral_sigma_m_s", "flags")
    )
    return _sound(take, arc, velocity, sigma, (flags & np.uint16(NOT_MEASURED)) == 0)


def raw(take: Take, stretches: Sequence[WallTrace], grid_m: FloatArray) -> Sound:
    """Return the same slopes without the smoother: the mean of the samples nearest to each point of the grid."""
    seen = [observe(trace, "lateral", wall_angle_rad=take.scene.bench.disc.wall_angle_rad) for trace in stretches]
    arc, slope, variance, flags = (
        np.concatenate([getattr(s, name) for s in seen]) for name in ("arc_m", "slope", "variance", "flags")
    )
    step = float(grid_m[1] - grid_m[0])
    place = np.rint((arc - grid_m[0]) / step).astype(int)
    good = np.isfinite(slope) & (np.abs(slope) < GATE) & (place >= 0) & (place < grid_m.size)
    count = np.bincount(place[good], minlength=grid_m.size).astype(np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(place[good], slope[good], grid_m.size) / count
        spread = np.sqrt(np.bincount(place[good], variance[good], grid_m.size)) / count
    measured = np.bincount(place[good & ((flags & np.uint16(NOT_MEASURED)) == 0)], minlength=grid_m.size) > 0
    speed = take.scene.bench.rotation.speed_at_m_s(grid_m)
    return _sound(take, grid_m, mean * speed, spread * speed, measured)


def _sound(take: Take, arc: FloatArray, velocity: FloatArray, sigma: FloatArray, measured: BoolArray) -> Sound:
    from_m = FIRST * take.scene.bench.sequence.group_step_m
    here = arc >= from_m
    true = take.passage.velocity_m_s(arc)[0]
    return Sound(arc[here], velocity[here], sigma[here], true[here], measured[here])


def both(take: Take, *, neighbourhood_px: float = 100.0) -> tuple[Sound, Sound]:
    """Return the sound of the same traces without and with the smoother."""
    stretches = traces(take, neighbourhood_px=neighbourhood_px)
    smooth = smoothed(take, stretches)
    return raw(take, stretches, smooth.arc_m), smooth


@dataclass(frozen=True)
class SpliceGain:
    """How far groups begin from where they are believed to, rms, metres."""

    nominal_m: float
    spliced_m: float


def splice_gain() -> SpliceGain:
    """Film with a rig that misses the nominal places of its groups, and splice."""
    take = film(rig=Rig(group_position_m=2e-6))
    true = np.array([take.true_starts_m(group)[0] for group in take.groups])
    nominal = np.array([group.arc_start_m[0] for group in take.groups])
    found = np.array([trace.arc_start_m for trace in traces(take)])
    # the first group of the film fixes where the passage begins
    return SpliceGain(
        *(float(np.sqrt(np.mean(((places - true) - (places - true)[0])[1:] ** 2))) for places in (nominal, found))
    )


def traces_figure(before: Sound, after: Sound, chipped_before: Sound, chipped_after: Sound) -> Figure:
    """Draw raw slopes and smoothed sound, both with two standard errors, of a whole passage and through a chip."""
    figure = ink.blank_figure(9.8, 5.6)
    middle = (CHIPPED_GROUP + 0.75) * 469.53e-6
    for axes, (a, b), name in zip(
        figure.subplots(2, 1, sharex=True, sharey=True),
        ((before, after), (chipped_before, chipped_after)),
        ("The groove whole", "The same with a piece of the wall missing"),
        strict=True,
    ):
        here = np.abs(a.arc_m - middle) < 0.55e-3
        arc_mm = 1e3 * a.arc_m[here]
        axes.errorbar(
            arc_mm,
            100 * a.velocity[here],
            200 * a.sigma[here],
            fmt=".",
            color=ink.GREY,
            ecolor=ink.PALE,
            markersize=3,
            label="raw, ± 2σ",
        )
        low, high = (100 * (b.velocity + side * 2 * b.sigma)[here] for side in (-1, 1))
        axes.fill_between(arc_mm, low, high, color=ink.SKY, alpha=0.45, linewidth=0, label="smoothed, ± 2σ")
        axes.plot(arc_mm, 100 * b.velocity[here], color=ink.BLUE, linewidth=1.4)
        axes.plot(arc_mm, 100 * b.true[here], color=ink.BLACK, linewidth=1.0, linestyle="--", label="truth")
        axes.set_ylim(-22, 22)
        ink.dress(axes, x="place along the groove, s (mm)", y="velocity (cm/s)")
        ink.heading(axes, name)
    ink.legend_above(figure.axes[0], columns=3)
    figure.axes[0].set_xlabel("")
    return figure


def _row(name: str, sound: Sound) -> tuple[str, ...]:
    return (
        name,
        f"{sound.r:.3f}",
        f"{sound.signal_to_noise_db:+.1f}",
        f"{100 * sound.real:.2f}",
        f"{100 * sound.claimed:.2f}",
        percent(sound.within_two_sigma),
    )


def make(folder: Path = FOLDER) -> Page:
    """Write the page."""
    take, chipped = film(), film(chipped=True)
    sizes = {size: both(take, neighbourhood_px=size) for size in NEIGHBOURHOODS_PX}
    (before, after), (broken_before, broken_after) = sizes[100.0], both(chipped)
    gain_db = after.signal_to_noise_db - before.signal_to_noise_db
    spliced = splice_gain()
    spread = [
        sizes[NEIGHBOURHOODS_PX[-1]][i].signal_to_noise_db - sizes[NEIGHBOURHOODS_PX[0]][i].signal_to_noise_db
        for i in (0, 1)
    ]
    page = Page("kalman", "Kalman filtering (an index term)", folder=folder)
    page.finding = (
        f"On the same traces the Kalman smoother gains {gain_db:.1f} dB (r from {before.r:.3f} to "
        f"{after.r:.3f}), with error bars of "
        f"{100 * after.claimed:.2f} cm/s for errors of {100 * after.real:.2f} (raw: "
        f"{100 * before.claimed:.2f} for {100 * before.real:.2f})."
    )
    page.say("""The paper lists *Kalman filtering* among its index terms and never mentions it again. Here is what it
        is used for by us.

        **Smoothing the sound** ([`tonearm/kalman.py`](../../../src/gramoscope/tonearm/kalman.py), run by
        [`tonearm/follow.py`](../../../src/gramoscope/tonearm/follow.py)). Orientations come every ten pixels, each
        with its standard error, some with flags, twice where groups overlap. The slope of the groove is taken for a
        stationary Gaussian process of Matérn's kind, order 3/2, whose state has two numbers: slope and its change. A
        Kalman filter goes along the groove, the smoother of Rauch, Tung and Striebel comes back, and what the process
        is like (how loud, how quick) is learned from the first groups by maximum likelihood. Samples far off their
        prediction get no weight. Where nothing is measured the estimate relaxes to zero and its error to that of not
        knowing.

        **Splicing the groups** ([`tonearm/splice.py`](../../../src/gramoscope/tonearm/splice.py)). Where each group
        begins is a filter with one number: the overlap with the group before predicts, the encoder corrects.""")
    page.claims(
        [
            Claim(
                "index terms",
                "Kalman Filtering",
                f"+{gain_db:.1f} dB on the same traces",
                "the paper does not say where it filters, nor what that gains",
            ),
            Claim(
                "7",
                "(not claimed) joining of the groups",
                f"{1e6 * spliced.nominal_m:.2f} µm error at nominal places, {1e6 * spliced.spliced_m:.3f} µm "
                "spliced (rms)",
                "the paper is silent on how 6000 groups are joined",
            ),
            Claim(
                "7, fig. 7",
                "missing parts are filled in by the line",
                "by the smoother, with an error bar",
                "the line's slope enters with an error as large as music: through the chip the passage keeps "
                f"{broken_after.signal_to_noise_db:+.1f} of {after.signal_to_noise_db:+.1f} dB",
            ),
        ]
    )
    page.head("Before and after, on the same traces")
    page.say(f"""{GROUPS} groups of {FRAMES} frames of noise between 200 Hz and 6 kHz, 3 cm/s. *Raw* takes the samples
        as they come, averaged where groups overlap, and leaves out slopes above {GATE:g}; no band limit, no gain
        taken out. Error and error bar are root mean squares.""")
    page.picture(
        traces_figure(before, after, broken_before, broken_after),
        "traces",
        """Raw and smoothed velocity of the groove with two standard errors, whole, and with a piece of the wall
        missing. In the gap the raw slopes are missing, or guesses from the Hough line with wide bars; the smoother
        lets its own bar grow.""",
    )
    page.table(
        ("", "r", "signal to noise (dB)", "error (cm/s)", "error bar (cm/s)", "within two bars"),
        [
            row
            for name, pair in (("whole", (before, after)), ("with a chip", (broken_before, broken_after)))
            for row in (_row(f"{name}, raw", pair[0]), _row(f"{name}, smoothed", pair[1]))
        ],
    )
    page.say(f"""The raw error bars are about right ({100 * before.claimed:.2f} for {100 * before.real:.2f} cm/s), the
        smoothed ones are {after.claimed / after.real:.1f} times as large as the errors: on the safe side.
        Neighbourhoods that overlap share errors, and the smoother is told that half a neighbourhood of samples has
        one and the same. Yet those that overlap little err the opposite way, because a centroid that tilts the one up
        tilts the other down; that is more than its state of two numbers can know.""")
    page.head("What remains of the choice of a neighbourhood")
    page.say(f"""[Section 6](orientation.md) of the paper chooses 100 pixels as the best compromise. For raw slopes
        the size matters much: from {NEIGHBOURHOODS_PX[0]:.0f} to {NEIGHBOURHOODS_PX[-1]:.0f} pixels they gain
        {spread[0]:.1f} dB. The smoother knows how noisy each slope is, and leaves {spread[1]:.1f} dB of that. With
        music up to 6 kHz a larger neighbourhood than the paper's would be better even so; what speaks for 100 is
        treble, which a long neighbourhood averages away for good.""")
    page.table(
        ("neighbourhood (px)", "raw: signal to noise (dB)", "smoothed (dB)", "smoothed: r"),
        [
            (f"{size:.0f}", f"{a.signal_to_noise_db:+.1f}", f"{b.signal_to_noise_db:+.1f}", f"{b.r:.3f}")
            for size, (a, b) in sizes.items()
        ],
    )
    page.write()
    return page


if __name__ == "__main__":
    make()
