"""Kalman filter and smoother for a quantity that varies smoothly along the groove.

The paper names Kalman filtering among its index terms and never says where; here it smooths the orientation of the wall
along the passage. The quantity x(s) is taken as a stationary Gaussian process with the Matérn covariance of order 3/2,

    k(d) = σ² (1 + λ d) exp(−λ d),

which has a state of two: x and dx/ds. Over a distance d the state moves by

    A = e^{−λd} [[1 + λd, d], [−λ²d, 1 − λd]],      P∞ = diag(σ², λ²σ²),      Q = P∞ − A P∞ Aᵀ

(Hartikainen and Särkkä, *Kalman filtering and smoothing solutions to temporal Gaussian process regression models*, 2010).
In a gap the estimate relaxes to zero and its error to σ: no information, and it says so. Backwards the smoother is that of
Rauch, Tung and Striebel (AIAA Journal 3, 1965).
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from scipy import optimize

from gramoscope.conventions import BoolArray, FloatArray


@dataclass(frozen=True)
class Prior:
    """What is assumed of the quantity before it is measured.

    Attributes
    ----------
    sigma : float
        Its standard deviation σ.
    rate_per_m : float
        λ, one over the distance along which it forgets itself.
    """

    sigma: float
    rate_per_m: float


@dataclass(frozen=True, eq=False)
class State:
    """Mean (x, dx/ds) and covariance at a place: where a filter can go on."""

    arc_m: float
    mean: FloatArray
    covariance: FloatArray


def rest(prior: Prior, arc_m: float) -> State:
    """Return the state before anything was measured."""
    return State(arc_m, np.zeros(2), np.diag([prior.sigma**2, (prior.rate_per_m * prior.sigma) ** 2]))


@numba.njit(cache=True, nogil=True)
def _move(distance, sigma2, rate, a, q):  # type: ignore[no-untyped-def]
    """Write A and Q for one step; distance in units of 1/rate keeps the two states of one size."""
    d = rate * distance
    decay = np.exp(-d)
    a[0, 0], a[0, 1] = decay * (1 + d), decay * d
    a[1, 0], a[1, 1] = -decay * d, decay * (1 - d)
    q[0, 0] = sigma2 * (1 - a[0, 0] ** 2 - a[0, 1] ** 2)
    q[0, 1] = -sigma2 * (a[0, 0] * a[1, 0] + a[0, 1] * a[1, 1])
    q[1, 0] = q[0, 1]
    q[1, 1] = sigma2 * (1 - a[1, 0] ** 2 - a[1, 1] ** 2)


@numba.njit(cache=True, nogil=True)
def _predict(a, q, m, p, m_out, p_out):  # type: ignore[no-untyped-def]
    m_out[0] = a[0, 0] * m[0] + a[0, 1] * m[1]
    m_out[1] = a[1, 0] * m[0] + a[1, 1] * m[1]
    for i in range(2):
        for j in range(2):
            total = q[i, j]
            for k in range(2):
                for n in range(2):
                    total += a[i, k] * p[k, n] * a[j, n]
            p_out[i, j] = total


@numba.njit(cache=True, nogil=True)
def _observe(value, variance, m, p):  # type: ignore[no-untyped-def]
    """Update mean and covariance in place; returns the log likelihood of the observation."""
    spread = p[0, 0] + variance
    innovation = value - m[0]
    g0, g1 = p[0, 0] / spread, p[1, 0] / spread
    m[0] += g0 * innovation
    m[1] += g1 * innovation
    p00, p01, p11 = p[0, 0], p[0, 1], p[1, 1]
    p[0, 0] = (1 - g0) * p00
    p[0, 1] = (1 - g0) * p01
    p[1, 0] = p[0, 1]
    p[1, 1] = p11 - g1 * p01
    return -0.5 * (np.log(2 * np.pi * spread) + innovation**2 / spread)


@numba.njit(cache=True, nogil=True)
def _filter(arc, value, variance, single, gate, sigma2, rate, arc0, m, p, means, covs, pred_m, pred_p, outlier):  # type: ignore[no-untyped-def]
    a, q = np.empty((2, 2)), np.empty((2, 2))
    loglik = 0.0
    at = arc0
    for k in range(arc.size):
        _move(arc[k] - at, sigma2, rate, a, q)
        _predict(a, q, m, p, pred_m[k], pred_p[k])
        m[:], p[:] = pred_m[k], pred_p[k]
        at = arc[k]
        if np.isfinite(value[k]) and np.isfinite(variance[k]):
            if (value[k] - m[0]) ** 2 > gate**2 * (p[0, 0] + single[k]):
                # as likely as a value right at the gate: far ones must not teach the prior anything
                loglik -= 0.5 * (np.log(2 * np.pi * (p[0, 0] + variance[k])) + gate**2)
                outlier[k] = True
            else:
                loglik += _observe(value[k], variance[k], m, p)
        means[k], covs[k] = m, p
    return loglik


@numba.njit(cache=True, nogil=True)
def _smooth(arc, sigma2, rate, means, covs, pred_m, pred_p):  # type: ignore[no-untyped-def]
    """Rauch–Tung–Striebel, in place on `means` and `covs`."""
    a, q, g, ap = np.empty((2, 2)), np.empty((2, 2)), np.empty((2, 2)), np.empty((2, 2))
    for k in range(arc.size - 2, -1, -1):
        _move(arc[k + 1] - arc[k], sigma2, rate, a, q)
        n = pred_p[k + 1]
        det = n[0, 0] * n[1, 1] - n[0, 1] * n[1, 0]
        for i in range(2):
            for j in range(2):
                ap[i, j] = covs[k, i, 0] * a[j, 0] + covs[k, i, 1] * a[j, 1]
        for i in range(2):
            g[i, 0] = (ap[i, 0] * n[1, 1] - ap[i, 1] * n[1, 0]) / det
            g[i, 1] = (ap[i, 1] * n[0, 0] - ap[i, 0] * n[0, 1]) / det
        d0, d1 = means[k + 1, 0] - pred_m[k + 1, 0], means[k + 1, 1] - pred_m[k + 1, 1]
        for i in range(2):
            means[k, i] += g[i, 0] * d0 + g[i, 1] * d1
        change = covs[k + 1] - n
        for i in range(2):
            for j in range(2):
                total = 0.0
                for u in range(2):
                    for v in range(2):
                        total += g[i, u] * change[u, v] * g[j, v]
                q[i, j] = total
        covs[k] += q


@dataclass(frozen=True, eq=False)
class Smoothed:
    """Result of `smooth`.

    Attributes
    ----------
    mean, sigma : float64 arrays, shape (event,)
        Smoothed quantity and its standard error.
    outlier : bool array, shape (event,)
        Observations that were given no weight.
    filtered : State
        State at the event asked for, from the past alone: where the next piece goes on.
    log_likelihood : float
    """

    mean: FloatArray
    sigma: FloatArray
    outlier: BoolArray
    filtered: State
    log_likelihood: float


def smooth(
    arc_m: FloatArray,
    value: FloatArray,
    variance: FloatArray,
    *,
    prior: Prior,
    start: State,
    gate_variance: FloatArray | None = None,
    gate: float = np.inf,
    keep: int = -1,
) -> Smoothed:
    """Filter forwards and smooth backwards over events along the groove.

    Parameters
    ----------
    arc_m : float64 array, shape (event,)
        Places, not falling, none before `start`.
    value, variance : float64 arrays, shape (event,)
        Observations; NaN in either means that the event only asks for an estimate.
    prior : Prior
    start : State
        See `rest`.
    gate_variance : float64 array, optional
        Variance of each single observation for the test against outliers, where `variance` was widened because
        neighbours share their errors; `variance` if left out.
    gate : float
        An observation further than this many standard deviations from its prediction is given no weight.
    keep : int
        The event whose filtered state is returned.

    Returns
    -------
    Smoothed
    """
    n = arc_m.size
    # inside, the second state is (dx/ds)/λ: both of the size of the first
    scale = np.array([1.0, 1 / prior.rate_per_m])
    m, p = start.mean * scale, start.covariance * np.outer(scale, scale)
    means, pred_m = np.empty((n, 2)), np.empty((n, 2))
    covs, pred_p = np.empty((n, 2, 2)), np.empty((n, 2, 2))
    outlier = np.zeros(n, np.bool_)
    single = variance if gate_variance is None else gate_variance
    loglik = _filter(
        arc_m, value, variance, single, gate, prior.sigma**2, prior.rate_per_m, start.arc_m, m, p,
        means, covs, pred_m, pred_p, outlier,
    )  # fmt: skip
    filtered = State(float(arc_m[keep]), means[keep] / scale, covs[keep] / np.outer(scale, scale)) if n else start
    _smooth(arc_m, prior.sigma**2, prior.rate_per_m, means, covs, pred_m, pred_p)
    return Smoothed(means[:, 0], np.sqrt(np.maximum(covs[:, 0, 0], 0)), outlier, filtered, float(loglik))


def learn_prior(
    arc_m: FloatArray,
    value: FloatArray,
    variance: FloatArray,
    *,
    rate_limits_per_m: tuple[float, float],
    sigma_floor: float,
    gate: float = 3.0,
) -> Prior:
    """Find the prior under which the observations are most likely.

    Parameters
    ----------
    arc_m, value, variance : float64 arrays, shape (event,)
        As in `smooth`.
    rate_limits_per_m : (float, float)
        Least and largest λ.
    sigma_floor : float
        Least σ: a silent start must not make the filter deaf to what comes.
    gate : float
        Observations further than this many standard deviations from their prediction count as if they lay right there.

    Returns
    -------
    Prior
        By bounded Nelder–Mead over the logarithms of σ and λ.
    """
    known = np.isfinite(value) & np.isfinite(variance)
    arc, x, v = arc_m[known], value[known], variance[known]
    low, high = rate_limits_per_m
    spread = max(float(np.sqrt(max(np.var(x) - np.median(v), 0.0))) if x.size > 1 else 0.0, sigma_floor)
    if x.size < 10:
        return Prior(spread, float(np.sqrt(low * high)))

    def cost(parameters: FloatArray) -> float:
        prior = Prior(float(np.exp(parameters[0])), float(np.exp(parameters[1])))
        return -smooth(arc, x, v, prior=prior, start=rest(prior, float(arc[0])), gate=gate).log_likelihood

    limits = [(np.log(sigma_floor), np.log(max(10 * spread, 2 * sigma_floor))), (np.log(low), np.log(high))]
    start = np.array([np.log(spread), 0.5 * (limits[1][0] + limits[1][1])])
    found = optimize.minimize(
        cost, start, method="Nelder-Mead", bounds=limits, options={"xatol": 0.02, "fatol": 0.1, "maxiter": 80}
    )
    return Prior(float(np.exp(found.x[0])), float(np.exp(found.x[1])))
