"""Lists of cues: which spans of a sound were touched, for machines and for Audacity.

`cues.json` is

    {"format": "gramoscope-cues/1", "rate_hz": …, "cues": [
    {"kind": …, "start_sample": …, "stop_sample": …, "start_s": …, "stop_s": …, "peak_change_m_s": …, "rms_change_m_s": …,
     "change_db": …, "reason": …},
    …
    ]}

with a cue on each line; null stands for what is not known. `labels.txt` is what Audacity imports as a label track: a line
``start <tab> stop <tab> text`` for each cue, in seconds with six digits.
"""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import TextIO

from gramoscope.errors import require
from gramoscope.listening.report import plain
from gramoscope.listening.whole_file import create_temporary, output_error, put_in_place
from gramoscope.signal_path import Cue

CUES_FORMAT = "gramoscope-cues/1"


def json_line(cue: Cue) -> str:
    """Return a cue as a line of JSON."""
    values = {
        "kind": cue.kind,
        "start_sample": cue.start_sample,
        "stop_sample": cue.stop_sample,
        "start_s": cue.start_s,
        "stop_s": cue.stop_s,
        "peak_change_m_s": cue.peak_change_m_s,
        "rms_change_m_s": cue.rms_change_m_s,
        "change_db": cue.change_db,
        "reason": cue.reason,
    }
    return json.dumps(plain(values), ensure_ascii=False, allow_nan=False)


def label_line(cue: Cue) -> str:
    """Return a cue as a line of an Audacity label track."""
    words = f"{cue.kind}: {cue.reason}" if cue.reason else cue.kind
    return f"{cue.start_s:.6f}\t{cue.stop_s:.6f}\t{' '.join(words.split())}"


class CueWriter:
    """Two files that grow cue by cue and appear under their names only when they are whole.

    `finish`, `commit` and `discard` as for `gramoscope.listening.broadcast_wave.WavWriter`.

    Parameters
    ----------
    json_path, labels_path : Path
    rate_hz : float
        Of the sound.

    Raises
    ------
    OutputError
        If a file cannot be created or, later, written.
    """

    def __init__(self, json_path: Path, labels_path: Path, *, rate_hz: float) -> None:
        self._paths = (json_path, labels_path)
        self._rate_hz = rate_hz
        self.cues_written = 0
        self._temporaries: list[Path] = []
        self._files: list[TextIO] = []
        self._state = "open"
        try:
            for path in self._paths:
                self._temporaries.append(create_temporary(path))
                self._files.append(self._temporaries[-1].open("w", encoding="utf-8"))
        except BaseException:
            self.discard()
            raise
        self._put(json.dumps({"format": CUES_FORMAT, "rate_hz": rate_hz})[:-1] + ', "cues": [', "")

    def write(self, cue: Cue) -> None:
        """Append a cue."""
        require(self._state == "open", f"{self._paths[0]} is {self._state}", "an open list")
        require(cue.rate_hz == self._rate_hz, f"a cue at {cue.rate_hz:g} Hz", f"one at {self._rate_hz:g} Hz")
        self._put(("," if self.cues_written else "") + "\n" + json_line(cue), label_line(cue) + "\n")
        self.cues_written += 1

    def finish(self) -> None:
        """Complete the files under their temporary names. Does nothing the second time."""
        if self._state != "open":
            return
        self._put("\n]}\n", "")
        self._state = "finished"
        try:
            for file in self._files:
                file.close()
        except OSError as error:
            self.discard()
            raise output_error(self._paths[0], error.strerror or str(error), number=error.errno) from error

    def commit(self) -> None:
        """Complete the files and put them in their places. Does nothing the second time."""
        if self._state == "committed":
            return
        require(self._state != "discarded", f"{self._paths[0]} was discarded", "a list that was not")
        self.finish()
        for temporary, path in zip(self._temporaries, self._paths, strict=True):
            put_in_place(temporary, path)
        self._state = "committed"

    def discard(self) -> None:
        """Remove every trace of files that were not committed; what was there before remains."""
        if self._state in ("committed", "discarded"):
            return
        self._state = "discarded"
        for file in self._files:
            with contextlib.suppress(OSError):  # its last block may not fit the disk either, and it goes away below
                file.close()
        for temporary in self._temporaries:
            temporary.unlink(missing_ok=True)

    def _put(self, *texts: str) -> None:
        try:
            for file, text in zip(self._files, texts, strict=True):
                file.write(text)
        except OSError as error:
            self.discard()
            raise output_error(self._paths[0], error.strerror or str(error), number=error.errno) from error
