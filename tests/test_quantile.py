"""Quantiles inside kernels are those of NumPy."""

import numpy as np
import pytest

from gramoscope.quantile import quantile


@pytest.mark.parametrize("share", [0.0, 0.1, 0.25, 0.5, 0.83, 1.0])
@pytest.mark.parametrize("size", [1, 2, 3, 10, 57, 512])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_they_are_those_of_numpy(share: float, size: int, dtype: type) -> None:
    rng = np.random.default_rng(size)
    for values in (rng.normal(size=size), np.sort(rng.normal(size=size)), rng.integers(0, 3, size), np.full(size, 2.5)):
        given = values.astype(dtype)
        before = given.copy()
        assert quantile(given, share) == pytest.approx(np.quantile(given.astype(float), share), rel=1e-6, abs=1e-12)
        np.testing.assert_array_equal(given, before)


def test_nothing_has_no_median() -> None:
    assert np.isnan(quantile(np.empty(0), 0.5))


def test_infinities_are_numbers() -> None:
    assert quantile(np.array([np.inf, 1.0, -np.inf]), 0.5) == 1.0
