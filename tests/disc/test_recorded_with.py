"""Label and year to curve: the literature as it stands in the file, and nothing beyond it."""

import pytest

from gramoscope.disc.characteristics import CHARACTERISTICS, characteristic
from gramoscope.disc.recorded_with import (
    RecordedWith,
    Support,
    known_labels,
    look_up,
    near_labels,
    recorded_with,
    uses_of,
)
from gramoscope.errors import ArgumentError


def named(found):
    return [(line.curve.name, support) for line, support in found]


def test_every_curve_but_none_beyond_the_table_has_a_use_and_a_source():
    assert {line.curve.name for line in recorded_with()} == {curve.name for curve in CHARACTERISTICS}
    assert all("Copeland" in line.source and "IASA" in line.source for line in recorded_with())
    assert all(line.first_year <= line.last_year for line in recorded_with() if line.first_year and line.last_year)


def test_the_label_in_its_year_comes_first_then_customs_then_other_years():
    found = named(look_up("Decca", 1948))
    assert found[0] == ("decca-ffrr", Support.LABEL_AND_YEAR)
    assert found[-1] == ("aes", Support.OTHER_YEARS)
    assert {name for name, support in found[1:-1]} == {"500n-0", "american-6", "american-8"}
    assert {support for _, support in found[1:-1]} == {Support.CUSTOM}


def test_two_curves_of_a_label_in_one_year_are_both_told():
    both = [name for name, support in named(look_up("rca Victor", 1944)) if support is Support.LABEL_AND_YEAR]
    assert both == ["old-rca", "rca"]


@pytest.mark.parametrize(("year", "there"), [(1943, False), (1944, True), (1956, True), (1957, False)])
def test_first_and_last_year_are_included(year, there):
    assert (("decca-ffrr", Support.LABEL_AND_YEAR) in named(look_up("DECCA", year))) is there


def test_a_year_alone_gives_the_customs_of_the_time():
    assert named(look_up(year=1920)) == [("flat", Support.CUSTOM)]
    assert [name for name, _ in named(look_up(year=1970))] == ["iec-78", "riaa"]


def test_a_label_alone_gives_all_its_curves_and_no_customs():
    assert named(look_up("Columbia")) == [("columbia-78", Support.LABEL), ("columbia-lp", Support.LABEL)]


def test_a_label_whose_years_nobody_wrote_down_is_told_as_such():
    assert named(look_up("Mercury", 1950))[0] == ("aes", Support.LABEL)


def test_an_unknown_label_leaves_the_customs_and_a_misspelt_one_has_neighbours():
    assert named(look_up("Odeon", 1920)) == [("flat", Support.CUSTOM)]
    assert look_up("Odeon") == []
    assert near_labels("decka") == ["Decca"]
    assert list(near_labels("Decca Records")) == []
    assert "Telefunken" in known_labels()


def test_part_of_a_word_is_no_label():
    assert look_up("Columbiana") == []


@pytest.mark.parametrize(("label", "year"), [(None, None), ("Decca", 48), (None, 1876)])
def test_impossible_questions_are_refused(label, year):
    with pytest.raises(ArgumentError):
        look_up(label, year)


def test_where_and_when_in_words():
    assert uses_of(characteristic("aes")) == "Decca, US, 1937–1946; Mercury; US, 1951–1958"
    assert uses_of(characteristic("riaa")) == "microgroove, since 1955"
    assert uses_of(characteristic("300R-12.7")) == ""
    assert RecordedWith(characteristic("aes"), "me", last_year=1925).where_when == "until about 1925"
