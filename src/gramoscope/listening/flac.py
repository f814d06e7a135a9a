"""FLAC: the samples of a finished WAV file, bit for bit, in about half the room.

What a WAV file says in `bext` and INFO has no exact place in FLAC; title, artist, date, program, scale and description become
Vorbis comments.
"""

from __future__ import annotations

import os
from pathlib import Path

import soundfile

from gramoscope.listening.broadcast_metadata import BroadcastMetadata

HIGHEST_RATE_HZ = 655_350
_BLOCK = 1 << 16


def write_flac(wav: Path, flac: Path, metadata: BroadcastMetadata) -> None:
    """Write the samples of a WAV file of 16 or 24 bits as FLAC, block by block.

    Parameters
    ----------
    wav, flac : Path
        The second exists already, and is filled.
    metadata : BroadcastMetadata
        Of the WAV file.

    Raises
    ------
    OSError
        If the disk is full.
    """
    try:
        with soundfile.SoundFile(wav) as source, _flac_like(source, flac) as target:
            for name, text in comments(metadata).items():
                setattr(target, name, text)
            for block in source.blocks(_BLOCK, dtype="int32", always_2d=True):
                target.write(block)
    except (soundfile.LibsndfileError, AssertionError) as error:
        # soundfile asserts that as many samples were written as were given
        reason = getattr(error, "error_string", "") or "a short write"
        raise OSError(None, reason.strip(". ")) from error
    with flac.open("r+b") as file:
        os.fsync(file.fileno())


def _flac_like(source: soundfile.SoundFile, flac: Path) -> soundfile.SoundFile:
    return soundfile.SoundFile(
        flac, "w", samplerate=source.samplerate, channels=source.channels, subtype=source.subtype, format="FLAC"
    )


def comments(metadata: BroadcastMetadata) -> dict[str, str]:
    """Return the Vorbis comments, by soundfile's names for them."""
    info = metadata.info
    said = (info.get("ICMT", ""), metadata.description, f"originator's reference {metadata.originator_reference}")
    texts = {
        "title": info.get("INAM", ""),
        "artist": info.get("IART", ""),
        "date": metadata.made.strftime("%Y-%m-%d") if metadata.made else "",
        "software": info.get("ISFT", ""),
        "comment": "; ".join(text for text in said if text),
    }
    return {name: text for name, text in texts.items() if text}
