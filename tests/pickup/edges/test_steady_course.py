"""The smooth course: what its matrix says, and whether its errors are true."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from gramoscope.errors import ArgumentError
from gramoscope.pickup.edges.steady_course import ORDER, left_by_course, steady_course


def test_the_course_and_its_variance_are_those_of_the_dense_matrix() -> None:
    rng = np.random.default_rng(1)
    row, weight = 50 + rng.standard_normal(40), rng.uniform(0.5, 2.0, 40)
    weight[10:15] = 0.0
    difference = np.diff(np.eye(40), ORDER, axis=0)
    matrix = np.diag(weight) + 30.0 * difference.T @ difference
    course = steady_course(row, weight, stiffness=30.0)
    np.testing.assert_allclose(course.row, np.linalg.solve(matrix, weight * row), rtol=1e-9)
    free = np.count_nonzero(weight) - ORDER
    misfit = np.sum(weight * (row - course.row) ** 2) + 30.0 * np.sum(np.diff(course.row, ORDER) ** 2)
    np.testing.assert_allclose(course.variance, np.diag(np.linalg.inv(matrix)) * max(1, misfit / free), rtol=1e-8)


def test_a_parabola_is_kept() -> None:
    x = np.arange(200.0)
    parabola = 300 + 0.2 * x - 0.003 * x**2
    np.testing.assert_allclose(steady_course(parabola, np.ones(200)).row, parabola, atol=1e-4)


@pytest.mark.parametrize("period", [25.0, 200.0])
def test_smoothness_is_learned_and_errors_are_true(period: float) -> None:
    x = np.arange(2000.0)
    true = 3 * np.sin(2 * np.pi * x / period)
    sigma = np.where(x < 1000, 0.3, 0.9)
    row = true + sigma * np.random.default_rng(2).standard_normal(2000)
    course = steady_course(row, sigma**-2)
    error = course.row - true
    # a slow tone is smoother than what third differences of one size look like, and is known better than it says
    assert 0.7 < np.sqrt(np.mean(error**2 / course.variance)) < 1.25
    assert np.sqrt(np.mean(error**2)) < 0.75 * np.sqrt(np.mean(sigma**2))


def test_places_that_scatter_more_than_they_say_do_not_make_it_wriggle() -> None:
    x = np.arange(1000.0)
    row = 3 * np.sin(2 * np.pi * x / 200) + np.random.default_rng(3).standard_normal(1000)
    honest, boastful = steady_course(row, np.ones(1000)), steady_course(row, np.full(1000, 16.0))
    assert np.sqrt(np.mean((honest.row - boastful.row) ** 2)) < 0.1
    np.testing.assert_allclose(boastful.variance, honest.variance, rtol=0.5)


def test_a_gap_is_bridged_with_a_larger_error() -> None:
    x = np.arange(400.0)
    true = 3 * np.sin(2 * np.pi * x / 150)
    row, weight = true + 0.1 * np.random.default_rng(4).standard_normal(400), np.full(400, 100.0)
    weight[190:220] = 0.0
    row[190:220] = np.nan
    course = steady_course(row, weight)
    assert course.variance[205] > 4 * course.variance[100]
    assert (np.abs(course.row - true)[190:220] < 4 * np.sqrt(course.variance[190:220])).all()


def test_a_stiff_course_is_softened_where_a_wide_gap_leaves_nothing_to_solve() -> None:
    rng = np.random.default_rng(11)
    row, weight = 0.02 * np.arange(2000.0) + 0.5 * rng.standard_normal(2000), np.zeros(2000)
    weight[:760] = 0.25
    found = steady_course(row, weight, stiffness=1e9)
    assert np.isfinite(found.row).all()
    assert np.isfinite(found.variance).all()
    assert found.stiffness < 1e9
    assert np.abs(found.row - 0.02 * np.arange(2000.0))[:760].max() < 0.3
    assert found.variance[1900] > 100 * found.variance[400]
    weight[10] = -1.0
    with pytest.raises(ArgumentError, match="no course"):
        steady_course(row, weight, stiffness=1.0)


@pytest.mark.parametrize(("blur", "stiffness"), [(0.0, 3.0), (0.0, 1e4), (1.0, 30.0), (2.0, 1e3)])
def test_what_a_course_leaves_of_errors_is_what_is_left(blur: float, stiffness: float) -> None:
    errors = np.random.default_rng(4).standard_normal(30_000)
    alike = np.zeros(12)
    alike[0] = 1.0
    if blur:
        errors = gaussian_filter1d(errors, blur)
        errors /= errors.std()
        alike = np.exp(-(np.arange(12.0) ** 2) / (4 * blur**2))
    left = errors - steady_course(errors, np.ones(errors.size), stiffness=stiffness).row
    assert left_by_course(alike, 1.0, stiffness) == pytest.approx(np.mean(left**2), rel=0.05)
