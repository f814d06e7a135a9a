"""Which groove goes on as which."""

from __future__ import annotations

import numpy as np

from gramoscope.tonearm.turns import GrooveEnds, continued

PITCH = 20.0


def ends(first_px: int, columns: int, middles: list[float], *, slope: float = 0.05, seed: int = 1) -> GrooveEnds:
    """Grooves that wind alike, 8 rows wide, as they are seen from a column on."""
    x = first_px + np.arange(columns)
    winding = 6 * np.sin(x / 7.0) + slope * x
    noise = 0.1 * np.random.default_rng(seed).standard_normal((len(middles), 2, columns))
    rows = np.array([[middle + 4 + winding, middle - 4 + winding] for middle in middles]).reshape(
        len(middles), 2, columns
    )
    return GrooveEnds(first_px, rows + noise)


def test_grooves_go_on_where_their_edges_do() -> None:
    before, after = ends(0, 100, [10.0, 30.0, 50.0]), ends(70, 90, [10.0, 30.0, 50.0])
    assert continued(before, after) == (0, 1, 2)


def test_a_groove_that_comes_in_moves_the_numbers_and_one_that_leaves_goes_nowhere() -> None:
    before, after = ends(0, 100, [10.0, 30.0, 50.0]), ends(70, 90, [-10.0, 10.0, 30.0])
    assert continued(before, after) == (1, 2, None)


def test_without_overlap_the_nearest_columns_decide() -> None:
    before, after = ends(0, 100, [10.0, 30.0]), ends(110, 80, [10.0, 30.0, 50.0])
    assert continued(before, after) == (0, 1)


def test_one_wall_is_enough_and_none_is_not() -> None:
    before, after = ends(0, 100, [10.0, 30.0]), ends(60, 80, [10.0, 30.0])
    after.row_px[0, 1] = np.nan
    before.row_px[1] = np.nan
    assert continued(before, after) == (0, None)


def test_no_grooves_are_no_trouble() -> None:
    nothing = GrooveEnds(0, np.empty((0, 2, 40)))
    assert continued(nothing, ends(0, 40, [10.0])) == ()
    assert continued(ends(0, 40, [10.0]), nothing) == (None,)
