"""Stitching: how neighbouring photographs of one row lie on each other, by what both show.

Both strips of the overlap are differentiated along the groove, so that what runs through all of them (land, walls) does not
drown what tells one place from another (dust, grain, the bends of the edges), and correlated as the textures of a film are
(`tonearm.splice`): the peak is found to some thousandths of a pixel, along the groove and across it. A match that is not
believed leaves the nominal step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from gramoscope.errors import require
from gramoscope.signal_path import StillPicture, Texture
from gramoscope.tonearm.splice import Match, Splice

SMOOTHING_PX = 1.0
MARGIN_PX = 4


@dataclass(frozen=True)
class Stitch:
    """How photographs are joined.

    Parameters
    ----------
    reach_px : int
        How far the true step may be from the nominal one, along the groove.
    row_reach_px : int
        The same across it.
    least_overlap_px : int
        Overlaps narrower than this are not believed.
    least_correlation : float
        Nor are matches worse than this.
    sure_px : float
        A match that is nearer to the nominal step than this says that it is the nominal one: over many turns a hundredth of
        a pixel would add up.
    """

    reach_px: int = 24
    row_reach_px: int = 12
    least_overlap_px: int = 24
    least_correlation: float = 0.4
    sure_px: float = 0.03

    def __post_init__(self) -> None:
        require(self.reach_px >= 1, f"a reach of {self.reach_px} pixels", "at least 1")
        require(self.row_reach_px >= 1, f"a reach of {self.row_reach_px} rows", "at least 1")
        require(0 < self.least_correlation < 1, f"a least correlation of {self.least_correlation}", "0 … 1")

    def texture(self, picture: StillPicture, start: int, stop: int) -> Texture:
        """Return some columns of a picture as a texture that can be matched.

        Parameters
        ----------
        picture : StillPicture
        start, stop : int
            Columns; those outside the picture, and the outermost few inside it, whose derivative is not known, are left out.
        """
        columns = picture.image.shape[1]
        start, stop = max(start, MARGIN_PX), min(stop, columns - MARGIN_PX)
        first, last = start - MARGIN_PX, min(stop + MARGIN_PX, columns)
        return Texture(
            strip=_derivative(picture, first, last)[:, MARGIN_PX : max(stop - first, MARGIN_PX)],
            arc_start_m=picture.arc_start_m + start * picture.pixel_pitch_m,
            pixel_pitch_m=picture.pixel_pitch_m,
            stage_m=picture.lateral_start_m,
        )

    def match(self, before: Texture, after: Texture) -> Match:
        """Return how the start of a picture lies on the end of the one before, by both nominal places.

        Parameters
        ----------
        before, after : Texture
            The second at its nominal place in the frame of the first.

        Returns
        -------
        Match
            NaN where none is believed, or the strips are too narrow.
        """
        if min(before.strip.shape[1], after.strip.shape[1]) < self.least_overlap_px:
            return Match(float("nan"), 0.0)
        rows = min(before.strip.shape[0], after.strip.shape[0])
        splice = Splice(
            reach_m=self.reach_px * before.pixel_pitch_m,
            row_reach_px=self.row_reach_px,
            least_overlap_px=self.least_overlap_px,
            least_correlation=self.least_correlation,
        )
        match = splice.match(_of_rows(before, rows), _of_rows(after, rows))
        within = self.sure_px * before.pixel_pitch_m
        return Match(_beyond(match.error_m, within), match.correlation, _beyond(match.row_error_m, within))


def _beyond(error_m: float, within_m: float) -> float:
    return 0.0 if abs(error_m) < within_m else error_m


def _derivative(picture: StillPicture, start: int, stop: int) -> npt.NDArray[np.float32]:
    """Derivative along the groove of what a picture shows, 0 where it shows nothing."""
    image = picture.image[:, start:stop].astype(np.float32) / np.float32(picture.white_level)
    if image.size == 0:
        return image
    slope = gaussian_filter(image, SMOOTHING_PX, order=(0, 1), mode="nearest")
    return np.ascontiguousarray(np.where(picture.seen[:, start:stop], slope, np.float32(0)))


def _of_rows(texture: Texture, rows: int) -> Texture:
    return Texture(
        np.ascontiguousarray(texture.strip[:rows]), texture.arc_start_m, texture.pixel_pitch_m, texture.stage_m
    )
