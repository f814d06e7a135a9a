"""Pictures: the groove with what was found in it; two sounds side by side are in `comparison_figure`.

In pictures of the groove s runs to the right and l upwards, as one looks down on the record with the centre of the disc
beyond the top edge: a stripe that climbs is a positive velocity, and the waveform below climbs with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import Stroke

from gramoscope.conventions import MICROMETRES_PER_METRE, FloatArray, arc_of_column_m, lateral_of_row_m
from gramoscope.errors import require
from gramoscope.listening import ink
from gramoscope.listening.comparison_figure import comparison_figure
from gramoscope.listening.envelope import extremes
from gramoscope.listening.ink import DOTS_ACROSS, readable_time, save_png
from gramoscope.signal_path import ImageArray

__all__ = ["StripeLine", "Waveform", "comparison_figure", "groove_figure", "save_png"]

BoolArray = npt.NDArray[np.bool_]

STRIPE_COLOURS = (ink.ORANGE, ink.SKY, ink.YELLOW, ink.PURPLE)
FILLED_IN = (0, (4, 3))
TALLEST_IN = 9.0
"""Pictures that would be taller are drawn narrower."""
LONGEST_LINE = 135
"""Letters of stripes' names that fit side by side."""

_CM = 100.0


class StripeLine(NamedTuple):
    """A stripe as it was found in one frame.

    Attributes
    ----------
    name : str
        For the legend: "inner wall, through the glass".
    columns, rows : float64 arrays, shape (point,)
        Canonical pixels, columns rising; NaN is not drawn.
    measured : bool array, shape (point,)
        False where the line was filled in.
    """

    name: str
    columns: FloatArray
    rows: FloatArray
    measured: BoolArray


class Waveform(NamedTuple):
    """A sound with its error bars.

    Attributes
    ----------
    time_s : float64 array, shape (sample,)
        Even steps.
    velocity_m_s, sigma_m_s : float64 arrays, shape (sample,)
        NaN is not drawn.
    interpolated : bool array, shape (sample,)
        True where nobody measured.
    """

    time_s: FloatArray
    velocity_m_s: FloatArray
    sigma_m_s: FloatArray
    interpolated: BoolArray


def groove_figure(
    image: ImageArray,
    *,
    white_level: int,
    pixel_pitch_m: float,
    stripes: Sequence[tuple[str, FloatArray, FloatArray, BoolArray]],
    glass_edge_row: float | None,
    waveform: tuple[FloatArray, FloatArray, FloatArray, BoolArray],
    title: str,
    heading: str = "One frame, and the stripes found in it",
) -> Figure:
    """Draw one frame with the stripes found in it, and below it the sound of the whole passage.

    Parameters
    ----------
    image : uint8 or uint16 array, shape (row, column)
        Canonical.
    white_level : int
        Pixel value of full scale.
    pixel_pitch_m : float
    stripes : sequence of (name, columns, rows, measured)
        As in `StripeLine`; measured parts are drawn solid, filled-in ones dashed.
    glass_edge_row : float, optional
        Canonical row; None draws no edge.
    waveform : (time_s, velocity_m_s, sigma_m_s, interpolated)
        As in `Waveform`; a long one is drawn by its extremes. Two sigma are drawn about it, and interpolated spans shaded.
    title, heading : str
        Of all, and of the frame.

    Returns
    -------
    Figure

    Raises
    ------
    ArgumentError
        If the image is not one picture, or the parts of the waveform differ in length.
    """
    require(image.ndim == 2, f"an image of shape {image.shape}", "shape (row, column)")
    sound = Waveform(*waveform)
    require(len({len(part) for part in sound}) == 1, "a waveform whose parts differ in length", "equal lengths")
    height_in = min(10.5 * image.shape[0] / image.shape[1], TALLEST_IN)
    figure = ink.blank_figure(11.0, height_in + 5.2)
    figure.suptitle(title, x=0.012, ha="left", fontsize=ink.LARGE, color=ink.BLACK)
    above, below = figure.subplots(2, 1, height_ratios=[height_in, 3.0])
    _draw_frame(above, image, white_level=white_level, pixel_pitch_m=pixel_pitch_m)
    for line, colour in zip(stripes, _colours([line[0] for line in stripes]), strict=True):
        _draw_stripe(above, StripeLine(*line), colour=colour, height_px=image.shape[0], pixel_pitch_m=pixel_pitch_m)
    if glass_edge_row is not None:
        _draw_glass_edge(above, float(_lateral_um(glass_edge_row, image.shape[0], pixel_pitch_m)))
    _name_stripes(above, [line[0] for line in stripes], heading)
    draw_waveform(below, sound)
    return figure


def frame_figure(
    image: ImageArray,
    *,
    white_level: int,
    pixel_pitch_m: float,
    stripes: Sequence[tuple[str, FloatArray, FloatArray, BoolArray]],
) -> Figure:
    """Draw one frame with the stripes found in it, small, for a page; parameters as in `groove_figure`."""
    require(image.ndim == 2, f"an image of shape {image.shape}", "shape (row, column)")
    width_in = 4.6
    across_in = width_in - ink.MARGINS_IN["left"] - ink.MARGINS_IN["right"]
    along_in = ink.MARGINS_IN["bottom"] + ink.MARGINS_IN["top"]
    figure, (axes,) = ink.small_figure(width_in, across_in * image.shape[0] / image.shape[1] + along_in, 1.0)
    _draw_frame(axes, image, white_level=white_level, pixel_pitch_m=pixel_pitch_m)
    for line, colour in zip(stripes, _colours([line[0] for line in stripes]), strict=True):
        _draw_stripe(axes, StripeLine(*line), colour=colour, height_px=image.shape[0], pixel_pitch_m=pixel_pitch_m)
    ink.dress(axes, x="along the groove (µm)", y="across (µm)", grid=False)
    return figure


def _colours(names: Sequence[str]) -> list[str]:
    """One for each kind of line; those that the legend does not name follow in the order of those that it does."""
    kinds = sum(not name.startswith("_") for name in names) or len(names)
    return [STRIPE_COLOURS[number % min(kinds, len(STRIPE_COLOURS))] for number in range(len(names))]


def _lateral_um(row: npt.ArrayLike, height_px: int, pixel_pitch_m: float) -> FloatArray:
    return lateral_of_row_m(row, height_px=height_px, pixel_pitch_m=pixel_pitch_m) * MICROMETRES_PER_METRE


def _arc_um(column: npt.ArrayLike, pixel_pitch_m: float) -> FloatArray:
    return arc_of_column_m(column, arc_start_m=0.0, pixel_pitch_m=pixel_pitch_m) * MICROMETRES_PER_METRE


def _draw_frame(axes: Axes, image: ImageArray, *, white_level: int, pixel_pitch_m: float) -> None:
    height_px, width_px = image.shape
    left, right = _arc_um([-0.5, width_px - 0.5], pixel_pitch_m)
    bottom, top = _lateral_um([-0.5, height_px - 0.5], height_px, pixel_pitch_m)
    dark, bright = np.percentile(image.astype(np.float32), [0.3, 99.7])
    axes.imshow(
        image,
        cmap="gray",
        vmin=0.7 * float(dark),
        vmax=min(float(white_level), 1.1 * float(bright) + 1.0),
        origin="lower",
        extent=(float(left), float(right), float(bottom), float(top)),
        aspect="equal",
        interpolation="antialiased",
    )
    ink.dress(axes, x="along the groove, s (µm)", y="towards the disc's centre, l (µm)", grid=False)


def _draw_stripe(axes: Axes, line: StripeLine, *, colour: str, height_px: int, pixel_pitch_m: float) -> None:
    arc_um = _arc_um(line.columns, pixel_pitch_m)
    lateral_um = _lateral_um(line.rows, height_px, pixel_pitch_m)
    seen = np.where(line.measured, lateral_um, np.nan)
    filled = np.where(_widened(~line.measured), lateral_um, np.nan)
    outline = [Stroke(linewidth=2.6, foreground="black", alpha=0.55), Stroke(linewidth=1.4)]
    axes.plot(arc_um, seen, color=colour, linewidth=1.4, path_effects=outline, label=line.name)
    axes.plot(arc_um, filled, color=colour, linewidth=1.4, linestyle=FILLED_IN)


def _name_stripes(axes: Axes, names: Sequence[str], heading: str) -> None:
    """Write the heading, and below it which line is which; long names stand in two columns."""
    names = [name for name in names if not name.startswith("_")]
    if not names:
        ink.heading(axes, heading)
        return
    axes.plot([], [], color=ink.GREY, linewidth=1.4, linestyle=FILLED_IN, label="filled in")
    entries = len(names) + 1
    columns = entries if sum(map(len, names)) <= LONGEST_LINE else 2
    ink.heading(axes, heading, lines_below=-(-entries // columns))
    ink.legend_above(axes, columns=columns, side="left")


def _widened(marked: BoolArray) -> BoolArray:
    """Mark the neighbours of marked points too, so that a filled-in part meets the measured ones."""
    wide = marked.copy()
    wide[1:] |= marked[:-1]
    wide[:-1] |= marked[1:]
    return wide


def _draw_glass_edge(axes: Axes, lateral_um: float) -> None:
    axes.axhline(lateral_um, color="white", linewidth=0.9, linestyle=(0, (1, 3)))
    axes.annotate(
        "edge of the glass",
        (1.0, lateral_um),
        xycoords=("axes fraction", "data"),
        xytext=(-6, 3),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=ink.SMALL,
        color="white",
    )


def draw_waveform(axes: Axes, sound: Waveform) -> None:
    """Draw a sound with two sigma about it, interpolated spans shaded; in centimetres a second.

    Parameters
    ----------
    axes : Axes
    sound : Waveform
        More samples than dots are drawn by their extremes.
    """
    count = len(sound.time_s)
    window_samples = max(1, -(-count // DOTS_ACROSS))
    time, unit = readable_time(sound.time_s)
    _shade_interpolated(axes, time, sound.interpolated)
    doubt = 2 * np.where(np.isfinite(sound.sigma_m_s), sound.sigma_m_s, 0.0)
    lowest, _ = extremes(_CM * (sound.velocity_m_s - doubt), window_samples=window_samples)
    _, highest = extremes(_CM * (sound.velocity_m_s + doubt), window_samples=window_samples)
    axes.fill_between(time[::window_samples], lowest, highest, color=ink.SKY, alpha=0.45, lw=0, label="± 2 σ")
    _draw_curve(axes, time, _CM * sound.velocity_m_s, window_samples=window_samples)
    ink.dress(axes, x=f"time ({unit})", y="groove velocity (cm/s)")
    ink.heading(axes, "The sound of the whole passage")
    axes.margins(x=0.0)
    ink.legend_above(axes, columns=3)


def _draw_curve(axes: Axes, time: FloatArray, velocity: FloatArray, *, window_samples: int) -> None:
    if window_samples == 1:
        axes.plot(time, velocity, color=ink.BLUE, linewidth=0.9, label="velocity")
        return
    lowest, highest = extremes(velocity, window_samples=window_samples)
    axes.fill_between(time[::window_samples], lowest, highest, color=ink.BLUE, lw=0.4, label="velocity")


def _shade_interpolated(axes: Axes, time: FloatArray, interpolated: BoolArray) -> None:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], interpolated, [False]]).astype(np.int8)))
    for number, (first, beyond) in enumerate(edges.reshape(-1, 2)):
        last = min(int(beyond), len(time) - 1)
        name = "interpolated" if number == 0 else None
        axes.axvspan(time[first], time[last], color=ink.ORANGE, alpha=0.3, linewidth=0.6, label=name)
