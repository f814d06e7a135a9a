"""Section 5.2 and figures 5c–d: three lines from the places of the flow, two regions and their centroid lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from experiments.seed_paper.page import FOLDER, Claim, Page, percent
from experiments.seed_paper.pictures import draw_accumulator, draw_regions
from experiments.seed_paper.take import NOISE_RATE_HZ, Take, film_in_memory, noise_sound, short_bench
from gramoscope.camera.noise import SensorNoise
from gramoscope.conventions import FloatArray, deg
from gramoscope.listening import ink
from gramoscope.pickup.search import HoughSearch
from gramoscope.pickup.seed_paper import Reading, SeedPaperPickup
from gramoscope.player.recipe import load_recipe
from gramoscope.simulation.scene import LEVEL_M_S, Scene, filming_bench

SEED, FRAMES = 11, 12
FIRST, GROUPS = 6, 6
LOUD = 3.0
"""The loud passage is so many times the ordinary level."""
ROLES = ("1, outer wall, through the glass", "2, inner wall, through the glass", "3, inner wall, beside the glass")


@dataclass(frozen=True)
class StripeFound:
    """One line of the Hough transform and the centroids of its region, against the truth."""

    theta_deg: float
    rho_px: float
    votes: float
    row_error_px: float
    slope: float
    true_slope: float
    points: int
    centroid_rms_px: float
    filled_share: float


def straight_search() -> HoughSearch:
    """Return the paper's own search: the whole picture at once."""
    return replace(load_recipe("seed-paper").cartridge_for(filming_bench()).hough, segments=1)


def sound() -> FloatArray:
    """Return the noise between 200 Hz and 4 kHz that is cut."""
    return noise_sound(low_hz=200, high_hz=4000, seconds=0.1, seed=SEED)


def film(level_m_s: float, count: int = 1) -> Take:
    """Film some groups of noise between 200 Hz and 4 kHz."""
    scene = Scene(short_bench(frames=FRAMES, groups=FIRST + GROUPS), seed=SEED, level_m_s=level_m_s)
    return film_in_memory(sound(), NOISE_RATE_HZ, scene, range(FIRST, FIRST + count))


def stripes_found(take: Take, reading: Reading) -> list[StripeFound]:
    """Return every stripe of the first group as it was found, against where it truly runs."""
    columns = np.arange(reading.canvas.mean.shape[1], dtype=np.float64)
    true_rows = take.stripe_rows(take.groups[0], columns)
    segment, found = reading.segments[0], []
    for number, line in enumerate(segment.lines):
        assert line is not None
        centre = reading.centrelines[number]
        off = centre.row - true_rows[number]
        straight = np.polyfit(columns, true_rows[number], 1)
        found.append(
            StripeFound(
                theta_deg=deg(line.theta_rad),
                rho_px=line.rho_px,
                votes=line.votes,
                row_error_px=float(line.row_at(line.column_origin) - np.polyval(straight, line.column_origin)),
                slope=line.slope,
                true_slope=float(straight[0]),
                points=int(np.count_nonzero(reading.label == number)),
                centroid_rms_px=float(np.sqrt(np.mean(off[centre.measured] ** 2))),
                filled_share=float(np.mean(~centre.measured)),
            )
        )
    return found


def stripes_apart_px(reading: Reading) -> float:
    """Return the median distance of the two stripes of the wall that is kept."""
    low, high = (reading.centrelines[number] for number in reading.kept)
    return float(np.median((high.row - low.row)[low.measured & high.measured]))


def noiseless_centroid_rms_px() -> float:
    """Return how far the centroids of the middle stripe err in the same picture from a camera without noise."""
    take = film(LEVEL_M_S)
    quiet = replace(take.scene, noise=SensorNoise(full_well_electrons=1e9, read_electrons=0.0))
    take = film_in_memory(sound(), NOISE_RATE_HZ, quiet, [FIRST])
    reading = replace(load_recipe("seed-paper").cartridge_for(quiet.bench), hough=straight_search()).inspect(
        take.groups[0]
    )
    assert reading is not None
    return stripes_found(take, reading)[1].centroid_rms_px


def slope_error(take: Take, pickup: SeedPaperPickup) -> tuple[float, float, float]:
    """Return rms error of the slopes, the rms of the true ones, and the share of samples that were filled in."""
    errors, slopes, filled = [], [], []
    for group in take.groups:
        trace = pickup.read(group)
        wall = int(np.argmax(np.isfinite(trace.slope).sum(axis=1)))
        true = take.slope(group, np.arange(trace.slope.shape[1]) * float(pickup.orientation.stride_px))
        measured = trace.flags[wall] == 0
        errors.append((trace.slope[wall] - true)[measured])
        slopes.append(true)
        filled.append(~measured)
    rms = (float(np.sqrt(np.mean(np.concatenate(values) ** 2))) for values in (errors, slopes))
    return (*rms, float(np.mean(np.concatenate(filled))))  # type: ignore[return-value]


def hough_figure(reading: Reading, search: HoughSearch) -> Figure:
    """Draw the accumulator with its peaks boxed, and the regions with their centroid lines."""
    figure = ink.blank_figure(9.6, 3.6)
    left, right = figure.subplots(1, 2, width_ratios=[1, 2.1])
    draw_accumulator(left, reading.segments[0], search, reading.segments[0].lines)
    draw_regions(right, reading)
    ink.heading(left, "c  Accumulator, peaks boxed")
    ink.heading(right, "d  Regions and centroid lines")
    return figure


def _segments_table(page: Page, pickup: SeedPaperPickup, takes: dict[str, Take]) -> None:
    rows = []
    for name, take in takes.items():
        for segments in (1, 2, 4, 8):
            search = replace(pickup.hough, segments=segments)
            error, true, filled = slope_error(take, replace(pickup, hough=search))
            rows.append((name, str(segments), f"{1e3 * error:.2f}", f"{1e3 * true:.1f}", percent(filled, 1)))
    page.table(("passage", "segments", "error of the slope (10⁻³ rms)", "slope (10⁻³ rms)", "filled in"), rows)


def make(folder: Path = FOLDER) -> Page:
    """Write the page."""
    take, search = film(LEVEL_M_S, GROUPS), straight_search()
    pickup = load_recipe("seed-paper").cartridge_for(take.scene.bench)
    reading = replace(pickup, hough=search).inspect(take.groups[0])
    assert reading is not None
    found = stripes_found(take, reading)
    apart_px, expected_px = stripes_apart_px(reading), float(np.diff(take.scene.bench.stripe_rows())[1])
    share = [float(np.mean(reading.label == label)) for label in (-1, -2)]
    quiet = noiseless_centroid_rms_px()
    page = Page("hough", "The Hough transform and the two regions (section 5.2, figure 5c–d)", folder=folder)
    page.finding = (
        f"Three peaks, as in the paper, each within {max(abs(f.row_error_px) for f in found):.1f} "
        "pixels of its stripe; the two kept stripes lie "
        f"{apart_px:.1f} pixels apart where a 45° wall and the glass make {expected_px:.1f}."
    )
    page.say("""Points with flow lie along stripes, and stripes are nearly straight, so the paper lets every point
        vote for all lines x cos θ + y sin θ = ρ through it. With θ between −45° and 45° the lines are those that run
        more or less along the columns, provided that **x is the row and y the column**: the paper does not say so,
        but with x along the groove its stripes would have θ near 90° and lie outside the accumulator. The picture is
        the frame of [in focus](in_focus.md).""")
    page.picture(
        hough_figure(reading, search),
        "lines",
        """Accumulator (square root of the votes) with its three peaks, and the points of the regions; compare figures
        5c and 5d of the paper. Grey: stripe 1, set aside. Orange and blue: the two stripes that make the wall, with
        their centroid lines in black. Red: points in no region, or disputed. Violet: columns filled in from the line.""",
    )
    page.claims(_claims(reading, found, share, search))
    page.head("What was found, against what is there")
    page.table(
        (
            "line",
            "θ (°)",
            "ρ (px)",
            "votes",
            "row, error in the middle (px)",
            "slope",
            "slope of the true stripe",
            "points",
            "centroids, rms error (px)",
            "filled in",
        ),
        [
            (
                ROLES[i],
                f"{f.theta_deg:+.0f}",
                f"{f.rho_px:+.0f}",
                f"{f.votes:.0f}",
                f"{f.row_error_px:+.2f}",
                f"{f.slope:+.4f}",
                f"{f.true_slope:+.4f}",
                str(f.points),
                f"{f.centroid_rms_px:.2f}",
                percent(f.filled_share, 1),
            )
            for i, f in enumerate(found)
        ],
    )
    page.say(f"""A step of 1° is a step of {np.tan(np.deg2rad(1)):.4f} in slope, and the music swings between about ±
        {1.5 * LEVEL_M_S / 0.939:.2f}: the transform finds *which points belong together*, it does not measure the
        sound. That is done by the centroids of each column and the planes through them
        ([orientation](orientation.md)). A centroid errs by {found[1].centroid_rms_px:.1f} pixels
        ({found[1].centroid_rms_px * 0.390625:.2f} µm) because the grains of a stripe are few and random: with a
        camera without noise it would still err by {quiet:.1f} pixels.

        The stripes kept lie {apart_px:.1f} pixels apart; the glass and a 45° wall make {expected_px:.1f}. The search
        believes any distance within 15 % of that; the rest is measured.""")
    page.head("Straight across half a millimetre?")
    page.say(f"""Half a millimetre of groove is half a millisecond: half a turn of a 1 kHz tone. A loud passage is no
        straight line across the picture any more, and its points leave the box of one peak. The recipe therefore cuts
        the picture into 4 stretches of columns with a transform each, our one departure from section 5.2. {GROUPS}
        groups each, the second passage {LOUD:g} times as loud as an ordinary one; what is filled in does not count in
        the error:""")
    _segments_table(
        page,
        pickup,
        {
            "ordinary (3 cm/s rms)": take,
            f"loud ({100 * LOUD * LEVEL_M_S:.0f} cm/s rms)": film(LOUD * LEVEL_M_S, GROUPS),
        },
    )
    page.write()
    return page


def _claims(reading: Reading, found: list[StripeFound], share: list[float], search: HoughSearch) -> list[Claim]:
    steps = np.rad2deg(search.theta_rad)
    return [
        Claim("5.2", "θ from −45° to 45° in steps of 1°", f"{steps[0]:.0f}° … {steps[-1]:.0f}°, {steps.size} angles"),
        Claim(
            "5.2",
            "three global peaks are three lines",
            f"{len(found)} lines; votes {', '.join(f'{f.votes:.0f}' for f in found)}",
        ),
        Claim(
            "5.2",
            "a point in one and only one region belongs to it; one in several is discarded",
            f"{percent(share[1], 1)} disputed, {percent(share[0], 1)} in no region",
            "the paper gives no size of the region; ours is ± 1.5°, ± 9 pixels",
        ),
        Claim(
            "5.2",
            "the top stripe is discarded",
            f"stripe 1 is set aside, {', '.join(str(k + 1) for k in reading.kept)} are kept",
        ),
        Claim(
            "5.2",
            "void sections are filled from the peak's line",
            f"{percent(found[1].filled_share, 1)} and {percent(found[2].filled_share, 1)} of the columns",
            "filled columns are flagged and take no part in the fit: a straight line has the wrong slope "
            "wherever there is music",
        ),
    ]


if __name__ == "__main__":
    make()
