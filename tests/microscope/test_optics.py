"""Objective, cover glass and focus: closed forms, limits and impossible arguments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gramoscope.errors import ArgumentError
from gramoscope.microscope.cover_glass import CoverGlass, shift_exact_m, shift_paraxial_m
from gramoscope.microscope.focus import blur_radius_m, stripe_distance_from_middle_m, stripe_separation_m
from gramoscope.microscope.objective import Objective


@given(st.floats(2, 100), st.floats(0.1, 0.3))
def test_the_thin_lens_equation_holds(magnification, tube_m):
    lens = Objective(magnification=magnification, tube_length_m=tube_m)
    assert 1 / lens.focal_length_m == pytest.approx(1 / tube_m + 1 / lens.object_distance_m)
    assert tube_m / lens.object_distance_m == pytest.approx(magnification)


@pytest.mark.parametrize("angle_rad", [0.05, 0.35, 0.7])
def test_a_ray_traced_through_the_plate_crosses_the_axis_where_the_formula_says(angle_rad):
    """Two refractions by Snell's law: the ray leaves parallel, displaced by d (tan θ − tan θ′) across the axis."""
    d, n = 0.17e-3, 1.515
    inside = np.arcsin(np.sin(angle_rad) / n)
    plain, bent = d * np.tan(angle_rad), d * np.tan(inside)
    traced = (plain - bent) / np.tan(angle_rad)
    assert shift_exact_m(d, angle_rad, refractive_index=n) == pytest.approx(traced, rel=1e-12)


def test_the_exact_shift_tends_to_the_paraxial_one_and_grows_with_the_angle():
    angles = np.linspace(1e-4, 1.4, 50)
    exact = shift_exact_m(0.11e-3, angles, refractive_index=1.515)
    assert exact[0] == pytest.approx(shift_paraxial_m(0.11e-3, refractive_index=1.515), rel=1e-7)
    assert np.all(np.diff(exact) > 0)
    np.testing.assert_allclose(exact, shift_exact_m(0.11e-3, -angles, refractive_index=1.515))
    assert np.isnan(shift_exact_m(0.11e-3, np.nan, refractive_index=1.515))


def test_a_plate_of_air_shifts_nothing():
    assert shift_exact_m(0.11e-3, 0.4, refractive_index=1.0) == pytest.approx(0, abs=1e-18)


def test_a_calibrated_shift_wins_over_the_computed_one():
    assert CoverGlass(focus_shift_m=41.5e-6).shift_m == 41.5e-6
    assert CoverGlass(thickness_m=0.17e-3, refractive_index=1.52).shift_m == pytest.approx(0.17e-3 * (1 - 1 / 1.52))


def test_blur_grows_alike_on_both_sides_of_the_sharp_plane():
    lens = Objective(numerical_aperture=0.6)
    np.testing.assert_allclose(blur_radius_m([-8e-6, 0.0, 8e-6], objective=lens), [6e-6, 0, 6e-6])
    assert np.isnan(blur_radius_m(np.nan, objective=lens))


def test_a_steeper_wall_brings_its_stripes_together():
    assert stripe_separation_m(37e-6, wall_angle_rad=np.arctan(2)) == pytest.approx(18.5e-6)
    upper, lower = (
        stripe_distance_from_middle_m(depth, groove_width_m=151e-6, wall_angle_rad=np.arctan(2))
        for depth in (11e-6, 48e-6)
    )
    assert upper - lower == pytest.approx(18.5e-6)
    assert stripe_distance_from_middle_m(90e-6, groove_width_m=151e-6, wall_angle_rad=np.pi / 4) < 0


@pytest.mark.parametrize(
    ("part", "wrong", "names"),
    [
        (Objective, {"magnification": 0.0}, "magnification"),
        (Objective, {"numerical_aperture": 1.2}, "aperture"),
        (Objective, {"tube_length_m": -0.16}, "tube"),
        (CoverGlass, {"thickness_m": -1e-4}, "thick"),
        (CoverGlass, {"refractive_index": 1.0}, "index"),
        (CoverGlass, {"side": "left"}, "side"),
    ],
)
def test_impossible_optics_are_refused_in_words(part, wrong, names):
    with pytest.raises(ArgumentError, match=names):
        part(**wrong)
