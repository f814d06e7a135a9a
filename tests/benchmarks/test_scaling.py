"""The calculation of many workers keeps to what is known of queues."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.speed.scaling import throughput


def test_one_worker_waits_for_nobody() -> None:
    assert throughput(0.04, [0.01, 0.002], 1) == pytest.approx(1 / 0.052)


def test_many_workers_get_what_the_slowest_place_gives_and_never_more() -> None:
    rates = np.array([throughput(0.04, [0.01, 0.002], n) for n in range(1, 200)])
    assert (np.diff(rates) > -1e-9).all()
    assert (rates <= np.minimum(np.arange(1, 200) / 0.052, 100.0) + 1e-9).all()
    assert rates[-1] == pytest.approx(100.0, rel=1e-3)


def test_two_workers_at_one_place_share_it_as_erlang_says() -> None:
    # two machines and one repairman: X = (1 − P0)/D with 1/P0 = 1 + 2a + 2a², a = D/Z
    own, shared = 0.03, 0.012
    a = shared / own
    assert throughput(own, [shared], 2) == pytest.approx((1 - 1 / (1 + 2 * a + 2 * a * a)) / shared)
