"""How long does a group of 12 frames of 1280 × 512 take to film, from displacement to quantised frames?

Promise: 0.3 s a group on two cores (median), disk left out. Prints seconds for each texture and damage, rendered one group
at a time on one core, and the throughput of `film` with two workers.

    python benchmarks/speed/film.py [GROUPS]
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from gramoscope.simulation.demo_sound import demo_sound
from gramoscope.simulation.film import film
from gramoscope.simulation.render import cut_passage, render_group
from gramoscope.simulation.scene import Scene, filming_bench, named_scene

PROMISE_S = 0.3
SCENES = (("powder", "none", "none"), ("shellac", "light", "modest"), ("powder", "heavy", "rough"))


class Nowhere:
    """Takes a film and notes when each group came."""

    def __init__(self) -> None:
        self.times_s: list[float] = []

    def write_group(self, number: int, images: np.ndarray, **log: np.ndarray) -> None:
        self.times_s.append(time.perf_counter())


def one_at_a_time_s(scene: Scene, sound: np.ndarray, rate_hz: float) -> list[float]:
    passage = cut_passage(sound, rate_hz=rate_hz, scene=scene)
    render_group(scene, passage, 0)  # compiles
    seconds = []
    for number in range(scene.bench.sequence.groups):
        start = time.perf_counter()
        render_group(scene, passage, number)
        seconds.append(time.perf_counter() - start)
    return seconds


def throughput_s(scene: Scene, sound: np.ndarray, rate_hz: float) -> float:
    writer = Nowhere()
    film(sound, rate_hz, scene, writer, workers=2)
    return (writer.times_s[-1] - writer.times_s[1]) / (len(writer.times_s) - 2)


def main(groups: int) -> int:
    sound, rate_hz = demo_sound(seconds=0.5)
    kept = True
    for texture, damage, imperfections in SCENES:
        scene = named_scene(filming_bench(), texture=texture, damage=damage, imperfections=imperfections)
        sequence = replace(scene.bench.sequence, groups=groups)
        scene = replace(scene, bench=replace(scene.bench, sequence=sequence))
        alone = one_at_a_time_s(scene, sound, rate_hz)
        together = throughput_s(scene, sound, rate_hz)
        kept &= together <= PROMISE_S
        print(
            f"{texture:8} damage {damage:6} imperfections {imperfections:7}"
            f" one core {np.median(alone):.3f} s (slowest {max(alone):.3f}), two workers {together:.3f} s a group"
        )
    print(f"promise of {PROMISE_S} s a group:", "kept" if kept else "BROKEN")
    return 0 if kept else 1


if __name__ == "__main__":
    raise SystemExit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
