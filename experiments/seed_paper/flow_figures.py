"""Pictures of the page on flow."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from experiments.seed_paper.pictures import GREYS, HEAT
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.listening import ink
from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.signal_path import ImageArray

ERROR_LIMITS_PX = (2e-3, 2.0)
TITLE_LETTERS = 26
GROOVE_COLUMNS = 140
"""So much of a groove's picture is drawn: all of it looks alike."""
COLOURS = (ink.VERMILLION, ink.BLUE, ink.ORANGE, ink.BLACK)


def speed_maps(textured: BoolArray, flows: Mapping[str, Flow], *, limits_px: tuple[float, float]) -> Figure:
    """Draw where there is texture, and u of five flows on one scale."""
    figure = ink.blank_figure(9.6, 6.2)
    axes = np.ravel(figure.subplots(2, 3, sharex=True, sharey=True))
    axes[0].imshow(textured, cmap="gray_r", interpolation="nearest")
    _label(axes[0], "gradient of 5 or more")
    for place, (name, flow) in zip(axes[1:], flows.items(), strict=True):
        shown = place.imshow(flow.u, cmap="viridis", vmin=limits_px[0], vmax=limits_px[1], interpolation="nearest")
        _label(place, name)
    bar = figure.colorbar(shown, ax=list(axes), shrink=0.6, extend="both")
    bar.set_label("u, along the columns (pixels a frame)", fontsize=ink.MEDIUM)
    return figure


def _label(axes: Axes, name: str) -> None:
    ink.dress(axes, x="column (px)", y="row (px)", grid=False)
    axes.set_title(textwrap.fill(name, TITLE_LETTERS), loc="left", fontsize=ink.MEDIUM, color=ink.BLACK)


def sweeps_figure(sweeps: Sequence[int], errors: Mapping[str, Sequence[float]], published_deg: float) -> Figure:
    """Draw the mean angular error over the number of sweeps."""
    figure = ink.blank_figure(8.0, 4.2)
    axes = figure.subplots()
    for (name, error), colour in zip(errors.items(), COLOURS, strict=False):
        axes.loglog(sweeps, error, "o-", color=colour, label=name, markersize=4)
    axes.plot(
        [100], [published_deg], "x", color=ink.BLACK, markersize=9, markeredgewidth=2, label="published, 100 sweeps"
    )
    axes.set_xticks(list(sweeps), [str(n) for n in sweeps])
    axes.set_yticks([0.3, 1, 3, 10, 30], ["0.3", "1", "3", "10", "30"])
    axes.minorticks_off()
    ink.dress(axes, x="sweeps", y="mean angular error (°)")
    axes.legend(fontsize=ink.SMALL, frameon=False)
    return figure


def error_over_time(panels: Mapping[str, Sequence[tuple[float, float, bool]]]) -> Figure:
    """Draw error over time, one panel each, of methods given as degrees, seconds, whether ours."""
    figure = ink.blank_figure(10.5, 4.6)
    for axes, (title, points) in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels.items(), strict=True):
        for number, (error, seconds, ours) in enumerate(points, 1):
            colour = ink.BLUE if ours else ink.VERMILLION
            axes.loglog(1e3 * seconds, error, "o" if ours else "s", color=colour, markersize=6)
            axes.annotate(
                str(number),
                (1e3 * seconds, error),
                (5, 4),
                textcoords="offset points",
                fontsize=ink.SMALL,
                color=colour,
            )
        ink.dress(axes, x="time for one flow, one core (ms)", y="mean angular error (°)")
        axes.set_title(title, loc="left", fontsize=ink.MEDIUM, fontweight="bold", pad=7)
        axes.margins(0.12)
    return figure


def groove_maps(image: ImageArray, sharp: BoolArray, errors: Mapping[str, FloatArray]) -> Figure:
    """Draw a groove frame with its sharp zones outlined, and maps of the end-point error on one logarithmic scale."""
    image, sharp = image[:, :GROOVE_COLUMNS], sharp[:, :GROOVE_COLUMNS]
    figure = ink.blank_figure(10.4, 5.0)
    axes = np.ravel(figure.subplots(1, 1 + len(errors), sharex=True, sharey=True))
    axes[0].imshow(image, cmap=GREYS, interpolation="nearest")
    _label(axes[0], "the frame; dotted: sharp zones")
    for place, (name, error) in zip(axes[1:], errors.items(), strict=True):
        shown = place.imshow(
            error[:, :GROOVE_COLUMNS], cmap=HEAT, norm=LogNorm(*ERROR_LIMITS_PX), interpolation="nearest"
        )
        _label(place, name)
    for place in axes:
        place.contour(sharp, levels=[0.5], colors=ink.SKY, linewidths=0.7, linestyles="dotted")
    bar = figure.colorbar(shown, ax=list(axes), shrink=0.6, extend="both")
    bar.set_label("end-point error (pixels a frame)", fontsize=ink.MEDIUM)
    return figure
