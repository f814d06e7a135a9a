"""Pages are whole HTML, hold everything they show, and let no text pass for markup."""

from __future__ import annotations

from html.parser import HTMLParser

import pytest
from matplotlib.figure import Figure

from gramoscope.errors import ArgumentError
from gramoscope.listening import page
from gramoscope.listening.ink import png_of, svg_of

ALONE = {"meta", "img", "wbr"}


class _Nesting(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.images: list[dict[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.images.append(dict(attrs))
        if tag not in ALONE:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


def _read(html: str) -> _Nesting:
    nesting = _Nesting()
    nesting.feed(html)
    assert nesting.open == []
    return nesting


def test_what_is_text_stays_text() -> None:
    wild = "<script>alert('a & b')</script>"
    parts = [
        page.paragraph(wild),
        page.bullets([wild]),
        page.facts([(wild, wild)], caption=wild),
        page.table([wild, "n"], [[wild, "1"]], caption=wild),
        page.figure(b"<svg/>", alt=wild, caption=wild),
    ]
    html = page.page(wild, parts[0], [page.section('a"b', wild, *parts)])
    assert "<script" not in html
    assert sum(text.count("alert('a & b')") for text in _read(html).texts) == 13


def test_a_column_of_words_is_set_to_the_left_and_stands_as_a_list_on_a_phone() -> None:
    numbers = page.table(["band", "level"], [["1 kHz", "−3.0 dB"]])
    words = page.table(["flag", "meaning"], [["dark", "no light"]])
    assert "words" not in numbers
    assert "stacked" not in numbers
    assert 'class="words"' in words
    assert "stacked" in words
    with pytest.raises(ArgumentError, match="3 cells"):
        page.table(["a", "b"], [["1", "2", "3"]])


def test_long_names_break_where_their_parts_end() -> None:
    assert "tonearm.<wbr>other_<wbr>floor" in page.facts([("tonearm.other_floor", "1")])


@pytest.mark.parametrize(("picture", "kind"), [(svg_of, "svg+xml"), (png_of, "png")])
def test_pictures_are_inside_the_page_and_the_same_twice(picture: object, kind: str) -> None:
    def drawn() -> bytes:
        figure = Figure()
        figure.subplots().plot([1, 2], [3, 4])
        return picture(figure)  # type: ignore[operator, no-any-return]

    assert drawn() == drawn()
    (image,) = _read(page.figure(drawn(), alt="a line", caption="A line.")).images
    assert (image["alt"], (image["src"] or "").split(";")[0]) == ("a line", f"data:image/{kind}")


def test_nothing_is_there_where_there_is_nothing_to_say() -> None:
    assert page.bullets([]) == page.figures([]) == ""
