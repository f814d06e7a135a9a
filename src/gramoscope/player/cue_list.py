"""What a repair did, span by span: the lists beside the sound, and the sums of the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gramoscope.listening.cues import CUES_FORMAT, CueWriter
from gramoscope.preamp.repair import Repair
from gramoscope.signal_path import Cue

CUES, LABELS = "cues.json", "labels.txt"


class CueList:
    """Writes `cues.json` and `labels.txt`; `finish`, `commit` and `discard` as for `listening.cues.CueWriter`.

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
        self._writer = CueWriter(folder / CUES, folder / LABELS, rate_hz=rate_hz)
        self.finish, self.commit, self.discard = self._writer.finish, self._writer.commit, self._writer.discard

    def note(self, cue: Cue) -> None:
        """Append a touched span to the lists."""
        self._writer.write(cue)
        self._spans[cue.kind] = self._spans.get(cue.kind, 0) + 1
        self._touched[cue.kind] = self._touched.get(cue.kind, 0) + cue.stop_sample - cue.start_sample

    def as_dict(self, repair: Repair) -> dict[str, Any]:
        """Return what was done, for the report."""
        return {
            "history": list(repair.history),
            "spans": dict(self._spans),
            "seconds": {kind: samples / self._rate_hz for kind, samples in self._touched.items()},
            "cues": {"name": CUES, "format": CUES_FORMAT, "labels": LABELS},
        }
