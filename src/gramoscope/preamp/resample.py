"""Place → time: from an even grid along the groove to even steps of time.

A stylus reaches the place s at the time t(s) of `gramoscope.turntable.rotation`; so sample n of the sound is the groove's
velocity at s(n/rate), taken from the grid by band-limited interpolation. Near the centre of the disc the same stretch takes
longer, the grid is worth a lower rate, and the band shrinks: the cut-off follows the lower of the two Nyquist rates from
sample to sample.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from gramoscope.conventions import FloatArray
from gramoscope.errors import require
from gramoscope.preamp.interpolation import half_width, interpolate, low_pass_table
from gramoscope.quality import FlagArray, Quality, no_flags
from gramoscope.signal_path import Audio, GrooveMotion, GrooveSound
from gramoscope.turntable.rotation import Rotation

DEFAULT_PASSBAND = 0.91
"""Share of the Nyquist rate that is passed flat: 20.07 kHz of 44.1."""


@dataclass(frozen=True)
class Resampler:
    """Turns the groove's motion along s, in both directions, into sound at an even rate.

    Parameters
    ----------
    rotation : Rotation
        How the record was meant to turn; a `DriftingRotation` where its speed changed over time.
    rate_hz : float
        Of the sound.
    passband : float
        Share (0 … 1) of the lower of both Nyquist rates that is passed flat, within 0.001 dB; all beyond that Nyquist rate
        is attenuated by more than 100 dB.
    """

    rotation: Rotation
    rate_hz: float = 96_000.0
    passband: float = DEFAULT_PASSBAND

    def __post_init__(self) -> None:
        require(self.rate_hz > 0, f"a rate of {self.rate_hz} Hz", "a positive rate", "96000 for an archive")
        require(0 < self.passband <= 0.98, f"a passband of {self.passband}", "a share between 0 and 0.98")

    def resample(self, pieces: Iterable[GrooveMotion]) -> Iterator[GrooveSound]:
        """Return the motion as sound; sample 0 lies exactly at s = 0.

        Parameters
        ----------
        pieces : iterable of GrooveMotion
            Following each other without gap on one grid. Each sample stands for the stretch from its place to the next.
            A NaN velocity counts as 0 and is flagged `INTERPOLATED`, in its own direction alone; in the direction of the
            cut it should have been filled before.

        Yields
        ------
        GrooveSound
            The same samples, whatever the pieces they came in; their number is the time from s = 0 to the end of the
            grid, times the rate, rounded down. Before its first and after its last sample the grid is taken to hold
            their values; sound samples nearer to an end than the half width of the low-pass carry `EDGE`, and those
            before the first sample of the grid `INTERPOLATED` too. The flags of all grid samples nearer than half a
            sample of the sound (and of the two neighbours, at the least) are joined. `sigma` is interpolated linearly
            and unchanged in size: the tonearm's errors are smooth along the groove, so that the low-pass does not
            average them away. (Were they white on the grid, they would shrink by √(output band/grid band), and `sigma`
            would err on the safe side.) NaN in `sigma` spreads to the neighbouring samples alone.

        Raises
        ------
        ArgumentError
            If a piece does not follow the one before it or has another step, or if the groove would run past the centre.
        """
        pieces = (piece for piece in pieces if piece.flags.size)
        first = next(pieces, None)
        if first is None:
            return
        grid = _Grid.of(first, self)
        table = low_pass_table(self.passband)
        stock, done = _lead_in(first, grid), 0
        for piece in chain([first], pieces):
            _require_next(piece, grid, end=stock.end)
            stock = stock.followed_by(_Stock.of(piece, start=stock.end))
            ready = grid.sounds_before(stock.end - grid.reach)
            if ready > done:
                yield _sound(stock, grid, table, sounds=(done, ready), end=np.inf)
                stock, done = stock.since(int(grid.places(ready, ready + 1)[0]) - grid.reach), ready
        wanted = grid.sounds_before(stock.end)
        if wanted > done:
            yield _sound(_led_out(stock, grid), grid, table, sounds=(done, wanted), end=stock.end - 1)


@dataclass(frozen=True)
class _Grid:
    """Where the sound's samples lie on the grid.

    A *place* is counted in grid samples, `pad` at the first grid sample, so that places are never negative. `reach` is how
    many grid samples around a place its sound needs, at the most.
    """

    arc_start_m: float
    arc_step_m: float
    pad: int
    reach: int
    half_width: int
    resampler: Resampler

    @classmethod
    def of(cls, first: GrooveMotion, resampler: Resampler) -> _Grid:
        fastest = resampler.rotation.fastest_m_s(min(0.0, first.arc_start_m))
        width = half_width(resampler.passband)
        reach = int(np.ceil(width * max(1.0, fastest / first.arc_step_m / resampler.rate_hz))) + 2
        late = int(np.ceil(max(0.0, first.arc_start_m / first.arc_step_m)))
        return cls(first.arc_start_m, first.arc_step_m, reach + late, reach, width, resampler)

    def sounds_before(self, place: float) -> int:
        """Return how many samples of sound lie before a place."""
        arc = self.arc_start_m + (place - self.pad) * self.arc_step_m
        time = float(self.resampler.rotation.time_of_arc_s(arc))
        return max(int(np.floor(time * self.resampler.rate_hz + 1e-9)), 0)

    def places(self, first: int, stop: int) -> FloatArray:
        """Return the places of samples of sound."""
        arc = self.resampler.rotation.arc_of_time_m(np.arange(first, stop) / self.resampler.rate_hz)
        return (arc - self.arc_start_m) / self.arc_step_m + self.pad

    def stretch(self, places: FloatArray) -> FloatArray:
        """Return the rate of the sound over that of the grid at places, at the most 1."""
        arc = self.arc_start_m + (places - self.pad) * self.arc_step_m
        speed = self.resampler.rotation.speed_at_m_s(arc)
        return np.minimum(1.0, self.resampler.rate_hz * self.arc_step_m / speed)

    def history(self, direction: str) -> str:
        """Return what was done, in words for the archive."""
        rotation, rate_hz = self.resampler.rotation, self.resampler.rate_hz
        return (
            f"{direction} motion resampled from every {self.arc_step_m * 1e6:.4g} µm "
            f"to {rate_hz:g} Hz at {rotation.in_words()}"
        )


@dataclass(frozen=True, eq=False)
class _Stock:
    """The grid samples at hand, from the place `start`; shape (direction, sample), lateral first."""

    start: int
    velocity_m_s: FloatArray
    sigma_m_s: FloatArray
    flags: FlagArray

    @classmethod
    def of(cls, piece: GrooveMotion, *, start: int) -> _Stock:
        velocity = np.stack([piece.lateral_velocity_m_s, piece.vertical_velocity_m_s])
        sigma = np.stack([piece.lateral_sigma_m_s, piece.vertical_sigma_m_s])
        missing = np.isnan(velocity)
        flags = np.where(missing, piece.flags | np.uint16(Quality.INTERPOLATED), piece.flags).astype(np.uint16)
        return cls(start, np.where(missing, 0.0, velocity), sigma, flags)

    @property
    def end(self) -> int:
        return self.start + int(self.flags.shape[1])

    def followed_by(self, other: _Stock) -> _Stock:
        return _Stock(
            self.start,
            np.concatenate([self.velocity_m_s, other.velocity_m_s], axis=1),
            np.concatenate([self.sigma_m_s, other.sigma_m_s], axis=1),
            np.concatenate([self.flags, other.flags], axis=1),
        )

    def since(self, place: int) -> _Stock:
        kept = slice(max(place - self.start, 0), None)
        return _Stock(max(place, self.start), self.velocity_m_s[:, kept], self.sigma_m_s[:, kept], self.flags[:, kept])

    def held(self, index: int, count: int, *, start: int) -> _Stock:
        """Return so many copies of one sample, without flags."""
        velocity, sigma = (
            np.repeat(values[:, [index]], count, axis=1) for values in (self.velocity_m_s, self.sigma_m_s)
        )
        return _Stock(start, velocity, sigma, no_flags(2, count))


def _lead_in(first: GrooveMotion, grid: _Grid) -> _Stock:
    return _Stock.of(first, start=grid.pad).held(0, grid.pad, start=0)


def _led_out(stock: _Stock, grid: _Grid) -> _Stock:
    return stock.followed_by(stock.held(-1, grid.reach + 1, start=stock.end))


def _sound(stock: _Stock, grid: _Grid, table: FloatArray, *, sounds: tuple[int, int], end: float) -> GrooveSound:
    """Return the samples of sound from … to; `end` is the last place of the grid, if it is known to have one."""
    places = grid.places(*sounds)
    stretch = grid.stretch(places)
    here = places - stock.start
    samples = interpolate(stock.velocity_m_s, here, stretch, table, grid.half_width)
    sigma = _between_neighbours(stock.sigma_m_s, here)
    flags = _joined_flags(stock.flags, here, span=np.maximum(1.0, 0.5 / stretch))
    width = grid.half_width / stretch
    at_edge = (places - width < grid.pad) | (places + width > end)
    flags |= np.where(at_edge, np.uint16(Quality.EDGE), np.uint16(0))
    flags |= np.where(places < grid.pad, np.uint16(Quality.INTERPOLATED), np.uint16(0))
    rate_hz = grid.resampler.rate_hz
    lateral, vertical = (
        Audio(sounds[0], rate_hz, samples[k], sigma[k], flags[k], (grid.history(direction),))
        for k, direction in enumerate(("lateral", "vertical"))
    )
    return GrooveSound(lateral, vertical)


def _between_neighbours(values: FloatArray, places: FloatArray) -> FloatArray:
    before = np.floor(places).astype(np.intp)
    share = places - before
    return np.asarray((1 - share) * values[:, before] + share * values[:, before + 1], np.float64)


def _joined_flags(flags: FlagArray, places: FloatArray, *, span: FloatArray) -> FlagArray:
    """Return the flags of all samples nearer to each place than `span`, joined."""
    first = np.floor(places - span).astype(np.intp) + 1
    stop = np.ceil(places + span).astype(np.intp)
    joined = no_flags(len(flags), places.size)
    for step in range(int(np.max(stop - first))):
        k = first + step
        joined |= np.where(k < stop, flags[:, np.minimum(k, flags.shape[1] - 1)], np.uint16(0))
    return joined


def _require_next(piece: GrooveMotion, grid: _Grid, *, end: int) -> None:
    expected_m = grid.arc_start_m + (end - grid.pad) * grid.arc_step_m
    require(
        abs(piece.arc_step_m - grid.arc_step_m) < 1e-9 * grid.arc_step_m,
        f"a piece with a sample every {piece.arc_step_m * 1e6:g} µm",
        f"one every {grid.arc_step_m * 1e6:g} µm, as before",
    )
    require(
        abs(piece.arc_start_m - expected_m) < 0.1 * grid.arc_step_m,
        f"a piece that starts at {piece.arc_start_m * 1e3:.6f} mm",
        f"one that starts at {expected_m * 1e3:.6f} mm, where the last one ended",
    )
