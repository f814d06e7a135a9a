"""Reports for people and machines: JSON that appears whole, without the values that JSON does not know."""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gramoscope.listening.whole_file import written_whole

# a line break stands between values only: texts hold it as \n
_LIST_OF_NUMBERS = re.compile(r'\[\n[^"\[\]{}]*\]')
_BREAK = re.compile(r"\s*\n\s*")


def plain(value: Any) -> Any:
    """Turn a value into what JSON knows.

    Parameters
    ----------
    value
        Numbers, strings, paths, None, NumPy scalars and arrays, and mappings and sequences of these.

    Returns
    -------
    None, bool, int, float, str, list or dict
        NaN and infinities become None; arrays become lists; keys become strings.

    Raises
    ------
    TypeError
        If a value is of another kind; a report that says nonsense is worse than none.
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    raise TypeError(f"a report cannot hold a {type(value).__name__}: {value!r}")


def json_text(report: Mapping[str, Any]) -> str:
    """Return a report as indented JSON in UTF-8, keys in the order given, lists of numbers in a line; values as in `plain`."""
    text = json.dumps(plain(report), indent=2, ensure_ascii=False, allow_nan=False)
    return (
        _LIST_OF_NUMBERS.sub(lambda found: _BREAK.sub(" ", found[0]).replace("[ ", "[").replace(" ]", "]"), text) + "\n"
    )


def write_json(path: str | os.PathLike[str], report: Mapping[str, Any]) -> None:
    """Write a report as a JSON file that appears whole or not at all.

    Parameters
    ----------
    path : path
        The folder must exist.
    report : mapping
        Values as in `plain`.

    Raises
    ------
    OutputError
        If the file cannot be written.
    TypeError
        If a value cannot be put into JSON.
    """
    text = json_text(report)
    with written_whole(Path(path)) as temporary:
        temporary.write_text(text, encoding="utf-8")
