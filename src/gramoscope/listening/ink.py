"""The look of our pictures: colours that the colour-blind can tell apart, thin axes, units on every axis.

Colours are those of M. Okabe and K. Ito, Color Universal Design, 2008. Nothing global is touched: every setting goes to the
axes it concerns.
"""

from __future__ import annotations

import os
from io import BytesIO
from pathlib import Path
from typing import Literal

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from gramoscope.conventions import FloatArray
from gramoscope.listening.whole_file import written_whole

BLACK = "#1b1b1f"
GREY = "#8a8d93"
PALE = "#e6e7ea"
BLUE = "#0072b2"
SKY = "#56b4e9"
ORANGE = "#e69f00"
VERMILLION = "#d55e00"
YELLOW = "#f0e442"
PURPLE = "#cc79a7"

DOTS_PER_INCH = 150
DOTS_ACROSS = 1400
"""Width of the data area of our figures; more samples than this are drawn by their extremes."""
SMALL = 8.5
MEDIUM = 10.0
LARGE = 13.0
LEGEND_LINE = 1.55 * SMALL
PNG_LEVEL = 1
"""A picture of a film gets a sixth larger so than packed as usual, in a third of the time."""


def blank_figure(width_in: float, height_in: float) -> Figure:
    """Return an empty white figure that arranges its axes by itself."""
    layout = ConstrainedLayoutEngine(h_pad=0.09, w_pad=0.05)
    return Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, layout=layout, facecolor="white")


MARGINS_IN = {"left": 0.78, "right": 0.2, "bottom": 0.52, "top": 0.3}
GAP_IN = 0.42
"""Between axes that stand on each other, for a legend."""


def small_figure(width_in: float, height_in: float, *height_ratios: float) -> tuple[Figure, list[Axes]]:
    """Return a white figure with axes on each other, one for each ratio, within margins that suit small ones.

    An arrangement that looks for the room that letters need takes as long as all the drawing.
    """
    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, facecolor="white")
    inside_in = height_in - MARGINS_IN["bottom"] - MARGINS_IN["top"]
    mean_in = (inside_in - GAP_IN * (len(height_ratios) - 1)) / len(height_ratios)
    figure.subplots_adjust(
        left=MARGINS_IN["left"] / width_in,
        right=1 - MARGINS_IN["right"] / width_in,
        bottom=MARGINS_IN["bottom"] / height_in,
        top=1 - MARGINS_IN["top"] / height_in,
        hspace=GAP_IN / mean_in,
    )
    axes = figure.subplots(len(height_ratios), 1, sharex=True, height_ratios=list(height_ratios), squeeze=False)
    return figure, list(axes[:, 0])


def dress(axes: Axes, *, x: str, y: str, grid: bool = True) -> None:
    """Give axes their labels and the common look.

    Parameters
    ----------
    axes : Axes
    x, y : str
        Labels with their units.
    grid : bool
        Whether faint lines are drawn behind the data.
    """
    axes.set_xlabel(x, fontsize=MEDIUM, color=BLACK)
    axes.set_ylabel(y, fontsize=MEDIUM, color=BLACK)
    axes.tick_params(labelsize=SMALL, color=GREY, labelcolor=BLACK, length=3)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(GREY)
    if grid:
        axes.grid(True, color=PALE, linewidth=0.7)
        axes.set_axisbelow(True)


def heading(axes: Axes, text: str, *, lines_below: int = 0) -> None:
    """Write a heading above axes, at their left edge, with room for lines of a legend below it."""
    pad = 7 + lines_below * LEGEND_LINE
    axes.set_title(text, loc="left", fontsize=MEDIUM, color=BLACK, fontweight="bold", pad=pad)


def legend_above(axes: Axes, *, columns: int, side: Literal["left", "right"] = "right") -> None:
    """List what is drawn just above axes, at one of their edges."""
    axes.legend(
        loc="lower left" if side == "left" else "lower right",
        bbox_to_anchor=(0.0 if side == "left" else 1.0, 1.0),
        ncols=columns,
        fontsize=SMALL,
        frameon=False,
        labelcolor=BLACK,
        borderpad=0.1,
        borderaxespad=0.3,
        columnspacing=1.4,
        handlelength=1.8,
    )


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def power_of_ten(exponent: int) -> str:
    """Return 10 with a raised exponent, as letters: matplotlib's own formulas take longer than all the rest of a picture."""
    return "10" + str(exponent).translate(_RAISED)


def readable_time(time_s: FloatArray) -> tuple[FloatArray, str]:
    """Time in the unit that suits its span, and the unit's name."""
    return (time_s, "s") if len(time_s) and time_s[-1] - time_s[0] > 1 else (1e3 * time_s, "ms")


def png_of(figure: Figure) -> bytes:
    """Return a figure, which is finished by that, as PNG; equal figures give equal bytes."""
    into, lightly = BytesIO(), {"compress_level": PNG_LEVEL}
    _arrange(figure)
    figure.savefig(into, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None}, pil_kwargs=lightly)
    return into.getvalue()


def svg_of(figure: Figure) -> bytes:
    """Return a figure, which is finished by that, as SVG, its letters as letters; equal figures give equal bytes."""
    into = BytesIO()
    _arrange(figure)
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "gramoscope"}):
        figure.savefig(into, format="svg", metadata={"Date": None, "Creator": None})
    return into.getvalue()


def _arrange(figure: Figure) -> None:
    """Arrange the axes once and for all: to do it while saving, matplotlib draws everything twice."""
    layout = figure.get_layout_engine()
    if layout is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")


def save_png(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure as a PNG file that appears whole or not at all; equal figures give equal bytes.

    Parameters
    ----------
    figure : Figure
    path : path
        The folder must exist.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    with written_whole(Path(path)) as temporary:
        temporary.write_bytes(png_of(figure))
