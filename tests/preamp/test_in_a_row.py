"""Passages one after the other."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from gramoscope.preamp.in_a_row import in_a_row
from gramoscope.preamp.pieces import part_of
from gramoscope.quality import Quality, no_flags
from gramoscope.signal_path import Audio, GrooveSound

RATE_HZ = 8000.0


def passage(length: int, level: float, cuts: tuple[int, ...] = ()) -> list[GrooveSound]:
    audio = Audio(0, RATE_HZ, level + np.arange(length, dtype=np.float64), np.ones(length), no_flags(length), ("h",))
    edges = (0, *cuts, length)
    parts = [part_of(audio, start, stop) for start, stop in pairwise(edges)]
    return [GrooveSound(part, part) for part in parts]


def whole(sounds: list[GrooveSound]) -> Audio:
    starts = [sound.lateral.start_sample for sound in sounds]
    sizes = [sound.lateral.samples.size for sound in sounds]
    assert starts == [0, *np.cumsum(sizes)[:-1]]
    parts = [sound.lateral for sound in sounds]
    return Audio(
        0,
        RATE_HZ,
        np.concatenate([part.samples for part in parts]),
        np.concatenate([part.sigma for part in parts]),
        np.concatenate([part.flags for part in parts]),
    )


def test_one_passage_stays_as_it_is() -> None:
    pieces = passage(50, 1.0, (7, 30))
    assert all(a is b for a, b in zip(in_a_row([pieces], silence_samples=9), pieces, strict=True))


@pytest.mark.parametrize("cuts", [(), (3,), (1, 2, 17)])
def test_silence_lies_between_and_is_flagged(cuts: tuple[int, ...]) -> None:
    told: list[tuple[int, int, int]] = []
    passages = [passage(20, 100.0, cuts), passage(0, 0.0), passage(30, 200.0, cuts)]
    sound = whole(list(in_a_row(passages, silence_samples=5, told=lambda *span: told.append(span))))
    assert np.array_equal(sound.samples, [*(100.0 + np.arange(20)), *np.zeros(5), *(200.0 + np.arange(30))])
    silent = (sound.flags & np.uint16(Quality.SILENCE)) != 0
    assert np.array_equal(np.flatnonzero(silent), np.arange(20, 25))
    assert np.all(sound.flags[silent] & np.uint16(Quality.INTERPOLATED))
    assert np.array_equal(np.isnan(sound.sigma), silent)
    assert told[0] == (0, 0, 20)
    assert told[2] == (2, 25, 55)


def test_passages_are_asked_for_one_at_a_time() -> None:
    begun: list[int] = []

    def passages():
        for number in range(3):
            begun.append(number)
            yield passage(4, 0.0)

    stream = in_a_row(passages(), silence_samples=2)
    next(stream)
    assert begun == [0]
