"""Two recordings of the same sound, laid upon each other: b(t) = g · a(t − τ) + noise.

Kernels: zero-phase band-pass with a shift in time of any fraction of a sample, the delay τ that makes two sounds most alike,
and the gain g by least squares. The band-pass has the response of a Butterworth filter of order 4 run forwards and
backwards, 1 / (1 + (f₁/f)⁸) · 1 / (1 + (f/f₂)⁸), so that each edge frequency is passed at half its amplitude.
"""

from __future__ import annotations

import numpy as np
import scipy.fft

from gramoscope.conventions import ComplexArray, FloatArray

Band = tuple[float, float]

_ORDER = 4
_REFINEMENTS = 12
_SETTLING_PERIODS = 2.0


def band_response(frequency_hz: FloatArray, *, band_hz: Band) -> FloatArray:
    """Return the amplitude response of the zero-phase band-pass, 0 … 1; exactly 0 at 0 Hz.

    Parameters
    ----------
    frequency_hz : float64 array
        0 or more.
    band_hz : (float, float)
        Lower and upper edge, where the response is one half.
    """
    low_hz, high_hz = band_hz
    high_pass = frequency_hz ** (2 * _ORDER) / (frequency_hz ** (2 * _ORDER) + low_hz ** (2 * _ORDER))
    return np.asarray(high_pass / (1 + (frequency_hz / high_hz) ** (2 * _ORDER)), np.float64)


def _continued(samples: FloatArray, *, beyond: int) -> FloatArray:
    """Continue both ends by their point reflection, fading to nothing, so that a filter finds no step there."""
    head = 2 * samples[0] - samples[beyond:0:-1]
    tail = 2 * samples[-1] - samples[-2 : -beyond - 2 : -1]
    fade = np.sin(np.linspace(0, np.pi / 2, beyond + 2)[1:-1]) ** 2
    return np.concatenate([head * fade, samples, tail * fade[::-1]])


def band_passed(samples: FloatArray, *, rate_hz: float, band_hz: Band, advance_s: float = 0.0) -> FloatArray:
    """Filter a sound to a band without moving it, or moved earlier by any fraction of a sample.

    Parameters
    ----------
    samples : float64 array, shape (sample,)
        At least two, any unit. One NaN makes all NaN.
    rate_hz : float
    band_hz : (float, float)
        Edges, see `band_response`.
    advance_s : float
        Result at t is the sound at t + advance; beyond the ends it is a made-up continuation.

    Returns
    -------
    float64 array, shape (sample,)
    """
    settling = round(_SETTLING_PERIODS * rate_hz / band_hz[0]) + round(abs(advance_s) * rate_hz)
    beyond = max(1, min(len(samples) - 1, settling))
    # the band passes nothing at 0 Hz, so an offset can go before the ends are continued
    continued = _continued(samples - samples.mean(), beyond=beyond)
    count = scipy.fft.next_fast_len(len(continued), real=True)
    frequency_hz = np.asarray(np.fft.rfftfreq(count, 1 / rate_hz), np.float64)
    turned = np.exp(2j * np.pi * frequency_hz * advance_s) * band_response(frequency_hz, band_hz=band_hz)
    filtered = scipy.fft.irfft(scipy.fft.rfft(continued, count) * turned, count)
    return np.asarray(filtered[beyond : beyond + len(samples)], np.float64)


def _cross_spectrum(a: FloatArray, b: FloatArray) -> tuple[ComplexArray, int]:
    count = scipy.fft.next_fast_len(len(a) + len(b), real=True)
    return np.conj(scipy.fft.rfft(a, count)) * scipy.fft.rfft(b, count), count


def _coarse_lag(cross: ComplexArray, *, count: int, max_lag: int) -> int:
    correlation = scipy.fft.irfft(cross, count)
    lags = np.arange(-max_lag, max_lag + 1)
    return int(lags[np.argmax(np.abs(correlation[lags % count]))])


def delay_samples(a: FloatArray, b: FloatArray, *, max_lag: int) -> float:
    """Return how many samples b is later than a, by the peak of the magnitude of their cross-correlation.

    The peak is found on whole samples and climbed between them by Newton's method on
    c(τ) = Re Σ A*(ω) B(ω) exp(iωτ), whose derivatives the spectrum gives exactly.

    Parameters
    ----------
    a, b : float64 arrays, shapes (sample,)
        Without offset (band-passed); lengths may differ. NaN is not allowed.
    max_lag : int
        Largest delay looked for, below half of the shorter length; 0 looks for none.

    Returns
    -------
    float
        Positive when b is later; between −`max_lag` − 1 and `max_lag` + 1.
    """
    cross, count = _cross_spectrum(a, b)
    lag = float(_coarse_lag(cross, count=count, max_lag=max_lag))
    return lag if max_lag == 0 else lag + _climb(cross, count=count, lag=lag)


def _climb(cross: ComplexArray, *, count: int, lag: float) -> float:
    omega = 2 * np.pi * np.arange(len(cross)) / count
    cross = cross * np.exp(1j * omega * lag)
    step = 0.0
    for _ in range(_REFINEMENTS):
        turned = cross * np.exp(1j * omega * step)
        slope, curvature = -np.sum(omega * turned.imag), -np.sum(omega**2 * turned.real)
        change = -slope / curvature if curvature != 0 else 0.0
        step = float(np.clip(step + change, -1.0, 1.0))
        if abs(change) < 1e-9:
            break
    return step


def refine_delay_s(a: FloatArray, b: FloatArray, *, rate_hz: float) -> float:
    """Return how much later than a the sound b is when they all but coincide, by least squares on the slope of a.

    Solves b = g a − g τ a′ for g and g τ: unlike the peak of the correlation it does not see where the sounds begin and
    end, and it allows samples to be left out, as NaN in b.

    Parameters
    ----------
    a, b : float64 arrays, same shape (sample,)
        Band-passed, apart by a small part of a period. NaN in b leaves a sample out.
    rate_hz : float

    Returns
    -------
    float
        τ, positive when b is later; 0 when the sounds have nothing in common.
    """
    used = np.isfinite(b)
    columns = np.stack([a[used], np.gradient(a, 1 / rate_hz)[used]], axis=1)
    gain, slope_gain = np.linalg.lstsq(columns, b[used], rcond=None)[0]
    return float(-slope_gain / gain) if gain != 0 else 0.0


def least_squares_gain(a: FloatArray, b: FloatArray) -> float:
    """Return g that makes Σ (b − g a)² smallest; its sign is the polarity of b against a."""
    return float(np.dot(a, b) / np.dot(a, a))


def pearson_r(a: FloatArray, b: FloatArray) -> float:
    """Return Pearson's product-moment correlation, −1 … 1 (reference 3 of the paper); NaN when one is constant."""
    a0, b0 = a - a.mean(), b - b.mean()
    power = float(np.dot(a0, a0) * np.dot(b0, b0))
    return float(np.dot(a0, b0) / np.sqrt(power)) if power > 0 else float("nan")
