"""Band-limited interpolation: the value of a sampled signal at any place between its samples.

A signal x sampled at the integers has at the place u the band-limited value Σ x[k] c g(c (k − u)), where g is a low-pass
impulse response of cut-off ½ for a unit grid and c ≤ 1 its stretch: c = 1 keeps the whole band of the grid, a smaller c
cuts the band to what a slower output can carry. g is a sinc under a Kaiser window. With passband edge p (as a share of the
Nyquist rate) and stop-band at the Nyquist rate the cut-off is (1 + p)/2 of it, and for an attenuation of A decibels Kaiser
found β = 0.1102 (A − 8.7) and the width (A − 7.95)/(2.285 Δω).

References
----------
J. O. Smith, Digital Audio Resampling Home Page, CCRMA, 2002. J. F. Kaiser, in: Kuo and Kaiser, System Analysis by Digital
Computer, 1966.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import FloatArray

STOP_BAND_DB = 115.0
TABLE_STEPS = 64
"""Table entries for a unit of x; with cubic interpolation between them the error is below −130 dB."""


def half_width(passband: float) -> int:
    """Return how far g reaches to each side, in units of its own grid, for a passband edge as a share of Nyquist."""
    return int(np.ceil((STOP_BAND_DB - 7.95) / (2.285 * np.pi * (1 - passband)) / 2))


def low_pass(x: FloatArray, *, passband: float) -> FloatArray:
    """Return g(x), the windowed sinc itself; 0 beyond `half_width`."""
    reach = half_width(passband)
    cut_off = (1 + passband) / 2
    window = np.i0(_kaiser_beta() * np.sqrt(np.clip(1 - (x / reach) ** 2, 0, None))) / np.i0(_kaiser_beta())
    return np.asarray(np.where(np.abs(x) < reach, cut_off * np.sinc(cut_off * x) * window, 0.0), np.float64)


def low_pass_table(passband: float) -> FloatArray:
    """Return g from 0 to its end as cubics, one for each step of 1/`TABLE_STEPS`.

    Returns
    -------
    float64 array, shape (step, 4)
        Coefficients of 1, t, t², t³ for t = 0 … 1 in the step: Lagrange's cubic through the four points around it.
    """
    count = half_width(passband) * TABLE_STEPS + 1
    y = low_pass(np.arange(-1, count + 2) / TABLE_STEPS, passband=passband)
    before, here, after, beyond = y[:-3], y[1:-2], y[2:-1], y[3:]
    return np.stack(
        [
            here,
            after - before / 3 - here / 2 - beyond / 6,
            (before + after) / 2 - here,
            (here - after) / 2 + (beyond - before) / 6,
        ],
        axis=1,
    )


def _kaiser_beta() -> float:
    return 0.1102 * (STOP_BAND_DB - 8.7)


def interpolate_reference(
    samples: FloatArray, places: FloatArray, stretch: FloatArray, *, passband: float
) -> FloatArray:
    """Return what `interpolate` returns for one signal, from g itself and in NumPy: slow, and easy to believe."""
    index = np.arange(samples.size)
    values = [
        np.sum(samples * c * low_pass(c * (index - u), passband=passband)) for u, c in zip(places, stretch, strict=True)
    ]
    return np.asarray(values, np.float64)


@numba.njit(cache=True, nogil=True)
def interpolate(
    samples: FloatArray, places: FloatArray, stretch: FloatArray, table: FloatArray, reach: int
) -> FloatArray:
    """Return sampled signals' band-limited values at places between their samples.

    Parameters
    ----------
    samples : float64 array, shape (signal, sample)
        Signals on one grid. Finite. Taken as 0 beyond both ends.
    places : float64 array, shape (value,)
        u, in samples.
    stretch : float64 array, shape (value,)
        c of each value, 0 < c ≤ 1.
    table, reach
        `low_pass_table` and `half_width` of the passband.

    Returns
    -------
    float64 array, shape (signal, value)
        Each value depends only on the samples within reach/c of it, added up in their order.
    """
    values = np.zeros((samples.shape[0], places.size))
    for n in range(places.size):
        _add_up(samples, places[n], stretch[n], table, reach, values[:, n])
    return values


@numba.njit(cache=True, nogil=True)
def _add_up(
    samples: FloatArray, place: float, stretch: float, table: FloatArray, reach: int, values: FloatArray
) -> None:
    # split first, so that the same place in a longer array is computed from the same numbers, to the last bit
    middle = int(np.floor(place))
    beyond = place - middle
    first = max(int(np.ceil(beyond - reach / stretch)), -middle)
    last = min(int(np.floor(beyond + reach / stretch)), samples.shape[1] - 1 - middle)
    for k in range(first, last + 1):
        steps = abs(k - beyond) * stretch * TABLE_STEPS
        i = int(steps)
        t = steps - i
        weight = table[i, 0] + t * (table[i, 1] + t * (table[i, 2] + t * table[i, 3]))
        for signal in range(values.size):
            values[signal] += samples[signal, middle + k] * weight
    for signal in range(values.size):
        values[signal] *= stretch
