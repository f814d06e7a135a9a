"""Agreement with independent programs: SciPy's robust slopes and sparse solvers, and phase correlation by FFT."""

import numpy as np
import pytest
from scipy import sparse, stats
from scipy.sparse.linalg import spsolve

from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.horn_schunck import solve_horn_schunck
from gramoscope.pickup.registration import pair_shift_px
from gramoscope.pickup.wall import START_POINTS, _repeated_median


@pytest.mark.parametrize("count", [4, 11, START_POINTS])
def test_the_repeated_median_is_siegels(count: int) -> None:
    rng = np.random.default_rng(count)
    x = np.sort(rng.uniform(-50, 50, count))
    y = 0.3 * x + rng.standard_t(2, count)
    y[: count // 3] += 40
    assert _repeated_median(x, y, count) == pytest.approx(stats.siegelslopes(y, x).slope, rel=1e-12)


def _average(height: int, width: int) -> sparse.csr_array:
    """Horn and Schunck's mean over the neighbours, the border repeated, as a matrix."""
    number = np.pad(np.arange(height * width).reshape(height, width), 1, mode="edge")
    weights = {(-1, -1): 1, (-1, 0): 2, (-1, 1): 1, (0, -1): 2, (0, 1): 2, (1, -1): 1, (1, 0): 2, (1, 1): 1}
    rows = np.tile(np.arange(height * width), 8)
    columns = [number[1 + i : height + 1 + i, 1 + j : width + 1 + j].ravel() for i, j in weights]
    values = np.repeat([w / 12 for w in weights.values()], height * width)
    return sparse.csr_array((values, (rows, np.concatenate(columns))))


def test_the_sweeps_end_at_the_solution_of_horn_and_schuncks_equations() -> None:
    rng, height, width, alpha = np.random.default_rng(1), 11, 17, 0.6
    x, y, t = (rng.normal(size=(height, width)) for _ in range(3))
    smooth = alpha**2 * (sparse.identity(height * width) - _average(height, width))
    xx, xy, yy = (sparse.diags((a * b).ravel()) for a, b in ((x, x), (x, y), (y, y)))
    system = sparse.block_array([[xx + smooth, xy], [xy, yy + smooth]], format="csc")
    solution = spsolve(system, -np.concatenate([(x * t).ravel(), (y * t).ravel()])).reshape(2, height, width)
    d = Derivatives(*(a.astype(np.float32) for a in (x, y, t)))
    flow = solve_horn_schunck(d, alpha=alpha, iterations=4000)
    np.testing.assert_allclose(flow.u, solution[0], atol=2e-4)
    np.testing.assert_allclose(flow.v, solution[1], atol=2e-4)


@pytest.mark.parametrize("shift_px", [1.7, 3.25])
def test_the_shift_between_frames_is_that_of_phase_correlation(shift_px: float) -> None:
    rng, width = np.random.default_rng(2), 256
    frequency = np.fft.rfftfreq(width)
    spectrum = np.fft.rfft(rng.normal(size=(41, width)), axis=1) * np.exp(-((frequency / 0.16) ** 2))
    images = [
        np.rint(2000 + 900 * np.fft.irfft(spectrum * np.exp(2j * np.pi * frequency * d), width, axis=1))
        for d in (0.0, shift_px)
    ]
    here, there = (np.fft.rfft(image, axis=1) for image in images)
    low = slice(1, 40)
    phase = np.angle((there * here.conj()).sum(axis=0))[low]
    weight = np.abs((there * here.conj()).sum(axis=0))[low]
    angle = 2 * np.pi * frequency[low]
    by_phase = (weight * angle * np.unwrap(phase)).sum() / (weight * angle**2).sum()
    found = pair_shift_px(
        *(image.astype(np.uint16) for image in images), expected_px=shift_px - 0.6, rows=np.arange(41)
    )
    assert by_phase == pytest.approx(shift_px, abs=1e-3)
    assert found == pytest.approx(by_phase, abs=2e-3)
