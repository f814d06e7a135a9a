"""Following a film while it is being made: groups are played as they arrive.

The passage cannot be learned as a whole before it is there: what is learned is its first groups, so that the reading is another
one than that of a plain transfer, and its manifest says so. It does not depend on when groups came.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from gramoscope.apparatus.capture import Capture, open_capture
from gramoscope.apparatus.filming import wait_for_groups, whole_groups
from gramoscope.apparatus.frame_log import GrowingLog
from gramoscope.errors import require

LEARNED_GROUPS = 64


@dataclass(frozen=True, eq=False)
class Following:
    """A capture that grows.

    Attributes
    ----------
    capture : Capture
        As many groups as there will be; its log fills.
    growing : GrowingLog or None
    """

    capture: Capture
    growing: GrowingLog | None

    @property
    def learned_groups(self) -> int:
        """So many groups, the first, are learned from."""
        return min(LEARNED_GROUPS, self.capture.group_count)

    def has(self, groups: int) -> bool:
        """Tell whether so many groups are whole, or the film is done."""
        whole = whole_groups(self.capture.folder)
        return whole is None or whole >= groups

    def wait(self, groups: int, looked: Callable[[], None] = lambda: None) -> None:
        """Wait until so many groups are whole or the film is done, and know where they were taken."""
        wait_for_groups(self.capture.folder, groups, looked=looked)
        if self.growing is not None:
            self.growing.grow()


def follow(folder: Path) -> Following:
    """Wait for a film to begin, and open it.

    Parameters
    ----------
    folder : Path
        Of the capture; may not be there yet.

    Raises
    ------
    ArgumentError
        If it is a video, which can only be read when it is done.
    """
    wait_for_groups(folder, 1)
    opened = open_capture(folder)
    require(opened.layout != "video", "following a video", "frames in files or in Zarr", "play it when it is done")
    if opened.manifest.log is None:
        return Following(opened, None)
    growing = GrowingLog(folder / opened.manifest.log, sequence=opened.bench.sequence)
    return Following(replace(opened, log=growing.log), growing)
