"""Where the work on the pixels is done: on the processor, or on a graphics card.

What touches the film or hears the texture is a few kernels; a device has them all. Arrays that lie *where the device keeps
them* come from it and go back to it: they have a `shape`, and nobody else looks into them. Small arrays (shifts, paths, what a
stripe says) are NumPy's, wherever they were made. The parts, and the order in which they are played, are the same on every
device; answers differ by the rounding of single precision, for sums are taken in another order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy.typing as npt

from gramoscope.conventions import BoolArray, Float32Array, FloatArray, IntArray
from gramoscope.signal_path import FrameGroup

if TYPE_CHECKING:
    import numpy as np

    from gramoscope.pickup.overlay import Overlay
    from gramoscope.pickup.texture.hearing import Ear, Told
    from gramoscope.pickup.texture.layout import StripeLayout
    from gramoscope.pickup.texture.sharpness import Sharpness
    from gramoscope.pickup.texture.stretch import Stretch
    from gramoscope.pickup.texture.tone import Tone

Kept = Any
"""An array that lies where a device keeps it."""


@dataclass(frozen=True, eq=False)
class Film:
    """The film of a group on a device.

    Attributes
    ----------
    group : FrameGroup
        At least one frame valid.
    images : uint8 or uint16 array, shape (valid frame, row, column)
        Where the device keeps it.
    device : Device
    """

    group: FrameGroup
    images: Kept
    device: Device


class Device(Protocol):
    """What works on pixels; may be used by several threads at once."""

    @property
    def name(self) -> str:
        """What it is, for reports."""
        ...

    def film(self, group: FrameGroup) -> Film:
        """Return the valid frames of a group, copied to the device once."""
        ...

    def frame_shifts(self, film: Film) -> tuple[FloatArray, FloatArray]:
        """Return how far the record turned by each frame, and from frame to frame; see `registration.frame_shifts`."""
        ...

    def sharpness(self, film: Film, shift_px: FloatArray) -> Sharpness:
        """Return where the picture is sharp; see `texture.sharpness`."""
        ...

    def overlay(
        self, film: Film, shift_px: FloatArray, frame_index: npt.NDArray[np.int64], wanted: BoolArray
    ) -> Overlay:
        """Lay the frames over each other; see `overlay.overlay`. Its columns lie where the device keeps them."""
        ...

    def places_brighter(self, columns: Kept, level: float) -> IntArray:
        """Return column and row of all points that reach a level, shape (place, 2)."""
        ...

    def part(self, columns: Kept, part: slice) -> Float32Array:
        """Return some columns of a picture as NumPy's array."""
        ...

    def in_tone(self, columns: Kept, tone: Tone) -> Kept:
        """Return a picture seen in a tone."""
        ...

    def told(
        self,
        ear: Ear,
        layout: StripeLayout,
        stretch: Stretch,
        *,
        least_support: float,
        power_limits: tuple[float, float],
    ) -> Told:
        """Return what the stripes of an ear say of the present path of both walls; see `texture.hearing.told`."""
        ...
