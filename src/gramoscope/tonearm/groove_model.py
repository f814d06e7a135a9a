"""The state of the groove in both directions, how it moves along the grid, and a smoother that outliers cannot fool.

A first pass leaves out what disagrees with its nearest neighbours, and rejects what is further than the gate from its
prediction; while it rejects, its error grows as fast as grooves move, so it cannot lose the groove for good. Smoothed
backwards, that tells of each reading how far it lies from what all others say, and by this it is accepted or rejected once
more, for a second pass, and so on until nothing changes. So what was rejected because the prediction was bad comes back. A
first pass that lost nothing and of which nothing changes is the second one, to the last bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numba
import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.quantile import quantile
from gramoscope.tonearm.bryson_frazier import Smoothed, backward
from gramoscope.tonearm.groove_prior import SLOPE, GroovePrior, start
from gramoscope.tonearm.linear_gaussian import (
    Filtered,
    FilterState,
    Gate,
    Moves,
    Readings,
    blank,
    forward,
)
from gramoscope.tonearm.small_matrices import STATES

ANYWHERE_M = 1e-3
"""How little is known of where a passage begins, once its first sample is taken off."""
PATIENCE = 64
"""A wall that was seen so often where it was not expected has moved, or the filter has: a fifth of a millimetre."""
DOUBT = 100.0
"""How much surer than it is by right the first pass may be, as a variance, when it has lost a wall."""
AGITATION_LIMIT = 1e4
"""No neighbourhood is louder than its stretch by more, as a variance."""
AGITATION_BINS, AGITATION_ROUNDS = 16, 6
"""Size of a neighbourhood, and how often at the most its noise is raised."""
AGITATED = 4.0
"""Innovations so many times (as variances) as large as believed are no chance."""
AGREEMENT = 9.0
"""Square of the standard deviations that the second wall may be off the first."""
NORMAL_MEDIAN = 0.455
"""Median of the square of a normal number."""
ROUNDS = 4
"""At most so often is looked again which readings are outliers."""
SLOPES: FloatArray = np.kron(np.eye(2), SLOPE).astype(np.float64)
"""The lateral and the vertical slope (times the step) are these rows times the state."""


@dataclass(frozen=True, eq=False)
class GrooveModel:
    """What is believed of both directions, lateral first, from a bin on.

    Attributes
    ----------
    from_bin : int
    slowest_per_m : float
        The least λ: what forgets most slowly.
    sigma : float64 array, shape (2,)
        Of the slopes (of their bodies).
    a, q : float64 arrays, shape (2, 8, 8)
        One step of the grid.
    covariance : float64 array, shape (16, 16)
        Of the state before anything was seen.
    priors : (GroovePrior, GroovePrior)
        Lateral and vertical.
    agitation : float64 array, shape (bin,)
        How many times q the noise has, from `from_bin` on; once, where it ends.
    """

    from_bin: int
    slowest_per_m: float
    sigma: FloatArray
    a: FloatArray
    q: FloatArray
    covariance: FloatArray
    priors: tuple[GroovePrior, GroovePrior]
    agitation: FloatArray = field(default_factory=lambda: np.ones(1))


@dataclass(frozen=True, eq=False)
class Beliefs:
    """The priors of both directions, made ready for a grid; see `beliefs`.

    Attributes
    ----------
    priors : (GroovePrior, GroovePrior)
        Lateral and vertical.
    a, q : float64 arrays, shape (2, 8, 8)
        For σ = 1, the standard deviation of a body.
    at_rest : float64 array, shape (2, 7, 7)
        The same.
    sigma_of_bend : float64 array, shape (2,)
    """

    priors: tuple[GroovePrior, GroovePrior]
    a: FloatArray
    q: FloatArray
    at_rest: FloatArray
    sigma_of_bend: FloatArray

    def model(self, from_bin: int, level: FloatArray) -> GrooveModel:
        """Return what is believed at a level, shape (2,), from a bin on."""
        bends = [prior.bends(one) for prior, one in zip(self.priors, level, strict=True)]
        sigma = self.sigma_of_bend * np.array(bends)
        covariance = np.zeros((2 * STATES, 2 * STATES))
        for i in range(2):
            part = slice(i * STATES, (i + 1) * STATES)
            covariance[part, part] = start(self.at_rest[i], sigma[i], place_sigma_m=ANYWHERE_M)
        slowest = min(prior.corner_per_m for prior in self.priors)
        return GrooveModel(
            from_bin, slowest, sigma, self.a, sigma[:, None, None] ** 2 * self.q, covariance, self.priors
        )


def beliefs(priors: tuple[GroovePrior, GroovePrior], step_m: float) -> Beliefs:
    """Return priors made ready for a grid."""
    steps = [prior.steps(step_m) for prior in priors]
    return Beliefs(
        priors,
        np.stack([a for a, _ in steps]),
        np.stack([q for _, q in steps]),
        np.stack([prior.at_rest(step_m) for prior in priors]),
        np.array([1 / prior.bend(step_m) for prior in priors]),
    )


def which(models: Sequence[GrooveModel], bins: IntArray) -> IntArray:
    """Return the number of the model that holds at each bin; before the first one begins it holds too."""
    starts = [model.from_bin for model in models]
    return np.maximum(np.searchsorted(starts, bins, side="right") - 1, 0)


def moves(models: Sequence[GrooveModel], first_bin: int, stop_bin: int) -> Moves:
    """Return how the state moves from each bin, first … stop − 1, to the next."""
    here = which(models, np.arange(first_bin, stop_bin))
    agitation = np.ones(here.size)
    limits = np.searchsorted(here, np.arange(len(models) + 1)) + first_bin
    for model, begin, end in zip(models, limits[:-1], limits[1:], strict=True):
        begin, end = max(begin, model.from_bin), min(end, model.from_bin + model.agitation.size)
        if begin < end:
            agitation[begin - first_bin : end - first_bin] = model.agitation[
                begin - model.from_bin : end - model.from_bin
            ]
    return Moves(np.stack([m.a for m in models]), np.stack([m.q for m in models]), here, agitation)


@dataclass(frozen=True, eq=False)
class PassState:
    """Where the first and the last pass go on, at a bin."""

    bin: int
    first: FilterState
    last: FilterState


def beginning(model: GrooveModel, first_bin: int) -> PassState:
    """Return the state before anything was seen."""
    return PassState(first_bin, blank(model.covariance), blank(model.covariance))


@dataclass(frozen=True, eq=False)
class Followed:
    """Result of `robustly`.

    Attributes
    ----------
    smoothed : Smoothed
        What was wanted.
    accepted : bool array, shape (reading,)
    state : PassState
        Where to go on.
    """

    smoothed: Smoothed
    accepted: BoolArray
    state: PassState


def robustly(
    steps: Moves,
    readings: Readings,
    trusted: BoolArray,
    begin: PassState,
    *,
    gate: float,
    resume_bin: int,
    wanted: FloatArray | None = None,
) -> Followed:
    """Smooth the groove by readings some of which are wild.

    Parameters
    ----------
    steps : Moves
    readings : Readings
    trusted : bool array, shape (reading,)
        What the first pass may use.
    begin : PassState
    gate : float
        Standard deviations.
    resume_bin : int
        Where to go on later, counted as `begin.bin` is.
    wanted : float64 array, optional
        What shall be smoothed, see `forward`; nothing if left out.

    Returns
    -------
    Followed
    """
    resume = resume_bin - begin.bin
    rule = Gate(gate, PATIENCE, ANYWHERE_M, DOUBT)
    first = last = forward(steps, readings, begin.first, gate=rule, allowed=trusted, wanted=wanted, resume=resume)
    smoothed = backward(steps, readings, first)
    used = accepted = smoothed.distance <= gate
    lost, missed = _where_it_was_lost(first, readings)
    accepted |= missed & trusted
    settled = _alike(begin.first, begin.last) and not first.lost.any() and np.array_equal(first.used, accepted)
    for _ in range(0 if settled else ROUNDS):
        last = forward(
            steps,
            readings,
            begin.last,
            gate=Gate(anywhere=ANYWHERE_M),
            allowed=accepted,
            lost=lost,
            wanted=wanted,
            resume=resume,
        )
        smoothed = backward(steps, readings, last)
        used, accepted = accepted, smoothed.distance <= gate
        if np.array_equal(used, accepted):
            break
    return Followed(smoothed, used, PassState(resume_bin, first.resume, last.resume))


def _alike(one: FilterState, other: FilterState) -> bool:
    """Whether two filters know the same."""
    return np.array_equal(one.mean, other.mean) and np.array_equal(one.covariance, other.covariance)


def _where_it_was_lost(first: Filtered, readings: Readings) -> tuple[BoolArray, BoolArray]:
    """The bins where the place was lost, not those where that was noticed; and the readings that were missed between."""
    lost, missed = np.zeros_like(first.lost), np.zeros(readings.bin.size, np.bool_)
    for noticed in np.flatnonzero(first.lost):
        for source in np.flatnonzero(first.missed[noticed] >= PATIENCE / 2):
            begun = max(int(noticed - first.since[noticed, source]), 0)
            lost[begun] = True
            missed |= (readings.source == source) & (readings.bin >= begun) & (readings.bin < noticed)
    return lost, missed


def agitation(model: GrooveModel, readings: Readings, trusted: BoolArray) -> FloatArray:
    """Return how much more restless the groove is, bin by bin of one stretch, than its model believes.

    The level of a stretch is one number, and clicks and attacks are short. Where half of the innovations of a
    neighbourhood are larger than they should be, the groove moves and nothing is wrong with the readings: there the noise
    that drives it is raised until they are not.

    Parameters
    ----------
    model : GrooveModel
    readings : Readings
        Of one stretch, bins counted from the model's first.
    trusted : bool array, shape (reading,)

    Returns
    -------
    float64 array, shape (bin,)
        1 where all is as believed.
    """
    bins = int(readings.bin[-1]) + 1 if readings.bin.size else 1
    factor = np.ones(bins)
    for _ in range(AGITATION_ROUNDS):
        restless = replace(model, from_bin=0, agitation=factor)
        found = forward(moves([restless], 0, bins), readings, blank(model.covariance), allowed=trusted)
        excess = _excess(*_surprise(found, readings, trusted), bins)
        if not (excess > 1).any():
            break
        factor = np.minimum(factor * np.where(excess > 1, excess**2, 1.0), AGITATION_LIMIT)
    return factor


def _surprise(found: Filtered, readings: Readings, trusted: BoolArray) -> tuple[IntArray, FloatArray]:
    """Bins that both walls read, and by how many variances both differ from their prediction; 0 where they disagree.

    One wall alone can be wrong by itself; a groove that moves takes both, to the same side or to opposite ones.
    """
    one = np.flatnonzero((readings.bin[1:] == readings.bin[:-1]) & trusted[1:] & trusted[:-1])
    h, bins = readings.h, readings.bin
    away = readings.value - np.einsum("ij,ij->i", h, found.mean[bins])
    spread = found.expected + readings.variance
    apart = np.minimum((away[one] - away[one + 1]) ** 2, (away[one] + away[one + 1]) ** 2)
    agree = apart < AGREEMENT * (readings.variance[one] + readings.variance[one + 1])
    share = away**2 / spread
    return bins[one], np.where(agree, np.minimum(share[one], share[one + 1]), 0.0)


@numba.njit(cache=True, nogil=True)
def _excess(bins, surprise, size):  # type: ignore[no-untyped-def]
    """The median of the surprise about each bin, over that of a normal number, if it is large; else 1."""
    excess = np.ones(size)
    if np.count_nonzero(surprise > AGITATED * NORMAL_MEDIAN) < AGITATION_BINS // 4:
        return excess
    for first in range(0, size, AGITATION_BINS // 2):
        near = surprise[np.searchsorted(bins, first) : np.searchsorted(bins, first + AGITATION_BINS)]
        if near.size >= AGITATION_BINS // 2:
            ratio = quantile(near, 0.5) / NORMAL_MEDIAN
            if ratio > AGITATED:
                for k in range(first, min(first + AGITATION_BINS, size)):
                    excess[k] = max(excess[k], ratio)
    return excess
