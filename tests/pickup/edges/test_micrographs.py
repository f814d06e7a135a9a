"""Two micrographs of a stereo test record: tones that are known, on edges that are ragged, dusty and written over."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from PIL import Image

from gramoscope.conventions import INNER, OUTER, FloatArray
from gramoscope.pickup.edges.appearance import Appearance
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge
from gramoscope.quality import NOT_MEASURED
from gramoscope.signal_path import GrooveEdges

Make = Callable[..., Any]
Places = tuple[FloatArray, FloatArray, FloatArray]
CARTRIDGE = EdgeCartridge()


def _places(groove: GrooveEdges, wall: int) -> Places:
    """Columns, rows and errors that were measured."""
    seen = (groove.flags[wall] & np.uint16(NOT_MEASURED)) == 0
    return np.flatnonzero(seen).astype(float), groove.row_px[wall][seen], groove.row_sigma_px[wall][seen]


def _fit(places: Places, *rates: float) -> tuple[FloatArray, float]:
    """Amplitudes (complex) of tones, cycles a column, over a parabola, and R² of the tones against what the parabola leaves."""
    x, y, sigma = places
    tones = np.exp(2j * np.pi * np.outer(x, rates))
    design = np.column_stack([tones.real, tones.imag, *((x / 250 - 1) ** k for k in range(3))])
    found = np.linalg.lstsq(design / sigma[:, None], y / sigma, rcond=None)[0]
    n, weight = len(rates), sigma**-2
    heard = design[:, : 2 * n] @ found[: 2 * n]
    left = y - design[:, 2 * n :] @ found[2 * n :]
    scatter = np.sum(weight * (left - np.average(left, weights=weight)) ** 2)
    return found[:n] - 1j * found[n : 2 * n], float(1 - np.sum(weight * (left - heard) ** 2) / scatter)


def _rate(places: Places, low: float, high: float) -> float:
    """The rate of the tone that explains most."""
    rates = np.linspace(low, high, 600)
    return float(rates[np.argmax([_fit(places, rate)[1] for rate in rates])])


def test_600_hz_on_both_walls_of_six_grooves(micrograph: Make, picture_of: Make) -> None:
    grooves = CARTRIDGE.find(picture_of(micrograph("track_05")))
    assert len(grooves) == 6
    edges = [_places(groove, wall) for groove in grooves for wall in (OUTER, INNER)]
    rates = np.array([_rate(places, 1 / 300, 1 / 120) for places in edges])
    assert np.abs(rates / np.median(rates) - 1).max() < 0.01
    assert rates.max() / rates.min() < 1.0135
    rows = np.array([row.mean() for _, row, _ in edges])
    # a turn takes as long at every radius: periods get shorter towards the centre, by half a per cent in this picture
    assert np.abs(rates / np.polyval(np.polyfit(rows, rates, 1), rows) - 1).max() < 0.01
    explained = np.array([_fit(places, rate)[1] for places, rate in zip(edges, rates, strict=True)])
    # one edge has a glow along it that looks like land, and one lies in scratches
    assert np.sort(explained)[2:].min() > 0.985
    assert explained.min() > 0.97
    assert all(places[0].size > 0.6 * 500 for places in edges)


def test_800_hz_on_one_wall_and_3000_hz_on_the_other(micrograph: Make, picture_of: Make) -> None:
    grooves = CARTRIDGE.find(picture_of(micrograph("track_09")))
    whole = [groove for groove in grooves if np.isfinite(groove.row_px).any(axis=1).all()]
    assert len(whole) == 6
    edges = {wall: [_places(groove, wall) for groove in whole] for wall in (OUTER, INNER)}
    slow, fast = (
        np.median([_rate(places, *range_) for places in edges[wall]])
        for wall, range_ in ((OUTER, (1 / 170, 1 / 140)), (INNER, (1 / 44, 1 / 38)))
    )
    assert fast / slow == pytest.approx(3000 / 800, rel=0.02)
    found = {wall: [_fit(places, slow, fast) for places in mine] for wall, mine in edges.items()}
    tones = {wall: np.array([tone for tone, _ in mine]) for wall, mine in found.items()}
    # no edge loses its tone: not even the fast one, a third as large, beside a wall whose brightness goes with it
    assert np.sort([explained for _, explained in found[OUTER]])[1:].min() > 0.98
    assert min(explained for _, explained in found[INNER]) > 0.86
    assert np.ptp(np.abs(tones[INNER][:, 1])) < 0.25 * np.abs(tones[INNER][:, 1]).mean()
    # in step with the same tone of the other wall, all grooves together
    across = {
        OUTER: np.mean(tones[OUTER][:, 1] * np.exp(-1j * np.angle(tones[INNER][:, 1]))),
        INNER: np.mean(tones[INNER][:, 0] * np.exp(-1j * np.angle(tones[OUTER][:, 0]))),
    }
    own = {OUTER: np.abs(tones[OUTER][:, 0]).mean(), INNER: np.abs(tones[INNER][:, 1]).mean()}
    # as displacement, and as velocity, which is what is heard
    assert 20 * np.log10(own[OUTER] / abs(across[OUTER])) > 30
    assert 20 * np.log10(own[OUTER] * slow / (abs(across[OUTER]) * fast)) > 19
    assert 20 * np.log10(own[INNER] * fast / (abs(across[INNER]) * slow)) > 21
    # and a tenth of either tone on the other wall, in step with it: that is in the picture
    for wall, other in ((OUTER, 1), (INNER, 0)):
        leak = across[wall] / np.abs(tones[1 - wall][:, other]).mean()
        assert 0.05 < abs(leak) < 0.15
        assert abs(np.angle(leak)) < 0.6


def test_a_smaller_picture_holds_the_same_tones(micrograph: Make, picture_of: Make) -> None:
    scale = 0.6
    grooves = CARTRIDGE.find(picture_of(_resized(micrograph("track_09"), scale)))
    whole = [groove for groove in grooves if np.isfinite(groove.row_px).any(axis=1).all()]
    assert len(whole) == 6
    rates = 1 / (154.5 * scale), 1 / (40.5 * scale)
    outer, inner = ([_fit(_places(groove, wall), *rates) for groove in whole] for wall in (OUTER, INNER))
    assert min(explained for _, explained in inner) > 0.75
    # a tenth of the slow tone on the inner wall, a third of a pixel: five rows on each side of an edge tell it, too
    leaks = [tones[0] / other[0] for (tones, _), (other, _) in zip(inner, outer, strict=True)]
    assert 0.05 < np.mean(leaks).real < 0.12
    assert abs(np.mean(leaks).imag) < 0.04


def test_the_line_along_the_bottom_is_found_where_it_is_seen_and_swings_as_the_walls_do(
    micrograph: Make, picture_of: Make
) -> None:
    grooves = CARTRIDGE.find(picture_of(micrograph("track_05")))
    seen = np.array([np.isfinite(groove.bottom_row_px).mean() for groove in grooves])
    # in the others the bottom is dim and as broad as half the wall
    assert (seen > 0).tolist() == [False] * 5 + [True]
    assert seen[5] > 0.8
    column = np.flatnonzero(np.isfinite(grooves[5].bottom_row_px))
    bottom = (column.astype(float), grooves[5].bottom_row_px[column], grooves[5].bottom_row_sigma_px[column])
    rate = _rate(_places(grooves[5], INNER), 1 / 200, 1 / 150)
    (tone,), explained = _fit(bottom, rate)
    (wall,), _ = _fit(_places(grooves[5], INNER), rate)
    assert explained > 0.9
    assert abs(tone / wall - 1) < 0.2


def test_writing_and_dust_at_full_scale_get_no_weight(micrograph: Make, picture_of: Make) -> None:
    image = micrograph("track_05")
    for groove in CARTRIDGE.find(picture_of(image)):
        for wall in (INNER, OUTER):
            column, row, _ = _places(groove, wall)
            assert np.mean(image[np.rint(row).astype(int), column.astype(int)] == 255) < 0.005


@pytest.mark.parametrize("name", ["track_05", "track_09"])
def test_dust_gets_no_weight_in_a_picture_that_was_darkened(micrograph: Make, picture_of: Make, name: str) -> None:
    image = micrograph(name)
    bright, dark = (CARTRIDGE.find(picture_of(one)) for one in (image, (0.7 * image).astype(np.uint8)))
    assert len(bright) == len(dark)
    for here, there in zip(bright, dark, strict=True):
        both = (here.flags == 0) & (there.flags == 0)
        assert np.mean(both == (here.flags == 0)) > 0.98
        off = (there.row_px - here.row_px)[both]
        assert np.sqrt(np.mean(off**2)) < 0.2


def _resized(image: np.ndarray, scale: float) -> np.ndarray:  # type: ignore[type-arg]
    height, width = image.shape
    return np.asarray(
        Image.fromarray(image).resize((round(width * scale), round(height * scale)), Image.Resampling.BILINEAR)
    )


@pytest.mark.parametrize(("name", "whole"), [("track_05", 6), ("track_09", 6)])
@pytest.mark.parametrize(
    "changed",
    [
        lambda image: image[::-1],
        lambda image: image[::-1, ::-1],
        lambda image: _resized(image, 0.7),
        lambda image: _resized(image, 1.4),
        lambda image: 255 * (image / 255) ** 2,
        lambda image: image * np.linspace(0.3, 1, image.shape[0])[:, None],
        lambda image: image + np.random.default_rng(3).normal(0, 20, image.shape),
        lambda image: image[:, 150:350],
    ],
    ids=["mirrored", "turned", "smaller", "larger", "gamma", "uneven", "noisy", "short"],
)
def test_all_grooves_are_found_however_the_picture_was_taken(
    micrograph: Make, picture_of: Make, name: str, whole: int, changed: Make
) -> None:
    image = np.clip(np.rint(changed(micrograph(name))), 0, 255).astype(np.uint8)
    grooves, _ = CARTRIDGE.coarse(picture_of(np.ascontiguousarray(image)), 250)
    assert sum(groove.outer is not None and groove.inner is not None for groove in grooves) == whole


@pytest.mark.parametrize("name", ["track_05", "track_09"])
def test_all_grooves_are_found_in_a_negative(micrograph: Make, picture_of: Make, name: str) -> None:
    cartridge = EdgeCartridge(appearance=Appearance.BRIGHT_GROOVES, burnt_share=2.0)
    grooves, _ = cartridge.coarse(picture_of(255 - micrograph(name)), 512)
    assert sum(groove.outer is not None and groove.inner is not None for groove in grooves) == 6
