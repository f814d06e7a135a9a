"""Repairs measured: clicks and crackle at known places in real sound, before and after, with the pickup's word and without.

    python -m benchmarks.accuracy.repair --table benchmarks/accuracy/repair.md

Peers are measured where they are installed: ffmpeg (`adeclick`).
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soundfile
import soxr

from benchmarks.accuracy.scenes import SHARED
from benchmarks.accuracy.table import Table
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.disc.characteristic_filter import recording_filter
from gramoscope.disc.characteristics import RIAA
from gramoscope.listening.wav import read_sound
from gramoscope.preamp.declick import Declicker
from gramoscope.preamp.decrackle import Decrackler
from gramoscope.quality import FlagArray, Quality, no_flags
from gramoscope.signal_path import Audio

RATE_HZ = 96_000
LEVEL_M_S, NOISE_M_S = 0.03, 3e-4
CORNER_HZ = 15_000.0
EDGE = 2000
SOUNDS = {"speech": ("speech-male.wav", 1.0), "orchestra": ("orchestra.wav", 2.0), "piano": ("piano.wav", 0.5)}
ABOUT = """# Repairs, measured

    python -m benchmarks.accuracy.repair --table benchmarks/accuracy/repair.md

Real sound of 1.2 s, cut with the RIAA characteristic at 3 cm/s rms, 96 kHz, with noise 40 dB below; clicks about every 40 ms,
bursts of noise that decay to a tenth; crackle: impulses of normally distributed heights at random. Noise and damage come
through two poles at 15 kHz, as through groove and pickup. *height*: of the peak, against the rms of the sound; of crackle, the
standard deviation of the impulses before that. Flat sound, full band, no equalising: SNR against the sound without damage but
with its noise. *found*: share of the clicks that were touched. *false a second*: touched spans further than 0.5 ms from any
damage. *sigma ÷ error*: claimed ÷ real, rms, where something was touched.

*blind* has no flags. *guided* has what a pickup might say: four clicks in five are flagged `SPARSE`, and a false flag of 0.3 ms
stands in every 40 ms. That share is an assumption. *ffmpeg* is its `adeclick`, by
overlap-save: as it comes, by overlap-add, it moves every sample, and speech without damage keeps 17 dB.
"""
COLUMNS = ("sound", "damage", "method", "SNR before dB", "after", "found", "false a second", "sigma ÷ error")


@dataclass(frozen=True)
class Damage:
    """Clicks of one length (ms) and height, or crackle of a density a second and a height; nothing if the height is 0."""

    name: str
    length_s: float = 0.0
    a_second: float = 0.0
    height: float = 0.0


DAMAGES = (
    Damage("none"),
    *(
        Damage(f"clicks {length_s * 1e3:g} ms × {height:g}", length_s=length_s, height=height)
        for length_s in (0.00005, 0.0002, 0.0005, 0.002)
        for height in (0.3, 1.0, 5.0)
    ),
    *(
        Damage(f"crackle {a_second:g} a second × {height:g}", a_second=a_second, height=height)
        for a_second in (200.0, 1000.0)
        for height in (0.3, 1.0)
    ),
)


def main() -> None:
    """Measure what is not in the table yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path)
    table = Table(parser.parse_args().table, ABOUT, COLUMNS, keys=3, order=tuple(SOUNDS))
    for sound in SOUNDS:
        for damage in DAMAGES:
            for row in _rows(sound, damage, table):
                table.add(row)
                print("  ".join(row), flush=True)


def _rows(sound: str, damage: Damage, table: Table) -> Iterator[list[str]]:
    clean = real_sound(*SOUNDS[sound])
    spoilt, places = damaged(clean, damage)
    for method, repair in _methods(damage).items():
        if repair is not None and not table.has(sound, damage.name, method):
            yield [sound, damage.name, method, *measured(clean, spoilt, places, *repair(spoilt, places))]


def real_sound(file: str, start_s: float) -> FloatArray:
    """Return a second of a recording as the velocity of a groove, with the noise of a pickup."""
    samples, rate_hz = read_sound(SHARED / "data" / "audio" / file, start_s=start_s, seconds=1.2)
    cut = recording_filter(RIAA, rate_hz=RATE_HZ).apply(soxr.resample(samples.mean(axis=1), rate_hz, RATE_HZ))
    noise = through_the_groove(np.random.default_rng(1).standard_normal(cut.size))
    return np.asarray(cut * LEVEL_M_S / np.std(cut) + noise * NOISE_M_S / np.std(noise))


def through_the_groove(samples: FloatArray) -> FloatArray:
    """Return samples after two poles run both ways."""
    frequency = np.fft.rfftfreq(samples.size, 1 / RATE_HZ)
    return np.fft.irfft(np.fft.rfft(samples) / (1 + (frequency / CORNER_HZ) ** 4), samples.size)


def damaged(clean: FloatArray, damage: Damage) -> tuple[FloatArray, list[range]]:
    """Return a sound with damage, and where it is."""
    rng, bare = np.random.default_rng(2), np.zeros(clean.size)
    height = damage.height * LEVEL_M_S
    if damage.a_second:
        struck = np.flatnonzero(rng.random(clean.size) < damage.a_second / RATE_HZ)
        bare[struck] = height * rng.standard_normal(struck.size)
        return clean + through_the_groove(bare), [range(place - 1, place + 2) for place in struck]
    length = max(round(damage.length_s * RATE_HZ), 1)
    places = [range(start, start + length) for start in range(EDGE, clean.size - EDGE - length, 3847)]
    for place in places if height else []:
        burst = rng.standard_normal(length) * np.exp(-2.3 * np.arange(length) / length)
        bare[place.start : place.stop] = height * burst / np.abs(burst).max()
    return clean + through_the_groove(bare), places if height else []


Repairer = Callable[[FloatArray, list[range]], tuple[FloatArray, FloatArray, BoolArray]]


def _methods(damage: Damage) -> dict[str, Repairer | None]:
    ffmpeg = _by_ffmpeg if shutil.which("ffmpeg") else None
    if damage.a_second:
        return {"decrackle": _decrackled, "ffmpeg": ffmpeg}
    both: dict[str, Repairer | None] = {"blind": _blind, "guided": _guided, "ffmpeg": ffmpeg}
    return both if damage.height else {**both, "decrackle": _decrackled}


def _blind(spoilt: FloatArray, places: list[range]) -> tuple[FloatArray, FloatArray, BoolArray]:
    return _joined(Declicker().declick([_audio(spoilt, no_flags(spoilt.size))]), Quality.DECLICKED)


def _guided(spoilt: FloatArray, places: list[range]) -> tuple[FloatArray, FloatArray, BoolArray]:
    rng, flags = np.random.default_rng(3), no_flags(spoilt.size)
    for place in places:
        if rng.random() < 0.8:
            flags[place.start : place.stop] = int(Quality.SPARSE)
    for start in range(EDGE + 1900, spoilt.size - EDGE, 3847):
        flags[start : start + 29] |= int(Quality.SPARSE)
    return _joined(Declicker().declick([_audio(spoilt, flags)]), Quality.DECLICKED)


def _decrackled(spoilt: FloatArray, places: list[range]) -> tuple[FloatArray, FloatArray, BoolArray]:
    return _joined(Decrackler().decrackle([_audio(spoilt, no_flags(spoilt.size))]), Quality.DECRACKLED)


def _audio(samples: FloatArray, flags: FlagArray) -> Audio:
    return Audio(0, float(RATE_HZ), samples, np.full(samples.size, NOISE_M_S), flags)


def _joined(pieces: Iterator[Audio], flag: Quality) -> tuple[FloatArray, FloatArray, BoolArray]:
    kept = list(pieces)
    flags = np.concatenate([piece.flags for piece in kept])
    samples, sigma = (np.concatenate([getattr(piece, name) for piece in kept]) for name in ("samples", "sigma"))
    return samples, sigma, (flags & np.uint16(flag)) != 0


def _by_ffmpeg(spoilt: FloatArray, places: list[range]) -> tuple[FloatArray, FloatArray, BoolArray]:
    with tempfile.TemporaryDirectory() as folder:
        before, after = Path(folder) / "before.wav", Path(folder) / "after.wav"
        soundfile.write(before, spoilt / 0.5, RATE_HZ, subtype="DOUBLE")
        command = ["ffmpeg", "-loglevel", "error", "-i", before, "-af", "adeclick=m=s", "-c:a", "pcm_f64le", after]
        subprocess.run(command, check=True)
        samples = 0.5 * soundfile.read(after)[0]
    # it may end a window early or late
    whole = np.concatenate([samples, spoilt[samples.size :]])[: spoilt.size]
    touched = np.abs(whole - spoilt) > 1e-9
    return whole, np.full(spoilt.size, np.nan), touched


def measured(
    clean: FloatArray, spoilt: FloatArray, places: list[range], after: FloatArray, sigma: FloatArray, touched: BoolArray
) -> list[str]:
    """Return the figures of a row."""
    inside = slice(EDGE // 2, -EDGE // 2)
    snr = [_snr_db(clean[inside], sound[inside]) for sound in (spoilt, after)]
    near = np.zeros(clean.size, np.bool_)
    for place in places:
        near[max(place.start - 48, 0) : place.stop + 48] = True
    false = np.count_nonzero(np.diff((touched & ~near)[inside].astype(np.int8)) > 0) / (clean.size / RATE_HZ)
    found = np.mean([touched[place.start : place.stop].any() for place in places]) if places else np.nan
    error, claimed = (values[inside][touched[inside]] for values in (after - clean, sigma))
    ratio = np.sqrt(np.mean(claimed**2) / np.mean(error**2)) if error.any() else np.nan
    return [*map(_decimal, snr), _decimal(found, 2), _decimal(false), _decimal(ratio, 2)]


def _snr_db(clean: FloatArray, sound: FloatArray) -> float:
    error = float(np.sum((sound - clean) ** 2))
    return float(10 * np.log10(np.sum(clean**2) / error)) if error else float("inf")


def _decimal(number: float, digits: int = 1) -> str:
    return f"{number:.{digits}f}" if np.isfinite(number) else "–" if np.isnan(number) else "untouched"


if __name__ == "__main__":
    main()
