"""The page of timings: what its columns mean, and ceilings that a machine can have."""

from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks.speed.ceilings import Ceilings, measured_ceilings, seconds
from benchmarks.speed.reading import page
from gramoscope.simulation.scene import filming_bench


def test_a_row_tells_time_share_and_how_far_from_real_time_it_is() -> None:
    bench = filming_bench(height_px=512)
    sounding_s = bench.sequence.group_step_m / float(bench.rotation.speed_at_m_s(0.0))
    capture: Any = SimpleNamespace(bench=bench)
    rows = [("laying", 4e-3, 8e6), ("search", 2 * sounding_s, 0.0)]
    lines = page(rows, capture, 8_000_000, Ceilings(20e9, 50e9), "cpu").splitlines()
    assert "| laying | 4.00 | 0.50 | 10.0 % |" in lines[-2]
    assert lines[-1].endswith("| – | 0.500 |")
    assert "20.0 GB/s" in "".join(lines)
    assert "read on cpu" in "".join(lines)


def test_ceilings_are_those_of_a_machine() -> None:
    found = measured_ceilings()
    assert 1e9 < found.triad_bytes_s < 1e12
    # a processor that adds its products does more of them than memory can feed it numbers
    assert found.fma_s > found.triad_bytes_s / 12


def test_the_median_of_several_times_is_taken_and_the_first_left_out() -> None:
    spent = iter([9.0, 1.0, 5.0, 2.0, 3.0, 4.0, 6.0, 7.0])
    clock = [0.0]

    def work() -> None:
        clock[0] += next(spent)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("time.perf_counter", lambda: clock[0])
        assert seconds(work) == 4.0
