"""Repairs in order, undone by adding, with a list of what was touched."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gramoscope.preamp.declick import Declicker
from gramoscope.preamp.decrackle import Decrackler
from gramoscope.preamp.pieces import windows
from gramoscope.preamp.repair import Repair
from gramoscope.preamp.rumble import RumbleFilter
from gramoscope.quality import Quality
from gramoscope.signal_path import Cue

ALL = Repair(Declicker(), Decrackler(), RumbleFilter(80.0))


def run(repair: Repair, pieces: Any, sounds: Any) -> tuple[Any, Any, list[Cue]]:
    cues: list[Cue] = []
    pairs = list(repair.repair(pieces, cues.append))
    return sounds.whole(raw for raw, _ in pairs), sounds.whole(after for _, after in pairs), cues


@pytest.fixture
def spoilt(sounds: Any) -> Any:
    samples = sounds.with_bursts(sounds.process(12_000), [3000, 7000], length=15, height=0.05)
    flags = np.zeros(12_000, np.uint16)
    flags[7003:7006] = int(Quality.SPARSE)
    flags[9000:9500] = int(Quality.INTERPOLATED)
    return sounds.audio(samples, flags=flags)


def test_nothing_asked_is_nothing_done(sounds: Any, spoilt: Any) -> None:
    raw, after, cues = run(Repair(), [spoilt], sounds)
    sounds.same(raw, spoilt)
    sounds.same(after, spoilt)
    assert not Repair().asked
    assert [cue.kind for cue in cues] == ["interpolated"]


@pytest.mark.parametrize("places", [(1, 3003), (2999, 3005, 7010, 9100), tuple(range(0, 12_000, 500))])
def test_sound_and_cues_do_not_depend_on_the_pieces(sounds: Any, spoilt: Any, places: tuple[int, ...]) -> None:
    raw, after, cues = run(ALL, sounds.cut(spoilt, *places), sounds)
    _, once, same_cues = run(ALL, [spoilt], sounds)
    sounds.same(raw, spoilt)
    sounds.same(after, once)
    key = [(cue.kind, cue.start_sample, cue.stop_sample, cue.reason) for cue in cues]
    assert sorted(key) == sorted((c.kind, c.start_sample, c.stop_sample, c.reason) for c in same_cues)


def test_the_steps_are_taken_in_order(sounds: Any, spoilt: Any) -> None:
    _, after, _ = run(ALL, [spoilt], sounds)
    first = sounds.whole(ALL.declick.declick([spoilt]))
    second = sounds.whole(ALL.decrackle.decrackle([first]))
    sounds.same(after, sounds.whole(ALL.rumble.take_off([second])))
    assert ALL.history == (ALL.declick.history_line, ALL.decrackle.history_line, ALL.rumble.history_line)
    assert ALL.asked


def test_a_cue_says_where_what_and_why(sounds: Any, spoilt: Any) -> None:
    raw, after, cues = run(Repair(declick=Declicker()), [spoilt], sounds)
    first, second = (cue for cue in cues if cue.kind == "declick")
    part = slice(first.start_sample - spoilt.start_sample, first.stop_sample - spoilt.start_sample)
    change = (raw.samples - after.samples)[part]
    assert np.all(after.flags[part] & Quality.DECLICKED)
    assert first.peak_change_m_s == pytest.approx(np.abs(change).max())
    assert first.rms_change_m_s == pytest.approx(np.sqrt(np.mean(change**2)))
    assert first.change_db == pytest.approx(10 * np.log10(np.mean(change**2) / np.mean(raw.samples[part] ** 2)))
    assert first.reason == f"{np.max(np.abs(change) / after.sigma[part]):.1f} standard errors"
    assert second.reason.endswith("standard errors, flagged sparse")
    assert first.start_s == first.start_sample / 96_000
    touched = np.flatnonzero(raw.samples != after.samples) + spoilt.start_sample
    assert all(any(cue.start_sample <= n < cue.stop_sample for cue in (first, second)) for n in touched)


def test_rumble_is_one_cue_for_the_whole_and_a_gap_is_one_for_itself(sounds: Any, spoilt: Any) -> None:
    _, _, cues = run(Repair(rumble=RumbleFilter(80.0)), sounds.cut(spoilt, 100, 9200), sounds)
    spans = {cue.kind: (cue.start_sample, cue.stop_sample, cue.reason) for cue in cues}
    assert spans["rumble"] == (7, 12_007, "asked for")
    assert spans["interpolated"][:2] == (9007, 9507)
    assert spans["interpolated"][2].endswith("flagged interpolated")
    assert len(cues) == 2


@pytest.mark.parametrize("start", [0, 7, 640, 1000])
def test_windows_lie_at_multiples_of_the_block_whatever_the_pieces(sounds: Any, start: int) -> None:
    sound = sounds.audio(np.arange(5000.0), start=start)
    whole = list(windows([sound], block=640, margin=320))
    for cut in ((1, 639, 640, 641), (2500,), tuple(range(0, 5000, 333))):
        parts = list(windows(sounds.cut(sound, *cut), block=640, margin=320))
        assert len(parts) == len(whole)
        for one, other in zip(whole, parts, strict=True):
            sounds.same(one.audio, other.audio)
            assert (one.start, one.stop) == (other.start, other.stop)
    assert all(window.start == 320 for window in whole[2:])
    assert all(window.audio.samples.size == 1280 for window in whole[2:-2])
    blocks = sounds.whole(window.block for window in whole)
    sounds.same(blocks, sound)
    assert all(window.block.start_sample % 640 == 0 for window in whole[1:])


def test_memory_stays_bounded(sounds: Any) -> None:
    piece = sounds.audio(sounds.process(2000), start=0)
    taken = 0

    def endless() -> Any:
        nonlocal taken
        while taken < 300:
            yield replace(piece, start_sample=2000 * taken)
            taken += 1

    pairs = ALL.repair(endless(), lambda cue: None)
    raw, _ = next(pairs)
    assert raw.start_sample == 0
    assert 2000 * taken < 60_000
