"""Whether both walls say the same of the direction that the cut uses.

Both walls of a lateral groove move together, of a vertical one apart. What each wall alone says is compared as a bend, the
change of velocity over `BEND_M` (50 µm of groove), so that neither the constant of each wall nor warp has a part in it. If
both say the same up to the errors that they claim, the square of the difference over its variance is one by the mean: more
is motion across the cut (pinch, dirt, a wall worn by itself) or an error that is claimed too small. The walls of a stereo
record have nothing to say of each other.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import WallTrace
from gramoscope.tonearm.course import Course
from gramoscope.tonearm.groove_prior import BEND_M

FAR = 5.0
"""Standard errors."""


class WallAgreement:
    """Sums over a transfer.

    Parameters
    ----------
    course : Course
        Of what direction the walls are asked.
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self._count = self._far = 0
        self._sums = np.zeros(7)

    def add(self, trace: WallTrace) -> None:
        """Take in a stretch."""
        lag = max(int(np.rint(BEND_M / trace.arc_step_m)), 1)
        seen = np.isfinite(trace.offset_m) & ((trace.flags & np.uint16(NOT_MEASURED)) == 0)
        if trace.offset_m.shape[1] <= 2 * lag or not seen.all(axis=0).any():
            return
        speed = float(self._course.rotation.speed_at_m_s(max(trace.arc_start_m, 0.0)))
        scale = speed / (lag * trace.arc_step_m) / self._gains()
        place, variance = (np.where(seen, values, np.nan) for values in (trace.offset_m, trace.offset_sigma_m**2))
        bend = scale[:, None] * _weighted(place, lag, (1.0, -2.0, 1.0))
        spread = (scale**2)[:, None] * _weighted(variance, lag, (1.0, 4.0, 1.0))
        both = np.isfinite(bend).all(axis=0) & np.isfinite(spread).all(axis=0)
        self._take(bend[:, both], spread[:, both].sum(axis=0))

    def _gains(self) -> FloatArray:
        return np.ones(2) if self._course.direction == "lateral" else self._course.gains

    def _take(self, bend: FloatArray, expected: FloatArray) -> None:
        x, y = bend[INNER], bend[OUTER]
        away = (y - x) ** 2
        self._count += x.size
        self._far += int(np.count_nonzero(away > FAR**2 * expected))
        parts = (x, y, x * x, y * y, x * y, away / expected, 1 / expected)
        self._sums += [float(part.sum()) for part in parts]

    def as_dict(self) -> dict[str, Any] | None:
        """Return what was found, by means weighted with 1/variance; None where both walls were never read at one place."""
        if self._count == 0:
            return None
        x, y, xx, yy, xy, chi, information = self._sums / self._count
        spread = np.sqrt(max(xx - x * x, 0.0) * max(yy - y * y, 0.0))
        return {
            "samples": self._count,
            "rms_difference_cm_s": 100 * float(np.sqrt(chi / information)),
            "expected_difference_cm_s": 100 * float(1 / np.sqrt(information)),
            "chi_squared_per_sample": float(chi),
            "share_beyond_5_sigma": self._far / self._count,
            "correlation": float((xy - x * y) / spread) if spread > 0 else float("nan"),
        }


def _weighted(values: FloatArray, lag: int, weights: tuple[float, float, float]) -> FloatArray:
    before, here, after = values[:, : -2 * lag], values[:, lag:-lag], values[:, 2 * lag :]
    return np.asarray(weights[0] * before + weights[1] * here + weights[2] * after)
