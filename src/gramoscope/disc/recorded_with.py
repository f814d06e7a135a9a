"""Who cut with which recording characteristic, and when: what can be guessed from a label and a year.

No record says how it was cut. What is known is which curves a firm, a country or a time used, from the literature that
`recorded_with.toml` names; so an answer here is a list, the best supported first, each with its source and with how sure it
is. Even where label and year agree, machines of the era kept to their curve within `ERA_ACCURACY_DB` only: the ear decides.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from importlib import resources

from gramoscope.disc.characteristics import Characteristic, characteristic
from gramoscope.errors import require

ERA_ACCURACY_DB = (2.0, 3.0)
"""How well machines of the era kept to their curve, by the sources of the table."""
FIRST_YEAR, LAST_YEAR = 1877, 2100
"""No record is older than the phonograph."""


class Support(Enum):
    """How well a curve is supported by what is known of a record, best first."""

    LABEL_AND_YEAR = "the label used it in that year"
    LABEL = "the label used it; no year to compare"
    CUSTOM = "a custom of the time, whatever the label"
    OTHER_YEARS = "the label used it, but in other years"


@dataclass(frozen=True)
class RecordedWith:
    """One line of the literature: this curve was used by these, there and then.

    Parameters
    ----------
    curve : Characteristic
    source : str
        Where it is written.
    labels : tuple of str
        Firms; empty where it was the custom of a region, a medium or a time.
    region, medium : str
        Empty where the source does not say.
    first_year, last_year : int or None
        Both included; None where the source does not say.
    """

    curve: Characteristic
    source: str
    labels: tuple[str, ...] = ()
    region: str = ""
    medium: str = ""
    first_year: int | None = None
    last_year: int | None = None

    @property
    def years(self) -> str:
        """Return e.g. "1944–56", "since 1955", "until 1925" or nothing."""
        if self.first_year is None:
            return "" if self.last_year is None else f"until about {self.last_year}"
        return f"since {self.first_year}" if self.last_year is None else f"{self.first_year}–{self.last_year}"

    @property
    def where_when(self) -> str:
        """Return labels, region, medium and years in a line."""
        return ", ".join(part for part in (" / ".join(self.labels), self.region, self.medium, self.years) if part)

    def is_of_label(self, label: str) -> bool:
        """Return whether all words of one of its labels stand in `label`, in any letters: RCA in "rca Victor"."""
        return any(_words(own) <= _words(label) for own in self.labels)

    def is_of_year(self, year: int) -> bool:
        """Return whether a year lies within its years; an open end has no limit."""
        return (self.first_year or FIRST_YEAR) <= year <= (self.last_year or LAST_YEAR)

    def support(self, label: str | None, year: int | None) -> Support | None:
        """Return how well it goes with a label and a year, either unknown; None if not at all."""
        if self.labels and label is not None:
            if not self.is_of_label(label):
                return None
            if year is None or not self.years:
                return Support.LABEL
            return Support.LABEL_AND_YEAR if self.is_of_year(year) else Support.OTHER_YEARS
        if year is None or not self.years or self.labels:
            return None
        return Support.CUSTOM if self.is_of_year(year) else None


@cache
def recorded_with() -> tuple[RecordedWith, ...]:
    """Return every line of `recorded_with.toml`."""
    text = resources.files("gramoscope.disc").joinpath("recorded_with.toml").read_text("utf-8")
    content = tomllib.loads(text)
    return tuple(
        RecordedWith(
            characteristic(line.pop("curve")),
            content["sources"][line.pop("source")],
            tuple(line.pop("labels", ())),
            **line,
        )
        for line in content["use"]
    )


def look_up(label: str | None = None, year: int | None = None) -> list[tuple[RecordedWith, Support]]:
    """Return which curves a record may have been cut with, the best supported first.

    Parameters
    ----------
    label : str, optional
        Of the record, in any letters. One that the literature does not name leaves the customs of the time.
    year : int, optional
        Of the recording, which may be older than the pressing.

    Returns
    -------
    list of (RecordedWith, Support)
        Equally supported ones in the order of the table; empty if nothing is known.

    Raises
    ------
    ArgumentError
        If neither is given, or the year is no year of a record.
    """
    require(label is not None or year is not None, "neither a label nor a year", "one of them, or both")
    require(
        year is None or FIRST_YEAR <= year <= LAST_YEAR, f"the year {year}", f"four digits, {FIRST_YEAR} … {LAST_YEAR}"
    )
    ranks = list(Support)
    found = [(line, support) for line in recorded_with() if (support := line.support(label, year)) is not None]
    return sorted(found, key=lambda each: ranks.index(each[1]))


def known_labels() -> tuple[str, ...]:
    """Return every label that the literature names, in alphabetical order."""
    return tuple(sorted({label for line in recorded_with() for label in line.labels}))


def near_labels(label: str) -> Sequence[str]:
    """Return the labels of the literature whose spelling is near; empty if it names the label itself."""
    if any(line.is_of_label(label) for line in recorded_with()):
        return ()
    by_small = {known.lower(): known for known in known_labels()}
    return [by_small[near] for near in difflib.get_close_matches(label.strip().lower(), by_small, n=3)]


def uses_of(curve: Characteristic) -> str:
    """Return where and when a curve was used, in a line; empty where the literature is silent."""
    return "; ".join(line.where_when for line in recorded_with() if line.curve.name == curve.name)


def _words(text: str) -> frozenset[str]:
    return frozenset(re.findall(r"\w+", text.casefold()))
