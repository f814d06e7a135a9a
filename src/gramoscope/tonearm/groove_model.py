"""The state of the groove in both directions, how it moves along the grid, and a smoother that outliers cannot fool.

A first pass leaves out what disagrees with its nearest neighbours, and rejects what is further than the gate from its
prediction; while it rejects, its error grows as fast as grooves move, so it cannot lose the groove for good. Smoothed
backwards, that tells of each reading how far it lies from what all others say, and by this it is accepted or rejected once
more, for a second pass, and so on until nothing changes. So what was rejected because the prediction was bad comes back. A
first pass that lost nothing, of which nothing changes and that began where the second one would is the second one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
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
ROUNDS = 4
"""At most so often is looked again which readings are outliers."""
ALIKE = 1e-6
SLOPES: FloatArray = np.kron(np.eye(2), SLOPE).astype(np.float64)
"""The lateral and the vertical slope (times the step) are these rows times the state."""


@dataclass(frozen=True, eq=False)
class Beliefs:
    """The priors of both directions, made ready for a grid; see `beliefs`.

    Attributes
    ----------
    priors : (GroovePrior, GroovePrior)
        Lateral and vertical.
    a, q : float64 arrays, shape (2, 8, 8)
        One step of the grid; q for σ = 1, the standard deviation of a body.
    at_rest : float64 array, shape (2, 7, 7)
        Covariance of all but the place before anything was seen, for σ = 1.
    sigma_of_bend : float64 array, shape (2,)
    """

    priors: tuple[GroovePrior, GroovePrior]
    a: FloatArray
    q: FloatArray
    at_rest: FloatArray
    sigma_of_bend: FloatArray

    def sigma(self, level: FloatArray) -> FloatArray:
        """Return the standard deviations of the slopes (of their bodies) at levels, both of shape (…, 2)."""
        bends = [prior.bends(level[..., i]) for i, prior in enumerate(self.priors)]
        return np.asarray(self.sigma_of_bend * np.stack(bends, axis=-1))

    def model(self, from_bin: int, level: FloatArray) -> GrooveModel:
        """Return what is believed at a level, shape (2,), from a bin on."""
        return GrooveModel(from_bin, self, self.sigma(level))


@dataclass(frozen=True, eq=False)
class GrooveModel:
    """What is believed of both directions, lateral first, from a bin on.

    Attributes
    ----------
    from_bin : int
    beliefs : Beliefs
    sigma : float64 array, shape (2,)
        Of the slopes (of their bodies).
    agitation : float64 array, shape (bin,)
        How many times q the noise has, from `from_bin` on; once, where it ends.
    """

    from_bin: int
    beliefs: Beliefs
    sigma: FloatArray
    agitation: FloatArray = field(default_factory=lambda: np.ones(1))

    @property
    def q(self) -> FloatArray:
        """Covariance of the noise of one step, shape (2, 8, 8)."""
        return np.asarray(self.sigma[:, None, None] ** 2 * self.beliefs.q)

    @property
    def slowest_per_m(self) -> float:
        """The least λ: what forgets most slowly."""
        return min(prior.corner_per_m for prior in self.beliefs.priors)

    @property
    def covariance(self) -> FloatArray:
        """Of the state before anything was seen, shape (16, 16)."""
        covariance = np.zeros((2 * STATES, 2 * STATES))
        for i in range(2):
            part = slice(i * STATES, (i + 1) * STATES)
            covariance[part, part] = start(self.beliefs.at_rest[i], self.sigma[i], place_sigma_m=ANYWHERE_M)
        return covariance


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
    return Moves(np.stack([m.beliefs.a for m in models]), np.stack([m.q for m in models]), here, agitation)


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
    """Whether two filters know the same, to `ALIKE` of their standard errors; what they owe to a reading long ago fades."""
    error = np.sqrt(np.diag(other.covariance))
    near = np.abs(one.mean - other.mean) <= ALIKE * error
    return bool(near.all() and (np.abs(one.covariance - other.covariance) <= ALIKE * np.outer(error, error)).all())


def _where_it_was_lost(first: Filtered, readings: Readings) -> tuple[BoolArray, BoolArray]:
    """The bins where the place was lost, not those where that was noticed; and the readings that were missed between."""
    lost, missed = np.zeros_like(first.lost), np.zeros(readings.bin.size, np.bool_)
    for noticed in np.flatnonzero(first.lost):
        for source in np.flatnonzero(first.missed[noticed] >= PATIENCE / 2):
            begun = max(int(noticed - first.since[noticed, source]), 0)
            lost[begun] = True
            missed |= (readings.source == source) & (readings.bin >= begun) & (readings.bin < noticed)
    return lost, missed
