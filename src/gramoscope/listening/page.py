"""Pages for people: one HTML file that holds everything it shows, without scripts, for a screen, a phone or paper."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources

from gramoscope.errors import require

STYLE_FILE = "page.css"
WIDEST, LONGEST_NUMBER = 4, 16
"""Columns of numbers that a narrow screen has room for; letters of a number with its unit."""


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def bullets(lines: Iterable[str]) -> str:
    """Return a list of plain texts; nothing for an empty one."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""


def facts(rows: Iterable[tuple[str, str]], *, caption: str = "") -> str:
    """Return a table of names and values, the names as headers of its rows."""
    body = "".join(f'<tr><th scope="row">{_breakable(name)}</th><td>{escape(value)}</td></tr>' for name, value in rows)
    return f'<div class="wide"><table class="facts">{_caption(caption)}<tbody>{body}</tbody></table></div>'


def _breakable(name: str) -> str:
    """A name that may be broken behind its points and underscores, and nowhere else."""
    return re.sub(r"([._])(?=\w)", r"\1<wbr>", escape(name))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str = "") -> str:
    """Return a table of texts; the first cell of each row is its header.

    Parameters
    ----------
    head : sequence of str
    rows : iterable of sequences of str
        As many as in the head. A column that holds words is set to the left, one of numbers to the right. On a narrow
        screen the rows of a table of words, or of many columns, stand as a list.
    caption : str
    """
    rows = list(rows)
    for row in rows:
        require(len(row) == len(head), f"a row of {len(row)} cells", f"{len(head)}")
    words = [any(_is_words(row[i]) for row in rows) for i in range(len(head))]
    stacked = ' class="stacked"' if any(words[1:]) or len(head) > WIDEST else ""
    columns = "".join(
        f'<th scope="col"{_kind(wordy)}>{escape(cell)}</th>' for cell, wordy in zip(head, words, strict=True)
    )
    body = "".join(_row(row, head, words) for row in rows)
    return (
        f'<div class="wide"><table{stacked}>{_caption(caption)}<thead><tr>{columns}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _row(cells: Sequence[str], head: Sequence[str], words: Sequence[bool]) -> str:
    others = "".join(
        f'<td data-label="{escape(name, quote=True)}"{_kind(wordy)}>{escape(cell)}</td>'
        for cell, name, wordy in zip(cells[1:], head[1:], words[1:], strict=True)
    )
    return f'<tr><th scope="row">{escape(cells[0])}</th>{others}</tr>'


def _kind(wordy: bool) -> str:
    return ' class="words"' if wordy else ""


def _is_words(cell: str) -> bool:
    """Whether a cell is more than a number with its unit."""
    return len(cell) > LONGEST_NUMBER or cell[:1].isalpha()


def _caption(text: str) -> str:
    return f"<caption>{escape(text)}</caption>" if text else ""


def figure(picture: bytes, *, alt: str, caption: str) -> str:
    """Return a figure that holds its picture.

    Parameters
    ----------
    picture : bytes
        SVG or PNG.
    alt : str
        What it shows, for those who do not see it.
    caption : str
    """
    kind = "png" if picture.startswith(b"\x89PNG") else "svg+xml"
    source = f"data:image/{kind};base64,{b64encode(picture).decode('ascii')}"
    return (
        f'<figure><img src="{source}" alt="{escape(alt, quote=True)}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def figures(several: Iterable[str]) -> str:
    """Return figures side by side where there is room, below each other where there is not."""
    inside = "".join(several)
    return f'<div class="figures">{inside}</div>' if inside else ""


def section(name: str, title: str, *parts: str) -> str:
    """Return a section that can be linked to by its name."""
    return f'<section id="{escape(name, quote=True)}"><h2>{escape(title)}</h2>{"".join(parts)}</section>'


def page(title: str, lead: str, sections: Sequence[str]) -> str:
    """Return a whole page.

    Parameters
    ----------
    title : str
        Plain text.
    lead, sections : str
        HTML, as the functions above make it.
    """
    style = resources.files("gramoscope.listening").joinpath(STYLE_FILE).read_text("utf-8")
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{escape(title)}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n<header>\n<h1>{escape(title)}</h1>\n{lead}\n</header>\n<main>\n"
        + "\n".join(sections)
        + "\n</main>\n</body>\n</html>\n"
    )
