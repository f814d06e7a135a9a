"""Devices by the names that the command line gives them. What a graphics card needs is imported only when one is asked for."""

from __future__ import annotations

from importlib.util import find_spec

from gramoscope.errors import ArgumentError, require
from gramoscope.pickup.device import Device
from gramoscope.pickup.processor import PROCESSOR

DEVICES = ("cpu", "cuda")


def device_named(name: str) -> Device:
    """Return a device.

    Parameters
    ----------
    name : {"cpu", "cuda"}

    Raises
    ------
    ArgumentError
        If there is no such device, or no card that speaks CUDA, or nothing installed to speak to it.
    """
    require(name in DEVICES, f"device {name!r}", f"one of {', '.join(DEVICES)}")
    return PROCESSOR if name == "cpu" else _graphics_card()


def device_of_report(name: str) -> Device:
    """Return the kind of device that a report names, as it is here; see `device_named`."""
    return device_named(name.split(":")[0])


def _graphics_card() -> Device:
    try:
        from numba import cuda
    except ImportError as error:
        raise ArgumentError("Numba has no CUDA", "the package numba-cuda", INSTALL) from error
    if not cuda.is_available():
        installed = find_spec("numba_cuda") is not None
        raise ArgumentError(
            "no graphics card that CUDA can use"
            + (f" ({_reason(cuda.cuda_error())})" if installed else ", and numba-cuda is not installed"),
            "an NVIDIA card, its driver, and numba-cuda with the CUDA toolkit's compiler",
            "leave --device out: the processor reads the same"
            + ("" if installed else f"; where there is a card, {INSTALL}"),
        )
    from gramoscope.pickup.cuda.graphics_card import GraphicsCard

    card = getattr(cuda.current_context().device, "name", "simulated")
    return GraphicsCard(f"cuda: {card.decode() if isinstance(card, bytes) else card}")


INSTALL = 'pip install "gramoscope[gpu]"'


def _reason(error: object) -> str:
    """The first sentence of what the driver says; it may be nothing."""
    lines = [line.strip() for line in str(error or "").splitlines()]
    return next((line.rstrip(".") for line in lines if line and not line.endswith(":")), "the driver does not say why")
