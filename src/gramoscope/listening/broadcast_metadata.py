"""What a Broadcast Wave file says of itself: the `bext` chunk, its coding history, its UMID, and the INFO list.

`bext` version 2 has fields of fixed size in ASCII, so accents are dropped there and other letters become question marks; the
INFO list keeps them, in UTF-8. Everything but the loudness is known before the first sample.

References
----------
EBU Tech 3285 v2 (2011), Broadcast Wave. EBU R98 (1999), CodingHistory. SMPTE ST 330 (2011), UMID. Microsoft, RIFF (1991), INFO.
"""

from __future__ import annotations

import re
import struct
import unicodedata
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime

from gramoscope.errors import require
from gramoscope.listening.loudness import Loudness

DESCRIPTION, ORIGINATOR, REFERENCE = 256, 32, 32
"""Longest texts, in characters."""
UMID_BYTES = 64
NOT_MEASURED = 0x7FFF
"""What stands for a loudness that was not measured, or does not fit (EBU Tech 3285 v2, 2.4)."""
_BEXT = struct.Struct("<256s32s32s10s8sQH64s5h180s")
_VERSION = 2
_NAMESPACE = uuid.UUID("6d0f2b8e-5a4c-5b0e-9d0a-6c6f7a1c8d11")


@dataclass(frozen=True)
class CodingStep:
    """One generation of a sound: a line of the coding history.

    Parameters
    ----------
    algorithm : str
        "ANALOGUE" or "PCM".
    mode : str
        "mono", "stereo", or "dual-mono" for channels that belong to no loudspeakers.
    text : str
        How it was made. Commas, which separate the fields, become semicolons.
    rate_hz, bits : int, optional
        Of a digital generation.
    """

    algorithm: str
    mode: str
    text: str
    rate_hz: int | None = None
    bits: int | None = None

    def line(self) -> str:
        """Return the line without its end, e.g. ``A=PCM,F=96000,W=24,M=mono,T=Gramoscope 0.1.0; flat``."""
        text = " ".join(ascii_text(self.text).replace(",", ";").split())
        fields = {"A": self.algorithm, "F": self.rate_hz, "W": self.bits, "M": self.mode, "T": text}
        return ",".join(f"{name}={value}" for name, value in fields.items() if value is not None)


@dataclass(frozen=True)
class BroadcastMetadata:
    """What a sound file says of itself; texts that are left out stay empty.

    Parameters
    ----------
    description : str
        What it is, 256 characters at the most.
    originator : str
        Who made it: the name of the archive, 32 characters at the most.
    originator_reference : str
        What the originator calls it, 32 characters at the most.
    made : datetime, optional
        When the sound was made; written as it is, without its zone.
    time_reference : int
        Number of the first sample, counted from midnight.
    coding_history : tuple of CodingStep
        Oldest first.
    umid : bytes
        64 bytes, see `basic_umid`; zeros for none.
    info : mapping of str to str
        Four-letter names of the INFO list (``INAM``, ``IART``) to texts.

    Raises
    ------
    ArgumentError
        If a text is too long for its field, or a name is none.
    """

    description: str = ""
    originator: str = ""
    originator_reference: str = ""
    made: datetime | None = None
    time_reference: int = 0
    coding_history: tuple[CodingStep, ...] = ()
    umid: bytes = bytes(UMID_BYTES)
    info: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, text, most in (
            ("description", self.description, DESCRIPTION),
            ("originator", self.originator, ORIGINATOR),
            ("originator's reference", self.originator_reference, REFERENCE),
        ):
            length = len(ascii_text(text))
            require(length <= most, f"the {name} has {length} characters: {text!r}", f"{most} at the most", "say less")
        require(0 <= self.time_reference < 2**64, f"a time reference of {self.time_reference}", "0 samples or more")
        require(len(self.umid) == UMID_BYTES, f"a UMID of {len(self.umid)} bytes", f"{UMID_BYTES}, padded with zeros")
        strange = [name for name in self.info if not re.fullmatch("[A-Z][A-Z0-9]{3}", name)]
        require(not strange, f"the INFO names {strange}", "four capital letters each")


def ascii_text(text: str) -> str:
    """Return a text in ASCII: accents are dropped, line ends and other controls become spaces, the rest question marks."""
    plain = "".join(letter for letter in unicodedata.normalize("NFKD", text) if not unicodedata.combining(letter))
    spaced = "".join(" " if unicodedata.category(letter) == "Cc" else letter for letter in plain)
    return spaced.encode("ascii", "replace").decode("ascii")


def basic_umid(name: str, *, channels: int) -> bytes:
    """Return a basic UMID whose material number is a UUID made of a name.

    Parameters
    ----------
    name : str
        The same name gives the same UMID, and no two materials may share one.
    channels : int

    Returns
    -------
    bytes
        SMPTE ST 330: universal label (audio of one or several components; numbers generated as UUID, instance 0 without
        method), length 0x13, instance 000000, material number; padded with zeros to 64 bytes, the size of the field.
    """
    material = 0x08 if channels == 1 else 0x09
    label = bytes([0x06, 0x0A, 0x2B, 0x34, 0x01, 0x01, 0x01, 0x05, 0x01, 0x01, material, 0x20])
    return (label + bytes([0x13, 0, 0, 0]) + uuid.uuid5(_NAMESPACE, name).bytes).ljust(UMID_BYTES, b"\0")


def chunk(name: str, content: bytes) -> bytes:
    """Return a RIFF chunk: name, size, content, and a zero if its size is odd."""
    return name.encode("ascii") + struct.pack("<I", len(content)) + content + bytes(len(content) % 2)


def bext_chunk(metadata: BroadcastMetadata, loudness: Loudness | None) -> bytes:
    """Return the `bext` chunk; its size does not depend on the loudness, which is None while it is not known."""
    made = metadata.made
    measured = [NOT_MEASURED] * 5 if loudness is None else [_hundredths(value) for value in loudness.in_order()]
    fixed = _BEXT.pack(
        ascii_text(metadata.description).encode("ascii"),
        ascii_text(metadata.originator).encode("ascii"),
        ascii_text(metadata.originator_reference).encode("ascii"),
        made.strftime("%Y-%m-%d").encode("ascii") if made else b"",
        made.strftime("%H:%M:%S").encode("ascii") if made else b"",
        metadata.time_reference,
        _VERSION,
        metadata.umid,
        *measured,
        b"",
    )
    return chunk("bext", fixed + _history(metadata.coding_history))


def _history(steps: tuple[CodingStep, ...]) -> bytes:
    """The lines, one space longer if their number of characters is odd: libsndfile 1.2 trips over padding in RF64."""
    text = "\r\n".join(step.line() for step in steps)
    return f"{text}{' ' * (len(text) % 2)}\r\n".encode("ascii") if steps else b""


def _hundredths(value: float) -> int:
    return round(100 * value) if abs(value) <= 99.99 else NOT_MEASURED


def info_chunk(info: Mapping[str, str]) -> bytes:
    """Return the INFO list, each text ending in a zero byte; nothing for no text."""
    parts = [chunk(name, text.encode("utf-8") + b"\0") for name, text in info.items() if text]
    return chunk("LIST", b"INFO" + b"".join(parts)) if parts else b""
