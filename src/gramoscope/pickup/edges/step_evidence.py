"""What speaks for an edge at each place of a picture, coarsely: how much brighter the land side is than the wall side.

The picture is averaged over blocks of columns, by its logarithm, so that neither the strength of the light nor its
unevenness count. On the side of the land only a few rows are looked at, so that a thin bright line at the edge counts
like bright land; on the side of the wall some more. What is burnt (at full scale) or not seen has no say. Evidence is
counted in standard deviations of its own over the picture, which are those of noise and texture, edges being rare; and
it is cut off above, so that no speck outvotes its surroundings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

from gramoscope.conventions import BoolArray, Float32Array, Scalar
from gramoscope.pickup.edges.appearance import Appearance
from gramoscope.signal_path import StillPicture

MAD_TO_SIGMA = 1.4826
SHADOW = 0.1
"""Added to every pixel before its logarithm, as a share of the median: noise of black pixels is no contrast."""
UNKNOWN = 1.0
"""Evidence where nothing is seen: less than a path finds by chance in noise, more than it finds away from an edge."""
LEAST_EVIDENCE, MOST_EVIDENCE = -1.0, 4.0
FEWEST_PIXELS = 0.5
"""A mean over less than this share of its pixels is not believed."""
SAMPLE_PIXELS = 1 << 20
"""Medians over a picture rest on so many pixels at most, evenly spread."""
TOP = 0.98
"""The highest fiftieth of all values."""
PILED_UP, LEAST_BURNT, MOST_BURNT = 5.0, 1e-3, 0.15
"""Times as many pixels in it as in the next, and shares of all pixels, of a picture whose dust is burnt."""


@dataclass(frozen=True, eq=False)
class StepEvidence:
    """What speaks for an edge.

    Attributes
    ----------
    outer, inner : float32 arrays, shape (block, row)
        In standard deviations, for an edge with the land at smaller rows, and at larger rows.
    block_px : int
        Columns in a block.
    """

    outer: Float32Array
    inner: Float32Array
    block_px: int


def burnt_level(picture: StillPicture, burnt_share: float) -> int:
    """Return the pixel value from which on a pixel counts as burnt: a share of full scale, or of what full scale has become.

    In a picture that was darkened after it was taken burnt pixels pile up at the highest value that there is, `PILED_UP` times
    as many as just below. They are few: a land without any noise is no dust.
    """
    sample: npt.NDArray[np.uint16] = spread_sample(picture.image).astype(np.uint16)
    white_level, top = picture.white_level, int(sample.max())
    if top < burnt_share * white_level:
        highest = float(np.mean(sample > TOP * top))
        below = float(np.mean(sample > (2 * TOP - 1) * top)) - highest
        if MOST_BURNT > highest > max(PILED_UP * below, LEAST_BURNT):
            white_level = top
    return max(1, int(np.ceil(burnt_share * white_level)))


def spread_sample(values: npt.NDArray[Scalar]) -> npt.NDArray[Scalar]:
    """Return evenly spread values of an array, at most about `SAMPLE_PIXELS`; a view."""
    step = int(np.ceil(np.sqrt(max(values.size / SAMPLE_PIXELS, 1.0))))
    return values[::step, ::step]


def _logarithms(picture: StillPicture, burnt: int) -> Float32Array:
    """The logarithm of each pixel value, as a table; NaN for burnt ones."""
    value = spread_sample(picture.image)[spread_sample(picture.seen)].astype(np.float64)
    shadow = SHADOW * float(np.median(value)) if value.size else 1.0
    table = np.log(np.arange(np.iinfo(picture.image.dtype).max + 1) + max(shadow, 1e-3))
    table[burnt:] = np.nan
    return np.asarray(table, np.float32)


@numba.njit(cache=True, nogil=True)
def _block_means(image, seen, table, step, level, share):  # type: ignore[no-untyped-def]
    """Means of logarithms over blocks of columns, [block, row], and the share of pixels they rest on."""
    rows = image.shape[0]
    for r in range(rows):
        for b in range(level.shape[0]):
            total, count = np.float32(0), 0
            for c in range(b * step, b * step + step):
                value = table[image[r, c]]
                if seen[r, c] and value == value:
                    total += value
                    count += 1
            level[b, r] = total / np.float32(count) if count else np.float32(0)
            share[b, r] = np.float32(count) / np.float32(step)


def block_means(picture: StillPicture, burnt: int, block_px: int) -> tuple[Float32Array, Float32Array]:
    """Return the mean logarithm of each row in each block of columns, and the share of its pixels that count.

    Parameters
    ----------
    picture : StillPicture
    burnt : int
        From this value on a pixel does not count.
    block_px : int
        Columns of a block; a last block that is not full is left out.

    Returns
    -------
    level, share : float32 arrays, shape (block, row)
        The level is 0 where the share is.
    """
    shape = (picture.image.shape[1] // block_px, picture.image.shape[0])
    level, share = np.empty(shape, np.float32), np.empty(shape, np.float32)
    _block_means(picture.image, picture.seen, _logarithms(picture, burnt), block_px, level, share)
    return level, share


def step_evidence(
    picture: StillPicture, appearance: Appearance, *, pitch_px: float, burnt: int, block_px: int
) -> StepEvidence:
    """Return what speaks for an edge at each place of a picture.

    Parameters
    ----------
    picture : StillPicture
    appearance : Appearance
    pitch_px : float
        From groove to groove, roughly; all windows are shares of it.
    burnt : int
        From this value on a pixel does not count.
    block_px : int
        Columns of a block.

    Returns
    -------
    StepEvidence
        `UNKNOWN` where too little is seen.
    """
    level, share = block_means(picture, burnt, block_px)
    smooth = 0.025 * pitch_px / block_px
    weighted, weight = (gaussian_filter1d(x, smooth, axis=0, mode="nearest") for x in (level * share, share))
    wall, land = max(2, round(pitch_px / 22)), max(2, round(pitch_px / 50))
    means = _RowMeans(weighted, weight)
    if appearance is Appearance.BRIGHT_LINES:
        line = max(1, land // 2)
        middle = means.over(-line, line + 1)
        beside = 0.5 * (means.over(-line - wall, -line) + means.over(line + 1, line + 1 + wall))
        either = _normalised(middle - beside)
        return StepEvidence(either, either.copy(), block_px)
    sign = np.float32(-1 if appearance is Appearance.BRIGHT_GROOVES else 1)
    outer = sign * (means.over(-land, 0) - means.over(0, wall))
    inner = sign * (means.over(0, land) - means.over(-wall, 0))
    return StepEvidence(_normalised(outer), _normalised(inner), block_px)


class _RowMeans:
    """Means over rows beside each row, of levels with weights."""

    def __init__(self, weighted: Float32Array, weight: Float32Array) -> None:
        self._sums = [np.cumsum(np.pad(x, ((0, 0), (1, 0))), axis=1, dtype=np.float64) for x in (weighted, weight)]
        self._rows = weighted.shape[1]

    def over(self, start: int, stop: int) -> Float32Array:
        """Means over the rows from `start` to `stop` beside each row; NaN where too little is seen."""
        row = np.arange(self._rows)
        low, high = (np.clip(row + side, 0, self._rows) for side in (start, stop))
        total, weight = (sums[:, high] - sums[:, low] for sums in self._sums)
        enough: BoolArray = weight >= FEWEST_PIXELS * (stop - start)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(enough, total / weight, np.nan).astype(np.float32)


def _normalised(step: Float32Array) -> Float32Array:
    """In standard deviations of noise, cut off at both ends; unknown where it is not known."""
    some = np.abs(spread_sample(step))
    some = some[np.isfinite(some)]
    noise = MAD_TO_SIGMA * float(np.median(some)) if some.size else 1.0
    scaled = np.clip(step / np.float32(max(noise, 1e-6)), LEAST_EVIDENCE, MOST_EVIDENCE)
    return np.where(np.isfinite(step), scaled, np.float32(UNKNOWN)).astype(np.float32)
