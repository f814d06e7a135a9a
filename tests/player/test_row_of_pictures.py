"""Pictures of a spiral, with the edges that are truly there: which stretches are one passage, and is it continuous?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.apparatus.still_bench import Row, StillBench
from gramoscope.camera.sensor import Sensor
from gramoscope.player.row_of_pictures import RowOfPictures, Stretch
from gramoscope.quality import no_flags
from gramoscope.signal_path import GrooveEdges, StillPicture
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.still import StillScene, cut_still, edges_of_turn, still_picture
from gramoscope.tonearm.stitch import Stitch

TURNS, TURN_PX, SHARED_PX, TONE_HZ = 12, 900, 60, 31.7
SCENE = StillScene(turns=TURNS, turn_px=TURN_PX, overlap_px=120, level_m_s=0.004, dust_per_m=0.0, seed=4)


@pytest.fixture(scope="module")
def passage() -> Passage:
    """A tone that runs through all turns, not in step with them."""
    time_s = np.arange(round(8000 * SCENE.seconds)) / 8000
    return cut_still(np.sin(2 * np.pi * TONE_HZ * time_s + 0.4), rate_hz=8000.0, scene=SCENE)


def bench(pictures: int, step_px: float, turn_px: float | None) -> StillBench:
    sensor = Sensor(SCENE.columns, SCENE.rows, pixel_pitch_m=SCENE.pixel_pitch_m)
    return StillBench(sensor=sensor, rotation=SCENE.rotation, row=Row(pictures, step_px, turn_px))


def grooves_of(passage: Passage, start: int, stop: int) -> tuple[GrooveEdges, ...]:
    """The true edges of what some columns of the picture show, by growing row."""
    place = np.arange(start, stop)
    found = []
    for turn in range(TURNS + 1):
        outer, inner = edges_of_turn(SCENE, passage, turn, place % TURN_PX)
        # beyond the turn the picture shows the same grooves again: the next rows of each
        rows = np.stack([inner, outer])
        rows[:, (place >= TURN_PX)] = np.nan
        beyond = place >= TURN_PX
        if turn > 0 or not beyond.all():
            found.append(rows)
        if beyond.any():
            again = np.stack(edges_of_turn(SCENE, passage, turn + 1, place % TURN_PX)[::-1])
            found[-1][:, beyond] = again[:, beyond]
    flags = no_flags(2, place.size)
    sigma = np.full((2, place.size), 0.02)
    nothing = np.full(place.size, np.nan)
    return tuple(GrooveEdges(k, rows, sigma, 1.0, flags, nothing, nothing) for k, rows in enumerate(found))


def looked_through(
    passage: Passage,
    starts: list[int],
    width: int,
    *,
    nominal: Row,
    lost: int | None = None,
    missed: tuple[int, int] | None = None,
    raised: int = 0,
) -> tuple[RowOfPictures, dict[tuple[int, int], GrooveEdges]]:
    row = RowOfPictures(bench(nominal.pictures, nominal.step_px, nominal.turn_px), Stitch())
    edges = {}
    for number, start in enumerate(starts):
        stop = min(start + width, SCENE.columns)
        # each picture shows everything so many rows higher than the one before
        image = still_picture(SCENE, passage, start, stop)[number * raised :]
        picture = StillPicture(
            number=number,
            image=image,
            arc_start_m=number * nominal.step_px * SCENE.pixel_pitch_m,
            lateral_start_m=0.0,
            pixel_pitch_m=SCENE.pixel_pitch_m,
            white_level=255,
            seen=np.ones(image.shape, np.bool_),
        )
        if number == lost:
            black = replace(picture, image=np.zeros_like(image), seen=np.zeros(image.shape, np.bool_))
            row.add(row.looked(black, ()))
            continue
        found = tuple(replace(one, row_px=one.row_px - number * raised) for one in grooves_of(passage, start, stop))
        if missed is not None and missed[0] == number:
            kept = [one for one in found if one.number != missed[1]]
            found = tuple(replace(one, number=k) for k, one in enumerate(kept))
        edges |= {(number, one.number): one for one in found}
        row.add(row.looked(picture, found))
    return row, edges


def course(stretches: tuple[Stretch, ...], edges: dict[tuple[int, int], GrooveEdges]) -> tuple[np.ndarray, np.ndarray]:
    """Place along the passage and lateral place of the outer edge, of all stretches, in pixels."""
    arc, lateral = [], []
    for one in stretches:
        rows = edges[one.picture, one.groove].row_px[1]
        arc.append(one.arc_start_m / SCENE.pixel_pitch_m + np.arange(rows.size))
        lateral.append(rows + one.lateral_start_m / SCENE.pixel_pitch_m)
    return np.concatenate(arc), np.concatenate(lateral)


def truth(passage: Passage, arc_px: np.ndarray) -> np.ndarray:
    return edges_of_turn(SCENE, passage, 0, arc_px)[0]


def test_twelve_turns_are_one_passage_and_nothing_counts_twice(passage: Passage) -> None:
    row, edges = looked_through(passage, [0], SCENE.columns, nominal=Row(turn_px=TURN_PX))
    (stretches,) = row.passages()
    assert len(stretches) == TURNS + 1
    assert row.turn_px == pytest.approx(TURN_PX, abs=0.05)
    arc, lateral = course(stretches, edges)
    assert np.abs(lateral - truth(passage, arc)).max() < 0.15
    assert arc.max() == pytest.approx((TURNS + 1) * TURN_PX + SCENE.overlap_px - 1, abs=1)


def test_a_tone_through_all_turns_has_no_jump_of_phase(passage: Passage) -> None:
    row, edges = looked_through(passage, [0], SCENE.columns, nominal=Row(turn_px=TURN_PX))
    arc, lateral = course(row.passages()[0], edges)
    time_s = SCENE.rotation.time_of_arc_s(arc * SCENE.pixel_pitch_m)
    for turn in range(TURNS):
        seen = (time_s >= turn * 60 / SCENE.rpm) & (time_s < (turn + 1) * 60 / SCENE.rpm)
        found = _phase(time_s[seen], lateral[seen])
        true = _phase(time_s[seen], truth(passage, arc[seen]))
        assert np.angle(np.exp(1j * (found - true))) == pytest.approx(0.0, abs=2e-3)


def _phase(time_s: np.ndarray, lateral_px: np.ndarray) -> float:
    """Phase of the tone in a course that drifts inwards."""
    angle = 2 * np.pi * TONE_HZ * time_s
    model = np.column_stack([np.cos(angle), np.sin(angle), np.ones_like(time_s), time_s])
    cosine, sine = np.linalg.lstsq(model, lateral_px, rcond=None)[0][:2]
    return float(np.arctan2(-cosine, sine))


def test_a_row_of_pictures_and_turns_together(passage: Passage) -> None:
    """The steps are other than nominal by some pixels, and the pictures say so."""
    starts = [0, 347, 690]
    row, edges = looked_through(passage, starts, 400, nominal=Row(3, 340.0, TURN_PX))
    (stretches,) = row.passages()
    assert len(stretches) == 3 * (TURNS + 1)
    assert row.turn_px == pytest.approx(TURN_PX, abs=0.1)
    arc, lateral = course(stretches, edges)
    assert np.abs(lateral - truth(passage, arc)).max() < 0.2
    assert len(row.matches) == 2
    assert not row.problems


def test_without_turns_each_groove_is_a_passage_in_playing_order(passage: Passage) -> None:
    row, edges = looked_through(passage, [0, 250], 400, nominal=Row(2, 250.0))
    passages = row.passages()
    assert len(passages) == TURNS + 1
    for turn, stretches in enumerate(passages):
        assert [(one.picture, one.groove) for one in stretches] == [(0, turn), (1, turn)]
        arc, lateral = course(stretches, edges)
        assert np.abs(lateral - truth(passage, arc + turn * TURN_PX)).max() < 0.1


def test_a_lost_picture_leaves_a_gap_and_the_nominal_step(passage: Passage) -> None:
    row, edges = looked_through(passage, [0, 200, 400], 260, nominal=Row(3, 200.0), lost=1)
    passages = row.passages()
    assert len(passages) == TURNS + 1
    assert "nominal" in row.problems[0]
    for turn, stretches in enumerate(passages):
        assert [one.picture for one in stretches] == [0, 2]
        assert stretches[1].unmatched
        arc, lateral = course(stretches, edges)
        assert np.abs(lateral - truth(passage, arc + turn * TURN_PX)).max() < 1e-6


def test_pictures_of_other_places_are_not_matched(passage: Passage) -> None:
    row, _ = looked_through(passage, [0, 500], 300, nominal=Row(2, 200.0))
    assert np.isnan(row.matches[0].error_m)
    assert "could not be laid" in row.problems[0]


@pytest.mark.parametrize("missed", [(1, 4), (0, 5), (2, 3)])
def test_a_groove_that_one_picture_misses_is_found_again(passage: Passage, missed: tuple[int, int]) -> None:
    """In the middle of the row, where the turn begins, and where it ends: the passage goes on, with a gap."""
    row, edges = looked_through(passage, [0, 340, 680], 400, nominal=Row(3, 340.0, TURN_PX), missed=missed)
    (stretches,) = row.passages()
    assert len(stretches) == 3 * (TURNS + 1) - 1
    arc, lateral = course(stretches, edges)
    assert np.abs(lateral - truth(passage, arc)).max() < 0.2
    gaps = np.diff([one.arc_start_m / SCENE.pixel_pitch_m for one in stretches])
    assert np.count_nonzero(gaps > 500) == 1


def test_a_stage_that_drifts_across_is_followed(passage: Passage) -> None:
    """Over a whole turn too: each turn starts where the last one ended."""
    row, edges = looked_through(passage, [0, 340, 680], 400, nominal=Row(3, 340.0, TURN_PX), raised=3)
    (stretches,) = row.passages()
    assert len(stretches) == 3 * (TURNS + 1)
    arc, lateral = course(stretches, edges)
    assert row.turn_drift_m / SCENE.pixel_pitch_m == pytest.approx(0.0, abs=0.1)
    assert np.abs(lateral - truth(passage, arc)).max() < 0.3
