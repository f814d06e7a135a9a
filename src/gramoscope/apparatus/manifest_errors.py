"""What is wrong with a `capture.toml`, in words that name the key, what stands there and what could."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MinLen
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo


def problems_of(error: ValidationError, model: type[BaseModel], content: Mapping[str, Any]) -> tuple[str, ...]:
    """Return every problem of a file in words.

    Parameters
    ----------
    error : ValidationError
        Of `model` and `content`.
    model : type of BaseModel
    content : mapping
        As read.

    Returns
    -------
    tuple of str
    """
    return tuple(dict.fromkeys(_words(one["type"], one["loc"], model, content) for one in error.errors()))


def several(problems: Sequence[str]) -> str:
    """Return problems as one text: a line if there is one, a list if there are more."""
    return (
        problems[0] if len(problems) == 1 else "\n".join([f"{len(problems)} problems", *(f"  {p}" for p in problems)])
    )


def _words(kind: str, place: tuple[int | str, ...], model: type[BaseModel], content: Mapping[str, Any]) -> str:
    keys = [str(key) for key in place[:2]]
    owner = _table(model, keys[0]) if len(keys) == 2 else model
    fields = owner.model_fields if owner is not None else {}
    name = f"[{keys[0]}] {keys[1]}" if len(keys) == 2 else _quoted(keys[0], model)
    if kind == "extra_forbidden":
        return f"unknown key {name}{_nearest(keys, model)}"
    range_words = range_of(fields[keys[-1]]) if keys[-1] in fields else "something else"
    if kind == "missing":
        return f"missing key {name}: needed is {range_words}"
    return f"{name} = {_shown(keys, content)}: needed is {range_words}"


def _quoted(key: str, model: type[BaseModel]) -> str:
    return f"[{key}]" if _table(model, key) is not None else key


def _table(model: type[BaseModel], key: str) -> type[BaseModel] | None:
    field = model.model_fields.get(key)
    if field is None:
        return None
    choices = (field.annotation, *get_args(field.annotation))
    return next((kind for kind in choices if isinstance(kind, type) and issubclass(kind, BaseModel)), None)


def _shown(keys: list[str], content: Mapping[str, Any]) -> str:
    value: Any = content
    for key in keys:
        value = value[key]
    if isinstance(value, Mapping):
        return "a table"
    return repr(value) if isinstance(value, str | bool | list) else str(value)


def range_of(field: FieldInfo) -> str:
    """Return in words what a key may be.

    Parameters
    ----------
    field : FieldInfo
        Of a table's model.

    Returns
    -------
    str
        E.g. "a number above 0 and at most 1000".
    """
    kinds = (field.annotation, *get_args(field.annotation))
    if get_origin(field.annotation) is Literal:
        return " or ".join(f'"{choice}"' for choice in get_args(field.annotation))
    if any(isinstance(kind, type) and issubclass(kind, BaseModel) for kind in kinds):
        return "a table"
    if list[str] in kinds:
        return "a list of texts" + (", one at least" if any(isinstance(m, MinLen) for m in field.metadata) else "")
    if str in kinds:
        return "text"
    noun = "a whole number" if int in kinds else "a number"
    limits = " and ".join(_limits(field.metadata))
    return f"{noun} {limits}" if limits else noun


def _limits(metadata: Sequence[Any]) -> Iterator[str]:
    for limit in metadata:
        match limit:
            case Gt(gt=value):
                yield f"above {value}"
            case Ge(ge=value):
                yield f"at least {value}"
            case Lt(lt=value):
                yield f"below {value}"
            case Le(le=value):
                yield f"at most {value}"
            case MinLen(min_length=value):
                yield f"of at least {value} letters"
            case _:
                continue


def _nearest(keys: list[str], model: type[BaseModel]) -> str:
    places = {"": model} | {key: table for key in model.model_fields if (table := _table(model, key)) is not None}
    here = places.get(keys[0] if len(keys) == 2 else "", model)
    for name, owner in places.items():
        if keys[-1] in owner.model_fields:
            return f": it belongs in [{name}]" if name else ": it belongs above the first table"
    nearest = max(here.model_fields, key=lambda known: difflib.SequenceMatcher(None, keys[-1], known).ratio())
    return f": the nearest known one is {nearest}"
