"""Hints at the true speed that lie in the sound itself. They are told, and never acted on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gramoscope.listening.mains_hum import HumFinding, HumListener
from gramoscope.listening.tuning import TuningFinding, TuningListener
from gramoscope.signal_path import Audio


@dataclass
class Hints:
    """Listens to the flat transfer for clocks.

    Parameters
    ----------
    rpm : float or None
        The speed at which it plays; None for one that changes, of which only the factor is told.
    rate_hz : float
    """

    rpm: float | None
    rate_hz: float

    def __post_init__(self) -> None:
        self._hum, self._tuning = HumListener(self.rate_hz), TuningListener(self.rate_hz)

    def hear(self, piece: Audio) -> None:
        """Take in the next piece."""
        self._hum.hear(piece)
        self._tuning.hear(piece)

    def as_dict(self) -> dict[str, Any]:
        """Return what the report says of them."""
        hum, tuning = self._hum.finding(), self._tuning.finding()
        return {"mains_hum": self._of_hum(hum), "tuning": self._of_tuning(tuning)}

    def _of_hum(self, found: HumFinding) -> dict[str, Any]:
        if found.reason is not None:
            return {"line_hz": None, "reason": found.reason}
        relative = found.sigma_hz / found.line_hz
        factors = {mains: mains / found.line_hz for mains in found.mains_hz()}
        turns = " or ".join(f"{self._turning(each, relative)} ({mains:g} Hz)" for mains, each in factors.items())
        return {
            "line_hz": found.line_hz,
            "sigma_hz": found.sigma_hz,
            "harmonics": found.harmonics,
            "above_surroundings_db": found.above_surroundings_db,
            "speeds": [
                {"mains_hz": mains, "factor": each, "sigma_factor": each * relative, **self._rpm(each, relative)}
                for mains, each in factors.items()
            ],
            "words": (
                f"a steady line at {found.line_hz:.2f} ± {found.sigma_hz:.2f} Hz; "
                f"if it was mains hum, the record should turn {turns}"
            ),
            "reason": None,
        }

    def _turning(self, factor: float, relative: float) -> str:
        if self.rpm is None:
            return f"{factor:.4f} ± {factor * relative:.4f} times as fast"
        return f"at {self.rpm * factor:.2f} ± {self.rpm * factor * relative:.2f} rpm"

    def _rpm(self, factor: float, relative: float) -> dict[str, float]:
        return {} if self.rpm is None else {"rpm": self.rpm * factor, "sigma_rpm": self.rpm * factor * relative}

    def _of_tuning(self, found: TuningFinding) -> dict[str, Any]:
        if found.reason is not None:
            return {"cents": None, "reason": found.reason}
        factor = 1 / found.factor
        turning = f"{factor:.4f} times as fast" if self.rpm is None else f"at {self.rpm * factor:.2f} rpm"
        return {
            "cents": found.cents,
            "sigma_cents": found.sigma_cents,
            "a_hz": found.a_hz,
            "partials": found.partials,
            "factor": factor,
            **({} if self.rpm is None else {"rpm": self.rpm * factor}),
            "words": (
                f"tuned {found.cents:+.1f} ± {found.sigma_cents:.1f} cents from A = 440 Hz, an A of {found.a_hz:.1f} Hz; "
                f"with an A of 440 the record should turn {turning}"
            ),
            "reason": None,
        }
