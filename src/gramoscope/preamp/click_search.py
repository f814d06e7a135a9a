"""Where a disturbance stands in a stretch of sound.

A click is a short pulse on top of the sound. Against an autoregressive process (`gramoscope.preamp.autoregression`) a pulse
of the shape h shows itself best in z = hᵀQx / √(hᵀQh), for which the whole surroundings on both sides speak; a sudden
excitation of the sound itself, a plucked string say, fits its own future and hardly moves z. Pulses of several lengths are
tried, half waves and whole waves of a sine. Without a click z is a normal deviate of the variance

    s² + Σ (Qh)² (σ² − σ₀²) / hᵀQh,

where σ is what the pickup claims for each sample, σ₀ its median: the process was learned from the sound as it was read, so
that the usual error is in s already, and only what goes beyond it counts.

The strongest pulse in each neighbourhood is marked, the marked samples are filled in by what their surroundings say, the
process is learned anew from the filled sound, and so on until nothing more is found.

References
----------
S. Vaseghi, P. Rayner, Detection and suppression of impulsive noise in speech communication systems, IEE Proc. I 137, 1990.
S. Godsill, P. Rayner, Digital Audio Restoration, 1998, chapter 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, binary_propagation, maximum_filter1d
from scipy.signal import lfilter

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.preamp.autoregression import conditional, excitation_scale, fit, precision, times

PULSE_LENGTHS = (1, 2, 3, 5, 8, 13, 21)
"""Of the pulses that are tried, in samples."""

ROUNDS = 2
GROWTH, NEIGHBOURS, MARGIN = 2.5, 5, 2
"""A click reaches as far as samples within NEIGHBOURS of each other are unpredicted by GROWTH standard errors, and MARGIN."""


@dataclass(frozen=True, eq=False)
class Process:
    """A stretch of sound as an autoregressive process.

    Attributes
    ----------
    coefficients : float64 array, shape (order + 1,)
    band : float64 array, shape (sample, order + 1)
        Q, as `gramoscope.preamp.autoregression.precision` returns it.
    autocorrelation : float64 array, shape (2 order + 1,)
        Any row of Q far from both ends.
    scale : float64 array, shape (sample,)
        s, in the unit of the sound; 0 in silence.
    """

    coefficients: FloatArray
    band: FloatArray
    autocorrelation: FloatArray
    scale: FloatArray


def learned_process(samples: FloatArray, *, order: int, used: BoolArray) -> Process:
    """Return the process that a stretch of sound looks like; `used` says which samples were measured."""
    coefficients = fit(samples, order=order)
    # an error of prediction is of use where all that it rests on is
    sound = ~_spread(~used, after=order)
    scale = excitation_scale(samples, coefficients, used=sound)
    band, autocorrelation = precision(coefficients, samples.size), np.correlate(coefficients, coefficients, "full")
    return Process(coefficients, band, autocorrelation, scale)


def significance(process: Process, samples: FloatArray, sigma: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return how many standard errors the likeliest pulse about each sample stands above nothing, and its length.

    Parameters
    ----------
    process : Process
    samples, sigma : float64 arrays, shape (sample,)
        A NaN in `sigma` counts as its median.

    Returns
    -------
    z : float64 array, shape (sample,)
        0 or more; 0 everywhere in silence.
    length : int64 array, shape (sample,)
        In samples. Those of an even length reach one sample further back than ahead.
    """
    best, length = np.zeros(samples.size), np.ones(samples.size, np.int64)
    if not process.scale.any():
        return best, length
    weighted = times(process.band, samples)
    more = excess_variance(sigma)
    for shape in _pulses():
        whitened = np.convolve(process.autocorrelation, shape)
        middle = process.autocorrelation.size // 2
        energy = float(whitened[middle : middle + shape.size] @ shape)
        variance = process.scale**2 + laid_about(more, whitened**2, lead=whitened.size // 2) / energy
        z = np.abs(laid_about(weighted, shape, lead=shape.size // 2)) / np.sqrt(energy * variance)
        length = np.where(z > best, shape.size, length)
        best = np.maximum(z, best)
    return best, length


def find_clicks(
    samples: FloatArray,
    sigma: FloatArray,
    *,
    unknown: BoolArray,
    threshold: FloatArray,
    order: int,
    passes: int,
) -> tuple[BoolArray, Process]:
    """Return which samples of a stretch are spoilt, and the process of the rest.

    Parameters
    ----------
    samples, sigma : float64 arrays, shape (sample,)
    unknown : bool array, shape (sample,)
        Samples that are to be filled in whatever they are.
    threshold : float64 array, shape (sample,)
        So many standard errors make a click of the pulse about a sample.
    order : int
        Of the process.
    passes : int
        So many times at the most pulses are looked for.

    Returns
    -------
    spoilt : bool array, shape (sample,)
        `unknown` and what was found.
    process : Process
    """
    process = learned_process(_bridged(samples, unknown), order=order, used=~unknown)
    spoilt = unknown
    for _ in range(ROUNDS):  # a process that was learned with clicks in it finds some that are none
        spoilt, process = _search(process, samples, sigma, unknown, threshold, order, passes)
    return spoilt, process


def _search(
    process: Process,
    samples: FloatArray,
    sigma: FloatArray,
    unknown: BoolArray,
    threshold: FloatArray,
    order: int,
    passes: int,
) -> tuple[BoolArray, Process]:
    spoilt = unknown
    for _ in range(passes):
        filled = filled_in(process, samples, spoilt)
        z, length = significance(process, filled, sigma)
        forward, backward = prediction_errors(process, filled, sigma)
        found = _strongest(z, z > threshold, length, reach=order)
        unpredicted = np.minimum(maximum_filter1d(forward, NEIGHBOURS), maximum_filter1d(backward, NEIGHBOURS))
        found = _grown(found, unpredicted > GROWTH)
        if not np.any(found & ~spoilt):
            break
        spoilt = spoilt | found
        process = learned_process(filled_in(process, samples, spoilt), order=order, used=~spoilt)
    return spoilt, process


def filled_in(process: Process, samples: FloatArray, unknown: BoolArray) -> FloatArray:
    """Return the samples with what the others say in place of the unknown ones."""
    filled = samples.copy()
    if unknown.any():
        index = np.flatnonzero(unknown)
        filled[unknown], _ = conditional(process.band, samples, index, np.zeros((index.size, 1)))
    return filled


def prediction_errors(process: Process, samples: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how many standard errors each sample differs from its prediction by those before, and by those after it.

    A click spoils the predictions forward from its first sample on, those backward up to its last, so that both are wrong from
    its first to its last. Infinite where there is too little to predict from, 0 in silence.
    """
    order = process.coefficients.size - 1
    if not process.scale.any():
        return np.zeros(samples.size), np.zeros(samples.size)
    forward = _prediction_error(process.coefficients, process.scale, samples, sigma)
    backward = _prediction_error(process.coefficients, process.scale[::-1], samples[::-1], sigma[::-1])[::-1].copy()
    forward[:order], backward[samples.size - order :] = np.inf, np.inf
    return forward, backward


def _prediction_error(
    coefficients: FloatArray, scale: FloatArray, samples: FloatArray, sigma: FloatArray
) -> FloatArray:
    more = lfilter(coefficients**2, [1.0], excess_variance(sigma))
    return np.asarray(np.abs(lfilter(coefficients, [1.0], samples)) / np.sqrt(scale**2 + more))


def _grown(seeds: BoolArray, unpredicted: BoolArray) -> BoolArray:
    """Add to each mark the unpredicted samples that join it, and a margin on either side."""
    if not seeds.any():
        return seeds
    grown = binary_propagation(seeds, mask=seeds | unpredicted)
    return np.asarray(binary_dilation(grown, iterations=MARGIN), np.bool_)


def _strongest(z: FloatArray, beyond: BoolArray, length: IntArray, *, reach: int) -> BoolArray:
    """Mark the pulse at the highest z of each neighbourhood."""
    marked = np.zeros(z.size, np.bool_)
    for place in np.flatnonzero(beyond & (z == maximum_filter1d(z, 2 * reach + 1))):
        first = place - length[place] // 2
        marked[max(first, 0) : first + length[place]] = True
    return marked


def _bridged(samples: FloatArray, unknown: BoolArray) -> FloatArray:
    """Draw straight lines over the unknown samples: good enough to learn a first process from."""
    if not unknown.any() or unknown.all():
        return samples
    index = np.arange(samples.size)
    return np.interp(index, index[~unknown], samples[~unknown])


def excess_variance(sigma: FloatArray) -> FloatArray:
    """Return by how much the variance of each sample exceeds the usual one, 0 where it does not or is not known."""
    known = np.isfinite(sigma)
    usual = float(np.median(sigma[known])) if known.any() else 0.0
    return np.clip(np.where(known, sigma, usual) ** 2 - usual**2, 0.0, None)


def laid_about(values: FloatArray, weights: FloatArray, *, lead: int) -> FloatArray:
    """Return Σ weights[k] values[n + k − lead] for every n, with nothing beyond the ends."""
    return np.correlate(np.pad(values, (lead, weights.size - 1 - lead)), weights, "valid")


def _pulses() -> list[FloatArray]:
    shapes = []
    for length in PULSE_LENGTHS:
        turn = np.pi * (np.arange(length) + 0.5) / length
        shapes.append(np.sin(turn))
        if length > 1:
            shapes.append(np.sin(2 * turn))
    return shapes


def _spread(marks: BoolArray, *, after: int) -> BoolArray:
    """Mark so many samples after each mark too."""
    if not marks.any():
        return marks
    count = np.cumsum(np.pad(marks.astype(np.int64), (after + 1, 0)))
    return np.asarray(count[after + 1 :] - count[: -after - 1] > 0)
