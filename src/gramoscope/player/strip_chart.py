"""How a passage fares along time: what was measured, bridged or missing, by flags, and how large the errors are."""

from __future__ import annotations

from typing import Any

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.quality import NOT_MEASURED, Quality
from gramoscope.signal_path import Audio

NO_FILM = Quality.FRAME_LOST | Quality.DARK | Quality.SATURATED
"""Causes that lie in the film, not in the groove."""
STRIP_POINTS = 240
_MEASURED, _BRIDGED, _MISSING, _POWER, _NOISE = range(5)
_FLAGS = tuple(Quality)


class StripChart:
    """Counts over runs of `samples_per_point` samples, whatever the pieces they come in.

    A sample is *measured* if it does not carry `INTERPOLATED`; it is *missing* if there is no film of it (`NO_FILM`), and
    *bridged* if there is and the groove was not seen on it. Both are filled in.
    """

    def __init__(self, samples_per_point: int) -> None:
        self.samples_per_point = samples_per_point
        self._points: list[FloatArray] = []
        self._rest = np.empty((3, 0))

    def add(self, piece: Audio) -> None:
        """Take in the next piece."""
        columns = np.concatenate([self._rest, [piece.samples, piece.sigma, piece.flags]], axis=1)
        n = self.samples_per_point
        whole = columns.shape[1] // n * n
        for start in range(0, whole, n):
            self._points.append(_counts(columns[:, start : start + n]))
        self._rest = columns[:, whole:]

    def as_dict(self, rate_hz: float) -> dict[str, Any]:
        """Return the chart as shares and root mean squares; flags that never occur are left out."""
        points, size = self._all()
        share = points / size[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            noise = points[:, _NOISE] / points[:, _MEASURED]
        flags = {
            str(flag.name).lower(): _short(share[:, 5 + i]) for i, flag in enumerate(_FLAGS) if points[:, 5 + i].any()
        }
        return {
            "step_s": self.samples_per_point / rate_hz,
            "measured": _short(share[:, _MEASURED]),
            "bridged": _short(share[:, _BRIDGED]),
            "missing": _short(share[:, _MISSING]),
            "rms_cm_s": _short(100 * np.sqrt(share[:, _POWER])),
            "sigma_rms_cm_s": _short(100 * np.sqrt(noise)),
            "flags": flags,
        }

    def shares(self) -> dict[str, float]:
        """Return the shares of the whole passage; NaN before anything came."""
        points, size = self._all()
        total = float(size.sum()) or float("nan")
        names = (("measured", _MEASURED), ("bridged", _BRIDGED), ("missing", _MISSING))
        return {name: float(points[:, i].sum()) / total for name, i in names}

    def mean_variance(self) -> float:
        """Return the mean of sigma², (m/s)², where the groove was measured; NaN where it never was."""
        points, _ = self._all()
        measured = float(points[:, _MEASURED].sum())
        return float(points[:, _NOISE].sum()) / measured if measured else float("nan")

    def _all(self) -> tuple[FloatArray, FloatArray]:
        """What was counted in each run, and how many samples it has; the last run may be short."""
        rest = [_counts(self._rest)] if self._rest.size else []
        points = np.array([*self._points, *rest], np.float64).reshape(-1, 5 + len(_FLAGS))
        size = np.full(len(points), self.samples_per_point, np.float64)
        if rest:
            size[-1] = self._rest.shape[1]
        return points, size


def _short(values: FloatArray) -> list[float]:
    """Five digits that count are enough for a chart."""
    return [float(f"{value:.5g}") for value in values]


def _counts(columns: FloatArray) -> FloatArray:
    samples, sigma, flags = columns[0], columns[1], columns[2].astype(np.uint16)
    filled = (flags & np.uint16(NOT_MEASURED)) != 0
    missing = filled & ((flags & np.uint16(NO_FILM)) != 0)
    told = np.where(filled | np.isnan(sigma), 0.0, sigma)
    by_flag = [np.count_nonzero(flags & np.uint16(flag)) for flag in _FLAGS]
    counts = (np.count_nonzero(~filled), np.count_nonzero(filled & ~missing), np.count_nonzero(missing))
    return np.array([*counts, np.sum(samples**2), np.sum(told**2), *by_flag], np.float64)
