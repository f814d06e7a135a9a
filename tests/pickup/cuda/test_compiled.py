"""The kernels compiled as for a card, which needs none: the simulator knows no types."""

from __future__ import annotations

import os
import re
from importlib.util import find_spec
from typing import Any

import pytest

SHIFTS = "pair_shifts"


def _signatures() -> list[tuple[Any, tuple[Any, ...]]]:
    from numba import types

    from gramoscope.pickup.cuda import film_kernels as film
    from gramoscope.pickup.cuda import hearing_kernels as hearing

    real, whole, byte, level = types.float32, types.int64, types.uint8, types.float64

    def of(kind: Any, axes: int) -> Any:
        return types.Array(kind, axes, "C")

    pictures = [of(types.uint8, 3), of(types.uint16, 3)]
    line, plane, block, deep = (of(real, axes) for axes in (1, 2, 3, 4))
    places, mask = of(whole, 2), of(byte, 2)
    return [
        *((film.pair_shifts, (one, of(level, 1), of(whole, 1), level, whole, of(level, 1))) for one in pictures),
        *((film.cell_energy, (one, of(whole, 1), of(whole, 1), line, plane)) for one in pictures),
        *((film.overlay_tiles, (one, places, plane, line, mask, plane)) for one in pictures),
        (film.hold_ends, (plane, whole, whole)),
        (film.any_brighter, (plane, real, of(types.int32, 1))),
        (film.compress, (plane, real, real, real, plane)),
        (hearing.windows, (plane, places, places, plane, block)),
        (hearing.channels, (block, block, block)),
        (hearing.whiten, (block, line, block)),
        (hearing.texture_power, (block, block, plane)),
        (hearing.believe, (plane, mask, whole, real, real, mask)),
        (hearing.weigh, (mask, line, plane)),
        (hearing.spectra, (block, plane, plane, whole, deep)),
        (hearing.let_through, (deep, deep, line, deep)),
        (hearing.sounds, (deep, plane, whole, block)),
        (hearing.say, (block, plane, line, real, line, line, plane)),
    ]


@pytest.mark.skipif(find_spec("numba_cuda") is None, reason="compiling for cards needs the extra gpu")
@pytest.mark.skipif(os.environ.get("NUMBA_ENABLE_CUDASIM") == "1", reason="the simulator compiles nothing")
def test_every_kernel_compiles_and_only_shifts_are_in_double_precision(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba import cuda, types
    from numba.cuda import dispatcher

    class Card:
        compute_capability = (7, 0)

    # functions that kernels call are compiled for the card that is there
    monkeypatch.setattr(dispatcher, "get_current_device", lambda: Card)
    for kernel, arguments in _signatures():
        code, _ = cuda.compile_ptx(kernel.py_func, types.void(*arguments), cc=Card.compute_capability)
        assert ".entry" in code
        assert bool(re.search(r"\.f64\b", code)) == (kernel.py_func.__name__ == SHIFTS), kernel.py_func.__name__
