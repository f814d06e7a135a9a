"""The accuracy table keeps its rows, and makes none twice."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.accuracy import readings, scenes
from benchmarks.accuracy.table import Table

COLUMNS = ("scene", "recipe", "r")


def table(path: Path | None) -> Table:
    return Table(path, "# A page\n\nWords | with a bar.\n", COLUMNS, order=("first", "second"))


def test_rows_come_back_from_the_page_in_the_order_of_the_scenes(tmp_path: Path) -> None:
    path = tmp_path / "page.md"
    page = table(path)
    page.add(["second", "best", "0.9"])
    page.add(["other", "best", "0.5"])
    page.add(["first", "seed-paper", "0.8"])
    again = table(path)
    assert again.has("second", "best")
    assert not again.has("second", "seed-paper")
    rows = [line for line in path.read_text("utf-8").splitlines() if line.startswith("| ")]
    assert [row.split()[1] for row in rows] == ["scene", "first", "second", "other"]
    assert again.text() == path.read_text("utf-8")


def test_a_new_row_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    page = table(tmp_path / "page.md")
    page.add(["first", "best", "0.1"])
    page.add(["first", "best", "0.2"])
    assert list(table(tmp_path / "page.md").rows.values()) == [["first", "best", "0.2"]]


def test_a_page_with_other_columns_is_begun_anew(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("| scene | recipe | SNR |\n|---|---|---|\n| first | best | 3 |\n", "utf-8")
    assert table(tmp_path / "page.md").rows == {}


def test_what_the_table_holds_is_neither_filmed_nor_played_again(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[tuple[str, str]] = []
    monkeypatch.setattr(readings, "filmed", lambda case, workdir, seconds: Path(case.name))
    monkeypatch.setattr(readings, "load_recipe", lambda name: name)
    monkeypatch.setattr(readings, "hear", lambda folder, recipe: made.append((folder.name, recipe)))
    monkeypatch.setattr(readings, "row", lambda judged, recipe, folder, heard: [judged.name, recipe, "0.9"])
    monkeypatch.setattr(scenes.Case, "can_be_filmed", True)
    page = table(None)
    page.add(["physics", "best", "0.7"])
    page.add(["55mm", "best", "0.7"])
    page.add(["55mm", "seed-paper", "0.7"])
    for name in ("physics", "55mm"):
        for cells in readings.rows(page, ["best", "seed-paper"], {name}, 0.1, None):
            page.add(cells)
    assert made == [("physics", "seed-paper")]


def test_a_film_is_used_again_unless_another_was_wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = []

    def film(case: scenes.Case, folder: Path, seconds: float, *, workers: int) -> None:
        made.append(seconds)
        folder.mkdir(exist_ok=True)
        (folder / "truth.npz").touch()

    monkeypatch.setattr(scenes, "film_case", film)
    case = scenes.CASES[0]
    for seconds in (0.1, 0.1, 0.2, 0.2):
        assert scenes.filmed(case, tmp_path, seconds) == tmp_path / case.name
    assert made == [0.1, 0.2]
    (tmp_path / f"{case.name}.txt").unlink()
    scenes.filmed(case, tmp_path, 0.7)
    assert made == [0.1, 0.2]


def test_no_two_scenes_share_a_name() -> None:
    names = [case.name for case in scenes.CASES] + [judged.name for judged in readings.PRACTICE]
    assert len(set(names)) == len(names)
