"""The exceptions of Gramoscope.

    GramoscopeError
    ├── ArgumentError (also a ValueError)     an argument is impossible: a negative thickness, an unknown recipe
    ├── CaptureError                          a capture cannot be used at all
    │   ├── ManifestError                     capture.toml: a key is missing, unknown or out of its range
    │   └── NoFramesError                     the manifest is fine, and not one frame can be read
    ├── SoundError                            a sound file cannot be read, or is of no use
    ├── TransferError                         a folder is no whole transfer: no report, a file missing, a sum that differs
    ├── FilmingError                          a film that is followed does not go on
    ├── WorkerError                           a worker of a cluster cannot read, or would read otherwise
    └── OutputError                           the results cannot be written: a full disk, a folder without permission

An exception is for the caller's failure. Where the *world* fails locally (dust, a chipped wall, a lost frame) nothing is
raised: the sample is flagged (`gramoscope.quality`) and the playing goes on.

Every message says three things: what was found, what was needed, and what to do. `GramoscopeError` takes them as three
arguments so that none is forgotten.
"""

from __future__ import annotations


class GramoscopeError(Exception):
    """Something the caller must change before it can work.

    Parameters
    ----------
    found : str
        What was found, with values and units.
    needed : str
        What was needed instead.
    remedy : str
        What the reader of the message can do about it.
    """

    def __init__(self, found: str, needed: str = "", remedy: str = "") -> None:
        self.found = found
        self.needed = needed
        self.remedy = remedy
        super().__init__(found, needed, remedy)

    def __str__(self) -> str:
        lines = [self.found]
        if self.needed:
            lines.append(f"Needed: {self.needed}")
        if self.remedy:
            lines.append(f"Try: {self.remedy}")
        return "\n".join(lines)


class ArgumentError(GramoscopeError, ValueError):
    """An argument is impossible."""


class CaptureError(GramoscopeError):
    """A capture cannot be used."""


class ManifestError(CaptureError):
    """A key of `capture.toml` is missing, unknown or out of its range."""


class NoFramesError(CaptureError):
    """The manifest is fine, and not one frame can be read."""


class SoundError(GramoscopeError):
    """A sound file cannot be read, or is of no use."""


class TransferError(GramoscopeError):
    """A folder is no whole transfer."""


class OutputError(GramoscopeError):
    """The results cannot be written."""


class FilmingError(GramoscopeError):
    """A film that is followed does not go on."""


class WorkerError(GramoscopeError):
    """Somebody who is to read pieces of a passage cannot, or would read otherwise."""


def require(condition: bool, found: str, needed: str = "", remedy: str = "") -> None:
    """Raise `ArgumentError` unless `condition` holds."""
    if not condition:
        raise ArgumentError(found, needed, remedy)
