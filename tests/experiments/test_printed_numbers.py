"""Every measurement that the paper prints stands on a page, and the pages hang together."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SEED_PAPER = ROOT / "experiments" / "seed_paper"
PAPER = ROOT.parent / "shared" / "seed-paper.txt"

MEASUREMENTS = (
    *("200Hz", "20KHz", "0.88", "1 µm", "400X", "40X", "10X", "24 bit", "1280 × 1024", "78RPM", "33RPM"),
    *("120 µm", "7–8 %", "1.7mm", "160mm", "4mm", "3.9mm", "4X", "45 µm", "32mm", "1.515", "1.0", "22.5°"),
    *("0.11mm", "0.037mm", "4.037mm", "100 pixels", "220.5kHz", "0.5mm", "0.39 µm", "115mm", "939.34mm/s"),
    *("2404.71kHz", "110 times", "6000 groups", "12 images", "3 seconds", "0.559", "0.564"),
)
"""What the paper measures or sets, as printed but for the micro sign and spaces."""
NOT_MEASURED = {"0", "1", "2", "3", "5", "6", "7", "8", "2006", "2009"}
"""Numbers of sections, figures, equations and references, steps of one, and years."""


def _pages(*names: str) -> str:
    return "\n".join((SEED_PAPER / "pages" / f"{name}.md").read_text(encoding="utf-8") for name in names)


@pytest.mark.parametrize("printed", MEASUREMENTS)
def test_every_measurement_of_the_paper_stands_on_the_pages_of_optics_or_sound(printed: str) -> None:
    assert printed in _pages("optics", "sound")


def _numbers(text: str) -> set[str]:
    return set(re.findall(r"\d+(?:\.\d+)?", text.replace("\\%", " ")))


def test_no_number_of_the_paper_is_missing_from_the_pages() -> None:
    if not PAPER.is_file():
        pytest.skip("the text of the paper is not here")
    printed = _numbers(PAPER.read_text(encoding="utf-8"))
    assert {"939.34", "2404.71", "0.559", "1.515"} <= printed
    pages = _numbers(_pages("optics", "in_focus", "hough", "orientation", "sound", "damage", "kalman"))
    assert sorted(printed - pages - NOT_MEASURED) == []


def _markdown() -> list[Path]:
    return sorted(SEED_PAPER.rglob("*.md"))


@pytest.mark.parametrize("path", _markdown(), ids=lambda path: path.name)
def test_every_link_and_picture_of_a_page_is_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    links = re.findall(r"\]\(([^)#]+)\)", text)
    assert links
    assert [link for link in links if not link.startswith("http") and not (path.parent / link).exists()] == []


@pytest.mark.parametrize("path", sorted((SEED_PAPER / "pages").glob("*.md")), ids=lambda path: path.stem)
def test_every_page_has_its_table_with_a_reason_in_every_row(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    table = text.split("## Claim · ours · why they differ", 1)[1].split("\n## ", 1)[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line.startswith("|")
    ]
    assert len(rows) > 3
    assert all(len(row) == 4 and all(row) for row in rows)
    assert (SEED_PAPER / f"{path.stem}.py").is_file()


def test_every_picture_is_small_and_shown_on_a_page() -> None:
    text = "\n".join(path.read_text(encoding="utf-8") for path in _markdown())
    pictures = sorted((SEED_PAPER / "pages" / "pictures").glob("*.png"))
    assert len(pictures) > 10
    assert [picture.name for picture in pictures if picture.stat().st_size > 300_000] == []
    assert [picture.name for picture in pictures if picture.name not in text] == []
