"""How numbers and facts of a report are written for people."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

UNKNOWN = "–"
LONGEST_LIST = 12


def number(value: float | None, unit: str = "", *, digits: int = 3) -> str:
    """Return a number with so many digits that count, and its unit; a dash for what is unknown."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    shown = f"{value:.{digits}g}" if value == 0 or 1e-3 <= abs(value) < 10**digits else f"{value:.0f}"
    shown = f"{value:.{digits - 1}e}" if 0 < abs(value) < 1e-3 else shown
    return f"{shown.replace('-', '−')} {unit}".strip()


def decibels(value: float | None) -> str:
    """Return decibels with one decimal."""
    return UNKNOWN if value is None or not math.isfinite(value) else f"{value:.1f} dB".replace("-", "−")


def percent(share: float | None) -> str:
    """Return a share as per cent; what is there and would round to nothing, or to everything, is not written so."""
    if share is None or not math.isfinite(share):
        return UNKNOWN
    if 0 < share < 0.0005:
        return "below 0.1 %"
    if 0.9995 < share < 1:
        return "above 99.9 %"
    return f"{100 * share:.1f} %" if 0 < share < 1 else f"{100 * share:.0f} %"


def hertz(frequency_hz: float | None) -> str:
    """Return a frequency in hertz or kilohertz."""
    if frequency_hz is None or not math.isfinite(frequency_hz):
        return UNKNOWN
    return f"{frequency_hz / 1e3:.3g} kHz" if frequency_hz >= 1000 else f"{frequency_hz:.3g} Hz"


def duration(seconds: float) -> str:
    """Return a duration as people write it."""
    if seconds < 60:
        return f"{seconds:.3f} s" if seconds < 10 else f"{seconds:.1f} s"
    return f"{int(seconds // 60)} min {seconds % 60:04.1f} s"


def flat_rows(value: Any, name: str = "") -> Iterator[tuple[str, str]]:
    """Return everything in nested tables as rows of a dotted name and a text."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flat_rows(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, Sequence) and not isinstance(value, str) and any(isinstance(v, Mapping) for v in value):
        for place, inner in enumerate(value):
            yield from flat_rows(inner, f"{name}[{place}]")
    else:
        yield name, _plainly(value)


def _plainly(value: Any) -> str:
    if value is None or value == "":
        return UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        shown = ", ".join(_plainly(one) for one in value[:LONGEST_LIST])
        return shown + (f", … ({len(value)} in all)" if len(value) > LONGEST_LIST else "")
    return str(value)
