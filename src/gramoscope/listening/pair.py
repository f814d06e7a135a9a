"""Two sounds brought together: one channel each, one rate, one band, one time.

Both are cut to the span that they share *before* they are filtered, so that whatever the filter does at the ends it does to
both alike.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import soxr

from gramoscope.conventions import FloatArray
from gramoscope.errors import SoundError, require
from gramoscope.listening.align import Band, band_passed, delay_samples, refine_delay_s

BoolArray = npt.NDArray[np.bool_]

_TOP_OF_BAND = 0.95
_SILENCE = 1e-9
_FEWEST_SAMPLES = 32
_REFINEMENTS = 8


@dataclass(frozen=True, eq=False)
class Span:
    """The stretch that two sounds share, band-passed.

    Attributes
    ----------
    a, b : float64 arrays, same shape (sample,)
        Reference and copy.
    used : bool array, shape (sample,)
        Which samples count: inside the trimmed ends, and not masked.
    start_s : float
        Time of the first sample in a.
    """

    a: FloatArray
    b: FloatArray
    used: BoolArray
    start_s: float

    @property
    def ends(self) -> slice:
        """From the first sample that counts to the last."""
        places = np.flatnonzero(self.used)
        return slice(int(places[0]), int(places[-1]) + 1)


@dataclass(frozen=True, eq=False)
class Pair:
    """Two sounds at one rate and in one band, laid upon each other and as they came.

    Attributes
    ----------
    rate_hz : float
        The lower of the two rates.
    band_hz : (float, float)
        The band asked for, cut down to what the rate holds.
    delay_s : float
        How much later b is than a.
    aligned : Span
        With the delay taken out; gain and polarity of b are left as they are.
    unaligned : Span
        With nothing taken out.
    """

    rate_hz: float
    band_hz: Band
    delay_s: float
    aligned: Span
    unaligned: Span


def one_channel(samples: npt.ArrayLike, *, channel: int | None = None) -> FloatArray:
    """Return one channel of a sound, or the mean of all.

    Parameters
    ----------
    samples : array_like, shape (sample,) or (sample, channel)
        NaN in any channel gives NaN in the mean.
    channel : int, optional
        From 0; a sound with one channel has only that, whatever is asked for.

    Returns
    -------
    float64 array, shape (sample,)

    Raises
    ------
    ArgumentError
        If there is no such channel, or the array has another shape.
    """
    sound = np.asarray(samples, np.float64)
    require(sound.ndim in (1, 2), f"a sound of shape {sound.shape}", "shape (sample,) or (sample, channel)")
    if sound.ndim == 1 or sound.shape[1] == 1:
        return sound.reshape(-1)
    if channel is None:
        return np.asarray(sound.mean(axis=1), np.float64)
    require(0 <= channel < sound.shape[1], f"channel {channel}", f"0 … {sound.shape[1] - 1}")
    return sound[:, channel]


@dataclass(frozen=True)
class Pairing:
    """How two sounds are brought together.

    Parameters
    ----------
    band_hz : (float, float)
        Lower and upper edge of what counts.
    max_delay_s : float
        Largest delay looked for, at most a quarter of the shorter sound; 0 takes the sounds as they lie.
    trim_s : float
        To leave out at each end of the span that both share: there both sounds are faded before they are filtered.
    """

    band_hz: Band = (200.0, 10_000.0)
    max_delay_s: float = 0.05
    trim_s: float = 0.0

    def __post_init__(self) -> None:
        low_hz, high_hz = self.band_hz
        require(0 < low_hz < high_hz, f"a band of {low_hz} … {high_hz} Hz", "two rising frequencies above 0 Hz")
        require(self.max_delay_s >= 0, f"a largest delay of {self.max_delay_s} s", "zero or more seconds")
        require(self.trim_s >= 0, f"a trim of {self.trim_s} s", "zero or more seconds")

    def bring_together(
        self, a: FloatArray, rate_a_hz: float, b: FloatArray, rate_b_hz: float, *, mask: npt.ArrayLike | None = None
    ) -> Pair:
        """Resample, find the delay, cut and filter.

        Parameters
        ----------
        a, b : float64 arrays, shapes (sample,)
        rate_a_hz, rate_b_hz : float
        mask : bool array_like, shape (sample of b,), optional
            True where b does not count; it may be NaN there.

        Returns
        -------
        Pair

        Raises
        ------
        ArgumentError
            If a rate or the shape of the mask is impossible.
        SoundError
            If a sound is too short, silent in the band, or holds NaN that no mask covers.
        """
        require(rate_a_hz > 0 and rate_b_hz > 0, f"rates of {rate_a_hz} and {rate_b_hz} Hz", "positive rates")
        rate_hz = min(rate_a_hz, rate_b_hz)
        band_hz = self._band_at(rate_hz)
        hidden = np.zeros(len(b), np.bool_) if mask is None else np.asarray(mask, np.bool_)
        require(hidden.shape == b.shape, f"a mask of shape {hidden.shape}", f"the shape of b, {b.shape}")
        self._require_length(min(len(a) / rate_a_hz, len(b) / rate_b_hz), rate_hz=rate_hz)
        a = at_rate(_finite(a, name="a"), rate_a_hz, rate_hz)
        b = at_rate(_finite(_bridged(b, hidden), name="b"), rate_b_hz, rate_hz)
        hidden = mask_at_rate(hidden, rate_b_hz, rate_hz, count=len(b))
        _require_sound(a, rate_hz=rate_hz, band_hz=band_hz, name="a")
        _require_sound(b, rate_hz=rate_hz, band_hz=band_hz, name="b")
        return self._pair(a, b, hidden, rate_hz=rate_hz, band_hz=band_hz)

    def _pair(self, a: FloatArray, b: FloatArray, hidden: BoolArray, *, rate_hz: float, band_hz: Band) -> Pair:
        unaligned = self._span(a, b, hidden, lag=0, advance_s=0.0, rate_hz=rate_hz, band_hz=band_hz)
        if self.max_delay_s == 0:
            return Pair(rate_hz, band_hz, 0.0, unaligned, unaligned)
        coarse = self._coarse_delay(a, b, rate_hz=rate_hz, band_hz=band_hz)
        lag = round(coarse)
        advance_s = (coarse - lag) / rate_hz
        aligned = self._span(a, b, hidden, lag=lag, advance_s=advance_s, rate_hz=rate_hz, band_hz=band_hz)
        for _ in range(_REFINEMENTS):
            seen = np.where(aligned.used, aligned.b, np.nan)
            later_s = refine_delay_s(aligned.a, seen, rate_hz=rate_hz)
            # a copy that has nothing in common with its reference has no delay to converge to
            step_s = float(np.clip(later_s, -0.5 / rate_hz, 0.5 / rate_hz))
            advance_s = float(np.clip(advance_s + step_s, -1.5 / rate_hz, 1.5 / rate_hz))
            aligned = self._span(a, b, hidden, lag=lag, advance_s=advance_s, rate_hz=rate_hz, band_hz=band_hz)
            if abs(step_s) * rate_hz < 1e-9:
                break
        return Pair(rate_hz, band_hz, lag / rate_hz + advance_s, aligned, unaligned)

    def _coarse_delay(self, a: FloatArray, b: FloatArray, *, rate_hz: float, band_hz: Band) -> float:
        max_lag = min(round(self.max_delay_s * rate_hz), min(len(a), len(b)) // 4)
        filtered = (band_passed(sound, rate_hz=rate_hz, band_hz=band_hz) for sound in (a, b))
        return delay_samples(*filtered, max_lag=max_lag)

    def _span(
        self,
        a: FloatArray,
        b: FloatArray,
        hidden: BoolArray,
        *,
        lag: int,
        advance_s: float,
        rate_hz: float,
        band_hz: Band,
    ) -> Span:
        first, last = max(0, -lag), min(len(a), len(b) - lag)
        cut_a, cut_b = a[first:last], b[first + lag : last + lag]
        used = ~hidden[first + lag : last + lag]
        trim = round(self.trim_s * rate_hz)
        used[:trim] = False
        used[len(used) - trim :] = False
        self._require_length(np.count_nonzero(used) / rate_hz, rate_hz=rate_hz)
        fade = trim_fade(len(used), trim)
        return Span(
            a=band_passed(fade * cut_a, rate_hz=rate_hz, band_hz=band_hz),
            b=band_passed(fade * cut_b, rate_hz=rate_hz, band_hz=band_hz, advance_s=advance_s),
            used=used,
            start_s=first / rate_hz,
        )

    def _band_at(self, rate_hz: float) -> Band:
        low_hz, high_hz = self.band_hz[0], min(self.band_hz[1], _TOP_OF_BAND * rate_hz / 2)
        if low_hz >= high_hz:
            raise SoundError(
                f"at {rate_hz:g} Hz a sound ends at {rate_hz / 2:g} Hz, and the band begins at {low_hz:g} Hz",
                "a band that the sounds can hold",
                "choose a lower band, or sounds with a higher rate",
            )
        return low_hz, high_hz

    def _require_length(self, length_s: float, *, rate_hz: float) -> None:
        needed_s = max(1 / self.band_hz[0], _FEWEST_SAMPLES / rate_hz)
        if length_s < needed_s:
            raise SoundError(
                f"{length_s * 1e3:.2f} ms of sound can be compared",
                f"{needed_s * 1e3:.2f} ms: a period of the lowest frequency, and {_FEWEST_SAMPLES} samples",
                "give longer sounds, trim or mask less, or raise the lower edge of the band",
            )


def trim_fade(count: int, trim: int) -> FloatArray:
    """Return a weight that rises over the trimmed head and falls over the trimmed tail, 0 … 1, shape (count,).

    What is left out must not ring into the rest when the whole is filtered.
    """
    rise = np.sin(np.pi / 2 * np.arange(trim) / max(trim, 1)) ** 2
    return np.concatenate([rise, np.ones(count - 2 * trim), rise[::-1]])


def at_rate(samples: FloatArray, rate_hz: float, new_rate_hz: float) -> FloatArray:
    """Resample by soxr, best quality; sample 0 stays where it is."""
    if rate_hz == new_rate_hz:
        return samples
    return np.asarray(soxr.resample(samples, rate_hz, new_rate_hz, quality="VHQ"), np.float64)


def mask_at_rate(hidden: BoolArray, rate_hz: float, new_rate_hz: float, *, count: int) -> BoolArray:
    """Carry a mask over to another rate: a new sample is hidden when any old one within its reach is.

    Parameters
    ----------
    hidden : bool array, shape (sample,)
    rate_hz, new_rate_hz : float
    count : int
        New samples; those beyond the end of `hidden` share the fate of its last sample.

    Returns
    -------
    bool array, shape (count,)
    """
    ratio = rate_hz / new_rate_hz
    middle = np.arange(count) * ratio
    reach = max(1.0, ratio) / 2
    last = len(hidden) - 1
    first = np.clip(np.ceil(middle - reach), 0, last).astype(np.intp)
    beyond = np.clip(np.floor(middle + reach), 0, last).astype(np.intp) + 1
    sums = np.concatenate([[0], np.cumsum(hidden)])
    return np.asarray(sums[beyond] > sums[first], np.bool_)


def _bridged(samples: FloatArray, hidden: BoolArray) -> FloatArray:
    """Replace hidden samples that are no numbers by a straight line, so that filters can pass over them."""
    missing = hidden & ~np.isfinite(samples)
    if not missing.any() or missing.all():
        return samples
    places = np.arange(len(samples))
    return np.where(missing, np.interp(places, places[~missing], samples[~missing]), samples)


def _finite(samples: FloatArray, *, name: str) -> FloatArray:
    if not np.isfinite(samples).all():
        count = int(np.count_nonzero(~np.isfinite(samples)))
        raise SoundError(
            f"{count} samples of sound {name} are no numbers", "finite samples", "mask what was not measured"
        )
    return samples


def _require_sound(samples: FloatArray, *, rate_hz: float, band_hz: Band, name: str) -> None:
    heard = float(np.max(np.abs(band_passed(samples, rate_hz=rate_hz, band_hz=band_hz))))
    if heard <= _SILENCE * float(np.max(np.abs(samples))):
        raise SoundError(
            f"sound {name} is silent between {band_hz[0]:g} and {band_hz[1]:g} Hz",
            "two sounds that can be heard",
            "check the file, or choose another band",
        )
