"""How far is a recording characteristic, played or cut, from its analogue curve? Ours, sox and ffmpeg, by the same measurement.

    python -m benchmarks.accuracy.equalisation

An impulse goes through each filter at each rate; its spectrum is held against the analytic curve in every quarter of a hertz
from 20 Hz to 20 kHz, and the largest difference of level counts. Nothing is scaled: all three are meant to be 0 dB at
1 kHz. The page beside this file is written anew; a program that is not installed, or refuses a rate, is said to.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import soundfile

from benchmarks.accuracy.table import line_of
from gramoscope.conventions import FloatArray
from gramoscope.disc.characteristic_filter import AUDIO_BAND_HZ, playback_filter, recording_filter
from gramoscope.disc.characteristics import CHARACTERISTICS, Characteristic, ComplexArray, characteristic

PAGE = Path(__file__).with_suffix(".md")
RATES_HZ = (44_100, 48_000, 88_200, 96_000, 176_400, 192_000)
BOUNDS_DB = (0.05, 0.02, 0.02, 0.02, 0.02, 0.02)
"""What we promise at each rate."""
SECONDS = 4
"""A curve without a shelf rings with the time constant of the bass limit, a third of a second."""
IMPULSE_S = 0.1
IMPULSE = 0.25
"""Small enough for a program that clips."""

FREE_ENTRIES = ("0N-30", "50N-0.1", "50S5-30", "300S70-16", "300R-12.7", "700N-10", "5000N-24", "5000S100-30")
"""Some that stand in no table, and the limits of what may be entered."""

FFMPEG_TYPES = {"riaa": "riaa", "col": "columbia-lp", "bsi": "iec-78", "emi": "500S70-12.3"}
"""Those of its curves that have a shelf, a turnover and a roll-off, and what they are called here."""

Filter = Callable[[FloatArray, int], FloatArray]
"""Samples and rate in, as many samples out."""


class RefusedError(Exception):
    """A program does not do this, and says why."""


def worst_error_db(through: Filter, response: Callable[[FloatArray], ComplexArray], rate_hz: int) -> float:
    """Return the largest difference of level between a filter and a curve, 20 Hz … 20 kHz."""
    impulse = np.zeros(SECONDS * rate_hz)
    impulse[round(IMPULSE_S * rate_hz)] = IMPULSE
    frequency = np.fft.rfftfreq(impulse.size, 1 / rate_hz)
    heard = (frequency >= AUDIO_BAND_HZ[0]) & (frequency <= AUDIO_BAND_HZ[1])
    level = np.abs(np.fft.rfft(through(impulse, rate_hz))[heard]) / IMPULSE
    return float(np.max(np.abs(20 * np.log10(level / np.abs(response(frequency[heard]))))))


def ours(curve: Characteristic, *, cutting: bool) -> tuple[Filter, Callable[[FloatArray], ComplexArray]]:
    design = recording_filter if cutting else playback_filter
    response = curve.recording_response if cutting else curve.playback_response
    return lambda samples, rate_hz: design(curve, rate_hz=rate_hz).apply(samples), response


def sox(samples: FloatArray, rate_hz: int) -> FloatArray:
    return _by_program(["sox", "-D", "{in}", "-b", "32", "-e", "floating-point", "{out}", "riaa"], samples, rate_hz)


def ffmpeg(kind: str) -> Filter:
    effect = f"aemphasis=type={kind}:mode=reproduction"
    command = ["ffmpeg", "-y", "-v", "error", "-i", "{in}", "-af", effect, "-c:a", "pcm_f32le", "{out}"]
    return lambda samples, rate_hz: _by_program(command, samples, rate_hz)


def _by_program(command: Sequence[str], samples: FloatArray, rate_hz: int) -> FloatArray:
    if shutil.which(command[0]) is None:
        raise RefusedError("not installed")
    with tempfile.TemporaryDirectory() as folder:
        files = {"{in}": f"{folder}/in.wav", "{out}": f"{folder}/out.wav"}
        soundfile.write(files["{in}"], samples, rate_hz, subtype="FLOAT")
        call = [files.get(word, word) for word in command]
        if subprocess.run(call, capture_output=True, check=False).returncode:
            raise RefusedError("refused")
        return np.asarray(soundfile.read(files["{out}"])[0], np.float64)


def version_of(program: str) -> str:
    """Return the first words of what a program says of its version."""
    if shutil.which(program) is None:
        return f"{program} not installed"
    option = "-version" if program == "ffmpeg" else "--version"
    said = subprocess.run([program, option], capture_output=True, text=True, check=False).stdout
    return " ".join(said.splitlines()[0].split(" Copyright")[0].split())


def our_rows(*, cutting: bool) -> Iterator[list[str]]:
    curves = [*CHARACTERISTICS, *map(characteristic, FREE_ENTRIES)]
    for curve in curves:
        through, response = ours(curve, cutting=cutting)
        yield [curve.title, *(f"{worst_error_db(through, response, rate):.4f}" for rate in RATES_HZ)]


def peer_rows() -> Iterator[list[str]]:
    for name in ("riaa", *(name for name in FFMPEG_TYPES.values() if name != "riaa")):
        curve = characteristic(name)
        filters = {"ours": ours(curve, cutting=False)[0], **({"sox `riaa`": sox} if name == "riaa" else {})}
        filters |= {f"ffmpeg `{kind}`": ffmpeg(kind) for kind, theirs in FFMPEG_TYPES.items() if theirs == name}
        for who, through in filters.items():
            yield [curve.title, who, *(_cell(through, curve, rate) for rate in RATES_HZ)]


def _cell(through: Filter, curve: Characteristic, rate_hz: int) -> str:
    try:
        return f"{worst_error_db(through, curve.playback_response, rate_hz):.4f}"
    except RefusedError as reason:
        return str(reason)


def page(playback: list[list[str]], cutting: list[list[str]], peers: list[list[str]]) -> str:
    rates = [f"{rate / 1e3:g} kHz" for rate in RATES_HZ]
    promise = ["*promised*", *(f"{bound:g}" for bound in BOUNDS_DB)]
    parts = [
        "# Recording characteristics against their analogue curves\n",
        "    python -m benchmarks.accuracy.equalisation\n",
        f"Largest error of level in dB, 20 Hz … 20 kHz, of an impulse's spectrum against the analytic curve. "
        f"{version_of('sox')}; {version_of('ffmpeg')}.\n",
        "What is left of ours is the bass limit of curves without a shelf (0.003 dB at 20 Hz) and, at 44.1 kHz, the fit "
        "near 20 kHz.\n",
        "## Ours and other programs, playing\n",
        _table(["curve", "by", *rates], peers),
        "## Every curve of ours, playing\n",
        _table(["curve", *rates], [promise, *playback]),
        "## Every curve of ours, cutting (the simulator)\n",
        _table(["curve", *rates], [promise, *cutting]),
    ]
    return "\n".join(parts).rstrip() + "\n"


def _table(heads: list[str], rows: list[list[str]]) -> str:
    return "\n".join([line_of(heads), "|" + "---|" * len(heads), *map(line_of, rows)]) + "\n"


def main() -> int:
    playback, cutting = list(our_rows(cutting=False)), list(our_rows(cutting=True))
    PAGE.write_text(page(playback, cutting, list(peer_rows())), "utf-8")
    kept = all(
        float(cell) <= bound for row in (*playback, *cutting) for cell, bound in zip(row[1:], BOUNDS_DB, strict=True)
    )
    print(PAGE.read_text("utf-8"))
    print("the promise is", "kept" if kept else "BROKEN")
    return 0 if kept else 1


if __name__ == "__main__":
    raise SystemExit(main())
