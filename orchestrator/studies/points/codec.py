"""Dataclasses as JSON's types and a few arrays, and back again by the types of their fields."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from orchestrator.core.spelling import Text, restored, stored
from orchestrator.studies.points.store import Arrays


def plain(value: Any) -> Any:
    return _Packing().packed(value)


def packed(value: Any) -> tuple[Any, Arrays]:
    """JSON's types, and one array for each type of number; all arrays of a value stand in it one behind the other."""
    packing = _Packing()
    header = packing.packed(value)
    return header, {kind: np.concatenate(parts) for kind, parts in packing.parts.items()}


class _Packing:
    def __init__(self) -> None:
        self.parts: dict[str, list[Any]] = {}
        self._sizes: dict[str, int] = {}

    def packed(self, value: Any) -> Any:
        if isinstance(value, np.ndarray):
            kind = value.dtype.str[1:]
            self.parts.setdefault(kind, []).append(value.ravel())
            first = self._sizes.get(kind, 0)
            self._sizes[kind] = first + value.size
            return [kind, first, list(value.shape)]
        if isinstance(value, Text) and not isinstance(value, Enum):
            return stored(value)
        if isinstance(value, np.generic | Enum):
            return value.item() if isinstance(value, np.generic) else value.value
        if is_dataclass(value):
            return {one.name: self.packed(getattr(value, one.name)) for one in fields(value)}
        if isinstance(value, Mapping):
            return {key: self.packed(one) for key, one in value.items()}
        return [self.packed(one) for one in value] if isinstance(value, list | tuple) else value


def unpacked(kind: Any, value: Any, arrays: Arrays) -> Any:
    """A value of a type from what `packed` made of it.

    Raises an error of Python's own if it is none of this type: `KeyError`, `TypeError`, `ValueError` or `IndexError`.
    """
    origin, of = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        known = [one for one in of if one is not NoneType]
        return value if value is None or len(known) > 1 else unpacked(known[0], value, arrays)
    if origin is np.ndarray:
        name, first, shape = value
        return arrays[name][first : first + int(np.prod(shape))].reshape(shape)
    if kind is str and isinstance(value, list):
        return restored(value)
    if is_dataclass(kind):
        types: dict[str, Any] = _types(kind)  # type: ignore[arg-type]
        if set(types) != set(value):
            raise ValueError(f"{kind} has other fields")
        return kind(**{name: unpacked(types[name], one, arrays) for name, one in value.items()})  # type: ignore[operator]
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    if origin is tuple:
        kinds = [of[0]] * len(value) if of[1:] == (...,) else of
        return tuple(unpacked(one, each, arrays) for one, each in zip(kinds, value, strict=True))
    if origin is dict:
        return {key: unpacked(of[1], one, arrays) for key, one in value.items()}
    return [unpacked(of[0], one, arrays) for one in value] if origin is list else value


@cache
def _types(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {one.name: hints[one.name] for one in fields(kind)}
