"""A picture at half its size again and again: large motion is small in a small picture.

Each level is smoothed by the binomial [1 3 3 1]/8 both ways and thinned by two (P. J. Burt and E. H. Adelson, IEEE
Transactions on Communications 31, 1983, with an even kernel). Pixels are squares that hold four pixels of the level below,
so a place x becomes (x + ½)/2 − ½ one level up; beyond its border a picture repeats its last pixel.
"""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

from gramoscope.conventions import Float32Array


@numba.njit(cache=True, nogil=True)
def _three_rows(above, here, below, out):  # type: ignore[no-untyped-def]
    quarter, half = np.float32(0.25), np.float32(0.5)
    for x in range(out.size):
        out[x] = quarter * (np.float32(above[x]) + np.float32(below[x])) + half * np.float32(here[x])


@numba.njit(cache=True, nogil=True)
def _four_rows(a, b, c, d, out):  # type: ignore[no-untyped-def]
    eighth, three = np.float32(0.125), np.float32(3)
    for x in range(out.size):
        out[x] = eighth * (a[x] + d[x] + three * (b[x] + c[x]))


@numba.njit(cache=True, nogil=True)
def _thin(row, out):  # type: ignore[no-untyped-def]
    """Four neighbours of every other place; `row` has one more value at the left and two at the right."""
    eighth, three = np.float32(0.125), np.float32(3)
    for x in range(out.size):
        out[x] = eighth * (row[2 * x] + row[2 * x + 3] + three * (row[2 * x + 1] + row[2 * x + 2]))


@numba.njit(cache=True, nogil=True)
def _smooth(image, out):  # type: ignore[no-untyped-def]
    height, width = image.shape
    row = np.empty(width + 2, np.float32)
    for y in range(height):
        _three_rows(image[max(y - 1, 0)], image[y], image[min(y + 1, height - 1)], row[1:-1])
        row[0], row[-1] = row[1], row[-2]
        _three_rows(row[:-2], row[1:-1], row[2:], out[y])


@numba.njit(cache=True, nogil=True)
def _halve(picture, out):  # type: ignore[no-untyped-def]
    height, width = picture.shape
    row = np.empty(width + 3, np.float32)
    for y in range(out.shape[0]):
        below, further = min(2 * y + 1, height - 1), min(2 * y + 2, height - 1)
        _four_rows(picture[max(2 * y - 1, 0)], picture[2 * y], picture[below], picture[further], row[1 : width + 1])
        row[0] = row[1]
        row[width + 1] = row[width]
        row[width + 2] = row[width]
        _thin(row, out[y])


def smoothed(image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> Float32Array:
    """Return a picture smoothed by [1 2 1]/4 both ways, which takes off the finest noise.

    Parameters
    ----------
    image : uint8 or uint16 array, shape (row, column)

    Returns
    -------
    float32 array of the same shape
        Grey levels.
    """
    out = np.empty(image.shape, np.float32)
    _smooth(image, out)
    return out


def halved(picture: Float32Array) -> Float32Array:
    """Return a picture at half its size, an odd row or column more counting as a whole pixel.

    Parameters
    ----------
    picture : float32 array, shape (row, column)

    Returns
    -------
    float32 array, shape ((row + 1) // 2, (column + 1) // 2)
    """
    height, width = picture.shape
    out = np.empty(((height + 1) // 2, (width + 1) // 2), np.float32)
    _halve(picture, out)
    return out


def picture_pyramid(image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16], *, levels: int) -> list[Float32Array]:
    """Return a picture at so many sizes, the largest first.

    Parameters
    ----------
    image : uint8 or uint16 array, shape (row, column)
    levels : int
        At least one.

    Returns
    -------
    list of float32 arrays
        Grey levels; the first is `smoothed`.
    """
    pyramid = [smoothed(image)]
    while len(pyramid) < levels:
        pyramid.append(halved(pyramid[-1]))
    return pyramid
