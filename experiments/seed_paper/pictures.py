"""What several pages draw: a picture of the groove, dots where flow was found, an accumulator, lines with their stripes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from scipy import ndimage

from gramoscope.conventions import FloatArray, deg
from gramoscope.listening import ink
from gramoscope.pickup.hough import Line
from gramoscope.pickup.search import HoughSearch, Segment
from gramoscope.pickup.seed_paper import Reading

GREYS, HEAT = colormaps["gray"].resampled(12), colormaps["magma"].resampled(16)
"""Few colours make small files."""
STRIPE_COLOURS = (ink.GREY, ink.ORANGE, ink.SKY)
ROWS = (150, 450)
"""The part of a picture that is shown: the rest is out of focus."""


def draw_picture(axes: Axes, image: FloatArray, *, rows: tuple[int, int] = ROWS) -> None:
    """Draw a frame in greys, from its dark to its bright parts."""
    dark, bright = np.percentile(image, [0.5, 99.8])
    _show(axes, image, vmin=float(dark), vmax=float(bright), rows=rows)


def draw_places(axes: Axes, reading: Reading, *, rows: tuple[int, int] = ROWS) -> None:
    """Draw the places where flow was found, white on black, each two pixels large."""
    dots = np.zeros(reading.canvas.mean.shape)
    dots[reading.point_row, reading.point_column] = 1
    _show(axes, np.asarray(ndimage.maximum_filter(dots, 2)), vmin=0.0, vmax=1.0, rows=rows)


def _show(axes: Axes, image: FloatArray, *, vmin: float, vmax: float, rows: tuple[int, int]) -> None:
    height, width = image.shape
    extent = (-0.5, width - 0.5, -0.5, height - 0.5)
    axes.imshow(
        image,
        cmap=GREYS,
        vmin=vmin,
        vmax=vmax,
        origin="lower",
        aspect="equal",
        interpolation="antialiased",
        extent=extent,
    )
    axes.set_ylim(rows)
    ink.dress(axes, x="column, along the groove (pixels)", y="row (pixels)", grid=False)


def draw_accumulator(axes: Axes, segment: Segment, search: HoughSearch, lines: Sequence[Line | None]) -> None:
    """Draw the votes over ρ and θ, with the boxes of the peaks: the regions that points belong to."""
    votes = segment.accumulator
    theta_deg, rho_px = np.rad2deg(votes.theta_rad), votes.rho_px
    shown = np.abs(rho_px) <= 260
    cells = votes.votes.T[shown].astype(np.float64)
    axes.imshow(
        np.sqrt(cells),
        cmap=HEAT,
        origin="lower",
        aspect="auto",
        interpolation="nearest",
        extent=(theta_deg[0] - 0.5, theta_deg[-1] + 0.5, -260.5, 260.5),
    )
    half_deg, half_px = search.region_theta_deg, search.region_rho_px
    for number, line in enumerate(lines):
        if line is not None:
            corner = (deg(line.theta_rad) - half_deg, line.rho_px - half_px)
            box = Rectangle(corner, 2 * half_deg, 2 * half_px, fill=False, edgecolor="white", linewidth=1.4)
            axes.add_patch(box)
            axes.text(
                corner[0] + 2 * half_deg + 1.5,
                line.rho_px,
                str(number + 1),
                color="white",
                fontsize=ink.MEDIUM,
                va="center",
            )
    ink.dress(axes, x="θ (degrees)", y="ρ (pixels)", grid=False)


def draw_regions(axes: Axes, reading: Reading, *, rows: tuple[int, int] = ROWS) -> None:
    """Draw the points in the colours of their regions, and the centroid lines of the stripes that are kept."""
    for number in range(len(reading.stripes)):
        mine = reading.label == number
        size = 1.2 if number in reading.kept else 0.5
        axes.plot(
            reading.point_column[mine], reading.point_row[mine], ",", color=STRIPE_COLOURS[number], markersize=size
        )
    lost = reading.label < 0
    axes.plot(reading.point_column[lost], reading.point_row[lost], ".", color=ink.VERMILLION, markersize=1.5)
    columns = np.arange(reading.canvas.mean.shape[1])
    for number in reading.kept:
        line = reading.centrelines[number]
        axes.plot(columns, np.where(line.measured, line.row, np.nan), color=ink.BLACK, linewidth=0.7)
        filled = np.where(line.measured, np.nan, line.row)
        axes.plot(columns, filled, ".", color=ink.PURPLE, markersize=1.6)
    axes.set_xlim(-0.5, columns.size - 0.5)
    axes.set_ylim(rows)
    ink.dress(axes, x="column, along the groove (pixels)", y="row (pixels)", grid=False)
