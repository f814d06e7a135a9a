"""How fast is the recipe `best`, from frames in memory to velocities, stage by stage?

    python -m benchmarks.speed.reading [--groups 512] [--device cuda] [--table benchmarks/speed/reading.md]

Films a melody with the simulator (12 frames of 1280 × 512 a group), lets the cartridge learn, and times each stage on one
thread, then the whole on one and on two, and with a third that reads while others wait for the interpreter. Bytes and shares
are those of the roofline (`ceilings`), measured in the same run. The real-time factor is the time that a stretch of groove
sounds over the time that it takes.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.accuracy.table import line_of
from benchmarks.speed.ceilings import Ceilings, measured_ceilings, seconds
from gramoscope.apparatus.capture import Capture, open_capture
from gramoscope.camera.exposure import EVERY_ROW
from gramoscope.disc.formats import direction_of_cut
from gramoscope.pickup.device import Device
from gramoscope.pickup.texture.reading import read
from gramoscope.pickup.texture.samples import samples_of
from gramoscope.pickup.texture_likelihood import TexturePickup, sight_of
from gramoscope.player.devices import DEVICES, device_named
from gramoscope.player.film import learned
from gramoscope.player.recipe import load_recipe
from gramoscope.player.workers import in_order
from gramoscope.preamp.resample import Resampler
from gramoscope.signal_path import FrameGroup, GrooveMotion, WallTrace
from gramoscope.simulation.demo_sound import demo_sound
from gramoscope.simulation.film_sound import film_sound
from gramoscope.simulation.scene import filming_bench, named_scene
from gramoscope.tonearm.follow import Tonearm
from gramoscope.tonearm.splice import Splice

Row = tuple[str, float, float]
"""Stage, seconds a group, bytes of film that it has to read."""


def filmed_capture(folder: Path, groups: int) -> Capture:
    """Film a melody into a folder."""
    bench = filming_bench(height_px=512)
    seconds_needed = groups * bench.sequence.group_step_m / float(bench.rotation.speed_at_m_s(0.0))
    sound, rate_hz = demo_sound(seconds=seconds_needed)
    film_sound(sound, rate_hz, named_scene(bench), folder, overwrite=True, workers=2)
    return open_capture(folder)


def reading_stages(pickup: TexturePickup, group: FrameGroup) -> list[Row]:
    """Time the stages of reading one stretch."""
    moved = float(group.images.nbytes)
    device = pickup.cartridge.device
    film = device.film(group)
    sight = sight_of(film)
    coarse = pickup.searched(sight)
    begun, laid = pickup.stretch(film, sight, coarse)
    cartridge, models = pickup.cartridge, pickup.models_for(group.number)
    cut, rules = cartridge.bench.disc.cut, cartridge.rules
    path, found = read(begun, models, cut, rules)
    drawn = (
        float(np.count_nonzero(device.part(laid.columns, slice(None)))) * len(sight.shift_px) * group.images.itemsize
    )
    return [
        ("frames that show nothing", seconds(lambda: cartridge.exposure.sort_out(group)), moved / EVERY_ROW),
        ("film to the device", seconds(lambda: device.film(group)), 0.0),
        ("how far the record turned", seconds(lambda: device.frame_shifts(film)), 0.0),
        ("sharpness", seconds(lambda: device.sharpness(film, sight.shift_px)), moved),
        ("coarse search", seconds(lambda: pickup.searched(sight)), 0.0),
        ("frames laid over each other about the stripes", seconds(lambda: pickup.stretch(film, sight, coarse)), drawn),
        (
            f"likelihood, {cartridge.rounds} rounds and what they come to",
            seconds(lambda: read(begun, models, cut, rules)),
            0.0,
        ),
        ("samples", seconds(lambda: samples_of(path, found, pickup.cartridge.rules)), 0.0),
        ("strips for the splice", seconds(lambda: pickup.strips(laid, film)), 0.0),
        ("reading, one thread, whole", seconds(lambda: pickup.read(group)), moved),
    ]


def read_by(pickup: TexturePickup, groups: list[FrameGroup], threads: int) -> tuple[list[WallTrace], float]:
    """Read all groups; return what was read and the seconds that a group took."""
    with ThreadPoolExecutor(threads) as pool:
        started = time.perf_counter()
        traces = list(pool.map(pickup.read, groups))
        return traces, (time.perf_counter() - started) / len(groups)


def timed(work: Callable[[], object], groups: int) -> float:
    """Return the seconds a group of something that is done once."""
    started = time.perf_counter()
    work()
    return (time.perf_counter() - started) / groups


def following(capture: Capture) -> tuple[Splice, Tonearm, Resampler]:
    """Return what comes after the pickup."""
    recipe, bench = load_recipe("best"), capture.bench
    direction = direction_of_cut(bench.disc.cut)
    arm = Tonearm(bench.rotation, direction, bench.disc.wall_angle_rad, bench.passage_length_m, recipe.smoother)
    return recipe.splice, arm, Resampler(bench.rotation, 96_000.0, recipe.passband)


def following_stages(capture: Capture, traces: list[WallTrace]) -> list[Row]:
    """Time what comes after the pickup, which is one stream."""
    splice, arm, resampler = following(capture)
    spliced: list[WallTrace] = []
    motion: list[GrooveMotion] = []
    list(arm.follow(trace for trace, _ in splice.join(iter(traces))))  # compiles
    count = len(traces)
    return [
        ("splice", timed(lambda: spliced.extend(t for t, _ in splice.join(iter(traces))), count), 0.0),
        ("tonearm", timed(lambda: motion.extend(arm.follow(iter(spliced))), count), 0.0),
        ("place to time", timed(lambda: list(resampler.resample(iter(motion))), count), 0.0),
    ]


def played(capture: Capture, pickup: TexturePickup, film: list[FrameGroup], threads: int) -> float:
    """Play from frames in memory to sound, as `play` does; return the seconds that a group took."""
    splice, arm, resampler = following(capture)

    def sounded() -> None:
        traces = in_order(pickup.read, film, workers=threads)
        for _ in resampler.resample(arm.follow(trace for trace, _ in splice.join(traces))):
            pass

    return timed(sounded, len(film))


def measured_rows(groups: int, device: Device) -> tuple[list[Row], Capture, int]:
    """Return all rows, the capture, and the pixels of a group."""
    with tempfile.TemporaryDirectory() as folder:
        capture = filmed_capture(Path(folder) / "film", groups)
        pickup = learned(capture, load_recipe("best"), 2, device=device)
        assert isinstance(pickup, TexturePickup)
        film = [capture.group(number) for number in range(capture.group_count)]
    rows = reading_stages(pickup, film[len(film) // 2])
    traces, alone = read_by(pickup, film, 1)
    again, together = read_by(pickup, film, 2)
    assert all(np.array_equal(a.offset_m, b.offset_m, equal_nan=True) for a, b in zip(traces, again, strict=True))
    film_bytes = float(film[0].images.nbytes)
    rows += [
        ("reading, all groups, one thread", alone, film_bytes),
        ("the same, two threads", together, film_bytes),
        *following_stages(capture, traces),
        ("in all, one thread for reading", played(capture, pickup, film, 1), film_bytes),
        ("in all, two threads for reading", played(capture, pickup, film, 2), film_bytes),
        ("in all, three threads for reading", played(capture, pickup, film, 3), film_bytes),
    ]
    return rows, capture, film[0].images.size


def page(rows: list[Row], capture: Capture, pixels: int, ceilings: Ceilings, device: str) -> str:
    """Return the table."""
    bench = capture.bench
    sounding_s = bench.sequence.group_step_m / float(bench.rotation.speed_at_m_s(0.0))
    lines = [
        "# Reading, timed",
        "",
        "    python -m benchmarks.speed.reading --table benchmarks/speed/reading.md",
        "",
        f"{bench.sequence.frames_per_group} frames of {bench.sensor.width_px} × {bench.sensor.height_px}, 8 bits, "
        f"{bench.rotation.radius_m * 1e3:g} mm, {bench.sequence.groups} groups, frames in memory, read on {device}. "
        f"Measured in the same run, on one thread of a machine of {os.cpu_count()} processors: triad "
        f"{ceilings.triad_bytes_s / 1e9:.1f} GB/s, {ceilings.fma_s / 1e9:.0f} · 10⁹ single-precision multiply-adds a second.",
        "*Of the memory's rate*: what the stage has to read of the film, over what the triad moves in that time. "
        "*Real-time factor*: 1 plays as fast as the record turns.",
        "",
        line_of(("stage", "ms a group", "ns a pixel of film", "of the memory's rate", "real-time factor")),
        "|" + "---|" * 5,
    ]
    for name, spent, moved in rows:
        share = f"{100 * moved / spent / ceilings.triad_bytes_s:.1f} %" if moved else "–"
        lines.append(
            line_of((name, f"{1e3 * spent:.2f}", f"{1e9 * spent / pixels:.2f}", share, f"{sounding_s / spent:.3f}"))
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--groups", type=int, default=512)
    parser.add_argument("--device", choices=DEVICES, default="cpu")
    parser.add_argument("--table", type=Path, help="page to write")
    given = parser.parse_args()
    device = device_named(given.device)
    rows, capture, pixels = measured_rows(given.groups, device)
    text = page(rows, capture, pixels, measured_ceilings(), device.name)
    print(text)
    if given.table is not None:
        given.table.write_text(text, "utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
