"""Files of a network that `gfor new` is given, by the key of the case that names each."""

from collections.abc import Sequence
from pathlib import Path

from orchestrator.cases.form.csv_rows import rows_of
from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import InputError

_TABLES = {
    "lines_file": ("from", "to"),
    "units": ("bus", "rating_mva"),
    "loads_file": ("bus", "p_mw"),
    "buses": ("bus",),
}
"""What a table of a plain network is → the columns that tell it."""

_FILES = {
    ".raw": "raw",
    ".rawx": "raw",
    ".m": "matpower",
    ".mat": "matpower",
    ".json": "pandapower",
    ".zip": "cgmes",
}

_BESIDE = {".dyr": "dyr", ".seq": "seq"}
"""Files that go with a RAW file: dynamics data, and those of the negative and the zero sequence."""


def sources_of(files: Sequence[Path]) -> dict[str, Path]:
    """Key of the case file that names it → file."""
    found: dict[str, Path] = {}
    beside = {*_BESIDE.values()}
    for path in files:
        suffix = path.suffix.lower()
        known = ", ".join([*_FILES, *_BESIDE, ".csv"])
        if not path.is_dir() and suffix not in (*_FILES, *_BESIDE, ".csv"):
            raise InputError(
                f"{path}: no network that is read; give a file {known}, or the folder of a CGMES model"
            )
        if not path.exists():
            near = close_names(path.name, [p.name for p in path.absolute().parent.glob("*")])
            raise InputError(f"{path}: there is no such file{f'; {near}' if near else ''}")
        key = _key_of(path)
        pairs = ((k, {k, key}) for k in found)
        others = [k for k, pair in pairs if not (pair & beside or pair <= {*_TABLES})]
        if key in found or others:
            raise InputError(
                f"{path} and {found.get(key) or found[others[0]]}: a case has one of them; give one"
            )
        found[key] = path
    if not found.keys() - beside:
        raise InputError("no network is given; name its file, such as own.raw, and with it own.dyr")
    lacks = [key for key in ("lines_file", "units") if key not in found]
    if {*found} & {*_TABLES} and lacks:
        wanted = " and ".join(f"one with the columns {', '.join(_TABLES[key])}" for key in lacks)
        raise InputError(
            f"{', '.join(map(str, found.values()))}: of the tables of a network, {wanted} is missing"
        )
    for key, what in (("dyr", "dynamics"), ("seq", "sequence")):
        if key in found and "raw" not in found:
            raise InputError(
                f"{found[key]}: {what} data of PSS/E need the network's RAW file; give both"
            )
    return found


def _key_of(path: Path) -> str:
    """Return the key of the case file that names a file."""
    suffix = path.suffix.lower()
    if path.is_dir():
        return "cgmes"
    return _BESIDE.get(suffix) or _FILES.get(suffix) or _table_of(path)


def _table_of(path: Path) -> str:
    columns = {*next(iter(rows_of(path, ())), ())}
    key = next((key for key, wanted in _TABLES.items() if columns >= {*wanted}), None)
    if key is None:
        kinds = "; ".join(", ".join(wanted) for wanted in _TABLES.values())
        raise InputError(
            f"{path}: no table of a network: none has its columns in line 1, or it has no row ({kinds})"
        )
    return key
