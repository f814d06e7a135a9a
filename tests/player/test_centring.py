"""Off-centre holes in a transfer: surveyed when asked, removed when sure, told in any case."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from gramoscope.player.centring import SURVEYED_GROUPS, Centring, spread_out, surveyed
from gramoscope.signal_path import WallTrace
from gramoscope.turntable.hole_gauge import HoleGauge
from gramoscope.turntable.off_centre import OffCentreHole
from gramoscope.turntable.rotation import Rotation

SPIRAL = Rotation(78.26, 0.0931, 254e-6)
STEP_M = 0.5e-3


def _trace(number: int, hole: OffCentreHole) -> WallTrace:
    noise = 10e-6 * np.random.default_rng(number).standard_normal()
    place = SPIRAL.radius_m - float(hole.distance_m(number * STEP_M)) + noise
    offset = np.full((2, 5), place) + np.array([[60e-6], [-60e-6]])
    nothing = np.full((2, 5), np.nan)
    return WallTrace(number, number * STEP_M, 1e-6, offset, nothing, nothing, nothing, 1.0, np.zeros((2, 5), np.uint16))


def _surveyed(hole: OffCentreHole, *, groups: int = 4000, asked: bool = True) -> tuple[Centring, list[int]]:
    read: list[int] = []

    def reading(number: int) -> WallTrace:
        read.append(number)
        return _trace(number, hole)

    bench = SimpleNamespace(rotation=SPIRAL, passage_length_m=groups * STEP_M)
    capture: Any = SimpleNamespace(bench=bench, group_count=groups, group=lambda number: number)
    pickup: Any = SimpleNamespace(read=reading)
    return surveyed(capture, pickup, 1, asked=asked), read


def _found(centring: Centring, hole: OffCentreHole, groups: int = 4000, *, angles: bool = True) -> Any:
    gauge, before = HoleGauge(SPIRAL), 0.0
    for trace in (_trace(number, hole) for number in range(groups)):
        (put,) = centring.centred([trace])
        true = float(hole.true_arc_m(trace.arc_start_m)) if angles else trace.arc_start_m
        error, before = true - put.arc_start_m - before, true - put.arc_start_m
        gauge.see(put, error)
    return gauge.finding()


def test_a_survey_finds_the_hole_in_a_bounded_number_of_stretches() -> None:
    hole = OffCentreHole(SPIRAL, 0.4e-3, 1.1)
    centring, read = _surveyed(hole)
    assert centring.hole is not None
    assert centring.survey is not None
    assert len(read) == SURVEYED_GROUPS
    assert abs(centring.hole.eccentricity_m - 0.4e-3) < 4 * centring.survey.eccentricity_sigma_m
    (put,) = centring.centred([_trace(777, hole)])
    assert abs(put.arc_start_m - float(hole.true_arc_m(777 * STEP_M))) < 10e-6
    assert abs(put.arc_start_m - 777 * STEP_M) > 100e-6


def test_what_was_removed_is_told_with_its_error_and_the_steps_agree() -> None:
    hole = OffCentreHole(SPIRAL, 0.4e-3, 1.1)
    centring, _ = _surveyed(hole)
    found = _found(centring, hole)
    (remark,) = centring.remarks(found)
    assert "was removed" in remark
    assert "±" in remark
    said = centring.as_dict(found)
    assert said["removal"]["applied"]
    assert said["removal"]["survey"]["groups"] == SURVEYED_GROUPS
    assert said["percent"] == pytest.approx(0.43, abs=0.01)
    assert abs(said["in_the_steps"]["percent"]) < 0.02, "nothing is left"


def test_a_removal_that_put_wow_in_is_told() -> None:
    """A capture whose places are true arcs has nothing to remove; the overlaps know."""
    hole = OffCentreHole(SPIRAL, 0.4e-3, 1.1)
    centring, _ = _surveyed(hole)
    remarks = list(centring.remarks(_found(centring, hole, angles=False)))
    assert len(remarks) == 2
    assert "play again without --remove-wow" in remarks[1]


def test_without_being_asked_it_is_told_and_nothing_is_done() -> None:
    hole = OffCentreHole(SPIRAL, 0.4e-3, 1.1)
    centring, read = _surveyed(hole, asked=False)
    assert read == []
    assert centring.hole is None
    trace = _trace(5, hole)
    assert next(centring.centred([trace])) is trace
    (remark,) = centring.remarks(_found(centring, hole))
    assert "--remove-wow removes it" in remark


def test_a_centred_record_and_a_short_passage_are_left_alone_and_say_why() -> None:
    centred = OffCentreHole(SPIRAL, 0.0)
    centring, _ = _surveyed(centred)
    assert centring.hole is None
    assert "no wow was removed: the hole is centred" in next(centring.remarks(_found(centring, centred)))
    short, read = _surveyed(OffCentreHole(SPIRAL, 0.4e-3), groups=300)
    assert read == []
    (remark,) = short.remarks(_found(short, centred, groups=300))
    assert "of a turn" in remark


def test_a_survey_is_spread_over_the_passage_without_a_beat() -> None:
    assert spread_out(7) == list(range(7))
    numbers = np.array(spread_out(60_000))
    assert len(set(numbers.tolist())) == SURVEYED_GROUPS
    assert numbers[0] < 200
    assert numbers[-1] > 59_700
    assert numbers[-1] < 60_000
    turn = 60_000 / SURVEYED_GROUPS
    assert abs(np.mean(np.exp(2j * np.pi * numbers / turn))) < 0.1, "even steps would all meet one place of the turn"


def test_a_film_of_a_few_stretches_says_why_it_knows_nothing(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path
) -> None:
    wow = transfer.report["wow"]
    assert not wow["determined"]
    assert "of a turn" in wow["reason"]
    assert wow["removal"] == {"asked": False, "applied": False, "survey": None}
    for hint in transfer.report["hints"].values():
        assert "too short" in hint["reason"]


def test_a_removal_puts_the_stretches_of_a_transfer_where_the_groove_has_them(
    capture: Path, transfer: Any, played: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int] = []

    class _Noting(Centring):
        def centred(self, traces: Any) -> Any:
            for trace in super().centred(traces):
                asked.append(trace.number)
                yield trace

    monkeypatch.setattr("gramoscope.player.film.surveyed", lambda *_, asked: _Noting(asked))
    same = played(capture, tmp_path / "out")
    assert asked == list(range(8)), "every stretch passes by, once and in order"
    assert same.bits("flat.wav") == transfer.bits("flat.wav")
