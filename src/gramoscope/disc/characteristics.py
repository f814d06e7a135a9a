"""Recording characteristics: how the velocity of the groove was tilted when the record was cut.

A cutter that kept the velocity of its stylus equal at all frequencies would swing too far in the bass and drown in surface
noise in the treble. So every firm cut the bass softer below a *turnover* and, later, the treble louder above a *roll-off*
corner; a few stopped the fall of the bass at a *shelf*. Playback undoes it. With the time constants τ₁ (shelf), τ₂
(turnover) and τ₃ (roll-off), τ = 1/(2πf), the playback response on the velocity is

    P(s) = (1 + s τ₂) / ((1 + s τ₁) (1 + s τ₃)),      without a shelf      P(s) = (1 + s τ₂) / (s τ₂ (1 + s τ₃)),

scaled to 0 dB at 1 kHz. The recording response is its inverse. Corners that a standard gives as time constants are
written as such in `CHARACTERISTICS`.

References
----------
IEC 60098:1987, section on recording characteristics (RIAA and N78 time constants). P. Copeland, Manual of Analogue Sound
Restoration Techniques, British Library, 2008, chapter 6. J. Powell and R. Stehle, Playback Equalizer Settings for 78 RPM
Recordings, 1993. G. Galo, Disc recording equalization demystified, ARSC Journal 27, 1996. IASA TC-04, section 5.2. The
table follows the compilation of the Audacity support pages. Machines of the era kept to their curve within 2 or 3 dB.
Who cut with which, and when, stands in `gramoscope.disc.recorded_with`.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gramoscope.conventions import ComplexArray
from gramoscope.errors import ArgumentError, require

REFERENCE_HZ = 1000.0
"""Every response is 0 dB here."""

ROLLOFF_STATED_AT_HZ = 10_000.0
"""Where the "roll-off in dB" of the collectors' tables is read."""


def corner_hz(time_constant_us: float) -> float:
    """Return the corner frequency of a time constant in microseconds, f = 1/(2πτ)."""
    return float(1e6 / (2 * np.pi * time_constant_us))


def rolloff_corner_hz(rolloff_db: float) -> float:
    """Return the treble corner of a curve that falls by so many decibels at 10 kHz, f₃ = 10 kHz/√(10^(R/10) − 1).

    Parameters
    ----------
    rolloff_db : float
        R, positive.

    Returns
    -------
    float
        Hertz.

    Raises
    ------
    ArgumentError
        If the roll-off is not positive.
    """
    require(
        rolloff_db > 0, f"a roll-off of {rolloff_db} dB", "a positive number of decibels", "leave a roll-off of 0 out"
    )
    return float(ROLLOFF_STATED_AT_HZ / np.sqrt(10 ** (rolloff_db / 10) - 1))


@dataclass(frozen=True)
class Characteristic:
    """A recording characteristic.

    Parameters
    ----------
    name : str
        As typed on a command line.
    title : str
        As an archive writes it.
    shelf_hz : float or None
        Where the cut of the bass ends; None if it never does. Below the turnover.
    turnover_hz : float or None
        Below it the bass was cut softer, 6 dB an octave; None for none.
    rolloff_hz : float or None
        Above it the treble was cut louder, 6 dB an octave; None for none.
    """

    name: str
    title: str
    shelf_hz: float | None = None
    turnover_hz: float | None = None
    rolloff_hz: float | None = None

    def __post_init__(self) -> None:
        for what, corner in (("shelf", self.shelf_hz), ("turnover", self.turnover_hz), ("roll-off", self.rolloff_hz)):
            require(
                corner is None or corner > 0, f"{self.name}: a {what} at {corner} Hz", "a positive frequency or none"
            )
        if self.shelf_hz is not None:
            require(
                self.turnover_hz is not None and self.shelf_hz < self.turnover_hz,
                f"{self.name}: a shelf at {self.shelf_hz} Hz and a turnover at {self.turnover_hz}",
                "a turnover above the shelf",
            )

    @property
    def is_flat(self) -> bool:
        """Whether the record was cut without any tilt."""
        return self.turnover_hz is None and self.rolloff_hz is None

    @property
    def rolloff_db(self) -> float:
        """How far playback falls at 10 kHz as the collectors' tables state it, R = 10 lg(1 + (10 kHz/f₃)²); 0 for none."""
        if self.rolloff_hz is None:
            return 0.0
        return float(10 * np.log10(1 + (ROLLOFF_STATED_AT_HZ / self.rolloff_hz) ** 2))

    def recording_response(self, frequency_hz: npt.ArrayLike) -> ComplexArray:
        """Return the response of the cutter on the velocity, 1/P, 0 dB at 1 kHz.

        Parameters
        ----------
        frequency_hz : array_like
            NaN gives NaN. At 0 Hz the response is 0 where there is a turnover and no shelf.

        Returns
        -------
        complex128 array, same shape
            The phase is that of s = +j2πf, without any change at 1 kHz.
        """
        with np.errstate(invalid="ignore"):  # NaN in, NaN out, and no warning
            return self._tilt(np.asarray(frequency_hz, np.float64)) / np.abs(self._tilt(np.asarray(REFERENCE_HZ)))

    def playback_response(self, frequency_hz: npt.ArrayLike) -> ComplexArray:
        """Return the response that undoes the cutter's, P of the module's head, 0 dB at 1 kHz.

        Parameters
        ----------
        frequency_hz : array_like
            NaN gives NaN. At 0 Hz the response is infinite where there is a turnover and no shelf.

        Returns
        -------
        complex128 array, same shape
        """
        recording = self.recording_response(frequency_hz)
        playback = np.full(recording.shape, complex(np.inf, 0))
        with np.errstate(invalid="ignore"):
            np.divide(1, recording, out=playback, where=recording != 0)
        return playback

    def _tilt(self, frequency_hz: npt.NDArray[Any]) -> ComplexArray:
        tilt = np.ones(frequency_hz.shape, np.complex128) + 0j * frequency_hz
        if self.turnover_hz is not None:
            above = 1j * frequency_hz / self.turnover_hz
            rising = above if self.shelf_hz is None else 1 + 1j * frequency_hz / self.shelf_hz
            tilt = tilt * rising / (1 + above)
        if self.rolloff_hz is not None:
            tilt = tilt * (1 + 1j * frequency_hz / self.rolloff_hz)
        return np.asarray(tilt, np.complex128)


FLAT = Characteristic("flat", "acoustic, or no equalisation")

RIAA = Characteristic("riaa", "RIAA, 500R-13.7", corner_hz(3180), corner_hz(318), corner_hz(75))

CHARACTERISTICS: tuple[Characteristic, ...] = (
    FLAT,
    RIAA,
    Characteristic("european-78", "European 78, 250N-0", None, 250),
    Characteristic("blumlein", "Blumlein, 300N-0", None, 300),
    Characteristic("500n-0", "500N-0", None, 500),
    Characteristic("american-6", "American 78, 250N-6", None, 250, 5900),
    Characteristic("american-8", "American 78, 250N-8", None, 250, 4400),
    Characteristic("columbia-78", "Columbia 78, 300N-16", None, 300, corner_hz(100)),
    Characteristic("old-rca", "old RCA, 800N-8", None, 800, 4340),
    Characteristic("decca-ffrr", "Decca ffrr, 300N-5.5", None, 300, corner_hz(25)),
    Characteristic("ccir", "CCIR, 350N-10.5", None, corner_hz(450), corner_hz(50)),
    Characteristic("iec-78", "IEC N78, 350A-10.5", corner_hz(3180), corner_hz(450), corner_hz(50)),
    Characteristic("telefunken", "Telefunken, 400N-0", None, 400),
    Characteristic("capitol", "Capitol, 400N-12.7", None, 400, rolloff_corner_hz(12.7)),
    Characteristic("aes", "AES, 400N-12.3", None, 400, 2500),
    Characteristic("mgm", "MGM, 500N-12", None, 500, rolloff_corner_hz(12)),
    Characteristic("rca", "RCA, 500N-13.7", None, 500, corner_hz(75)),
    Characteristic("nab", "NAB, 500N-16", None, 500, corner_hz(100)),
    Characteristic("nab-shelf", "NAB, 500B-16", 50, 500, corner_hz(100)),
    Characteristic("columbia-lp", "Columbia LP, 500C-16", corner_hz(1590), corner_hz(318), corner_hz(100)),
    Characteristic("london-lp", "London LP, 500C-10.5", corner_hz(1590), corner_hz(318), corner_hz(50)),
)
"""The curves, after the sources in the module's head."""

ALIASES = {"acoustic": "flat", "none": "flat", "bs-1928": "iec-78", "ffrr": "decca-ffrr"}

SHELVES_HZ = {"N": None, "R": corner_hz(3180), "B": 50.0, "C": 100.0, "A": 50.0}
"""The letters of the collectors' notation."""
TURNOVER_LIMITS_HZ = (50.0, 5000.0)
LOWEST_SHELF_HZ = 5.0
STEEPEST_ROLLOFF_DB = 30.0
"""Beyond these a notation is taken for a slip of the hand."""

_NUMBER = r"(\d+(?:\.\d+)?)"
_NOTATION = re.compile(rf"{_NUMBER}(?:([NRBCA])|S{_NUMBER})-{_NUMBER}(?:DB)?")
_HOW_TO_WRITE = (
    "turnover in Hz, a letter for the shelf, roll-off in dB at 10 kHz: 500N-16 (N none, R 50.05 Hz, B or A 50, C 100; "
    "S70 any other: 300S70-16)"
)


def characteristic(name: str) -> Characteristic:
    """Return the characteristic of that name, or the one that the collectors' notation describes.

    Parameters
    ----------
    name : str
        One of `CHARACTERISTICS` or `ALIASES`; capitals, blanks and underscores do not matter. Or turnover in hertz, shelf and
        roll-off in decibels at 10 kHz: `500N-16`, `250N-0`, `500R-13.7`, `300S70-16`, as in `SHELVES_HZ`; a turnover or
        a roll-off of 0 is none. A notation that stands in the table is the curve of the table, with the time constants
        that it rounds: `350A-10.5` is `iec-78`, whose turnover is 353.7 Hz.

    Returns
    -------
    Characteristic

    Raises
    ------
    ArgumentError
        If there is none; the message names the nearest.
    """
    known = {curve.name: curve for curve in CHARACTERISTICS}
    wanted = name.strip().lower().replace("_", "-").replace(" ", "-")
    wanted = ALIASES.get(wanted, wanted)
    if wanted in known:
        return known[wanted]
    if wanted[:1].isdecimal():
        return _of_notation(name)
    near = difflib.get_close_matches(wanted, [*known, *ALIASES], n=3, cutoff=0.4)
    remedy = f"did you mean {' or '.join(near)}?" if near else "riaa for microgroove, flat when nobody knows"
    raise ArgumentError(
        f"no recording characteristic is called {name!r}", f"one of {', '.join(known)}, or {_HOW_TO_WRITE}", remedy
    )


def _of_notation(text: str) -> Characteristic:
    parts = _parts_of(text)
    require(parts is not None, f"the recording characteristic {text!r}", _HOW_TO_WRITE)
    assert parts is not None
    for curve in CHARACTERISTICS:
        if _parts_of(curve.title.split(", ")[-1]) == parts:
            return curve
    return _free_entry(*parts)


def _parts_of(text: str) -> tuple[float, float | None, str, float] | None:
    """Turnover in Hz, shelf in Hz, how the shelf is written, roll-off in dB; None if the text is no notation."""
    plain = re.sub(r"\s", "", text).translate(str.maketrans("–−,", "--.")).upper()
    if not (match := _NOTATION.fullmatch(plain)):
        return None
    turnover_hz, letter, other_shelf_hz, rolloff_db = match.groups()
    if letter is None:
        return float(turnover_hz), float(other_shelf_hz), f"S{float(other_shelf_hz):g}", float(rolloff_db)
    return float(turnover_hz), SHELVES_HZ[letter], letter, float(rolloff_db)


def _free_entry(turnover_hz: float, shelf_hz: float | None, shelf: str, rolloff_db: float) -> Characteristic:
    notation = f"{turnover_hz:g}{shelf}-{rolloff_db:g}"
    lowest, highest = TURNOVER_LIMITS_HZ
    possible = turnover_hz == 0 or lowest <= turnover_hz <= highest
    require(possible, f"{notation}: a turnover of {turnover_hz:g} Hz", f"{lowest:g} … {highest:g} Hz, or 0 for none")
    require(
        rolloff_db <= STEEPEST_ROLLOFF_DB,
        f"{notation}: a roll-off of {rolloff_db:g} dB",
        f"0 … {STEEPEST_ROLLOFF_DB:g} dB at 10 kHz",
    )
    require(
        shelf_hz is None or shelf_hz >= LOWEST_SHELF_HZ,
        f"{notation}: a shelf {shelf}",
        f"a shelf at {LOWEST_SHELF_HZ:g} Hz or more, or N for none",
    )
    corner = rolloff_corner_hz(rolloff_db) if rolloff_db else None
    free = Characteristic(notation.lower(), notation, shelf_hz, turnover_hz or None, corner)
    return FLAT if free.is_flat else free
