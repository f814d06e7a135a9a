"""What a passage teaches about its own texture.

Some groups, spread over the passage, are laid ready and searched coarsely. Then rounds follow: lay windows about the present
paths, sum up their cross-spectra, invert them, move the paths by what the new model says. The first rounds add much to the
diagonal of C, which makes them forgiving, the last nothing. In each round the model is blurred by just the error that paths
have in that round, so the whole series of models will lead any other stretch in the same way from the coarse path to the
exact one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from scipy import fft

from gramoscope.conventions import FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import require
from gramoscope.pickup.cartridge import Spread
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import StripeStatistics, believable, quiet_power, scores, softened
from gramoscope.pickup.texture.reading import Model, Rules, Stretch, clear_columns, evidence, step, windows
from gramoscope.pickup.texture.spectrum import (
    Band,
    CrossSpectra,
    cross_spectra,
    information,
    precision,
    whitening_filter,
)


@dataclass(frozen=True)
class Learning:
    """How the passage is learned.

    Parameters
    ----------
    half_px : int
        Rows of a window on each side of a stripe.
    largest_lag_px : int
        Lags up to here may carry correlation: two blur discs at the window's edge and a grain.
    band_low, band_high : float
        Frequencies along the groove that are used, cycles a pixel.
    loading : tuple of float
        Of each round; see `spectrum.precision`.
    least_columns : int
        A stripe seen in fewer columns is not read.
    """

    half_px: int = 12
    largest_lag_px: int = 60
    band_low: float = 0.02
    band_high: float = 0.35
    loading: tuple[float, ...] = (0.03, 0.03, 0.01, 0.003, 0.001, 0.0, 0.0, 0.0)
    least_columns: int = 6000

    def __post_init__(self) -> None:
        require(self.half_px >= 4, f"windows of ± {self.half_px} rows", "4 or more")
        require(len(self.loading) >= 1, "no rounds", "at least one loading")
        require(0 < self.band_low < self.band_high <= 0.5, f"a band of {self.band_low} … {self.band_high}", "0 … 0.5")

    def learn(
        self,
        stretches: list[Stretch],
        layout: StripeLayout,
        cut: Cut,
        rules: Rules,
        spread: Spread,
        told: Callable[[], None] = lambda: None,
    ) -> tuple[list[Stretch], tuple[Model, ...]]:
        """Return the stretches with their paths improved, and a model for each round.

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
        whitener = self._whitener(stretches, layout, band, spread)
        models: list[Model] = []
        previous: Model | None = None
        for loading in self.loading:
            model = Model(layout, whitener, self.half_px, band, length, ())
            model = self._learned(stretches, model, previous, loading, rules, spread)
            stretches = list(spread(lambda s, m=model: s.moved(step(evidence(s, m, rules), cut, rules)), stretches))
            models.append(model)
            previous = model
            told()
        return stretches, tuple(models)

    def _whitener(self, stretches: list[Stretch], layout: StripeLayout, band: Band, spread: Spread) -> FloatArray:
        powers = [power for power in spread(lambda s: self._power(s, layout), stretches) if power is not None]
        if not powers:
            return whitening_filter(np.ones(129), band)
        return whitening_filter(np.mean(powers, axis=0), band)

    def _power(self, stretch: Stretch, layout: StripeLayout) -> FloatArray | None:
        """Mean power spectrum of the rows of all stripes in pieces of 256 columns."""
        rows = layout.rows(stretch.displacement_px)
        visible = layout.visible(rows, half_px=self.half_px)
        taper = np.hanning(256)
        spectra = []
        for row, seen in zip(rows, visible, strict=True):
            clear = clear_columns(stretch, row, seen, self.half_px)
            if not clear.any():
                continue
            window, _ = windows(stretch, row, np.ones(1), self.half_px)
            for start in range(0, clear.size - 256, 128):
                piece = slice(start, start + 256)
                if clear[piece].all():
                    level = window[:, piece] - window[:, piece].mean(axis=1, keepdims=True)
                    spectra.append(np.mean(np.abs(np.fft.rfft(level * taper, axis=1)) ** 2, axis=0))
        return np.median(spectra, axis=0) if spectra else None

    def _learned(
        self,
        stretches: list[Stretch],
        model: Model,
        previous: Model | None,
        loading: float,
        rules: Rules,
        spread: Spread,
    ) -> Model:
        """Learn one stripe after the other: their spectra first, then how their scores behave."""
        statistics: list[StripeStatistics | None] = []
        for number in range(model.layout.wall.size):
            before = previous.stripes[number] if previous is not None else None
            sums = [
                s
                for s in spread(lambda s, n=number, b=before: self._sums(s, model, n, b, rules), stretches)
                if s is not None
            ]
            columns = int(sum(size for _, _, size in sums))
            if columns < self.least_columns:
                statistics.append(None)
                continue
            total = reduce(_added, (spectra for spectra, _, _ in sums))
            power = np.sum([p for _, p, _ in sums], axis=0) / columns
            c, dc = total.spectra(largest_lag_px=self.largest_lag_px, length=model.length)
            bins = model.band.bins(model.length)
            inverse = precision(c, band=bins, loading=loading)
            told = information(inverse, dc, band=bins, length=model.length)
            first = StripeStatistics(inverse, told, told, 0.0, power.astype(np.float32), columns)
            statistics.append(self._tried(stretches, model, number, first, rules, spread))
        return replace(model, stripes=tuple(statistics))

    def _sums(
        self, stretch: Stretch, model: Model, number: int, before: StripeStatistics | None, rules: Rules
    ) -> tuple[CrossSpectra, FloatArray, float] | None:
        laid = self._laid(stretch, model, number, before, rules)
        if laid is None:
            return None
        window, derivative, weight = laid
        spectra = cross_spectra(window, derivative, weight, length=model.length)
        return spectra, (window**2 * weight).sum(axis=1).astype(np.float64), float(weight.sum())

    def _laid(self, stretch: Stretch, model: Model, number: int, before: StripeStatistics | None, rules: Rules):
        row = model.layout.rows(stretch.displacement_px)[number]
        seen = model.layout.visible(model.layout.rows(stretch.displacement_px), half_px=self.half_px)[number]
        clear = clear_columns(stretch, row, seen, self.half_px)
        if not clear.any():
            return None
        window, derivative = windows(stretch, row, model.whitener, self.half_px)
        usual = before.row_power if before is not None else np.median(window**2, axis=1) / 0.455
        clear &= believable(window, usual, limits=rules.power_limits)
        weight = softened(clear)
        return (window, derivative, weight) if weight.sum() > 100 else None

    def _tried(
        self,
        stretches: list[Stretch],
        model: Model,
        number: int,
        statistics: StripeStatistics,
        rules: Rules,
        spread: Spread,
    ) -> StripeStatistics:
        """Measure the mean and the power of the scores that a stripe gives."""

        def tried(stretch: Stretch) -> tuple[FloatArray, FloatArray] | None:
            laid = self._laid(stretch, model, number, statistics, rules)
            if laid is None:
                return None
            window, derivative, weight = laid
            u = scores(window, derivative, weight, statistics.inverse, band=model.band, length=model.length)
            return u, weight.astype(np.float64)

        told = [one for one in spread(tried, stretches) if one is not None]
        columns = sum(float(w.sum()) for _, w in told)
        mean = sum(float(np.sum(u * w)) for u, w in told) / max(columns, 1.0)
        powers = np.sum([quiet_power(u - mean, w) for u, w in told], axis=0)
        return replace(statistics, mean_score=mean, score_power=float(powers[0] / max(powers[1], 1e-12)))


def _added(one: CrossSpectra, other: CrossSpectra) -> CrossSpectra:
    one.add(other)
    return one
