"""What is in a capture of photographs, and what is wrong with it, before anybody plays it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from gramoscope.apparatus.still import StillCapture
from gramoscope.apparatus.still_bench import StillBench
from gramoscope.camera.exposure import Exposure

EXPOSURE = Exposure()


@dataclass(frozen=True)
class StillInspection:
    """What is in a capture of photographs.

    Attributes
    ----------
    path, name : str
    bench : StillBench
    pictures_expected, pictures_found : int
    complete : bool
        Whether every picture was looked at, or the first and the last only.
    size_bytes : int
        Of the pictures.
    seconds : float
        How long one groove sounds from side to side, before turns are joined.
    pixel_rate_hz : float
        How many pixels pass in a second.
    findings : tuple of str
        What is wrong, in words.
    """

    path: str
    name: str
    bench: StillBench
    pictures_expected: int
    pictures_found: int
    complete: bool
    size_bytes: int
    seconds: float
    pixel_rate_hz: float
    findings: tuple[str, ...]

    @property
    def sound(self) -> bool:
        """Whether nothing at all was found wrong."""
        return not self.findings

    def as_dict(self) -> dict[str, Any]:
        """Return everything as plain numbers, texts, lists and dicts, as for JSON."""
        return asdict(self)


def inspect_stills(
    capture: StillCapture, *, quick: bool = False, progress: Callable[[int, int], None] | None = None
) -> StillInspection:
    """Look through a capture of photographs.

    Parameters
    ----------
    capture : StillCapture
    quick : bool
        Look at the first and the last picture only, and see whether the others are there.
    progress : callable, optional
        Called with the number of pictures done and the number of all.
    """
    bench, count = capture.bench, capture.group_count
    files = [file for number in range(count) for file in capture.files_of_group(number)]
    findings, found = list(capture.problems), 0
    for number in range(count):
        problems = _problems_of(capture, number, look=not quick or number in (0, count - 1))
        found += files[number].is_file()
        findings += [f"picture {number}: {problem}" for problem in problems]
        if progress is not None:
            progress(number + 1, count)
    speed_m_s = float(bench.rotation.speed_at_m_s(0.0))
    return StillInspection(
        path=str(capture.path),
        name=capture.name,
        bench=bench,
        pictures_expected=count,
        pictures_found=found,
        complete=not quick or count <= 2,
        size_bytes=sum(file.stat().st_size for file in files if file.is_file()),
        seconds=float(bench.rotation.time_of_arc_s(bench.passage_length_m)),
        pixel_rate_hz=speed_m_s / bench.sensor.pixel_pitch_m,
        findings=tuple(findings),
    )


def _problems_of(capture: StillCapture, number: int, *, look: bool) -> tuple[str, ...]:
    if not look:
        return tuple(f"{file.name} is missing" for file in capture.files_of_group(number) if not file.is_file())
    picture = capture.group(number)
    if not picture.seen.any():
        return picture.problems
    problems = list(picture.problems)
    if EXPOSURE.is_dark(picture.image, white_level=picture.white_level):
        problems.append("no light or no contrast")
    if EXPOSURE.is_saturated(picture.image, white_level=picture.white_level):
        problems.append(f"too bright, more than {EXPOSURE.saturated_share:.0%} at full scale")
    return tuple(problems)
