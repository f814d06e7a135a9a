"""What every column of a band says of the place of its edge, and how well: least squares, column by column.

With r the pixels less the profile and g the gradient of the profile with the place of the edge, of the pixels that count,

    δ = a'r,        var δ = a'Σ a,        a = Σ⁻¹ g / g'Σ⁻¹ g,

where Σ is the covariance of the errors of pixels (`column_noise`). What a pixel must not differ by, is counted after the
step δ has been taken: an edge that has moved is no dust.

Beside burnt light pixels may be brighter by about h (`halo`). Each may be so on its own, which adds h² to the variance of
that pixel, or all of a column together, which adds h h' to Σ: what looks like a halo moves no edge. What a column has lost
to dust is counted without regard to halos, which only make its error larger.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz
from scipy.ndimage import binary_dilation

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.edges.column_noise import (
    filtered,
    filtered_beside,
    patch_patterns,
    patchy_covariance,
    seen_covariance,
)
from gramoscope.pickup.edges.edge_band import EdgeBand
from gramoscope.pickup.edges.edge_profile import AWAY_PX, KNOT_PX, SOFT_STEP_PX, EdgeProfile, along, binned
from gramoscope.pickup.edges.likeness import likeness

NOISE_COLUMNS = 20.0
"""Standard deviation of the window, in columns, over which the strength of the noise is averaged."""
LEAST_NOISE = 5e-3
"""Noise is never taken for less than this share of the range of grey levels in the band."""
FLAT = 0.2
"""Share of the steepest gradient below which a profile counts as flat."""

FAINT = 0.5
"""A halo that is less than this share of the noise makes neighbours no more alike than they are."""


@dataclass(frozen=True, eq=False)
class ColumnPlaces:
    """What the columns say, each for itself.

    Attributes
    ----------
    step : float64 array, shape (column,)
        How far the edge lies from the course, towards the land; 0 where the column says nothing.
    variance : float64 array, shape (column,)
        Of the step; infinite where the column says nothing.
    lost : float64 array, shape (column,)
        0 … 1, the share of its information that the column has lost to dust and the like.
    likeness : float64 array, shape (lag,)
        Correlation of the errors of columns so far apart, from lag 0, where it is 1.
    kept : bool array, shape (column, place)
        Pixels that are no dust.
    """

    step: FloatArray
    variance: FloatArray
    lost: FloatArray
    likeness: FloatArray
    kept: BoolArray


def column_places(
    band: EdgeBand, profile: EdgeProfile, kept: BoolArray, *, dust_gate: float, settled: bool, crowded: bool = False
) -> ColumnPlaces:
    """Return what every column says of the place of its edge.

    Parameters
    ----------
    band : EdgeBand
    profile : EdgeProfile
    kept : bool array, shape (column, place)
        Pixels that have been no dust so far.
    dust_gate : float
        A pixel so many standard deviations off the profile is dust.
    settled : bool
        Whether the course follows the edge already: then the noise is judged on the course. Judged after each column's
        step it is too small, for the step takes along what neighbouring pixels share.
    crowded : bool
        Whether a neighbouring edge shows in the band: its motion is no error that pixels share, and each counts alone.
    """
    rest = band.level - profile.expected
    halo = band.halo * np.maximum(band.burnt_level - profile.expected, 0.0)
    noise = _first_noise(band, rest, kept)
    steps = _steps(rest, halo, profile, noise, kept, settled=settled, crowded=crowded)
    for _ in range(2):
        own = noise * steps.own(kept)
        dust = band.usable & (np.abs(own) > dust_gate * noise)
        kept = band.usable & ~binary_dilation(dust, np.ones((3, 3), np.bool_))
        noise = _noise(band, rest if settled else own, 0.0 if settled else profile.gradient, noise, kept)
        steps = _steps(rest, halo, profile, noise, kept, settled=settled, crowded=crowded)
    # the step has taken noise along where the profile is steep; likeness is judged where it is not, and beside no halo
    flat = np.abs(profile.gradient) < FLAT * np.abs(profile.gradient).max()
    beside = np.where(flat & kept & (halo < FAINT * noise), steps.grain(kept), 0.0)
    errors = steps.covariance
    if not settled:
        errors = errors + toeplitz(likeness(beside.T, rest.shape[1])) - np.eye(rest.shape[1])
    variance = steps.variance(errors)
    if not crowded:
        variance = variance * _strangeness(steps.after, kept, steps.covariance)
    return ColumnPlaces(steps.step, np.where(steps.gain > 0, variance, np.inf), steps.lost, likeness(beside), kept)


@dataclass(frozen=True, eq=False)
class _Steps:
    """Steps of all columns, what they rest on, and what they were weighed by, in units of the noise."""

    step: FloatArray
    share: FloatArray
    gain: FloatArray
    lost: FloatArray
    after: FloatArray
    covariance: FloatArray
    halo: FloatArray
    patterns: FloatArray
    patchy: bool

    def own(self, kept: BoolArray) -> FloatArray:
        """What is left of each pixel after the step, without the patterns that come and go."""
        return filtered(self.covariance, kept, self.after) if self.patchy else self.after

    def grain(self, kept: BoolArray) -> FloatArray:
        """What is left of each pixel after the step and without any land or wall that is brighter as a whole.

        Such patterns last for many columns, and the step hardly hears them: what they have in common is none of its errors.
        """
        left = np.where(kept, self.after, 0.0)
        return np.asarray(left - left @ np.linalg.pinv(self.patterns).T @ self.patterns.T)

    def variance(self, covariance: FloatArray) -> FloatArray:
        """Of the steps, by the covariance of the pixels."""
        by_noise = ((self.share @ covariance) * self.share).sum(axis=1)
        return np.asarray(by_noise + (self.share * self.halo).sum(axis=1) ** 2)


def _steps(
    rest: FloatArray,
    halo: FloatArray,
    profile: EdgeProfile,
    noise: FloatArray,
    kept: BoolArray,
    *,
    settled: bool,
    crowded: bool,
) -> _Steps:
    """The step of each column, by generalised least squares (`column_noise`); specks that are kept pull little."""
    clear = profile.gradient / noise
    noise = np.hypot(noise, halo)
    rest, gradient, halo = rest / noise, profile.gradient / noise, halo / noise
    place = np.arange(rest.shape[1]) - (rest.shape[1] - 1) / 2
    bright = np.mean(profile.light[:, None] / noise, axis=0)
    patterns = bright[:, None] * patch_patterns(place, SOFT_STEP_PX)
    if crowded:
        # the next edge lies within: nothing is known to be land or wall as a whole
        covariance, patterns = np.eye(rest.shape[1]), np.zeros((rest.shape[1], 1))
    elif settled:
        covariance = seen_covariance(rest, kept)
    else:
        covariance = patchy_covariance(rest, kept, patterns, np.abs(place) > AWAY_PX)
    pull = filtered_beside(covariance, kept, gradient, halo)
    gain = (pull * gradient).sum(axis=1)
    share = np.where(gain[:, None] > 0, pull / np.where(gain > 0, gain, 1.0)[:, None], 0.0)
    step = (share * rest).sum(axis=1)
    after, lost = rest - gradient * step[:, None], _lost(covariance, kept, clear)
    return _Steps(step, share, gain, lost, after, covariance, halo, patterns, patchy=not settled)


def _lost(covariance: FloatArray, kept: BoolArray, gradient: FloatArray) -> FloatArray:
    """Share of the information of each column that is not kept."""
    known, whole = ((filtered(covariance, which, gradient) * gradient).sum(axis=1) for which in (kept, kept | True))
    return np.where(whole > 0, 1 - known / np.where(whole > 0, whole, 1.0), 1.0)


def _strangeness(after: FloatArray, kept: BoolArray, covariance: FloatArray) -> FloatArray:
    """How many times more than usual a column differs from the profile, squared; at least 1."""
    free = np.maximum(kept.sum(axis=1) - 1, 1)
    squares = (filtered(covariance, kept, after) * after).sum(axis=1) / free
    usual = float(np.median(squares[kept.any(axis=1)])) if kept.any() else 1.0
    return np.asarray(np.maximum(squares / max(usual, 1e-12), 1.0))


def _first_noise(band: EdgeBand, rest: FloatArray, kept: BoolArray) -> FloatArray:
    """The noise at each place across the edge, by absolute deviations, to begin with."""
    usual = 1.4826 * float(np.median(np.abs(rest[kept]))) if kept.any() else 1.0
    half_px = (rest.shape[1] - 1) / 2 + 0.5
    deviation = np.minimum(np.abs(rest), 4 * max(usual, 1e-9))
    mean, weight = binned(band.from_edge_px, deviation, kept.astype(np.float64), half_px)
    return _at_places(band, np.where(weight > 0, 1.2533 * mean, usual), half_px)


def _noise(
    band: EdgeBand, after: FloatArray, gradient: FloatArray | float, noise: FloatArray, kept: BoolArray
) -> FloatArray:
    """The noise of each pixel: across the edge by its place, along it by how dirty or bright the neighbourhood is."""
    half_px = (after.shape[1] - 1) / 2 + 0.5
    information = (gradient / noise) ** 2 * kept
    # the step has taken its part of the noise along
    left = 1 - information / np.maximum(information.sum(axis=1, keepdims=True), 1e-12)
    weight = kept.astype(np.float64)
    square, _ = binned(band.from_edge_px, after**2, weight, half_px)
    free, _ = binned(band.from_edge_px, left, weight, half_px)
    usual = float(np.sqrt((after[kept] ** 2).mean())) if kept.any() else 1.0
    across = _at_places(band, np.where(free > 0.05, np.sqrt(square / np.maximum(free, 0.05)), usual), half_px)
    count = weight.sum(axis=1)
    mean = (weight * (after / across) ** 2).sum(axis=1) / np.maximum((weight * left).sum(axis=1), 1e-9)
    strength = along(mean, count, NOISE_COLUMNS)
    return across * np.sqrt(np.where(strength > 0, np.maximum(strength, 0.1), 1.0))[:, None]


def _at_places(band: EdgeBand, knots: FloatArray, half_px: float) -> FloatArray:
    """Values at knots as values of each pixel, smoothed over a pixel or two."""
    smooth = np.convolve(np.pad(knots, 2, mode="edge"), np.array([1, 2, 3, 2, 1]) / 9, mode="valid")
    floor = LEAST_NOISE * max(float(np.ptp(band.level)), 1.0)
    return np.maximum(np.interp(band.from_edge_px, np.arange(knots.size) * KNOT_PX - half_px, smooth), floor)
