"""Sections 2 to 5 and the arithmetic of section 7: every number that the paper prints of its rig, computed again."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from experiments.seed_paper.page import FOLDER, PAPER, Claim, Page, percent
from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import FloatArray, deg, rad
from gramoscope.listening import ink
from gramoscope.microscope.cover_glass import CoverGlass, shift_exact_m
from gramoscope.microscope.focus import blur_radius_m, stripe_distance_from_middle_m, stripe_separation_m
from gramoscope.microscope.objective import Objective
from gramoscope.turntable.rotation import Rotation, pixel_rate_hz

LENS, LENS_4X = Objective(), Objective(magnification=4, numerical_aperture=0.10)
GLASS = CoverGlass()
TABLE = Rotation(rpm=78.0, radius_m=0.115)
WIDTH_M, WIDTH_PX, HEIGHT_PX = 0.5e-3, 1280, 1024
GROUPS, FRAMES = 6000, 12
GROOVE_DEPTH_M = 120e-6
NEIGHBOURHOOD_PX = 100
PARAXIAL_LIMIT_DEG = 22.5


@dataclass(frozen=True)
class Numbers:
    """The rig in numbers, SI units."""

    object_distance_m: float
    focal_length_m: float
    focal_length_4x_m: float
    depth_of_field_m: float
    depth_of_field_4x_m: float
    aperture_of_45_um: float
    shift_m: float
    shift_at_limit_m: float
    shift_at_rim_m: float
    shift_mean_m: float
    cosines_at_limit: float
    separation_px: float
    pixel_pitch_m: float
    groove_speed_m_s: float
    pixel_rate_hz: float
    seconds: float
    overlap_for_3_s: float
    data_bytes: float


def shift_over_aperture_m(objective: Objective, glass: CoverGlass) -> float:
    """Return the mean shift over all rays of the cone, each weighted by its light (sin θ cos θ dθ, a matt surface)."""
    theta = (np.arange(2000) + 0.5) / 2000 * objective.half_angle_rad
    light = np.sin(theta) * np.cos(theta)
    shift = shift_exact_m(glass.thickness_m, theta, refractive_index=glass.refractive_index)
    return float(np.average(shift, weights=light))


def cosine_ratio(angle_rad: float, refractive_index: float) -> float:
    """Return cos θ / cos θ′ of a ray that enters the glass; the paper calls it close to 1."""
    return float(np.cos(angle_rad) / np.cos(np.arcsin(np.sin(angle_rad) / refractive_index)))


def numbers() -> Numbers:
    """Return everything that sections 2 to 5 and 7 print, computed."""
    pitch_m = WIDTH_M / WIDTH_PX
    speed = float(TABLE.speed_at_m_s(0.0))
    seconds = float(TABLE.time_of_arc_s(GROUPS * WIDTH_M))
    limit = rad(PARAXIAL_LIMIT_DEG)

    def exact(angle_rad: float) -> float:
        return float(shift_exact_m(GLASS.thickness_m, angle_rad, refractive_index=GLASS.refractive_index))

    return Numbers(
        object_distance_m=LENS.object_distance_m,
        focal_length_m=LENS.focal_length_m,
        focal_length_4x_m=LENS_4X.focal_length_m,
        depth_of_field_m=LENS.depth_of_field_m(),
        depth_of_field_4x_m=LENS_4X.depth_of_field_m(),
        aperture_of_45_um=float(np.sqrt(0.55e-6 / 45e-6)),
        shift_m=GLASS.shift_m,
        shift_at_limit_m=exact(limit),
        shift_at_rim_m=exact(LENS.half_angle_rad),
        shift_mean_m=shift_over_aperture_m(LENS, GLASS),
        cosines_at_limit=cosine_ratio(limit, GLASS.refractive_index),
        separation_px=stripe_separation_m(GLASS.shift_m, wall_angle_rad=rad(45)) / pitch_m,
        pixel_pitch_m=pitch_m,
        groove_speed_m_s=speed,
        pixel_rate_hz=float(pixel_rate_hz(speed, pixel_pitch_m=pitch_m)),
        seconds=seconds,
        overlap_for_3_s=1 - 3.0 / seconds,
        data_bytes=float(GROUPS * FRAMES * WIDTH_PX * HEIGHT_PX * 3),
    )


def claims(n: Numbers) -> list[Claim]:
    """Return the table of the page."""
    um, mm = 1e6, 1e3
    return [
        Claim("2", "40X objective, 10X eye piece: 400X", f"{LENS.magnification * 10:.0f}X"),
        Claim(
            "2",
            "24 bit colour, 1280 × 1024 pixels",
            f"{WIDTH_PX} × {HEIGHT_PX}; the reading uses grey",
            "a stripe is sharp in all three colours alike; the simulator films in grey",
        ),
        Claim(
            "2",
            "78RPM records need less magnification than 33RPM ones",
            f"at 33⅓ the same sound is squeezed into a {78 / (100 / 3):.2f} times shorter groove, which "
            "needs so much more "
            "magnification",
            "the paper gives no number",
        ),
        Claim(
            "3",
            "groove about 120 µm deep, error 7–8 % of the distance: distance ≤ 1.7mm",
            f"{GROOVE_DEPTH_M / 0.08 * mm:.2f} … {GROOVE_DEPTH_M / 0.07 * mm:.2f} mm",
            "1.7 mm belongs to 7 %; 8 % gives 1.5 mm. A V with 45° walls that is 120 µm deep is "
            f"{2 * GROOVE_DEPTH_M * um:.0f} µm "
            f"wide; the bench here has {Bench().disc.groove_width_m * um:.0f} µm, and is therefore "
            f"{Bench().disc.groove_width_m / 2 * um:.0f} µm deep",
        ),
        Claim("3", "u = 160mm, v = u/40 = 4mm", f"{n.object_distance_m * mm:.3f} mm"),
        Claim("3", "f = 3.9mm", f"{n.focal_length_m * mm:.3f} mm"),
        Claim(
            "4",
            "depth of field of a 40X objective about 1 µm",
            f"{n.depth_of_field_m * um:.2f} µm",
            "λ/NA² with λ = 0.55 µm and NA = 0.65; the paper does not print its aperture",
        ),
        Claim(
            "4",
            "depth of field of a 4X objective about 45 µm",
            f"{n.depth_of_field_4x_m * um:.0f} µm for NA 0.10",
            f"45 µm belongs to NA {n.aperture_of_45_um:.2f}; it is {percent(45e-6 / GROOVE_DEPTH_M)} of "
            "the groove, where the "
            "paper says about half",
        ),
        Claim("4", "f = 32mm of the 4X objective", f"{n.focal_length_4x_m * mm:.0f} mm"),
        Claim(
            "5, eq. 2",
            "δv = 1 − (1/λ)·cos θ/cos θ′",
            "δv = d·(1 − (1/λ)·cos θ/cos θ′)",
            "the factor d is missing in print: a shift has the unit of a length, and equation 3 has it",
        ),
        Claim("5, eq. 3", "d = 0.11mm, λ = 1.515 (air 1.0): δv = 0.037mm", f"{n.shift_m * um:.2f} µm"),
        Claim(
            "5",
            "cos θ/cos θ′ is close to 1 below 22.5°",
            f"{n.cosines_at_limit:.3f} at 22.5°, where the shift is {n.shift_at_limit_m * um:.2f} µm",
            f"that is {percent(n.shift_at_limit_m / n.shift_m - 1)} more than equation 3, and a 0.65 "
            "aperture goes on to "
            f"{deg(LENS.half_angle_rad):.1f}°, where it is {n.shift_at_rim_m * um:.1f} µm",
        ),
        Claim(
            "5", "two depths, 4mm and 4.037mm", f"4.000 and {(n.object_distance_m + n.shift_m) * mm:.3f} mm, paraxially"
        ),
        Claim("7", "0.5mm / 1280 = 0.39 µm a pixel", f"{n.pixel_pitch_m * um:.6f} µm"),
        Claim("7", "2π·78/60·115mm = 939.34mm/s", f"{n.groove_speed_m_s * mm:.3f} mm/s"),
        Claim(
            "7",
            "pixel rate 2404.71kHz",
            f"{n.pixel_rate_hz / 1e3:.2f} kHz",
            f"rounding; the printed pitch of 0.39 µm would give {n.groove_speed_m_s / 0.39e-6 / 1e3:.1f} kHz",
        ),
        Claim(
            "7",
            "about 110 times a recording's sample frequency",
            f"110 times {n.pixel_rate_hz / 110 / 1e3:.2f} kHz",
            "so the recording was taken to need about 22 kHz, half of the rate of a compact disc",
        ),
        Claim(
            "7",
            "synthetic grooves sampled at 220.5kHz",
            f"the real pixels are {n.pixel_rate_hz / 220_500:.1f} times finer",
        ),
        Claim(
            "7",
            "6000 groups: about 3 seconds",
            f"{n.seconds:.2f} s without overlap",
            f"an overlap of {percent(n.overlap_for_3_s, 1)} between groups would make it 3 s; the paper "
            "says nothing of overlap",
        ),
        Claim(
            "7",
            "12 images a group, a week to capture and another to process",
            f"{GROUPS * FRAMES} images, {n.data_bytes / 1e9:.0f} GB of raw colour",
            f"a week is {7 * 86400 / (GROUPS * FRAMES):.1f} s an image",
        ),
        Claim(
            "6",
            "neighbourhood of 100 pixels",
            f"{NEIGHBOURHOOD_PX * n.pixel_pitch_m * um:.1f} µm, "
            f"{NEIGHBOURHOOD_PX / n.pixel_rate_hz * um:.1f} µs of sound",
            "see [orientation](orientation.md) for what that does to treble and noise",
        ),
    ]


def shift_figure(n: Numbers) -> Figure:
    """Draw the shift of the focus over the angle of the ray, exact and paraxial."""
    angle_deg = np.linspace(0, deg(LENS.half_angle_rad), 300)
    exact = shift_exact_m(GLASS.thickness_m, np.deg2rad(angle_deg), refractive_index=GLASS.refractive_index)
    figure = ink.blank_figure(8.0, 4.2)
    axes = figure.subplots()
    axes.plot(angle_deg, exact * 1e6, color=ink.BLUE, linewidth=2)
    axes.axhline(n.shift_m * 1e6, color=ink.VERMILLION, linestyle="--", linewidth=1.5)
    axes.axhline(n.shift_mean_m * 1e6, color=ink.GREY, linestyle=":", linewidth=1.5)
    axes.axvline(PARAXIAL_LIMIT_DEG, color=ink.GREY, linewidth=1)
    axes.text(41, 43.5, "exact: equation 2 with its d", color=ink.BLUE, fontsize=ink.SMALL, va="top", ha="right")
    axes.text(
        41,
        n.shift_m * 1e6 - 0.2,
        "paraxial: equation 3",
        color=ink.VERMILLION,
        fontsize=ink.SMALL,
        va="top",
        ha="right",
    )
    axes.text(1, n.shift_mean_m * 1e6 + 0.15, "mean over the light of the cone", color=ink.BLACK, fontsize=ink.SMALL)
    axes.text(PARAXIAL_LIMIT_DEG + 0.4, 47.5, "22.5°, the paper's limit", color=ink.BLACK, fontsize=ink.SMALL)
    ink.dress(
        axes, x="angle of the ray in air, θ (degrees; the aperture ends at 40.5)", y="shift of the focus, δv (µm)"
    )
    axes.set_xlim(0, 41.2)
    axes.set_ylim(36, 50)
    return figure


def _draw_groove(axes: Axes, bench: Bench) -> None:
    half_um = bench.disc.groove_width_m * 1e6 / 2
    axes.plot([-115, -half_um, 0, half_um, 115], [0, 0, -half_um, 0, 0], color=ink.BLACK, linewidth=1.6)
    depths = (bench.focus_below_land_m, bench.focus_through_glass_m)
    for depth_m, text, colour in zip(depths, ("4.000 mm", "4.037 mm"), (ink.ORANGE, ink.SKY), strict=True):
        axes.axhline(-depth_m * 1e6, color=colour, linewidth=1.2, linestyle="--")
        axes.text(-113, -depth_m * 1e6 - 1, text, color=ink.BLACK, fontsize=ink.SMALL, va="top")
    width = {"groove_width_m": bench.disc.groove_width_m, "wall_angle_rad": bench.disc.wall_angle_rad}
    deep, shallow = (stripe_distance_from_middle_m(q, **width) * 1e6 for q in reversed(depths))
    places = ((-deep, depths[1], "1"), (deep, depths[1], "2"), (shallow, depths[0], "3"))
    for lateral_um, depth_m, name in places:
        axes.plot(lateral_um, -depth_m * 1e6, "o", color=ink.VERMILLION, markersize=7, zorder=5)
        side = "left" if lateral_um < 0 else "right"
        axes.text(lateral_um + (4 if lateral_um < 0 else -4), -depth_m * 1e6 + 3, name, fontsize=ink.LARGE, ha=side)
    axes.axvspan(-115, (deep + shallow) / 2, color=ink.SKY, alpha=0.12, linewidth=0)
    axes.text(-113, 8, "under the glass", fontsize=ink.SMALL, color=ink.BLACK)
    axes.set_xlim(-115, 115)
    axes.set_ylim(-82, 18)
    ink.dress(axes, x="across the groove, l (µm)", y="height, z (µm)", grid=False)


def _draw_blur(axes: Axes, bench: Bench) -> None:
    depth_um = np.linspace(0, 75, 500)

    def radius_px(sharp_m: float) -> FloatArray:
        radius_m = blur_radius_m(depth_um * 1e-6 - sharp_m, objective=bench.objective)
        return np.asarray(radius_m / bench.sensor.pixel_pitch_m)

    axes.plot(radius_px(bench.focus_below_land_m), -depth_um, color=ink.ORANGE, linewidth=2)
    axes.plot(radius_px(bench.focus_through_glass_m), -depth_um, color=ink.SKY, linewidth=2)
    axes.text(40, -7, "without glass", fontsize=ink.SMALL, color=ink.BLACK, va="top")
    axes.text(40, -72, "through it", fontsize=ink.SMALL, color=ink.BLACK, va="top")
    axes.set_xlim(0, 130)
    axes.set_ylim(-82, 18)
    ink.dress(axes, x="radius of the blur (pixels)", y="")


def stripes_figure(bench: Bench) -> Figure:
    """Draw the section of the groove with its two focal planes, and how blurred every depth is."""
    figure = ink.blank_figure(10.0, 3.9)
    left, right = figure.subplots(1, 2, width_ratios=[2.1, 1.0], sharey=True)
    _draw_groove(left, bench)
    _draw_blur(right, bench)
    ink.heading(left, "Three sharp places on two walls")
    ink.heading(right, "How blurred the rest is")
    return figure


def make(folder: Path = FOLDER) -> Page:
    """Write the page."""
    n, bench = numbers(), Bench()
    page = Page("optics", "The rig and its optics (sections 2 to 5, arithmetic of 7)", folder=folder)
    page.finding = (
        "Nearly all printed numbers come out again (not the depth of field of a 4X lens, nor quite "
        "the 3 seconds); equation 2 lacks its factor d, and at "
        "the rim of the aperture the "
        f"glass shifts the focus by {n.shift_at_rim_m * 1e6:.1f} µm where the paper counts on {n.shift_m * 1e6:.1f}."
    )
    page.say(f"""{PAPER}. A microscope with a 40X objective looks down into the groove of a 78 while the turntable
        creeps. The lens is sharp over about a micrometre of depth only, and the groove is a hundred times deeper. The
        paper makes a virtue of it: where a wall at 45° crosses the sharp plane there is a sharp *stripe*, and with a
        thin glass over half of the field there are two sharp planes, hence two stripes at known depths on one wall,
        hence that wall's orientation.""")
    page.claims(claims(n))
    page.head("Why the glass moves the focus, and by how much")
    page.say(f"""A plane plate of thickness d lets a ray of angle θ cross the axis further away from the lens by d −
        d·tan θ′/tan θ with sin θ = λ sin θ′. Writing the tangents out gives the paper's equation 2, *with* the d. The
        ratio cos θ/cos θ′ is 1 on the axis only, and falls as the ray gets steeper: the plate adds spherical
        aberration. The rays of the cone do not meet in one point any more but are spread over
        {(n.shift_at_rim_m - n.shift_m) * 1e6:.1f} µm of depth,
        {(n.shift_at_rim_m - n.shift_m) / n.depth_of_field_m:.0f} times the depth of field. Their mean, weighted by
        light, lies at {n.shift_mean_m * 1e6:.1f} µm. (An objective corrected for cover glasses behaves otherwise; the
        paper names none.)

        The shift sets the wall's angle that is computed, not the sound: what is heard is the slope of a stripe along
        the groove, and that does not depend on the shift. But the distance of two stripes of a 45° wall does:
        {n.separation_px:.1f} pixels for {n.shift_m * 1e6:.2f} µm. That is a free check of the glass; measured in a
        real picture it is a calibration (`CoverGlass.focus_shift_m`).""")
    page.picture(
        shift_figure(n),
        "shift",
        "Shift of the focus by 0.11 mm of glass. The paper's constant is the value at θ = 0; the "
        "aperture of a 40X/0.65 ends at "
        f"{deg(LENS.half_angle_rad):.1f}°.",
    )
    page.head("Two sharp depths, three sharp stripes")
    page.say(f"""Depths are counted here from the land, with the plane that is sharp without glass
        {bench.focus_below_land_m * 1e6:.0f} µm below it (the paper does not say where it focused). Stripes 1 and 2
        lie at the same depth on opposite walls, through the glass; stripe 3 lies on the wall of stripe 2, beside the
        glass. The paper sets stripe 1 aside and makes the wall from 2 and 3. Blur grows by
        {LENS.blur_radius_per_defocus:.2f} µm of radius for each micrometre of defocus: a point one stripe distance
        away from its sharp plane is smeared over a disc of
        {float(blur_radius_m(n.shift_m, objective=LENS)) / n.pixel_pitch_m:.0f} pixels radius, and a texture of
        micrometre grains vanishes. That is what lets a flow algorithm tell sharp from blurred: see [in
        focus](in_focus.md).""")
    page.picture(
        stripes_figure(bench),
        "stripes",
        "Section through the groove. Red dots: where a wall is sharp. The glass covers the shaded side. "
        "Right: radius of the blur disc over the height, with the glass (blue) and without it (orange).",
    )
    page.write()
    return page


if __name__ == "__main__":
    make()
