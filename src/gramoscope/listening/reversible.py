"""A repaired sound and what was taken off it, so that both add up to the raw one, to the last bit of 24.

Rounding each for itself would leave an error of a step here and there. So raw and repaired sound are rounded as a WAV file
rounds them, and their difference is taken of the whole numbers. Where that is more than a file holds, the repaired sound gives
way.
"""

from __future__ import annotations

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.listening.sample_format import rounded

_BITS = 24
_STEPS = 2 ** (_BITS - 1)


def reversible(raw: FloatArray, repaired: FloatArray, *, full_scale_m_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the repaired sound and the difference, both on the steps of a 24-bit file.

    Parameters
    ----------
    raw, repaired : float64 arrays, shape (sample,)
        Velocity in metres a second; what is not finite counts as silence, what lies beyond full scale as full scale, as in
        `gramoscope.listening.broadcast_wave.WavWriter`.
    full_scale_m_s : float
        Of all three files.

    Returns
    -------
    repaired, difference : float64 arrays, shape (sample,)
        Whole steps of full_scale_m_s / 2²³: a file takes them without rounding, and as whole numbers
        repaired + difference = raw. A repaired sample beyond full scale stays there, so that whoever writes it clips it to
        the step that is meant, and counts it.
    """
    whole_raw, whole_repaired = (_steps(sound, full_scale_m_s) for sound in (raw, repaired))
    difference = np.clip(whole_raw - whole_repaired, -_STEPS, _STEPS - 1)
    step = full_scale_m_s / _STEPS
    left = whole_raw - difference
    beyond = np.abs(np.nan_to_num(repaired, nan=0.0)) > full_scale_m_s
    held = beyond & ((left == -_STEPS) | (left == _STEPS - 1))
    return np.where(held, repaired, left * step), difference * step


def _steps(sound: FloatArray, full_scale_m_s: float) -> FloatArray:
    scaled = sound / full_scale_m_s
    return rounded(np.where(np.isfinite(scaled), scaled, 0.0), bits=_BITS).astype(np.float64)
