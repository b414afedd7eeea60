"""Records of PSS/E's power flow data in JSON (RAWX), as those of a RAW file of revision 35.

A table names its fields, in any order and as many as it likes; here each goes to its place in the record of a RAW file,
and what is absent is a default, as there. Source: the examples of RAWX that PowSyBl publishes."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.cases.networks.psse.raw_records import RawFile, Record
from orchestrator.core.errors import InputError

REVISION = 35  # whose records the tables are put into; RAWX began with it
_RATINGS = 12  # of a branch or a winding
_VALUES_OF_GNE = 10  # of each kind of a GNE
_SHUNT_BLOCKS = 8  # of a switched shunt
_MOST_WINDINGS = 3  # of a transformer

_BLANKS = " \t\r\n"
_JSON = json.JSONDecoder()


def _numbered(name: str, most: int) -> tuple[str, ...]:
    return tuple(f"{name}{k}" for k in range(1, most + 1))


def _winding(k: int) -> tuple[str, ...]:
    """Fields of a winding's line of a transformer."""
    control = ("cod", "cont", "node", "rma", "rmi", "vma", "vmi", "ntp", "tab", "cr", "cx", "cnxa")
    return (
        f"windv{k}",
        f"nomv{k}",
        f"ang{k}",
        *_numbered(f"wdg{k}rate", _RATINGS),
        *(f"{name}{k}" for name in control),
    )


def _converter(end: str) -> tuple[str, ...]:
    """Fields of the line of one end of a two-terminal DC line."""
    names = ("ip", "nb", "anmx", "anmn", "rc", "xc", "ebas", "tr", "tap", "tmx", "tmn", "stp")
    more = ("ic", "nd", "if", "it", "id", "xcap")
    return tuple(f"{name}{end}" for name in (*names, *more))


def _vsc(k: int) -> tuple[str, ...]:
    """Fields of the line of one end of a DC line with voltage source converters."""
    names = ("ibus", "type", "mode", "dcset", "acset", "aloss", "bloss", "minloss", "smax", "imax")
    more = ("pwf", "maxq", "minq", "vsreg", "nreg", "rmpct")
    return tuple(f"{name}{k}" for name in (*names, *more))


_OWNERS = tuple(f"{letter}{k}" for k in range(1, 5) for letter in "of")
_BLOCKS = tuple(f"{letter}{k}" for k in range(1, _SHUNT_BLOCKS + 1) for letter in "snb")

_TRANSFORMER_HEAD = (
    *("ibus", "jbus", "kbus", "ckt", "cw", "cz", "cm", "mag1", "mag2", "nmet", "name", "stat"),
    *_OWNERS,
    *("vecgrp", "zcod"),
)
_TRANSFORMER_IMPEDANCES = (
    *("r1_2", "x1_2", "sbase1_2", "r2_3", "x2_3", "sbase2_3", "r3_1", "x3_1", "sbase3_1"),
    *("vmstar", "anstar"),
)

_LAYOUTS: Mapping[str, tuple[str, tuple[tuple[str, ...], ...]]] = {
    "bus": (
        "bus",
        (
            (
                *("ibus", "name", "baskv", "ide", "area", "zone", "owner", "vm", "va"),
                *("nvhi", "nvlo", "evhi", "evlo"),
            ),
        ),
    ),
    "load": (
        "load",
        (
            (
                *("ibus", "loadid", "stat", "area", "zone", "pl", "ql", "ip", "iq", "yp", "yq"),
                *("owner", "scale", "intrpt", "dgenp", "dgenq", "dgenm", "loadtype"),
            ),
        ),
    ),
    "fixshunt": ("fixed shunt", (("ibus", "shntid", "stat", "gl", "bl"),)),
    "generator": (
        "generator",
        (
            (
                *("ibus", "machid", "pg", "qg", "qt", "qb", "vs", "ireg", "nreg", "mbase"),
                *("zr", "zx", "rt", "xt", "gtap", "stat", "rmpct", "pt", "pb", "baslod"),
                *_OWNERS,
                *("wmod", "wpf"),
            ),
        ),
    ),
    "acline": (
        "branch",
        (
            (
                *("ibus", "jbus", "ckt", "rpu", "xpu", "bpu", "name"),
                *_numbered("rate", _RATINGS),
                *("gi", "bi", "gj", "bj", "stat", "met", "len"),
                *_OWNERS,
            ),
        ),
    ),
    "sysswd": (
        "system switching device",
        (
            (
                *("ibus", "jbus", "ckt", "xpu"),
                *_numbered("rate", _RATINGS),
                *("stat", "nstat", "met", "stype", "name"),
            ),
        ),
    ),
    "swshunt": (
        "switched shunt",
        (
            (
                *("ibus", "shntid", "modsw", "adjm", "stat", "vswhi", "vswlo", "swreg", "nreg"),
                *("rmpct", "rmidnt", "binit"),
                *_BLOCKS,
            ),
        ),
    ),
    "area": ("area", (("iarea", "isw", "pdes", "ptol", "arname"),)),
    "twotermdc": (
        "two-terminal dc",
        (
            (
                *("name", "mdc", "rdc", "setvl", "vschd", "vcmod", "rcomp", "delti", "met"),
                *("dcvmin", "cccitmx", "cccacc"),
            ),
            _converter("r"),
            _converter("i"),
        ),
    ),
    "vscdc": ("vsc dc line", (("name", "mdc", "rdc", *_OWNERS), _vsc(1), _vsc(2))),
    "facts": (
        "facts device",
        (
            (
                *("name", "ibus", "jbus", "mode", "pdes", "qdes", "vset", "shmx", "trmx", "vtmn"),
                *("vtmx", "vsmx", "imx", "linx", "rmpct", "owner", "set1", "set2", "vsref"),
                *("fcreg", "nreg", "mname"),
            ),
        ),
    ),
    "indmach": (
        "induction machine",
        (
            (
                *("ibus", "imid", "stat", "sc", "dc", "area", "zone", "owner", "tc", "bc"),
                *("mbase", "ratekv", "pcode", "pset", "hconst", "aconst", "bconst", "dconst"),
                *("econst", "ra", "xa", "xm", "r1", "x1", "r2", "x2", "x3", "e1", "se1", "e2"),
                *("se2", "ia1", "ia2", "xamult"),
            ),
        ),
    ),
}
"""Table of RAWX → section of RAW, and the fields of each line of a record, in RAW's order."""

_MULTI_TERMINAL = {
    "ntermdc": ("nconv", "ndcbs", "ndcln", "mdc", "vconv", "vcmod", "vconvn"),
    "ntermdcconv": (
        *("ib", "n", "angmx", "angmn", "rc", "xc", "ebas", "tr", "tap", "tpmx", "tpmn", "tstp"),
        *("setvl", "dcpf", "marg", "cnvcod"),
    ),
    "ntermdcbus": ("idc", "ib", "area", "zone", "dcname", "idc2", "rgrnd", "owner"),
    "ntermdclink": ("idc", "jdc", "dcckt", "met", "rdc", "ldc"),
}
"""Tables of multi-terminal DC networks, each with the network's name first, and their fields in RAW's order."""

_END_OF_CORRECTIONS = ("0", "0", "0")  # behind the last point of a table in a RAW file

_SYNONYMS = {"scode": "sc", "dcode": "dc", "tcode": "tc", "bcode": "bc", "nbrdg": "n"}

_WITHOUT_EFFECT = {
    "zone": "zone",
    "owner": "owner",
    "iatrans": "inter-area transfer",
    "iatransfer": "inter-area transfer",
    "msline": "multi-section line",
    "sub": "substation",
    "subnode": "substation",
    "subswd": "substation",
    "subterm": "substation",
    "voltagedroop": "voltage droop control",
    "swdratnam": "switching device rating set",
    "swdratset": "switching device rating set",
    "loadtype": "load type",
    "interface": "interface",
    "itfelmt": "interface element",
}
"""Table of RAWX → section of RAW, where nothing reads the fields."""

_READ = {"caseid", "general", "transformer", "impcor", *_LAYOUTS}
"""Tables whose values have a meaning here; only in them a row must fit its fields."""

_SOLUTION = {"gauss", "newton", "adjust", "tysl", "solver", "rating"}
"""Settings of a solution in PSS/E."""


@dataclass(frozen=True)
class _Table:
    """A table of RAWX: its name, its fields, and its rows, each with the line of the file where it begins."""

    name: str
    fields: tuple[str, ...]
    rows: tuple[tuple[int, tuple[str, ...]], ...]


def read_rawx(path: Path, text: str) -> RawFile:
    """The records of a RAWX file.

    Raises
    ------
    InputError
        If the text is no JSON, has no ``network``, or has a table without ``fields`` and ``data``.
    """
    tables = {table.name: table for table in _tables(path, text)}
    head = _head(path, tables)
    base = head.number(1, "the system base sbase [MVA]", 100.0)
    if not base > 0:
        raise head.error(f"the system base sbase is {base:g} MVA; it must exceed 0")
    frequency = head.number(2, "the frequency basfrq [Hz]", 0.0)
    sections: dict[str, list[Record]] = {}
    for table in tables.values():
        for section, records in _records(path, table):
            sections.setdefault(section, []).extend(records)
    sections |= _multi_terminal(path, tables) | _corrections(path, tables)
    if "bus" not in sections:
        raise InputError.at(f"{path}", "network.bus has no rows; export the case once more")
    return RawFile(str(path), REVISION, base, frequency or None, sections)


def _head(path: Path, tables: Mapping[str, _Table]) -> Record:
    """Return what the file says of the case: IC, system base and frequency."""
    table = tables.get("caseid", _Table("caseid", (), ((1, ()),)))
    line, row = table.rows[0] if table.rows else (1, ())
    given = dict(zip(table.fields, row, strict=False))
    return Record(str(path), line, [given.get(name, "") for name in ("ic", "sbase", "basfrq")])


def _records(path: Path, table: _Table) -> Iterator[tuple[str, list[Record]]]:
    """The section of a table, and its rows as the lines of that section's records."""
    place = str(path)
    if table.name == "transformer":
        rows = [(line, _by_field(table, row)) for line, row in table.rows]
        lines = [
            Record(place, line, record)
            for line, given in rows
            for record in _transformer_lines(given)
        ]
        yield "transformer", lines
    elif table.name in _LAYOUTS:
        section, layout = _LAYOUTS[table.name]
        for line, row in table.rows:
            given = _by_field(table, row)
            yield section, [Record(place, line, _in_order(given, fields)) for fields in layout]
    elif table.name == "general":
        for line, row in table.rows:
            settings = [f"{name.upper()}={value}" for name, value in _by_field(table, row).items()]
            yield "system-wide", [Record(place, line, ["GENERAL", *settings])]
    elif table.name == "gne":
        yield "gne", [line for row in table.rows for line in _gne_lines(place, table, row)]
    elif table.name not in {"caseid", "impcor", *_SOLUTION, *_MULTI_TERMINAL}:
        section = _WITHOUT_EFFECT.get(table.name, table.name)
        yield section, [Record(place, line, row) for line, row in table.rows]


def _multi_terminal(path: Path, tables: Mapping[str, _Table]) -> dict[str, list[Record]]:
    """Return the lines of multi-terminal DC networks: each network, then its converters, DC buses and links."""
    rows = {
        name: [(line, _by_field(tables[name], row)) for line, row in tables[name].rows]
        for name in _MULTI_TERMINAL
        if name in tables
    }
    records = []
    for line, head in rows.get("ntermdc", []):
        own = head.get("name", "")
        fields = _in_order(head, _MULTI_TERMINAL["ntermdc"])
        records.append(Record(str(path), line, [own, *fields]))
        for table in ("ntermdcconv", "ntermdcbus", "ntermdclink"):
            records += [
                Record(str(path), at, _in_order(given, _MULTI_TERMINAL[table]))
                for at, given in rows.get(table, [])
                if given.get("name", "") == own
            ]
    return {"multi-terminal dc": records} if records else {}


def _corrections(path: Path, tables: Mapping[str, _Table]) -> dict[str, list[Record]]:
    """Return the impedance correction tables, whose points are rows here; in a RAW file each table is a record."""
    table = tables.get("impcor", _Table("impcor", (), ()))
    points: dict[str, list[str]] = {}
    lines: dict[str, int] = {}
    for line, row in table.rows:
        number, *point = _in_order(_by_field(table, row), ("itable", "tap", "refact", "imfact"))
        lines.setdefault(number, line)
        points.setdefault(number, []).extend(point)
    records = [
        Record(str(path), lines[number], [number, *found, *_END_OF_CORRECTIONS])
        for number, found in points.items()
    ]
    return {"impedance correction": records} if records else {}


def _gne_lines(place: str, table: _Table, row: tuple[int, tuple[str, ...]]) -> Iterator[Record]:
    """Yield the lines of a GNE in a RAW file: its head, then a line for each kind of values that it has."""
    line, values = row
    given = _by_field(table, values)
    count = given.get("nterm", "")
    buses = _numbered("bus", int(count) if count.isdigit() else 0)
    head = ("name", "model", "nterm", *buses, "nreal", "nintg", "nchar", "stat", "owner", "nmet")
    yield Record(place, line, _in_order(given, head))
    for name, kind in (("nreal", "real"), ("nintg", "intg"), ("nchar", "char")):
        if given.get(name, "0") not in ("", "0"):
            yield Record(place, line, _in_order(given, _numbered(kind, _VALUES_OF_GNE)))


def _by_field(table: _Table, row: Sequence[str]) -> dict[str, str]:
    return dict(zip(table.fields, row, strict=False))


def _in_order(given: Mapping[str, str], fields: Sequence[str]) -> list[str]:
    return [given.get(name, "") for name in fields]


def _transformer_lines(given: Mapping[str, str]) -> list[list[str]]:
    """The four or five lines of a transformer in a RAW file."""
    three = given.get("kbus", "") not in ("", "0")
    windings = [_in_order(given, _winding(k)) for k in range(1, _MOST_WINDINGS + three)]
    return [
        _in_order(given, _TRANSFORMER_HEAD),
        _in_order(given, _TRANSFORMER_IMPEDANCES),
        *windings,
    ]


def _tables(path: Path, text: str) -> Iterator[_Table]:
    """The tables of a file's network.

    The text is walked through rather than decoded at once, so that each row knows its line."""
    try:
        whole = _JSON.decode(text)
    except (ValueError, RecursionError) as error:
        raise InputError.at(
            f"{path}", f"it is no JSON: {error}; export the case from PSS/E once more"
        ) from error
    network = whole.get("network") if isinstance(whole, dict) else None
    if not isinstance(network, dict):
        raise InputError.at(f"{path}", "it has no 'network', so it is no RAWX file of PSS/E")
    at = dict(_members(text, _skip(text, 0)))["network"]
    lines = _Lines(text)
    for name, start in _members(text, at):
        table = network[name]
        if not (
            isinstance(table, dict) and isinstance(table.get("fields"), list) and "data" in table
        ):
            raise InputError.at(
                f"{path}, line {lines.of(start)}",
                f"network.{name} lacks 'fields' or 'data'; export the case once more",
            )
        fields = tuple(_field(name) for name in table["fields"])
        data = dict(_members(text, start))["data"]
        rows = _rows(path, name, text, data, lines)
        if name.lower() in _READ:
            rows = _fitting(path, name, fields, rows)
        yield _Table(name.lower(), fields, tuple(rows))


def _field(name: Any) -> str:
    lower = str(name).lower()
    return _SYNONYMS.get(lower, lower)


def _fitting(
    path: Path, name: str, fields: Sequence[str], rows: Iterator[tuple[int, tuple[str, ...]]]
) -> Iterator[tuple[int, tuple[str, ...]]]:
    """The rows, none of which has more values than the table has fields."""
    for line, row in rows:
        if len(row) > len(fields):
            raise InputError.at(
                f"{path}, line {line}",
                f"a row of network.{name} has {len(row)} values for {len(fields)} fields; "
                "export the case once more",
            )
        yield line, row


class _Lines:
    """The line of a place in a text; places are asked for in rising order."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._place = 0
        self._line = 1

    def of(self, place: int) -> int:
        """The line of a place, counted from 1."""
        self._line += self._text.count("\n", self._place, place)
        self._place = place
        return self._line


def _rows(
    path: Path, name: str, text: str, at: int, lines: _Lines
) -> Iterator[tuple[int, tuple[str, ...]]]:
    """The rows of a table's data; of a table with one row, data may be that row itself."""
    places = list(_elements(text, at))
    if places and text[places[0]] != "[":
        places = [at]
    for place in places:
        row, _ = _JSON.raw_decode(text, place)
        line = lines.of(place)
        if not isinstance(row, list):
            raise InputError.at(
                f"{path}, line {line}",
                f"a row of network.{name} is {row!r}; it must be a list of values",
            )
        yield line, tuple(map(_as_text, row))


def _as_text(value: Any) -> str:
    """A value as a field of a RAW file; null is an omitted one, and 3.0 a whole number."""
    if value is None:
        return ""
    is_whole = isinstance(value, bool) or (isinstance(value, float) and value.is_integer())
    return str(int(value)) if is_whole else str(value).strip()


def _skip(text: str, at: int) -> int:
    """The next place that is no blank."""
    while text[at] in _BLANKS:
        at += 1
    return at


def _members(text: str, at: int) -> Iterator[tuple[str, int]]:
    """Names of an object's members, and the places where their values begin."""
    at = _skip(text, at + 1)
    while text[at] != "}":
        name, at = _JSON.raw_decode(text, at)
        at = _skip(text, _skip(text, at) + 1)
        yield name, at
        _, at = _JSON.raw_decode(text, at)
        at = _skip(text, at)
        if text[at] == ",":
            at = _skip(text, at + 1)


def _elements(text: str, at: int) -> Iterator[int]:
    """The places where the elements of a list begin."""
    at = _skip(text, at + 1)
    while text[at] != "]":
        yield at
        _, at = _JSON.raw_decode(text, at)
        at = _skip(text, at)
        if text[at] == ",":
            at = _skip(text, at + 1)
