"""Axes, signs, pixel origin; pixels ↔ metres ↔ seconds. Nowhere else.

*Groove frame*, right-handed: **s** forward along the groove, the way a stylus travels; **l** to the left of it, towards
the centre of the disc; **z** up, out of the disc; the land is z = 0. Depths below the land are written as positive
``…_below_land_m``.

*Image*, as every part of the program sees it ("canonical"): ``[row, column]``, pixel centres at integers, **s grows with
the column and l with the row**. Captures may be stored mirrored either way; `mirror` turns stored pictures into canonical
ones and back (it is its own inverse), and happens in `apparatus.capture` alone.

*Walls*: the **inner** wall is the one at larger l (nearer to the centre of the disc; the left channel of a 45/45
stereo groove), the **outer** one lies at smaller l (the right channel). Arrays over walls have the wall as first axis,
`INNER` first.

*Sound*: positive where the groove moves towards +l (lateral cut) or +z (vertical cut), and is the **velocity** of the
groove. For 45/45, with L and R the channels' velocities along the normals of their walls,

    lateral = (L + R) / √2,     vertical = (R − L) / √2,

so that equal channels are a lateral cut.
"""

from __future__ import annotations

from typing import Literal, TypeVar

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
ComplexArray = npt.NDArray[np.complex128]
BoolArray = npt.NDArray[np.bool_]
IntArray = npt.NDArray[np.int64]
Columns = Literal["forward", "backward"]
Rows = Literal["inward", "outward"]
Scalar = TypeVar("Scalar", bound=np.generic)

INNER = 0
OUTER = 1

MICROMETRES_PER_METRE = 1e6
MILLIMETRES_PER_METRE = 1e3


def mirror(images: npt.NDArray[Scalar], *, columns: Columns, rows: Rows) -> npt.NDArray[Scalar]:
    """Turn stored pictures into canonical ones, or back.

    Parameters
    ----------
    images : array, shape (..., row, column)
    columns : {"forward", "backward"}
        Whether s grows or falls with the stored column.
    rows : {"inward", "outward"}
        Whether l grows or falls with the stored row.

    Returns
    -------
    array, same shape
        A view.
    """
    if columns == "backward":
        images = images[..., ::-1]
    if rows == "outward":
        images = images[..., ::-1, :]
    return images


def mirror_row(row: float, *, height_px: int, rows: Rows) -> float:
    """Turn a stored row coordinate into a canonical one, or back."""
    return height_px - 1 - row if rows == "outward" else row


def arc_of_column_m(column: npt.ArrayLike, *, arc_start_m: float, pixel_pitch_m: float) -> FloatArray:
    """Return the place s along the groove that a canonical column shows, in metres."""
    return arc_start_m + np.asarray(column, np.float64) * pixel_pitch_m


def lateral_of_row_m(row: npt.ArrayLike, *, height_px: int, pixel_pitch_m: float, stage_m: float = 0.0) -> FloatArray:
    """Return the lateral place l that a canonical row shows, in metres.

    l = 0 is the middle of the picture, (height − 1) / 2, when the stage is at zero; `stage_m` is the radial position of
    the microscope, positive inwards.
    """
    return (np.asarray(row, np.float64) - (height_px - 1) / 2) * pixel_pitch_m + stage_m


def row_of_lateral_px(
    lateral_m: npt.ArrayLike, *, height_px: int, pixel_pitch_m: float, stage_m: float = 0.0
) -> FloatArray:
    """Return the canonical row that shows the lateral place l; the inverse of `lateral_of_row_m`."""
    return (np.asarray(lateral_m, np.float64) - stage_m) / pixel_pitch_m + (height_px - 1) / 2


def stereo_of_motion(lateral: FloatArray, vertical: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the left and right channels of a 45/45 groove from its lateral and vertical velocity (any unit)."""
    return (lateral - vertical) / np.sqrt(2.0), (lateral + vertical) / np.sqrt(2.0)


def motion_of_stereo(left: FloatArray, right: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return lateral and vertical velocity of a 45/45 groove; the inverse of `stereo_of_motion`."""
    return (left + right) / np.sqrt(2.0), (right - left) / np.sqrt(2.0)


def rad(angle_deg: float) -> float:
    """Degrees, as people write them, to radians, as the program computes."""
    return float(np.deg2rad(angle_deg))


def deg(angle_rad: float) -> float:
    """Radians to degrees."""
    return float(np.rad2deg(angle_rad))
