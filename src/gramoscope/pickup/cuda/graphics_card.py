"""A graphics card that reads groups: their film is copied to it once, and only small arrays come back.

On the card: the normal equations of the frames' shifts, the energies of the whole film, the frames laid over each other, the
tone, and one look at all stripes. On the processor: which rows carry texture (one frame), the coarse search, and the smoothing
of steps, which are small and one thing after another.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from threading import Lock
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt
from numba import cuda

from gramoscope.conventions import BoolArray, Float32Array, FloatArray, IntArray
from gramoscope.pickup.cuda import film_kernels, hearing_kernels
from gramoscope.pickup.cuda.ear_there import EarThere, ear_there
from gramoscope.pickup.cuda.launching import threads_for
from gramoscope.pickup.device import Film, Kept
from gramoscope.pickup.overlay import TILE_COLUMNS, Overlay, frames_in, overlay_width, placements, places_brighter
from gramoscope.pickup.registration import (
    REACH_PX,
    ROUNDS,
    added_up,
    cubic_taps,
    expected_steps_px,
    textured_rows,
)
from gramoscope.pickup.texture.following import REACH, places_of
from gramoscope.pickup.texture.hearing import Ear, Told, told_by
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import TEMPER, TEXTURE_PX
from gramoscope.pickup.texture.sharpness import CELL_PX, Sharpness, sharpness_of, whole_pixels
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture.tone import Tone
from gramoscope.signal_path import FrameGroup


@dataclass(frozen=True)
class GraphicsCard:
    """A graphics card; see `pickup.device.Device` for what each method does.

    Parameters
    ----------
    name : str
        What it is, for reports.
    """

    name: str
    _ears: WeakKeyDictionary[Ear, EarThere] = field(default_factory=WeakKeyDictionary, repr=False, compare=False)
    _lock: Any = field(default_factory=Lock, repr=False, compare=False)

    def film(self, group: FrameGroup) -> Film:
        """Copy the valid frames to the card."""
        return Film(group, cuda.to_device(np.ascontiguousarray(group.usable_images)), self)

    def frame_shifts(self, film: Film) -> tuple[FloatArray, FloatArray]:
        """See `registration.frame_shifts`; all pairs of frames at once."""
        first = film.group.images[np.flatnonzero(film.group.valid)[0]]
        expected_px, rows = expected_steps_px(film.group), textured_rows(first)
        found_px = np.empty(expected_px.size)
        if found_px.size:
            there = cuda.to_device(found_px)
            pairs = film_kernels.pair_shifts[found_px.size, film_kernels.PAIR_THREADS]
            pairs(film.images, cuda.to_device(expected_px), cuda.to_device(rows), REACH_PX, ROUNDS, there)
            found_px = there.copy_to_host()
        return added_up(film.group, expected_px, found_px)

    def sharpness(self, film: Film, shift_px: FloatArray) -> Sharpness:
        """See `texture.sharpness`; energies come back, and what follows is small."""
        _, height, width = film.images.shape
        frames, offset, share = whole_pixels(width, shift_px)
        energy = cuda.device_array((share.size // CELL_PX, height), np.float32)
        blocks = (-(-share.size // film_kernels.ENERGY_COLUMNS), height)
        kernel = film_kernels.cell_energy[blocks, film_kernels.ENERGY_COLUMNS]
        kernel(film.images, *(cuda.to_device(one) for one in (frames, offset, share)), energy)
        return sharpness_of(energy.copy_to_host())

    def overlay(
        self, film: Film, shift_px: FloatArray, frame_index: npt.NDArray[np.int64], wanted: BoolArray
    ) -> Overlay:
        """See `overlay.overlay`; the picture stays on the card."""
        _, height, width = film.images.shape
        places, taps = placed(shift_px, width)
        counts = frames_in(width, shift_px)
        share = (1 / np.maximum(counts, 1)).astype(np.float32)
        columns = cuda.device_array((counts.size, height), np.float32)
        kernel = film_kernels.overlay_tiles[wanted.shape[::-1], (TILE_COLUMNS, film_kernels.ROWS_AT_ONCE)]
        tiles = wanted.astype(np.uint8)
        kernel(film.images, *(cuda.to_device(one) for one in (places, taps, share, tiles)), columns)
        covered = np.flatnonzero(counts)
        if covered.size:
            film_kernels.hold_ends[threads_for((height,))](columns, int(covered[0]), int(covered[-1]))
        return Overlay(columns, counts, shift_px, frame_index)

    def places_brighter(self, columns: Kept, level: float) -> IntArray:
        """See `overlay.places_brighter`; the picture comes back only if there are any."""
        found = cuda.to_device(np.zeros(1, np.int32))
        film_kernels.any_brighter[threads_for(columns.shape)](columns, np.float32(level), found)
        if not found.copy_to_host()[0]:
            return np.empty((0, 2), np.int64)
        return np.asarray(places_brighter(columns.copy_to_host(), np.float32(level)))

    def part(self, columns: Kept, part: slice) -> Float32Array:
        """Copy some columns back."""
        return np.asarray(columns[part].copy_to_host())

    def in_tone(self, columns: Kept, tone: Tone) -> Kept:
        """See `texture.tone`."""
        if tone.compression == 0:
            return columns
        q, m = tone.compression, tone.level
        seen = cuda.device_array(columns.shape, np.float32)
        kernel = film_kernels.compress[threads_for(columns.shape)]
        kernel(columns, np.float32(q / m), np.float32(1 - q), np.float32(m / q), seen)
        return seen

    def told(
        self,
        ear: Ear,
        layout: StripeLayout,
        stretch: Stretch,
        *,
        least_support: float,
        power_limits: tuple[float, float],
    ) -> Told:
        """See `texture.hearing.told`."""

        def heard(rows: FloatArray, clear: BoolArray) -> tuple[FloatArray, Float32Array]:
            return self.heard(ear, stretch.columns, rows, clear, power_limits=power_limits)

        return told_by(heard, ear, layout, stretch, least_support=least_support)

    def heard(
        self,
        ear: Ear,
        columns: Kept,
        rows: FloatArray,
        clear: BoolArray,
        *,
        power_limits: tuple[float, float],
    ) -> tuple[FloatArray, Float32Array]:
        """Return what `texture.hearing.listen` writes."""
        there = self._ear(ear)
        white, weight = drawn(there, columns, *places_of(rows, ear.half_px + REACH), clear, power_limits)
        said = spoken(there, white, weight, first_bin=ear.band.bins(ear.length).start)
        return said.copy_to_host().astype(np.float64), weight.copy_to_host()

    def _ear(self, ear: Ear) -> EarThere:
        """The ear on the card; it is copied when it is heard with for the first time."""
        with self._lock:
            if ear not in self._ears:
                self._ears[ear] = ear_there(ear)
            return self._ears[ear]


def placed(shift_px: FloatArray, width: int) -> tuple[npt.NDArray[np.int64], Float32Array]:
    """Return what the overlay must know of each frame.

    Returns
    -------
    places : int64 array, shape (frame, 3)
        First and last but one column of the overlay that it covers, and its own column minus theirs.
    taps : float32 array, shape (frame, 4)
        Of the interpolation between its columns.
    """
    places, fraction = placements(shift_px, width, overlay_width(width, shift_px))
    return places, np.array([cubic_taps(one) for one in fraction.tolist()], np.float32)


def drawn(
    ear: EarThere,
    columns: Kept,
    first_row: IntArray,
    phase: IntArray,
    clear: BoolArray,
    power_limits: tuple[float, float],
) -> tuple[Kept, Kept]:
    """Return the whitened channels of each stripe, [stripe, column, channel], and their weight, on the card."""
    stripes, width = first_row.shape
    rows, channels = ear.basis.shape[1:]
    window = cuda.device_array((stripes, width, rows), np.float32)
    raw, white = (cuda.device_array((stripes, width, channels), np.float32) for _ in range(2))
    power = cuda.device_array((2, stripes, width), np.float32)
    weight = cuda.device_array((stripes, width), np.float32)
    valid = cuda.device_array((stripes, width), np.uint8)
    first_row, phase, clear = (cuda.to_device(one) for one in (first_row, phase, clear.astype(np.uint8)))
    low, high = (np.float32(limit) for limit in power_limits)
    over_columns = threads_for(weight.shape)
    hearing_kernels.windows[threads_for(window.shape)](columns, first_row, phase, ear.taps, window)
    hearing_kernels.channels[threads_for(raw.shape)](window, ear.basis, raw)
    hearing_kernels.whiten[threads_for(white.shape)](raw, ear.half_taps, white)
    hearing_kernels.texture_power[threads_for(power.shape)](white, ear.usual, power)
    hearing_kernels.believe[over_columns](power, clear, TEXTURE_PX // 2, low, high, valid)
    hearing_kernels.weigh[over_columns](valid, ear.taper, weight)
    return white, weight


def spoken(ear: EarThere, white: Kept, weight: Kept, *, first_bin: int) -> Kept:
    """Return what the energies of the filters say, [stripe, column], on the card."""
    stripes, width, channels = white.shape
    bins, filters = ear.filters.shape[1:3]
    spectrum = cuda.device_array((stripes, bins, channels, 2), np.float32)
    through = cuda.device_array((stripes, filters, bins, 2), np.float32)
    p = cuda.device_array((stripes, filters, width), np.float32)
    said = cuda.device_array((stripes, width), np.float32)
    hearing_kernels.spectra[threads_for(spectrum.shape[:3])](white, weight, ear.turn, first_bin, spectrum)
    hearing_kernels.let_through[threads_for(through.shape[:3])](spectrum, ear.filters, ear.share, through)
    hearing_kernels.sounds[threads_for(p.shape)](through, ear.turn, first_bin, p)
    least = np.float32(TEMPER)
    hearing_kernels.say[threads_for(said.shape)](p, ear.sign, ear.half_bell, least, ear.mean, ear.trust, said)
    return said
