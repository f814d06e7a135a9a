"""Photographs of grooves, drawn by the simulator and played: how near is the sound to what was cut?

python -m benchmarks.accuracy.stills --table benchmarks/accuracy/stills.md
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import soundfile

from gramoscope.apparatus.still import open_stills
from gramoscope.apparatus.unroll import disc_scan, unroll
from gramoscope.camera.frames_image import write_png
from gramoscope.disc.formats import Disc
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe
from gramoscope.simulation.demo_sound import demo_sound
from gramoscope.simulation.passage import Passage
from gramoscope.simulation.still import StillScene, cut_still, disc_picture, still_truth_m_s, write_still

RATE_HZ = 48_000
MARGIN_S = 0.02
HEAD = """# Photographs, measured

    python -m benchmarks.accuracy.stills --table benchmarks/accuracy/stills.md

Spirals drawn by the simulator (`gramoscope.simulation.still`: everything in focus, grain, dust, noise of the camera), cut
with the sound of the demonstration (a singer over bells, 150 Hz … 6 kHz, 3 cm/s rms unless said otherwise) at 78 rpm,
written as a row of overlapping pictures and played by the recipe `stills`: edges found, pictures laid on each other, all
turns joined. Against the velocity that was cut, sample by sample, nothing aligned or scaled, full band at 48 kHz; the first
and last 20 ms are left out. *r*: Pearson's; *SNR*: of the sound against its error; *claimed ÷ real*: rms of the error bars
over that of the error, where measured. *pixels a second* pass under the stylus: half of them is the highest frequency there
could be.

| photograph | turns | pictures | pixels a second | r | SNR dB | claimed ÷ real | measured |
|---|---|---|---|---|---|---|---|
"""


@dataclass(frozen=True)
class Case:
    """A photograph.

    Attributes
    ----------
    name : str
    scene : StillScene
    pictures : int
    scan : bool
        Whether it is a scan of a whole disc, to be straightened first.
    """

    name: str
    scene: StillScene
    pictures: int = 20
    scan: bool = False


BASE = StillScene(turns=12, turn_px=157_080)
CASES = (
    Case("12 turns at a radius of 100 mm, dust: 60 specks a metre", BASE, pictures=80),
    Case("1 turn", replace(BASE, turns=1)),
    Case("… three times the grain (3 %), twice the noise", replace(BASE, turns=1, grain=0.03, noise=2.0)),
    Case("… ten times the dust", replace(BASE, turns=1, dust_per_m=600.0)),
    Case("… cut vertically", replace(BASE, turns=1, disc=Disc(cut="vertical", groove_width_m=140e-6))),
    Case("… at a radius of 26 mm", replace(BASE, turns=1, turn_px=40_960), pictures=5),
    Case("… pixels of 8 µm", replace(BASE, turns=1, turn_px=78_540, pixel_pitch_m=8e-6), pictures=10),
    Case(
        "a scan of 2200 × 2200 pixels of 20 µm, straightened; at 1 cm/s",
        StillScene(turns=5, turn_px=round(2 * np.pi * 1050), pixel_pitch_m=20e-6, level_m_s=0.01, dust_per_m=10.0),
        scan=True,
    ),
)


def main() -> None:
    """Measure every case, or those whose names contain a word."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    rows = []
    for case in CASES:
        if chosen.only in case.name:
            started = time.perf_counter()
            rows.append(measured(case))
            print(rows[-1], f"{time.perf_counter() - started:.0f} s", flush=True)
    if chosen.table is not None:
        chosen.table.write_text(HEAD + "\n".join(rows) + "\n", encoding="utf-8")


def measured(case: Case) -> str:
    """Return the row of a case."""
    scene = case.scene
    sound, rate_hz = demo_sound(seconds=scene.seconds)
    passage = cut_still(sound, rate_hz=rate_hz, scene=scene)
    with tempfile.TemporaryDirectory() as folder:
        capture, out = Path(folder) / "capture", Path(folder) / "out"
        pictures = _photographed(case, passage, Path(folder), capture)
        report = play(
            open_stills(capture), load_recipe("stills"), out, Settings(rate_hz=float(RATE_HZ), full_scale_m_s=1.0)
        )
        heard = {name: soundfile.read(out / f"{name}.wav")[0] for name in ("flat", "vertical")}
    cut, across = still_truth_m_s(scene, passage, rate_hz=RATE_HZ)
    if scene.disc.cut == "vertical":
        cut = across
    margin = round(MARGIN_S * RATE_HZ)
    inside = slice(margin, min(heard["flat"].size, cut.size) - margin)
    x, y = heard["flat"][inside], cut[inside]
    error = float(np.sqrt(np.mean((x - y) ** 2)))
    snr_db = 20 * np.log10(float(np.sqrt(np.mean(y**2))) / error)
    claimed = report["noise_estimate"]["sigma_rms_cm_s"] / 100
    rate = scene.turn_px * scene.rpm / 60
    return (
        f"| {case.name} | {scene.turns} | {pictures} | {rate / 1e3:.1f} k | {np.corrcoef(x, y)[0, 1]:.5f} | {snr_db:.1f} | "
        f"{claimed / error:.2f} | {report['share']['measured']:.1%} |"
    )


def _photographed(case: Case, passage: Passage, folder: Path, capture: Path) -> int:
    scene = case.scene
    if not case.scan:
        write_still(capture, scene, passage, pictures=case.pictures)
        return case.pictures
    picture = disc_picture(scene, passage, centre_px=(1097.3, 1102.6), size_px=(2200, 2200))
    write_png(folder / "disc.png", picture)
    scan = disc_scan(folder / "disc.png", outer_px=1050.0)
    manifest = unroll(scan, capture, disc=scene.disc, pixel_pitch_m=scene.pixel_pitch_m, rpm=scene.rpm)
    return len(manifest.pictures)


if __name__ == "__main__":
    main()
