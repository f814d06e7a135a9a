"""Grooves that are known at every place, and what a cartridge with white errors would read of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from gramoscope.conventions import INNER, OUTER
from gramoscope.quality import Quality
from gramoscope.signal_path import WallTrace
from gramoscope.tonearm.follow import PlaceSmoother, Tonearm
from gramoscope.turntable.rotation import Rotation

FINE = 8


@dataclass(frozen=True, eq=False)
class Course:
    """The velocity of a groove on a fine grid from s = −20 bins on, and the place it leads to."""

    velocity_m_s: np.ndarray
    speed_m_s: float
    step_m: float

    def velocity(self, arc_m: np.ndarray) -> np.ndarray:
        return np.interp(arc_m, self._arc, self.velocity_m_s)

    def place(self, arc_m: np.ndarray) -> np.ndarray:
        v = self.velocity_m_s
        place = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2)]) * self.step_m / self.speed_m_s
        return np.interp(arc_m, self._arc, place)

    @property
    def _arc(self) -> np.ndarray:
        return (np.arange(self.velocity_m_s.size) - 20 * FINE) * self.step_m


@dataclass(frozen=True, eq=False)
class Heard:
    """A passage on the grid: velocities and errors of both directions (lateral first), and the truth."""

    arc_m: np.ndarray
    velocity: np.ndarray
    sigma: np.ndarray
    true: np.ndarray
    flags: np.ndarray
    pieces: int

    def error(self, direction: int, where: np.ndarray | slice) -> float:
        return float(np.sqrt(np.nanmean((self.velocity - self.true)[direction, where] ** 2)))

    def claim(self, direction: int, where: np.ndarray | slice) -> float:
        return float(np.sqrt(np.nanmean(self.sigma[direction, where] ** 2)))

    def ratio(self, direction: int, where: np.ndarray | slice) -> float:
        """Claimed over real error, root mean squares."""
        return self.claim(direction, where) / self.error(direction, where)

    @property
    def measured(self) -> np.ndarray:
        """Samples that are not filled in, away from the ends."""
        inside = (np.arange(self.flags.size) > 60) & (np.arange(self.flags.size) < self.flags.size - 60)
        return inside & ((self.flags & Quality.INTERPOLATED) == 0)


@dataclass(frozen=True)
class Bench:
    """Stretches of 165 samples that overlap by 14, as the cartridge for textures gives them."""

    step_m: float = 3.125e-6
    samples: int = 165
    group_step: float = 151.3
    rotation: Rotation = field(default_factory=lambda: Rotation(rpm=78.0, radius_m=0.115, pitch_m=250e-6))
    wall_angles_rad: tuple[float, float] = (np.pi / 4, np.pi / 4)
    sigma_m: float = 50e-9
    shared: float = 0.9

    @property
    def speed_m_s(self) -> float:
        return float(self.rotation.speed_at_m_s(0.0))

    def course(
        self, gain: Callable[[np.ndarray], np.ndarray], rms_m_s: float, *, groups: int, seed: int, loud_from: int = 0
    ) -> Course:
        """Noise with a spectrum, gain(Hz); silent up to a group if asked for."""
        rng = np.random.default_rng(seed)
        size = int((groups + 3) * self.group_step) * FINE
        frequency = np.fft.rfftfreq(size, self.step_m / FINE / self.speed_m_s)
        spectrum = (rng.normal(size=frequency.size) + 1j * rng.normal(size=frequency.size)) * gain(frequency)
        velocity = np.fft.irfft(spectrum, size)
        envelope = (
            np.clip(np.arange(size) / FINE - 20 - loud_from * self.group_step, 0, 300) / 300 if loud_from else 1.0
        )
        return Course(velocity / velocity.std() * rms_m_s * envelope, self.speed_m_s, self.step_m / FINE)

    def tone(self, frequency_hz: float, rms_m_s: float, *, groups: int) -> Course:
        time = np.arange(int((groups + 3) * self.group_step) * FINE) * self.step_m / FINE / self.speed_m_s
        wave = np.sqrt(2) * rms_m_s * np.sin(2 * np.pi * frequency_hz * time + 0.3)
        return Course(wave, self.speed_m_s, self.step_m / FINE)

    def traces(self, lateral: Course, vertical: Course, *, groups: int, seed: int = 0) -> list[WallTrace]:
        """Overlapping stretches share most of their errors: they see the same texture."""
        rng = np.random.default_rng(seed + 100)
        common = rng.normal(size=(2, int((groups + 3) * self.group_step)))
        cot = 1 / np.tan(self.wall_angles_rad)
        traces = []
        for number in range(groups):
            start = self.step_m * (number * self.group_step + 0.37 * (number > 0))
            arc = start + self.step_m * np.arange(self.samples)
            a, h = lateral.place(arc), vertical.place(arc)
            own = rng.normal(size=(2, self.samples))
            error = self.shared * common[:, np.rint(arc / self.step_m).astype(int)] + np.sqrt(1 - self.shared**2) * own
            offset = self.sigma_m * error
            offset[INNER] += a - h * cot[INNER] + 35e-6
            offset[OUTER] += a + h * cot[OUTER] - 30e-6
            nothing = np.full((2, self.samples), np.nan)
            sigma = np.full((2, self.samples), self.sigma_m)
            flags = np.zeros((2, self.samples), np.uint16)
            trace = WallTrace(number, start, self.step_m, offset, sigma, nothing, nothing, 1.0, flags)
            # no window reaches over the ends of a picture
            traces.append(without(without(trace, [0, 1], slice(0, 2)), [0, 1], slice(self.samples - 2, None)))
        return traces

    def hear(
        self,
        traces: list[WallTrace],
        lateral: Course,
        vertical: Course,
        *,
        direction: str = "lateral",
        **settings: object,
    ) -> Heard:
        length = traces[-1].arc_start_m + self.step_m * (self.samples - 1)
        tonearm = Tonearm(self.rotation, direction, self.wall_angles_rad, length, PlaceSmoother(**settings))
        pieces = list(tonearm.follow(iter(traces)))
        lateral_v, lateral_s, vertical_v, vertical_s, flags = (
            np.concatenate([getattr(piece, name) for piece in pieces])
            for name in (
                "lateral_velocity_m_s",
                "lateral_sigma_m_s",
                "vertical_velocity_m_s",
                "vertical_sigma_m_s",
                "flags",
            )
        )
        arc = self.step_m * np.arange(flags.size)
        # the same slope is a slower movement further in
        slower = self.rotation.speed_at_m_s(arc) / self.speed_m_s
        true = np.stack([lateral.velocity(arc), vertical.velocity(arc)]) * slower
        return Heard(
            arc, np.stack([lateral_v, vertical_v]), np.stack([lateral_s, vertical_s]), true, flags, len(pieces)
        )


def without(trace: WallTrace, walls: list[int], columns: slice) -> WallTrace:
    """The same stretch with a piece of wall that nobody saw."""
    offset, sigma, flags = trace.offset_m.copy(), trace.offset_sigma_m.copy(), trace.flags.copy()
    offset[walls, columns] = np.nan
    sigma[walls, columns] = np.nan
    flags[walls, columns] |= np.uint16(Quality.NO_STRIPE | Quality.INTERPOLATED)
    return replace(trace, offset_m=offset, offset_sigma_m=sigma, flags=flags)


@pytest.fixture(scope="session")
def bench() -> Bench:
    return Bench()


@pytest.fixture(scope="session")
def lose() -> Callable[[WallTrace, list[int], slice], WallTrace]:
    return without
