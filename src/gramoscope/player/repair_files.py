"""The files of a repair, beside those of the transfer: what is left, what was taken off, and where."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from gramoscope.listening.cues import CUES_FORMAT, CueWriter
from gramoscope.listening.reversible import reversible
from gramoscope.listening.wav import WavWriter
from gramoscope.preamp.repair import Repair
from gramoscope.signal_path import Audio, Cue

REPAIRED, DIFFERENCE, CUES, LABELS = REPAIR_FILES = ("repaired.wav", "difference.wav", "cues.json", "labels.txt")


class RepairFiles:
    """Writes the files of a repair; `finish`, `commit` and `discard` as for `gramoscope.listening.wav.WavWriter`.

    Parameters
    ----------
    folder : Path
        Must exist.
    rate_hz : float

    Raises
    ------
    OutputError
        If something cannot be written.
    """

    def __init__(self, folder: Path, *, rate_hz: float) -> None:
        self._spans: dict[str, int] = {}
        self._touched: dict[str, int] = {}
        self._rate_hz = rate_hz
        with contextlib.ExitStack() as undo:
            self.repaired = WavWriter(folder / REPAIRED, rate_hz=rate_hz)
            undo.callback(self.repaired.discard)
            self.difference = WavWriter(folder / DIFFERENCE, rate_hz=rate_hz)
            undo.callback(self.difference.discard)
            self._cues = CueWriter(folder / CUES, folder / LABELS, rate_hz=rate_hz)
            undo.pop_all()
        self._parts = (self.repaired, self.difference, self._cues)

    def write(self, raw: Audio, repaired: Audio) -> None:
        """Append a piece of sound, as it came and as it is now."""
        left, taken = reversible(raw.samples, repaired.samples, full_scale_m_s=self.repaired.full_scale_m_s)
        self.repaired.write(left)
        self.difference.write(taken)

    def note(self, cue: Cue) -> None:
        """Append a touched span to the lists."""
        self._cues.write(cue)
        self._spans[cue.kind] = self._spans.get(cue.kind, 0) + 1
        self._touched[cue.kind] = self._touched.get(cue.kind, 0) + cue.stop_sample - cue.start_sample

    def finish(self) -> None:
        """Complete the files under temporary names."""
        for part in self._parts:
            part.finish()

    def commit(self) -> None:
        """Put the files in place."""
        for part in self._parts:
            part.commit()

    def discard(self) -> None:
        """Remove every trace of files that were not committed."""
        for part in self._parts:
            part.discard()

    def as_dict(self, repair: Repair) -> dict[str, Any]:
        """Return what was done, for the report."""
        return {
            "history": list(repair.history),
            "spans": dict(self._spans),
            "seconds": {kind: samples / self._rate_hz for kind, samples in self._touched.items()},
        }

    def files(self) -> dict[str, Any]:
        """Return what the files are, for the report."""
        return {
            REPAIRED: {
                "what": "flat.wav after repair, not equalised",
                "full_scale_m_s": self.repaired.full_scale_m_s,
                "clipped_samples": self.repaired.clipped_samples,
            },
            DIFFERENCE: {
                "what": "what was taken off: as whole numbers, repaired.wav + difference.wav = flat.wav",
                "full_scale_m_s": self.difference.full_scale_m_s,
            },
            CUES: {"what": "every span that was touched or never measured", "format": CUES_FORMAT},
            LABELS: {"what": "the same as labels for Audacity"},
        }
