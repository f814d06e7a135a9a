"""The tone curve in closed form."""

import numpy as np
import pytest

from gramoscope.errors import ArgumentError
from gramoscope.pickup.texture.tone import Tone, mean_level

GREY = np.linspace(0, 255, 511).astype(np.float32)


@pytest.mark.parametrize("compression", [0.0, 0.01, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("level", [0.01, 3.0, 120.0])
def test_about_the_mean_level_contrasts_stay_as_they_are(level: float, compression: float) -> None:
    tone = Tone(level, compression)
    step = 0.01 * level
    below, at, above = tone(np.array([level - step, level, level + step], np.float32)) - tone(np.float32([level]))
    assert abs(at) < 1e-4 * step
    assert (above - below) / (2 * step) == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize("compression", [0.2, 0.9])
def test_grey_is_seen_as_a_logarithm(compression: float) -> None:
    expected = 80 / compression * np.log(1 - compression + compression * GREY.astype(np.float64) / 80)
    np.testing.assert_allclose(Tone(80.0, compression)(GREY), expected, rtol=1e-5, atol=1e-4)


def test_equal_factors_become_nearly_equal_steps_when_all_is_compressed() -> None:
    seen = Tone(50.0, 0.9999)(np.float32([12.5, 25, 50, 100, 200]))
    np.testing.assert_allclose(np.diff(seen), 50 * np.log(2), rtol=1e-3)


def test_without_compression_a_picture_is_itself() -> None:
    assert Tone()(GREY) is GREY
    assert Tone(17.0, 0.0)(GREY) is GREY


@pytest.mark.parametrize("compression", [0.1, 0.5, 0.99])
def test_what_is_brighter_is_seen_brighter_and_the_less_so_the_brighter_it_is(compression: float) -> None:
    seen = Tone(90.0, compression)(GREY)
    assert seen.dtype == np.float32
    assert (np.diff(seen) > 0).all()
    assert (np.diff(seen, 2) < 1e-4).all()


def test_light_below_zero_is_none_and_the_picture_stays_as_it_was() -> None:
    grey = np.array([[-7.0, 0.0], [-0.1, 60.0]], np.float32)
    before = grey.copy()
    grey.flags.writeable = False
    seen = Tone(40.0, 0.9)(grey)
    assert seen[0, 0] == seen[1, 0] == seen[0, 1] == pytest.approx(40 / 0.9 * np.log(0.1), rel=1e-5)
    np.testing.assert_array_equal(grey, before)


@pytest.mark.parametrize(
    ("level", "compression", "said"),
    [(0.0, 0.5, "mean level of 0"), (-3.0, 0.0, "mean level"), (9.0, 1.0, "compression of 1"), (9.0, -0.1, "of -0.1")],
)
def test_impossible_tones_are_refused(level: float, compression: float, said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        Tone(level, compression)


def test_the_mean_level_is_that_of_the_usual_picture() -> None:
    pictures = [np.array([[0.5 * level, 1.5 * level]], np.float32) for level in (30.0, 33.0, 250.0)]
    assert mean_level(pictures) == 33.0
    assert Tone(mean_level([np.zeros((4, 4), np.float32)])).level == 0.01


def test_what_was_not_drawn_does_not_darken_the_mean() -> None:
    picture = np.full((30, 40), 80.0, np.float32)
    picture[:, 15:] = 0
    assert mean_level([picture] * 3) == pytest.approx(80.0)
