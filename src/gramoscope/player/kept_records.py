"""Records as bytes and back, exactly: what a passage taught is kept this way while the passage is played.

Dataclasses, tuples, mappings, numbers, texts and arrays become a line of JSON, with the arrays behind it. They are read back
by the types that the record declares; nothing in the bytes says what to run, so that a file from anywhere is harmless.
"""

from __future__ import annotations

import json
import types
import zlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

Record = TypeVar("Record")


class DamagedRecordError(ValueError):
    """Bytes that are not what was written."""


def bytes_of(record: object) -> bytes:
    """Return a dataclass as bytes.

    Parameters
    ----------
    record : dataclass
        Of numbers, texts, None, NumPy arrays and scalars, and of tuples, mappings and dataclasses of these.
    """
    arrays: list[bytes] = []
    tree = json.dumps(_tree(record, arrays))
    payload = b"".join(arrays)
    head = json.dumps({"crc32": zlib.crc32(payload), "bytes": len(payload), "record": tree}).encode()
    return head + b"\n" + payload


def record_of(data: bytes, kind: type[Record]) -> Record:
    """Return the record that was made into bytes.

    Parameters
    ----------
    data : bytes
    kind : type
        What it was.

    Raises
    ------
    DamagedRecordError
        If the bytes were cut off or changed, or are of another kind.
    """
    head, _, payload = data.partition(b"\n")
    try:
        said = json.loads(head)
        payload = payload[: said["bytes"]]
        if len(payload) != said["bytes"] or zlib.crc32(payload) != said["crc32"]:
            raise DamagedRecordError("the bytes are not those that were written")
        record: Record = _value(kind, json.loads(said["record"]), payload)
    except (KeyError, TypeError, ValueError) as error:
        raise DamagedRecordError(f"the record cannot be read: {error}") from error
    return record


def _tree(value: Any, arrays: list[bytes]) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return _placed(np.asarray(value), arrays)
    if is_dataclass(value):
        return {one.name: _tree(getattr(value, one.name), arrays) for one in fields(value)}
    if isinstance(value, Mapping):
        return [[_tree(key, arrays), _tree(one, arrays)] for key, one in value.items()]
    if isinstance(value, tuple):
        return [_tree(one, arrays) for one in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"a {type(value).__name__} in a record")


def _placed(array: Any, arrays: list[bytes]) -> dict[str, Any]:
    start = sum(len(one) for one in arrays)
    arrays.append(array.tobytes())
    return {"dtype": array.dtype.str, "shape": array.shape, "start": start}


def _value(kind: Any, node: Any, payload: bytes) -> Any:
    if isinstance(node, dict) and set(node) == {"dtype", "shape", "start"}:
        return _array(node, payload)
    if is_dataclass(kind) and isinstance(kind, type):
        hints = get_type_hints(kind)
        return kind(**{one.name: _value(hints[one.name], node[one.name], payload) for one in fields(kind)})
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        (left,) = (one for one in inner if one is not types.NoneType)
        return None if node is None else _value(left, node, payload)
    if origin is tuple:
        of = inner[:1] * len(node) if inner[-1] is Ellipsis else inner
        return tuple(_value(one, part, payload) for one, part in zip(of, node, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {_value(inner[0], key, payload): _value(inner[1], one, payload) for key, one in node}
    return node


def _array(node: Mapping[str, Any], payload: bytes) -> Any:
    """Return an array of its own, or the scalar that it was: kernels compile anew for what may not be written."""
    dtype, shape = np.dtype(node["dtype"]), tuple(node["shape"])
    array = np.frombuffer(payload, dtype, count=int(np.prod(shape)), offset=node["start"]).reshape(shape).copy()
    return array if shape else array[()]
