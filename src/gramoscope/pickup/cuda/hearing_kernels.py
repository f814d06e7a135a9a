"""The kernels of one look at all stripes: windows, channels, whitening, weights, the filters' energies, what they say.

One thread for each element of what is written, in the steps of `texture.hearing`; each step can be held against its kernel on
the processor. Only bins in the band are wanted, a few hundred: sums over the columns give them at once, by a table of one turn
of cosine and sine, and no Fourier library is needed.
"""

from __future__ import annotations

from numba import cuda, float32


@cuda.jit
def windows(columns, first_row, phase, taps, window):  # type: ignore[no-untyped-def]
    """Write [stripe, column, row], rows that follow a path; see `texture.following.follow_rows`."""
    j, x, i = cuda.grid(3)
    if i < window.shape[0] and x < window.shape[1] and j < window.shape[2]:
        last = columns.shape[1] - 1
        total = float32(0)
        for k in range(taps.shape[1]):
            row = min(max(first_row[i, x] + j + k, 0), last)
            total += taps[phase[i, x], k] * columns[x, row]
        window[i, x, j] = total


@cuda.jit
def channels(window, basis, raw):  # type: ignore[no-untyped-def]
    """Write [stripe, column, channel], weighted sums of a window's rows."""
    c, x, i = cuda.grid(3)
    if i < raw.shape[0] and x < raw.shape[1] and c < raw.shape[2]:
        total = float32(0)
        for j in range(window.shape[2]):
            total += window[i, x, j] * basis[i, j, c]
        raw[i, x, c] = total


@cuda.jit
def whiten(raw, half_taps, white):  # type: ignore[no-untyped-def]
    """Filter along the columns, mirrored beyond the ends; see `texture.spectrum.filter_columns`."""
    c, x, i = cuda.grid(3)
    if i < raw.shape[0] and x < raw.shape[1] and c < raw.shape[2]:
        last = raw.shape[1] - 1
        total = half_taps[0] * raw[i, x, c]
        for k in range(1, half_taps.size):
            before, behind = x - k, x + k
            # a window that is shorter than the mirror repeats its other end
            before = before if before >= 0 else min(-before - 1, last)
            behind = behind if behind <= last else max(2 * last + 1 - behind, 0)
            total += half_taps[k] * (raw[i, before, c] + raw[i, behind, c])
        white[i, x, c] = total


@cuda.jit
def texture_power(white, usual, power):  # type: ignore[no-untyped-def]
    """Write [half, stripe, column], how much there is of the usual texture, and of anything."""
    x, i, half = cuda.grid(3)
    if half < power.shape[0] and i < power.shape[1] and x < power.shape[2]:
        total = float32(0)
        count = usual.shape[2] // 2
        for d in range(half * count, (half + 1) * count):
            seen = float32(0)
            for c in range(usual.shape[1]):
                seen += white[i, x, c] * usual[i, c, d]
            total += seen * seen
        power[half, i, x] = total


@cuda.jit
def believe(power, clear, reach, low, high, valid):  # type: ignore[no-untyped-def]
    """Write which clear columns have about the texture that they should; see `texture.likelihood.within`."""
    x, i = cuda.grid(2)
    if i < power.shape[1] and x < power.shape[2]:
        texture, anything = float32(0), float32(0)
        for k in range(x - reach, x + reach + 1):
            there = min(max(k, 0), power.shape[2] - 1)
            texture += power[0, i, there]
            anything += power[1, i, there]
        count = float32(2 * reach + 1)
        valid[i, x] = 1 if clear[i, x] != 0 and low * count <= texture and anything <= high * count else 0


@cuda.jit(device=True)
def _whole(valid, i, x, reach):  # type: ignore[no-untyped-def]
    """Whether all columns within reach are valid; those beyond the ends are."""
    whole = True
    for k in range(max(x - reach, 0), min(x + reach + 1, valid.shape[1])):
        whole = whole and valid[i, k] != 0
    return whole


@cuda.jit
def weigh(valid, bell, weight):  # type: ignore[no-untyped-def]
    """Write weights that fall softly before what is not valid; see `texture.likelihood.soften`."""
    x, i = cuda.grid(2)
    if i < valid.shape[0] and x < valid.shape[1]:
        reach, total = bell.size // 2, float32(0)
        for k in range(bell.size):
            if _whole(valid, i, min(max(x + k - reach, 0), valid.shape[1] - 1), reach):
                total += bell[k]
        weight[i, x] = total


@cuda.jit
def spectra(white, weight, turn, first_bin, spectrum):  # type: ignore[no-untyped-def]
    """Write [stripe, bin in the band, channel, part], the Fourier transform of weighted channels; parts: real, imaginary.

    turn[m] holds cos and sin of 2π m / length; those of bin · column come round again and again.
    """
    c, b, i = cuda.grid(3)
    if i < spectrum.shape[0] and b < spectrum.shape[1] and c < spectrum.shape[2]:
        length, m = turn.shape[0], 0
        real, imaginary = float32(0), float32(0)
        for x in range(white.shape[1]):
            value = white[i, x, c] * weight[i, x]
            real += value * turn[m, 0]
            imaginary -= value * turn[m, 1]
            m += first_bin + b
            if m >= length:
                m -= length
        spectrum[i, b, c, 0] = real
        spectrum[i, b, c, 1] = imaginary


@cuda.jit
def let_through(spectrum, filters, share, through):  # type: ignore[no-untyped-def]
    """Write [stripe, filter, bin in the band, part], times each bin's share of the way back; see `filter_bank.let_through`."""
    b, k, i = cuda.grid(3)
    if i < through.shape[0] and k < through.shape[1] and b < through.shape[2]:
        real, imaginary = float32(0), float32(0)
        for c in range(spectrum.shape[2]):
            real += filters[i, b, k, c] * spectrum[i, b, c, 0]
            imaginary += filters[i, b, k, c] * spectrum[i, b, c, 1]
        through[i, k, b, 0] = share[b] * real
        through[i, k, b, 1] = share[b] * imaginary


@cuda.jit
def sounds(through, turn, first_bin, p):  # type: ignore[no-untyped-def]
    """Write [stripe, filter, column], the way back from what the filters let through."""
    x, k, i = cuda.grid(3)
    if i < p.shape[0] and k < p.shape[1] and x < p.shape[2]:
        length, total = turn.shape[0], float32(0)
        m = (first_bin * x) % length
        for b in range(through.shape[2]):
            total += through[i, k, b, 0] * turn[m, 0] - through[i, k, b, 1] * turn[m, 1]
            m += x
            if m >= length:
                m -= length
        p[i, k, x] = total


@cuda.jit(device=True)
def _loudness(p, i, x):  # type: ignore[no-untyped-def]
    total = float32(0)
    for k in range(p.shape[1]):
        total += p[i, k, x] * p[i, k, x]
    return total


@cuda.jit
def say(p, sign, half_bell, least, mean, trust, said):  # type: ignore[no-untyped-def]
    """Write [stripe, column], energies over the local loudness; see `filter_bank.energies` and `likelihood.temper`."""
    x, i = cuda.grid(2)
    if i < said.shape[0] and x < said.shape[1]:
        score, last = float32(0), said.shape[1] - 1
        for k in range(p.shape[1]):
            score += sign[i, k] * (p[i, k, x] * p[i, k, x])
        local = half_bell[0] * _loudness(p, i, x)
        for k in range(1, half_bell.size):
            beside = _loudness(p, i, max(x - k, 0)) + _loudness(p, i, min(x + k, last))
            local += half_bell[k] * beside
        said[i, x] = (score / (least + local) - mean[i]) * trust[i]
