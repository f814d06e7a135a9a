"""How well does each recipe read, and how well could it be read? Films scenes, plays them, compares with the truth.

    python -m benchmarks.accuracy.readings [--recipe NAME]… [--only NAME,NAME] [--seconds 0.1] [--workdir DIR] [--table FILE]

A tenth of a second of a scene needs 1.6 GB on disk (a film in colour or of a loud sound up to 4) and one to three minutes on
two cores; with `--workdir` films are kept for the next time, else one at a time is on disk. The table is written after
every row, and a row that it holds is not made again.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.accuracy.bound import scene_density_m2_hz, snr_db, velocity_noise_compared_m_s
from benchmarks.accuracy.hearing import RATE_HZ, Heard, hear
from benchmarks.accuracy.measures import band_rms, driven_channels, separation_db, sigma_ratio
from benchmarks.accuracy.scenes import CASES, SHARED, Case, filmed, scene_of
from benchmarks.accuracy.table import Table
from gramoscope.conventions import BoolArray, FloatArray
from gramoscope.errors import CaptureError, SoundError
from gramoscope.listening.align import Band
from gramoscope.listening.compare import Comparison, compare
from gramoscope.listening.truth import truth_sound
from gramoscope.player.recipe import load_recipe
from gramoscope.quality import interpolated_share
from gramoscope.simulation.scene import Scene

RECIPES = ("best", "seed-paper")
MAX_DELAY_S = 0.001
OCTAVES_HZ = (125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0)
NOTHING = "–"


ENDS_S = 0.002
"""Left out at both ends: a passage cut out of a side begins and ends in the middle of a sound."""


@dataclass(frozen=True)
class Judged:
    """How a capture is judged.

    Attributes
    ----------
    name : str
    scene : Scene or None
        None where nobody knows it: no bound.
    band_hz : (float, float)
    trim_s : float
        Left out at both ends.
    """

    name: str
    scene: Scene | None = None
    band_hz: Band = (100.0, 10_000.0)
    trim_s: float = ENDS_S


PRACTICE = tuple(Judged(name, None, (200.0, 10_000.0)) for name in ("practice-clean", "practice-damaged"))


@dataclass(frozen=True, eq=False)
class Ears:
    """One channel of truth, what was heard of it, and which channel of a 45/45 groove it is."""

    truth: FloatArray
    heard: FloatArray
    channel: int | None = None

    def compared(self, judged: Judged, *, mask: BoolArray | None = None) -> Comparison:
        return compare(
            self.truth,
            RATE_HZ,
            self.heard,
            RATE_HZ,
            band_hz=judged.band_hz,
            max_delay_s=MAX_DELAY_S,
            trim_s=judged.trim_s,
            mask=mask,
        )


def ears(folder: Path, heard: Heard) -> list[Ears]:
    """Return what is to be compared: the sound, or each driven channel of a 45/45 groove if both directions were read."""
    channels = heard.channels
    if heard.cut != "stereo" or channels is None:
        cut = "vertical" if heard.cut == "vertical" else "lateral"
        return [Ears(truth_sound(folder / "truth.npz", rate_hz=RATE_HZ, cut=cut), heard.sound.samples)]
    truth = truth_sound(folder / "truth.npz", rate_hz=RATE_HZ, cut="stereo")
    return [Ears(truth[:, i], channels[:, i], i) for i in driven_channels(truth)]


def row(judged: Judged, recipe: str, folder: Path, heard: Heard) -> list[str]:
    """Return the cells of a row; of several channels it is that of the one that was read worst."""
    sound = heard.sound
    flagged = sound.flags != 0
    found, one = min(((pair.compared(judged), pair) for pair in ears(folder, heard)), key=lambda x: x[0].snr_db)
    direct = truth_sound(
        folder / "truth.npz", rate_hz=RATE_HZ, cut="vertical" if heard.cut == "vertical" else "lateral"
    )
    return [
        judged.name,
        recipe,
        f"{found.span_s:.3f}",
        f"{found.polarity * found.waveform_r:.5f}",
        _db(found.snr_db),
        _db(_outside(flagged, one, judged)),
        _db(_bound(judged, one)),
        *(_db(found.octave_snr_db.get(centre_hz, np.nan), 0) for centre_hz in OCTAVES_HZ),
        _number(sigma_ratio(direct, sound.samples, sound.sigma, used=~flagged), 2),
        f"{100 * interpolated_share(sound.flags):.1f}",
        f"{100 * flagged.mean():.1f}",
        _db(_separation(judged, folder, heard)),
        f"{heard.played_s:.0f}",
    ]


def _outside(flagged: BoolArray, one: Ears, judged: Judged) -> float:
    try:
        return one.compared(judged, mask=flagged).snr_db
    except SoundError:
        return float("nan")


def _bound(judged: Judged, one: Ears) -> float:
    if judged.scene is None:
        return float("nan")
    noise_m_s = velocity_noise_compared_m_s(
        scene_density_m2_hz(judged.scene, channel=one.channel), band_hz=judged.band_hz
    )
    return snr_db(band_rms(one.truth, rate_hz=RATE_HZ, band_hz=judged.band_hz), noise_m_s)


def _separation(judged: Judged, folder: Path, heard: Heard) -> float:
    channels = heard.channels
    if heard.cut != "stereo" or channels is None:
        return float("nan")
    truth = truth_sound(folder / "truth.npz", rate_hz=RATE_HZ, cut="stereo")
    return separation_db(truth, channels, rate_hz=RATE_HZ, band_hz=judged.band_hz, trim_s=judged.trim_s)


def _number(value: float, digits: int) -> str:
    return NOTHING if not np.isfinite(value) else f"{value:.{digits}f}"


def _db(value: float, digits: int = 1) -> str:
    return _number(value, digits)


COLUMNS = (
    "scene",
    "recipe",
    "s",
    "r",
    "SNR dB",
    "unflagged",
    "bound",
    "125",
    "250",
    "500",
    "1k",
    "2k",
    "4k",
    "8k",
    "σ ÷ error",
    "interpolated %",
    "flagged %",
    "separation dB",
    "played in s",
)


def rows(table: Table, recipes: list[str], only: set[str], seconds: float, workdir: Path | None) -> Iterator[list[str]]:
    """Yield the rows that the table lacks, scene by scene, each filmed once."""
    for judged in PRACTICE:
        folder = SHARED / "captures" / judged.name
        if (not only or judged.name in only) and folder.is_dir():
            yield from _played(table, recipes, judged, folder)
    for case in CASES:
        wanted = [recipe for recipe in recipes if not table.has(case.name, recipe)]
        if wanted and (not only or case.name in only) and case.can_be_filmed:
            yield from _filmed_and_played(table, wanted, case, seconds, workdir)


def _filmed_and_played(
    table: Table, recipes: list[str], case: Case, seconds: float, workdir: Path | None
) -> Iterator[list[str]]:
    with tempfile.TemporaryDirectory() as passing:
        folder = filmed(case, workdir or Path(passing), seconds)
        yield from _played(table, recipes, Judged(case.name, scene_of(case)), folder)


def _played(table: Table, recipes: list[str], judged: Judged, folder: Path) -> Iterator[list[str]]:
    for recipe in recipes:
        if table.has(judged.name, recipe):
            continue
        try:
            yield row(judged, recipe, folder, hear(folder, load_recipe(recipe)))
        except (CaptureError, SoundError) as error:
            print(f"{judged.name}, {recipe}: {error}")
            yield [judged.name, recipe, *[NOTHING] * (len(COLUMNS) - 2)]


def arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recipe", action="append", help=f"name or file; may be repeated; default {RECIPES}")
    parser.add_argument("--only", default="", help="scenes by name, with commas between them; all when left out")
    parser.add_argument("--seconds", type=float, default=0.1)
    parser.add_argument("--workdir", type=Path, help="keep films here, and use those that lie here")
    parser.add_argument("--table", type=Path, help="page to keep the rows in")
    parser.add_argument("--again", action="store_true", help="make rows that the table holds again")
    return parser


def main() -> int:
    given = arguments().parse_args()
    recipes = given.recipe or list(RECIPES)
    order = [*(judged.name for judged in PRACTICE), *(case.name for case in CASES)]
    table = Table(given.table, ABOUT, COLUMNS, order=order)
    known = Table(None, "", COLUMNS, rows={} if given.again else table.rows)
    if given.workdir is not None:
        given.workdir.mkdir(parents=True, exist_ok=True)
    for cells in rows(known, recipes, set(filter(None, given.only.split(","))), given.seconds, given.workdir):
        print(" | ".join(cells), flush=True)
        table.add(cells)
    return 0


_SCENES = "\n".join(f"- *{case.name}*: {case.words}" for case in CASES)
ABOUT = f"""# The readings, measured

    python -m benchmarks.accuracy.readings --table benchmarks/accuracy/readings.md

Waveform against truth after taking out gain and delay (at most 1 ms) by least squares, 100 Hz … 10 kHz, `practice` captures
200 Hz … 10 kHz, without the first and last 2 ms. *unflagged*: the same outside all flagged samples. *bound*: the SNR that no
unbiased reading of the undamaged scene can exceed in the same band ([bound.py](bound.py)); for scenes with texture that is not
Gaussian, the bound of a Gaussian one. SNR by octave in dB. *σ ÷ error*: rms of the claimed standard errors ÷ rms of the real
error in full band, outside flagged samples; of the lateral motion for a stereo cut. For a stereo cut r, SNR and bound are
those of the worse channel; *separation*: power heard in the driven channel ÷ that in the other, noise included, or with both
driven by what leaks between them. *s*: what is compared, by `--seconds` less the ends: 0.1 for
physics and polished, 0.06 for the other films. *played in s*: on two cores, learning included.

Scenes are filmed by our simulator; the `practice` captures were made by an independent renderer.

{_SCENES}
"""

if __name__ == "__main__":
    raise SystemExit(main())
