"""What a passage teaches about its own texture.

Some groups, spread over the passage, are laid ready and searched coarsely. Then rounds follow: lay windows about the present
paths, sum up their cross-spectra, invert them, move the paths by what the new model says. The first rounds add much to the
diagonal of C, which makes them forgiving, the last hardly anything. In each round the model is blurred by just the error that
paths have in that round, so the whole series of models will lead any other stretch in the same way from the coarse path to
the exact one. When the first exact model is to be learned it is learned in every tone, and the one that tells most is kept.

A model calls the path that it was learned from right, whatever that is. So the groups are dealt out to a few folds, and the
cross-spectra that move, judge and read a group are those of the other folds; only the tone, the whitening filter, and what
witnesses are worth (their means, answers and powers) are those of all. In the first rounds all folds are lined up by much
the same model all the same, and what that calls zero looks right to the next ones (docs/decisions/0006).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import require
from gramoscope.pickup.cartridge import Spread
from gramoscope.pickup.texture.filter_bank import (
    FilterBank,
    common_channels,
    interpolated,
    strongest_filters,
    through_channels,
    witness_forms,
)
from gramoscope.pickup.texture.following import REACH, SHARP, across, wide_rows
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import (
    StripeStatistics,
    believable,
    best_shares,
    quiet_power,
    said,
    softened,
)
from gramoscope.pickup.texture.reading import Model, Rules, Stretch, clear_columns, evidence, step
from gramoscope.pickup.texture.spectrum import Band, CrossSpectra, cross_spectra, precision, whitening_filter
from gramoscope.pickup.texture.tone import Tone, mean_level


@dataclass(frozen=True, eq=False)
class Lesson:
    """What one round taught.

    Attributes
    ----------
    whole : Model
        From all groups, for those that were not among them.
    without : tuple of Model
        Without each fold, for the groups of that fold.
    """

    whole: Model
    without: tuple[Model, ...]


@dataclass(frozen=True, eq=False)
class Forms:
    """What both witnesses say of a stripe, as quadratic forms of its window.

    Attributes
    ----------
    witnesses : (float64 array, float64 array), shape (bin in the band, row, row)
    spectra : float64 array, same shape
        C_f of the window.
    length : int
        Of the transform whose bins these are.
    """

    witnesses: tuple[FloatArray, FloatArray]
    spectra: FloatArray
    length: int

    def through(self, basis: FloatArray) -> Forms:
        """Return what they say of channels, shape (row, channel)."""
        (first, spectra), (second, _) = (through_channels(form, self.spectra, basis) for form in self.witnesses)
        return Forms((first, second), spectra, self.length)


@dataclass(frozen=True)
class Learning:
    """How the passage is learned.

    Parameters
    ----------
    half_px : int
        Rows of a window on each side of a stripe.
    largest_lag_px : int
        Lags up to here may carry correlation: the light of points far from the stripe reaches its rows in large discs.
    change_lag_px : int
        The same for how correlation changes when a path moves: what is left out costs little, and the rest is known better.
    band_low, band_high : float
        Frequencies along the groove that are used, cycles a pixel.
    loading : tuple of float
        Of each round; see `spectrum.precision`.
    compressions : tuple of float
        Tones to choose from, see `texture.tone`; rounds before the choice use the first.
    least_columns : int
        A stripe seen in fewer columns is not read.
    spread_noises, spread_limit_px : float
        Paths are heard so many of their standard errors on either side, and so many pixels at the most.
    channels, filters : int
        Of what is heard of a window, see `texture.filter_bank`; both even.
    folds : int
        Parts of the learning groups, each read by what the others taught; 2 or more.
    """

    half_px: int = 12
    largest_lag_px: int = 150
    change_lag_px: int = 30
    band_low: float = 0.02
    band_high: float = 0.35
    loading: tuple[float, ...] = (0.03, 0.03, 0.01, 0.003, 0.001, 0.001, 0.001)
    compressions: tuple[float, ...] = (0.0, 0.9)
    least_columns: int = 6000
    spread_noises: float = 4.0
    spread_limit_px: float = 0.8
    channels: int = 16
    filters: int = 4
    folds: int = 4

    def __post_init__(self) -> None:
        require(self.half_px >= 4, f"windows of ± {self.half_px} rows", "4 or more")
        require(self.spread_noises >= 0, f"a spread of {self.spread_noises} standard errors", "0 or more")
        require(0 <= self.spread_limit_px < 1, f"a spread of up to {self.spread_limit_px} px", "0 … below 1")
        most = wide_rows(self.half_px)
        require(2 <= self.channels <= most, f"{self.channels} channels", f"2 … {most}, the rows of a window")
        possible = 2 <= self.filters <= self.channels and self.filters % 2 == 0
        require(possible, f"{self.filters} filters", "an even number of them, 2 or more, and no more than channels")
        require(self.folds >= 2, f"{self.folds} folds", "2 or more")
        require(len(self.loading) >= 1, "no rounds", "at least one loading")
        require(len(self.compressions) >= 1, "no tone", "at least one compression; 0 leaves pictures as they are")
        require(all(0 <= q < 1 for q in self.compressions), f"compressions {self.compressions}", "0 … below 1")
        require(0 < self.band_low < self.band_high <= 0.5, f"a band of {self.band_low} … {self.band_high}", "0 … 0.5")

    def learn(
        self,
        stretches: list[Stretch],
        layout: StripeLayout,
        cut: Cut,
        rules: Rules,
        spread: Spread,
        told: Callable[[], None] = lambda: None,
    ) -> tuple[Lesson, ...]:
        """Return what each round taught.

        Parameters
        ----------
        stretches : list of Stretch
            With coarse paths.
        layout : StripeLayout
        cut : {"lateral", "vertical", "stereo"}
        rules : Rules
        spread : callable
            How a function is mapped over stretches.
        told : callable
            Called after each round.
        """
        band = Band(self.band_low, self.band_high)
        width = max(stretch.columns.shape[0] for stretch in stretches)
        length = fft.next_fast_len(width + self.largest_lag_px, real=True)
        level = mean_level([stretch.columns for stretch in stretches])
        tones = [Tone(level, compression) for compression in self.compressions]
        toned = [Model(layout, tone, np.ones(1), self.half_px, band, length, ()) for tone in tones]
        blanks = [self._whitening(toned[0], stretches, rules, spread)]
        fold = np.arange(len(stretches)) % self.folds
        lessons: list[Lesson] = []
        choice = int(np.argmin(self.loading))
        for number, loading in enumerate(self.loading):
            if number == choice:
                blanks += [self._whitening(b, _seen_in(b, stretches, spread), rules, spread) for b in toned[1:]]
            before = lessons[-1].whole if lessons else None
            spread_px = self.spread_px(before, rules)
            blanks = [replace(blank, spread_px=spread_px) for blank in blanks]
            tried = [
                self._lesson(_seen_in(blank, stretches, spread), fold, blank, before, loading, rules, spread)
                for blank in blanks
            ]
            lesson = max(tried, key=lambda one: one.whole.precision)
            blanks = [replace(lesson.whole, stripes=())]
            stretches = self._improved(stretches, fold, lesson, cut, rules, spread)
            lessons.append(lesson)
            told()
        return tuple(lessons)

    def spread_px(self, before: Model | None, rules: Rules) -> float:
        """Return how far on either side of a path its witnesses are heard, by what was known before."""
        if before is None:
            return self.spread_limit_px
        return min(self.spread_noises * before.path_noise_px(rules.smooth_px), self.spread_limit_px)

    def _improved(
        self, stretches: list[Stretch], fold: IntArray, lesson: Lesson, cut: Cut, rules: Rules, spread: Spread
    ) -> list[Stretch]:
        """Improve every path by what the other folds taught."""

        def moved(pair: tuple[Stretch, int]) -> Stretch:
            stretch, left = pair
            seen = stretch.in_tone(lesson.whole.tone)
            return stretch.moved(step(evidence(seen, lesson.without[left], rules), cut, rules))

        return list(spread(moved, zip(stretches, fold, strict=True)))

    def _whitening(self, model: Model, stretches: list[Stretch], rules: Rules, spread: Spread) -> Model:
        """Return the model with the whitener that its texture needs."""
        powers = [power for power in spread(lambda s: self._power(s, model, rules), stretches) if power is not None]
        power = np.mean(powers, axis=0) if powers else np.ones(129)
        return replace(model, whitener=whitening_filter(power, model.band))

    def _power(self, stretch: Stretch, model: Model, rules: Rules) -> FloatArray | None:
        """Mean power spectrum of the rows of all stripes in pieces of 256 columns."""
        rows = model.layout.rows(stretch.displacement_px)
        visible = model.layout.visible(rows, half_px=self.half_px)
        taper = np.hanning(256)
        spectra = []
        for number, row in enumerate(rows):
            clear = clear_columns(stretch, number, row, visible[number], self.half_px, rules)
            if not clear.any():
                continue
            window = model.window(stretch.in_tone(model.tone).columns, row)[:, REACH:-REACH]
            for start in range(0, clear.size - 256, 128):
                piece = slice(start, start + 256)
                if clear[piece].all():
                    level = window[piece] - window[piece].mean(axis=0)
                    spectra.append(np.mean(np.abs(np.fft.rfft(level * taper[:, None], axis=0)) ** 2, axis=1))
        return np.median(spectra, axis=0) if spectra else None

    def _lesson(
        self,
        stretches: list[Stretch],
        fold: IntArray,
        blank: Model,
        previous: Model | None,
        loading: float,
        rules: Rules,
        spread: Spread,
    ) -> Lesson:
        """Learn one stripe after the other: their spectra first, then how their scores behave."""
        whole: list[StripeStatistics | None] = []
        without: list[list[StripeStatistics | None]] = [[] for _ in range(self.folds)]
        for number in range(blank.layout.wall.size):
            alike = previous is not None and previous.tone == blank.tone
            before = previous.stripes[number] if previous is not None and alike else None
            learned = self._stripe(stretches, fold, blank, number, before, loading, rules, spread)
            whole.append(learned[-1])
            for one, statistics in zip(without, learned, strict=False):
                one.append(statistics)
        return Lesson(
            replace(blank, stripes=tuple(whole)), tuple(replace(blank, stripes=tuple(stripes)) for stripes in without)
        )

    def _stripe(
        self,
        stretches: list[Stretch],
        fold: IntArray,
        blank: Model,
        number: int,
        before: StripeStatistics | None,
        loading: float,
        rules: Rules,
        spread: Spread,
    ) -> list[StripeStatistics | None]:
        """Return what is known of a stripe without each fold, and from all of them."""
        totals = [CrossSpectra(wide_rows(self.half_px), blank.length) for _ in range(self.folds)]
        for one, k in zip(spread(lambda s: self._sums(s, blank, number, before, rules), stretches), fold, strict=True):
            if one is not None:
                totals[k].add(one)
        parts = [self._together(totals, left) for left in (*range(self.folds), None)]
        if min(part.columns for part in parts) < self.least_columns:
            return [None] * len(parts)
        known = list(spread(lambda part: self._forms(part, blank, loading), parts))
        whole, everything = parts[-1], known[-1]
        basis = common_channels(everything.witnesses, everything.spectra, self.channels)
        blind = [
            StripeStatistics(
                FilterBank(basis.astype(np.float32), np.empty((0, 0, 0), np.float32), np.empty(0, np.float32)),
                information=1.0,
                score_power=1.0,
                mean_score=0.0,
                row_power=np.diag(part.covariance),
                channel_power=np.diag(basis.T @ whole.covariance @ basis),
                columns=part.columns,
            )
            for part in parts
        ]
        seen = [one.through(basis) for one in known]
        alone = [[self._bank(form, one.spectra, basis, blank) for form in one.witnesses] for one in seen]
        _, answers, powers = self._tried(
            stretches, fold, blank, number, blind, [[bank for bank, _ in one] for one in alone], rules, spread
        )
        share = best_shares(answers, powers)
        both = []
        for one, banks in zip(seen, alone, strict=True):
            weights = [s / loudness for s, (_, loudness) in zip(share, banks, strict=True)]
            mixed = weights[0] * one.witnesses[0] + weights[1] * one.witnesses[1]
            both.append([self._bank(mixed, one.spectra, basis, blank)[0]])
        mean, answers, powers = self._tried(stretches, fold, blank, number, blind, both, rules, spread)
        return [
            replace(
                one,
                bank=bank,
                mean_score=float(mean[0]),
                information=max(float(answers[0]), 1e-6),
                score_power=float(powers[0, 0]),
            )
            for one, (bank,) in zip(blind, both, strict=True)
        ]

    def _together(self, totals: list[CrossSpectra], left: int | None) -> CrossSpectra:
        """Sums of all folds but one."""
        total = CrossSpectra(totals[0].rows, totals[0].length)
        for k, one in enumerate(totals):
            if k != left:
                total.add(one)
        return total

    def _forms(self, total: CrossSpectra, blank: Model, loading: float) -> Forms:
        """What spectra say about paths, in the bins that they can tell apart."""
        length = self._coarse_length
        bins = blank.band.bins(length)
        c = total.spectra(largest_lag_px=self.largest_lag_px, length=length)
        near = total.spectra(largest_lag_px=self.change_lag_px, length=length)[bins]
        inner = slice(REACH, -REACH)
        moved = np.pad(across(2 * self.half_px + 1, SHARP), ((0, 0), (REACH - SHARP.size,) * 2)) @ near[:, :, inner]
        inverse, noise = precision(c[:, inner, inner], band=bins, loading=loading, smooth_bins=SMOOTH_CYCLES * length)
        forms = witness_forms(inverse, moved + moved.transpose(0, 2, 1), noise, spread_px=blank.spread_px)
        return Forms(forms, c[bins], self._coarse_length)

    @property
    def _coarse_length(self) -> int:
        """Of a transform whose bins spectra cut off at the largest lag can just tell apart."""
        return int(fft.next_fast_len(2 * self.largest_lag_px + 2, real=True))

    def _bank(self, form: FloatArray, spectra: FloatArray, basis: FloatArray, blank: Model) -> tuple[FilterBank, float]:
        """The strongest filters of a form, in the bins of the model, of loudness 1, and how loud they were."""
        filters, sign = strongest_filters(form, spectra, self.filters)
        length = self._coarse_length
        loudness = max(2 / length * float(np.einsum("fkc,fcd,fkd->", filters, spectra, filters, optimize=True)), 1e-30)
        fine, coarse = (np.arange(n // 2 + 1)[blank.band.bins(n)] / n for n in (blank.length, length))
        filters = interpolated(filters / np.sqrt(loudness), coarse, fine)
        return FilterBank(basis.astype(np.float32), filters.astype(np.float32), sign.astype(np.float32)), loudness

    def _sums(
        self, stretch: Stretch, model: Model, number: int, before: StripeStatistics | None, rules: Rules
    ) -> CrossSpectra | None:
        """Cross-spectra of a stripe; None where too little of it can be seen."""
        row, clear = self._clear(stretch, model, number, rules)
        if not clear.any():
            return None
        window = model.window(stretch.in_tone(model.tone).columns, row)
        inner = window[:, REACH:-REACH]
        usual = before.row_power[REACH:-REACH] if before is not None else np.median(inner**2, axis=0) / 0.455
        weight = softened(clear & believable(inner, usual, limits=rules.power_limits))
        return cross_spectra(window, weight, length=model.length) if weight.sum() > 100 else None

    def _clear(self, stretch: Stretch, model: Model, number: int, rules: Rules) -> tuple[FloatArray, BoolArray]:
        """Where a stripe runs, and in which columns it can be seen."""
        rows = model.layout.rows(stretch.displacement_px)
        seen = model.layout.visible(rows, half_px=self.half_px)[number]
        return rows[number], clear_columns(stretch, number, rows[number], seen, self.half_px, rules)

    def _tried(
        self,
        stretches: list[Stretch],
        fold: IntArray,
        blank: Model,
        number: int,
        learned: list[StripeStatistics],
        banks: list[list[FilterBank]],
        rules: Rules,
        spread: Spread,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Measure the means of what banks say of a stripe, how they answer to a moved path, and their powers."""

        def tried(pair: tuple[Stretch, int]) -> tuple[FloatArray, FloatArray, FloatArray] | None:
            stretch, left = pair
            row, clear = self._clear(stretch, blank, number, rules)
            if not clear.any():
                return None
            columns = stretch.in_tone(blank.tone).columns
            here, low, high = (blank.channels(columns, row + move, banks[left][0]) for move in (0.0, -MOVE_PX, MOVE_PX))
            weight = softened(clear & believable(here, learned[left].channel_power, limits=rules.power_limits))
            if weight.sum() <= 100:
                return None
            u, below, above = (
                np.array([said(z, weight, bank, band=blank.band, length=blank.length) for bank in banks[left]])
                for z in (here, low, high)
            )
            return u, weight.astype(np.float64), (below - above) @ weight / (2 * MOVE_PX)

        told = [one for one in spread(tried, zip(stretches, fold, strict=True)) if one is not None]
        columns = max(sum(float(w.sum()) for _, w, _ in told), 1.0)
        mean = sum((u @ w for u, w, _ in told), np.zeros(len(banks[0]))) / columns
        quiet = [quiet_power(u - mean[:, np.newaxis], w) for u, w, _ in told]
        powers = sum((power for power, _ in quiet), np.zeros((mean.size,) * 2)) / max(sum(s for _, s in quiet), 1e-12)
        answers = sum((answer for _, _, answer in told), np.zeros(mean.size)) / columns
        return mean, answers, powers


def _seen_in(model: Model, stretches: list[Stretch], spread: Spread) -> list[Stretch]:
    """All stretches in the tone of a model."""
    return list(spread(lambda stretch: stretch.in_tone(model.tone), stretches))


MOVE_PX = 0.1
"""By which paths are moved to see how scores answer."""
SMOOTH_CYCLES = 0.011
"""Cycles a pixel over which what is known of the noise is smoothed."""
