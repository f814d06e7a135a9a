"""The files of a transfer: all of them, or none."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from matplotlib.figure import Figure

from gramoscope.errors import OutputError
from gramoscope.interruption import ctrl_c_waits
from gramoscope.listening.ink import save_png
from gramoscope.listening.report import json_text
from gramoscope.listening.wav import WavWriter
from gramoscope.listening.whole_file import written_whole
from gramoscope.player.repair_files import REPAIR_FILES, RepairFiles

FLAT, EQUALISED, REPORT, PICTURE = "flat.wav", "equalised.wav", "report.json", "groove.png"


class Outputs:
    """Writes the files of a transfer into a folder; use it in a `with` statement.

    Sound grows in temporary files. At the end of the block everything is put under its name, the report last; a block
    that fails, or is interrupted, leaves nothing behind, and an earlier transfer in the same folder as it was.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    rate_hz : float
    repaired : bool
        Whether there are files of a repair; `repair` is None if not.

    Raises
    ------
    OutputError
        If something cannot be written.
    """

    def __init__(self, folder: Path, *, rate_hz: float, repaired: bool = False) -> None:
        self.folder = folder
        self._rate_hz = rate_hz
        self._repaired = repaired
        self.repair: RepairFiles | None = None
        self._made: list[Path] = []

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as undo:
            with ctrl_c_waits():
                undo.callback(self._remove_made)
                self._make_folder()
                self.flat = WavWriter(self.folder / FLAT, rate_hz=self._rate_hz)
                undo.callback(self.flat.discard)
                self.equalised = WavWriter(self.folder / EQUALISED, rate_hz=self._rate_hz)
                undo.callback(self.equalised.discard)
                if self._repaired:
                    self.repair = RepairFiles(self.folder, rate_hz=self._rate_hz)
            undo.pop_all()
        return self

    def finish(self, report: Mapping[str, Any], picture: Figure) -> None:
        """Complete everything under temporary names, then put all of it in place."""
        text = json_text(report)
        self.flat.finish()
        self.equalised.finish()
        if self.repair is not None:
            self.repair.finish()
        report_whole, picture_whole = (written_whole(self.folder / name) for name in (REPORT, PICTURE))
        with contextlib.ExitStack() as holding, report_whole as report_part, picture_whole as picture_part:
            report_part.write_text(text, encoding="utf-8")
            save_png(picture, picture_part)
            holding.enter_context(ctrl_c_waits())
            # nothing large is left to do: from here on an old transfer makes way. Whoever sees a report sees a whole
            # transfer, so the old one goes first and the new one comes last, when the block ends
            (self.folder / REPORT).unlink(missing_ok=True)
            self.flat.commit()
            self.equalised.commit()
            if self.repair is not None:
                self.repair.commit()
            else:
                self._remove_older_repair()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.flat.discard()
        self.equalised.discard()
        if self.repair is not None:
            self.repair.discard()
        if kind is not None:
            self._remove_made()

    def _remove_older_repair(self) -> None:
        # a repair of another transfer would not add up with this one
        for name in REPAIR_FILES:
            with contextlib.suppress(OSError):
                (self.folder / name).unlink(missing_ok=True)

    def _make_folder(self) -> None:
        self._made = [path for path in (self.folder, *self.folder.parents) if not path.exists()]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(
                f"the folder {self.folder} cannot be made: {error.strerror}",
                "a place where a folder can be made",
                "choose another --out",
            ) from error

    def _remove_made(self) -> None:
        for path in self._made:
            with contextlib.suppress(OSError):
                path.rmdir()
