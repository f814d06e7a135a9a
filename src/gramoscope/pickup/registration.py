"""The frames of a group laid over each other along the motion of the record.

The texture is fixed to the record, so frame k shows at column x what the first frame showed at column x + d_k, where d_k is
how far the record has turned. Laid over each other, the frames give at every point of the *canvas* (the coordinates of the
first frame, extended forward by the last d_k)

- their mean M, in which camera noise is √n smaller, and
- their trend T, the slope of a straight line through the n values, in grey levels a frame: the temporal derivative that
  remains when the motion assumed was not quite right. All frames of the group take part in it, not only two.

`frame_shifts` finds the d_k themselves: a least-squares flow with one unknown for each pair of frames, over the rows that
carry texture.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.camera.film_line import film_line
from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.pickup.film_lanes import COLUMNS, add_products
from gramoscope.quantile import quantile
from gramoscope.signal_path import FrameGroup, ImageArray, Texture

STRIP_REACH_PX = 40
"""Strips for matching stretches reach so far beyond their nominal overlap."""
CONVERGED_PX = 2e-3
"""Steps of the shift search below this are no longer worth a round."""
LARGEST_STEP_PX = 0.5
REACH_PX = 3.0
"""How far from its expectation a shift is believed."""
ROUNDS = 12
TAPS = 6
"""Of `quintic_taps`."""


@dataclass(frozen=True, eq=False)
class Canvas:
    """The frames of a group laid over each other.

    Attributes
    ----------
    mean, trend : float32 arrays, shape (row, column)
        M in grey levels and T in grey levels a frame; `trend` is zero where fewer than two frames overlap.
    frames : int array, shape (column,)
        How many frames each column rests on.
    shift_px : float64 array, shape (frame,)
        d_k of each frame used.
    frame_index : int array, shape (frame,)
        Which frames of the group were used.
    """

    mean: Float32Array
    trend: Float32Array
    frames: npt.NDArray[np.int64]
    shift_px: FloatArray
    frame_index: npt.NDArray[np.int64]


@numba.njit(cache=True, nogil=True)
def cubic_taps(fraction: float) -> tuple[float, float, float, float]:
    """Return the four weights of Catmull–Rom interpolation at `fraction` (0 … 1) between the middle two samples."""
    f = fraction
    return (
        f * (-0.5 + f * (1.0 - 0.5 * f)),
        1.0 + f * f * (-2.5 + 1.5 * f),
        f * (0.5 + f * (2.0 - 1.5 * f)),
        f * f * (-0.5 + 0.5 * f),
    )


@numba.njit(cache=True, nogil=True)
def quintic_taps(fraction: float) -> tuple[float, float, float, float, float, float]:
    """Return the six weights of Lagrange's interpolation at `fraction` (0 … 1) between the middle two samples.

    Exact for polynomials up to the fifth degree. Textures with a period of six pixels it delays by the fraction to 1 %,
    Catmull–Rom to 14 %, which biased shifts by up to 0.009 pixels: a search for shifts needs the better one.
    """
    f = fraction
    a, b, c, d, e, g = f + 2, f + 1, f, f - 1, f - 2, f - 3
    return (
        -b * c * d * e * g / 120,
        a * c * d * e * g / 24,
        -a * b * d * e * g / 12,
        a * b * c * e * g / 12,
        -a * b * c * d * g / 24,
        a * b * c * d * e / 120,
    )


@numba.njit(cache=True, nogil=True)
def _add_row(before, here, after, beyond, taps, weight, total, moment):  # type: ignore[no-untyped-def]
    w0, w1, w2, w3 = taps
    w0, w1, w2, w3 = np.float32(w0), np.float32(w1), np.float32(w2), np.float32(w3)
    k = np.float32(weight)
    for x in range(total.size):
        value = w0 * before[x] + w1 * here[x] + w2 * after[x] + w3 * beyond[x]
        total[x] += value
        moment[x] += k * value


@numba.njit(cache=True, nogil=True)
def placement(shift_px: float, width: int, canvas_width: int) -> tuple[int, int, int, float]:
    """Canvas columns [start, stop) that a frame covers, its column minus theirs, and the fraction between."""
    offset = int(math.floor(-shift_px))  # noqa: RUF046  CUDA has this floor only, and its is a float
    fraction = -shift_px - offset
    start = max(0, 1 - offset)
    stop = min(canvas_width, width - 2 - offset)
    return start, stop, offset, fraction


@numba.njit(cache=True, nogil=True)
def _register(images, shift_px, weights, counts, mean_weight, spread, mean, trend):  # type: ignore[no-untyped-def]
    frames, height, width = images.shape
    canvas_width = mean.shape[1]
    moment = np.empty(canvas_width, np.float32)
    total = np.empty(canvas_width, np.float32)
    for row in range(height):
        total[:] = np.float32(0)
        moment[:] = np.float32(0)
        for k in range(frames):
            start, stop, offset, fraction = placement(shift_px[k], width, canvas_width)
            seen = images[k, row, start + offset - 1 : stop + offset + 2]
            here = slice(start, stop)
            _add_row(
                seen[:-3], seen[1:-2], seen[2:-1], seen[3:], cubic_taps(fraction), weights[k], total[here], moment[here]
            )
        for x in range(canvas_width):
            if counts[x] > 0:
                mean[row, x] = total[x] / counts[x]
                trend[row, x] = (moment[x] - mean_weight[x] * total[x]) * spread[x]


def register(images: ImageArray, shift_px: FloatArray, frame_index: npt.NDArray[np.int64]) -> Canvas:
    """Lay frames over each other along their shifts.

    Parameters
    ----------
    images : uint8 or uint16 array, shape (frame, row, column)
    shift_px : float64 array, shape (frame,)
        d_k ≥ 0, how far the record has turned since the first frame.
    frame_index : int array, shape (frame,)
        Number of each frame in running order: the abscissa of the trend.

    Returns
    -------
    Canvas
        Columns that no frame covers (one at each end, lost to interpolation) repeat their neighbour.
    """
    height, width = images.shape[1:]
    canvas_width = width + int(np.floor(shift_px.max(initial=0.0)))
    counts, first, second = (np.zeros(canvas_width) for _ in range(3))
    for shift, k in zip(shift_px, frame_index, strict=True):
        start, stop, _, _ = placement(float(shift), width, canvas_width)
        counts[start:stop] += 1
        first[start:stop] += k
        second[start:stop] += k * k
    mean_index = first / np.maximum(counts, 1)
    variance = second - counts * mean_index**2
    spread = np.where(variance > 0, 1 / np.maximum(variance, 1e-12), 0.0)
    mean, trend = (np.zeros((height, canvas_width), np.float32) for _ in range(2))
    _register(
        images,
        shift_px,
        frame_index.astype(np.float64),
        counts.astype(np.float32),
        mean_index.astype(np.float32),
        spread.astype(np.float32),
        mean,
        trend,
    )
    covered = np.flatnonzero(counts)
    if covered.size:
        mean[:, : covered[0]] = mean[:, covered[0], None]
        mean[:, covered[-1] + 1 :] = mean[:, covered[-1], None]
    return Canvas(mean, trend, counts.astype(np.int64), shift_px, frame_index)


@numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"})
def _row_texture(before, after):  # type: ignore[no-untyped-def]
    total = np.float32(0)
    for x in range(after.size):
        gradient = np.float32(after[x]) - np.float32(before[x])
        total += gradient * gradient
    return total


@numba.njit(cache=True, nogil=True)
def _textured_rows(image, share, most):  # type: ignore[no-untyped-def]
    power = np.empty(image.shape[0])
    for row in range(power.size):
        power[row] = _row_texture(image[row, :-4], image[row, 4:])
    power -= quantile(power, 0.25)
    largest = power.max()
    rows = np.flatnonzero(power >= share * largest) if largest > 0 else np.arange(power.size)
    return rows[:: -(-rows.size // most)]


@numba.njit(cache=True, nogil=True)
def _add_few_products(film, here, there, count, sums):  # type: ignore[no-untyped-def]
    """Do what `film_lanes.add_products` does, for few columns."""
    for x in range(count):
        one, other = here + x, there + x
        slope = np.int64(film[one + 2]) + np.int64(film[one + 1]) - np.int64(film[one - 1]) - np.int64(film[one - 2])
        sums[0] += slope * slope
        sums[1] += slope * np.int64(film[one])
        for k in range(TAPS):
            sums[2 + k] += slope * np.int64(film[other + k - 2])


@numba.njit(cache=True, nogil=True)
def _products(film, here, there, rows, width, start, stop, offset):  # type: ignore[no-untyped-def]
    """Return what rows of two frames give with each other when they are moved by whole pixels: see `add_products`.

    Frames begin at some places of a film as one line. Sums of products of whole numbers are exact.
    """
    sums = np.zeros(2 + TAPS, np.int64)
    for row in rows:
        one = here + row * width + start
        other, count = there + row * width + start + offset, stop - start
        if count >= COLUMNS:
            add_products(film, one, other, count, sums)
        else:
            _add_few_products(film, one, other, count, sums)
    return sums.astype(np.float64)


@numba.njit(cache=True, nogil=True)
def _pair_shift(film, here, there, rows, width, expected_px, reach_px, rounds):  # type: ignore[no-untyped-def]
    """Return the shift that steps lead to; they need the film again only when they come to another whole pixel."""
    shift_px, seen, products = expected_px, 0, np.zeros(2 + TAPS)
    for turn in range(rounds):
        start, stop, offset, fraction = placement(shift_px, width, width)
        # two more taps than `placement` makes room for, and a gradient of five columns
        start, stop = max(start + 1, 2), min(stop - 1, width - 2)
        if turn == 0 or offset != seen:
            seen, products = offset, _products(film, here, there, rows, width, start, max(start, stop), offset)
        cross = -products[1]
        for k, tap in enumerate(quintic_taps(fraction)):
            cross += tap * products[2 + k]
        # the gradient of five columns, (x₂ + x₁ − x₋₁ − x₋₂)/6, without its sixth
        step = 6.0 * cross / products[0] if products[0] > 0 else 0.0
        step = min(max(step, -LARGEST_STEP_PX), LARGEST_STEP_PX)
        shift_px += step
        if not abs(shift_px - expected_px) <= reach_px or shift_px < 0:
            return np.nan
        if abs(step) < CONVERGED_PX:
            return shift_px
    return np.nan


@numba.njit(cache=True, nogil=True)
def _pair_shifts(film, step, shape, index, expected_px, share):  # type: ignore[no-untyped-def]
    found_px, (_, height, width) = np.empty(expected_px.size), shape
    first = film[index[0] * step : index[0] * step + height * width].reshape(height, width)
    rows = _textured_rows(first, share, ENOUGH_ROWS)
    for i in range(found_px.size):
        here, there = index[i] * step, index[i + 1] * step
        found_px[i] = _pair_shift(film, here, there, rows, width, expected_px[i], REACH_PX, ROUNDS)
    return found_px


TEXTURED = 0.25
"""Rows with less power than this, of the strongest row's, carry no texture."""
ENOUGH_ROWS = 32
"""So many rows that carry texture say where a frame lies to a hundredth of a pixel; more are not looked at."""


def textured_rows(image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> npt.NDArray[np.int64]:
    """Return rows whose gradients along the groove are strong: enough of them, spread evenly over all.

    The power that every row has (camera noise) is taken off first, as the lower quartile over the rows.
    """
    return np.asarray(_textured_rows(image, TEXTURED, ENOUGH_ROWS))


def pair_shift_px(
    here: npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
    there: npt.NDArray[np.uint8] | npt.NDArray[np.uint16],
    *,
    expected_px: float,
    rows: npt.NDArray[np.int64],
    reach_px: float = REACH_PX,
    rounds: int = ROUNDS,
) -> float:
    """Return how far the record turned from one frame to a later one, by least-squares flow along the groove.

    Minimises Σ (I₂(x − d) − I₁(x))² over the rows that carry texture by Gauss–Newton steps from the expected d: the flow
    of Lucas and Kanade (1981) with one unknown for a pair of frames.

    Parameters
    ----------
    here, there : uint arrays, shape (row, column)
    expected_px : float
        Where to start, ≥ 0.
    rows : int array
        Rows to use, see `textured_rows`.
    reach_px : float
        How far from the expectation an answer is believed.
    rounds : int
        At most so many steps.

    Returns
    -------
    float
        d in pixels; NaN when the search does not converge within `reach_px`.
    """
    both = np.stack([here, there])
    return float(_pair_shift(both.ravel(), 0, here.size, rows, here.shape[1], float(expected_px), reach_px, rounds))


def frame_shifts(group: FrameGroup) -> tuple[FloatArray, FloatArray]:
    """Return how far the record really turned by each valid frame of a group.

    Parameters
    ----------
    group : FrameGroup
        At least one frame valid.

    Returns
    -------
    shift_px : float64 array, shape (valid frame,)
        Since the first valid frame.
    frame_step_m : float64 array, shape (frame − 1,)
        From frame to frame; NaN beside a frame that is not valid and where the flow could not be found (there the
        nominal step is used in `shift_px`).
    """
    expected_px = expected_steps_px(group)
    film, step = film_line(group.images)
    usable = np.flatnonzero(group.valid)
    return added_up(group, expected_px, _pair_shifts(film, step, group.images.shape, usable, expected_px, TEXTURED))


def expected_steps_px(group: FrameGroup) -> FloatArray:
    """Return how far the record should have turned from each valid frame to the next, 0 or more."""
    return np.maximum(np.diff(group.arc_start_m[group.valid] / group.pixel_pitch_m), 0.0)


def added_up(group: FrameGroup, expected_px: FloatArray, found_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what `frame_shifts` does, of the steps that were expected and found (or NaN) between valid frames."""
    shift_px, step_m = np.empty(expected_px.size + 1), np.empty(max(group.images.shape[0] - 1, 0))
    _add_steps(group.valid, expected_px, found_px, group.pixel_pitch_m, shift_px, step_m)
    return shift_px, step_m


@numba.njit(cache=True, nogil=True)
def _add_steps(valid, expected_px, found_px, pitch_m, shift_px, step_m):  # type: ignore[no-untyped-def]
    """Write where the valid frames lie, and the steps between neighbours of which both are valid."""
    seen = 0
    for frame in range(valid.size):
        if frame < step_m.size:
            step_m[frame] = np.nan
        if valid[frame]:
            if seen == 0:
                shift_px[0] = 0.0
            else:
                step = found_px[seen - 1]
                shift_px[seen] = shift_px[seen - 1] + (expected_px[seen - 1] if np.isnan(step) else step)
                if valid[frame - 1]:
                    step_m[frame - 1] = step * pitch_m
            seen += 1


def registered(group: FrameGroup) -> tuple[Canvas, FloatArray]:
    """Return the valid frames of a group laid over each other, and the steps between frames (see `frame_shifts`)."""
    shift_px, step_m = frame_shifts(group)
    return register(group.usable_images, shift_px, np.flatnonzero(group.valid)), step_m


def overlap_textures(
    group: FrameGroup,
    *,
    first: int,
    width: int,
    group_step_m: float,
    texture_of: Callable[[slice], Float32Array],
    reach_px: int = STRIP_REACH_PX,
) -> tuple[Texture | None, Texture | None]:
    """Return the strips at both ends of a stretch by which it is matched with its neighbours.

    Parameters
    ----------
    group : FrameGroup
    first : int
        Number of the first frame that was used.
    width : int
        Columns of the canvas.
    group_step_m : float
        From stretch to stretch, nominal.
    texture_of : callable
        Gives the texture, shape (row, column), of some columns of the canvas.
    reach_px : int
        How far the strips reach beyond the nominal overlap.

    Returns
    -------
    head, tail : Texture or None
        None where stretches do not overlap.
    """
    pitch = group.pixel_pitch_m
    ends = strip_columns(group, width=width, group_step_m=group_step_m, reach_px=reach_px)
    if not ends:
        return None, None
    start, stage = float(group.arc_start_m[first]), float(group.stage_m[first])
    head, tail = (Texture(texture_of(end), start + end.start * pitch, pitch, stage) for end in ends)
    return head, tail


def strip_columns(
    group: FrameGroup, *, width: int, group_step_m: float, reach_px: int = STRIP_REACH_PX
) -> tuple[slice, ...]:
    """Return which columns of a canvas both strips take, that at the start and that at the end; none without overlap."""
    overlap = width - round(group_step_m / group.pixel_pitch_m)
    length = min(overlap + reach_px, width)
    return (slice(0, length), slice(width - length, width)) if overlap > 0 else ()
