"""Products by rows that are vectors are those of NumPy, wherever in larger arrays the matrices lie."""

import numba
import numpy as np
import pytest

from gramoscope.tonearm import vector_rows
from gramoscope.tonearm.small_matrices import STATES, add_products, block_sandwich, block_vector, dot, times

PLACES = [(0, 0), (8, 3), (5, 11)]
"""Row and column at which a matrix begins."""


@numba.njit
def _all(a, x, y, i, j, product, outer, row, turned):  # type: ignore[no-untyped-def]
    vector_rows.multiply(a, i, j, x, j, i, product, i, i)
    vector_rows.add_outer(y, 0, j, x, i, 0, outer, j, j)
    vector_rows.add_row_times(y, 0, j, x, i, j, row, 0, i)
    vector_rows.transpose(x, i, j, turned, j, i)
    return vector_rows.inner(y, 0, i, x, j, i)


def _part(matrix: np.ndarray, i: int, j: int) -> np.ndarray:
    return matrix[i : i + STATES, j : j + STATES]


@pytest.mark.parametrize(("i", "j"), PLACES)
def test_products_of_parts_are_those_of_numpy(i: int, j: int) -> None:
    rng = np.random.default_rng(3)
    a, x, y = rng.normal(size=(20, 23)), rng.normal(size=(21, 22)), rng.normal(size=20)
    product, outer, row, turned = (rng.normal(size=(25, 25)) for _ in range(4))
    expected = [matrix.copy() for matrix in (product, outer, row, turned)]
    # views of parts, written in place
    _part(expected[0], i, i)[:] = _part(a, i, j) @ _part(x, j, i)
    _part(expected[1], j, j)[:] += np.outer(y[j : j + STATES], x[i, :STATES])
    expected[2][0, i : i + STATES] += y[j : j + STATES] @ _part(x, i, j)
    _part(expected[3], j, i)[:] = _part(x, i, j).T
    inner = _all(a, x, y, i, j, product, outer, row, turned)
    for found, right in zip((product, outer, row, turned), expected, strict=True):
        np.testing.assert_allclose(found, right, atol=1e-13)
    assert inner == pytest.approx(y[i : i + STATES] @ x[j, i : i + STATES], abs=1e-13)


@pytest.mark.parametrize("blocks", [1, 2, 3])
def test_products_of_blocks_are_those_of_the_whole(blocks: int) -> None:
    rng, size, first = np.random.default_rng(blocks), blocks * STATES, 16
    transition = np.array([[j in vector_rows.COUPLED[i] for j in range(STATES)] for i in range(STATES)])
    stacked = rng.normal(size=(first + size, STATES)) * np.tile(transition, (first // STATES + blocks, 1))
    across = stacked.reshape(-1, STATES, STATES).swapaxes(1, 2).reshape(-1, STATES).copy()
    whole = np.zeros((size, size))
    for b in range(0, size, STATES):
        whole[b : b + STATES, b : b + STATES] = stacked[first + b : first + b + STATES]
    x = rng.normal(size=(size, size))
    x, h = x + x.T, rng.normal(size=(3, size))
    out, moved, ph = np.empty((size, size)), np.empty(size), np.empty(size)
    block_sandwich(stacked, first, x, out)
    np.testing.assert_allclose(out, whole @ x @ whole.T, atol=1e-12)
    np.testing.assert_array_equal(out, out.T)
    block_vector(across, first, h[1], moved)
    np.testing.assert_allclose(moved, whole @ h[1], atol=1e-13)
    assert times(x, h, 2, ph) == pytest.approx(h[2] @ x @ h[2])
    np.testing.assert_allclose(ph, x @ h[2], atol=1e-12)
    assert dot(h, 0, ph, 0, size) == pytest.approx(h[0] @ ph)
    more = x.copy()
    add_products(h, 0, h, 1, more)
    np.testing.assert_allclose(more, x + np.outer(h[0], h[1]), atol=1e-13)
