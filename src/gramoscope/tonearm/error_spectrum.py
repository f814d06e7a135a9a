"""How the error of a smoothed velocity is spread over the frequencies.

Standard errors say how wrong a sample may be, not at which frequencies. A smoother over a long passage is Wiener's filter
(N. Wiener, *Extrapolation, Interpolation, and Smoothing of Stationary Time Series*, 1949): where the prior expects the
density S(k) of slopes and the readings bring the density N(k) of noise, its error has the density

    E(k) = (1/S + 1/N)⁻¹ = S N/(S + N),

and what follows for two directions that are read by two walls is the same with matrices, E = (S⁻¹ + Gᵀ N⁻¹ G)⁻¹. White noise
of places is noise k² N of slopes: the error rises by 6 dB an octave until the prior has the word, and then falls with it.
N is one over the information that a metre of readings brings. Loudness and information change along the groove, so E is
found for each of many short runs and averaged. Where a wall is missing over a length L the place is known again behind it:
what is wrong in between is a bump, white for waves longer than about 2L, and its velocity falls with k² there, as everywhere
else. The integral over all frequencies is the mean of σ², which tests prove.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.signal_path import ErrorSpectrum
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.groove_model import GrooveModel, which
from gramoscope.tonearm.kalman import Prior
from gramoscope.tonearm.place_samples import PlaceSamples

FREQUENCIES_HZ: FloatArray = np.geomspace(5.0, 160_000.0, 181)
"""Twelve an octave."""
RUN_BINS = 32
"""A tenth of a millimetre: as far as a smoother looks."""
BUMP = 1.2
"""Waves longer than 2L/1.2 see a bump as white. By trial, with chips in half of all stretches; a smooth bump that is pinned
at both ends, (1 − x²)², has half its power at 1.4."""
POOR = 0.1
"""A wall that brings less than so many times what is usual of it tells little."""


def places_error(
    accepted: PlaceSamples, models: Sequence[GrooveModel], bins: tuple[int, int], *, step_m: float, course: Course
) -> ErrorSpectrum:
    """Return the spectrum of the error that a smoother of places claims between two bins.

    Parameters
    ----------
    accepted : PlaceSamples
        What it used.
    models : sequence of GrooveModel
        What it believed.
    bins : (int, int)
        From … to, the second not included.
    step_m : float
        Of the grid.
    course : Course

    Returns
    -------
    ErrorSpectrum
        Over runs of which something was seen.
    """
    starts = np.arange(*bins, RUN_BINS)
    lengths = np.diff(np.append(starts, bins[1]))
    information = _information(accepted, bins, lengths * step_m)
    seen = information.any(axis=1)
    speed = float(course.rotation.speed_at_m_s(np.mean(bins) * step_m))
    wavenumber = 2 * np.pi * FREQUENCIES_HZ / speed
    shortest = BUMP * np.pi / _without_a_wall(information, lengths * step_m)[seen, None]
    looked_at = np.maximum(wavenumber, shortest)
    believed = _believed(models, starts[seen], lengths[seen], looked_at)
    error = _wiener(believed, information[seen], looked_at, course.gains) * ((wavenumber / looked_at) ** 2)[:, None]
    samples = int(lengths[seen].sum())
    mean = np.einsum("rdf,r->df", error, lengths[seen] / max(samples, 1))
    return ErrorSpectrum(FREQUENCIES_HZ, 2 * speed * mean, samples)


def slopes_error(information_per_m: float, prior: Prior, *, speed_m_s: float, samples: int) -> tuple[FloatArray, int]:
    """Return the density of the error that a smoother of slopes claims, (m/s)²/Hz, shape (frequency,).

    Parameters
    ----------
    information_per_m : float
        Sum of 1/variance of the readings of a metre; 0 where there are none.
    prior : Prior
        Of Matérn's process of order 3/2, S = 4σ²λ³/(λ² + k²)².
    speed_m_s : float
    samples : int
        Grid samples that this holds for.

    Returns
    -------
    density : float64 array, shape (frequency,)
    samples : int
        0 where there is no information.
    """
    wavenumber = 2 * np.pi * FREQUENCIES_HZ / speed_m_s
    density = 4 * prior.sigma**2 * prior.rate_per_m**3 / (prior.rate_per_m**2 + wavenumber**2) ** 2
    error = 2 * speed_m_s / (1 / density + information_per_m)
    return (error, samples) if information_per_m > 0 else (0 * error, 0)


def _information(accepted: PlaceSamples, bins: tuple[int, int], length_m: FloatArray) -> FloatArray:
    """Of a metre of each wall, shape (run, wall)."""
    here = (accepted.bin >= bins[0]) & (accepted.bin < bins[1])
    run = (accepted.bin[here] - bins[0]) // RUN_BINS
    total = np.zeros((length_m.size, 2))
    np.add.at(total, (run, accepted.wall[here]), 1 / accepted.variance[here])
    return np.asarray(total / length_m[:, None])


def _without_a_wall(information: FloatArray, length_m: FloatArray) -> FloatArray:
    """How long the stretch is, to which each run belongs, in which a wall tells little; infinite where both tell enough."""
    usual: FloatArray = np.asarray(np.median(information, axis=0), np.float64)
    poor: BoolArray = np.any(information <= POOR * usual, axis=1)
    number = np.cumsum(np.append(True, poor[1:] != poor[:-1])) - 1
    return np.where(poor, np.bincount(number, length_m)[number], np.inf)


def _believed(models: Sequence[GrooveModel], starts: IntArray, lengths: IntArray, wavenumber: FloatArray) -> FloatArray:
    """Densities of the slopes in both directions at the wavenumbers of each run, shape (run, 2, frequency)."""
    numbers = which(models, starts + lengths // 2)
    power = np.empty((starts.size, 2))
    for run, (start, length, number) in enumerate(zip(starts, lengths, numbers, strict=True)):
        model = models[number]
        first = max(start - model.from_bin, 0)
        restless = model.agitation[first : first + length]
        power[run] = model.sigma**2 * (float(restless.sum()) / restless.size if restless.size else 1.0)
    believed = np.empty((starts.size, 2, wavenumber.shape[1]))
    # one prior holds for many stretches
    for priors in {models[number].beliefs.priors for number in numbers}:
        mine = [run for run, number in enumerate(numbers) if models[number].beliefs.priors == priors]
        for i, prior in enumerate(priors):
            believed[mine, i] = power[mine, i, None] * prior.slope_density(wavenumber[mine])
    return believed


def _wiener(believed: FloatArray, information: FloatArray, wavenumber: FloatArray, gains: FloatArray) -> FloatArray:
    """The diagonal of (S⁻¹ + Gᵀ N⁻¹ G)⁻¹, shape (run, 2, frequency)."""
    told = information[:, :, None] / wavenumber[:, None] ** 2
    lateral = 1 / believed[:, 0] + told.sum(axis=1)
    vertical = 1 / believed[:, 1] + np.einsum("rwf,w->rf", told, gains**2)
    cross = np.einsum("rwf,w->rf", told, gains)
    return np.asarray(np.stack([vertical, lateral], axis=1) / (lateral * vertical - cross**2)[:, None])
