"""What a passage teaches about one stripe: how its rows hang together, and by which filters it is best heard.

Cross-spectra first, of all stretches but those of one fold at a time; from them what both witnesses say, as quadratic forms;
how the witnesses behave; and the filters of the best mixture of both. How those behave is measured again, for what they say
is what is read by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from operator import add

import numpy as np

from gramoscope.conventions import BoolArray, FloatArray, IntArray
from gramoscope.errors import require
from gramoscope.pickup.cartridge import Spread
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.filter_bank import (
    FilterBank,
    common_channels,
    interpolated,
    root,
    row_weights,
    strongest_filters,
    strongest_patterns,
    through_channels,
    usual_power,
    witness_forms,
)
from gramoscope.pickup.texture.following import REACH, SHARP, across, wide_rows
from gramoscope.pickup.texture.hearing import clear_columns
from gramoscope.pickup.texture.likelihood import (
    StripeStatistics,
    believable,
    best_shares,
    quiet_power,
    said,
    softened,
)
from gramoscope.pickup.texture.reading import Model, Rules
from gramoscope.pickup.texture.spectrum import CrossSpectra, LagSums, precision
from gramoscope.pickup.texture.stretch import Stretch

LEAST_WEIGHT = 100.0
"""Columns of a stretch; with fewer it teaches nothing."""
MOVE_PX = 0.1
"""By which paths are moved to see how scores answer."""
SMOOTH_CYCLES = 0.011
"""Cycles a pixel over which the least that a covariance may have is smoothed."""
INNER_ROWS = slice(REACH, -REACH)


@dataclass(frozen=True, eq=False)
class StripeMaterial:
    """What there is to learn a stripe from.

    Parameters
    ----------
    stretches : list of Stretch
        In the tone of the model.
    fold : int array, shape (stretch,)
    folds : int
    model : Model
        Whose stripes are still to be learned.
    number : int
        Of the stripe.
    rules : Rules
    spread : callable
        How a function is mapped over stretches.
    """

    stretches: list[Stretch]
    fold: IntArray
    folds: int
    model: Model
    number: int
    rules: Rules
    spread: Spread

    def clear(self, stretch: Stretch) -> tuple[FloatArray, BoolArray]:
        """Return where the stripe runs, and in which columns it can be seen."""
        rows, clear = clear_columns(
            stretch,
            self.model.layout,
            np.array([self.number]),
            half_px=self.model.half_px,
            least_support=self.rules.least_support,
        )
        return rows[0], clear[0]

    def sums(self, before: StripeStatistics | None, largest_lag_px: int) -> list[LagSums]:
        """Return what all stretches without those of each fold come to, up to a largest lag, and all of them."""
        rows = wide_rows(self.model.half_px)

        def summed(some: Sequence[Stretch]) -> CrossSpectra:
            total = CrossSpectra(rows, self.model.length)
            for stretch in some:
                self._add(stretch, before, total)
            return total

        parts = [(k, some) for k in range(self.folds) for some in _in_parts(self._of_fold(k))]
        of_fold = [CrossSpectra(rows, self.model.length) for _ in range(self.folds)]
        for one, (k, _) in zip(self.spread(summed, [some for _, some in parts]), parts, strict=True):
            of_fold[k].add(one)
        lags = list(self.spread(lambda one: one.lags(largest_lag_px), of_fold))
        return [reduce(add, lags[:left] + lags[left + 1 :]) for left in range(self.folds)] + [reduce(add, lags)]

    def _of_fold(self, number: int) -> list[Stretch]:
        return [stretch for stretch, k in zip(self.stretches, self.fold, strict=True) if k == number]

    def _add(self, stretch: Stretch, before: StripeStatistics | None, total: CrossSpectra) -> None:
        """Add the cross-spectra of one stretch, where the stripe can be seen and is believed."""
        row, clear = self.clear(stretch)
        if not clear.any():
            return
        window = self.model.window(stretch.columns, row)
        usual = np.median(window**2, axis=0) / CHI2_MEDIAN if before is None else before.row_power
        power = window**2 @ row_weights(np.asarray(usual, np.float64), INNER_ROWS)
        weight = softened(clear & believable(power, limits=self.rules.power_limits))
        if weight.sum() > LEAST_WEIGHT:
            total.see(window, weight)

    def tried(self, banks: list[list[FilterBank]]) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the means of what banks say, how they answer to a moved path, and their powers.

        Parameters
        ----------
        banks : list of lists of FilterBank
            Those by which the stretches of each fold are read, with one basis for all.
        """
        model = self.model

        def told_of(pair: tuple[Stretch, int]) -> tuple[FloatArray, FloatArray, FloatArray] | None:
            stretch, heard_by = pair[0], banks[pair[1]]
            row, clear = self.clear(stretch)
            if not clear.any():
                return None
            here, low, high = (
                model.channels(stretch.columns, row + move, heard_by[0]) for move in (0.0, -MOVE_PX, MOVE_PX)
            )
            weight = softened(clear & believable(heard_by[0].power(here), limits=self.rules.power_limits))
            if weight.sum() <= LEAST_WEIGHT:
                return None
            u, below, above = (
                np.array([said(z, weight, bank, band=model.band, length=model.length) for bank in heard_by])
                for z in (here, low, high)
            )
            return u, weight.astype(np.float64), (below - above) @ weight / (2 * MOVE_PX)

        pairs = zip(self.stretches, self.fold, strict=True)
        told = [one for one in self.spread(told_of, pairs) if one is not None]
        count = len(banks[0])
        columns = max(sum(float(weight.sum()) for _, weight, _ in told), 1.0)
        mean = sum((u @ weight for u, weight, _ in told), np.zeros(count)) / columns
        quiet = [quiet_power(u - mean[:, np.newaxis], weight) for u, weight, _ in told]
        powers = sum((power for power, _ in quiet), np.zeros((count, count))) / max(
            sum(size for _, size in quiet), 1e-12
        )
        answers = sum((answer for _, _, answer in told), np.zeros(count)) / columns
        return mean, answers, powers


PART = 4
"""So many stretches are summed by one thread, whatever the number of threads: sums do not depend on that."""


def _in_parts(stretches: Sequence[Stretch]) -> list[Sequence[Stretch]]:
    return [stretches[first : first + PART] for first in range(0, len(stretches), PART)]


CHI2_MEDIAN = 0.455
"""Median of the square of a standard normal variable."""


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
        (first, second), spectra = through_channels(self.witnesses, self.spectra, basis)
        return Forms((first, second), spectra, self.length)

    @cached_property
    def root(self) -> FloatArray:
        """L with L Lᵀ = C_f."""
        return root(self.spectra)

    def loudness(self, filters: FloatArray) -> float:
        """Return Σ p² of filters of this window in the mean of all columns."""
        power = np.einsum("fkc,fcd,fkd->", filters, self.spectra, filters, optimize=True)
        return max(2 / self.length * float(power), 1e-30)


@dataclass(frozen=True)
class StripeLearning:
    """How a stripe is learned.

    Parameters
    ----------
    largest_lag_px : int
        Lags up to here may carry correlation: the light of points far from the stripe reaches its rows in large discs.
    change_lag_px : int
        The same for how correlation changes when a path moves: what is left out costs little, and the rest is known better.
    least_columns : int
        A stripe seen in fewer columns is not read.
    channels, patterns, filters : int
        Channels of a window that are drawn, at most 16, those among them that show whether there is the usual texture, and
        filters, an even number.
    """

    largest_lag_px: int = 150
    change_lag_px: int = 30
    least_columns: int = 6000
    channels: int = 16
    patterns: int = 4
    filters: int = 4

    def __post_init__(self) -> None:
        require(self.channels <= LANES, f"{self.channels} channels", f"at most {LANES}, which are heard at once")
        require(
            1 <= self.patterns < self.channels,
            f"{self.patterns} of {self.channels} channels for the usual texture",
            "at least one, and fewer than all",
        )
        require(
            2 <= self.filters <= self.channels and self.filters % 2 == 0,
            f"{self.filters} filters",
            "an even number of them, 2 or more, and no more than channels",
        )

    @property
    def length(self) -> int:
        """Of a transform whose bins spectra that are cut off at the largest lag can just tell apart."""
        return 2 * self.largest_lag_px + 2

    def learn(
        self, material: StripeMaterial, before: StripeStatistics | None, loading: float
    ) -> list[StripeStatistics | None]:
        """Return what is known of a stripe without each fold, and from all of them.

        Parameters
        ----------
        material : StripeMaterial
        before : StripeStatistics or None
            What was known already, in the same tone.
        loading : float
            See `spectrum.precision`.

        Returns
        -------
        list of StripeStatistics or None
            All None when a fold left out leaves too few columns.
        """
        sums = material.sums(before, max(self.largest_lag_px, self.change_lag_px))
        if min(one.columns for one in sums) < self.least_columns:
            return [None] * len(sums)
        known = list(material.spread(lambda one: self._forms(one, material.model, loading), sums))
        deaf = self._deaf(sums[-1], known[-1])
        seen = list(material.spread(lambda one: one.through(deaf.basis.astype(np.float64)), known))
        alone = list(
            material.spread(
                lambda one: [self._heard_by(deaf, form, one, material.model) for form in one.witnesses], seen
            )
        )
        _, answers, powers = material.tried([[bank for bank, _ in pair] for pair in alone])
        shares = best_shares(answers, powers)

        def best_of(both: tuple[Forms, list[tuple[FilterBank, float]]]) -> FilterBank:
            one, pair = both
            mixed = sum(
                share / loudness * form for share, (_, loudness), form in zip(shares, pair, one.witnesses, strict=True)
            )
            return self._heard_by(deaf, np.asarray(mixed), one, material.model)[0]

        banks = list(material.spread(best_of, zip(seen, alone, strict=True)))
        mean, answers, powers = material.tried([[bank] for bank in banks])
        return [
            StripeStatistics(
                bank,
                information=max(float(answers[0]), 1e-6),
                score_power=float(powers[0, 0]),
                mean_score=float(mean[0]),
                row_power=np.diag(one.covariance),
                columns=one.columns,
            )
            for one, bank in zip(sums, banks, strict=True)
        ]

    def _forms(self, sums: LagSums, model: Model, loading: float) -> Forms:
        """What spectra say about paths, in the bins that they can tell apart."""
        frequency = model.band.frequencies(self.length)
        wide = sums.spectra(frequency, largest_lag_px=self.largest_lag_px)
        near = sums.spectra(frequency, largest_lag_px=self.change_lag_px)
        c = wide[:, INNER_ROWS, INNER_ROWS]
        inverse, _ = precision(c, loading=loading, smooth_bins=SMOOTH_CYCLES * self.length)
        slope = np.pad(across(c.shape[1], SHARP), ((0, 0), (REACH - SHARP.size,) * 2))
        half = slope @ near[:, :, INNER_ROWS]
        forms = witness_forms(inverse, half + half.transpose(0, 2, 1), spread_px=model.spread_px)
        return Forms(forms, wide, self.length)

    def _deaf(self, sums: LagSums, known: Forms) -> FilterBank:
        """A bank with channels, and no filters yet."""
        patterns = np.zeros((sums.rows, self.patterns))
        patterns[INNER_ROWS] = strongest_patterns(sums.covariance[INNER_ROWS, INNER_ROWS], self.patterns)
        basis = common_channels(known.witnesses, known.spectra, patterns, self.channels)
        usual = usual_power(sums.covariance, basis, INNER_ROWS)
        none = np.empty((0, 0, self.channels), np.float32)
        return FilterBank(basis.astype(np.float32), none, np.empty(0, np.float32), usual.astype(np.float32))

    def _heard_by(self, deaf: FilterBank, form: FloatArray, seen: Forms, model: Model) -> tuple[FilterBank, float]:
        """The bank with the strongest filters of a form, of loudness 1 together, and how loud they were."""
        filters, sign = strongest_filters(form, seen.spectra, seen.root, self.filters)
        loudness = seen.loudness(filters)
        fine, coarse = (model.band.frequencies(length) for length in (model.length, seen.length))
        filters = interpolated(filters / np.sqrt(loudness), coarse, fine)
        return replace(deaf, filters=filters.astype(np.float32), sign=sign.astype(np.float32)), loudness
