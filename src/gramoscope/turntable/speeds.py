"""Speeds that have a name, and where they come from.

A stroboscope disc of n bars stands still in the light of a lamp that flashes twice in each period of the mains f when the
table turns at

    rpm = 60 · 2 f / n = 120 f / n,

and n is whole: that is why a record of "78" turns at 78.26 where the mains have 60 Hz and at 77.92 where they have 50.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from difflib import get_close_matches

from gramoscope.errors import ArgumentError, require

LOWEST_RPM, HIGHEST_RPM = 10.0, 200.0
"""Nothing that is called a gramophone record turned slower or faster: a slip of the pen."""


@dataclass(frozen=True)
class NamedSpeed:
    """A speed at which records were meant to turn.

    Attributes
    ----------
    rpm : float
        Turns a minute.
    origin : str
        Where the number comes from; empty for one that was simply given.
    """

    rpm: float
    origin: str = ""


def stroboscope_rpm(mains_hz: float, bars: int) -> float:
    """Return the speed at which a stroboscope disc stands still, 120 f / n (IASA TC-04)."""
    return 120 * mains_hz / bars


NAMED_SPEEDS: dict[str, NamedSpeed] = {
    "78-us": NamedSpeed(stroboscope_rpm(60, 92), "92 bars under 60 Hz mains: electric turntables of North America"),
    "78-europe": NamedSpeed(stroboscope_rpm(50, 77), "77 bars under 50 Hz mains: electric turntables of Europe"),
    "76-us": NamedSpeed(stroboscope_rpm(60, 94), "94 bars under 60 Hz mains: often given for acoustic discs"),
    "80": NamedSpeed(stroboscope_rpm(60, 90), "90 bars under 60 Hz, 75 under 50 Hz: early discs, Edison Diamond Discs"),
    "45": NamedSpeed(stroboscope_rpm(60, 160), "160 bars under 60 Hz mains: microgroove singles from 1949"),
    "33-third": NamedSpeed(stroboscope_rpm(60, 216), "216 bars under 60 Hz, 180 under 50 Hz: long-playing records"),
    "16-two-thirds": NamedSpeed(stroboscope_rpm(60, 432), "432 bars under 60 Hz mains: spoken word"),
    "pathe": NamedSpeed(90.0, "vertical Pathé discs with a centre start, the least of 90 to 100 rpm: check by ear"),
}
"""The bars are those that stroboscope discs print; early discs turned at anything from 68 to 90 rpm (IASA TC-04)."""
_ALIASES = {
    "33⅓": "33-third",
    "33 1/3": "33-third",
    "16⅔": "16-two-thirds",
    "16 2/3": "16-two-thirds",
    "pathé": "pathe",
}


def speed_called(text: str) -> NamedSpeed:
    """Return the speed that a number or a name stands for.

    Parameters
    ----------
    text : str
        A number of turns a minute, "78.26", or a name, "78-us", "33⅓".

    Returns
    -------
    NamedSpeed
        "80" and "45" are names too; another number has no origin.

    Raises
    ------
    ArgumentError
        If it is neither, or beyond 10 … 200 rpm.
    """
    key = text.strip().lower()
    key = _ALIASES.get(key, key)
    if key in NAMED_SPEEDS:
        return NAMED_SPEEDS[key]
    try:
        rpm = float(key)
    except ValueError:
        raise _unknown(text, key) from None
    require(
        math.isfinite(rpm) and LOWEST_RPM <= rpm <= HIGHEST_RPM,
        f"a speed of {text} rpm",
        f"{LOWEST_RPM:g} … {HIGHEST_RPM:g}",
        "78.26 for most shellac discs",
    )
    return NamedSpeed(rpm)


def _unknown(text: str, key: str) -> ArgumentError:
    near = get_close_matches(key, [*NAMED_SPEEDS, *_ALIASES], n=1)
    return ArgumentError(
        f"there is no speed called {text!r}",
        f"a number of turns a minute, or one of {', '.join(NAMED_SPEEDS)}",
        f"did you mean {near[0]}?" if near else "a number always works",
    )
