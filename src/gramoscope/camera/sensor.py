"""The camera: its pixels, its numbers, and which way round it looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import Columns, Rows
from gramoscope.errors import require

Colour = Literal["mono", "rgb"]


@dataclass(frozen=True)
class Sensor:
    """A camera on a microscope.

    Parameters
    ----------
    width_px, height_px : int
    bits : int
        8 … 16, for each channel.
    colour : {"mono", "rgb"}
    pixel_pitch_m : float
        One pixel, measured on the record.
    columns : {"forward", "backward"}
        Whether s grows or falls with the stored column.
    rows : {"inward", "outward"}
        Whether l grows or falls with the stored row.
    """

    width_px: int = 1280
    height_px: int = 1024
    bits: int = 8
    colour: Colour = "mono"
    pixel_pitch_m: float = 0.5e-3 / 1280
    columns: Columns = "forward"
    rows: Rows = "inward"

    def __post_init__(self) -> None:
        require(
            self.width_px >= 16 and self.height_px >= 16, f"{self.width_px} × {self.height_px} px", "at least 16 × 16"
        )
        require(8 <= self.bits <= 16, f"the camera has {self.bits} bits", "8 … 16")
        require(self.pixel_pitch_m > 0, f"the pixel pitch is {self.pixel_pitch_m} m", "a positive length")
        require(self.colour in ("mono", "rgb"), f"colour is {self.colour!r}", '"mono" or "rgb"')
        require(self.columns in ("forward", "backward"), f"columns is {self.columns!r}", '"forward" or "backward"')
        require(self.rows in ("inward", "outward"), f"rows is {self.rows!r}", '"inward" or "outward"')

    @property
    def white_level(self) -> int:
        """The pixel value of full scale, 2**bits − 1."""
        return int(2**self.bits - 1)

    @property
    def dtype(self) -> npt.DTypeLike:
        """The smallest unsigned integer that holds a pixel."""
        return np.uint8 if self.bits == 8 else np.uint16

    @property
    def frame_shape(self) -> tuple[int, ...]:
        """Shape of one stored frame: (row, column), and (…, 3) for colour."""
        shape: tuple[int, ...] = (self.height_px, self.width_px)
        return (*shape, 3) if self.colour == "rgb" else shape
