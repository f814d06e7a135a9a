"""A few filters whose energies tell which way a path should move.

What a witness (see `likelihood`) says of a path is a quadratic form of the window about it, xᴴ Q_f x at every frequency f. Most
of such a form is in a few of its eigenvectors: seen through them the window is loud in some when the path lies too low, and
in the others when it lies too high,

    u(s) = Σ_k ± p_k(s)²,     p_k = U_k x,

and four of them know as much as all forty-one: what the rest would add is mostly what the passage could not tell well enough
(docs/decisions/0008). Two more things make them quick. All filters are mixtures of the same few *channels* of the window, so
that only these are drawn, whitened and transformed. And hearing both sides of a path, which is the mean of the same form about
two paths beside each other, is one form of a slightly wider window.

The filters of neighbouring frequencies are turned into each other as far as their energies allow (Procrustes), so that the
products of different frequencies, of which everything that changes along the groove consists, are right too.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate
from operator import matmul

import numba
import numpy as np
from scipy import fft

from gramoscope.conventions import Float32Array, FloatArray
from gramoscope.pickup.lane_writer import LANES
from gramoscope.pickup.texture.following import GENTLE, across, shifted
from gramoscope.pickup.texture.spectrum import Band

LEAST_POWER = 1e-6
"""Of the loudest direction: what is weaker in a covariance is taken to be that strong."""


@dataclass(frozen=True, eq=False)
class FilterBank:
    """What turns a window into the energies that a score is made of.

    Attributes
    ----------
    basis : float32 array, shape (row, channel)
        The channels: uncorrelated and of power 1 in the passage that was learned from.
    filters : float32 array, shape (bin in the band, filter, channel)
    sign : float32 array, shape (filter,)
        Whether more energy asks for a path with a higher row number, +1, or a lower one, −1.
    usual : float32 array, shape (channel, 16)
        What shows whether there is the usual texture, and nothing but it; see `usual_power`.
    """

    basis: Float32Array
    filters: Float32Array
    sign: Float32Array
    usual: Float32Array

    def power(self, channels: Float32Array) -> Float32Array:
        """Return how much there is in each column, of channels of shape (column, channel); 1 on average.

        Returns
        -------
        float32 array, shape (column, 2)
            Of the texture, and of anything.
        """
        seen = (channels @ self.usual).reshape(len(channels), 2, HALF)
        return np.asarray(np.einsum("xhc,xhc->xh", seen, seen))

    def heard(self, channels: Float32Array, *, band: Band, length: int) -> tuple[Float32Array, Float32Array]:
        """Return Σ ± p² and Σ p² in each column.

        Parameters
        ----------
        channels : float32 array, shape (column, channel)
            Whitened, zero where nothing is to be heard.
        band : Band
        length : int
            Of the transform, at least the number of columns.
        """
        spectrum = fft.rfft(channels, length, axis=0)
        through = np.zeros((1, self.sign.size, spectrum.shape[0]), np.complex64)
        let_through(spectrum[np.newaxis], self.filters[np.newaxis], band.bins(length).start, through)
        p = fft.irfft(through[0], length)
        score, loudness = np.empty((2, channels.shape[0]), np.float32)
        energies(p, self.sign, score, loudness)
        return score, loudness


@numba.njit(cache=True, nogil=True, fastmath=True)
def let_through(spectrum, filters, first, through):  # type: ignore[no-untyped-def]
    """Write what each stripe's filters let through, [stripe, filter, bin], of [stripe, bin, channel], from a first bin on."""
    stripes, bins, count, channels = filters.shape
    for i in range(stripes):
        for b in range(bins):
            for k in range(count):
                real, imaginary = np.float32(0), np.float32(0)
                for c in range(channels):
                    real += filters[i, b, k, c] * spectrum[i, first + b, c].real
                    imaginary += filters[i, b, k, c] * spectrum[i, first + b, c].imag
                through[i, k, first + b] = complex(real, imaginary)


@numba.njit(cache=True, nogil=True)
def energies(p, sign, score, loudness):  # type: ignore[no-untyped-def]
    """Write Σ ± p² and Σ p² of the first columns of [filter, column]."""
    score[:], loudness[:] = np.float32(0), np.float32(0)
    for k in range(sign.size):
        row, s = p[k, : score.size], sign[k]
        for x in range(score.size):
            energy = row[x] * row[x]
            score[x] += s * energy
            loudness[x] += energy


def witness_forms(inverse: FloatArray, change: FloatArray, *, spread_px: float) -> tuple[FloatArray, FloatArray]:
    """Return Q_f of both witnesses: −x'ᵀ C⁻¹x and −½ xᵀ C⁻¹ C′ C⁻¹ x, each the mean of both sides of a path.

    The camera's noise N y, which does not move with the groove, need not be taken off x: of a form only the symmetric part
    is heard, and (N y)'ᵀ y has none.

    Parameters
    ----------
    inverse, change : float64 arrays, shape (bin, row, row)
        C⁻¹ and C′.
    spread_px : float
        How far on either side of the path the window is heard, less than 1.

    Returns
    -------
    float64 arrays, shape (bin, row + 16, row + 16)
        Symmetric, of the window and eight rows more on each side.
    """
    rows = inverse.shape[1]
    near = GENTLE.size
    window = np.eye(rows, rows + 2 * near, near)
    answers = (-across(rows, GENTLE).T, -0.5 * (window.T @ inverse @ change))
    sides = [shifted(rows + 2 * near, side) for side in (-spread_px, spread_px)]
    forms = []
    for answer in answers:
        form = answer @ (inverse @ window)
        form = 0.5 * (form + form.transpose(0, 2, 1))
        forms.append(0.5 * sum(side.T @ form @ side for side in sides))
    return np.asarray(forms[0]), np.asarray(forms[1])


def root(covariance: FloatArray) -> FloatArray:
    """Return L with L Lᵀ the covariance (of each bin), what is next to nothing in it lifted a little; by eigenvectors."""
    power, vector = np.linalg.eigh(covariance)
    safe = np.maximum(power, LEAST_POWER * np.maximum(power[..., -1:], 1e-30))
    return np.asarray(vector * np.sqrt(safe)[..., None, :])


def _safe(covariance: FloatArray) -> FloatArray:
    """A covariance that can be inverted even where nothing was seen."""
    size = covariance.shape[-1]
    mean = np.trace(covariance, axis1=-2, axis2=-1) / size
    return np.asarray(covariance + (1e-12 * mean + 1e-30)[..., None, None] * np.eye(size))


def strongest_patterns(covariance: FloatArray, count: int) -> FloatArray:
    """Return the patterns that have most of a window's power, every row counting the same.

    Parameters
    ----------
    covariance : float64 array, shape (row, row)
        Of the rows in one column.
    count : int

    Returns
    -------
    float64 array, shape (row, pattern)
    """
    scale = 1 / np.sqrt(np.maximum(np.diag(covariance), 1e-30))
    _, vector = np.linalg.eigh(scale[:, None] * covariance * scale)
    return np.asarray(scale[:, None] * vector[:, -count:])


def texture_weight(row_power: FloatArray) -> FloatArray:
    """Return how much each row of a window counts for whether the usual texture is there.

    The quietest row is taken to show none of it: noise, and what is out of focus. Then a share t of the texture gives rows
    the variance v_r = n + t · (c_r − n), and t is told best by Σ (c_r − n)/v_r² · x_r² (least squares, weighted by the
    variance of squares of a normal variable); so that it is told best where it is hard to tell, t is `FAINT` here.

    Parameters
    ----------
    row_power : float64 array, shape (row,)
        c, the mean squares of rows; where all are the same, all count.

    Returns
    -------
    float64 array, shape (row,)
        Σ w_r c_r = 1.
    """
    power = np.maximum(row_power, 1e-30)
    quiet = (1 - 1e-6) * power.min()
    weight = (power - quiet) / (quiet + FAINT * (power - quiet)) ** 2
    return np.asarray(weight / (weight @ power))


FAINT = 0.2
"""Of the usual texture: with so much of it a wall is there or not."""


def row_weights(row_power: FloatArray, rows: slice) -> FloatArray:
    """Return how much rows count for how much texture there is, and for how much of anything: `rows`, each by its own power.

    Returns
    -------
    float64 array, shape (row, 2)
        With Σ w_r c_r = 1.
    """
    anything = np.zeros(row_power.shape)
    anything[rows] = 1 / np.maximum(row_power[rows], 1e-30)
    return np.stack([texture_weight(row_power), anything / anything[rows].size], axis=1)


HALF = LANES // 2
"""Of the lanes show the texture, the others anything."""


def usual_power(covariance: FloatArray, basis: FloatArray, rows: slice) -> FloatArray:
    """Return P so that the halves of |zᵀP|² are the power of texture and of anything, as channels z tell it; 1 on average.

    Parameters
    ----------
    covariance : float64 array, shape (row, row)
        Of the rows in one column.
    basis : float64 array, shape (row, channel)
    rows : slice
        Which rows count, where anything counts.

    Returns
    -------
    float64 array, shape (channel, 16)
        Of each form `row_weights` its eight strongest directions.
    """
    seen = basis.T @ covariance @ basis
    expected = np.linalg.solve(_safe(seen), (covariance @ basis).T)
    usual = np.zeros((2, basis.shape[1], HALF))
    for half, weight in zip(usual, row_weights(np.diag(covariance), rows).T, strict=True):
        strongest = root((expected * weight) @ expected.T)[:, -HALF:]
        half[:, : strongest.shape[1]] = strongest / np.sqrt(max(float(np.sum(strongest * (seen @ strongest))), 1e-30))
    return np.concatenate(list(usual), axis=1)


def common_channels(forms: tuple[FloatArray, ...], spectra: FloatArray, patterns: FloatArray, count: int) -> FloatArray:
    """Return the channels of a window in which quadratic forms are best kept, and some patterns whole.

    Parameters
    ----------
    forms : tuple of float64 arrays, shape (bin, row, row)
        Each counts as much as the others.
    spectra : float64 array, shape (bin, row, row)
        C_f.
    patterns : float64 array, shape (row, pattern)
    count : int
        More than there are patterns.

    Returns
    -------
    float64 array, shape (row, channel)
        Uncorrelated and of power 1 in the mean over the bins.
    """
    mean = root(spectra.mean(axis=0))
    total = np.zeros(mean.shape)
    for form in forms:
        # E[(Qx)(Qx)ᵀ]: in which directions a form looks, by how much it says
        looked = mean.T @ form @ spectra @ form @ mean
        power = np.einsum("fij,fji->", form @ spectra, form @ spectra)
        total += looked.sum(axis=0) / max(float(power), 1e-30)
    _, vector = np.linalg.eigh(total)
    kept = mean.T @ patterns
    wanted = np.concatenate([kept, vector[:, : -(count - patterns.shape[1]) - 1 : -1]], axis=1)
    orthogonal, _ = np.linalg.qr(wanted)
    return np.asarray(np.linalg.solve(mean.T, orthogonal))


def through_channels(
    forms: tuple[FloatArray, ...], spectra: FloatArray, basis: FloatArray
) -> tuple[tuple[FloatArray, ...], FloatArray]:
    """Return forms and the spectra as they are seen through channels.

    What a form says of rows is said of what the channels lead to expect of the rows, R z with R = C B (BᵀC B)⁻¹.

    Returns
    -------
    (float64 arrays, float64 array), shape (bin, channel, channel)
    """
    shown = spectra @ basis
    seen = basis.T @ shown
    expected = np.linalg.solve(_safe(seen), shown.transpose(0, 2, 1))
    return tuple(expected @ form @ expected.transpose(0, 2, 1) for form in forms), np.asarray(seen)


def strongest_filters(
    form: FloatArray, spectra: FloatArray, lower: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return the filters whose energies make up most of a form.

    Parameters
    ----------
    form, spectra : float64 arrays, shape (bin, channel, channel)
        Q_f and C_f.
    lower : float64 array, same shape
        L with L Lᵀ = C_f; see `root`.
    count : int
        Even: half of the filters have positive energies, half negative ones.

    Returns
    -------
    filters : float64 array, shape (bin, filter, channel)
        Σ_k sign_k (U_k x)² ≈ xᵀ Q x.
    sign : float64 array, shape (filter,)
    """
    half = count // 2
    strength, vector = np.linalg.eigh(lower.transpose(0, 2, 1) @ form @ lower)
    used = np.r_[0:half, -half:0]
    strength, vector = strength[:, used], vector[:, :, used]
    sign = np.repeat([-1.0, 1.0], half)
    # √|μ| L⁻ᵀ w = Q L w sign / √|μ|, without an inverse; an eigenvalue of the other sign says nothing here
    found = sign * strength > 1e-9 * np.abs(strength).max(initial=0.0)
    scale = np.where(found, sign / np.sqrt(np.where(found, np.abs(strength), 1.0)), 0.0)
    filters = (form @ lower @ vector * scale[:, None, :]).transpose(0, 2, 1).copy()
    for side in (slice(0, half), slice(half, count)):
        # turned by V, the next is turned by V times what it would be turned by if this one were not
        left, _, right = np.linalg.svd(filters[:-1, side] @ spectra[1:] @ filters[1:, side].transpose(0, 2, 1))
        turns = accumulate(left @ right, matmul, initial=np.eye(half))
        filters[:, side] = np.stack(list(turns)) @ filters[:, side]
    return filters, sign


def interpolated(filters: FloatArray, bins: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return filters at other bins, by straight lines; beyond the ends they are held."""
    at = np.interp(wanted, bins, np.arange(bins.size))
    low = np.minimum(at.astype(np.int64), bins.size - 2)
    share = (at - low)[:, None, None]
    return np.asarray((1 - share) * filters[low] + share * filters[low + 1])
