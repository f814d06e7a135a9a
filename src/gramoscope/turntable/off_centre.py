"""An off-centre hole: what it does to a film, and how places are put right.

The groove is a spiral about C, the middle of the lathe on which it was cut, where the record turned evenly; the record is
filmed while it turns about H, its hole, at the distance e from C. Let φ be the angle by which it has turned about H since
s = 0. The groove then passes the lens at the distance

    R(φ) = e cos(φ − φ₀) + √(r² − e² sin²(φ − φ₀)) = r + e cos(φ − φ₀) + O(e²/r)

from the spindle, farthest out at φ = φ₀, where the line from C to the groove under the lens encloses with that from H the
angle (law of sines in the triangle C, H, groove) by which the angle about C runs ahead (r of the spiral is taken at φ in place
of θ: 0.5 µm of R for 0.6 mm off centre),

    θ(φ) = φ + arcsin((e/r) sin(φ − φ₀)),      dθ/dφ = 1 + (e/r) cos(φ − φ₀) + O(e²/r²).

The lateral place l grows inwards, so that a hole shows as l = const − e cos(φ − φ₀), beside the pitch of the spiral.

*Places.* An encoder, a stepper motor or a count of groups knows φ: what a capture calls the place of a stretch is the arc
s_n = s(φ) of the nominal spiral. How far the groove has really run is s(θ(φ) − θ(0)), and it was cut at the time
(θ(φ) − θ(0))/ω. Played at φ/ω, as by a stylus, the sound is too fast by (e/r) cos(φ − φ₀): the wow of peak e/r, highest where
the groove is farthest out. Within a stretch the pixels are true arc already, and so is its slope; only where the stretch begins
must be put right. Overlaps of stretches (`tonearm.splice`) see the difference too, but believe the encoder over more than some
hundredths of a turn, and leave most of the wow as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.signal_path import Texture, WallTrace
from gramoscope.turntable.rotation import Rotation


@dataclass(frozen=True)
class OffCentreHole:
    """A hole beside the middle of the groove.

    Parameters
    ----------
    rotation : Rotation
        The spiral; its speed does not matter here.
    eccentricity_m : float
        e, 0 or more and less than half the radius at s = 0.
    phase_rad : float
        φ₀: by how much the record has turned since s = 0 when the groove is farthest from the spindle.
    """

    rotation: Rotation
    eccentricity_m: float
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        require(
            0 <= self.eccentricity_m < self.rotation.radius_m / 2,
            f"a hole {self.eccentricity_m * 1e3:g} mm off centre, the groove at {self.rotation.radius_m * 1e3:g} mm",
            "0 … half the radius",
        )

    def distance_m(self, nominal_arc_m: npt.ArrayLike) -> FloatArray:
        """Return R, the distance of the groove under the lens from the spindle; NaN gives NaN."""
        angle, radius = self._seen_from_the_groove(nominal_arc_m)
        across = self.eccentricity_m * np.sin(angle)
        return self.eccentricity_m * np.cos(angle) + np.sqrt(radius**2 - across**2)

    def true_arc_m(self, nominal_arc_m: npt.ArrayLike) -> FloatArray:
        """Return how far the groove has run where the capture says s_n; 0 at 0; rises with s_n; NaN gives NaN."""
        turned = self.rotation.angle_of_arc_rad(nominal_arc_m)
        ahead = self._ahead_rad(nominal_arc_m) - self._ahead_rad(0.0)
        return self.rotation.arc_of_angle_m(turned + ahead)

    def put_right(self, trace: WallTrace) -> WallTrace:
        """Return a stretch where it really begins, with its textures; all else stays."""
        shift = float(self.true_arc_m(trace.arc_start_m)) - trace.arc_start_m

        def moved(texture: Texture | None) -> Texture | None:
            return texture and replace(texture, arc_start_m=texture.arc_start_m + shift)

        return replace(trace, arc_start_m=trace.arc_start_m + shift, head=moved(trace.head), tail=moved(trace.tail))

    def _seen_from_the_groove(self, nominal_arc_m: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """φ − φ₀ and r."""
        return (
            self.rotation.angle_of_arc_rad(nominal_arc_m) - self.phase_rad,
            self.rotation.radius_at_m(nominal_arc_m),
        )

    def _ahead_rad(self, nominal_arc_m: npt.ArrayLike) -> FloatArray:
        """θ − φ."""
        angle, radius = self._seen_from_the_groove(nominal_arc_m)
        return np.asarray(np.arcsin(self.eccentricity_m / radius * np.sin(angle)), np.float64)
