"""The processor: the device that every machine has. Arrays are NumPy's, kernels Numba's, one thread a group."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import BoolArray, Float32Array, FloatArray, IntArray
from gramoscope.pickup.device import Film
from gramoscope.pickup.overlay import Overlay, overlay, places_brighter
from gramoscope.pickup.registration import frame_shifts
from gramoscope.pickup.texture.hearing import Ear, Told, told
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.sharpness import Sharpness, sharpness
from gramoscope.pickup.texture.tone import Tone
from gramoscope.signal_path import FrameGroup

if TYPE_CHECKING:
    from gramoscope.pickup.texture.stretch import Stretch


@dataclass(frozen=True)
class Processor:
    """The processor; see `pickup.device.Device` for what each method does."""

    @property
    def name(self) -> str:
        """What it is, for reports."""
        return "cpu"

    def film(self, group: FrameGroup) -> Film:
        """Return the film as it is; a copy when frames are lost."""
        return Film(group, group.usable_images, self)

    def frame_shifts(self, film: Film) -> tuple[FloatArray, FloatArray]:
        """See `registration.frame_shifts`."""
        return frame_shifts(film.group)

    def sharpness(self, film: Film, shift_px: FloatArray) -> Sharpness:
        """See `texture.sharpness`."""
        return sharpness(film.images, shift_px)

    def overlay(
        self, film: Film, shift_px: FloatArray, frame_index: npt.NDArray[np.int64], wanted: BoolArray
    ) -> Overlay:
        """See `overlay.overlay`."""
        return overlay(film.images, shift_px, frame_index, wanted)

    def places_brighter(self, columns: Float32Array, level: float) -> IntArray:
        """See `overlay.places_brighter`."""
        return np.asarray(places_brighter(columns, np.float32(level)))

    def part(self, columns: Float32Array, part: slice) -> Float32Array:
        """Return a view."""
        return columns[part]

    def in_tone(self, columns: Float32Array, tone: Tone) -> Float32Array:
        """See `texture.tone`."""
        return tone(columns)

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
        return told(ear, layout, stretch, least_support=least_support, power_limits=power_limits)


PROCESSOR = Processor()
