"""The ear of a model as it lies on a graphics card."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import cuda

from gramoscope.conventions import Float32Array
from gramoscope.pickup.texture.following import TAPS_OF_PHASES
from gramoscope.pickup.texture.hearing import Ear
from gramoscope.pickup.texture.likelihood import LOUDNESS_BELL, TAPER


@dataclass(frozen=True, eq=False)
class EarThere:
    """What the kernels need of an ear; arrays on the card.

    Attributes
    ----------
    basis, usual, filters, sign, half_taps
        As in `texture.hearing.Ear`.
    mean, trust : float32 arrays, shape (stripe,)
    turn : float32 array, shape (length, 2)
        Cosine and sine of one turn.
    share : float32 array, shape (bin in the band,)
        With which each bin comes back: two over the length, for a bin stands for its mirror too.
    taps : float32 array, shape (phase, tap)
        Of the interpolation between rows.
    half_bell, taper : float32 arrays
        Smoothing of the loudness, from its middle on, and of the weights.
    """

    basis: Any
    usual: Any
    filters: Any
    sign: Any
    half_taps: Any
    mean: Any
    trust: Any
    turn: Any
    share: Any
    taps: Any
    half_bell: Any
    taper: Any


def ear_there(ear: Ear) -> EarThere:
    """Copy an ear to the card."""
    arrays = (
        *(ear.basis, ear.usual, ear.filters, ear.sign, ear.half_taps, ear.mean_score, ear.trust),
        *(one_turn(ear.length), shares_of_bins(ear), TAPS_OF_PHASES, LOUDNESS_BELL, TAPER),
    )
    return EarThere(*(cuda.to_device(np.ascontiguousarray(one, np.float32)) for one in arrays))


def one_turn(length: int) -> Float32Array:
    """Return cos and sin of 2π m / length, shape (length, 2)."""
    angle = 2 * np.pi * np.arange(length) / length
    return np.stack([np.cos(angle), np.sin(angle)], axis=1).astype(np.float32)


def shares_of_bins(ear: Ear) -> Float32Array:
    """Return how much of a bin comes back in the inverse of a real transform: those without a mirror count once."""
    bins = np.arange(ear.length // 2 + 1)[ear.band.bins(ear.length)]
    alone = (bins == 0) | (2 * bins == ear.length)
    return np.where(alone, 1 / ear.length, 2 / ear.length).astype(np.float32)
