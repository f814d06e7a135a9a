"""Sound in pieces: what every part of the preamp asks of them, so that cutting a passage differently changes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from gramoscope.errors import require
from gramoscope.quality import Quality
from gramoscope.signal_path import Audio


def in_order(pieces: Iterable[Audio]) -> Iterator[Audio]:
    """Yield the pieces as they come, and see to it that each begins where the last one ended.

    Raises
    ------
    ArgumentError
        At the first piece that does not, or that has another rate.
    """
    before: Audio | None = None
    for piece in pieces:
        if before is not None:
            end = before.start_sample + before.samples.size
            require(
                piece.rate_hz == before.rate_hz,
                f"a piece at {piece.rate_hz:g} Hz after one at {before.rate_hz:g} Hz",
                "one rate throughout",
            )
            require(
                piece.start_sample == end,
                f"a piece that starts at sample {piece.start_sample}",
                f"one that starts at {end}, where the last one ended",
            )
        before = piece
        yield piece


def without_nan(piece: Audio) -> Audio:
    """Return the piece with 0 for NaN samples, flagged `INTERPOLATED`: a NaN would live in a recursive filter for ever."""
    missing = np.isnan(piece.samples)
    flags = np.where(missing, piece.flags | np.uint16(Quality.INTERPOLATED), piece.flags).astype(np.uint16)
    return replace(piece, samples=np.where(missing, 0.0, piece.samples), flags=flags)
