"""Opening whatever can be played: a film, a folder of photographs, or one picture."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from gramoscope.apparatus.capture import Capture, open_capture
from gramoscope.apparatus.manifest_still import StillManifest, is_still
from gramoscope.apparatus.still import StillCapture, is_picture, open_picture, open_stills
from gramoscope.errors import require


def opened(path: Path, known: StillManifest | None = None) -> Capture | StillCapture:
    """Open a capture.

    Parameters
    ----------
    path : Path
        A folder with `capture.toml`, or a picture.
    known : StillManifest, optional
        What somebody says of a picture. A folder says it in its `capture.toml`: there nothing may be said but the speed of
        photographs, which counts where `capture.toml` tells none.

    Returns
    -------
    Capture or StillCapture

    Raises
    ------
    CaptureError, ManifestError, NoFramesError
        See `open_capture`, `open_stills` and `open_picture`.
    ArgumentError
        If something is said of a folder.
    """
    if is_picture(path):
        return open_picture(path, known)
    known, nothing = known or StillManifest(()), StillManifest(())
    names = [one.name for one in fields(StillManifest) if one.name not in ("pictures", "rpm")]
    said = [name for name in names if getattr(known, name) != getattr(nothing, name)]
    require(
        not said,
        f"{', '.join(said)} said of the folder {path}",
        "nothing beside its capture.toml, which says what its pictures are",
        "mend capture.toml, or give one picture in place of the folder",
    )
    return open_stills(path, rpm=known.rpm) if is_still(path) else open_capture(path)
