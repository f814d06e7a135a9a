"""Provenance: from what, with what and how a transfer was made."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
import sys
from dataclasses import asdict, dataclass, field
from importlib.metadata import PackageNotFoundError, version
from os.path import relpath
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

from gramoscope.apparatus.fingerprint import sha256_of_file
from gramoscope.camera.contents import Contents
from gramoscope.player.recipe import Recipe, table_of_recipe

if TYPE_CHECKING:
    from gramoscope.player.play import Settings
    from gramoscope.player.reading import AnyCapture

_LIBRARIES = ("gramoscope", "numpy", "scipy", "numba", "llvmlite", "soxr", "soundfile", "tifffile", "zarr", "pillow")
_OPTIONAL = ("numba-cuda", "av")
_NOT_AMONG_SETTINGS = ("workers", "catalogue", "device")
"""The result does not depend on them, or they stand elsewhere in the report."""


def versions() -> dict[str, str]:
    """Return the versions of everything that a result depends on."""
    return {
        **{name: version(name) for name in _LIBRARIES},
        **_versions_of_those_installed(_OPTIONAL),
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
    }


def _versions_of_those_installed(names: tuple[str, ...]) -> dict[str, str]:
    found = {}
    for name in names:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def bench_of(capture: AnyCapture) -> dict[str, Any]:
    """Return the apparatus in plain numbers, SI units."""
    return capture.bench.as_dict()


def settings_of(settings: Settings) -> dict[str, Any]:
    """Return what the listener chose beside recipe, catalogue and device, as far as the result depends on it."""
    left_out = {*_NOT_AMONG_SETTINGS, *([] if settings.groove is not None else ["groove"])}
    return {name: value for name, value in asdict(settings).items() if name not in left_out}


def from_folder(path: Path, folder: Path) -> str | None:
    """Return the way from a folder to a path, with slashes; None where there is none (another drive)."""
    try:
        return PurePath(relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:
        return None


def recipe_of(recipe: Recipe) -> dict[str, Any]:
    """Return the recipe with all its parameters, and a sum over what it does: the same for the same under another name."""
    table = table_of_recipe(recipe)
    choices = {name: part for name, part in table.items() if name not in ("name", "about")}
    return {**table, "sha256": hashlib.sha256(json.dumps(choices, sort_keys=True).encode()).hexdigest()}


@dataclass
class InputHashes:
    r"""SHA-256 of everything that was read: one sum for each file common to all groups, one over the files of the groups.

    The sum over the groups is that of the lines ``<sum>  <path>\n`` in order of the groups, as `sha256sum` prints them, so
    that a transfer of a million files needs no list of a million lines.
    """

    files: int = 0
    _lines: Any = field(default_factory=hashlib.sha256)

    def add(self, sums: dict[str, str]) -> None:
        """Take in the sums of one group's files."""
        for path, digest in sums.items():
            self._lines.update(f"{digest}  {path}\n".encode())
            self.files += 1

    def as_dict(self, capture: AnyCapture) -> dict[str, Any]:
        """Return all sums, for the report."""
        return {
            "common_files": {_inside(capture, path): sha256_of_file(path) for path in capture.common_files()},
            "group_files": {"count": self.files, "sha256_of_sha256sum_lines": self._lines.hexdigest()},
        }


def hash_group(capture: AnyCapture, number: int, read: Contents | None = None) -> dict[str, str]:
    """Return path → SHA-256 of the files that hold one group; an unreadable file has an empty sum.

    Files that were summed when they were read are not read again.
    """
    sums = read.sums if read is not None else {}
    return {
        _inside(capture, path): sums[path] if path in sums else sha256_of_file(path)
        for path in capture.files_of_group(number)
    }


def _inside(capture: AnyCapture, path: Path) -> str:
    return path.relative_to(capture.folder).as_posix()


def command_line() -> str:
    """Return the command as it was typed."""
    return " ".join(["gramoscope", *sys.argv[1:]])
