"""A transfer repeated from its report: the same capture, recipe, settings and words give the same bits.

Versions of the program and its libraries may have changed since; that is told, and the sums of the sound files say whether it
mattered. Other input is an error, unless it is wanted: then the transfer is a new one, made in the same way.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_type_hints

from pydantic import TypeAdapter, ValidationError

from gramoscope.apparatus.fingerprint import sha256_of_file
from gramoscope.apparatus.manifest import MANIFEST_NAME
from gramoscope.apparatus.manifest_still import StillManifest
from gramoscope.apparatus.opening import opened
from gramoscope.apparatus.still import is_picture
from gramoscope.errors import ArgumentError, CaptureError, GramoscopeError, require
from gramoscope.listening.broadcast_metadata import REFERENCE, ascii_text
from gramoscope.player.catalogue import Catalogue
from gramoscope.player.devices import device_of_report
from gramoscope.player.provenance import InputHashes, versions
from gramoscope.player.reading import AnyCapture
from gramoscope.player.recipe import Recipe, recipe_of_table
from gramoscope.player.report import REPORT_FORMAT

if TYPE_CHECKING:
    from gramoscope.player.play import Settings


@dataclass(frozen=True, eq=False)
class Again:
    """What a report says of how its transfer was made.

    Parameters
    ----------
    path : Path
        Of the report.
    report : mapping
    force : bool
        Whether other input is no error.
    """

    path: Path
    report: Mapping[str, Any]
    force: bool = False

    def capture_folder(self, given: Path | None = None) -> Path:
        """Return where the capture is: as given, else as the report says, seen from where the report lies now or lay then."""
        if given is not None:
            return given
        here = self.report.get("capture_from_here")
        places: list[Path] = [*([self.path.parent / here] if here else []), Path(self.report["capture"])]
        for place in places:
            if (place / MANIFEST_NAME).is_file() or (is_picture(place) and place.is_file()):
                return place
        raise CaptureError(
            f"the capture of {self.path} is neither at {' nor at '.join(map(str, places))}",
            "the capture that was played",
            f"say where it is now: gramoscope play CAPTURE --again {self.path}",
        )

    def opened(self, path: Path) -> AnyCapture:
        """Open the capture, with what was said of its pictures then."""
        told = self.report.get("still_manifest")
        if told is None:
            return opened(path)
        try:
            manifest = TypeAdapter(StillManifest).validate_json(json.dumps(told))
        except ValidationError as error:
            raise ArgumentError(
                f"{self.path}: still_manifest: {error.errors()[0]['msg']}", "as it was written"
            ) from error
        return opened(path, manifest if is_picture(path) else StillManifest((), rpm=manifest.rpm))

    def recipe(self) -> Recipe:
        """Return the recipe, with every parameter that it had."""
        return recipe_of_table({key: value for key, value in self.report["recipe"].items() if key != "sha256"})

    def settings(self, capture: AnyCapture, workers: int) -> Settings:
        """Return the settings, with the moment of then; a capture with another name keeps the old one as its reference."""
        from gramoscope.player.play import Settings

        known = {one.name for one in fields(Settings)} - {"catalogue", "device", "workers"}
        unknown = sorted(set(self.report["settings"]) - known)
        require(not unknown, f"{self.path} has settings that are unknown here: {', '.join(unknown)}", "", _REMEDY)
        words = dict(self.report["catalogue"])
        if not words["reference"] and capture.name != self.report["capture_name"]:
            words["reference"] = ascii_text(self.report["capture_name"])[:REFERENCE]
        catalogue = Catalogue(**words, made=datetime.fromisoformat(self.report["made"]))
        chosen = self._chosen(get_type_hints(Settings))
        return Settings(**chosen, catalogue=catalogue, device=device_of_report(self.report["device"]), workers=workers)

    def _chosen(self, kinds: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings as they were, tables made into what they are tables of."""
        chosen = {}
        for name, value in self.report["settings"].items():
            try:
                chosen[name] = TypeAdapter(kinds[name]).validate_json(json.dumps(value), strict=True)
            except ValidationError as error:
                raise ArgumentError(f"{self.path}: settings.{name} = {value!r}", error.errors()[0]["msg"]) from error
        return chosen

    def other_versions(self) -> dict[str, dict[str, str | None]]:
        """Return what has another version now: name → then and now."""
        then, now = self.report["versions"], versions()
        return {
            name: {"then": then.get(name), "now": now.get(name)}
            for name in sorted({*then, *now})
            if then.get(name) != now.get(name)
        }

    def require_same_files_in_common(self, capture: AnyCapture) -> None:
        """Look at the manifest and what else all groups share, before anything else is read."""
        found = InputHashes().as_dict(capture)["common_files"]
        self._require(_changed(self.report["inputs"]["common_files"], found))

    def judged(self, report: Mapping[str, Any]) -> dict[str, Any]:
        """Return what a repeated transfer is against its model, for its report; before its files are put in place.

        Raises
        ------
        CaptureError
            If the frames are others.
        """
        then, now = self.report["inputs"], report["inputs"]
        changed = _changed(then["common_files"], now["common_files"])
        if then["group_files"] != now["group_files"]:
            changed.append("the frames")
        self._require(changed)
        sums = {name: (file["sha256"], report["files"].get(name, {}).get("sha256")) for name, file in self._files()}
        return {
            "again": {
                "report_sha256": sha256_of_file(self.path),
                "made": self.report["made"],
                "same_files": [name for name, (old, new) in sums.items() if old == new],
                "other_files": [name for name, (old, new) in sums.items() if old != new],
                "other_versions": self.other_versions(),
                "other_inputs": changed,
            }
        }

    def _files(self) -> list[tuple[str, Mapping[str, Any]]]:
        return [(name, file) for name, file in self.report["files"].items() if "sha256" in file]

    def _require(self, changed: list[str]) -> None:
        if changed and not self.force:
            raise CaptureError(
                f"the capture is not the one that {self.path} was made of: {', '.join(changed)} differ",
                "the same files, byte for byte",
                "play the capture that was meant, or --force to play this one in the same way",
            )


_REMEDY = "use the version that the report names"


def load_again(path: Path, *, force: bool = False) -> Again:
    """Return what a report says of how its transfer was made.

    Parameters
    ----------
    path : Path
        A `report.json`.
    force : bool
        Whether other input is no error.

    Raises
    ------
    ArgumentError
        If it cannot be read, or is no report that a transfer can be repeated from.
    """
    needed = f"a report.json of {REPORT_FORMAT} that gramoscope play wrote"
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ArgumentError(f"{path} cannot be read: {error.strerror}", needed) from error
    except ValueError as error:
        raise ArgumentError(f"{path} is not JSON: {error}", needed) from error
    found = report.get("format") if isinstance(report, dict) else None
    require(found == REPORT_FORMAT, f"{path} is of the format {found!r}", needed)
    missing = [key for key in _NEEDED if key not in report]
    require(not missing, f"{path} does not say {', '.join(missing)}", needed, _REMEDY)
    return _looked_through(Again(path, report, force))


_NEEDED = (
    "settings",
    "catalogue",
    "made",
    "capture",
    "capture_name",
    "recipe",
    "inputs",
    "files",
    "versions",
    "device",
)


def _looked_through(again: Again) -> Again:
    """What was changed by hand fails here, in words, and not later."""
    try:
        again.recipe()
        datetime.fromisoformat(again.report["made"])
        Catalogue(**again.report["catalogue"])
    except GramoscopeError as error:
        raise ArgumentError(f"{again.path}: {error.found}", error.needed, error.remedy) from error
    except (TypeError, ValueError, AttributeError) as error:
        raise ArgumentError(f"{again.path}: {error}", "a report as it was written", "take the original") from error
    return again


def _changed(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    return [name for name in sorted({*then, *now}) if then.get(name) != now.get(name)]
