"""What every column of a band says of the place of its edge, and how well: least squares, column by column.

With r the pixels less the profile, g the gradient of the profile with the place of the edge, σ² the noise and kept the
pixels that count,

    δ = Σ g r/σ² / Σ g²/σ²,        var δ = Σ_ij a_i a_j σ_i σ_j ρ(i − j),    a = g/σ² / Σ g²/σ²,

where ρ is the likeness of the noise from row to row. What a pixel must not differ by, is counted after the step δ has been
taken: an edge that has moved is no dust.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.edges.edge_band import EdgeBand
from gramoscope.pickup.edges.edge_profile import KNOT_PX, EdgeProfile, along, binned
from gramoscope.pickup.edges.likeness import likeness

NOISE_COLUMNS = 20.0
"""Standard deviation of the window, in columns, over which the strength of the noise is averaged."""
LEAST_NOISE = 1e-3
"""Noise is never taken for less than this share of the range of grey levels in the band."""

FLAT = 0.2
"""Share of the steepest gradient below which a profile counts as flat."""


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
    band: EdgeBand, profile: EdgeProfile, kept: BoolArray, *, dust_gate: float, settled: bool
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
    """
    rest = band.level - profile.expected
    noise = _first_noise(band, rest, kept)
    step, _, _ = _steps(rest, profile.gradient, noise, kept)
    for _ in range(2):
        after = rest - profile.gradient * step[:, None]
        dust = band.usable & (np.abs(after) > dust_gate * noise)
        kept = band.usable & ~binary_dilation(dust, np.ones((3, 3), np.bool_))
        noise = _noise(band, rest if settled else after, 0.0 if settled else profile.gradient, noise, kept)
        step, gain, whole = _steps(rest, profile.gradient, noise, kept)
    after = np.where(kept, (rest - profile.gradient * step[:, None]) / noise, 0.0)
    # the step has taken noise along where the profile is steep; likeness is judged where it is not
    beside = np.where(np.abs(profile.gradient) < FLAT * np.abs(profile.gradient).max(), after, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = kept * profile.gradient / noise / gain[:, None]
        lost = np.where(whole > 0, 1 - gain / whole, 1.0)
        variance = np.where(gain > 0, _variance(np.where(gain[:, None] > 0, share, 0.0), likeness(beside.T)), np.inf)
    return ColumnPlaces(step, variance, lost, likeness(beside), kept)


def _steps(
    rest: FloatArray, gradient: FloatArray, noise: FloatArray, kept: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The step of each column, and the information of what is kept and of all; specks that are kept pull little."""
    information = (gradient / noise) ** 2
    gain, whole = (information * kept).sum(axis=1), information.sum(axis=1)
    pull = (kept * gradient * rest / noise**2).sum(axis=1)
    return np.where(gain > 0, pull / np.where(gain > 0, gain, 1.0), 0.0), gain, whole


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


def _variance(share: FloatArray, rho: FloatArray) -> FloatArray:
    """Variance of sums of noise in units of itself, with shares, shape (column, place)."""
    total = (share**2).sum(axis=1)
    for lag in range(1, rho.size):
        if rho[lag] > 0:
            total = total + 2 * rho[lag] * (share[:, lag:] * share[:, :-lag]).sum(axis=1)
    return np.asarray(np.maximum(total, 0.0))
