"""What lies on the record: how far the groove winds at each place, and how fast it would move under a stylus.

The sound's own time belongs to a place through the nominal rotation and the wow with which it was cut. The velocity of the
groove is slope × nominal groove speed: what a perfect player hears, wow included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import FloatArray
from gramoscope.disc.cutting import Cutting
from gramoscope.turntable.rotation import Rotation
from gramoscope.turntable.wow import Wow


@dataclass(frozen=True, eq=False)
class Passage:
    """A stretch of modulated groove; arrays have the lateral motion first, the vertical one second."""

    cutting: Cutting
    rotation: Rotation
    wow: Wow

    def displacement_m(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return displacement at the places s, shape (2, …): towards +l, and towards +z."""
        return np.stack(self.cutting.displacement_at(self._sound_time_s(arc_m)))

    def slope(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return da/ds and dh/ds at the places s, shape (2, …)."""
        return self.velocity_m_s(arc_m) / self.rotation.speed_at_m_s(arc_m)

    def velocity_m_s(self, arc_m: npt.ArrayLike) -> FloatArray:
        """Return the velocity of the groove at nominal speed, shape (2, …)."""
        velocity = np.stack(self.cutting.velocity_at(self._sound_time_s(arc_m)))
        return np.asarray(velocity * self.wow.rate(self.rotation.time_of_arc_s(arc_m)))

    def _sound_time_s(self, arc_m: npt.ArrayLike) -> FloatArray:
        return self.wow.sound_time_s(self.rotation.time_of_arc_s(arc_m))
