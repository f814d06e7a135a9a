"""How well could a scene be read at best? The Cramér–Rao bound of a textured wall, blurred by known optics, seen with noise.

A wall that stands at the angle φ is sharp at one row of the picture, its stripe, and the further a row lies from there the
larger the disc that blurs it: at y rows from the stripe R² = (y tan φ tan α)² + floor², with α the half angle of the
aperture. A groove that moves by part of a row takes stripe and texture along; the texture is random, so that all that
betrays the movement is which rows are how blurred. For a Gaussian texture with the power spectrum S, and a picture that is
even along the groove, Whittle's likelihood is exact frequency by frequency: the rows at f cycles a pixel have the
covariance

    C_f(y, y′) = ∫ S(f, k) H(R_y, κ) H(R_y′, κ) cos 2πk(y − y′) dk + noise² δ,   κ² = f² + k²,   H = 2 J₁(x)/x at x = 2πRκ,

and a column tells ∫ ½ tr(C⁻¹ dC C⁻¹ dC) df, f from −½ to ½, about the place of its stripe (P. Whittle, 1953; S. Kay,
Fundamentals of Statistical Signal Processing I, 1993, section 3.9). Each row is blurred by its own disc, not by those of the
points that light it. No unbiased reading can have errors of place with a smaller density, and the error of the velocity has
(2πf)² times that. Left out: what the skewness of a texture tells, overlapping groups, the mixed zone at the glass edge, the
opposite wall.

    python -m benchmarks.accuracy.bound
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import j1, jv

from gramoscope.conventions import FloatArray
from gramoscope.listening.align import Band, band_response
from gramoscope.simulation.scene import Scene, filming_bench, named_scene

REACH_PX = 40
"""Rows on each side of a stripe. Half the way to the next stripe of the wall is 48."""
FREQUENCIES = 24
BAND_HZ = (100.0, 10_000.0)
LEAST_POWER = 1e-9
"""Where the spectrum of the texture has fallen so far, relative to its peak, it is taken to end."""


@dataclass(frozen=True)
class SharpStripe:
    """A wall where it is sharp, in pixels.

    Attributes
    ----------
    grain_px : float
        Diameter of a grain on the wall, full width at half maximum of the Gaussian that makes it.
    foreshortening : float
        How much shorter the wall looks across the groove, cos φ; 1 for grains that are round in the picture.
    blur_per_row : float
        Growth of the disc's radius for each row away from the stripe, tan φ · tan α.
    floor_px : float
        Radius of the disc that diffraction leaves.
    contrast, noise : float
        Standard deviations in the sharp row, of texture and of a pixel's noise, in one unit.
    """

    grain_px: float
    foreshortening: float
    blur_per_row: float
    floor_px: float
    contrast: float
    noise: float

    def texture_power(self, f: float, k: FloatArray) -> FloatArray:
        """Return the power spectrum of the texture in the picture before any blur, 1 at its peak (f, k in cycles a pixel)."""
        sigma_px = self.grain_px / np.sqrt(8 * np.log(2))
        return np.asarray(np.exp(-((2 * np.pi * sigma_px) ** 2) * (f**2 + (k * self.foreshortening) ** 2)))

    @property
    def finest(self) -> float:
        """Cycles a pixel across the stripe beyond which the texture has no power left."""
        sigma_px = self.grain_px / np.sqrt(8 * np.log(2))
        return float(np.sqrt(-np.log(LEAST_POWER)) / (2 * np.pi * sigma_px * self.foreshortening))


def disc_mtf(x: FloatArray) -> FloatArray:
    """Return 2 J₁(x)/x, the response of an even disc; 1 at 0."""
    safe = np.maximum(x, 1e-6)
    return np.asarray(2 * j1(safe) / safe, np.float64)


def disc_mtf_slope(x: FloatArray) -> FloatArray:
    """Return the derivative of `disc_mtf`, −2 J₂(x)/x."""
    safe = np.maximum(x, 1e-6)
    return np.asarray(-2 * jv(2, safe) / safe, np.float64)


def covariance(stripe: SharpStripe, f: float, rows_px: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of the rows about a stripe at one frequency along the groove, and how it changes.

    Parameters
    ----------
    stripe : SharpStripe
    f : float
        Cycles a pixel, −½ … ½.
    rows_px : float array, shape (row,)
        Distances from the stripe.

    Returns
    -------
    C, dC : float64 arrays, shape (row, row)
        Spectral density for each pixel along the groove, with the noise, and its derivative for all `rows_px` growing alike:
        the groove moving the other way.
    """
    k, step = _across(stripe, rows_px)
    radius = np.sqrt((stripe.blur_per_row * rows_px) ** 2 + stripe.floor_px**2)[:, None]
    growth = (stripe.blur_per_row**2 * rows_px)[:, None] / radius
    kappa = np.hypot(f, k)
    weight = np.sqrt(_scale(stripe) * stripe.texture_power(f, k) * step)
    seen = weight * disc_mtf(2 * np.pi * radius * kappa)
    change = weight * disc_mtf_slope(2 * np.pi * radius * kappa) * 2 * np.pi * kappa * growth
    turn = 2 * np.pi * k * rows_px[:, None]
    waves = np.hstack([seen * np.cos(turn), seen * np.sin(turn)])
    changes = np.hstack([change * np.cos(turn), change * np.sin(turn)])
    half = changes @ waves.T
    return waves @ waves.T + stripe.noise**2 * np.eye(len(rows_px)), half + half.T


def _across(stripe: SharpStripe, rows_px: FloatArray) -> tuple[FloatArray, float]:
    """Return frequencies across the groove and their step.

    The step is so fine that the sum's period exceeds rows, discs and grains.
    """
    span = float(np.ptp(rows_px)) + 1
    period = 2 * span * (1 + stripe.blur_per_row) + 4 * (stripe.grain_px + stripe.floor_px) + 16
    count = int(np.ceil(2 * stripe.finest * period))
    k = ((np.arange(count) + 0.5) / count * 2 - 1) * stripe.finest
    return k, 2 * stripe.finest / count


def _scale(stripe: SharpStripe) -> float:
    """Return the power density that gives the sharp row its contrast."""
    f = (np.arange(128) + 0.5) / 256
    k, step = _across(stripe, np.zeros(1))
    sharp = [
        np.sum(stripe.texture_power(one, k) * disc_mtf(2 * np.pi * stripe.floor_px * np.hypot(one, k)) ** 2) * step
        for one in f
    ]
    return float(stripe.contrast**2 / np.mean(sharp))


def fisher_density(C: FloatArray, dC: FloatArray) -> float:
    """Return ½ tr(C⁻¹ dC C⁻¹ dC), what one frequency tells."""
    change = np.linalg.solve(C, dC)
    return float(0.5 * np.sum(change * change.T))


def information(stripe: SharpStripe, *, reach_px: int = REACH_PX, frequencies: int = FREQUENCIES) -> float:
    """Return what a column tells about the place of its stripe.

    Parameters
    ----------
    stripe : SharpStripe
    reach_px : int
        Rows on each side that are looked at.
    frequencies : int
        Nodes of Gauss and Legendre's quadrature over 0 … ½ cycles a pixel.

    Returns
    -------
    float
        Fisher information for each column, 1/px².
    """
    rows_px = np.arange(-reach_px, reach_px + 1, dtype=np.float64)
    node, weight = np.polynomial.legendre.leggauss(frequencies)
    told = [fisher_density(*covariance(stripe, f, rows_px)) for f in (node + 1) / 4]
    return float(np.dot(weight, told) / 2)


def place_density_m2_hz(information_px: float, *, pixel_pitch_m: float, groove_speed_m_s: float) -> float:
    """Return the one-sided density of the error of place, 2 · (pitch²/information) / columns a second."""
    return 2 * pixel_pitch_m**2 / information_px * pixel_pitch_m / groove_speed_m_s


def velocity_noise_m_s(density_m2_hz: float, *, band_hz: Band = BAND_HZ) -> float:
    """Return the rms error of the velocity in a band with sharp edges, for an even density of the error of place."""
    low_hz, high_hz = band_hz
    return float(2 * np.pi * np.sqrt(density_m2_hz * (high_hz**3 - low_hz**3) / 3))


def velocity_noise_compared_m_s(density_m2_hz: float, *, band_hz: Band = BAND_HZ) -> float:
    """Return the same behind the band-pass of `gramoscope.listening.compare`, whose soft edge lets a fifth less through."""
    f = np.linspace(0, 4 * band_hz[1], 8001)[1:]
    power = (2 * np.pi * f * band_response(f, band_hz=band_hz)) ** 2
    return float(np.sqrt(density_m2_hz * np.sum(power) * f[0]))


def snr_db(signal_m_s: float, noise_m_s: float) -> float:
    """Return a signal to noise ratio from two rms values."""
    return float(20 * np.log10(signal_m_s / noise_m_s))


def stripe_of_scene(scene: Scene) -> SharpStripe:
    """Return the stripes of a simulated scene: texture, light, camera and frames of a group as they are, free of damage.

    Light is the mean over all stripes at rest. Rendered films have a twentieth less contrast, because their sources and pixels
    are not points: their true bound lies half a decibel lower.
    """
    bench = scene.bench
    pitch_m, angle_rad = bench.sensor.pixel_pitch_m, bench.disc.wall_angle_rad
    level = _wall_level(scene)
    round_ = SharpStripe(
        grain_px=scene.texture.grain_m / pitch_m,
        foreshortening=float(np.cos(angle_rad)),
        blur_per_row=float(np.tan(angle_rad)) * bench.objective.blur_radius_per_defocus,
        floor_px=scene.floor_px,
        contrast=1.0,
        noise=pixel_noise(scene, level=level) / float(np.sqrt(bench.sequence.frames_per_group)),
    )
    return replace(round_, contrast=bench.sensor.white_level * level * scene.texture.contrast * sharp_share(round_))


def _wall_level(scene: Scene) -> float:
    """Return the share of full scale that the walls have at their stripes."""
    steep = float(np.tan(scene.bench.disc.wall_angle_rad))
    stripes = scene.bench.stripes()
    slope = np.array([steep if stripe.wall == 0 else -steep for stripe in stripes])
    depth = np.array([-stripe.depth_below_land_m for stripe in stripes])
    bright = scene.illumination.brightness(np.zeros(len(slope)), slope, height_m=depth)
    sensor = scene.bench.sensor
    field = scene.illumination.field(height_px=sensor.height_px, width_px=sensor.width_px)
    rows = np.clip(np.rint([stripe.row for stripe in stripes]).astype(int), 0, sensor.height_px - 1)
    seen = bright * field[rows].mean(axis=1)
    return float(seen.mean()) * scene.illumination.exposure * scene.rig.dim


def pixel_noise(scene: Scene, *, level: float) -> float:
    """Return the standard deviation of a pixel in grey levels: photons, amplifier and rounding."""
    noise, white = scene.noise, scene.bench.sensor.white_level
    electrons = level * noise.full_well_electrons + noise.read_electrons**2
    return float(np.sqrt(electrons * (white / noise.full_well_electrons) ** 2 + 1 / 12))


def sharp_share(stripe: SharpStripe) -> float:
    """Return the contrast that the floor's disc leaves in the sharp row, relative to that of the unblurred texture."""
    open_eye = replace(stripe, floor_px=1e-6)
    return float(np.sqrt(_scale(replace(open_eye, contrast=1.0)) / _scale(replace(stripe, contrast=1.0))))


def scene_density_m2_hz(scene: Scene, *, channel: int | None = None, reach_px: int = REACH_PX) -> float:
    """Return the least density of the error of place that a scene allows.

    Parameters
    ----------
    scene : Scene
    channel : int, optional
        Of a 45/45 groove, 0 for left: along the normal of its wall, by the stripes of that wall. When not given, in the
        direction of the cut (lateral for 45/45), the other direction being known, by all stripes.
    reach_px : int
        As in `information`.

    Returns
    -------
    float
        m²/Hz, one-sided.
    """
    bench = scene.bench
    stripes = [stripe for stripe in bench.stripes() if channel in (None, stripe.wall)]
    told = information(stripe_of_scene(scene), reach_px=reach_px) * len(stripes)
    if channel is not None:
        told *= 2
    elif bench.disc.cut == "vertical":
        told /= float(np.tan(bench.disc.wall_angle_rad)) ** 2
    speed_m_s = float(bench.rotation.speed_at_m_s(0.0))
    return place_density_m2_hz(told, pixel_pitch_m=bench.sensor.pixel_pitch_m, groove_speed_m_s=speed_m_s)


PHYSICS = SharpStripe(
    grain_px=1.2 / 0.390625,
    foreshortening=1.0,
    blur_per_row=float(np.tan(np.arcsin(0.65))),
    floor_px=0.42 * 0.55 / 0.65 / 0.390625,
    contrast=22.0,
    noise=2.5 / np.sqrt(12),
)
"""The scene whose bound was published with the prototypes: 22 grey levels, noise 2.5 in each of 12 frames."""


def _say(name: str, stripe: SharpStripe, reach_px: int, frequencies: int = FREQUENCIES) -> None:
    bench = filming_bench()
    told = information(stripe, reach_px=reach_px, frequencies=frequencies)
    speed_m_s = float(bench.rotation.speed_at_m_s(0.0))
    density = place_density_m2_hz(3 * told, pixel_pitch_m=bench.sensor.pixel_pitch_m, groove_speed_m_s=speed_m_s)
    snr = snr_db(0.03, velocity_noise_m_s(density))
    grid = f"±{reach_px:2d} rows, {frequencies:2d} frequencies"
    print(f"{name:26s} {grid}: {told:7.2f} /px² a column and stripe, three read 3 cm/s rms with {snr:5.1f} dB")


def main() -> int:
    for reach_px, frequencies in ((10, 24), (20, 24), (30, 24), (40, 24), (45, 24), (30, 12), (30, 48)):
        _say("physics", PHYSICS, reach_px, frequencies)
    _say("physics, round on the wall", replace(PHYSICS, foreshortening=np.sqrt(0.5)), 30)
    _say("physics, one frame", replace(PHYSICS, noise=2.5), 30)
    for texture in ("powder", "shellac", "polished"):
        _say(f"film, {texture}", stripe_of_scene(named_scene(filming_bench(), texture=texture)), 30)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
