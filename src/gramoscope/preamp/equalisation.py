"""De-emphasis: undoes the recording characteristic, piece by piece.

Remove clicks before this, not after: the bass boost turns a tick into a thump. What the filter is and how well it follows
the analogue curve is said in `gramoscope.disc.characteristic_filter`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from gramoscope.disc.characteristic_filter import playback_filter
from gramoscope.disc.characteristics import RIAA, Characteristic
from gramoscope.preamp.pieces import in_order, joined, part_of, without_nan
from gramoscope.quality import no_flags
from gramoscope.signal_path import Audio


@dataclass(frozen=True)
class Equaliser:
    """Plays a record's velocity through the inverse of its recording characteristic.

    Parameters
    ----------
    characteristic : Characteristic
    """

    characteristic: Characteristic = RIAA

    def equalise(self, pieces: Iterable[Audio]) -> Iterator[Audio]:
        """Return the pieces equalised, 0 dB at 1 kHz, without delay.

        The groove is taken to have been at rest before the first sample and after the last.

        Parameters
        ----------
        pieces : iterable of Audio
            Following each other without gap, at one rate. A NaN counts as 0 and is flagged `INTERPOLATED`.

        Yields
        ------
        Audio
            The same samples, whatever the pieces they came in; all but the last `look_ahead` of the samples read so far
            have been passed on. Flags stay where they were. `sigma` is multiplied by the rms gain of the filter between
            20 Hz and 20 kHz: true for errors with a flat spectrum in that band whose size changes slowly (hundreds of
            samples); position noise, whose velocity rises with frequency, is attenuated more than that by a curve with
            a roll-off, so that `sigma` then errs on the safe side.

        Raises
        ------
        ArgumentError
            If a piece does not follow the one before it, or has another rate.
        """
        pieces = in_order(pieces)
        first = next(pieces, None)
        if first is None:
            return
        undo = playback_filter(self.characteristic, rate_hz=first.rate_hz)
        done = (*first.history, history_line(self.characteristic))
        waiting = replace(part_of(first, 0, 0), history=done)
        state, late_by, gain = undo.at_rest(), undo.look_ahead, undo.rms_gain
        for piece in map(without_nan, chain([first], pieces, [_silence(undo.look_ahead, after=first)])):
            late, state = undo.advance(piece.samples, state)
            samples = late[late_by:]
            late_by -= late.size - samples.size
            waiting = joined(waiting, replace(piece, sigma=piece.sigma * gain))
            if samples.size:
                yield replace(part_of(waiting, 0, samples.size), samples=samples)
            waiting = part_of(waiting, samples.size, None)


def _silence(count: int, *, after: Audio) -> Audio:
    return replace(after, samples=np.zeros(count), sigma=np.zeros(count), flags=no_flags(count))


def history_line(characteristic: Characteristic) -> str:
    """Return what the equaliser did, in words for the archive."""
    if characteristic.is_flat:
        return "not equalised (flat)"
    corners = (
        ("shelf", characteristic.shelf_hz),
        ("turnover", characteristic.turnover_hz),
        ("roll-off", characteristic.rolloff_hz),
    )
    words = ", ".join(f"{what} {corner:.4g} Hz" for what, corner in corners if corner is not None)
    return f"equalised for playback with {characteristic.title} ({words}; 0 dB at 1 kHz)"
