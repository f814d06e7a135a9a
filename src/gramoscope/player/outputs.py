"""The files of a transfer: all of them, or none."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from matplotlib.figure import Figure

from gramoscope.errors import OutputError
from gramoscope.interruption import ctrl_c_waits
from gramoscope.listening.broadcast_metadata import BroadcastMetadata
from gramoscope.listening.ink import save_png
from gramoscope.listening.report import json_text
from gramoscope.listening.whole_file import create_temporary, put_in_place, temporary_sibling, written_whole
from gramoscope.player.cue_list import CUES, LABELS, CueList
from gramoscope.player.track_file import TrackFile, files_of
from gramoscope.player.tracks import EQUALISED, FLAT, REPAIR_TRACKS, VERTICAL, WALLS, Track
from gramoscope.signal_path import Audio

REPORT, PAGE, PICTURE = "report.json", "report.html", "groove.png"
_STEMS = {Path(name).stem for name in (REPORT, PAGE, PICTURE, CUES, LABELS)} | {
    Path(track.name).stem for track in (FLAT, WALLS, VERTICAL, EQUALISED, *REPAIR_TRACKS)
}
GROOVES, EDGES, GROOVE_LABELS = "grooves.csv", "edges.npz", "grooves.txt"
BESIDE = (GROOVES, EDGES, GROOVE_LABELS)
"""Files that only the photographs of grooves have beside their sound."""
Piece = TypeVar("Piece")


def remove_left_over(folder: Path) -> None:
    """Remove the temporary files of transfers into a folder that were killed; only while nobody else works there."""
    for path in folder.glob(".*.part"):
        maker = path.suffixes[-2:-1]
        if path.name.split(".")[1] in _STEMS and maker != [f".{os.getpid()}"]:
            path.unlink(missing_ok=True)


class Outputs:
    """Writes the files of a transfer into a folder; use it in a `with` statement.

    Sound grows in temporary files. At the end of the block everything is put under its name, the report last; a block
    that fails, or is interrupted, leaves nothing behind, and an earlier transfer in the same folder as it was. One that is
    killed leaves temporary files (valid ones), or some of the final files, each whole, and no report.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    tracks : mapping of Track to BroadcastMetadata
        The sound files, and what each says of itself. With those of a repair there are lists of what it touched, `cues`.
    rate_hz : float
    full_scale_m_s : float
        The velocity that is ±1 in every file.
    flac : bool
        Write every sound as FLAC too.

    Raises
    ------
    OutputError
        If something cannot be written.
    """

    def __init__(
        self,
        folder: Path,
        tracks: Mapping[Track, BroadcastMetadata],
        *,
        rate_hz: float,
        full_scale_m_s: float,
        flac: bool = False,
    ) -> None:
        self.folder = folder
        self._tracks = tracks
        self._rate_hz, self._full_scale_m_s, self._flac = rate_hz, full_scale_m_s, flac
        self._files: dict[Track, TrackFile] = {}
        self.cues: CueList | None = None
        self._beside: list[Path] = []
        self._made: list[Path] = []

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as undo:
            with ctrl_c_waits():
                undo.callback(self._remove_made)
                self._make_folder()
                for track, metadata in self._tracks.items():
                    self._files[track] = TrackFile(
                        self.folder,
                        track,
                        metadata,
                        rate_hz=self._rate_hz,
                        full_scale_m_s=self._full_scale_m_s,
                        flac=self._flac,
                    )
                    undo.callback(self._files[track].discard)
                if set(REPAIR_TRACKS) & set(self._tracks):
                    self.cues = CueList(self.folder, rate_hz=self._rate_hz)
            undo.pop_all()
        return self

    def kept(
        self, track: Track, pieces: Iterable[Piece], channels: Callable[[Piece], Sequence[Audio]]
    ) -> Iterator[Piece]:
        """Write pieces into a track as they pass by.

        Parameters
        ----------
        track : Track
            One of those that were given.
        pieces : iterable
        channels : callable
            Returns the sounds that a piece is in the file, one for each channel.

        Yields
        ------
        The pieces as they came.
        """
        for piece in pieces:
            self._files[track].write(channels(piece))
            yield piece

    def beside(self, name: str) -> Path:
        """Return where to write a file that is put in place with the sound; one of `BESIDE`."""
        path = self.folder / name
        self._beside.append(path)
        return create_temporary(path)

    def complete(self) -> dict[str, Any]:
        """Finish all sound under temporary names; return what became of each file, for the report."""
        for file in self._files.values():
            file.complete()
        if self.cues is not None:
            self.cues.finish()
        return {track.name: file.as_dict() for track, file in self._files.items()}

    def finish(self, report: Mapping[str, Any], picture: Figure, page: str) -> None:
        """Complete everything under temporary names, then put all of it in place."""
        text = json_text(report)
        self.complete()
        with contextlib.ExitStack() as holding, contextlib.ExitStack() as parts:
            report_part, page_part, picture_part = (
                parts.enter_context(written_whole(self.folder / name)) for name in (REPORT, PAGE, PICTURE)
            )
            report_part.write_text(text, encoding="utf-8")
            page_part.write_text(page, encoding="utf-8")
            save_png(picture, picture_part)
            holding.enter_context(ctrl_c_waits())
            # nothing large is left to do: from here on an old transfer makes way. Whoever sees a report sees a whole
            # transfer, so the old one goes first and the new one comes last, when the block ends
            for name in (REPORT, PAGE):
                (self.folder / name).unlink(missing_ok=True)
            self._retire_older()
            for file in self._files.values():
                file.commit()
            if self.cues is not None:
                self.cues.commit()
            for path in self._beside:
                put_in_place(temporary_sibling(path), path)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for file in self._files.values():
            file.discard()
        if self.cues is not None:
            self.cues.discard()
        for path in self._beside:
            temporary_sibling(path).unlink(missing_ok=True)
        if kind is not None:
            self._remove_made()

    def _retire_older(self) -> None:
        """Take away what an earlier transfer left and this one does not replace."""
        for file in self._files.values():
            file.retire_older()
        for track in set(REPAIR_TRACKS) - set(self._files):
            for path in files_of(self.folder, track):
                path.unlink(missing_ok=True)
        if self.cues is None:
            for name in (CUES, LABELS):
                (self.folder / name).unlink(missing_ok=True)
        for name in BESIDE:
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
