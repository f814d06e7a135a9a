"""Pictures for the statement of quality: spectra, shares along time, the response that was applied.

Small ones, for a page that is read on a phone too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from gramoscope.conventions import FloatArray
from gramoscope.listening import ink
from gramoscope.listening.ink import readable_time

WIDTH_IN, HEIGHT_IN = 4.6, 3.1
NOTHING = (1e-3, 1.0)
"""The upright axis of what has no positive values."""
SHARES = (("measured", ink.BLUE), ("bridged", ink.ORANGE), ("missing", ink.VERMILLION))


def band_figure(bands: Mapping[str, Any]) -> Figure:
    """Draw sound and claimed error in each third of an octave, cm/s.

    Parameters
    ----------
    bands : mapping
        `centre_hz`, `sound_rms_cm_s`, `error_rms_cm_s`: arrays of one length; NaN is not drawn.
    """
    figure, axes = _blank()
    centre, sound, error = (_positive(bands[name]) for name in ("centre_hz", "sound_rms_cm_s", "error_rms_cm_s"))
    axes.fill_between(centre, error, sound, where=sound > error, color=ink.SKY, alpha=0.25, lw=0)
    axes.loglog(centre, sound, color=ink.BLUE, linewidth=1.6, label="sound")
    axes.loglog(centre, error, color=ink.VERMILLION, linewidth=1.6, linestyle=(0, (4, 2)), label="claimed error")
    _whole_decades(axes)
    _frequencies(axes, "rms in a third of an octave (cm/s)")
    ink.legend_above(axes, columns=2)
    return figure


def density_figure(frequency_hz: FloatArray, density_m2_s2_per_hz: FloatArray, *, highest_hz: float) -> Figure:
    """Draw the density of the claimed error, (cm/s)/√Hz, up to a frequency."""
    figure, axes = _blank()
    shown = (frequency_hz >= 20.0) & (frequency_hz <= highest_hz)
    axes.loglog(frequency_hz[shown], 100 * np.sqrt(density_m2_s2_per_hz[shown]), color=ink.VERMILLION, linewidth=1.6)
    _whole_decades(axes)
    _frequencies(axes, "claimed error (cm/s per √Hz)")
    return figure


def response_figure(frequency_hz: FloatArray, curve_db: FloatArray, filter_db: FloatArray) -> Figure:
    """Draw the response of a playback curve as it is written down, and of the filter that was used."""
    figure, axes = _blank()
    axes.semilogx(frequency_hz, curve_db, color=ink.SKY, linewidth=4.0, label="curve")
    axes.semilogx(frequency_hz, filter_db, color=ink.BLACK, linewidth=1.0, label="filter")
    _frequencies(axes, "response (dB, 0 at 1 kHz)")
    ink.legend_above(axes, columns=2)
    return figure


def share_figure(along_time: Mapping[str, Any]) -> Figure:
    """Draw which share was measured, bridged and missing along time, in per cent, and the rms of sound and error below.

    Parameters
    ----------
    along_time : mapping
        As in the report: `step_s`, the shares, `rms_cm_s`, `sigma_rms_cm_s`.
    """
    figure, (above, below) = ink.small_figure(WIDTH_IN, 1.35 * HEIGHT_IN, 1.0, 1.2)
    count = len(along_time["measured"])
    edge, unit = readable_time(np.arange(count + 1) * along_time["step_s"])
    floor = np.zeros(count)
    for name, colour in SHARES:
        top = floor + 100 * np.asarray(along_time[name], np.float64)
        above.fill_between(edge, _to_the_end(floor), _to_the_end(top), step="post", color=colour, lw=0, label=name)
        floor = top
    above.set_ylim(0, 100)
    for name, colour, label in (("rms_cm_s", ink.BLUE, "sound"), ("sigma_rms_cm_s", ink.VERMILLION, "claimed error")):
        values = _to_the_end(_positive(along_time[name]))
        below.plot(edge, values, drawstyle="steps-post", color=colour, linewidth=1.3, label=label)
    below.set_yscale("log")
    _whole_decades(below)
    for axes, x, y, columns in ((above, "", "share (%)", 3), (below, f"time ({unit})", "rms (cm/s)", 2)):
        axes.margins(x=0.0)
        ink.dress(axes, x=x, y=y)
        ink.legend_above(axes, columns=columns)
    return figure


def _positive(values: Sequence[float | None] | FloatArray) -> FloatArray:
    """NaN for what is unknown, and for what a logarithmic axis cannot show."""
    known = np.asarray(values, np.float64)
    return np.where(known > 0, known, np.nan)


def _to_the_end(steps: FloatArray) -> FloatArray:
    """The height of each step where it begins, and of the last one where it ends."""
    return np.append(steps, steps[-1:])


def _blank() -> tuple[Figure, Axes]:
    figure, (axes,) = ink.small_figure(WIDTH_IN, HEIGHT_IN, 1.0)
    return figure, axes


def _whole_decades(axes: Axes) -> None:
    """Let the upright axis, a logarithmic one, run from a power of ten to another, and name those alone."""
    low, high = axes.get_ylim()
    if low <= 0:  # nothing was drawn that such an axis could show
        low, high = NOTHING
    axes.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))
    axes.yaxis.set_major_formatter(lambda value, _: ink.power_of_ten(round(np.log10(value))))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _frequencies(axes: Axes, y: str) -> None:
    axes.margins(x=0.0)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1e3:g}k" if value >= 1e3 else f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    ink.dress(axes, x="frequency (Hz)", y=y)
