"""A table in a Markdown page that grows row by row, and keeps what it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

Key = tuple[str, ...]


@dataclass
class Table:
    """Rows known by their first cells.

    Parameters
    ----------
    path : Path or None
        Where it is written after every row; None keeps it in memory.
    about : str
        What stands above the table.
    columns : sequence of str
    keys : int
        So many cells at the start of a row say which row it is.
    order : sequence of str
        First cells in the order in which rows are to stand; others follow.
    """

    path: Path | None
    about: str
    columns: Sequence[str]
    keys: int = 2
    order: Sequence[str] = ()
    rows: dict[Key, list[str]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.path is not None and self.path.is_file():
            self.rows = dict(self._read(self.path.read_text("utf-8")))

    def _read(self, text: str) -> list[tuple[Key, list[str]]]:
        lines = [cells_of(line) for line in text.splitlines() if line.startswith("| ")]
        # rows of a table with other columns are of no use
        if not lines or lines[0] != list(self.columns):
            return []
        return [(tuple(cells[: self.keys]), cells) for cells in lines[1:] if len(cells) == len(self.columns)]

    def has(self, *key: str) -> bool:
        """Return whether there is a row already."""
        return tuple(key) in self.rows

    def add(self, cells: Sequence[str]) -> None:
        """Put a row in, in place of an older one, and write the page whole."""
        assert len(cells) == len(self.columns)
        self.rows[tuple(cells[: self.keys])] = list(cells)
        if self.path is not None:
            part = self.path.with_suffix(".part")
            part.write_text(self.text(), "utf-8")
            part.replace(self.path)

    def text(self) -> str:
        """Return the page."""
        places = {name: place for place, name in enumerate(self.order)}
        rows = sorted(self.rows.values(), key=lambda cells: places.get(cells[0], len(places)))
        rule = "|" + "---|" * len(self.columns)
        return "\n".join([self.about, line_of(self.columns), rule, *map(line_of, rows)]) + "\n"


def line_of(cells: Sequence[str]) -> str:
    """Return a line of a table."""
    return "| " + " | ".join(cells) + " |"


def cells_of(line: str) -> list[str]:
    """Return the cells of a line of a table."""
    return [cell.strip() for cell in line.strip().strip("|").split("|")]
