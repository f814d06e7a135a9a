"""What lies under a click.

A click adds to the sound. Samples y_u that it touches are x_u + c, with the sound x an autoregressive process and the click c
another, of a strength of its own: c has the covariance τ² P⁻¹, where P is the precision of a low-passed noise, for every click
comes through the groove and the pickup. So y_u is a measurement of x_u with that error, and x_u has the mean and the variance
of `gramoscope.preamp.autoregression.conditional` with W = (s²/τ²) P. τ² is found by expectation and maximisation,

    τ² ← (dᵀPd + tr P Σ) / m,     d = y_u − E[x_u],

Σ being the covariance of x_u and m the length of the click. A click that is much stronger than what the surroundings leave
open has W ≈ 0: least-squares interpolation. One that is weak hides little, and most of what was read is kept.

References
----------
S. Godsill, P. Rayner, Digital Audio Restoration, 1998, chapter 9. A. Dempster, N. Laird, D. Rubin, Maximum likelihood from
incomplete data via the EM algorithm, J. R. Stat. Soc. B 39, 1977.
"""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.preamp.autoregression import conditional, precision, times
from gramoscope.preamp.click_search import Process

CLICK_CORNER_HZ = 6000.0
"""Corner of either of the two poles through which clicks come. By trial (docs/decisions/0012): at 10 kHz the errors of weak
clicks are claimed too small."""
ITERATIONS = 20


def under_clicks(
    process: Process, samples: FloatArray, unknown: IntArray, *, seen: BoolArray, rate_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Return mean and standard error of what lies under clicks.

    Parameters
    ----------
    process : Process
        Of the sound.
    samples : float64 array, shape (sample,)
        With the clicks.
    unknown : int64 array, shape (unknown,)
        The indices of what they touch, rising; every run of neighbours is one click.
    seen : bool array, shape (unknown,)
        Whether there is a measurement; without one the click is endlessly strong.
    rate_hz : float

    Returns
    -------
    mean, sigma : float64 arrays, shape (unknown,)
    """
    first = np.flatnonzero(np.diff(unknown, prepend=-2) > 1)
    count = np.diff(first, append=unknown.size)
    click = _click_precision(count, rate_hz)
    click *= np.repeat(np.logical_and.reduceat(seen, first), count)[:, np.newaxis]
    reach = click.shape[1]
    weight = np.zeros_like(click)
    power_of_excitation = process.scale[unknown] ** 2
    for _ in range(ITERATIONS):
        mean, covariance = conditional(process.band, samples, unknown, weight)
        error = samples[unknown] - mean
        spread = power_of_excitation * np.sum(
            click * covariance[:, :reach] * np.minimum(np.arange(reach) + 1, 2), axis=1
        )
        power = np.add.reduceat(error * times(click, error) + spread, first) / count
        known = np.repeat(power, count)[:, np.newaxis]
        weight = np.divide(click * power_of_excitation[:, np.newaxis], known, out=np.zeros_like(click), where=known > 0)
    return mean, process.scale[unknown] * np.sqrt(covariance[:, 0])


def _click_precision(counts: IntArray, rate_hz: float) -> FloatArray:
    """P of clicks of so many samples, one after the other: two equal poles, or one where a click is too short for two."""
    pole = np.exp(-2 * np.pi * CLICK_CORNER_HZ / rate_hz)
    blocks = []
    for count in counts:
        block = np.zeros((count, 3))
        coefficients = (
            np.array([1.0, -2 * pole, pole**2]) if count > 4 else np.array([1.0, -pole]) if count > 2 else np.ones(1)
        )
        band = precision(coefficients, int(count))
        block[:, : band.shape[1]] = band
        blocks.append(block)
    return np.concatenate(blocks)
