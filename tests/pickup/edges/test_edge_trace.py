"""Edges as walls: places in metres, signs, slopes, and what the tonearm makes of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER
from gramoscope.pickup.edges.edge_trace import wall_trace
from gramoscope.quality import Quality, no_flags
from gramoscope.signal_path import GrooveEdges, StillPicture
from gramoscope.tonearm.directions import observe

PITCH_M = 2e-6
X = np.arange(300.0)
PICTURE = StillPicture(
    number=4,
    image=np.zeros((100, 300), np.uint8),
    arc_start_m=0.01,
    lateral_start_m=0.002,
    pixel_pitch_m=PITCH_M,
    white_level=255,
    seen=np.ones((100, 300), np.bool_),
    problems=("a scratch",),
)


def _edges(lateral_px: np.ndarray, narrower_px: np.ndarray) -> GrooveEdges:  # type: ignore[type-arg]
    row = np.array([60 + lateral_px - narrower_px, 30 + lateral_px + narrower_px])
    nothing = np.full(300, np.nan)
    return GrooveEdges(0, row, np.full((2, 300), 0.1), 4.0, no_flags(2, 300), nothing, nothing)


def test_places_are_rows_on_the_record() -> None:
    trace = wall_trace(_edges(np.sin(X / 20), np.zeros(300)), PICTURE)
    assert (trace.number, trace.arc_start_m, trace.arc_step_m) == (4, 0.01, PITCH_M)
    assert trace.problems == ("a scratch",)
    np.testing.assert_allclose(trace.offset_m[INNER], 0.002 + (60 + np.sin(X / 20)) * PITCH_M)
    np.testing.assert_allclose(trace.offset_sigma_m, 0.1 * PITCH_M)
    assert trace.correlation_samples == 4.0


def test_slopes_are_those_of_the_places() -> None:
    trace = wall_trace(_edges(3 * np.sin(X / 40), np.zeros(300)), PICTURE)
    inside = slice(3, -3)
    np.testing.assert_allclose(trace.slope[:, inside], np.tile(3 / 40 * np.cos(X / 40), (2, 1))[:, inside], atol=1e-3)
    np.testing.assert_allclose(trace.slope_sigma[:, inside], 0.1 * np.sqrt(2) / 4)
    assert np.isfinite(trace.slope).all()


def test_a_groove_that_moves_inwards_moves_towards_plus_l_and_a_narrower_one_is_higher() -> None:
    trace = wall_trace(_edges(0.05 * X, 0.02 * X), PICTURE)
    lateral = observe(trace, "lateral", wall_angle_rad=np.pi / 4)
    vertical = observe(trace, "vertical", wall_angle_rad=np.pi / 4)
    np.testing.assert_allclose(lateral.slope, 0.05)
    np.testing.assert_allclose(vertical.slope, 0.02)


def test_flags_and_gaps_are_handed_on() -> None:
    edges = _edges(np.zeros(300), np.zeros(300))
    row, flags = edges.row_px.copy(), edges.flags.copy()
    row[OUTER] = np.nan
    flags[OUTER] = Quality.NO_STRIPE | Quality.INTERPOLATED
    trace = wall_trace(replace(edges, row_px=row, flags=flags), PICTURE)
    np.testing.assert_array_equal(trace.flags, flags)
    assert trace.flags is not flags
    assert np.isnan(trace.offset_m[OUTER]).all()
    assert np.isfinite(trace.offset_m[INNER]).all()
    assert observe(trace, "lateral", wall_angle_rad=0.7).slope[50] == pytest.approx(0.0)
