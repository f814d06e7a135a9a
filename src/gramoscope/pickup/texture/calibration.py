"""What a passage says about the apparatus: where its stripes really lie, and what follows from that.

The manifest says where to look first. The searched paths line up the picture; the ridges of the lined-up picture are where
the stripes are. Their distances, with the known depth of either the walls' angle or the glass's step, give the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from gramoscope.apparatus.bench import Bench
from gramoscope.conventions import INNER, MICROMETRES_PER_METRE, OUTER, Float32Array, FloatArray
from gramoscope.disc.formats import Cut
from gramoscope.pickup.cartridge import Spread
from gramoscope.pickup.texture.groove_search import GrooveSearch
from gramoscope.pickup.texture.layout import StripeLayout
from gramoscope.pickup.texture.reading import Model
from gramoscope.pickup.texture.sharpness import ridges

REACH_PX = 14
"""A stripe may lie so far from where the manifest puts it: more than a tenth of the distance between stripes."""
ROUNDS = 3


def aligned_layout(
    sharp: Sequence[Float32Array], nominal: StripeLayout, search: GrooveSearch, cut: Cut, spread: Spread
) -> tuple[StripeLayout, list[tuple[FloatArray, FloatArray]]]:
    """Return where the stripes lie, and the coarse paths of all stretches.

    Parameters
    ----------
    sharp : sequence of float32 arrays, shape (cell, row)
        From `texture.sharpness`, of some stretches.
    nominal : StripeLayout
    search : GrooveSearch
    cut : {"lateral", "vertical", "stereo"}
    spread : callable
    """
    layout = nominal
    for _ in range(ROUNDS):
        found = list(spread(partial(_found, search, layout, cut), sharp))
        shift = _shifts(sharp, [path for path, _ in found], layout)
        layout = layout.at(layout.rest_row + shift)
        if np.abs(shift).max(initial=0.0) < 1.0:
            break
    return layout, found


def _found(search: GrooveSearch, layout: StripeLayout, cut: Cut, sharp: Float32Array) -> tuple[FloatArray, FloatArray]:
    return search.find(sharp, layout, cut=cut)


def _shifts(sharp: Sequence[Float32Array], paths: list[FloatArray], layout: StripeLayout) -> FloatArray:
    """How far each stripe lies from the layout, rows, the stripe of the outer wall that is seen most kept in place."""
    aside = np.arange(-REACH_PX, REACH_PX + 1)
    profile, seen = np.zeros((layout.wall.size, aside.size)), np.zeros(layout.wall.size)
    for one, path in zip(sharp, paths, strict=True):
        ridge = ridges(one)
        rows = layout.rows(path)
        visible = layout.visible(rows, half_px=REACH_PX)
        cells = np.arange(len(ridge))
        for number in range(layout.wall.size):
            mine = visible[number]
            at = np.round(rows[number, mine]).astype(np.int64)[:, None] + aside
            profile[number] += ridge[cells[mine, None], at].sum(axis=0)
            seen[number] += np.count_nonzero(mine)
    shift = np.zeros(layout.wall.size)
    for number in np.flatnonzero(seen > 100).tolist():
        mean = profile[number] / seen[number]
        if mean.max() > 0.15:
            shift[number] = _peak(mean) - REACH_PX
    kept = _kept(layout, seen)
    return np.where(seen > 100, shift - shift[kept], 0.0)


def _kept(layout: StripeLayout, seen: FloatArray) -> int:
    outer = np.flatnonzero(layout.wall == OUTER)
    return int(outer[np.argmax(seen[outer])]) if outer.size else int(np.argmax(seen))


def _peak(values: FloatArray) -> float:
    i = int(np.clip(np.argmax(values), 1, values.size - 2))
    bend = values[i - 1] - 2 * values[i] + values[i + 1]
    return i + (float(0.5 * (values[i - 1] - values[i + 1]) / bend) if bend < 0 else 0.0)


def calibration_of(layout: StripeLayout, model: Model | None, bench: Bench, groups: int) -> dict[str, Any]:
    """Return what was learned beside what the manifest says, as plain numbers.

    Parameters
    ----------
    layout : StripeLayout
        As it was found.
    model : Model or None
        What the last round taught.
    bench : Bench
    groups : int
        Learned from.
    """
    nominal = StripeLayout.of_bench(bench, edge_margin_px=0.0)
    pitch_um = bench.sensor.pixel_pitch_m * MICROMETRES_PER_METRE
    distances = {}
    for name, one in (("manifest", nominal), ("measured", layout)):
        inner, outer = (np.sort(one.rest_row[one.wall == wall]) for wall in (INNER, OUTER))
        distances[name] = {
            "between_walls_um": float((inner.min() - outer.max()) * pitch_um) if inner.size and outer.size else None,
            "between_planes_um": _between_planes_um(one, model, pitch_um),
        }
    step_um = distances["measured"]["between_planes_um"]
    told: dict[str, Any] = {"groups": groups, "stripe_distances": distances}
    if bench.cover_glass is not None and step_um:
        tangent = float(np.tan(bench.disc.wall_angle_rad))
        shift_um = bench.cover_glass.shift_m * MICROMETRES_PER_METRE
        told["focus_shift_um"] = {"manifest": shift_um, "if_walls_are_as_stated": step_um * tangent}
        told["wall_angle_deg"] = {
            "manifest": float(np.rad2deg(bench.disc.wall_angle_rad)),
            "if_the_glass_is_as_stated": float(np.rad2deg(np.arctan2(shift_um, step_um))),
        }
    told["stripes"] = [_stripe(model, number, pitch_um) for number in range(layout.wall.size)] if model else []
    return told


def _between_planes_um(layout: StripeLayout, model: Model | None, pitch_um: float) -> float | None:
    """Distance of the two stripes of the wall that shows both, by which the glass is measured."""
    for wall in (INNER, OUTER):
        mine = np.flatnonzero(layout.wall == wall)
        if mine.size == 2 and (model is None or all(model.stripes[i] is not None for i in mine)):
            return float(np.ptp(layout.rest_row[mine]) * pitch_um)
    return None


def _stripe(model: Model, number: int, pitch_um: float) -> dict[str, Any]:
    statistics = model.stripes[number]
    told: dict[str, Any] = {
        "wall": "inner" if model.layout.wall[number] == INNER else "outer",
        "row_at_rest": float(model.layout.rest_row[number]),
    }
    if statistics is None:
        return {**told, "columns": 0}
    error_um = pitch_um / np.sqrt(statistics.trust * statistics.information)
    return {
        **told,
        "columns": statistics.columns,
        "information_a_column_per_px2": statistics.information,
        "score_power_over_information": 1 / statistics.trust,
        "standard_error_of_a_column_um": float(error_um),
    }
