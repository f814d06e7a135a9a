"""Decrackling: many small pulses near the noise are taken off the sound, each as far as it is strong.

The sound is an autoregressive process (`gramoscope.preamp.autoregression`), the crackle a sum of pulses b h(t − n) of a few
shapes, at any sample n with the same small probability, of normally distributed heights b. Predicting from the past turns both
into white noise and pulses g = a ∗ h, and what remains is a linear regression with few of many coefficients at work. Its
posterior is found by the mean-field method of Carbonetto and Stephens: for every place and shape in turn, given all others,

    c = Σ g[k] e[n + k],   v = 1 / (Σ g²/s² + 1/τ),   μ = v c / s²,   α / (1 − α) = π/(1 − π) √(v/τ) exp(μ²/2v),

with the probability α that there is a pulse, its mean height μ and variance v if there is; density π and variance τ of the
heights maximise the likelihood, block by block: in sound without crackle π falls until nothing is found. Where a pulse is
more likely than not, the sound under it is recovered as under a click (`gramoscope.preamp.click_removal`): the weaker it is,
the less the samples move. (To subtract α μ h itself was tried and is worse: real pulses are not quite of our shapes.)
Everything else stays as it is, bit for bit.

References
----------
P. Carbonetto, M. Stephens, Scalable variational inference for Bayesian variable selection in regression, Bayesian Analysis 7,
2012. S. Godsill, P. Rayner, Digital Audio Restoration, 1998, chapters 9 and 12, for the model.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numba
import numpy as np
from scipy.ndimage import binary_dilation
from scipy.signal import lfilter

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.preamp.click_search import excess_variance, filled_in, laid_about, learned_process
from gramoscope.preamp.pieces import Window, windows
from gramoscope.preamp.spoilt import Findings, findings, repaired, runs_of, with_gaps
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio

PULSE_LENGTHS = (3, 5, 8)
"""Of the pulses, half waves and whole waves of a sine, in samples."""
SWEEPS, ESTIMATES = 4, 4
LOWEST_DENSITY, FIRST_DENSITY, HIGHEST_DENSITY = 1e-6, 1e-4, 0.05
FIRST_HEIGHT = 8.0
"""In standard errors of a height."""
MARGIN = 2
"""Samples on either side of a pulse that it spoils too: real ones are not quite of our shapes."""


@dataclass(frozen=True)
class Decrackler:
    """Takes crackle off the sound.

    Parameters
    ----------
    probability : float
        A pulse is taken off where it is so likely, at the least, to be there.
    least_density_hz : float
        Blocks with fewer pulses a second are left alone: crackle is many small clicks, and a few are a plosive or a beat.
    order : int
        Of the autoregressive process, in samples.
    block_s : float
        Process, density and heights are learned anew for every block of this length, from the block and half a block on
        either side.
    """

    probability: float = 0.5
    least_density_hz: float = 250.0
    order: int = 32
    block_s: float = 0.02

    def __post_init__(self) -> None:
        require(0 < self.probability < 1, f"a probability of {self.probability:g}", "one between 0 and 1")
        require(self.least_density_hz >= 0, f"a least density of {self.least_density_hz:g} a second", "0 or more")
        require(self.order >= 1, f"an order of {self.order}", "at least one sample")
        require(self.block_s > 0, f"blocks of {self.block_s:g} s", "a positive time")

    def decrackle(self, pieces: Iterable[Audio]) -> Iterator[Audio]:
        """Return the pieces with their crackle taken off.

        Parameters
        ----------
        pieces : iterable of Audio
            Following each other without gap, at one rate. A NaN counts as 0 and is flagged `INTERPOLATED`.

        Yields
        ------
        Audio
            The same samples, whatever the pieces they came in; at the most two and a half blocks are held back. What is
            touched is flagged `DECRACKLED` and has the standard error of what is left; everything else is passed on bit for
            bit. A passage of fewer samples than four times the order is passed on as it is.

        Raises
        ------
        ArgumentError
            If a piece does not follow the one before it or has another rate, or if blocks are too short for the order.
        """
        found = map(self._search, self._windows(pieces))
        yield from repaired(found, flag=Quality.DECRACKLED, history_line=self.history_line)

    @property
    def history_line(self) -> str:
        """What the decrackler did, in words for the archive."""
        return f"small pulses of at least {self.probability:.0%} probability taken off"

    def _windows(self, pieces: Iterable[Audio]) -> Iterator[Window]:
        first = next(pieces := iter(pieces), None)
        if first is None:
            return
        block = round(self.block_s * first.rate_hz)
        require(
            block >= 8 * self.order,
            f"blocks of {block} samples at {first.rate_hz:g} Hz for an order of {self.order}",
            f"at least {8 * self.order} samples",
            "longer blocks or a lower order",
        )
        yield from windows(map(with_gaps, chain([first], pieces)), block=block, margin=block // 2)

    def _search(self, window: Window) -> Findings:
        audio = window.audio
        if audio.samples.size < 4 * self.order:
            return Findings(window, None, [])
        alpha = find_crackle(audio.samples, audio.sigma, order=self.order)[0]
        touched = _laid_down((alpha >= self.probability).astype(np.float64), 2) > 0
        if touched.any():
            touched = np.asarray(binary_dilation(touched, iterations=MARGIN), np.bool_)
        if len(runs_of(touched)) * audio.rate_hz < self.least_density_hz * audio.samples.size:
            return Findings(window, None, [])
        process = learned_process(audio.samples, order=self.order, used=~touched)
        process = learned_process(filled_in(process, audio.samples, touched), order=self.order, used=~touched)
        return findings(window, process, touched, longest=(window.stop - window.start) // 4)


def find_crackle(samples: FloatArray, sigma: FloatArray, *, order: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return how likely a pulse begins at each sample, and its height.

    Parameters
    ----------
    samples, sigma : float64 arrays, shape (sample,)
        `sigma` as in `gramoscope.preamp.click_search.significance`.
    order : int

    Returns
    -------
    probability, height, variance : float64 arrays, shape (shape of pulse, sample)
        α, μ and v.
    """
    shapes = pulses()
    everywhere = np.ones(samples.size, np.bool_)
    cleaned = samples
    alpha = mean = variance = np.zeros((len(shapes), samples.size))
    density, height = FIRST_DENSITY, FIRST_HEIGHT
    for _ in range(ESTIMATES):
        process = learned_process(cleaned, order=order, used=everywhere)
        if not process.scale.any():
            return alpha, mean, variance
        whitened = np.zeros((len(shapes), order + max(PULSE_LENGTHS)))
        for g, shape in zip(whitened, shapes, strict=True):
            g[: order + shape.size] = np.convolve(process.coefficients, shape)
        energy = np.sum(whitened**2, axis=1)
        noise = _noise_variance(process.autocorrelation, shapes, energy, process.scale, sigma)
        errors = lfilter(process.coefficients, [1.0], samples)
        errors[:order] = 0.0  # no past to predict them from
        slab = height**2 * np.median(process.scale) ** 2 / energy
        alpha, mean, variance = mean_field(errors, whitened, noise, slab, density, SWEEPS)
        cleaned = samples - _laid_down(alpha * mean, 1)
        density = float(np.clip(np.sum(alpha) / samples.size, LOWEST_DENSITY, HIGHEST_DENSITY))
        relative = (variance + mean**2) * energy[:, np.newaxis] / process.scale**2
        height = float(np.sqrt(max(np.sum(alpha * relative) / max(np.sum(alpha), 1e-12), FIRST_HEIGHT)))
    return alpha, mean, variance


@numba.njit(cache=True, nogil=True)
def mean_field(
    errors: FloatArray, whitened: FloatArray, noise: FloatArray, slab: FloatArray, density: float, sweeps: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the posterior of pulses in white noise.

    Parameters
    ----------
    errors : float64 array, shape (sample,)
        e, the errors of prediction.
    whitened : float64 array, shape (shape of pulse, tap)
        g.
    noise : float64 array, shape (shape of pulse, sample)
        s² as the pulse at a place sees it.
    slab : float64 array, shape (shape of pulse,)
        τ.
    density : float
        π of all shapes together.
    sweeps : int

    Returns
    -------
    alpha, mean, variance : float64 arrays, shape (shape of pulse, sample)
    """
    kinds, taps = whitened.shape
    count = errors.size
    rest = np.concatenate((errors, np.zeros(taps)))
    alpha, mean, variance = np.zeros((kinds, count)), np.zeros((kinds, count)), np.zeros((kinds, count))
    energy = np.sum(whitened**2, axis=1)
    odds = np.log(density / kinds / (1 - density / kinds))
    for _ in range(sweeps):
        for n in range(count):
            for kind in range(kinds):
                g = whitened[kind]
                before = alpha[kind, n] * mean[kind, n]
                seen = 0.0
                for k in range(taps):  # beyond the end there is silence, and a pulse there is thought smaller
                    seen += g[k] * rest[n + k]
                v = 1.0 / (energy[kind] / noise[kind, n] + 1.0 / slab[kind])
                m = v * (seen + before * energy[kind]) / noise[kind, n]
                logit = odds + 0.5 * np.log(v / slab[kind]) + min(m * m / (2 * v), 700.0)
                a = 1.0 / (1.0 + np.exp(-logit)) if logit > -30.0 else 0.0
                alpha[kind, n], mean[kind, n], variance[kind, n] = a, m, v
                if a * m != before:
                    for k in range(min(taps, count - n)):
                        rest[n + k] -= (a * m - before) * g[k]
    return alpha, mean, variance


def pulses() -> list[FloatArray]:
    """Return the shapes of the pulses, 1 at their highest."""
    shapes = []
    for length in PULSE_LENGTHS:
        turn = np.pi * (np.arange(length) + 0.5) / length
        shapes += [wave / np.abs(wave).max() for wave in (np.sin(turn), np.sin(2 * turn))]
    return shapes


def _noise_variance(
    autocorrelation: FloatArray, shapes: list[FloatArray], energy: FloatArray, scale: FloatArray, sigma: FloatArray
) -> FloatArray:
    """Return s² and what the samples' own errors add to it beyond the usual, as in `gramoscope.preamp.click_search`."""
    more = excess_variance(sigma)
    if not more.any():
        return np.tile(scale**2, (len(shapes), 1))
    seen = [
        laid_about(more, np.convolve(autocorrelation, shape) ** 2, lead=autocorrelation.size // 2) for shape in shapes
    ]
    return np.asarray([scale**2 + each / whole for each, whole in zip(seen, energy, strict=True)])


def _laid_down(heights: FloatArray, power: int) -> FloatArray:
    """Return Σ heights[n] shape[t − n] ** power."""
    total = np.zeros(heights.shape[1])
    for height, shape in zip(heights, pulses(), strict=True):
        total += np.convolve(height, shape**power)[: total.size]
    return total
