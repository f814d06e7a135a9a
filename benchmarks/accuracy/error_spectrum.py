"""The claimed error beside the real one, octave by octave, of simulated captures whose truth is known.

    python -m benchmarks.accuracy.error_spectrum CAPTURE … --out DIR

plays each with the recipe `best` and prints claimed error ÷ real error of each octave, root mean squares. Gain and delay of
the copy are taken out, as `gramoscope compare` does, and what was bridged is left out.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import welch

from gramoscope.apparatus.capture import open_capture
from gramoscope.conventions import FloatArray
from gramoscope.listening.bands import band_power, octaves
from gramoscope.listening.truth import load_for_comparison, truth_sound
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe

TRIM = 96
"""Samples at either end, where the error is that of an end."""


def real_error_cm_s(capture: Path, played: Path) -> FloatArray:
    """Return the rms of the error of `flat.wav` in each octave of its report, NaN where it cannot be told."""
    report = json.loads((played / "report.json").read_text(encoding="utf-8"))
    heard, rate_hz = load_for_comparison(played / "flat.wav")
    true = truth_sound(capture / "truth.npz", rate_hz=rate_hz, cut="stronger")
    size = min(len(heard), len(true))
    error, seen = aligned_error(heard[:size, 0], true[:size]), _measured(report, size)
    error, share = (error * seen)[TRIM:-TRIM], float(seen[TRIM:-TRIM].mean())
    segment = report["quality"]["spectrum"]["segment_samples"]
    frequency_hz, density = welch(error, rate_hz, nperseg=min(segment, error.size))
    bands = octaves(1.42 * max(report["quality"]["spectrum"]["octaves"]["centre_hz"]))
    return 100 * np.sqrt(band_power(frequency_hz, density / share, bands))


def aligned_error(heard: FloatArray, true: FloatArray) -> FloatArray:
    """Return what is left of a sound when the truth, with the gain and the small delay that suit it best, is taken off."""
    known = np.stack([true, np.gradient(true)])[:, TRIM:-TRIM]
    gain, delay = np.linalg.lstsq(known.T, heard[TRIM:-TRIM], rcond=None)[0]
    return np.asarray(heard - gain * true - delay * np.gradient(true))


def _measured(report: dict[str, Any], size: int) -> FloatArray:
    """1 where all samples of a point of the strip chart were measured, else 0."""
    along = report["quality"]["along_time"]
    run = round(along["step_s"] * report["rate_hz"])
    return np.repeat(np.array(along["measured"]) == 1, run)[:size].astype(np.float64)


def ratios(capture: Path, played: Path) -> dict[float, float]:
    """Return claimed ÷ real error by octave."""
    said: dict[str, Any] = json.loads((played / "report.json").read_text(encoding="utf-8"))["quality"]["spectrum"]
    claimed = np.array(said["octaves"]["error_rms_cm_s"], np.float64)
    real = real_error_cm_s(capture, played)
    centre = said["octaves"]["centre_hz"]
    return {f: float(c / r) for f, c, r in zip(centre, claimed, real, strict=True) if np.isfinite(c / r)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("captures", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    for capture in arguments.captures:
        played = arguments.out / capture.name
        if not (played / "report.json").exists():
            play(open_capture(capture), load_recipe("best"), played, Settings())
        found = "  ".join(f"{f:g} Hz {ratio:.2f}" for f, ratio in ratios(capture, played).items())
        print(f"{capture.name}: {found}", flush=True)


if __name__ == "__main__":
    main()
