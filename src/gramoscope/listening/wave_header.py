"""The header of a Broadcast Wave file: everything before the samples.

A RIFF file counts its bytes in 32 bits and ends at 4 GB. Room for 64-bit counts is kept at its very start, as a `JUNK` chunk
of 28 bytes; a file that outgrows RIFF changes its name to RF64 and that chunk into `ds64`, where the true sizes stand. So the
header of a file keeps its length whatever becomes of the file, and can be written again over itself at any moment.

    RIFF or RF64 · JUNK or ds64 · bext · fmt · fact (floats only) · LIST INFO · data

References
----------
EBU Tech 3285 v2 (2011), Broadcast Wave. EBU Tech 3306 v1.1 (2009), RF64.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from gramoscope.errors import require
from gramoscope.listening.broadcast_metadata import BroadcastMetadata, bext_chunk, chunk, info_chunk
from gramoscope.listening.loudness import Loudness
from gramoscope.listening.sample_format import SampleFormat

RIFF_LIMIT_BYTES = 2**32 - 2
"""The largest size that a RIFF file can state: the next one, all ones, says "see ds64"."""
_SEE_DS64 = 0xFFFFFFFF
_DS64 = struct.Struct("<QQQI")
_PCM, _FLOAT = 1, 3


@dataclass(frozen=True)
class WaveHeader:
    """What does not change while a file grows.

    Parameters
    ----------
    rate_hz : int
    channels : int
        1 … 1024.
    sample_format : SampleFormat
    metadata : BroadcastMetadata
    riff_limit_bytes : int
        A file whose stated size would be larger becomes RF64; smaller than the format allows only in tests.
    """

    rate_hz: int
    channels: int
    sample_format: SampleFormat
    metadata: BroadcastMetadata
    riff_limit_bytes: int = RIFF_LIMIT_BYTES

    def __post_init__(self) -> None:
        require(1 <= self.rate_hz < 2**32, f"a rate of {self.rate_hz} Hz", "a positive one of 32 bits")
        require(1 <= self.channels <= 1024, f"{self.channels} channels", "1 … 1024")
        require(
            0 <= self.riff_limit_bytes <= RIFF_LIMIT_BYTES,
            f"RIFF files of {self.riff_limit_bytes} bytes",
            f"{RIFF_LIMIT_BYTES} at the most",
        )

    @property
    def frame_bytes(self) -> int:
        """Bytes of one sample of all channels."""
        return self.channels * self.sample_format.bits // 8

    def written(self, frames: int, loudness: Loudness | None = None) -> bytes:
        """Return the header of a file of so many samples a channel; always of the same length.

        The chunk of samples is taken to be padded to an even number of bytes.
        """
        data_bytes = frames * self.frame_bytes
        middle = bext_chunk(self.metadata, loudness) + self._format() + self._fact(frames)
        middle += info_chunk(self.metadata.info)
        riff_bytes = 4 + 8 + _DS64.size + len(middle) + 8 + data_bytes + data_bytes % 2
        if riff_bytes <= self.riff_limit_bytes:
            start = b"RIFF" + struct.pack("<I", riff_bytes) + b"WAVE" + chunk("JUNK", bytes(_DS64.size))
            return start + middle + b"data" + struct.pack("<I", data_bytes)
        sizes = chunk("ds64", _DS64.pack(riff_bytes, data_bytes, frames, 0))
        start = b"RF64" + struct.pack("<I", _SEE_DS64) + b"WAVE" + sizes
        return start + middle + b"data" + struct.pack("<I", _SEE_DS64)

    def _format(self) -> bytes:
        floats, bits = self.sample_format.is_float, self.sample_format.bits
        bytes_a_second = min(self.rate_hz * self.frame_bytes, _SEE_DS64)
        kind = _FLOAT if floats else _PCM
        content = struct.pack("<HHIIHH", kind, self.channels, self.rate_hz, bytes_a_second, self.frame_bytes, bits)
        return chunk("fmt ", content + bytes(2 if floats else 0))

    def _fact(self, frames: int) -> bytes:
        """How many samples there are: asked for in all files that are not of whole numbers."""
        return chunk("fact", struct.pack("<I", min(frames, _SEE_DS64))) if self.sample_format.is_float else b""
