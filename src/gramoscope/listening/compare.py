"""How alike two sounds are.

One is the *reference* a, the other the *copy* b; the model is b(t) = g · a(t − τ) + noise, within a band. Delay τ and gain g
are found by least squares, and everything is reported after they have been taken out (and once, `waveform_r_unaligned`,
before). With the aligned copy b̂(t) = b(t + τ)/g,

    signal to noise = 10 lg ( Σ a² / Σ (b̂ − a)² )

over the span that both share. Overall this equals r²/(1 − r²) with r Pearson's (for sounds without offset), so that a copy
with white noise added scores the ratio of the two powers, and an unrelated sound scores far below 0 dB: scaling a
copy down gains nothing. For a copy that is exact the ratio stops at 300 dB.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.listening.align import Band, band_passed, least_squares_gain, pearson_r
from gramoscope.listening.envelope import peak_envelope
from gramoscope.listening.pair import Pair, Pairing, Span, one_channel

OCTAVE_CENTRES_HZ = (31.5, 63.0, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0, 16000.0)
"""Nominal octave-band centres of IEC 61260-1; the exact ones are 1000 · 2ᵏ Hz."""

ENVELOPE_WINDOW_S = 0.005
SMALLEST_NOISE_SHARE = 1e-30

_ENVELOPE_WINDOWS = 20


@dataclass(frozen=True)
class Comparison:
    """How alike two sounds are; b is the copy, a the reference.

    Attributes
    ----------
    waveform_r : float
        Pearson r of the waveforms, aligned and with the polarity put right: 0 … 1.
    waveform_r_unaligned : float
        The same with nothing aligned, −1 … 1: it shows a wrong polarity or time zero.
    envelope_r : float
        Pearson r of the peak envelopes, aligned.
    envelope_window_s : float
        Window of the envelopes: 5 ms, or a twentieth of the span when that is shorter.
    snr_db : float
        Signal to noise of the aligned copy, see the module.
    octave_snr_db : dict
        The same in octave bands, nominal centre in Hz → dB; only octaves whose centre lies in the band and that the span
        and the rates can resolve. The gain is the overall one, so a wrong tone colour counts as noise.
    gain_db : float
        Level of b relative to a, by least squares; 20 lg |g|.
    polarity : int
        +1, or −1 when b is upside down.
    delay_s : float
        Positive when b is later than a.
    duration_a_s, duration_b_s : float
        Whole sounds.
    span_start_s, span_s : float
        What was compared: its start in a, and its length, trimmed ends excluded.
    masked_share : float
        Share of that span that was left out, 0 … 1.
    rate_a_hz, rate_b_hz, rate_hz : float
        Of both sounds, and the one they were compared at: the lower of the two.
    band_hz : (float, float)
        The band compared, cut down to what the rates hold.
    notes : tuple of str
        What was done to the input, in words.
    """

    waveform_r: float
    waveform_r_unaligned: float
    envelope_r: float
    envelope_window_s: float
    snr_db: float
    octave_snr_db: dict[float, float]
    gain_db: float
    polarity: int
    delay_s: float
    duration_a_s: float
    duration_b_s: float
    span_start_s: float
    span_s: float
    masked_share: float
    rate_a_hz: float
    rate_b_hz: float
    rate_hz: float
    band_hz: Band
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return all attributes as a dictionary for a report, octave centres as strings."""
        values = asdict(self)
        values["octave_snr_db"] = {f"{centre:g}": value for centre, value in self.octave_snr_db.items()}
        return values


def compare(
    a: npt.ArrayLike,
    rate_a_hz: float,
    b: npt.ArrayLike,
    rate_b_hz: float,
    *,
    band_hz: Band = (200.0, 10_000.0),
    max_delay_s: float = 0.05,
    trim_s: float = 0.0,
    mask: npt.ArrayLike | None = None,
    channel: int | None = None,
) -> Comparison:
    """Say how alike two sounds are.

    Parameters
    ----------
    a, b : array_like, shapes (sample,) or (sample, channel)
        Reference and copy, in any unit each.
    rate_a_hz, rate_b_hz : float
    band_hz : (float, float)
        What counts; frequencies above 0.95 of half the lower rate are left out.
    max_delay_s : float
        Largest delay looked for, at most a quarter of the shorter sound; 0 takes the sounds as they lie.
    trim_s : float
        To leave out at each end of the span that both share.
    mask : bool array_like, shape (sample of b,), optional
        True where b is to be left out (not measured, say); b may be NaN there.
    channel : int, optional
        Which channel of sounds with several, from 0; their mean when not given.

    Returns
    -------
    Comparison

    Raises
    ------
    ArgumentError
        If a rate, the band, the trim, the delay or the channel is impossible.
    SoundError
        If a sound is too short, is silent in the band, or holds NaN that no mask covers.
    """
    mono_a, mono_b = one_channel(a, channel=channel), one_channel(b, channel=channel)
    pairing = Pairing(band_hz=band_hz, max_delay_s=max_delay_s, trim_s=trim_s)
    pair = pairing.bring_together(mono_a, rate_a_hz, mono_b, rate_b_hz, mask=mask)
    span, inside = pair.aligned, pair.aligned.ends
    span_s = (inside.stop - inside.start) / pair.rate_hz
    window_s = min(ENVELOPE_WINDOW_S, span_s / _ENVELOPE_WINDOWS)
    gain = least_squares_gain(span.a[span.used], span.b[span.used])
    return Comparison(
        waveform_r=abs(_waveform_r(span)),
        waveform_r_unaligned=_waveform_r(pair.unaligned),
        envelope_r=_envelope_r(span, window_samples=max(1, round(window_s * pair.rate_hz))),
        envelope_window_s=window_s,
        snr_db=snr_db(span.a[span.used], span.b[span.used], gain=gain),
        octave_snr_db=_octave_snr_db(pair, gain=gain),
        gain_db=_decibel(gain**2),
        polarity=-1 if gain < 0 else 1,
        delay_s=pair.delay_s,
        duration_a_s=len(mono_a) / rate_a_hz,
        duration_b_s=len(mono_b) / rate_b_hz,
        span_start_s=span.start_s + inside.start / pair.rate_hz,
        span_s=span_s,
        masked_share=float(1 - span.used[inside].mean()),
        rate_a_hz=float(rate_a_hz),
        rate_b_hz=float(rate_b_hz),
        rate_hz=float(pair.rate_hz),
        band_hz=pair.band_hz,
        notes=(
            *_channel_notes("a", a, channel=channel),
            *_channel_notes("b", b, channel=channel),
            *_rate_notes(pair, rate_a_hz, rate_b_hz, band_hz=band_hz),
        ),
    )


def _channel_notes(name: str, samples: npt.ArrayLike, *, channel: int | None) -> list[str]:
    shape = np.shape(samples)
    if len(shape) == 1 or shape[1] == 1:
        return []
    taken = "the mean of them" if channel is None else f"channel {channel}"
    return [f"sound {name} has {shape[1]} channels: {taken} was compared"]


def _rate_notes(pair: Pair, rate_a_hz: float, rate_b_hz: float, *, band_hz: Band) -> list[str]:
    notes = []
    if rate_a_hz != rate_b_hz:
        notes.append(f"{rate_a_hz:g} Hz against {rate_b_hz:g} Hz: both were compared at {pair.rate_hz:g} Hz")
    if pair.band_hz != band_hz:
        notes.append(f"the band ends at {pair.band_hz[1]:g} Hz, because the rate is {pair.rate_hz:g} Hz")
    return notes


def _decibel(power: float) -> float:
    return float(10 * np.log10(power)) if power > 0 else float("-inf")


def snr_db(a: FloatArray, b: FloatArray, *, gain: float) -> float:
    """Return 10 lg (Σ a² / Σ (b/gain − a)²), the signal to noise ratio of b with a as its signal.

    Parameters
    ----------
    a, b : float64 arrays, same shape (sample,)
        One NaN gives NaN.
    gain : float
        Of b relative to a, with its sign; 0 gives −∞.

    Returns
    -------
    float
        Decibel, at most 300; NaN when a is silent.
    """
    signal = gain**2 * float(np.dot(a, a))
    noise = max(float(np.sum((b - gain * a) ** 2)), signal * SMALLEST_NOISE_SHARE)
    return _decibel(signal / noise) if noise > 0 else float("nan")


def _waveform_r(span: Span) -> float:
    return pearson_r(span.a[span.used], span.b[span.used])


def _envelope_r(span: Span, *, window_samples: int) -> float:
    inside = span.ends
    envelope_a, envelope_b = (
        peak_envelope(np.where(span.used, sound, np.nan)[inside], window_samples=window_samples)
        for sound in (span.a, span.b)
    )
    seen = np.isfinite(envelope_a)
    return pearson_r(envelope_a[seen], envelope_b[seen])


def _octave_snr_db(pair: Pair, *, gain: float) -> dict[float, float]:
    span, result = pair.aligned, {}
    for power_of_two, centre_hz in enumerate(OCTAVE_CENTRES_HZ, start=-5):
        exact_hz = 1000 * 2.0**power_of_two
        if _resolves(pair, centre_hz=exact_hz):
            octave_hz = (exact_hz / np.sqrt(2), exact_hz * np.sqrt(2))
            a = band_passed(span.a, rate_hz=pair.rate_hz, band_hz=octave_hz)
            b = band_passed(span.b, rate_hz=pair.rate_hz, band_hz=octave_hz)
            result[centre_hz] = snr_db(a[span.used], b[span.used], gain=gain)
    return result


def _resolves(pair: Pair, *, centre_hz: float) -> bool:
    """Whether an octave lies in band and rate, and the span lasts at least the inverse of its width."""
    low_hz, high_hz = pair.band_hz
    span_s = np.count_nonzero(pair.aligned.used) / pair.rate_hz
    inside = low_hz <= centre_hz <= high_hz and centre_hz * np.sqrt(2) < pair.rate_hz / 2
    return bool(inside and span_s * centre_hz >= np.sqrt(2))
