"""The response that was applied to `equalised.wav`: the curve as it is written down, and the filter as it is."""

from __future__ import annotations

from typing import Any

import numpy as np

from gramoscope.disc.characteristic_filter import AUDIO_BAND_HZ, playback_filter
from gramoscope.disc.characteristics import characteristic

POINTS = 121


def response_of(characteristic_name: str, *, rate_hz: float) -> dict[str, Any]:
    """Return both responses, for the report.

    Parameters
    ----------
    characteristic_name : str
    rate_hz : float

    Returns
    -------
    dict
        Decibels, 0 dB at 1 kHz by the curve, at frequencies evenly spaced on a logarithmic axis, 20 Hz … 20 kHz or 0.45 of
        the rate, if that is less.
    """
    curve = characteristic(characteristic_name)
    low_hz, high_hz = AUDIO_BAND_HZ[0], min(AUDIO_BAND_HZ[1], 0.45 * rate_hz)
    frequency_hz = np.geomspace(low_hz, high_hz, POINTS)
    written, made = (
        20 * np.log10(np.abs(response(frequency_hz)))
        for response in (curve.playback_response, playback_filter(curve, rate_hz=rate_hz).response)
    )
    return {
        "characteristic": curve.name,
        "title": curve.title,
        "corners_hz": {"shelf": curve.shelf_hz, "turnover": curve.turnover_hz, "rolloff": curve.rolloff_hz},
        "frequency_hz": frequency_hz,
        "curve_db": written,
        "filter_db": made,
        "largest_deviation_db": float(np.abs(made - written).max()),
    }
