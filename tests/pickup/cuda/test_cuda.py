"""The kernels for graphics cards in CUDA's simulator: in a process of its own, as Numba asks for it when imported."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from gramoscope.errors import ArgumentError
from gramoscope.pickup.processor import Processor
from gramoscope.player.devices import device_named
from gramoscope.player.recipe import load_recipe
from gramoscope.simulation.scene import filming_bench

SIMULATED = Path(__file__).with_name("simulated.py")


def _python(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    called = [sys.executable, *arguments]
    return subprocess.run(called, capture_output=True, text=True, check=False, env={**os.environ, **environment})


def test_every_kernel_equals_the_processors_in_the_simulator() -> None:
    if find_spec("numba.cuda") is None:
        pytest.skip("neither numba nor numba-cuda has a simulator here")
    ran = _python("-m", "pytest", "-q", "-p", "no:cacheprovider", str(SIMULATED), NUMBA_ENABLE_CUDASIM="1")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert " passed" in ran.stdout
    assert "skipped" not in ran.stdout


def test_a_card_that_is_not_there_is_told_with_a_remedy() -> None:
    told = _python(
        *("-c", "from gramoscope.player.devices import device_named; device_named('cuda')"),
        # neither the simulator nor a real card
        NUMBA_ENABLE_CUDASIM="0",
        CUDA_VISIBLE_DEVICES="-1",
    )
    assert told.returncode != 0
    assert "no graphics card that CUDA can use" in told.stderr
    assert "Needed: an NVIDIA card" in told.stderr
    assert "Try: leave --device out" in told.stderr


def test_nothing_of_cuda_is_imported_unless_it_is_asked_for() -> None:
    imports = "import gramoscope.player.play, gramoscope.player.devices as d; d.device_named('cpu')"
    asked = "import sys; print([name for name in sys.modules if 'numba.cuda.cudadrv' in name or 'pickup.cuda' in name])"
    told = _python("-c", f"{imports}; {asked}", NUMBA_ENABLE_CUDASIM="0")
    assert told.stdout.strip() == "[]", told.stderr


def test_names_of_devices() -> None:
    assert device_named("cpu") == Processor()
    with pytest.raises(ArgumentError, match="one of cpu, cuda"):
        device_named("tpu")


class _Card(Processor):
    @property
    def name(self) -> str:
        return "cuda: a card"


def test_a_recipe_reads_on_a_device_or_says_that_it_cannot() -> None:
    bench, card = filming_bench(), _Card()
    assert load_recipe("best").cartridge_for(bench, card).device is card
    assert load_recipe("best").cartridge_for(bench).device == Processor()
    assert load_recipe("seed-paper").cartridge_for(bench) is not None
    with pytest.raises(ArgumentError, match="'seed-paper' on cuda: a card"):
        load_recipe("seed-paper").cartridge_for(bench, card)
