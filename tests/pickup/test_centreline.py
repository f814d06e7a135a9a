"""Centroid lines, their voids, and columns in which damage runs across."""

import numpy as np
import pytest

from gramoscope.pickup.centreline import centroids, discard_damaged_columns, fill_voids


def test_a_centroid_is_the_weighted_mean_row_of_its_column() -> None:
    rows, columns = np.array([3, 7, 5, 9]), np.array([1, 1, 4, 4])
    row, weight = centroids(rows, columns, np.array([1.0, 3.0, 2.0, 2.0]), width=6)
    np.testing.assert_allclose(row, [np.nan, 6.0, np.nan, np.nan, 7.0, np.nan])
    np.testing.assert_allclose(weight, [0, 4, 0, 0, 4, 0])


def test_a_stripe_moved_down_has_its_centroids_moved_down() -> None:
    rng = np.random.default_rng(1)
    rows, columns, weights = rng.integers(40, 70, 900), rng.integers(0, 91, 900), rng.uniform(0.1, 2, 900)
    here, _ = centroids(rows, columns, weights, width=91)
    there, _ = centroids(rows + 11, columns, weights, width=91)
    np.testing.assert_allclose(there, here + 11)
    # brighter light does not move it
    bright, _ = centroids(rows, columns, 7.3 * weights, width=91)
    np.testing.assert_allclose(bright, here)


def test_a_void_is_filled_from_the_line_and_says_so() -> None:
    line = fill_voids(np.array([4.0, np.nan, 6.5, np.nan]), np.array([4.4, 5.2, 6.0, np.nan]))
    np.testing.assert_allclose(line.row, [4.0, 5.2, 6.5, np.nan])
    np.testing.assert_array_equal(line.measured, [True, False, True, False])


@pytest.mark.parametrize(("outside", "damaged"), [(12, False), (13, True)])
def test_columns_that_damage_crosses_are_set_aside_with_their_neighbours(outside: int, damaged: bool) -> None:
    across = np.full(outside, 30)
    columns = np.concatenate([across, [25, 26, 30, 34, 35]])
    label = np.concatenate([np.full(outside, -1), [1, 1, 1, 0, -2]])
    found = discard_damaged_columns(label, columns, width=61)
    assert found[-5:].tolist() == ([1, -3, -3, -3, -2] if damaged else [1, 1, 1, 0, -2])
