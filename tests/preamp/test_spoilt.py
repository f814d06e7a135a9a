"""What lies under a click, and whose click it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from gramoscope.preamp.autoregression import precision
from gramoscope.preamp.click_removal import CLICK_CORNER_HZ, under_clicks
from gramoscope.preamp.click_search import Process
from gramoscope.preamp.pieces import windows
from gramoscope.preamp.spoilt import findings, marks_of, repaired, runs_of
from gramoscope.quality import Quality

LENGTH = 40


def known_process(sounds: Any, count: int) -> Process:
    a = sounds.coefficients
    return Process(a, precision(a, count), np.correlate(a, a, "full"), np.full(count, sounds.scale_m_s))


def low_passed_noise(count: int, seed: int, rate_hz: float) -> np.ndarray:
    pole = np.exp(-2 * np.pi * CLICK_CORNER_HZ / rate_hz)
    noise = np.random.default_rng(seed).standard_normal(count + 200)
    return lfilter([1.0], [1.0, -2 * pole, pole**2], noise)[200:]


@pytest.mark.parametrize("strength", [0.3, 3.0, 100.0])
def test_errors_under_weak_and_strong_clicks_are_as_claimed_and_smaller_than_either_way_alone(
    sounds: Any, strength: float
) -> None:
    x = sounds.process(40_000, seed=21)
    unknown = (np.arange(100, 39_800, 200)[:, np.newaxis] + np.arange(LENGTH)).ravel()
    spoilt = x.copy()
    spoilt[unknown] += strength * sounds.scale_m_s * low_passed_noise(unknown.size, 5, sounds.rate_hz)
    process = known_process(sounds, x.size)
    every = np.ones(unknown.size, bool)
    mean, sigma = under_clicks(process, spoilt, unknown, seen=every, rate_hz=sounds.rate_hz)
    blank, _ = under_clicks(process, spoilt, unknown, seen=~every, rate_hz=sounds.rate_hz)
    error = np.std(mean - x[unknown])
    assert np.std((mean - x[unknown]) / sigma) == pytest.approx(1, abs=0.15)
    assert error < 1.02 * min(np.std(blank - x[unknown]), np.std((spoilt - x)[unknown]))


def test_a_run_belongs_to_the_block_in_which_it_begins(sounds: Any) -> None:
    sound = sounds.audio(sounds.process(2000), start=0)
    _, second, _ = windows([sound], block=800, margin=300)
    marks = np.zeros(second.audio.samples.size, bool)
    marks[295:305] = marks[400:410] = marks[500:560] = marks[1095:1110] = marks[1105:1120] = marks[1150:1160] = True
    found = findings(second, known_process(sounds, marks.size), marks, longest=40)
    assert found.runs == [range(900, 910), range(1595, 1620)]
    assert runs_of(marks_of(runs_of(marks), marks.size)) == runs_of(marks)


def test_a_click_in_the_next_block_spoils_no_repair_in_this_one(sounds: Any) -> None:
    x = sounds.process(2400, seed=22)
    spoilt = x.copy()
    spoilt[785:795] += 0.1
    spoilt[802:812] -= 0.2
    found = []
    for window in windows([sounds.audio(spoilt, start=0)], block=800, margin=300):
        runs = [
            run for run in (range(785, 795), range(802, 812)) if run.start // 800 == window.block.start_sample // 800
        ]
        marks = marks_of(
            [range(r.start - window.audio.start_sample, r.stop - window.audio.start_sample) for r in runs], 1400
        )
        process = known_process(sounds, window.audio.samples.size)
        found.append(findings(window, process, marks[: window.audio.samples.size], longest=40))
    after = sounds.whole(repaired(found, flag=Quality.DECLICKED, history_line="mended"))
    touched = np.flatnonzero(after.flags)
    assert touched.tolist() == [*range(785, 795), *range(802, 812)]
    assert np.all(np.abs(after.samples - x)[touched] < 4.5 * after.sigma[touched])
    assert after.history[-1] == "mended"
