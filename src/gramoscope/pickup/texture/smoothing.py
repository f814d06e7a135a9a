"""Smoothing along the groove: nearly a Gaussian, at the same cost for any width; or a narrow one as it is.

Three running means one after the other are a Gaussian to 7 % of its peak (P. Kovesi, Fast almost-Gaussian filtering, DICTA
2010): their widths are odd numbers whose variances, (w² − 1)/12 each, add up to σ² as nearly as odd numbers can.
"""

from __future__ import annotations

import numba
import numpy as np

from gramoscope.conventions import FloatArray

PASSES = 3


@numba.njit(cache=True, nogil=True)
def half_widths(sigma: float) -> tuple[int, int, int]:
    """Return the half widths of three running means that together have about the standard deviation σ."""
    narrow = int(np.sqrt(12 * sigma * sigma / PASSES + 1))
    narrow -= 1 - narrow % 2
    # so many of the three are narrow, the rest two columns wider
    count = int(np.rint((12 * sigma * sigma - PASSES * (narrow * narrow + 4 * narrow + 3)) / (-4 * narrow - 4)))
    near, far = (narrow - 1) // 2, (narrow + 1) // 2
    return near if count > 0 else far, near if count > 1 else far, near if count > 2 else far


@numba.njit(cache=True, nogil=True)
def _running_mean(values, half, out):  # type: ignore[no-untyped-def]
    width = values.size
    total = (half + 1) * values[0]
    for x in range(1, half + 1):
        total += values[min(x, width - 1)]
    share = 1 / (2 * half + 1)
    for x in range(width):
        out[x] = total * share
        total += values[min(x + half + 1, width - 1)] - values[max(x - half, 0)]


@numba.njit(cache=True, nogil=True)
def smooth(values, sigma, out):  # type: ignore[no-untyped-def]
    """Write one row, smoothed by about a Gaussian of so many columns; beyond the ends each running mean holds the last value.

    A NaN spreads to all that follows it.
    """
    first, second, third = half_widths(sigma)
    between = np.empty_like(values)
    _running_mean(values, first, out)
    _running_mean(out, second, between)
    _running_mean(between, third, out)


@numba.njit(cache=True, nogil=True)
def _running_means(one, other, half, out, out_other):  # type: ignore[no-untyped-def]
    """Of two rows: a sum waits for the sum before it, but not for the other row's."""
    width = one.size
    total, total_other = (half + 1) * one[0], (half + 1) * other[0]
    for x in range(1, half + 1):
        total += one[min(x, width - 1)]
        total_other += other[min(x, width - 1)]
    share = 1 / (2 * half + 1)
    begin = min(half, width)
    end = max(width - half - 1, begin)
    for x in range(begin):
        out[x], out_other[x] = total * share, total_other * share
        entered = min(x + half + 1, width - 1)
        total += one[entered] - one[0]
        total_other += other[entered] - other[0]
    for x in range(np.uint64(begin), np.uint64(end)):
        out[x], out_other[x] = total * share, total_other * share
        enters, leaves = x + np.uint64(half + 1), x - np.uint64(half)
        total += one[enters] - one[leaves]
        total_other += other[enters] - other[leaves]
    for x in range(end, width):
        out[x], out_other[x] = total * share, total_other * share
        left = max(x - half, 0)
        total += one[width - 1] - one[left]
        total_other += other[width - 1] - other[left]


@numba.njit(cache=True, nogil=True)
def smooth_both(one, other, sigma, out, out_other):  # type: ignore[no-untyped-def]
    """Write two rows as `smooth` does, in little more time than one."""
    first, second, third = half_widths(sigma)
    between, between_other = np.empty_like(one), np.empty_like(other)
    _running_means(one, other, first, out, out_other)
    _running_means(out, out_other, second, between, between_other)
    _running_means(between, between_other, third, out, out_other)


def half_bell(sigma: float) -> FloatArray:
    """Return the taps of a Gaussian of that standard deviation, to four times as far, from its middle on."""
    reach = int(4 * sigma + 0.5)
    bell = np.exp(-0.5 / sigma**2 * np.arange(-reach, reach + 1) ** 2)
    return np.asarray(bell[reach:] / bell.sum())


@numba.njit(cache=True, nogil=True)
def blur(values, bell, before, beyond, out):  # type: ignore[no-untyped-def]
    """Write one row smoothed by a symmetric filter from its middle on, of what lies before its ends and beyond them."""
    width, reach = values.size, bell.size - 1
    wide = np.empty(width + 2 * reach)
    wide[:reach], wide[reach : reach + width], wide[reach + width :] = before, values, beyond
    for x in range(width):
        out[x] = bell[0] * values[x]
    for k in range(reach, 0, -1):
        share = bell[k]
        for x in range(width):
            out[x] += share * (wide[reach + x - k] + wide[reach + x + k])
