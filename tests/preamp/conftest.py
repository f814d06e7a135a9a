"""Sounds in pieces, and autoregressive processes that are known exactly."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from gramoscope.signal_path import Audio

RATE_HZ = 96_000.0
# two resonances, neither symmetric nor at a round frequency
POLES = np.array([0.97 * np.exp(0.21j), 0.93 * np.exp(1.13j), 0.6 * np.exp(2.2j)])
COEFFICIENTS = np.real(np.poly(np.concatenate([POLES, POLES.conj()])))
SCALE_M_S = 2e-4


def process(count: int, *, seed: int = 1) -> np.ndarray:
    """A stretch of the stationary process."""
    noise = SCALE_M_S * np.random.default_rng(seed).standard_normal(count + 2000)
    return lfilter([1.0], COEFFICIENTS, noise)[2000:]


def audio(
    samples: np.ndarray, *, start: int = 7, sigma: float | np.ndarray = 1e-5, flags: np.ndarray | int = 0
) -> Audio:
    count = samples.size
    return Audio(
        start,
        RATE_HZ,
        samples,
        np.broadcast_to(np.asarray(sigma, np.float64), count).copy(),
        np.broadcast_to(np.asarray(flags, np.uint16), count).copy(),
        ("read from a groove",),
    )


def cut(sound: Audio, *places: int) -> Iterator[Audio]:
    for a, b in pairwise([0, *places, sound.samples.size]):
        yield replace(
            sound,
            start_sample=sound.start_sample + a,
            samples=sound.samples[a:b],
            sigma=sound.sigma[a:b],
            flags=sound.flags[a:b],
        )


def whole(pieces: Iterable[Audio]) -> Audio:
    kept = list(pieces)
    for before, after in pairwise(kept):
        assert after.start_sample == before.start_sample + before.samples.size
    return replace(
        kept[0],
        samples=np.concatenate([piece.samples for piece in kept]),
        sigma=np.concatenate([piece.sigma for piece in kept]),
        flags=np.concatenate([piece.flags for piece in kept]),
    )


def same(first: Audio, second: Audio) -> None:
    assert first.start_sample == second.start_sample
    for name in ("samples", "sigma", "flags"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def with_bursts(samples: np.ndarray, places: Iterable[int], *, length: int, height: float, seed: int = 2) -> np.ndarray:
    """Add bursts of noise."""
    rng = np.random.default_rng(seed)
    spoilt = samples.copy()
    for place in places:
        burst = rng.standard_normal(length)
        spoilt[place : place + length] += height * burst / np.abs(burst).max()
    return spoilt


@pytest.fixture(scope="session")
def sounds() -> SimpleNamespace:
    """All of the above by name, for tests cannot import each other."""
    return SimpleNamespace(
        rate_hz=RATE_HZ,
        coefficients=COEFFICIENTS,
        scale_m_s=SCALE_M_S,
        process=process,
        audio=audio,
        cut=cut,
        whole=whole,
        same=same,
        with_bursts=with_bursts,
    )
