"""On what a reading depends: apparatus, places, recipe, device, versions. Where one of them is another, it is made again.

What comes after the pickup (splice, smoother, rate, characteristic, repairs, words for the catalogue) is not among them: the
same reading serves all.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

from gramoscope.apparatus.capture import Capture
from gramoscope.apparatus.fingerprint import sha256_of_file
from gramoscope.pickup.device import Device
from gramoscope.player.provenance import versions
from gramoscope.player.recipe import Recipe, table_of_recipe

READING_FORMAT = "gramoscope-reading/2"
_DOES_NOT_READ = ("soxr", "soundfile", "system")
_READS = ("apparatus", "camera", "disc", "microscope", "pickup", "turntable")
_NOT_FOR_READING = ("notes", "characteristic")
"""What [disc] says to people, or to parts that come later."""
_SMALL_BYTES = 16_000_000
"""A larger file in common, a video, is known by its size and time of writing."""


def manifest_of(capture: Capture, recipe: Recipe, device: Device) -> dict[str, str]:
    """Return what a reading depends on: name → text or sum.

    Parameters
    ----------
    capture : Capture
    recipe : Recipe
    device : Device
    """
    return {
        "format": READING_FORMAT,
        "the apparatus in capture.toml": _sum(_apparatus(capture)),
        **{f"the file {path.name}": _known_by(path) for path in capture.common_files()[1:]},
        "[pickup] of the recipe": _sum(table_of_recipe(recipe)["pickup"]),
        "device": device.name,
        **{name: one for name, one in versions().items() if name not in _DOES_NOT_READ},
        "the program's code": _sum_of_code(),
    }


def key_of(manifest: Mapping[str, str]) -> str:
    """Return one sum for all."""
    return _sum(dict(manifest))


def differences(then: Mapping[str, str], now: Mapping[str, str]) -> Iterator[str]:
    """Say in words what is another now."""
    for name in sorted({*then, *now}):
        old, new = then.get(name), now.get(name)
        if old != new:
            plain = all(one is None or len(one) < 40 for one in (old, new))
            yield f"{name} was {old or 'absent'} and is {new or 'absent'}" if plain else f"{name} is another"


def _apparatus(capture: Capture) -> dict[str, Any]:
    bench = asdict(capture.bench)
    return {
        "frames": capture.manifest.frames,
        **{name: one for name, one in bench.items() if name != "disc"},
        "disc": {name: one for name, one in bench["disc"].items() if name not in _NOT_FOR_READING},
    }


def _known_by(path: Path) -> str:
    try:
        status = path.stat()
    except OSError:
        return ""
    if status.st_size > _SMALL_BYTES:
        return f"{status.st_size} bytes of {status.st_mtime_ns} ns"
    return sha256_of_file(path)


def _sum(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


def _sum_of_code() -> str:
    """A sum over all modules that reading depends on: versions in the making have all one number."""
    package = resources.files("gramoscope")
    total = hashlib.sha256()
    for folder in _READS:
        for path in sorted(Path(str(package.joinpath(folder))).rglob("*.py")):
            total.update(f"{path.name}\0".encode() + path.read_bytes())
    return total.hexdigest()
