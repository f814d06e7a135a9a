"""Figure 7: a groove with nearly half of a wall missing, and the two lines carried across the gap."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from experiments.seed_paper.hough import straight_search
from experiments.seed_paper.page import FOLDER, Claim, Page, percent
from experiments.seed_paper.pictures import draw_accumulator, draw_picture, draw_places, draw_regions
from experiments.seed_paper.take import NOISE_RATE_HZ, Take, film_in_memory, noise_sound, short_bench
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.disc.damage import NO_DAMAGE, Chip, Damage, Mark
from gramoscope.listening import ink
from gramoscope.pickup.centreline import discard_damaged_columns
from gramoscope.pickup.search import line_rows
from gramoscope.pickup.seed_paper import Reading
from gramoscope.player.recipe import load_recipe
from gramoscope.quality import Quality
from gramoscope.simulation.scene import Scene

SEED, GROUP, FRAMES = 11, 6, 12
CHIP_FROM, CHIP_TO = 0.27, 0.73
"""The chip lies between these shares of the picture's width: nearly half, as in the paper."""


@dataclass(frozen=True)
class OneChip(Damage):
    """A record with one chip in its inner wall, and nothing else."""

    middle_m: float = 0.0
    length_m: float = 0.2e-3

    def marks(
        self, arc_from_m: float, arc_to_m: float, *, groove_width_m: float, groove_middle_m: float, seed: int
    ) -> Iterator[Mark]:
        """Yield the chip: over the whole height of the wall."""
        wall_m = groove_width_m / 2
        yield Chip((self.middle_m, groove_middle_m + 0.55 * wall_m), self.length_m, 0.95 * wall_m, 16e-6, 0.8, seed)


@dataclass(frozen=True)
class Gap:
    """What a gap does to one of the two stripes."""

    measured_outside: float
    measured_inside: float
    error_outside_px: float
    line_error_px: float
    centroid_error_px: float


def film(damaged: bool = True) -> Take:
    """Film one group, with or without the chip."""
    bench = short_bench(frames=FRAMES, groups=GROUP + 1)
    width_m = bench.sensor.width_px * bench.sensor.pixel_pitch_m
    start_m = GROUP * bench.sequence.group_step_m
    chip = OneChip(middle_m=start_m + (CHIP_FROM + CHIP_TO) / 2 * width_m, length_m=(CHIP_TO - CHIP_FROM) * width_m)
    scene = Scene(bench, seed=SEED, damage=chip if damaged else NO_DAMAGE)
    sound = noise_sound(low_hz=200, high_hz=4000, seconds=0.1, seed=SEED)
    return film_in_memory(sound, NOISE_RATE_HZ, scene, [GROUP])


def read(take: Take, *, segments: int | None = None) -> Reading:
    """Read the group, by the paper's search or by one that cuts the picture into segments."""
    pickup = load_recipe("seed-paper").cartridge_for(take.scene.bench)
    search = straight_search() if segments is None else replace(pickup.hough, segments=segments)
    reading = replace(pickup, hough=search).inspect(take.groups[0])
    assert reading is not None
    return reading


def in_chip(width: int) -> BoolArray:
    """Return which columns the chip covers, its ragged rim left out."""
    share = (np.arange(width) + 0.5) / 1280
    return np.asarray((share > CHIP_FROM + 0.02) & (share < CHIP_TO - 0.02))


def gaps(take: Take, reading: Reading) -> list[Gap]:
    """Return what the chip does to the stripes that are kept."""
    width = reading.canvas.mean.shape[1]
    columns, inside = np.arange(width, dtype=np.float64), in_chip(width)
    true, found = take.stripe_rows(take.groups[0], columns), []
    for number in reading.kept:
        line = reading.centrelines[number]
        off, carried = line.row - true[number], line_rows(reading.segments, number) - true[number]
        found.append(
            Gap(
                measured_outside=float(line.measured[~inside].mean()),
                measured_inside=float(line.measured[inside].mean()),
                error_outside_px=_rms(off[line.measured & ~inside]),
                line_error_px=_rms(carried[inside]),
                centroid_error_px=_rms(off[line.measured & inside]),
            )
        )
    return found


def _rms(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def columns_set_aside(reading: Reading) -> float:
    """Return which share of the columns is set aside because damage runs across the stripes there."""
    width = reading.canvas.mean.shape[1]
    before = np.where(reading.label == -3, -1, reading.label)
    after = discard_damaged_columns(before, reading.point_column, width=width)
    return float(np.unique(reading.point_column[after == -3]).size / width)


def slopes_in_gap(take: Take, reading: Reading) -> tuple[float, float, float]:
    """Return, of the samples in the chip: share filled in, rms error of the others, rms standard error of the others."""
    trace = reading.trace
    wall = reading.stripes[reading.kept[0]].wall
    stations = np.arange(trace.slope.shape[1]) * 10.0
    inside = in_chip(reading.canvas.mean.shape[1])[stations.astype(int)]
    filled = (trace.flags[wall] & np.uint16(Quality.INTERPOLATED)) != 0
    error = trace.slope[wall] - take.slope(take.groups[0], stations)
    seen = inside & ~filled
    return float(filled[inside].mean()), _rms(error[seen]), _rms(trace.slope_sigma[wall][seen])


def damage_figure(take: Take, reading: Reading) -> Figure:
    """Draw the frame, the flow, the accumulator and the lines, as in figure 7 of the paper."""
    figure = ink.blank_figure(9.2, 5.0)
    (a, b), (c, d) = figure.subplots(2, 2, height_ratios=[1, 1.7])
    draw_picture(a, take.groups[0].images[0].astype(np.float64))
    draw_places(b, reading)
    draw_accumulator(c, reading.segments[0], straight_search(), reading.segments[0].lines)
    draw_regions(d, reading)
    for axes, text in zip(
        (a, b, c, d),
        ("a  Damaged groove", "b  Places with flow", "c  Accumulator, peaks boxed", "d  Regions and lines"),
        strict=True,
    ):
        ink.heading(axes, text)
    return figure


def make(folder: Path = FOLDER) -> Page:
    """Write the page."""
    take = film()
    reading = read(take)
    found, (filled, error, sigma) = gaps(take, reading), slopes_in_gap(take, reading)
    whole = slopes_in_gap(film(damaged=False), read(film(damaged=False)))
    page = Page("damage", "A groove with half of its wall missing (figure 7)", folder=folder)
    page.finding = (
        f"With {percent(CHIP_TO - CHIP_FROM)} of a wall broken out, both lines are found and carried "
        "across; in the gap they lie "
        f"{found[0].line_error_px:.1f} and {found[1].line_error_px:.1f} pixels (rms) from where the "
        f"wall was, and {percent(filled)} of the samples there are flagged."
    )
    page.say(f"""The group of [in focus](in_focus.md) once more, with a piece broken out of the inner wall:
        {percent(CHIP_TO - CHIP_FROM)} of the picture's length, nearly the whole height of the wall, 16 µm deep, rough
        and of another brightness. The stripes of that wall are the two that the paper keeps.""")
    page.picture(
        damage_figure(take, reading),
        "groove",
        """Damaged groove, places with flow, accumulator with its three peaks, and the lines carried across the gap;
        compare figure 7 of the paper. Violet: columns filled in from the line. Red: points in no region, disputed, or
        in columns set aside.""",
    )
    page.claims(
        [
            Claim(
                "7, fig. 7a",
                "nearly half of the groove walls in this image is missing",
                f"{percent(CHIP_TO - CHIP_FROM)} of the inner wall",
            ),
            Claim(
                "7, fig. 7b",
                "some vertical stripes caused by the damage",
                f"{percent(columns_set_aside(reading), 1)} of the columns hold so many points outside the "
                "regions that they are set aside",
                "setting them aside is ours: where a vertical stripe crosses a region it pulls the centroid",
            ),
            Claim(
                "7, fig. 7c",
                "the Hough transform segments the lines, ignoring the vertical stripes",
                f"{sum(line is not None for line in reading.segments[0].lines)} lines",
                "a vertical stripe has θ near 90°, outside of ± 45°: no line can collect its votes",
            ),
            Claim(
                "7, fig. 7d",
                "missing parts are filled in using the line",
                f"{found[0].line_error_px:.1f} and {found[1].line_error_px:.1f} pixels (rms) from the true wall",
                "a straight line knows nothing of the music in between. We fill in too, and flag it; the "
                "smoother does not believe it",
            ),
        ]
    )
    page.head("What is measured in the gap, and what is believed")
    page.table(
        (
            "stripe",
            "columns measured, outside the chip",
            "inside",
            "centroids, error outside (px rms)",
            "inside",
            "line, error inside (px rms)",
        ),
        [
            (
                str(number + 1),
                percent(g.measured_outside),
                percent(g.measured_inside),
                f"{g.error_outside_px:.1f}",
                "–" if np.isnan(g.centroid_error_px) else f"{g.centroid_error_px:.1f}",
                f"{g.line_error_px:.1f}",
            )
            for number, g in zip(reading.kept, found, strict=True)
        ],
    )
    page.say(f"""In the chip {percent(filled)} of the samples of the wall rest on too few centroids: they take the
        slope of the line, are flagged `SPARSE | INTERPOLATED`, and get an error bar as large as music.
        {_rest(filled, error, sigma)} The same stretch of the same groove without the chip errs by {whole[1]:.4f}
        (claimed: {whole[2]:.4f}), and {percent(whole[0])} of it is filled in. So the gap is *bridged*, as in the
        paper, but nothing that was guessed passes for a measurement: see [Kalman](kalman.md) for what the smoother
        makes of it.""")
    page.write()
    return page


def _rest(filled: float, error: float, sigma: float) -> str:
    if filled >= 1:
        return "Nothing in it counts as measured."
    return (
        "The rest, where enough points of the broken surface happen to be sharp near the line, errs "
        f"by {error:.4f} in slope (rms) "
        f"and claims {sigma:.4f}."
    )


if __name__ == "__main__":
    make()
