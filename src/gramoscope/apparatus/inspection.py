"""What is in a capture, what is wrong with it, and what it will sound like, before anybody plays it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.capture import Capture, spans
from gramoscope.apparatus.frame_log import nominal_arc_m
from gramoscope.camera.exposure import Exposure
from gramoscope.conventions import MICROMETRES_PER_METRE, FloatArray
from gramoscope.signal_path import FrameGroup
from gramoscope.turntable.rotation import pixel_rate_hz

EXPOSURE = Exposure()
NEAR_EDGE_M = 5e-6
"""A stripe this near to the edge of the glass is hidden by the swing of a quiet passage: a guess."""
_SAMPLED_GROUPS = 5


@dataclass(frozen=True)
class GroupFinding:
    """What is wrong with one group.

    Attributes
    ----------
    number : int
    frames_found : int
        How many of its frames are there.
    dark, saturated : tuple of int
        Which frames show no light or no contrast, and which are too bright.
    problems : tuple of str
        All of it in words.
    """

    number: int
    frames_found: int
    dark: tuple[int, ...] = ()
    saturated: tuple[int, ...] = ()
    problems: tuple[str, ...] = ()


@dataclass(frozen=True)
class Inspection:
    """What is in a capture.

    Attributes
    ----------
    folder, layout : str
    bench : Bench
        Canonical.
    groups_expected, frames_expected, frames_found : int
    complete : bool
        Whether every frame was looked at, or a sample only (then `frames_found` counts files for the rest).
    groups : tuple of GroupFinding
        The groups with something wrong, in order.
    stripe_rows : tuple of float
        Canonical rows where sharp stripes are expected.
    passage_m, seconds : float
        How much groove it shows, and how long that sounds.
    groove_speed_m_s, pixel_rate_hz : float
        At s = 0 (paper, section 7).
    overlap_m, smallest_overlap_m : float
        How much of the picture neighbouring groups share, from the log if there is one: the median, and the least;
        None for a single group.
    size_bytes : int
        Of all files in the folder.
    findings : tuple of str
        What is wrong with the whole, in words.
    """

    folder: str
    layout: str
    bench: Bench
    groups_expected: int
    frames_expected: int
    frames_found: int
    complete: bool
    groups: tuple[GroupFinding, ...]
    stripe_rows: tuple[float, ...]
    passage_m: float
    seconds: float
    groove_speed_m_s: float
    pixel_rate_hz: float
    overlap_m: float | None
    smallest_overlap_m: float | None
    size_bytes: int
    findings: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether nothing at all was found wrong."""
        return not self.groups and not self.findings

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts, lists and dicts, as for JSON."""
        return asdict(self)


def inspect(capture: Capture, *, quick: bool = False, progress: Callable[[int, int], None] | None = None) -> Inspection:
    """Look through a capture.

    Parameters
    ----------
    capture : Capture
    quick : bool
        Only see whether the files are there, and read a few groups spread over the whole.
    progress : callable, optional
        Called with the number of groups done and the number of all.

    Returns
    -------
    Inspection
    """
    bench, count = capture.bench, capture.group_count
    read = set(np.linspace(0, count - 1, min(count, _SAMPLED_GROUPS)).astype(int).tolist()) if quick else range(count)
    groups = []
    for number in range(count):
        groups.append(finding_of_group(capture.group(number)) if number in read else _presence(capture, number))
        if progress is not None:
            progress(number + 1, count)
    overlaps_m = overlaps_of(capture)
    speed_m_s = float(bench.rotation.speed_at_m_s(0.0))
    return Inspection(
        folder=str(capture.folder),
        layout=capture.layout,
        bench=bench,
        groups_expected=count,
        frames_expected=count * bench.sequence.frames_per_group,
        frames_found=sum(group.frames_found for group in groups),
        complete=not quick or len(read) == count,
        groups=tuple(group for group in groups if group.problems),
        stripe_rows=bench.stripe_rows(),
        passage_m=bench.passage_length_m,
        seconds=float(bench.rotation.time_of_arc_s(bench.passage_length_m)),
        groove_speed_m_s=speed_m_s,
        pixel_rate_hz=pixel_rate_hz(speed_m_s, pixel_pitch_m=bench.sensor.pixel_pitch_m),
        overlap_m=float(np.median(overlaps_m)) if overlaps_m.size else None,
        smallest_overlap_m=float(overlaps_m.min()) if overlaps_m.size else None,
        size_bytes=sum(path.stat().st_size for path in capture.folder.rglob("*") if path.is_file()),
        findings=(*capture.problems, *findings_of_stripes(bench), *_findings_of_overlap(overlaps_m)),
    )


def frame_bytes(bench: Bench) -> int:
    """Return the size of a frame as the camera gives it, uncompressed."""
    return int(np.prod(bench.sensor.frame_shape)) * np.dtype(bench.sensor.dtype).itemsize


def finding_of_group(group: FrameGroup) -> GroupFinding:
    """Return what is wrong with the frames of one group.

    Parameters
    ----------
    group : FrameGroup

    Returns
    -------
    GroupFinding
        Without problems when all is well. Lost frames are not counted among the dark ones.
    """
    usable = np.flatnonzero(group.valid).tolist()
    dark = tuple(k for k in usable if EXPOSURE.is_dark(group.images[k], white_level=group.white_level))
    saturated = tuple(k for k in usable if EXPOSURE.is_saturated(group.images[k], white_level=group.white_level))
    problems = list(group.problems)
    if dark:
        problems.append(f"{spans(list(dark))}: no light or no contrast")
    if saturated:
        problems.append(f"{spans(list(saturated))}: too bright, more than {EXPOSURE.saturated_share:.0%} at full scale")
    return GroupFinding(group.number, len(usable), dark, saturated, tuple(problems))


def _presence(capture: Capture, number: int) -> GroupFinding:
    files = capture.files_of_group(number)
    absent = [path.name for path in files if not path.is_file()]
    expected = capture.bench.sequence.frames_per_group
    found = expected - round(expected * len(absent) / len(files)) if files else expected
    return GroupFinding(number, found, problems=tuple(f"{name} is missing" for name in absent))


def overlaps_of(capture: Capture) -> FloatArray:
    """Return how much of the picture each group shares with the next.

    Parameters
    ----------
    capture : Capture

    Returns
    -------
    float64 array, shape (group − 1,)
        Width of the picture less the way from the first frame of one group to that of the next, in metres; negative
        where groove was left out between them. From the log where it has both places, else nominal.
    """
    bench = capture.bench
    first = [nominal_arc_m(number, sequence=bench.sequence)[0] for number in range(capture.group_count)]
    starts_m = np.asarray(first, np.float64)
    if capture.log is not None:
        logged = capture.log.arc_m[:, 0]
        starts_m = np.where(np.isnan(logged), starts_m, logged)
    return np.asarray(bench.sensor.width_px * bench.sensor.pixel_pitch_m - np.diff(starts_m), np.float64)


def _findings_of_overlap(overlaps_m: FloatArray) -> Iterator[str]:
    apart = np.flatnonzero(overlaps_m <= 0)
    if apart.size:
        worst = int(np.argmin(overlaps_m))
        yield (
            f"{apart.size} of {overlaps_m.size} neighbouring groups do not overlap; between group {worst} and the next "
            f"{-overlaps_m[worst] * MICROMETRES_PER_METRE:.1f} µm of groove were not filmed"
        )


def findings_of_stripes(bench: Bench) -> Iterator[str]:
    """Yield what speaks against seeing the sharp stripes of a groove in the middle of the picture.

    Parameters
    ----------
    bench : Bench

    Yields
    ------
    str
        A stripe outside the picture, on the wrong side of the glass edge, or deeper than the groove.
    """
    rows = bench.stripe_rows()
    depth_m = bench.disc.groove_width_m / 2 * float(np.tan(bench.disc.wall_angle_rad))
    if bench.focus_through_glass_m >= depth_m:
        yield (
            f"the sharp plane lies {bench.focus_through_glass_m * MICROMETRES_PER_METRE:.1f} µm below the land and the "
            f"groove is only {depth_m * MICROMETRES_PER_METRE:.1f} µm deep: its walls are not sharp anywhere"
        )
        return
    for row in rows:
        if not 0 <= row <= bench.sensor.height_px - 1:
            yield f"a sharp stripe is expected at row {row:.0f}, outside the {bench.sensor.height_px} rows of the picture"
    yield from _findings_of_glass(bench, rows)


def _findings_of_glass(bench: Bench, rows: tuple[float, ...]) -> Iterator[str]:
    if bench.cover_glass is None:
        return
    low, edge = bench.cover_glass.side == "low", bench.glass_edge_row
    through, beside = (rows[:2], rows[2]) if low else (rows[1:], rows[0])
    for row in through:
        if (row < edge) != low:
            yield f"the stripe expected at row {row:.0f} should be seen through the glass, whose edge lies at {edge:.0f}"
    if (beside < edge) == low:
        yield f"the stripe expected at row {beside:.0f} should be seen beside the glass, whose edge lies at {edge:.0f}"
    for row in rows:
        if abs(row - edge) * bench.sensor.pixel_pitch_m < NEAR_EDGE_M:
            yield (
                f"the stripe expected at row {row:.0f} lies at the edge of the glass ({edge:.0f}): the groove's swing will "
                "hide it; move the glass midway between the two stripes of one wall"
            )
