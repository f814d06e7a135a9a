"""`gramoscope compare`: how alike two sounds are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from gramoscope.cli.terminal import FINE, FINITE, Terminal

if TYPE_CHECKING:
    from gramoscope.conventions import FloatArray
    from gramoscope.listening.compare import Comparison


def compare(
    a: Path,
    b: Path,
    /,
    *,
    band: Annotated[tuple[float, float], FINITE] = (200.0, 10_000.0),
    start: Annotated[float, FINITE] = 0.0,
    trim_ms: Annotated[float, FINITE] = 0.0,
    max_delay_ms: Annotated[float, FINITE] = 50.0,
    channel: int | None = None,
    picture: Path | None = None,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Compare a copy with its original: Pearson r of waveform and envelope, SNR overall and by octave, gain, delay, polarity.

    Gain and delay are taken out by least squares before r and SNR are computed; the r of the sounds as they lie is given
    too.

    Parameters
    ----------
    a
        The original: a sound file, or the `truth.npz` of a simulated capture.
    b
        The copy.
    band
        Lowest and highest frequency that count, Hz.
    start
        Seconds into A at which B begins, as for `gramoscope film --start`.
    trim_ms
        Milliseconds to leave out at either end.
    max_delay_ms
        Longest delay to look for.
    channel
        Channel of files with several, from 0; their mean when left out.
    picture
        Draw waveforms, envelopes and spectra into this PNG file.
    quiet
        Say nothing (useful with --picture).
    json
        Print the comparison as JSON.
    """
    from gramoscope.errors import require
    from gramoscope.listening.compare import compare as compare_sounds
    from gramoscope.listening.pair import one_channel
    from gramoscope.listening.truth import load_for_comparison

    for name, value in (("--start", start), ("--trim-ms", trim_ms), ("--max-delay-ms", max_delay_ms)):
        require(value >= 0, f"{name} {value:g}", "zero or more")
    terminal = Terminal(quiet, json)
    one, one_rate_hz = load_for_comparison(a)
    other, other_rate_hz = load_for_comparison(b)
    original, copy = (one_channel(sound, channel=channel) for sound in (one, other))
    original = original[round(start * one_rate_hz) :]
    require(original.size > 0, f"{a} ends before {start:g} s", "a --start within the sound")
    result = compare_sounds(
        original,
        one_rate_hz,
        copy,
        other_rate_hz,
        band_hz=band,
        trim_s=trim_ms / 1e3,
        max_delay_s=max_delay_ms / 1e3,
    )
    if picture is not None:
        _draw(original, one_rate_hz, copy, other_rate_hz, result, picture)
    terminal.result(result.as_dict())
    tell(terminal, result)
    return FINE


def tell(terminal: Terminal, result: Comparison) -> None:
    """Print a comparison for people."""
    low_hz, high_hz = result.band_hz
    terminal.table(
        {
            "band": f"{low_hz:g} Hz … {high_hz / 1e3:g} kHz over {result.span_s:.4f} s",
            "waveform": f"r = {result.waveform_r:.4f} (as they lie: {result.waveform_r_unaligned:+.4f})",
            "envelope": f"r = {result.envelope_r:.4f} (peaks in windows of {result.envelope_window_s * 1e3:.1f} ms)",
            "SNR": f"{result.snr_db:.1f} dB",
            "SNR by octave": "  ".join(f"{_hz(f)} {snr:.1f}" for f, snr in result.octave_snr_db.items()) or "–",
            "gain": f"{result.gain_db:+.2f} dB",
            "delay": f"{round(result.delay_s * 1e6, 1) + 0.0:+.1f} µs",
            "polarity": "the same" if result.polarity > 0 else "[yellow]upside down[/]",
        }
    )
    for note in result.notes:
        terminal.say(f"[yellow]Note:[/] {note}")


def _hz(frequency_hz: float) -> str:
    return f"{frequency_hz / 1e3:g}k" if frequency_hz >= 1000 else f"{frequency_hz:g}"


def _draw(
    original: FloatArray, rate_a_hz: float, copy: FloatArray, rate_b_hz: float, result: Comparison, path: Path
) -> None:
    from gramoscope.listening.comparison_figure import comparison_figure
    from gramoscope.listening.ink import save_png
    from gramoscope.listening.pair import at_rate

    a, b = at_rate(original, rate_a_hz, result.rate_hz), at_rate(copy, rate_b_hz, result.rate_hz)
    save_png(comparison_figure(a, b, result.rate_hz, result), path)
