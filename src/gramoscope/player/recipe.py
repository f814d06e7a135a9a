"""Recipes: what we choose to do with a capture, as opposed to what the apparatus is (`apparatus.bench`).

A recipe is a TOML file. Each of its tables is one part of the player, each key a parameter of that part; names are
resolved to parts here and nowhere else.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from enum import Enum
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from pydantic import ConfigDict, TypeAdapter, ValidationError

from gramoscope.apparatus.bench import Bench
from gramoscope.apparatus.still import StillCapture
from gramoscope.errors import ArgumentError, require
from gramoscope.pickup.cartridge import Cartridge
from gramoscope.pickup.device import Device
from gramoscope.pickup.edges.edge_cartridge import EdgeCartridge
from gramoscope.pickup.flow.flow_method import FlowMethod
from gramoscope.pickup.flow.horn_schunck import GrooveHornSchunck, HornSchunck
from gramoscope.pickup.flow.multigrid_horn_schunck import MultigridHornSchunck
from gramoscope.pickup.processor import PROCESSOR
from gramoscope.pickup.seed_paper import SeedPaperPickup
from gramoscope.pickup.texture_likelihood import TextureLikelihood
from gramoscope.preamp.declick import Declicker
from gramoscope.preamp.decrackle import Decrackler
from gramoscope.preamp.repair import Repair
from gramoscope.preamp.resample import DEFAULT_PASSBAND
from gramoscope.preamp.rumble import RumbleFilter
from gramoscope.tonearm.follow import KalmanSmoother, PlaceSmoother, Smoother
from gramoscope.tonearm.splice import Splice
from gramoscope.tonearm.stitch import Stitch

DEFAULT_RECIPE, STILLS_RECIPE = "best", "stills"
_EDGES = "edges"
_CARTRIDGES: dict[str, type[SeedPaperPickup] | type[TextureLikelihood] | type[EdgeCartridge]] = {
    _EDGES: EdgeCartridge,
    "seed-paper": SeedPaperPickup,
    "texture-likelihood": TextureLikelihood,
}
_FLOWS: dict[str, type[FlowMethod]] = {
    "horn-schunck": HornSchunck,
    "groove-horn-schunck": GrooveHornSchunck,
    "multigrid-horn-schunck": MultigridHornSchunck,
}
_SMOOTHERS: dict[str, type[KalmanSmoother] | type[PlaceSmoother]] = {"slopes": KalmanSmoother, "places": PlaceSmoother}
_REPAIRS: dict[str, type[Any]] = {"declick": Declicker, "decrackle": Decrackler, "rumble": RumbleFilter}
_JOINS = ("splice", "stitch")
"""The table that says how a film, and how photographs, are joined."""
# what a table that names none gets
_CARTRIDGE, _FLOW, _SMOOTHER = "seed-paper", "groove-horn-schunck", "slopes"
Part = TypeVar("Part")


@dataclass(frozen=True)
class Recipe:
    """Everything that was chosen for a transfer.

    Attributes
    ----------
    name, about : str
    cartridge : str
        "seed-paper" or "texture-likelihood", which read films, or "edges", which reads photographs.
    pickup : dict
        Parameters of the cartridge, all but the bench.
    splice : Splice
        Of the stretches of a film.
    stitch : Stitch
        Of neighbouring photographs.
    smoother : KalmanSmoother or PlaceSmoother
    passband : float
        Of the resampler.
    repair : Repair
        Nothing, unless there are tables `[preamp.declick]`, `[preamp.decrackle]` or `[preamp.rumble]`, which may be empty.
    """

    name: str
    about: str = ""
    cartridge: str = _CARTRIDGE
    pickup: Mapping[str, Any] = field(default_factory=dict)
    splice: Splice = field(default_factory=Splice)
    stitch: Stitch = field(default_factory=Stitch)
    smoother: Smoother = field(default_factory=KalmanSmoother)
    passband: float = DEFAULT_PASSBAND
    repair: Repair = field(default_factory=Repair)

    def cartridge_for(self, bench: Bench, device: Device = PROCESSOR) -> Cartridge:
        """Return the cartridge, fitted to an apparatus, reading on a device; ArgumentError if it has no kernels for it."""
        kind = _CARTRIDGES[self.cartridge]
        if issubclass(kind, EdgeCartridge):
            raise ArgumentError(
                f"the recipe {self.name!r} for a film",
                "a recipe for films",
                f"--recipe {DEFAULT_RECIPE}, or leave --recipe out",
            )
        if issubclass(kind, TextureLikelihood):
            return kind(bench, **self.pickup, device=device)
        require(
            device == PROCESSOR,
            f"the recipe {self.name!r} on {device.name}",
            "a recipe of the cartridge texture-likelihood, which has kernels for it",
            "--recipe best, or leave --device out",
        )
        return kind(bench, **self.pickup)

    def edge_cartridge(self) -> EdgeCartridge:
        """Return the cartridge for photographs; ArgumentError if the recipe reads films."""
        require(
            self.cartridge == _EDGES,
            f"the recipe {self.name!r} for photographs",
            "a recipe for photographs",
            f"--recipe {STILLS_RECIPE}, or leave --recipe out",
        )
        return EdgeCartridge(**self.pickup)


def recipe_for(capture: object) -> str:
    """Return the name of the recipe that a capture is played with when nobody chooses one."""
    return STILLS_RECIPE if isinstance(capture, StillCapture) else DEFAULT_RECIPE


def shipped_recipes() -> tuple[str, ...]:
    """Return the names of the recipes that ship with us."""
    folder = resources.files("gramoscope.player").joinpath("recipes")
    return tuple(sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml")))


def load_recipe(name_or_file: str) -> Recipe:
    """Return a recipe by its name or from a file.

    Parameters
    ----------
    name_or_file : str
        A name from `shipped_recipes`, or the path of a TOML file.

    Raises
    ------
    ArgumentError
        If there is no such recipe, or a key is unknown or impossible.
    """
    try:
        table = tomllib.loads(recipe_text(name_or_file))
    except tomllib.TOMLDecodeError as error:
        raise ArgumentError(f"recipe {name_or_file} is not valid TOML: {error}", "a TOML file") from error
    return recipe_of_table({"name": Path(name_or_file).stem, **table})


def recipe_text(name_or_file: str) -> str:
    """Return the TOML of a recipe by its name or from a file; ArgumentError if there is none."""
    if name_or_file in shipped_recipes():
        return resources.files("gramoscope.player").joinpath("recipes", f"{name_or_file}.toml").read_text("utf-8")
    return _read_file(name_or_file)


def _read_file(name: str) -> str:
    path = Path(name)
    if not path.is_file():
        raise ArgumentError(
            f"there is no recipe {name!r}",
            f"one of {', '.join(shipped_recipes())}, or the path of a TOML file",
            "copy a shipped recipe with: gramoscope recipe seed-paper > my-recipe.toml",
        )
    try:
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ArgumentError(f"recipe {name} cannot be read: {error}", "a TOML file in UTF-8") from error


def recipe_of_table(table: Mapping[str, Any]) -> Recipe:
    """Return the recipe that a parsed TOML file describes; ArgumentError if a key is unknown or impossible."""
    _only(table, ("name", "about", "pickup", "tonearm", "preamp"), "the recipe")
    pickup, tonearm, preamp = (_table(table, key) for key in ("pickup", "tonearm", "preamp"))
    name, parameters = _cartridge_of_table(pickup)
    join = _JOINS[name == _EDGES]
    _only(tonearm, (join, "smoother"), "[tonearm]")
    _only(preamp, ("passband", *_REPAIRS), "[preamp]")
    return Recipe(
        name=_checked(str, table.get("name", "unnamed"), "name"),
        about=_checked(str, table.get("about", ""), "about"),
        cartridge=name,
        pickup=parameters,
        splice=build(Splice, _table(tonearm, "splice"), "[tonearm.splice]"),
        stitch=build(Stitch, _table(tonearm, "stitch"), "[tonearm.stitch]"),
        smoother=_chosen(_SMOOTHERS, _SMOOTHER, _table(tonearm, "smoother"), "[tonearm.smoother]"),
        passband=_checked(float, preamp.get("passband", DEFAULT_PASSBAND), "[preamp] passband"),
        repair=Repair(
            **{
                name: build(kind, _table(preamp, name), f"[preamp.{name}]")
                for name, kind in _REPAIRS.items()
                if name in preamp
            }
        ),
    )


def table_of_recipe(recipe: Recipe) -> dict[str, Any]:
    """Return a recipe with every one of its parameters, those it left out included; `recipe_of_table` reads it back."""
    stills = recipe.cartridge == _EDGES
    cartridge = recipe.edge_cartridge() if stills else recipe.cartridge_for(Bench())
    join = _JOINS[stills]
    pickup: dict[str, Any] = {}
    for parameter in _parameters(type(cartridge)):
        value = getattr(cartridge, parameter)
        if parameter == "flow":
            pickup[parameter] = _table_of_chosen(_FLOWS, value)
        else:
            pickup[parameter] = asdict(value) if is_dataclass(value) and not isinstance(value, type) else _named(value)
    return {
        "name": recipe.name,
        "about": recipe.about,
        "pickup": {"cartridge": recipe.cartridge, **pickup},
        "tonearm": {join: asdict(getattr(recipe, join)), "smoother": _table_of_chosen(_SMOOTHERS, recipe.smoother)},
        "preamp": {"passband": recipe.passband, **_table_of_repair(recipe.repair)},
    }


def _named(value: Any) -> Any:
    """A choice among a few by its name in TOML; anything else as it is."""
    return value.name.lower().replace("_", "-") if isinstance(value, Enum) else value


def _table_of_repair(repair: Repair) -> dict[str, Any]:
    return {name: asdict(part) for name in _REPAIRS if (part := getattr(repair, name)) is not None}


def with_repairs(recipe: Recipe, *, declick: bool, decrackle: bool, rumble_hz: float | None) -> Recipe:
    """Return the recipe with repairs added that it has not; a corner replaces its own. ArgumentError for a bad corner."""
    own = recipe.repair
    return replace(
        recipe,
        repair=Repair(
            declick=own.declick or (Declicker() if declick else None),
            decrackle=own.decrackle or (Decrackler() if decrackle else None),
            rumble=own.rumble if rumble_hz is None else replace(own.rumble or RumbleFilter(), corner_hz=rumble_hz),
        ),
    )


def _parameters(kind: type[Any]) -> tuple[str, ...]:
    return tuple(f.name for f in fields(kind) if f.name not in ("bench", "device"))


def _cartridge_of_table(table: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    name = table.get("cartridge", _CARTRIDGE)
    if name not in _CARTRIDGES:
        raise ArgumentError(f"[pickup] cartridge = {name!r}", f"one of {', '.join(_CARTRIDGES)}")
    kind = _CARTRIDGES[name]
    _only(table, ("cartridge", *_parameters(kind)), "[pickup]")
    hints = get_type_hints(kind)
    built: dict[str, Any] = {}
    for parameter in _parameters(kind):
        if parameter == "flow":
            built[parameter] = _chosen(_FLOWS, _FLOW, _table(table, parameter), "[pickup.flow]")
        elif is_dataclass(hints[parameter]):
            built[parameter] = build(hints[parameter], _table(table, parameter), f"[pickup.{parameter}]")
        elif parameter in table:
            built[parameter] = _checked(hints[parameter], table[parameter], f"[pickup] {parameter}")
    return name, built


def _chosen(kinds: Mapping[str, type[Part]], default: str, table: Mapping[str, Any], where: str) -> Part:
    """Make the part that a table's `method` names."""
    parameters = dict(table)
    method = parameters.pop("method", default)
    if method not in kinds:
        raise ArgumentError(f"{where} method = {method!r}", f"one of {', '.join(kinds)}")
    return build(kinds[method], parameters, where)


def _table_of_chosen(kinds: Mapping[str, type[Any]], part: Any) -> dict[str, Any]:
    return {"method": next(name for name, kind in kinds.items() if type(part) is kind), **asdict(part)}


def build(kind: type[Part], table: Mapping[str, Any], where: str) -> Part:
    """Make a part from a table of its parameters.

    Parameters
    ----------
    kind : type
        A dataclass.
    table : mapping
        Parameter → value; those left out keep their defaults.
    where : str
        How to call the table in messages.

    Raises
    ------
    ArgumentError
        If a key is unknown, a value of the wrong type or impossible, or one without default is missing.
    """
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    _only(table, tuple(known), where)
    missing = [n for n, f in known.items() if n not in table and f.default is MISSING and f.default_factory is MISSING]
    if missing:
        raise ArgumentError(f"{where} lacks {', '.join(missing)}", "a value for each")
    hints = get_type_hints(kind)
    checked = {name: _checked(hints[name], value, f"{where} {name}") for name, value in table.items()}
    try:
        return kind(**checked)
    except ArgumentError as error:
        raise ArgumentError(f"{where}: {error.found}", error.needed, error.remedy) from error


def _checked(hint: Any, value: Any, where: str) -> Any:
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _member(hint, value, where)
    # TOML has no tuples, and pydantic's strictness (no "0.5" for 0.5, no true for 1) wants them
    given = tuple(value) if isinstance(value, list) else value
    try:
        checked = TypeAdapter(hint, config=ConfigDict(allow_inf_nan=False, strict=True)).validate_python(given)
    except ValidationError as error:
        needed = _IN_WORDS.get(hint, error.errors()[0]["msg"].lower())
        raise ArgumentError(f"{where} = {value!r}", needed) from error
    # all parameters are sizes, shares and counts: what a part does not check itself is at least not negative
    numbers = [
        number for number in (given if isinstance(given, tuple) else (given,)) if isinstance(number, int | float)
    ]
    require(all(number >= 0 for number in numbers), f"{where} = {value!r}", "zero or more")
    return checked


def _member(choices: type[Enum], name: Any, where: str) -> Enum:
    named = {_named(choice): choice for choice in choices}
    if not isinstance(name, str) or name not in named:
        raise ArgumentError(f"{where} = {name!r}", f"one of {', '.join(named)}")
    return named[name]


_IN_WORDS: dict[Any, str] = {
    float: "a finite number",
    int: "a whole number",
    str: "a text",
    tuple[float, float]: "two finite numbers",
}


def _only(table: Mapping[str, Any], known: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in known:
            near = get_close_matches(key, known, 1)
            raise ArgumentError(
                f"{where} has an unknown key {key!r}",
                f"one of {', '.join(known)}",
                f"write {near[0]!r}" if near else "",
            )


def _table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise ArgumentError(f"{key} = {value!r}", f"a table [{key}]")
    return value
