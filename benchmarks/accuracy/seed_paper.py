"""How well does the paper's reading read? Films scenes, plays them with the recipe `seed-paper`, compares with the truth.

    python benchmarks/accuracy/seed_paper.py [--seconds 0.1] [--only WORD] [--table FILE]

Real speech and music, and the captures of the independent renderer, are taken from `../shared`, and left out where it is
absent. A tenth of a second of each scene needs about 1.6 GB on disk while it is played, and a minute on two cores.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gramoscope.apparatus.capture import open_capture
from gramoscope.listening.compare import Comparison, compare
from gramoscope.listening.pair import one_channel
from gramoscope.listening.truth import load_for_comparison
from gramoscope.listening.wav import read_sound
from gramoscope.player.play import Settings, play
from gramoscope.player.recipe import load_recipe
from gramoscope.simulation.demo_sound import demo_sound
from gramoscope.simulation.film_sound import film_sound, framing_height_px
from gramoscope.simulation.scene import filming_bench, named_scene

SHARED = Path(__file__).parents[3] / "shared"
COMMAND = "python benchmarks/accuracy/seed_paper.py --table benchmarks/accuracy/seed_paper.md"


@dataclass(frozen=True)
class Case:
    """A scene to film and play."""

    name: str
    sound: str = "demo"
    start_s: float = 0.0
    texture: str = "powder"
    damage: str = "none"
    imperfections: str = "none"
    cut: str = "lateral"
    level_m_s: float = 0.03
    frames: int = 12
    radius_m: float = 0.115
    height_px: int = 0


CASES = (
    Case("speech", "speech-male.wav", 1.0),
    Case("speech, 512 rows", "speech-male.wav", 1.0, height_px=512),
    Case("singing", "singing-female.wav", 1.0),
    Case("orchestra", "orchestra.wav", 2.0),
    Case("piano", "piano.wav", 0.5),
    Case("speech, modest rig", "speech-male.wav", 1.0, imperfections="modest"),
    Case("orchestra, rough rig", "orchestra.wav", 2.0, imperfections="rough"),
    Case("orchestra, light damage", "orchestra.wav", 2.0, damage="light"),
    Case("orchestra, heavy damage", "orchestra.wav", 2.0, damage="heavy"),
    Case("orchestra, shellac", "orchestra.wav", 2.0, texture="shellac"),
    Case("orchestra, polished", "orchestra.wav", 2.0, texture="polished"),
    Case("orchestra, vertical cut", "orchestra.wav", 2.0, cut="vertical", level_m_s=0.02),
    Case("orchestra, 4 frames", "orchestra.wav", 2.0, frames=4),
    Case("orchestra, 1 frame", "orchestra.wav", 2.0, frames=1),
    Case("orchestra, 55 mm", "orchestra.wav", 2.0, radius_m=0.055),
    Case("demonstration, 4 frames", frames=4),
)


def film_case(case: Case, folder: Path, seconds: float) -> None:
    if case.sound == "demo":
        samples, rate_hz = demo_sound(seconds=seconds)
    else:
        sound, rate_hz = read_sound(SHARED / "data" / "audio" / case.sound, start_s=case.start_s, seconds=seconds)
        samples = one_channel(sound)
    disc = replace(filming_bench().disc, cut=case.cut)
    height_px = case.height_px or framing_height_px(samples, rate_hz, level_m_s=case.level_m_s, disc=disc)
    bench = filming_bench(height_px=height_px)
    bench = replace(
        bench,
        disc=disc,
        rotation=replace(bench.rotation, radius_m=case.radius_m),
        sequence=replace(bench.sequence, frames_per_group=case.frames),
    )
    scene = named_scene(bench, texture=case.texture, damage=case.damage, imperfections=case.imperfections)
    film_sound(samples, float(rate_hz), replace(scene, level_m_s=case.level_m_s), folder, overwrite=True)


def heard(capture: Path, out: Path) -> tuple[Comparison, dict]:
    opened = open_capture(capture)
    report = play(opened, load_recipe("seed-paper"), out, Settings(characteristic_name="flat"))
    truth, truth_rate_hz = load_for_comparison(capture / "truth.npz", cut=opened.bench.disc.cut)
    copy, rate_hz = read_sound(out / "flat.wav")
    found = compare(one_channel(truth), truth_rate_hz, one_channel(copy), rate_hz, trim_s=0.002, max_delay_s=0.001)
    return found, report


def row(name: str, found: Comparison, report: dict) -> str:
    octaves = [found.octave_snr_db.get(f, np.nan) for f in (250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)]
    cells = [
        name,
        f"{report['groups']['read']}/{report['groups']['read'] + report['groups']['lost']}",
        f"{report['seconds']:.3f}",
        f"{found.polarity * found.waveform_r:.4f}",
        f"{found.waveform_r_unaligned:.4f}",
        f"{found.envelope_r:.3f}",
        f"{found.snr_db:.1f}",
        *("–" if np.isnan(snr) else f"{snr:.0f}" for snr in octaves),
        f"{found.delay_s * 1e6:+.1f}",
        f"{100 * report['share']['interpolated']:.1f}",
        f"{report['elapsed_s']:.0f}",
    ]
    return "| " + " | ".join(cells) + " |"


HEADER = (
    "| scene | groups read | s | r | r as it lies | r envelope | SNR dB | 250 | 500 | 1k | 2k | 4k | 8k | delay µs"
    " | interpolated % | played in s |\n|---|" + "---|" * 15
)


def rows(only: str, seconds: float, work: Path) -> Iterator[str]:
    for name in ("practice-clean", "practice-damaged"):
        if only in name and (SHARED / "captures" / name).is_dir():
            yield row(name, *heard(SHARED / "captures" / name, work / "out"))
    for case in CASES:
        if only in case.name and (case.sound == "demo" or SHARED.is_dir()):
            film_case(case, work / "capture", seconds)
            yield row(case.name, *heard(work / "capture", work / "out"))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=0.1)
    parser.add_argument("--only", default="")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    lines = [HEADER]
    print(HEADER)
    with tempfile.TemporaryDirectory() as work:
        for line in rows(given.only, given.seconds, Path(work)):
            print(line, flush=True)
            lines.append(line)
    if given.table is not None:
        given.table.write_text(ABOUT + "\n".join(lines) + "\n", encoding="utf-8")
    return 0


ABOUT = f"""# The paper's reading, measured

    {COMMAND}

Recipe `seed-paper`; `flat.wav` against the truth, 200 Hz … 10 kHz without the first and last 2 ms. *r* and SNR after taking
out gain and delay by least squares; *r as it lies* with nothing taken out, so with the polarity and the time zero that the
file has. SNR by octave in dB. Scenes with names of sounds are filmed by our simulator; the `practice` captures were made by
an independent renderer.

"""

if __name__ == "__main__":
    raise SystemExit(main())
