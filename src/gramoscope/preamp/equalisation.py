"""De-emphasis: undoes the recording characteristic, piece by piece.

Remove clicks before this, not after: the bass boost turns a tick into a thump. What the filter is and how well it follows
the analogue curve is said in `gramoscope.disc.characteristic_filter`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.disc.characteristic_filter import CharacteristicFilter, playback_filter
from gramoscope.disc.characteristics import RIAA, Characteristic
from gramoscope.errors import require
from gramoscope.quality import FlagArray, Quality
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
        late: _Late | None = None
        for piece in pieces:
            if late is None:
                late = _Late(self.characteristic, piece)
            out = late.advance(piece)
            if out.samples.size:
                yield out
        if late is not None:
            out = late.flush()
            if out.samples.size:
                yield out


class _Late:
    """What waits for the filter's look-ahead: local to one run of `Equaliser.equalise`."""

    def __init__(self, characteristic: Characteristic, first: Audio) -> None:
        self.filter: CharacteristicFilter = playback_filter(characteristic, rate_hz=first.rate_hz)
        self.state = self.filter.at_rest()
        self.gain = self.filter.rms_gain
        self.to_drop = self.filter.look_ahead
        self.next_sample = first.start_sample
        self.waiting = replace(
            first,
            samples=np.empty(0),
            sigma=np.empty(0),
            flags=first.flags[:0],
            history=(*first.history, history_line(characteristic)),
        )

    def advance(self, piece: Audio) -> Audio:
        _require_next(piece, start_sample=self.next_sample, rate_hz=self.waiting.rate_hz)
        self.next_sample += piece.samples.size
        samples, flags = without_nan(piece.samples, piece.flags)
        return self._pass_on(samples, piece.sigma * self.gain, flags)

    def flush(self) -> Audio:
        return self._pass_on(np.zeros(self.filter.look_ahead), np.empty(0), self.waiting.flags[:0])

    def _pass_on(self, samples: FloatArray, sigma: FloatArray, flags: FlagArray) -> Audio:
        filtered, self.state = self.filter.advance(samples, self.state)
        dropped = min(self.to_drop, filtered.size)
        self.to_drop -= dropped
        filtered = filtered[dropped:]
        waiting = self.waiting
        sigma = np.concatenate([waiting.sigma, sigma])
        flags = np.concatenate([waiting.flags, flags])
        done = filtered.size
        self.waiting = replace(
            waiting, start_sample=waiting.start_sample + done, sigma=sigma[done:], flags=flags[done:]
        )
        return replace(waiting, samples=filtered, sigma=sigma[:done], flags=flags[:done])


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


def without_nan(samples: FloatArray, flags: FlagArray) -> tuple[FloatArray, FlagArray]:
    """Return the samples with 0 for NaN, and the flags with `INTERPOLATED` there."""
    missing = np.isnan(samples)
    filled = np.where(missing, 0.0, samples)
    return filled, np.where(missing, flags | np.uint16(Quality.INTERPOLATED), flags).astype(np.uint16)


def _require_next(piece: Audio, *, start_sample: int, rate_hz: float) -> None:
    require(
        piece.rate_hz == rate_hz, f"a piece at {piece.rate_hz:g} Hz after one at {rate_hz:g} Hz", "one rate throughout"
    )
    require(
        piece.start_sample == start_sample,
        f"a piece that starts at sample {piece.start_sample}",
        f"one that starts at {start_sample}, where the last one ended",
    )
