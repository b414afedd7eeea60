"""The text of a pandapower network in JSON, without anything that a reader would run.

`pandapower.to_json` writes objects as a module, a class and what the class is made from, and `from_json` imports that
module and calls that class. Versions before 3.5.4 call whatever a file names, a shell among it; later ones still import
every module that it names. So what pandapower reads is written anew here, from values and from the few classes of
`_CLASSES`. Its minimum version is not raised instead: 3.5.4 needs a pandas that other libraries do not take."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError

_NUMPY: tuple[str, ...] = (
    "array",
    "bool",
    "bool_",
    "complex64",
    "complex128",
    "float16",
    "float32",
    "float64",
)
_NUMPY += tuple(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64))
_INDICES = {"base": "Index", "range": "RangeIndex", "multi": "MultiIndex"}
_CURVES = ("Characteristic", "SplineCharacteristic", "LogSplineCharacteristic")

_TABLES = {
    ("pandas", "DataFrame"),
    ("pandas", "Series"),
    ("pandas.core.frame", "DataFrame"),
    ("pandas.core.series", "Series"),
}
_NETWORK = ("pandapower.auxiliary", "pandapowerNet")
_OBJECTS = {("pandapower.control.util.characteristic", name) for name in _CURVES}
_CLASSES = {_NETWORK, ("networkx", "MultiGraph"), *_TABLES, *_OBJECTS}
_CLASSES |= {("numpy", name) for name in _NUMPY}
_CLASSES |= {("builtins", name) for name in ("complex", "tuple", "set", "frozenset")}
_CLASSES |= {(f"pandas.core.indexes.{module}", name) for module, name in _INDICES.items()}
"""Module and class of what a power flow needs; each holds values alone."""

_OF_A_TABLE = {"_module", "_class", "_object", "orient", "dtype", "typ"}
_OF_A_TABLE |= {"is_multiindex", "is_multicolumn", "index_name", "index_names"}
_OF_A_TABLE |= {"column_name", "column_names"}

UNUSED = ("controller", "protection", "bus_geodata", "line_geodata")
"""Tables that no power flow reads; they are left out if they hold objects of other classes."""


class _ForeignClassError(ValueError):
    pass


def network_text(path: Path, content: bytes) -> str:
    """Return what `pandapower.from_json_string` may read of a file.

    Raises an `InputError` if the file is no JSON, or names a class that is none of a network's values."""
    try:
        return json.dumps(_plain(json.loads(content)))
    except _ForeignClassError as error:
        raise InputError.at(
            f"{path}",
            f"it names {error}, which pandapower would import and call; gfor reads the "
            "tables of a network and runs no code of a file: remove that object, and "
            "save the network again",
        ) from error
    except RecursionError as error:
        raise InputError.at(
            f"{path}",
            "its brackets nest too deeply for a network; save one with pandapower.to_json",
        ) from error
    except ValueError as error:
        raise InputError.at(
            f"{path}", f"it is no network saved with pandapower.to_json: {error}"
        ) from error


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(one) for one in value]
    if not isinstance(value, dict):
        return value
    if "_module" in value or "_class" in value:
        return _plain_object(value)
    return {name: _plain(one) for name, one in value.items()}


def _plain_object(value: Mapping[str, Any]) -> dict[str, Any]:
    module, name = value.get("_module"), value.get("_class")
    named = (module, name)
    if not (isinstance(module, str) and isinstance(name, str)) or named not in _CLASSES:
        raise _ForeignClassError(f"the class {name!r} of the module {module!r}")
    inner = value.get("_object")
    if named == _NETWORK and isinstance(inner, dict):
        inner = _without_unused(inner)
    more = sorted(set(value) - _OF_A_TABLE)
    if named in _TABLES and more:
        raise ValueError(f"a table has the key {more[0]!r}")
    plain = {key: _plain(one) for key, one in value.items() if key != "_object"}
    if "_object" in value:
        if isinstance(inner, str) and (named == _NETWORK or named in _TABLES | _OBJECTS):
            plain["_object"] = json.dumps(_plain(json.loads(inner)))
        else:
            plain["_object"] = _plain(inner)
    return plain


def _without_unused(tables: dict[str, Any]) -> dict[str, Any]:
    kept = dict(tables)
    for name in UNUSED:
        try:
            _plain(kept.get(name))
        except _ForeignClassError:
            del kept[name]
    return kept
