"""`capture.toml`: what the apparatus is, in micrometres, millimetres and degrees, as people measure it.

The keys and their ranges are the pydantic models below; ``CAPTURE_FORMAT.md`` is the same in words. In the file the glass
edge and its side are those of the *stored* picture; in the `Bench` they are canonical (see `gramoscope.conventions`).
Numbers are read and written as decimals and only then made binary, so that a bench comes back to the last bit.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.manifest_bench import bench_of_file, file_of_bench, toml_of_file
from gramoscope.apparatus.manifest_errors import problems_of, several
from gramoscope.apparatus.manifest_tables import CaptureFile, FilmFile, Table
from gramoscope.camera.pattern import FramePattern, require_inside
from gramoscope.errors import ArgumentError, CaptureError, ManifestError

MANIFEST_NAME = "capture.toml"
DEFAULT_FRAMES = "frames/g{group:06d}.tif"


@dataclass(frozen=True)
class Manifest:
    """What `capture.toml` says.

    Attributes
    ----------
    bench : Bench
        Canonical.
    frames : str
        Where the frames lie, a pattern in {group} and {frame}.
    log : str or None
        Where the encoder's log lies.
    """

    bench: Bench
    frames: str = DEFAULT_FRAMES
    log: str | None = None


def read_manifest(path: Path) -> Manifest:
    """Read a manifest.

    Parameters
    ----------
    path : Path
        A `capture.toml`, or the folder it lies in.

    Returns
    -------
    Manifest

    Raises
    ------
    CaptureError
        If there is no such folder or file.
    ManifestError
        If a key is missing, unknown or out of its range, or a path leaves the folder. All problems are named at once.
    """
    file = path / MANIFEST_NAME if path.is_dir() else path
    content = validated(CaptureFile, load_toml(file), file=file)
    manifest = Manifest(_bench(content, file=file), content.sequence.frames, content.sequence.log)
    try:
        FramePattern(manifest.frames).require_distinct(groups=manifest.bench.sequence.groups)
        if manifest.log is not None:
            require_inside(manifest.log)
    except ArgumentError as error:
        raise ManifestError(f"{file}: {error.found}", error.needed, error.remedy) from None
    return manifest


def read_bench(path: Path) -> Bench:
    """Read a bench for filming: a manifest in which the number of groups and the place of the frames may be left out.

    Parameters
    ----------
    path : Path

    Returns
    -------
    Bench
        Canonical; one group when the file does not say how many.

    Raises
    ------
    CaptureError, ManifestError
        As `read_manifest`.
    """
    file = path / MANIFEST_NAME if path.is_dir() else path
    return _bench(validated(FilmFile, load_toml(file), file=file), file=file)


def write_manifest(path: Path, bench: Bench, *, frames: str = DEFAULT_FRAMES, log: str | None = None) -> None:
    """Write a manifest, so that `read_manifest` gives the same bench to the last bit.

    Parameters
    ----------
    path : Path
        The file; it is overwritten.
    bench : Bench
        Canonical.
    frames : str
    log : str, optional

    Raises
    ------
    ArgumentError
        If the bench holds a value that the format has no place for.
    """
    content = file_of_bench(bench, frames=frames, log=log)
    try:
        CaptureFile.model_validate(content)
    except ValidationError as error:
        raise ArgumentError(
            several(problems_of(error, CaptureFile, content)), "values that capture.toml can hold"
        ) from None
    path.write_text(toml_of_file(content), encoding="utf-8")


def load_toml(file: Path) -> dict[str, Any]:
    """Return the content of a manifest, its numbers as decimals; CaptureError or ManifestError if it is none."""
    try:
        return tomllib.loads(file.read_bytes().decode("utf-8-sig"), parse_float=Decimal)
    except (FileNotFoundError, NotADirectoryError):
        raise _no_manifest(file) from None
    except OSError as error:
        raise CaptureError(f"{file} cannot be read: {error.strerror}", "a file that may be read") from None
    except UnicodeDecodeError as error:
        raise ManifestError(f"{file} is not UTF-8 text: byte {error.start}", "TOML", "save it as UTF-8") from None
    except (tomllib.TOMLDecodeError, ValueError, RecursionError) as error:
        raise ManifestError(f"{file} is not TOML: {error}", "a file as in the format page", "mend that line") from None


def _no_manifest(file: Path) -> CaptureError:
    folder = file.parent
    found = f"there is no {file.name} in {folder}" if folder.is_dir() else f"there is no folder {folder}"
    return CaptureError(found, f"a folder with {MANIFEST_NAME} and frames", "check the path of the capture")


def validated(model: type[Table], content: dict[str, Any], *, file: Path) -> Any:
    """Return the content of a manifest as a model of it; ManifestError that names all problems at once."""
    try:
        return model.model_validate(content)
    except ValidationError as error:
        problems = problems_of(error, model, content)
        raise ManifestError(
            f"{file}: {several(problems)}", remedy="mend these lines; docs/reference/capture-format.md has all keys"
        ) from None


def _bench(content: FilmFile, *, file: Path) -> Bench:
    try:
        bench = bench_of_file(content)
        bench.rotation.radius_at_m(bench.passage_length_m)
    except ArgumentError as error:
        raise ManifestError(f"{file}: {error.found}", error.needed, error.remedy) from None
    return bench
