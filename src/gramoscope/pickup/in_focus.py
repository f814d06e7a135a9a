"""Where the picture is in focus: sharp texture that moves as the record moves.

The paper marks "any location that has an optical flow vector": blurred regions have derivatives near zero and no flow worth
the name. We ask two things of a point: its gradient along the groove is strong (against the sharpest part of this stretch
and against what the whole picture shows anyhow), and its flow is the record's. Dirt on the optics is sharp and stands
still; noise is strong here and there and moves anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gramoscope.conventions import BoolArray
from gramoscope.pickup.flow.derivatives import Derivatives
from gramoscope.pickup.flow.horn_schunck import Flow


@dataclass(frozen=True)
class InFocus:
    """How a point earns its place.

    Parameters
    ----------
    contrast_share : float
        Least gradient along the groove, as a share of the sharpest region's root mean square.
    background_share : float
        Least gradient, as a multiple of the median over the whole picture (out-of-focus texture and camera noise).
    flow_tolerance_px : float
        Largest flow that remains after registration, along the groove and across it, pixels a frame.
    """

    contrast_share: float = 0.6
    background_share: float = 5.0
    flow_tolerance_px: float = 0.5

    def mask(self, derivatives: Derivatives, flow: Flow | None) -> BoolArray:
        """Return which points are in focus.

        Parameters
        ----------
        derivatives : Derivatives
            Scaled so that the sharpest region's root mean square gradient along the groove is 1.
        flow : Flow, optional
            What remains after registration; without one (a single frame) only sharpness decides.

        Returns
        -------
        bool array, shape (row, column)
        """
        strength = np.abs(derivatives.x)
        background = float(np.median(strength[:, ::4]))
        mask = strength >= max(self.contrast_share, self.background_share * background)
        if flow is not None:
            tolerance = self.flow_tolerance_px
            mask &= (np.abs(flow.u) <= tolerance) & (np.abs(flow.v) <= tolerance)
        return np.asarray(mask)
