"""Sound in pieces: what every part of the preamp asks of them, so that cutting a passage differently changes nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

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


def part_of(piece: Audio, start: int, stop: int | None) -> Audio:
    """Return the samples start … stop of a piece, counted from its first."""
    part = slice(start, stop)
    return replace(
        piece,
        start_sample=piece.start_sample + start,
        samples=piece.samples[part],
        sigma=piece.sigma[part],
        flags=piece.flags[part],
    )


def joined(first: Audio, second: Audio) -> Audio:
    """Return two pieces that follow each other as one, with the history of the first."""
    return replace(
        first,
        samples=np.concatenate([first.samples, second.samples]),
        sigma=np.concatenate([first.sigma, second.sigma]),
        flags=np.concatenate([first.flags, second.flags]),
    )


def side_by_side(first: Iterable[Audio], second: Iterable[Audio]) -> Iterator[tuple[Audio, Audio]]:
    """Yield two streams of the same passage in pairs of pieces of the same samples, however each was cut."""
    others = iter(second)
    rest: Audio | None = None
    for piece in first:
        left = piece
        while left.samples.size:
            if rest is None or not rest.samples.size:
                rest = next(others)
            count = min(left.samples.size, rest.samples.size)
            if count:
                yield part_of(left, 0, count), part_of(rest, 0, count)
            left, rest = part_of(left, count, None), part_of(rest, count, None)
    for _ in others:  # whoever makes the second stream may have something left to do at its end
        pass


@dataclass(frozen=True, eq=False)
class Window:
    """A block of a passage with what surrounds it.

    Attributes
    ----------
    audio : Audio
        The block and up to so many samples before and after it, fewer at the ends of the passage.
    start, stop : int
        Where the block lies in `audio`.
    """

    audio: Audio
    start: int
    stop: int

    @property
    def block(self) -> Audio:
        """The block alone."""
        return part_of(self.audio, self.start, self.stop)


def windows(pieces: Iterable[Audio], *, block: int, margin: int) -> Iterator[Window]:
    """Yield a passage block by block, each with its surroundings.

    Parameters
    ----------
    pieces : iterable of Audio
        Following each other without gap, at one rate.
    block : int
        Samples. Blocks begin at multiples of it, by the number of the sample, whatever the pieces.
    margin : int
        So many samples before and after a block, at the most.

    Yields
    ------
    Window
        Blocks follow each other without gap; the first and the last may be shorter.

    Raises
    ------
    ArgumentError
        As `in_order`.
    """
    stock: Audio | None = None
    done = 0
    for piece in in_order(pieces):
        if stock is None:
            stock, done = piece, piece.start_sample
        else:
            stock = joined(stock, piece)
        while (stop := (done // block + 1) * block) + margin <= _end(stock):
            yield _window(stock, done, stop, margin)
            done, stock = stop, part_of(stock, max(0, stop - margin - stock.start_sample), None)
    while stock is not None and done < _end(stock):
        stop = min((done // block + 1) * block, _end(stock))
        yield _window(stock, done, stop, margin)
        done = stop


def _window(stock: Audio, start: int, stop: int, margin: int) -> Window:
    first = max(start - margin - stock.start_sample, 0)
    audio = part_of(stock, first, min(stop + margin, _end(stock)) - stock.start_sample)
    return Window(audio, start - audio.start_sample, stop - audio.start_sample)


def _end(piece: Audio) -> int:
    return piece.start_sample + piece.samples.size
