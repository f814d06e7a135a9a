"""The sound files of a transfer: one declaration each.

Whatever shall be written beside these is declared here, and passes through `Outputs.kept` in `player.play`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gramoscope.disc.characteristics import characteristic
from gramoscope.preamp.equalisation import history_line
from gramoscope.preamp.walls import WALL_CHANNELS
from gramoscope.signal_path import Audio, GrooveSound

if TYPE_CHECKING:
    from gramoscope.player.play import Settings


def _nothing(_: Settings) -> str:
    return "not equalised; nothing repaired"


def _equalisation(settings: Settings) -> str:
    return history_line(characteristic(settings.characteristic_name))


@dataclass(frozen=True)
class Track:
    """A sound file of a transfer.

    Parameters
    ----------
    name : str
        Of the file, without folder, with `.wav`.
    what : str
        What it holds, for the report and the file itself; short, and in ASCII.
    channels : tuple of str
        What each channel is.
    done : callable
        What was done to the sound on the way from the groove, in words, by the settings.
    """

    name: str
    what: str
    channels: tuple[str, ...] = ("groove",)
    done: Callable[[Settings], str] = _nothing


FLAT = Track("flat.wav", "velocity of the groove in the direction of the cut")
WALLS = Track(
    "walls.wav",
    "velocity of each wall along its normal: channel 1 the outer wall, channel 2 the inner wall",
    channels=WALL_CHANNELS,
)
VERTICAL = Track("vertical.wav", "vertical velocity of the groove, positive upwards")
EQUALISED = Track(
    "equalised.wav", "velocity of the groove in the direction of the cut, characteristic undone", done=_equalisation
)
TRACKS = (FLAT, WALLS, VERTICAL, EQUALISED)


def alone(piece: Audio) -> tuple[Audio, ...]:
    """Return a sound as the one channel of a file."""
    return (piece,)


def vertical(piece: GrooveSound) -> tuple[Audio, ...]:
    """Return the vertical motion as the one channel of a file."""
    return (piece.vertical,)
