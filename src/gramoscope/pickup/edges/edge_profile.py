"""What an edge looks like across: the profile of light, learned along its course, and how the light varies along it.

    I(s, v) = B(s) (p(v) + a(s) h(v) + b(s) (1 − h(v))) + noise

with v the distance from the edge towards the land, p the profile (one for the whole edge, so that it cannot follow the
edge's own wanderings), B the strength of the light, a and b how land and wall differ here from what they are elsewhere, and
h a soft step. Land and wall are looked at away from the edge only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.special import ndtr

from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.pickup.edges.edge_band import EdgeBand
from gramoscope.pickup.edges.likeness import shared_pixels
from gramoscope.pickup.edges.steady_course import steady_course

KNOT_PX = 0.5
SOFT_STEP_PX = 1.0
"""Standard deviation of the Gaussian under the soft step h."""
AWAY_PX = 3.0
"""Land and wall are what lies farther from the edge than this."""
LIGHT_COLUMNS, PATCH_COLUMNS = 40.0, 12.0
"""Standard deviations of the windows, in columns, over which the light, and land and wall, are averaged."""
HALF_WEIGHT = 0.1
"""A pixel that the halo of burnt light brightens by this share of the way to burnt weighs half."""
PATCHES_FROM = 1.5
"""Land and wall are patchy where their means over a window scatter by more than this, squared, times what noise would do."""


@dataclass(frozen=True, eq=False)
class EdgeProfile:
    """An edge as its band shows it.

    Attributes
    ----------
    light : float64 array, shape (column,)
        B, grey levels.
    shape : CubicSpline
        p.
    expected : float64 array, shape (column, place)
        Grey levels of the band if the edge is on its course.
    gradient : float64 array, shape (column, place)
        d(expected)/dx, x being how far the edge lies from its course towards the land.
    amplitude : float64 array, shape (column,)
        How much of the profile is seen in the neighbourhood: about 1; 0 where there is no edge.
    middle_px : float
        Where the edge lies in the profile, from the course towards the land: where it is steepest, or, of a lone line,
        where it is brightest or darkest.
    """

    light: FloatArray
    shape: CubicSpline
    expected: FloatArray
    gradient: FloatArray
    amplitude: FloatArray
    middle_px: float


def along(value: FloatArray, weight: FloatArray, columns: float) -> FloatArray:
    """Return the mean along the course under a Gaussian window, of values with weights; 0 where there is no weight."""
    total, share = (gaussian_filter1d(x, columns, mode="constant", truncate=3.0) for x in (value * weight, weight))
    return np.asarray(np.where(share > 1e-9, total / np.maximum(share, 1e-9), 0.0))


def binned(place: FloatArray, value: FloatArray, weight: FloatArray, half_px: float) -> tuple[FloatArray, FloatArray]:
    """Return means and weights of values at knots `KNOT_PX` apart from −`half_px` on, shared between the nearest two."""
    at = (place + half_px) / KNOT_PX
    count = round(2 * half_px / KNOT_PX) + 1
    low = np.clip(np.floor(at).astype(np.int64), 0, count - 2)
    share = np.clip(at - low, 0.0, 1.0)
    total, weights = np.zeros(count), np.zeros(count)
    for knot, part in ((low, 1 - share), (low + 1, share)):
        total += np.bincount(knot.ravel(), (part * weight * value).ravel(), count)
        weights += np.bincount(knot.ravel(), (part * weight).ravel(), count)
    return np.where(weights > 0, total / np.maximum(weights, 1e-12), 0.0), weights


def _learned(place: FloatArray, value: FloatArray, weight: FloatArray, half_px: float) -> CubicSpline:
    """The profile as a spline, as smooth as its means at the knots say (`steady_course`)."""
    mean, weights = binned(place, value, weight, half_px)
    knots = np.arange(mean.size) * KNOT_PX - half_px
    known = weights > 1e-3 * weights.max()
    scatter = float((weight * (value - np.interp(place, knots, mean)) ** 2).sum() / max(weight.sum(), 1.0))
    precision = np.where(known, weights / max(scatter, 1e-9), 0.0)
    return CubicSpline(knots, steady_course(mean, precision).row)


def learn_profile(band: EdgeBand, kept: BoolArray, *, line: bool = False) -> EdgeProfile:
    """Return what an edge looks like along its course.

    Parameters
    ----------
    band : EdgeBand
    kept : bool array, shape (column, place)
        The pixels to learn from.
    line : bool
        Whether it is a lone line, with the same on both sides, instead of a step.
    """
    place, weight = band.from_edge_px, kept / (1 + (band.halo / HALF_WEIGHT) ** 2)
    half_px = (place.shape[1] - 1) / 2 + 0.5
    light = _light(band, weight, half_px)[:, None]
    value = band.level / light
    soft = ndtr(place / SOFT_STEP_PX)
    land = place > AWAY_PX
    wall = place < -AWAY_PX
    patches = np.zeros_like(value, np.float64)
    difference = np.zeros(place.shape[0])
    profile = _learned(place, value, weight, half_px)
    for _ in range(2):
        rest = (value - profile(place)) * weight
        sides = (land | wall, land | wall) if line else (land, wall)
        on_land, on_wall = (_side(rest * side, weight * side) for side in sides)
        difference = on_land - on_wall
        patches = on_wall[:, None] + difference[:, None] * soft
        profile = _learned(place, value - patches, weight, half_px)
    shape = profile(place)
    slope = profile(place, 1) + difference[:, None] * np.exp(-0.5 * (place / SOFT_STEP_PX) ** 2) / (
        SOFT_STEP_PX * np.sqrt(2 * np.pi)
    )
    # only what is near the edge tells where it is; the rest may be patches of land
    near = np.clip(2.0 * (1 - np.abs(place) / half_px), 0.0, 1.0)
    return EdgeProfile(
        light[:, 0],
        profile,
        light * (shape + patches),
        -light * slope * near,
        _amplitude(value, shape, weight),
        _middle(profile, half_px, line=line),
    )


def _light(band: EdgeBand, weight: FloatArray, half_px: float) -> FloatArray:
    """The strength of the light along the course: regression on what is usual at each place across the edge."""
    usual, _ = binned(band.from_edge_px, band.level.astype(np.float64), weight, half_px)
    expected = np.interp(band.from_edge_px, np.arange(usual.size) * KNOT_PX - half_px, usual)
    power = (weight * expected**2).sum(axis=1)
    strength = (weight * expected * np.minimum(band.level, 2 * expected)).sum(axis=1) / np.maximum(power, 1e-12)
    scale = float(usual.mean()) if usual.any() else 1.0
    return scale * np.maximum(along(strength, power, LIGHT_COLUMNS), 0.02)


def _side(rest: FloatArray, weight: FloatArray) -> FloatArray:
    """By how much land or wall differs from what it is elsewhere; what may be chance is not believed."""
    count = weight.sum(axis=1)
    mean = np.where(count > 0, rest.sum(axis=1) / np.maximum(count, 1e-9), 0.0)
    patch = along(mean, count, PATCH_COLUMNS)
    pixels = float(np.mean(count)) * 2 * np.sqrt(np.pi) * PATCH_COLUMNS
    fine = rest - weight * patch[:, None]
    chance = float((fine**2).sum() / max(weight.sum(), 1.0)) * shared_pixels(fine) / max(pixels, 1.0)
    return patch if float(np.mean(patch**2)) > PATCHES_FROM * chance else np.zeros_like(patch)


def _amplitude(value: FloatArray, shape: FloatArray, weight: FloatArray) -> FloatArray:
    """Regression of what is seen, over some columns, on the profile; both about their means."""
    count = np.maximum(weight.sum(axis=1, keepdims=True), 1.0)
    centred = shape - (shape * weight).sum(axis=1, keepdims=True) / count
    power = (weight * centred**2).sum(axis=1)
    likeness = (weight * centred * value).sum(axis=1) / np.maximum(power, 1e-12)
    return along(likeness, power, PATCH_COLUMNS)


def _middle(profile: CubicSpline, half_px: float, *, line: bool) -> float:
    """Where the edge lies in the middle half of its profile: the centre of the peak of its slope, or of the line."""
    fine = np.linspace(-0.5 * half_px, 0.5 * half_px, 401)
    beside = np.median(profile(np.linspace(-half_px, half_px, 401)))
    height = (profile(fine) - beside if line else profile(fine, 1)) ** 2
    peak = height > 0.1 * height.max()
    # the peak that holds the maximum, and no other
    runs = np.cumsum(np.diff(peak, prepend=peak[0]))
    above = np.where(runs == runs[int(np.argmax(height))], height, 0.0)
    return float(np.average(fine, weights=above)) if above.any() else 0.0
