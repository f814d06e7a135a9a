"""How far a flow is from the true one: the two measures of the literature.

The angular error of Barron, Fleet and Beauchemin (IJCV 12, 1994) is the angle between (u, v, 1) and (u₀, v₀, 1): it
tempers the errors of fast motion, and still has a meaning where nothing moves. The end-point error is the plain distance,
in pixels a frame.
"""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.pickup.flow.horn_schunck import Flow


def angular_error_rad(found: Flow, true: Flow) -> FloatArray:
    """Return the angle in space-time between two flows.

    Parameters
    ----------
    found, true : Flow
        Of shapes that broadcast. NaN in either gives NaN.

    Returns
    -------
    float64 array
        0 … π, from the cross and the scalar product of (u, v, 1) and (u₀, v₀, 1): exact for small angles, which the
        arc cosine is not.
    """
    u, v, u0, v0 = (np.asarray(c, np.float64) for c in (found.u, found.v, true.u, true.v))
    cross = np.sqrt((v - v0) ** 2 + (u - u0) ** 2 + (u * v0 - v * u0) ** 2)
    return np.asarray(np.arctan2(cross, u * u0 + v * v0 + 1))


def end_point_error_px(found: Flow, true: Flow) -> FloatArray:
    """Return the distance between two flows, pixels a frame.

    Parameters
    ----------
    found, true : Flow
        Of shapes that broadcast. NaN in either gives NaN.

    Returns
    -------
    float64 array
        Zero or more.
    """
    u, v, u0, v0 = (np.asarray(c, np.float64) for c in (found.u, found.v, true.u, true.v))
    return np.asarray(np.hypot(u - u0, v - v0))
