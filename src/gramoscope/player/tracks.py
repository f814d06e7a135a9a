"""The sound files of a transfer: one declaration each.

Whatever shall be written beside these is declared here, and passes through `Outputs.kept` in `player.play`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gramoscope.disc.characteristics import characteristic
from gramoscope.listening.reversible import reversible
from gramoscope.preamp.equalisation import history_line
from gramoscope.preamp.walls import WALL_CHANNELS
from gramoscope.signal_path import Audio, GrooveSound

if TYPE_CHECKING:
    from gramoscope.player.play import Settings
    from gramoscope.player.recipe import Recipe


def _nothing(_: Settings, __: Recipe) -> str:
    return "not equalised; nothing repaired"


def _repair(_: Settings, recipe: Recipe) -> str:
    return "; ".join(["not equalised", *recipe.repair.history])


def _equalisation(settings: Settings, recipe: Recipe) -> str:
    return "; ".join([*recipe.repair.history, history_line(characteristic(settings.characteristic_name))])


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
        What was done to the sound on the way from the groove, in words, by the settings and the recipe.
    """

    name: str
    what: str
    channels: tuple[str, ...] = ("groove",)
    done: Callable[[Settings, Recipe], str] = _nothing


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
REPAIRED = Track("repaired.wav", "flat.wav after repair", done=_repair)
DIFFERENCE = Track(
    "difference.wav", "what was taken off: as whole numbers, repaired.wav + difference.wav = flat.wav", done=_repair
)
TRACKS = (FLAT, WALLS, VERTICAL, EQUALISED)
REPAIR_TRACKS = (REPAIRED, DIFFERENCE)


def tracks_of(recipe: Recipe) -> tuple[Track, ...]:
    """Return the tracks of a transfer: those of a repair only where one is asked for."""
    return (*TRACKS, *REPAIR_TRACKS) if recipe.repair.asked else TRACKS


def alone(piece: Audio) -> tuple[Audio, ...]:
    """Return a sound as the one channel of a file."""
    return (piece,)


def vertical(piece: GrooveSound) -> tuple[Audio, ...]:
    """Return the vertical motion as the one channel of a file."""
    return (piece.vertical,)


@dataclass(frozen=True, eq=False)
class RepairedPiece:
    """A piece of sound after repair.

    Attributes
    ----------
    sound : Audio
        As it goes on.
    left, taken : Audio
        As files hold it: what is left, and what was taken off; both together are the raw sound, to the last bit.
    """

    sound: Audio
    left: Audio
    taken: Audio

    @classmethod
    def of(cls, raw: Audio, repaired: Audio, *, full_scale_m_s: float) -> RepairedPiece:
        """Return a piece before and after repair as files of that scale hold it."""
        left, taken = reversible(raw.samples, repaired.samples, full_scale_m_s=full_scale_m_s)
        return cls(repaired, replace(repaired, samples=left), replace(repaired, samples=taken))


def left_of_repair(piece: RepairedPiece) -> tuple[Audio, ...]:
    """Return the repaired sound as the one channel of a file."""
    return (piece.left,)


def taken_by_repair(piece: RepairedPiece) -> tuple[Audio, ...]:
    """Return what a repair took off as the one channel of a file."""
    return (piece.taken,)
