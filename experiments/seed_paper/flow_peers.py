"""Flow programs of others, with the settings that they bring, and how long a flow takes."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from gramoscope.pickup.flow.horn_schunck import Flow
from gramoscope.signal_path import ImageArray

PairFlow = Callable[[ImageArray, ImageArray], Flow]
ENOUGH_S, RUNS = 1.5, 5


def peers() -> tuple[dict[str, PairFlow], list[str]]:
    """Return the programs that are installed, by name, and a sentence for each that is not."""
    found: dict[str, PairFlow] = {}
    missing = []
    try:
        found |= _opencv()
    except ImportError:
        missing.append("OpenCV is not installed, so DIS and Farnebäck are left out (extra `peers`).")
    try:
        found |= _scikit_image()
    except ImportError:
        missing.append("scikit-image is not installed, so ILK and TV-L1 are left out (extra `peers`).")
    return found, missing


def _opencv() -> dict[str, PairFlow]:
    import cv2

    cv2.setNumThreads(1)
    presets = {"DIS, fast": cv2.DISOPTICAL_FLOW_PRESET_FAST, "DIS, medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM}

    def dis(preset: int) -> PairFlow:
        return lambda a, b: _of_last_axis(cv2.DISOpticalFlow_create(preset).calc(a, b, None))

    def farneback(a: ImageArray, b: ImageArray) -> Flow:
        # the values of OpenCV's own example: pyramid ½, 3 levels, window 15, 3 rounds, polynomials over 5 at σ = 1.2
        return _of_last_axis(cv2.calcOpticalFlowFarneback(a, b, None, 0.5, 3, 15, 3, 5, 1.2, 0))

    return {f"OpenCV {name}": dis(preset) for name, preset in presets.items()} | {"OpenCV Farnebäck": farneback}


def _of_last_axis(field: np.ndarray) -> Flow:
    return Flow(field[..., 0], field[..., 1])


def _scikit_image() -> dict[str, PairFlow]:
    from skimage.registration import optical_flow_ilk, optical_flow_tvl1

    def of(method: Callable[[ImageArray, ImageArray], np.ndarray]) -> PairFlow:
        def flow(a: ImageArray, b: ImageArray) -> Flow:
            v, u = method(a, b)
            return Flow(u, v)

        return flow

    return {"scikit-image ILK": of(optical_flow_ilk), "scikit-image TV-L1": of(optical_flow_tvl1)}


def timed(work: Callable[[], Flow]) -> tuple[Flow, float]:
    """Return a flow and the shortest of a few runs, in seconds; the first run, which may compile, does not count."""
    flow = work()
    seconds: list[float] = []
    while len(seconds) < RUNS and sum(seconds) < ENOUGH_S:
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return flow, min(seconds)
