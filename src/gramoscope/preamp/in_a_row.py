"""Several passages in one sound: one after the other, with a short silence between."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from gramoscope.quality import Quality
from gramoscope.signal_path import Audio, GrooveSound


def in_a_row(
    passages: Iterable[Iterable[GrooveSound]],
    *,
    silence_samples: int,
    told: Callable[[int, int, int], None] | None = None,
) -> Iterator[GrooveSound]:
    """Return the sound of passages one after the other.

    Parameters
    ----------
    passages : iterable of iterables of GrooveSound
        Each passage in pieces that follow each other, from sample 0. They are asked for one at a time.
    silence_samples : int
        Between two passages; flagged `SILENCE | INTERPOLATED`, with NaN for sigma: nobody measured anything there.
    told : callable, optional
        Told the number of a passage, its first sample, and the first after its last, when it is over.

    Yields
    ------
    GrooveSound
        Of one passage alone, the pieces as they came.
    """
    done = 0
    for number, passage in enumerate(passages):
        silence = silence_samples if done else 0
        start = done + silence
        for piece in passage:
            if silence:
                if not piece.lateral.samples.size:
                    continue
                yield _silence(piece, done, silence)
                silence = 0
            yield _later(piece, start)
            done = start + piece.lateral.start_sample + piece.lateral.samples.size
        if told is not None:
            told(number, min(start, done), done)


def _later(piece: GrooveSound, samples: int) -> GrooveSound:
    if samples == 0:
        return piece
    lateral, vertical = (
        replace(audio, start_sample=audio.start_sample + samples) for audio in (piece.lateral, piece.vertical)
    )
    return GrooveSound(lateral, vertical)


def _silence(like: GrooveSound, start_sample: int, samples: int) -> GrooveSound:
    def silent(audio: Audio) -> Audio:
        flags = np.full(samples, np.uint16(Quality.SILENCE | Quality.INTERPOLATED), np.uint16)
        return replace(
            audio, start_sample=start_sample, samples=np.zeros(samples), sigma=np.full(samples, np.nan), flags=flags
        )

    return GrooveSound(silent(like.lateral), silent(like.vertical))
