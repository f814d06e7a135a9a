"""Recipes: what ships is what the parts do, and what cannot be is refused with a name."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from gramoscope.apparatus.bench import Bench
from gramoscope.errors import ArgumentError
from gramoscope.pickup.flow.horn_schunck import GrooveHornSchunck, HornSchunck
from gramoscope.pickup.seed_paper import SeedPaperPickup
from gramoscope.player.provenance import recipe_of
from gramoscope.player.recipe import (
    Recipe,
    build,
    load_recipe,
    recipe_of_table,
    recipe_text,
    shipped_recipes,
    table_of_recipe,
)
from gramoscope.tonearm.follow import KalmanSmoother

SHIPPED = "seed-paper"


@pytest.fixture
def table() -> dict[str, Any]:
    return tomllib.loads(recipe_text(SHIPPED))


def _leaves(table: dict[str, Any], path: tuple[str, ...] = ()) -> dict[tuple[str, ...], Any]:
    found: dict[tuple[str, ...], Any] = {}
    for key, value in table.items():
        found |= _leaves(value, (*path, key)) if isinstance(value, dict) else {(*path, key): value}
    return found


def _plain(leaves: dict[tuple[str, ...], Any]) -> dict[tuple[str, ...], Any]:
    return {path: list(value) if isinstance(value, tuple) else value for path, value in leaves.items()}


def test_the_shipped_recipe_holds_every_key_of_every_part(table: dict[str, Any]) -> None:
    every = table_of_recipe(recipe_of_table({}))
    assert set(_leaves(table)) == set(_leaves(every))


def test_the_shipped_recipe_holds_the_defaults_of_the_parts_but_where_it_says_so(table: dict[str, Any]) -> None:
    shipped, defaults = _plain(_leaves(table)), _plain(_leaves(table_of_recipe(recipe_of_table({}))))
    # fewer sweeps than the textbook method: the file says why beside the number
    on_purpose = {("name",), ("about",), ("pickup", "flow", "iterations")}
    assert {path for path, value in shipped.items() if value != defaults[path]} == on_purpose
    line = next(line for line in recipe_text(SHIPPED).splitlines() if line.startswith("iterations"))
    assert "# the paper does not say; 100 change none of the figures" in line


def test_an_empty_recipe_is_the_parts_as_they_come() -> None:
    recipe = recipe_of_table({})
    assert recipe.cartridge_for(Bench()) == SeedPaperPickup(Bench())
    assert recipe == replace(Recipe("unnamed"), pickup=recipe.pickup)


def test_every_parameter_of_the_cartridge_can_be_written_in_a_recipe(table: dict[str, Any]) -> None:
    assert {f.name for f in fields(SeedPaperPickup)} - {"bench"} == set(table["pickup"]) - {"cartridge"}


def test_what_is_written_arrives_in_the_part(table: dict[str, Any]) -> None:
    table["pickup"]["flow"] = {"method": "horn-schunck", "alpha": 0.7, "iterations": 11}
    table["tonearm"]["smoother"]["corner_limits_hz"] = [900.0, 7000.0]
    table["preamp"]["passband"] = 0.8
    recipe = recipe_of_table(table)
    assert recipe.cartridge_for(Bench()).flow == HornSchunck(alpha=0.7, iterations=11)
    assert recipe.smoother == KalmanSmoother(corner_limits_hz=(900.0, 7000.0))
    assert recipe.passband == 0.8


def test_the_flow_with_the_groove_is_the_one_that_is_taken_unasked() -> None:
    assert isinstance(recipe_of_table({}).cartridge_for(Bench()).flow, GrooveHornSchunck)


@pytest.mark.parametrize("flow", ["horn-schunck", "groove-horn-schunck"])
def test_a_recipe_comes_back_whole_from_its_table(table: dict[str, Any], flow: str) -> None:
    table["pickup"]["flow"] = {"method": flow, "alpha": 0.31}
    table["name"] = "mine"
    recipe = recipe_of_table(table)
    assert recipe_of_table(table_of_recipe(recipe)) == recipe


def test_a_recipe_comes_back_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(recipe_text(SHIPPED), encoding="utf-8")
    assert load_recipe(str(file)) == load_recipe(SHIPPED)


def test_a_recipe_without_a_name_is_called_as_its_file(tmp_path: Path) -> None:
    (tmp_path / "my-quiet-one.toml").write_text("[preamp]\npassband = 0.5\n", encoding="utf-8")
    assert load_recipe(str(tmp_path / "my-quiet-one.toml")).name == "my-quiet-one"


def test_all_that_ship_can_be_loaded_and_say_what_they_are() -> None:
    assert SHIPPED in shipped_recipes()
    assert all(load_recipe(name).name == name and load_recipe(name).about for name in shipped_recipes())


def test_the_sum_is_of_what_a_recipe_does_not_of_how_it_is_written(table: dict[str, Any]) -> None:
    recipe = recipe_of_table(table)
    turned = {key: table[key] for key in reversed(table)} | {"name": "other", "about": ""}
    turned["pickup"] = {key: table["pickup"][key] for key in reversed(table["pickup"])}
    del turned["tonearm"]["splice"]["row_reach_px"]  # its default is what was written
    assert recipe_of(recipe_of_table(turned))["sha256"] == recipe_of(recipe)["sha256"]


def test_the_sum_changes_with_every_single_parameter(table: dict[str, Any]) -> None:
    sums = {recipe_of(recipe_of_table(table))["sha256"]}
    numbers = [path for path, value in _leaves(table).items() if isinstance(value, float)]
    for *path, key in numbers:
        changed = deepcopy(table)
        part = changed
        for name in path:
            part = part[name]
        part[key] *= 0.97
        sums.add(recipe_of(recipe_of_table(changed))["sha256"])
    assert len(sums) == len(numbers) + 1


def _refused(table: dict[str, Any]) -> ArgumentError:
    with pytest.raises(ArgumentError) as caught:
        recipe_of_table(table)
    return caught.value


@pytest.mark.parametrize(
    ("table", "where", "near"),
    [
        ({"pickp": {}}, "the recipe", "pickup"),
        ({"pickup": {"smoothing": 1.0}}, "[pickup]", "smoothing_px"),
        ({"pickup": {"flow": {"alhpa": 0.5}}}, "[pickup.flow]", "alpha"),
        ({"pickup": {"flow": {"method": "horn-schunck", "gamma": 0.5}}}, "[pickup.flow]", ""),
        ({"tonearm": {"smother": {}}}, "[tonearm]", "smoother"),
        ({"tonearm": {"smoother": {"gates": 5.0}}}, "[tonearm.smoother]", "gate"),
        ({"preamp": {"pass_band": 0.9}}, "[preamp]", "passband"),
    ],
)
def test_an_unknown_key_is_named_with_its_table_and_the_nearest_known_one(
    table: dict[str, Any], where: str, near: str
) -> None:
    error = _refused(table)
    assert where in error.found
    assert "unknown key" in error.found
    assert error.remedy == (f"write {near!r}" if near else "")


@pytest.mark.parametrize(
    ("table", "found", "needed"),
    [
        ({"pickup": {"flow": {"alpha": "0.5"}}}, "[pickup.flow] alpha = '0.5'", "a finite number"),
        ({"pickup": {"flow": {"alpha": float("nan")}}}, "alpha = nan", "a finite number"),
        ({"pickup": {"smoothing_px": [1.0]}}, "[pickup] smoothing_px = [1.0]", "a finite number"),
        ({"pickup": {"hough": {"segments": 2.5}}}, "[pickup.hough] segments = 2.5", "a whole number"),
        ({"tonearm": {"smoother": {"block_groups": True}}}, "block_groups = True", "a whole number"),
        ({"tonearm": {"smoother": {"corner_limits_hz": [1e3]}}}, "corner_limits_hz = [1000.0]", "two finite numbers"),
        ({"preamp": {"passband": True}}, "[preamp] passband = True", "a finite number"),
        ({"name": 3}, "name = 3", "a text"),
        ({"pickup": 3}, "pickup = 3", "a table [pickup]"),
        ({"pickup": {"cartridge": "crystal"}}, "cartridge = 'crystal'", "seed-paper, texture-likelihood"),
        ({"pickup": {"flow": {"method": "lucas-kanade"}}}, "method = 'lucas-kanade'", "horn-schunck"),
    ],
)
def test_a_value_of_the_wrong_kind_is_named_with_what_is_needed(table: dict[str, Any], found: str, needed: str) -> None:
    error = _refused(table)
    assert found in error.found
    assert needed in error.needed


@pytest.mark.parametrize(
    ("table", "where"),
    [
        ({"pickup": {"flow": {"alpha": -1.0}}}, "[pickup.flow]"),
        ({"pickup": {"flow": {"iterations": 0}}}, "[pickup.flow]"),
        ({"pickup": {"hough": {"segments": 0}}}, "[pickup.hough]"),
        ({"tonearm": {"splice": {"reach_m": -1e-6}}}, "[tonearm.splice]"),
        ({"tonearm": {"smoother": {"gate": 0.0}}}, "[tonearm.smoother]"),
    ],
)
def test_a_value_out_of_its_range_is_refused_with_the_table_it_stands_in(table: dict[str, Any], where: str) -> None:
    error = _refused(table)
    assert error.found.startswith(where)
    assert error.needed


def test_a_whole_number_will_do_where_any_number_will() -> None:
    assert recipe_of_table({"pickup": {"flow": {"alpha": 1}}}).cartridge_for(Bench()).flow == GrooveHornSchunck(alpha=1)


def test_a_part_without_a_value_it_cannot_do_without_is_refused() -> None:
    with pytest.raises(ArgumentError, match=r"\[bench\.cartridge\] lacks bench"):
        build(SeedPaperPickup, {}, "[bench.cartridge]")


@pytest.mark.parametrize(
    ("content", "said"),
    [(b"[pickup\n", "not valid TOML"), (b"\xff\xfe\x00", "cannot be read"), (b"alpha = 1", "unknown key 'alpha'")],
)
def test_a_file_that_is_no_recipe_says_what_is_wrong(tmp_path: Path, content: bytes, said: str) -> None:
    (tmp_path / "x.toml").write_bytes(content)
    with pytest.raises(ArgumentError, match=said):
        load_recipe(str(tmp_path / "x.toml"))


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    with pytest.raises(ArgumentError) as caught:
        load_recipe("sed-paper")
    assert "seed-paper" in caught.value.needed
    assert "gramoscope recipe" in caught.value.remedy
