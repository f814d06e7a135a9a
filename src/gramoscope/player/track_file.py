"""One sound file of a transfer, with what lies beside it: its sum, and the same as FLAC if that is wanted."""

from __future__ import annotations

import errno
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from gramoscope.apparatus.fingerprint import sha256_of_file
from gramoscope.listening.broadcast_metadata import BroadcastMetadata
from gramoscope.listening.broadcast_wave import WavWriter
from gramoscope.listening.flac import write_flac
from gramoscope.listening.whole_file import create_temporary, output_error, put_in_place, temporary_sibling
from gramoscope.player.tracks import Track
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import Audio


def sum_beside(path: Path) -> Path:
    """Return the name of the file that holds another one's SHA-256, as `sha256sum --check` reads it."""
    return path.with_name(f"{path.name}.sha256")


def files_of(folder: Path, track: Track) -> tuple[Path, ...]:
    """Return all files that a track may have: sound, FLAC, and the sum of each."""
    wav = folder / track.name
    flac = wav.with_suffix(".flac")
    return wav, sum_beside(wav), flac, sum_beside(flac)


class TrackFile:
    """Writes one track under temporary names, and puts it in place with its sum.

    Parameters
    ----------
    folder : Path
    track : Track
    metadata : BroadcastMetadata
    rate_hz, full_scale_m_s : float
    flac : bool

    Raises
    ------
    OutputError
        If a file cannot be created, or a folder has its name.
    """

    def __init__(
        self,
        folder: Path,
        track: Track,
        metadata: BroadcastMetadata,
        *,
        rate_hz: float,
        full_scale_m_s: float,
        flac: bool,
    ) -> None:
        self.track = track
        self.wav = folder / track.name
        self.flac = self.wav.with_suffix(".flac") if flac else None
        self._beside = files_of(folder, track)[1:]
        for path in self._beside:
            # found out now, and not when hours of reading are done
            if path.is_dir():
                raise output_error(path, os.strerror(errno.EISDIR), number=errno.EISDIR)
        self._interpolated = np.zeros(len(track.channels), np.int64)
        self._sums: dict[Path, str] = {}
        self._writer = WavWriter(
            self.wav, rate_hz=rate_hz, channels=len(track.channels), full_scale_m_s=full_scale_m_s, metadata=metadata
        )

    def write(self, channels: Sequence[Audio]) -> None:
        """Append a piece, one sound for each channel."""
        self._writer.write(np.column_stack([channel.samples for channel in channels]))
        self._interpolated += [np.count_nonzero(channel.flags & np.uint16(NOT_MEASURED)) for channel in channels]

    def complete(self) -> None:
        """Finish everything under temporary names; does nothing the second time.

        Raises
        ------
        OutputError
            If the disk is full.
        """
        if self._sums:
            return
        self._writer.finish()
        self._add_up(self.wav)
        if self.flac is not None:
            part = create_temporary(self.flac)
            try:
                write_flac(self._writer.temporary, part, self._writer.metadata)
            except OSError as error:
                raise output_error(self.flac, error.strerror or str(error), number=error.errno) from error
            self._add_up(self.flac)

    def _add_up(self, path: Path) -> None:
        digest = sha256_of_file(temporary_sibling(path))
        beside = sum_beside(path)
        if not digest:
            raise output_error(path, "it cannot be read again")
        try:
            with create_temporary(beside).open("wb") as file:
                file.write(f"{digest}  {path.name}\n".encode())
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise output_error(beside, error.strerror or str(error), number=error.errno) from error
        self._sums[path] = digest

    def retire_older(self) -> None:
        """Take away what an earlier transfer left beside its file, so that no sum stands beside another file."""
        for path in self._beside:
            path.unlink(missing_ok=True)

    def commit(self) -> None:
        """Put everything in place, each sum after its file."""
        self.complete()
        self._writer.commit()
        for path in self._sums:
            if path != self.wav:
                put_in_place(temporary_sibling(path), path)
            put_in_place(temporary_sibling(sum_beside(path)), sum_beside(path))

    def discard(self) -> None:
        """Remove every trace of what was not committed."""
        self._writer.discard()
        for path in self._beside:
            temporary_sibling(path).unlink(missing_ok=True)

    def as_dict(self) -> dict[str, Any]:
        """Return what became of the track, for the report; its sums once it is complete."""
        writer, loudness = self._writer, self._writer.loudness()
        said = {
            "what": self.track.what,
            "channels": list(self.track.channels),
            "full_scale_m_s": writer.full_scale_m_s,
            "bits": writer.sample_format.bits,
            "samples": writer.samples_written,
            "clipped_samples": writer.clipped_samples,
            "interpolated_samples": dict(zip(self.track.channels, self._interpolated.tolist(), strict=True)),
            "loudness": {name: round(value, 2) for name, value in vars(loudness).items()},
            "description": writer.metadata.description,
            "coding_history": [step.line() for step in writer.metadata.coding_history],
            "sha256": self._sums.get(self.wav),
        }
        if self.flac is None:
            return said
        return {**said, "flac": {"name": self.flac.name, "sha256": self._sums.get(self.flac)}}
