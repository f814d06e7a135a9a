"""Where the centre of a disc lies in a picture of it, and how its grooves leave the circle.

The gradient of a groove points to the centre, or away from it; so all lines along gradients meet there, and the point nearest
to them by least squares, reweighted for dust and print, is the centre to a pixel or so. Then the picture is looked at along
rays: the grooves of neighbouring sectors are shifted against each other by what is wrong with the centre,

    d(θ) = x cos θ + y sin θ + c cos 2θ + s sin 2θ − p θ/2π,

x and y being how far the centre lies to the right and above, c and s an ellipse (pixels that are not square), and p the pitch
of the spiral. At first each sector of the disc is correlated with the next, which works however far off the start is; then
each with the mean of all along the spiral, so that errors do not add up round the disc.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import least_squares

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.signal_path import ImageArray

LONGEST_PX = 1200
"""The rough search looks at larger pictures in strides."""
SECTOR_PX = 8.0
"""Arc of a sector: the groove's own swing must not carry it to its neighbour's place from one to the next."""
MOST_SECTORS = 4096
RAYS = 4
REACH_PX = 4
ROUNDS = 2
BAND_RAYS = 512
BAND_SHARE = 0.2
"""Of the ring's usual power."""
STEP_PX = 0.5
FIRM_PX = 1.0
"""Shifts from sector to sector that are larger pull less: a scratch, or a groove taken for its neighbour."""


@dataclass(frozen=True)
class DiscCentre:
    """The centre of a disc in a picture.

    Attributes
    ----------
    row_px, column_px : float
    cos2_px, sin2_px : float
        By how much the radius of a groove grows with cos 2θ and sin 2θ, at the mean radius that was looked at.
    mean_radius_px : float
    pitch_px : float
        From one turn to the next, inwards for positive; 0 where nothing was measured.
    sigma_px : float
        Standard error of row and column.
    """

    row_px: float
    column_px: float
    cos2_px: float = 0.0
    sin2_px: float = 0.0
    mean_radius_px: float = 1.0
    pitch_px: float = 0.0
    sigma_px: float = float("nan")

    def places(self, angle_rad: npt.ArrayLike, radius_px: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return rows and columns of places on the disc.

        Parameters
        ----------
        angle_rad : array_like
            Growing with s: anticlockwise as one looks down on a record that turns clockwise; 0 is to the right.
        radius_px : array_like
            Broadcasts with it.
        """
        angle, radius = np.asarray(angle_rad, np.float64), np.asarray(radius_px, np.float64)
        bent = (self.cos2_px * np.cos(2 * angle) + self.sin2_px * np.sin(2 * angle)) / self.mean_radius_px
        true = radius * (1 + bent)
        return self.row_px - true * np.sin(angle), self.column_px + true * np.cos(angle)


def rough_centre(image: ImageArray) -> tuple[float, float]:
    """Return row and column of the point at which gradients meet.

    Parameters
    ----------
    image : array, shape (row, column)
        Of a disc; most of it must be in the picture.
    """
    stride = max(1, max(image.shape) // LONGEST_PX)
    seen = gaussian_filter(image[::stride, ::stride].astype(np.float64), 1.0)
    down, aside = (np.gradient(seen, axis=axis) for axis in (0, 1))
    size = np.asarray(np.hypot(down, aside), np.float64)
    strong = size > np.quantile(size, 0.8)
    require(bool(strong.any()), "a picture without any change of brightness", "a picture of a disc")
    rows, columns = np.nonzero(strong)
    # unit normals of the lines that run along the gradients
    normal = np.array([-aside[strong], down[strong]]) / size[strong]
    target = normal[0] * rows + normal[1] * columns
    weight = np.ones(rows.size)
    centre = np.asarray(seen.shape, np.float64) / 2
    for _ in range(30):
        a = (weight * normal) @ normal.T
        centre = np.asarray(np.linalg.solve(a, (weight * normal) @ target), np.float64)
        away = np.abs(np.einsum("i,ij->j", centre, normal) - target)
        # lines of print and dust miss the centre widely
        weight = 1 / (1 + (away / max(np.median(away), 0.5)) ** 2)
    row, column = (float(place) * stride for place in centre.tolist())
    return row, column


def refined_centre(image: ImageArray, start: tuple[float, float], *, inner_px: float, outer_px: float) -> DiscCentre:
    """Return the centre to a small part of a pixel, from a start a few pixels off.

    Parameters
    ----------
    image : array, shape (row, column)
    start : (float, float)
        Row and column.
    inner_px, outer_px : float
        Radii between which there are grooves.
    """
    require(
        outer_px - inner_px > 32, f"grooves from {inner_px:g} to {outer_px:g} pixels", "more than 32 pixels of radius"
    )
    mean = (inner_px + outer_px) / 2
    centre = DiscCentre(start[0], start[1], mean_radius_px=mean)
    for _ in range(ROUNDS):
        profiles = _profiles(image, centre, inner_px, outer_px)
        centre = _put_right(centre, *_fit(_from_neighbours(profiles), _changes))
    for _ in range(ROUNDS):
        profiles = _profiles(image, centre, inner_px, outer_px)
        centre = _put_right(centre, *_fit(_from_the_mean(profiles), _courses))
    return centre


def _put_right(centre: DiscCentre, fitted: FloatArray, sigma: float) -> DiscCentre:
    right, up, c, s, slope = (float(one) for one in fitted[:5])
    return DiscCentre(
        centre.row_px - up,
        centre.column_px + right,
        centre.cos2_px + c,
        centre.sin2_px + s,
        centre.mean_radius_px,
        centre.pitch_px - slope,
        sigma,
    )


def groove_band(image: ImageArray, centre: DiscCentre) -> tuple[float, float]:
    """Return between which radii there are grooves, in pixels: the longest stretch of radius with fine rings in it.

    Parameters
    ----------
    image : array, shape (row, column)
    centre : DiscCentre
    """
    rows, columns = image.shape
    reach = min(centre.row_px, rows - 1 - centre.row_px, centre.column_px, columns - 1 - centre.column_px)
    require(
        reach > 64, f"a disc of which {reach:g} pixels are seen round its centre", "more than 64", "check --centre-px"
    )
    radius = np.arange(0.0, reach, 0.5)
    angle = 2 * np.pi * np.arange(BAND_RAYS)[:, None] / BAND_RAYS
    rays = _seen_at(image, centre, angle, radius)
    fine = rays - gaussian_filter(rays, (0, 16.0))
    # what is the same for neighbouring rays is a ring, the rest is grain and print
    ring = np.abs(gaussian_filter(np.median(fine * np.roll(fine, 1, axis=0), axis=0), 24.0))
    inside = np.concatenate([[False], ring > BAND_SHARE * np.quantile(ring, 0.9), [False]])
    edges = np.flatnonzero(np.diff(inside.astype(np.int8))).reshape(-1, 2)
    first, stop = edges[int(np.argmax(edges[:, 1] - edges[:, 0]))]
    return float(radius[first]), float(radius[min(stop, radius.size - 1)])


def _profiles(image: ImageArray, centre: DiscCentre, inner_px: float, outer_px: float) -> FloatArray:
    """What is seen along the radius in each sector, every half pixel, following the spiral as far as it is known."""
    sectors = min(int(2 * np.pi * centre.mean_radius_px / SECTOR_PX), MOST_SECTORS)
    radius = np.arange(inner_px, outer_px, STEP_PX)
    profiles = np.empty((sectors, radius.size))
    for sector in range(sectors):
        angle = 2 * np.pi * (sector + (np.arange(RAYS) / RAYS - 0.5)[:, None]) / sectors
        inwards = centre.pitch_px * (sector / sectors - 0.5)
        profiles[sector] = _seen_at(image, centre, angle, radius - inwards).mean(axis=0)
    return np.asarray(profiles - gaussian_filter(profiles, (0, 16.0)), np.float64)


def _from_neighbours(profiles: FloatArray) -> FloatArray:
    """How much farther out the grooves of each sector lie than those of the one before, in pixels; NaN where it is not seen."""
    # the first sector follows the last one of the turn before, which is a pitch away
    return np.array([np.nan, *(STEP_PX * _shift(profiles[k - 1], profiles[k]) for k in range(1, len(profiles)))])


def _from_the_mean(profiles: FloatArray) -> FloatArray:
    """How much farther out the grooves of each sector lie than they do on the whole, in pixels."""
    mean = profiles.mean(axis=0)
    return np.array([STEP_PX * _shift(mean, profile) for profile in profiles])


def _seen_at(image: ImageArray, centre: DiscCentre, angle_rad: FloatArray, radius_px: FloatArray) -> FloatArray:
    places = np.stack(np.broadcast_arrays(*centre.places(angle_rad, radius_px)))
    return np.asarray(map_coordinates(image, places, order=1, output=np.float64, mode="nearest"), np.float64)


def _shift(before: FloatArray, after: FloatArray) -> float:
    """Shift of one profile against another at the peak of their correlation, in samples."""
    reach = 2 * REACH_PX
    inside = before[reach:-reach]
    values = np.array([inside @ after[reach + k : after.size - reach + k] for k in range(-reach, reach + 1)])
    best = int(np.argmax(values))
    if not 0 < best < values.size - 1:
        return float("nan")
    left, peak, right = values[best - 1 : best + 2]
    return float(best - reach + 0.5 * (left - right) / (left - 2 * peak + right))


def _courses(angle_rad: FloatArray) -> FloatArray:
    """The parts of d(θ), and a constant."""
    harmonics = [np.cos(angle_rad), np.sin(angle_rad), np.cos(2 * angle_rad), np.sin(2 * angle_rad)]
    return np.stack([*harmonics, angle_rad / (2 * np.pi), np.ones_like(angle_rad)], axis=1)


def _changes(angle_rad: FloatArray) -> FloatArray:
    """The parts of d(θ) from one sector to the next."""
    return (_courses(angle_rad) - _courses(angle_rad - 2 * np.pi / angle_rad.size))[:, :5]


def _fit(shifts: FloatArray, design_of: Callable[[FloatArray], FloatArray]) -> tuple[FloatArray, float]:
    """Fit d(θ); return right, up, c, s, −p and perhaps a constant, and the error of the first two."""
    design = design_of(2 * np.pi * np.arange(shifts.size) / shifts.size)
    known = np.isfinite(shifts)
    require(
        int(known.sum()) > shifts.size // 2,
        "a picture in which grooves were seen in less than half of the disc",
        "a whole disc",
        "say where the grooves are: --inner-px and --outer-px",
    )

    def residual(p: FloatArray) -> FloatArray:
        return np.asarray(design[known] @ p - shifts[known], np.float64)

    solved = least_squares(residual, np.zeros(design.shape[1]), loss="soft_l1", f_scale=FIRM_PX)
    rest = residual(solved.x)
    spread = 1.4826 * float(np.median(np.abs(rest - np.median(rest))))
    covariance = np.linalg.inv(design[known].T @ design[known]) * spread**2
    return solved.x, float(np.sqrt(covariance[:2, :2].trace() / 2))
