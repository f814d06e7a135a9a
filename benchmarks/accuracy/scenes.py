"""The scenes of the table: which record, under which microscope, with which sound.

Those of the first kind are the promises that the recipe `best` has to keep; those of the second change one thing at a time
about `base`. Real speech and music are taken from `../shared` and left out where it is absent; `physics` makes its own sound.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import FloatArray, rad
from gramoscope.disc.formats import Cut
from gramoscope.listening.pair import one_channel
from gramoscope.listening.wav import read_sound
from gramoscope.simulation.film_sound import film_sound, framing_height_px
from gramoscope.simulation.rig import MODEST_RIG, PERFECT_RIG, ROUGH_RIG, Rig
from gramoscope.simulation.scene import Scene, filming_bench, named_scene

SHARED = Path(__file__).parents[3] / "shared"
NOISE = "noise"
NOISE_BAND_HZ = (150.0, 6000.0)
NOISE_RATE_HZ = 48_000


@dataclass(frozen=True)
class Case:
    """A scene to film and play.

    Attributes
    ----------
    name, words : str
        What it is called in the table, and what it is.
    sound : str
        A file of `../shared/data/audio`, or `noise`.
    second_sound : str
        Of the right channel of a stereo cut; `silence` leaves that channel at rest.
    contrast, skewness : float or None
        Factor on the contrast of the texture, and its skewness where another one is wanted.
    rig : Rig
    like_the_paper : bool
        False stores the film in colour and mirrored both ways.
    seed : int
        Of texture, damage, noise and rig.
    """

    name: str
    words: str
    sound: str = "orchestra.wav"
    start_s: float = 2.0
    second_sound: str = ""
    texture: str = "powder"
    contrast: float = 1.0
    skewness: float | None = None
    damage: str = "none"
    rig: Rig = field(default=PERFECT_RIG)
    cut: Cut = "lateral"
    level_m_s: float = 0.03
    frames: int = 12
    radius_m: float = 0.115
    like_the_paper: bool = True
    seed: int = 0

    @property
    def can_be_filmed(self) -> bool:
        """Whether the sounds are there."""
        return all((SHARED / "data" / "audio" / name).is_file() for name in self.sound_files)

    @property
    def sound_files(self) -> list[str]:
        return [name for name in (self.sound, self.second_sound) if name not in ("", NOISE, "silence")]


_DIM_MODEST = replace(MODEST_RIG, dim=0.5)
_ROUGH_55 = replace(
    ROUGH_RIG,
    frame_step_share=0.08,
    group_position_m=1.5e-6,
    inner_angle_error_rad=rad(-1.5),
    outer_angle_error_rad=rad(1.5),
)
_SPEECH = "speech-male.wav"
_SINGING = "singing-female.wav"

PROMISES = (
    Case(
        "physics",
        "noise 150 Hz … 6 kHz, 3 cm/s, softer Gaussian powder, perfect rig",
        NOISE,
        contrast=22 / 34,
        skewness=0.05,
    ),
    Case("speech", "a man speaking, modest rig", _SPEECH, 1.0, rig=MODEST_RIG),
    Case("orch", "an orchestra, modest rig", rig=MODEST_RIG),
    Case("polished", "the same orchestra, nearly polished, half the light", texture="polished", rig=_DIM_MODEST),
    Case(
        "loud", "a piano at 9 cm/s, swinging by ± 80 µm, modest rig", "piano.wav", 0.5, level_m_s=0.09, rig=MODEST_RIG
    ),
    Case(
        "vertical",
        "a woman singing, hill-and-dale, 2 cm/s, modest rig",
        _SINGING,
        1.0,
        cut="vertical",
        level_m_s=0.02,
        rig=MODEST_RIG,
    ),
    Case(
        "stereo",
        "45/45, one woman singing left, another time right, modest rig",
        _SINGING,
        2.0,
        second_sound=_SINGING,
        cut="stereo",
        rig=MODEST_RIG,
    ),
    Case(
        "stereo-left",
        "45/45, a woman singing left, right at rest, modest rig",
        _SINGING,
        1.0,
        second_sound="silence",
        cut="stereo",
        rig=MODEST_RIG,
    ),
    Case(
        "rough55",
        "55 mm, steps uneven by 8 %, groups off by 1.5 µm, walls 43.5° and 46.5°, warp, colour, mirrored",
        radius_m=0.055,
        rig=_ROUGH_55,
        like_the_paper=False,
    ),
    Case("heavy", "heavy damage, modest rig", damage="heavy", rig=MODEST_RIG),
)
GRID = (
    Case("base", "orchestra, powder, 12 frames, 115 mm, 3 cm/s, perfect rig"),
    Case("shellac", "base on bare shellac", texture="shellac"),
    Case("base-polished", "base, nearly polished", texture="polished"),
    Case("little-light", "base in a quarter of the light", rig=Rig(dim=0.25)),
    Case("1-frame", "base, 1 frame a group", frames=1),
    Case("2-frames", "base, 2 frames", frames=2),
    Case("4-frames", "base, 4 frames", frames=4),
    Case("55mm", "base at 55 mm", radius_m=0.055),
    Case("soft", "base at 0.5 cm/s", level_m_s=0.005),
    Case("base-loud", "base at 9 cm/s: the bass swings by ± 270 µm, out of the picture", level_m_s=0.09),
    Case("light-damage", "base, light damage", damage="light"),
    Case("heavy-damage", "base, heavy damage", damage="heavy"),
    Case(
        "heavy-5",
        "heavy damage, modest rig, drawn anew: both walls broken over 0.2 mm",
        damage="heavy",
        rig=MODEST_RIG,
        seed=5,
    ),
    Case(
        "heavy-6",
        "heavy damage, modest rig, drawn anew: a fracture as sharp as a wall",
        damage="heavy",
        rig=MODEST_RIG,
        seed=6,
    ),
    Case(
        "heavy-7",
        "heavy damage, modest rig, drawn anew: looked at by nobody while limits were chosen",
        damage="heavy",
        rig=MODEST_RIG,
        seed=7,
    ),
    Case(
        "heavy-8",
        "heavy damage, modest rig, drawn anew: looked at by nobody while limits were chosen",
        damage="heavy",
        rig=MODEST_RIG,
        seed=8,
    ),
    Case("warp", "base, warped by 4 µm, focus drifting by 2 µm", rig=Rig(warp_m=4e-6, focus_drift_m=2e-6)),
    Case("uneven", "base, steps uneven by 8 %, groups off by 3 µm", rig=Rig(0.08, 3e-6)),
    Case(
        "base-vertical",
        "base, hill-and-dale, 2 cm/s: the bass swings further than the stripes reach",
        cut="vertical",
        level_m_s=0.02,
    ),
    Case("singing", "a woman singing, perfect rig", _SINGING, 1.0),
    Case("piano", "a piano, perfect rig", "piano.wav", 0.5),
)
CASES = PROMISES + GRID


def noise_sound(seconds: float, *, seed: int = 1) -> FloatArray:
    """Return noise with an even spectrum within `NOISE_BAND_HZ` and nothing beyond, at `NOISE_RATE_HZ`."""
    count = round(seconds * NOISE_RATE_HZ)
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(count))
    f = np.fft.rfftfreq(count, 1 / NOISE_RATE_HZ)
    spectrum[(f <= NOISE_BAND_HZ[0]) | (f >= NOISE_BAND_HZ[1])] = 0
    return np.asarray(np.fft.irfft(spectrum, count), np.float64)


def sound_of(case: Case, seconds: float) -> tuple[FloatArray, float]:
    """Return what is cut, shape (sample,) or (sample, 2), and its rate."""
    if case.sound == NOISE:
        return noise_sound(seconds), float(NOISE_RATE_HZ)
    sound, rate_hz = _read(case.sound, case.start_s, seconds)
    if not case.second_sound:
        return sound, rate_hz
    if case.second_sound == "silence":
        return np.stack([sound, np.zeros_like(sound)], axis=1), rate_hz
    other, _ = _read(case.second_sound, 1.0, seconds)
    count = min(len(sound), len(other))
    return np.stack([one[:count] / one[:count].std() for one in (sound, other)], axis=1), rate_hz


def _read(name: str, start_s: float, seconds: float) -> tuple[FloatArray, float]:
    sound, rate_hz = read_sound(SHARED / "data" / "audio" / name, start_s=start_s, seconds=seconds)
    return one_channel(sound), float(rate_hz)


def scene_of(case: Case, *, height_px: int = 512) -> Scene:
    """Return the scene of a case, in a picture of so many rows."""
    scene = named_scene(_bench_of(case, height_px), texture=case.texture, damage=case.damage, seed=case.seed)
    texture = replace(scene.texture, contrast=scene.texture.contrast * case.contrast)
    if case.skewness is not None:
        texture = replace(texture, skewness=case.skewness)
    return replace(scene, texture=texture, rig=case.rig, level_m_s=case.level_m_s)


def _bench_of(case: Case, height_px: int) -> Bench:
    bench = filming_bench(height_px=height_px)
    sensor = bench.sensor
    if not case.like_the_paper:
        sensor = replace(sensor, colour="rgb", columns="backward", rows="outward")
    return replace(
        bench,
        disc=replace(bench.disc, cut=case.cut),
        rotation=replace(bench.rotation, radius_m=case.radius_m),
        sequence=replace(bench.sequence, frames_per_group=case.frames),
        sensor=sensor,
    )


def film_case(case: Case, folder: Path, seconds: float, *, workers: int = 2) -> None:
    """Film a case into a folder."""
    samples, rate_hz = sound_of(case, seconds)
    height_px = framing_height_px(samples, rate_hz, level_m_s=case.level_m_s, disc=_bench_of(case, 512).disc)
    film_sound(samples, rate_hz, scene_of(case, height_px=height_px), folder, overwrite=True, workers=workers)


def filmed(case: Case, workdir: Path, seconds: float, *, workers: int = 2) -> Path:
    """Return the film of a case, made if there is none of these seconds.

    Parameters
    ----------
    case : Case
    workdir : Path
        The film lies in its folder `name`. Beside it `name.txt` says what was filmed; where that says something else the film
        is made again, and a film without it is taken as it is.
    seconds : float
    """
    folder, told = workdir / case.name, workdir / f"{case.name}.txt"
    wanted = f"{seconds:g} s of {case}\n"
    if (folder / "truth.npz").is_file() and (not told.is_file() or told.read_text("utf-8") == wanted):
        return folder
    told.unlink(missing_ok=True)
    film_case(case, folder, seconds, workers=workers)
    told.write_text(wanted, "utf-8")
    return folder
