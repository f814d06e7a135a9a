"""Playback curves of recording characteristics, few enough to a panel to be told apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from gramoscope.disc.characteristics import Characteristic
from gramoscope.errors import require
from gramoscope.listening import ink

COLOURS = (ink.BLACK, ink.BLUE, ink.ORANGE, ink.SKY, ink.VERMILLION, ink.PURPLE, ink.GREY)
DASHES = ("solid", (0, (5, 2)), (0, (1, 1.5)))
SHOWN_HZ = np.geomspace(20, 20_000, 400)
HIGH_TURNOVER_HZ = 390.0


def characteristics_figure(curves: Sequence[Characteristic]) -> Figure:
    """Draw what playback does to the velocity, 0 dB at 1 kHz: a panel for each kind of curve that there is.

    Parameters
    ----------
    curves : sequence of Characteristic
        At least one; their titles stand in the legends.

    Returns
    -------
    Figure
    """
    require(len(curves) > 0, "no curves", "at least one")
    kinds: dict[str, list[Characteristic]] = {}
    for curve in curves:
        kinds.setdefault(_kind(curve), []).append(curve)
    across = min(2, len(kinds))
    down = -(-len(kinds) // across)
    figure = ink.blank_figure(5.6 * across, 4.3 * down)
    panels = figure.subplots(down, across, squeeze=False).reshape(-1)
    for axes, (kind, members) in zip(panels, kinds.items(), strict=False):
        _draw_kind(axes, kind, members)
    for spare in panels[len(kinds) :]:
        spare.set_axis_off()
    return figure


def _kind(curve: Characteristic) -> str:
    if curve.shelf_hz is not None:
        return "Bass turnover with a shelf"
    if curve.rolloff_hz is None:
        return "No treble roll-off"
    high = curve.turnover_hz is not None and curve.turnover_hz >= HIGH_TURNOVER_HZ
    return f"Treble roll-off, turnover {'of 400 Hz and more' if high else 'below 400 Hz'}"


def _draw_kind(axes: Axes, kind: str, curves: Sequence[Characteristic]) -> None:
    for number, curve in enumerate(curves):
        level_db = 20 * np.log10(np.abs(curve.playback_response(SHOWN_HZ)))
        dash = DASHES[number // len(COLOURS) % len(DASHES)]
        colour = COLOURS[number % len(COLOURS)]
        axes.semilogx(SHOWN_HZ, level_db, color=colour, linestyle=dash, linewidth=1.3, label=curve.title)
    axes.set_xlim(SHOWN_HZ[0], SHOWN_HZ[-1])
    axes.set_ylim(-26, 36)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1e3:g} k" if value >= 1e3 else f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    ink.dress(axes, x="frequency (Hz)", y="playback, dB re 1 kHz")
    ink.heading(axes, kind)
    axes.legend(fontsize=ink.SMALL, frameon=False, labelcolor=ink.BLACK)
