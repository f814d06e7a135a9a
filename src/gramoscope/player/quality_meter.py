"""The statement of quality, gathered while the sound streams by: spectra, shares along time, agreement of the walls."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.listening.bands import Bands, band_power, octaves, third_octaves, usable_to_hz
from gramoscope.listening.spectrum_meter import SpectrumMeter, segment_for
from gramoscope.player.strip_chart import STRIP_POINTS, StripChart
from gramoscope.player.wall_agreement import WallAgreement
from gramoscope.player.worst_groups import Doubtful, WorstGroups
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import Audio, GrooveMotion, WallTrace
from gramoscope.tonearm.course import Course

LEAST_DB = (0.0, 10.0)
"""Signal-to-noise ratios up to which the bandwidth is told."""


class QualityMeter:
    """Watches a transfer, in memory that does not grow with it.

    Parameters
    ----------
    course : Course
        Of the groove.
    cut : {"lateral", "vertical", "stereo"}
    rate_hz : float
        Of the sound.
    passband : float
        Share of the Nyquist rate that the resampler passes: bands end there.
    samples : float
        How long the sound will be, nominally.
    """

    def __init__(self, course: Course, cut: Cut, *, rate_hz: float, passband: float, samples: float) -> None:
        self._rate_hz, self._highest_hz = rate_hz, passband * rate_hz / 2
        self._rotation = course.rotation
        self._direction = 0 if course.direction == "lateral" else 1
        self._spectrum = SpectrumMeter(rate_hz, segment_for(samples))
        self._strip = StripChart(max(1, int(np.ceil(samples / STRIP_POINTS))))
        self._walls = WallAgreement(course) if cut != "stereo" else None
        self._error_sum: FloatArray | None = None
        self._error_frequency_hz: FloatArray = np.empty(0)
        self._error_samples = 0
        self.worst = WorstGroups()

    def picked_up(self, trace: WallTrace) -> None:
        """Take note of a stretch that the pickup has read."""
        self.worst.add(trace)
        if self._walls is not None:
            self._walls.add(trace)

    def followed(self, pieces: Iterable[GrooveMotion]) -> Iterator[GrooveMotion]:
        """Take note of the tonearm's pieces as they pass by."""
        for piece in pieces:
            if piece.error_spectrum is not None:
                density = piece.error_spectrum.samples * piece.error_spectrum.density[self._direction]
                self._error_sum = density if self._error_sum is None else self._error_sum + density
                self._error_frequency_hz = piece.error_spectrum.frequency_hz
                self._error_samples += piece.error_spectrum.samples
            yield piece

    def heard(self, piece: Audio) -> None:
        """Take note of a piece of the flat transfer."""
        measured = (piece.flags & np.uint16(NOT_MEASURED)) == 0
        self._spectrum.add(piece.samples, measured)
        self._strip.add(piece)

    def shares(self) -> dict[str, float]:
        """Return which share of the sound was measured, bridged, missing."""
        return self._strip.shares()

    def as_dict(self) -> dict[str, Any]:
        """Return the figures, for the report."""
        return {
            "along_time": self._strip.as_dict(self._rate_hz),
            "spectrum": self._spectra(),
            "wall_agreement": self._walls.as_dict() if self._walls is not None else None,
            "worst_groups": [self._told(group) for group in self.worst.worst_first()],
        }

    def _told(self, group: Doubtful) -> dict[str, Any]:
        return {
            "group": group.number,
            "at_s": float(self._rotation.time_of_arc_s(max(group.arc_start_m, 0.0))),
            "unread": group.unread,
            "place_sigma_um": 1e6 * group.sigma_m,
        }

    def _spectra(self) -> dict[str, Any]:
        frequency_hz, density = self._spectrum.density()
        error, scale = self._error_density()
        sound = (frequency_hz, density)
        thirds = third_octaves(self._highest_hz)
        told = _by_band(thirds, sound, (self._error_frequency_hz, error))
        ratio_db = told["signal_to_noise_db"]
        return {
            "segment_samples": round(self._rate_hz / self._spectrum.step_hz),
            "segments": {"used": self._spectrum.segments, "left_out": self._spectrum.left_out},
            "octaves": _by_band(octaves(self._highest_hz), sound, (self._error_frequency_hz, error)),
            "third_octaves": told,
            "usable_to_hz": {f"{least:g}_db": usable_to_hz(thirds, ratio_db, least_db=least) for least in LEAST_DB},
            "error_density": {"frequency_hz": self._error_frequency_hz, "density_m2_s2_per_hz": error},
            "error_bars_over_model": scale,
        }

    def _error_density(self) -> tuple[FloatArray, float]:
        """The density of the claimed error, with the power of the error bars, and that power over the model's own."""
        if self._error_sum is None or not self._error_samples:
            return np.full(self._error_frequency_hz.size, np.nan), float("nan")
        density, f = self._error_sum / self._error_samples, self._error_frequency_hz
        power = float(np.sum((density[1:] + density[:-1]) / 2 * np.diff(f)))
        scale = self._strip.mean_variance() / power if power > 0 else float("nan")
        return scale * density, scale


def _by_band(
    bands: Bands, sound: tuple[FloatArray, FloatArray], error: tuple[FloatArray, FloatArray]
) -> dict[str, FloatArray]:
    heard = band_power(*sound, bands)
    noise = band_power(*error, bands) if error[0].size else np.full(heard.size, np.nan)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio_db = 10 * np.log10(heard / noise)
    return {
        "centre_hz": bands.centre_hz,
        "sound_rms_cm_s": 100 * np.sqrt(heard),
        "error_rms_cm_s": 100 * np.sqrt(noise),
        "signal_to_noise_db": ratio_db,
    }
