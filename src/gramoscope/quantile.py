"""The quantile of a few numbers inside a kernel.

What `np.quantile` and `np.median` do, without the seconds that their versions for kernels take to compile on the first day.
"""

from __future__ import annotations

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def _select(values, k):  # type: ignore[no-untyped-def]
    """Exchange values until the k-th smallest stands at its place, no larger one before it (C. A. R. Hoare, 1961)."""
    first, last = 0, values.size - 1
    while first < last:
        pivot, i, j = values[(first + last) // 2], first, last
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if k <= j:
            last = j
        elif k >= i:
            first = i
        else:
            return


@numba.njit(cache=True, nogil=True)
def quantile(values, share):  # type: ignore[no-untyped-def]
    """Return the value below which such a share of some values lies.

    Parameters
    ----------
    values : float array, shape (value,)
        No NaN among them; left as they are.
    share : float
        0 … 1; ½ for the median.

    Returns
    -------
    float
        Between the values on either side in proportion; NaN of no values.
    """
    if values.size == 0:
        return np.nan
    some, place = values.copy(), share * (values.size - 1)
    k = int(place)
    _select(some, k)
    low = float(some[k])
    if place == k:
        return low
    high = np.inf
    for i in range(k + 1, some.size):
        high = min(high, float(some[i]))
    return low + (place - k) * (high - low)
