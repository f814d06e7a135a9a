"""Frames that show nothing are sorted out, with a reason."""

import numpy as np
import pytest

from gramoscope.camera.exposure import Exposure
from gramoscope.quality import Quality
from gramoscope.signal_path import FrameGroup


def _group(**spoilt: int) -> FrameGroup:
    rng = np.random.default_rng(1)
    images = rng.normal(100, 20, (5, 67, 90)).clip(0, 255).astype(np.uint8)
    if "black" in spoilt:
        images[spoilt["black"]] = 1
    if "blank" in spoilt:
        images[spoilt["blank"]] = 128
    if "white" in spoilt:
        images[spoilt["white"], :, :20] = 255
    valid = np.ones(5, bool)
    if "lost" in spoilt:
        images[spoilt["lost"]] = 0
        valid[spoilt["lost"]] = False
    return FrameGroup(9, images, 7e-3 + np.arange(5) * 8e-7, np.zeros(5), 4e-7, 255, valid, ("told before",))


@pytest.mark.parametrize(
    ("spoilt", "flag"),
    [
        ({}, Quality(0)),
        ({"lost": 2}, Quality.FRAME_LOST),
        ({"black": 4}, Quality.DARK),
        ({"blank": 0}, Quality.DARK),
        ({"white": 3}, Quality.SATURATED),
        ({"white": 3, "black": 1, "lost": 0}, Quality.SATURATED | Quality.DARK | Quality.FRAME_LOST),
    ],
)
def test_useless_frames_are_set_aside_with_their_reason(spoilt: dict[str, int], flag: Quality) -> None:
    group = _group(**spoilt)
    sorted_out, flags = Exposure().sort_out(group)
    assert flags == flag
    assert set(np.flatnonzero(~sorted_out.valid)) == set(spoilt.values())
    # a lost frame was told of when it was read
    assert len(sorted_out.problems) == 1 + sum(kind != "lost" for kind in spoilt)
    assert all(f"frame {k}" in " ".join(sorted_out.problems) for kind, k in spoilt.items() if kind != "lost")
    assert group.valid.sum() == 5 - ("lost" in spoilt)


def test_a_few_burnt_out_grains_are_no_reason() -> None:
    group = _group()
    group.images[2, ::4, ::5] = 255
    assert Exposure().sort_out(group)[1] == Quality(0)
    assert Exposure(saturated_share=0.02).sort_out(group)[1] == Quality.SATURATED
