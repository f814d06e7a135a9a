"""Two walls told apart: what was cut into each comes out of its own channel."""

from __future__ import annotations

import numpy as np
import pytest

from gramoscope.conventions import motion_of_stereo
from gramoscope.errors import ArgumentError
from gramoscope.preamp.walls import WallSplitter, in_direction
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio, GrooveSound

COUNT = 57
RNG = np.random.default_rng(2)
LEFT, RIGHT = RNG.normal(0, 0.03, (2, COUNT))
FLAGS = np.where(np.arange(COUNT) % 11 == 3, np.uint16(Quality.EDGE), np.uint16(0)).astype(np.uint16)
UNSEEN = np.full(COUNT, np.uint16(Quality.INTERPOLATED), np.uint16)


def audio(samples: np.ndarray, sigma: np.ndarray | float, flags: np.ndarray) -> Audio:
    return Audio(12, 96_000.0, samples, np.broadcast_to(sigma, COUNT).astype(np.float64), flags, ("resampled",))


def both() -> GrooveSound:
    lateral, vertical = motion_of_stereo(LEFT, RIGHT)
    return GrooveSound(audio(lateral, 3e-4, FLAGS), audio(vertical, 4e-4, np.roll(FLAGS, 1)))


def test_the_outer_wall_carries_the_right_channel_the_inner_one_the_left() -> None:
    outer, inner = WallSplitter("lateral").split(both())
    np.testing.assert_allclose(outer.samples, RIGHT, atol=1e-15)
    np.testing.assert_allclose(inner.samples, LEFT, atol=1e-15)
    np.testing.assert_array_equal(outer.flags, FLAGS | np.roll(FLAGS, 1))
    np.testing.assert_allclose(outer.sigma, 5e-4 / np.sqrt(2))
    assert (outer.start_sample, outer.rate_hz, outer.history[0]) == (12, 96_000.0, "resampled")
    assert "outer" in outer.history[-1]


def test_walls_read_equally_well_have_the_error_that_they_had() -> None:
    """Errors of walls, drawn; turned into errors of directions, and back."""
    errors = np.random.default_rng(5).normal(0, 2e-4, (2, 100_000))
    lateral, vertical = motion_of_stereo(*errors)
    sound = GrooveSound(audio(both().lateral.samples, lateral.std(), FLAGS), audio(LEFT, vertical.std(), FLAGS))
    for wall in WallSplitter("lateral").split(sound):
        np.testing.assert_allclose(wall.sigma, 2e-4, rtol=0.01)


@pytest.mark.parametrize(("direction", "sign"), [("lateral", 1), ("vertical", -1)])
@pytest.mark.parametrize("read", ["outer", "inner"])
def test_one_wall_alone_gives_itself_back_and_the_other_is_silent_and_flagged(
    direction: str, sign: int, read: str
) -> None:
    """What the tonearm made of the wall under the assumption that the groove moves in one direction only."""
    wall = RIGHT if read == "outer" else LEFT
    heard = audio(np.sqrt(2) * wall * (sign if read == "inner" else 1), 1e-4, FLAGS)
    other = audio(np.zeros(COUNT), np.nan, UNSEEN | FLAGS)
    sound = GrooveSound(heard, other) if direction == "lateral" else GrooveSound(other, heard)
    walls = dict(zip(("outer", "inner"), WallSplitter(direction, (read,)).split(sound), strict=True))
    np.testing.assert_allclose(walls[read].samples, wall, atol=1e-15)
    np.testing.assert_array_equal(walls[read].flags, FLAGS)
    np.testing.assert_allclose(walls[read].sigma, 1e-4 / np.sqrt(2))
    silent = walls["inner" if read == "outer" else "outer"]
    assert not silent.samples.any()
    assert np.isnan(silent.sigma).all()
    np.testing.assert_array_equal(silent.flags, UNSEEN)


def test_where_the_other_direction_is_unknown_both_walls_move_as_the_cut_does_and_say_so() -> None:
    sound = GrooveSound(audio(LEFT, 1e-4, FLAGS), audio(np.zeros(COUNT), np.nan, UNSEEN))
    for wall in WallSplitter("lateral").split(sound):
        np.testing.assert_allclose(wall.samples, LEFT / np.sqrt(2))
        assert np.all(wall.flags & Quality.INTERPOLATED)
        assert np.isnan(wall.sigma).all()


def test_the_cut_chooses_the_direction() -> None:
    sound = both()
    assert in_direction(sound, "lateral") is sound.lateral
    assert in_direction(sound, "vertical") is sound.vertical


@pytest.mark.parametrize("walls", [(), ("upper",)])
def test_walls_that_are_none_are_refused(walls: tuple[str, ...]) -> None:
    with pytest.raises(ArgumentError, match="walls"):
        WallSplitter("lateral", walls)
