"""Two sounds upon each other: waveforms, envelopes, spectra, and what `compare` found."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from scipy.signal import welch

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.listening import ink
from gramoscope.listening.align import band_passed
from gramoscope.listening.compare import Comparison
from gramoscope.listening.envelope import peak_envelope
from gramoscope.listening.ink import DOTS_ACROSS, readable_time

SHORT_WINDOW_S = 0.012


def comparison_figure(a: FloatArray, b: FloatArray, rate_hz: float, comparison: Comparison) -> Figure:
    """Draw two sounds upon each other: waveforms where the reference is loudest, envelopes, spectra.

    Parameters
    ----------
    a, b : float64 arrays, shapes (sample,)
        Reference and copy as they were compared, but at one rate; NaN is not allowed.
    rate_hz : float
    comparison : Comparison
        What `compare` found; its delay, gain and polarity are taken out of b, and its band out of both.

    Returns
    -------
    Figure
    """
    shared_a, shared_b, start_s = _laid_upon(a, b, rate_hz=rate_hz, comparison=comparison)
    figure = ink.blank_figure(11.0, 9.6)
    figure.suptitle(_verdict(comparison), x=0.012, ha="left", fontsize=ink.LARGE, color=ink.BLACK)
    top, middle, bottom = figure.subplots(3, 1, height_ratios=[1.15, 0.85, 1.15])
    _draw_short_window(top, shared_a, shared_b, rate_hz=rate_hz, start_s=start_s)
    _draw_envelopes(middle, shared_a, shared_b, rate_hz=rate_hz, start_s=start_s, comparison=comparison)
    _draw_spectra(bottom, shared_a, shared_b, rate_hz=rate_hz, comparison=comparison)
    return figure


def _verdict(comparison: Comparison) -> str:
    polarity = "same polarity" if comparison.polarity > 0 else "upside down"
    return (
        f"waveform r = {comparison.waveform_r:.4f}, envelope r = {comparison.envelope_r:.4f}, "
        f"signal to noise {comparison.snr_db:.1f} dB\n"
        f"copy against reference: {comparison.gain_db:+z.2f} dB, {comparison.delay_s * 1e6:+z.1f} µs, {polarity}"
    ).replace("-", "−")


def _laid_upon(
    a: FloatArray, b: FloatArray, *, rate_hz: float, comparison: Comparison
) -> tuple[FloatArray, FloatArray, float]:
    """Cut both to the span they share, filter them, and undo delay, gain and polarity of the copy."""
    lag = round(comparison.delay_s * rate_hz)
    first, last = max(0, -lag), min(len(a), len(b) - lag)
    require(last - first >= 2, f"{last - first} samples in common", "two sounds that overlap")
    gain = comparison.polarity * 10 ** (comparison.gain_db / 20)
    reference = band_passed(a[first:last], rate_hz=rate_hz, band_hz=comparison.band_hz)
    copy = band_passed(
        b[first + lag : last + lag],
        rate_hz=rate_hz,
        band_hz=comparison.band_hz,
        advance_s=comparison.delay_s - lag / rate_hz,
    )
    return reference, copy / gain, first / rate_hz


def _loudest(a: FloatArray, *, window_samples: int) -> slice:
    """The window, in steps of half its length, in which a sound has most power."""
    if len(a) <= window_samples:
        return slice(0, len(a))
    starts = np.arange(0, len(a) - window_samples + 1, max(1, window_samples // 2))
    power = np.concatenate([[0.0], np.cumsum(a**2)])
    first = int(starts[np.argmax(power[starts + window_samples] - power[starts])])
    return slice(first, first + window_samples)


def _draw_short_window(axes: Axes, a: FloatArray, b: FloatArray, *, rate_hz: float, start_s: float) -> None:
    shown = _loudest(a, window_samples=max(2, round(SHORT_WINDOW_S * rate_hz)))
    time_ms = 1e3 * (start_s + np.arange(len(a))[shown] / rate_hz)
    scale = float(np.max(np.abs(a))) or 1.0
    axes.plot(time_ms, a[shown] / scale, color=ink.BLACK, linewidth=2.4, alpha=0.35, label="reference")
    axes.plot(time_ms, b[shown] / scale, color=ink.VERMILLION, linewidth=0.9, label="copy, aligned")
    axes.plot(time_ms, (b - a)[shown] / scale, color=ink.BLUE, linewidth=0.7, label="difference")
    axes.margins(x=0.0)
    ink.dress(axes, x="time (ms)", y="reference's peak = 1")
    ink.heading(axes, "Waveforms where the reference is loudest")
    ink.legend_above(axes, columns=3)


def _draw_envelopes(
    axes: Axes, a: FloatArray, b: FloatArray, *, rate_hz: float, start_s: float, comparison: Comparison
) -> None:
    count = max(round(comparison.envelope_window_s * rate_hz), len(a) // DOTS_ACROSS, 1)
    scale = float(np.max(np.abs(a))) or 1.0
    outline_a, outline_b = (peak_envelope(sound, window_samples=count) / scale for sound in (a, b))
    time, unit = readable_time(start_s + np.arange(len(outline_a)) * count / rate_hz)
    axes.fill_between(time, outline_a, color=ink.BLACK, alpha=0.18, linewidth=0, label="reference", step="post")
    axes.step(time, outline_b, color=ink.VERMILLION, linewidth=0.9, label="copy, aligned", where="post")
    axes.set_ylim(bottom=0)
    axes.margins(x=0.0)
    ink.dress(axes, x=f"time ({unit})", y="reference's peak = 1")
    ink.heading(axes, f"Peak envelopes, windows of {1e3 * count / rate_hz:.3g} ms")
    ink.legend_above(axes, columns=2)


def _draw_spectra(axes: Axes, a: FloatArray, b: FloatArray, *, rate_hz: float, comparison: Comparison) -> None:
    segment = int(min(len(a), 2 ** np.ceil(np.log2(rate_hz / 20))))
    frequency_hz, density_a = welch(a, rate_hz, nperseg=segment)
    peak = float(density_a.max()) or 1.0
    curves = (
        ("reference", a, ink.BLACK, 2.4, 0.35),
        ("copy, aligned", b, ink.VERMILLION, 0.9, 1.0),
        ("difference", b - a, ink.BLUE, 0.9, 1.0),
    )
    low_hz, high_hz = comparison.band_hz
    shown = (frequency_hz >= low_hz / 2) & (frequency_hz <= high_hz * 1.5)
    for name, sound, colour, width, alpha in curves:
        _, density = welch(sound, rate_hz, nperseg=segment)
        level_db = 10 * np.log10(np.maximum(density[shown] / peak, 1e-14))
        axes.semilogx(frequency_hz[shown], level_db, color=colour, linewidth=width, alpha=alpha, label=name)
    axes.axvspan(low_hz, high_hz, color=ink.PALE, alpha=0.5, linewidth=0, zorder=0)
    axes.set_ylim(-100, 6)
    axes.margins(x=0.0)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value / 1e3:g} k" if value >= 1e3 else f"{value:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    ink.dress(axes, x="frequency (Hz); the band compared is shaded", y="power density (dB re peak)")
    ink.heading(axes, "Spectra")
    ink.legend_above(axes, columns=3)
