"""What a passage teaches about its own texture.

Some groups, spread over the passage, are laid ready and searched coarsely. Then rounds follow: lay windows about the present
paths, sum up their cross-spectra, invert them, move the paths by what the new model says. The first rounds add much to the
diagonal of C, which makes them forgiving, the last hardly anything. In each round the model is blurred by just the error that
paths have in that round, so the whole series of models will lead any other stretch in the same way from the coarse path to
the exact one. When the first exact model is to be learned it is learned in every tone, and the one that tells most is kept.

A model calls the path that it was learned from right, whatever that is. So the groups are dealt out to a few folds, and the
cross-spectra that move, judge and read a group are those of the other folds; only the tone, the whitening filter, the
channels, and what is said is worth (means, answers and powers) are those of all. In the first rounds all folds are lined
up by much the same model all the same, and what that calls zero looks right to the next ones (docs/decisions/0006).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gramoscope.conventions import FloatArray, IntArray
from gramoscope.disc.formats import Cut
from gramoscope.errors import require
from gramoscope.pickup.cartridge import Spread
from gramoscope.pickup.texture.following import REACH, wide_rows
from gramoscope.pickup.texture.hearing import clear_columns
from gramoscope.pickup.texture.lane_transform import fast_length
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.likelihood import StripeStatistics
from gramoscope.pickup.texture.reading import Model, Rules, evidence, step
from gramoscope.pickup.texture.spectrum import Band, whitening_filter
from gramoscope.pickup.texture.stretch import Stretch
from gramoscope.pickup.texture.stripe_learning import StripeLearning, StripeMaterial
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


@dataclass(frozen=True)
class Learning:
    """How the passage is learned.

    Parameters
    ----------
    half_px : int
        Rows of a window on each side of a stripe.
    largest_lag_px, change_lag_px, least_columns : int
        See `StripeLearning`.
    band_low, band_high : float
        Frequencies along the groove that are used, cycles a pixel.
    loading : tuple of float
        Of each round; see `spectrum.precision`.
    compressions : tuple of float
        Tones to choose from, see `texture.tone`; rounds before the choice use the first.
    spread_noises, spread_limit_px : float
        Paths are heard so many of their standard errors on either side, and so many pixels at the most.
    channels, patterns, filters : int
        See `StripeLearning`.
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
    patterns: int = 4
    filters: int = 4
    folds: int = 4

    def __post_init__(self) -> None:
        require(self.half_px >= 4, f"windows of ± {self.half_px} rows", "4 or more")
        require(self.spread_noises >= 0, f"a spread of {self.spread_noises} standard errors", "0 or more")
        require(0 <= self.spread_limit_px < 1, f"a spread of up to {self.spread_limit_px} px", "0 … below 1")
        most = wide_rows(self.half_px)
        require(self.stripe.channels <= most, f"{self.channels} channels", f"{most}, the rows of a window, or fewer")
        require(self.folds >= 2, f"{self.folds} folds", "2 or more")
        require(len(self.loading) >= 1, "no rounds", "at least one loading")
        require(len(self.compressions) >= 1, "no tone", "at least one compression; 0 leaves pictures as they are")
        for compression in self.compressions:
            Tone(compression=compression)
        require(0 < self.band_low < self.band_high <= 0.5, f"a band of {self.band_low} … {self.band_high}", "0 … 0.5")

    @property
    def stripe(self) -> StripeLearning:
        """How each stripe is learned."""
        return StripeLearning(
            self.largest_lag_px,
            self.change_lag_px,
            self.least_columns,
            self.channels,
            self.patterns,
            self.filters,
        )

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
        length = fast_length(width + self.largest_lag_px)
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
        every = np.arange(model.layout.wall.size)
        rows, seen = clear_columns(
            stretch, model.layout, every, half_px=self.half_px, least_support=rules.least_support
        )
        taper = np.hanning(256)
        spectra = []
        for row, clear in zip(rows, seen, strict=True):
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
        """Learn one stripe after the other."""
        whole: list[StripeStatistics | None] = []
        without: list[list[StripeStatistics | None]] = [[] for _ in range(self.folds)]
        for number in range(blank.layout.wall.size):
            alike = previous is not None and previous.tone == blank.tone
            before = previous.stripes[number] if previous is not None and alike else None
            material = StripeMaterial(stretches, fold, self.folds, blank, number, rules, spread)
            learned = self.stripe.learn(material, before, loading)
            whole.append(learned[-1])
            for one, statistics in zip(without, learned, strict=False):
                one.append(statistics)
        return Lesson(
            replace(blank, stripes=tuple(whole)), tuple(replace(blank, stripes=tuple(stripes)) for stripes in without)
        )


def _seen_in(model: Model, stretches: list[Stretch], spread: Spread) -> list[Stretch]:
    """All stretches in the tone of a model."""
    return list(spread(lambda stretch: stretch.in_tone(model.tone), stretches))
