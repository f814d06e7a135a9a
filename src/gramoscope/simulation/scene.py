"""Everything that a simulated film depends on.

The `Bench` is what the manifest says; the scene holds what is true, which may be something else: walls off their angle, a
microscope that drifts, a groove that does not run through the middle of the picture. The same scene and the same sound
give the same film, bit for bit.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from gramoscope.apparatus.bench import Bench
from gramoscope.camera.noise import SensorNoise
from gramoscope.camera.sensor import Sensor
from gramoscope.disc.damage import DAMAGES, NO_DAMAGE, Damage
from gramoscope.disc.groove import GrooveProfile
from gramoscope.disc.texture import POWDER, TEXTURES, Texture
from gramoscope.errors import require
from gramoscope.microscope.cover_glass import CoverGlass
from gramoscope.microscope.illumination import Illumination
from gramoscope.simulation.rig import PERFECT_RIG, RIGS, Rig

LEVEL_M_S = 0.03
"""Velocity of the groove, rms, of an ordinary 78."""


@dataclass(frozen=True)
class Scene:
    """A record under a microscope.

    Parameters
    ----------
    bench : Bench
        What the manifest says.
    texture : Texture
    damage : Damage
    illumination : Illumination
    noise : SensorNoise
    rig : Rig
        How far the truth is from the manifest.
    level_m_s : float
        Velocity of the groove, rms over the passage.
    groove_middle_m : float
        Lateral place l of the middle of the unmodulated groove; 0 is the middle of the picture.
    bottom_radius_m : float
        Of the groove's rounded bottom.
    mixed_zone_m : float
        Half width of the zone along the glass edge where both focal planes are seen at once: there the cone of rays is
        partly inside the glass. Positive.
    wavelength_m : float
        Of the light, for the smallest disc that diffraction leaves.
    seed : int
        Zero or more.
    """

    bench: Bench = field(default_factory=lambda: filming_bench())
    texture: Texture = POWDER
    damage: Damage = NO_DAMAGE
    illumination: Illumination = field(default_factory=Illumination)
    noise: SensorNoise = field(default_factory=SensorNoise)
    rig: Rig = PERFECT_RIG
    level_m_s: float = LEVEL_M_S
    groove_middle_m: float = 0.0
    bottom_radius_m: float = 10e-6
    mixed_zone_m: float = 12e-6
    wavelength_m: float = 0.55e-6
    seed: int = 0

    def __post_init__(self) -> None:
        require(self.mixed_zone_m > 0, f"a mixed zone of {self.mixed_zone_m} m", "a positive width")
        require(self.wavelength_m > 0, f"a wavelength of {self.wavelength_m} m", "a positive length")
        require(self.seed >= 0, f"the seed is {self.seed}", "zero or more")

    @property
    def groove(self) -> GrooveProfile:
        """The groove as it is."""
        return GrooveProfile.of_disc(
            self.bench.disc,
            inner_error_rad=self.rig.inner_angle_error_rad,
            outer_error_rad=self.rig.outer_angle_error_rad,
            bottom_radius_m=self.bottom_radius_m,
        )

    @property
    def floor_px(self) -> float:
        """Radius of the disc that stands for diffraction, 0.42 λ/NA, in pixels."""
        aperture = self.bench.objective.numerical_aperture
        return 0.42 * self.wavelength_m / aperture / self.bench.sensor.pixel_pitch_m

    def lasting(self, seconds: float) -> Scene:
        """Return the same scene with as many groups as it takes to film a sound of that length."""
        sequence, sensor = self.bench.sequence, self.bench.sensor
        length_m = float(self.bench.rotation.arc_of_time_m(seconds)) - (sensor.width_px - 1) * sensor.pixel_pitch_m
        groups = max(1, 1 + int(-(-length_m // sequence.group_step_m)))
        return replace(self, bench=replace(self.bench, sequence=replace(sequence, groups=groups)))


def filming_bench(*, height_px: int = 512) -> Bench:
    """Return the bench of the paper with a picture that just holds the groove, its glass edge between two stripes."""
    bench = Bench(sensor=Sensor(height_px=height_px))
    _, deep_row, shallow_row = bench.stripe_rows()
    return replace(bench, cover_glass=CoverGlass(edge_row=(deep_row + shallow_row) / 2))


def named_scene(
    bench: Bench, *, texture: str = "powder", damage: str = "none", imperfections: str = "none", seed: int = 0
) -> Scene:
    """Return a scene by the names that the command line knows.

    Parameters
    ----------
    bench : Bench
    texture : {"powder", "shellac", "polished"}
    damage : {"none", "light", "heavy"}
    imperfections : {"none", "modest", "rough"}
    seed : int

    Raises
    ------
    ArgumentError
        If there is no preset of some name.
    """
    for kind, name, known in (
        ("texture", texture, TEXTURES),
        ("damage", damage, DAMAGES),
        ("imperfections", imperfections, RIGS),
    ):
        require(name in known, f"{kind} {name!r}", f"one of {', '.join(known)}")
    return Scene(bench, texture=TEXTURES[texture], damage=DAMAGES[damage], rig=RIGS[imperfections], seed=seed)
