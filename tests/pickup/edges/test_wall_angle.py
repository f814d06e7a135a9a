"""The angle of the walls by test tones: the right one, with a true error, and none where tones do not tell it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER, rad
from gramoscope.pickup.edges.wall_angle import WallAngleFinding, wall_angle
from gramoscope.quality import Quality
from gramoscope.signal_path import GrooveEdges

COLUMNS, NOISE_PX = 600, 0.6


def groove(
    inner: np.ndarray,  # type: ignore[type-arg]
    outer: np.ndarray,  # type: ignore[type-arg]
    *,
    angle_deg: float,
    rng: np.random.Generator,
    number: int = 0,
    noise_px: float = NOISE_PX,
) -> GrooveEdges:
    """Edges of a groove whose walls were moved along their normals, by so many pixels, where walls of 45° are moved so."""
    lateral, rise = (outer + inner) / np.sqrt(2), (outer - inner) / np.sqrt(2)
    cot = 1 / np.tan(rad(angle_deg))
    columns = inner.size
    spiral = 0.01 * np.arange(columns) + 1e-5 * np.arange(columns) ** 2
    rows = np.empty((2, columns))
    rows[INNER], rows[OUTER] = 40 + spiral + lateral - rise * cot, 80 + spiral + lateral + rise * cot
    rows += noise_px * rng.standard_normal(rows.shape)
    nothing = np.full(columns, np.nan)
    flags = np.zeros(rows.shape, np.uint16)
    return GrooveEdges(number, rows, np.full(rows.shape, NOISE_PX), 1.0, flags, nothing, nothing)


def of_tones(
    *,
    angle_deg: float,
    seed: int = 0,
    grooves: int = 6,
    periods_px: tuple[float, float] = (40.5, 154.5),
    swing_px: tuple[float, float] = (2.5, 8.0),
    columns: int = COLUMNS,
) -> list[GrooveEdges]:
    """Grooves with a tone on the inner wall and one on the outer wall."""
    rng, column = np.random.default_rng(seed), np.arange(columns)
    found = []
    for number in range(grooves):
        inner, outer = (
            swing * np.sin(2 * np.pi * (column / period + rng.random()))
            for swing, period in zip(swing_px, periods_px, strict=True)
        )
        found.append(groove(inner, outer, angle_deg=angle_deg, rng=rng, number=number))
    return found


def nothing_told(found: WallAngleFinding, why: str) -> bool:
    """Whether nothing was told, and why."""
    return np.isnan(found.angle_rad) and found.reason is not None and why in found.reason


@pytest.mark.parametrize("angle_deg", [38.0, 45.0, 50.0, 57.0])
def test_the_angle_comes_back(angle_deg: float) -> None:
    found = wall_angle(of_tones(angle_deg=angle_deg))
    assert found.reason is None
    assert abs(found.angle_rad - rad(angle_deg)) < 4 * found.sigma_rad
    assert found.sigma_rad < rad(0.5)
    assert found.period_px == pytest.approx((40.5, 154.5), rel=5e-3)
    # ρ = (1 − cot φ) / (1 + cot φ), of both tones
    cot = 1 / np.tan(rad(angle_deg))
    assert found.crosstalk == pytest.approx(((1 - cot) / (1 + cot),) * 2, abs=0.03)


@pytest.mark.parametrize("grooves", [3, 6, 12])
def test_the_error_is_true(grooves: int) -> None:
    pictures = [of_tones(angle_deg=50.0, seed=seed, grooves=grooves, swing_px=(2.5, 2.5)) for seed in range(150)]
    found = [wall_angle(one) for one in pictures]
    off = np.array([(one.angle_rad - rad(50.0)) / one.sigma_rad for one in found])
    # of 150 independent ones 102 ± 6
    assert np.mean(np.abs(off) < 1) == pytest.approx(0.683, abs=3 * 0.038)
    assert abs(np.median(off)) < 0.35


def test_a_mirrored_picture_tells_the_same() -> None:
    grooves = of_tones(angle_deg=51.0)
    mirrored = [
        replace(one, row_px=200 - one.row_px[::-1], row_sigma_px=one.row_sigma_px[::-1], flags=one.flags[::-1])
        for one in grooves
    ]
    there, back = wall_angle(grooves), wall_angle(mirrored)
    assert back.angle_rad == pytest.approx(there.angle_rad, abs=1e-6)
    assert back.period_px == pytest.approx(there.period_px[::-1], rel=1e-6)


def test_columns_that_were_not_measured_do_not_count() -> None:
    grooves, rng = of_tones(angle_deg=50.0), np.random.default_rng(3)
    dirty = []
    for one in grooves:
        lost = rng.random(one.row_px.shape) < 0.25
        flags = np.where(lost, np.uint16(Quality.INTERPOLATED), np.uint16(0)).astype(np.uint16)
        dirty.append(replace(one, row_px=np.where(lost, np.nan, one.row_px), flags=flags))
    found = wall_angle(dirty)
    assert found.reason is None
    assert abs(found.angle_rad - rad(50.0)) < 4 * found.sigma_rad


def test_long_stretches_are_heard_in_their_middle() -> None:
    found = wall_angle(of_tones(angle_deg=48.0, grooves=3, columns=9000))
    assert abs(found.angle_rad - rad(48.0)) < 4 * found.sigma_rad


def test_an_edge_that_was_hardly_seen_says_nothing() -> None:
    grooves = of_tones(angle_deg=50.0, grooves=4)
    lost = np.full(grooves[0].row_px.shape, np.uint16(Quality.INTERPOLATED))
    blind: Sequence[GrooveEdges] = [replace(one, row_px=one.row_px * np.nan, flags=lost) for one in grooves[:2]]
    assert nothing_told(wall_angle([*blind, *grooves[2:]]), "2 stretches")
    assert nothing_told(wall_angle([]), "0 stretches")


def test_one_tone_on_both_walls_tells_nothing() -> None:
    assert nothing_told(wall_angle(of_tones(angle_deg=50.0, periods_px=(150.0, 152.0), swing_px=(8, 8))), "same tone")


def test_silence_tells_nothing() -> None:
    assert nothing_told(wall_angle(of_tones(angle_deg=50.0, swing_px=(0, 0))), "stands out on the inner wall")


def test_a_tone_on_one_wall_alone_tells_nothing() -> None:
    # what is seen of it on the other wall is the tone itself
    assert nothing_told(wall_angle(of_tones(angle_deg=55.0, swing_px=(0, 8))), "same tone")
    assert nothing_told(wall_angle(of_tones(angle_deg=45.0, swing_px=(0, 8))), "stands out on the inner wall")


def test_edges_without_any_noise_tell_it_too() -> None:
    time = np.arange(COLUMNS)
    rng = np.random.default_rng(4)
    grooves = []
    for number in range(3):
        phases = rng.random(2)
        inner, outer = (
            np.sin(2 * np.pi * (time / period + phase)) for period, phase in zip((30, 75), phases, strict=True)
        )
        grooves.append(groove(3 * inner, 8 * outer, angle_deg=49.0, rng=rng, number=number, noise_px=0.0))
    assert np.rad2deg(wall_angle(grooves).angle_rad) == pytest.approx(49.0, abs=0.05)


def test_music_tells_nothing() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(COLUMNS)
    grooves = []
    for number in range(6):
        walls = []
        for _ in range(2):
            notes = rng.uniform(15, 200, 5)
            walls.append(sum(2 * np.sin(2 * np.pi * (time / note + rng.random())) for note in notes))
        grooves.append(groove(*walls, angle_deg=50.0, rng=rng, number=number))
    assert nothing_told(wall_angle(grooves), "more than a tone")


def test_leaks_that_no_angle_makes_tell_nothing() -> None:
    rng, time = np.random.default_rng(7), np.arange(COLUMNS)

    def leaking(inner_leak: complex, outer_leak: complex) -> WallAngleFinding:
        """Tones of which the other wall has a share, complex."""
        grooves = []
        for number in range(6):
            inner, outer = (np.exp(2j * np.pi * (time / period + rng.random())) for period in (40.5, 154.5))
            both = (3 * inner + 8 * outer_leak * outer).real, (8 * outer + 3 * inner_leak * inner).real
            grooves.append(groove(*both, angle_deg=45.0, rng=rng, number=number))
        return wall_angle(grooves)

    assert leaking(0.1, 0.1).reason is None
    assert nothing_told(leaking(0.3j, 0.3j), "out of step")
    assert nothing_told(leaking(0.2, 0.0), "do not leak equally")
    assert nothing_told(leaking(0.2, -0.2), "do not leak equally")
    assert nothing_told(leaking(0.4, 0.4), "30 to 60°")
