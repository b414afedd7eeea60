"""A MATPOWER case (.m) is a program: its tables, and the statements that change them, are carried out in order.

What is understood: assignments to ``mpc``, to parts of its tables and to variables, arithmetic, MATPOWER's names of
columns, and ``if`` with a condition that is known. A statement that is not understood is refused by its line if it
could change what gfor reads; a field that gfor does not read may hold what it likes.

Source of the names of columns: MATPOWER's manual, appendix on the case format."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orchestrator.cases.networks.matpower.expressions import (
    UnknownError,
    Value,
    indices_of,
    value_of,
)
from orchestrator.cases.networks.matpower.statements import Statement, UnendedError, statements
from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_text, visible

READ = ("baseMVA", "bus", "branch", "gen")
"""Fields of a case that gfor reads."""

_COLUMNS = {
    "idx_bus": "PQ PV REF NONE BUS_I BUS_TYPE PD QD GS BS BUS_AREA VM VA BASE_KV ZONE VMAX VMIN LAM_P LAM_Q MU_VMAX "
    "MU_VMIN",
    "idx_brch": "F_BUS T_BUS BR_R BR_X BR_B RATE_A RATE_B RATE_C TAP SHIFT BR_STATUS PF QF PT QT MU_SF MU_ST ANGMIN "
    "ANGMAX MU_ANGMIN MU_ANGMAX",
    "idx_gen": "GEN_BUS PG QG QMAX QMIN VG MBASE GEN_STATUS PMAX PMIN MU_PMAX MU_PMIN MU_QMAX MU_QMIN PC1 PC2 QC1MIN "
    "QC1MAX QC2MIN QC2MAX RAMP_AGC RAMP_10 RAMP_30 RAMP_Q APF",
    "idx_cost": "PW_LINEAR POLYNOMIAL MODEL STARTUP SHUTDOWN NCOST COST",
}
"""Names that each of MATPOWER's functions of columns gives, in the order of its results."""

_WHERE = {
    "idx_bus": (1, 2, 3, 4, *range(1, 18)),
    "idx_brch": (*range(1, 12), *range(14, 20), 12, 13, 20, 21),
    "idx_gen": (*range(1, 11), *range(22, 26), *range(11, 22)),
    "idx_cost": (1, 2, 1, 2, 3, 4, 5),
}
_ASSIGNMENT = re.compile(
    r"(?P<name>[A-Za-z_]\w*(?:\.\w+)*)\s*(?P<part>\(.*?\))?\s*=(?!=)\s*(?P<value>.*)", re.DOTALL
)
_SEVERAL = re.compile(r"\[(?P<names>[^\]]*)\]\s*=(?!=)\s*(?P<value>.*)", re.DOTALL)
_FUNCTION = re.compile(r"function\b\s*(?:(?P<given>\[[^\]]*\]|\w+)\s*=)?\s*\w+\s*(?:\(\s*\))?")
_HARMLESS = re.compile(
    r"(return|end|endfunction|clc|format\b.*|(disp|fprintf|printf|warning)\s*\(.*\))", re.DOTALL
)
NAMES = ("bus_name", "branch_name", "gen_name")
"""Fields with the names of the rows of ``bus``, ``branch`` and ``gen``."""

_CELL = re.compile(r"""'((?:[^'\n]|'')*)'|"([^"\n]*)\"""")
_MOST_SHOWN = 80  # characters of a statement in a message


@dataclass(frozen=True)
class CaseProgram:
    """Tables that a case's program leaves, by the fields that gfor reads, and names of their rows where it has them."""

    tables: Mapping[str, Value]
    names: Mapping[str, tuple[str, ...]]


def case_tables(path: Path) -> CaseProgram:
    """Return what a case's program leaves in the fields that gfor reads; one that it lacks is not there.

    Raises `InputError` with the line of the first statement that is not understood."""
    source = visible(read_text(path, errors="replace"))
    program = _Program(str(path))
    try:
        for statement in statements(source):
            program.carry_out(statement)
    except UnendedError as error:
        raise InputError.at(
            f"{path}, line {error.line}", f"{error}; the file is cut short"
        ) from error
    return CaseProgram(program.tables, program.names)


class _Program:
    def __init__(self, name: str) -> None:
        self._name = name
        self._case = "mpc"
        self._results: tuple[str, ...] = ()  # of a function that gives its tables one by one
        self._values: dict[str, Value] = {}
        self._texts: dict[str, tuple[str, ...]] = {}  # cells of the fields that name rows
        # of each `if` that is open: whether its branch is carried out, and whether one of them was
        self._branches: list[tuple[bool, bool]] = []

    @property
    def tables(self) -> dict[str, Value]:
        names = {field: field if self._results else f"{self._case}.{field}" for field in READ}
        return {field: self._values[name] for field, name in names.items() if name in self._values}

    @property
    def names(self) -> dict[str, tuple[str, ...]]:
        """Return names of rows by field: ``bus_name``, ``branch_name``, ``gen_name``."""
        keys = {field: field if self._results else f"{self._case}.{field}" for field in NAMES}
        return {field: self._texts[key] for field, key in keys.items() if key in self._texts}

    def carry_out(self, statement: Statement) -> None:
        try:
            if not self._is_branching(statement.text) and all(on for on, _ in self._branches):
                self._carry_out(statement)
        except UnknownError as error:
            shown = " ".join(statement.text.split())
            shown = shown if len(shown) <= _MOST_SHOWN else f"{shown[:_MOST_SHOWN]} …"
            raise InputError.at(
                f"{self._name}, line {statement.line}",
                f"the statement {shown!r} is not carried out: {error}; a MATPOWER case is a "
                "program, and what it does to the tables counts: run it in MATPOWER or "
                "Octave, and save the result with savecase",
            ) from error

    def _is_branching(self, text: str) -> bool:
        """Return whether a statement is a part of an ``if``, which is then followed."""
        word, _, condition = text.partition(" ")
        if word.startswith("if("):
            word, condition = "if", text[2:]
        if word == "if":
            known = all(on for on, _ in self._branches)
            on = known and self._is_true(condition)
            self._branches.append((on, on))
        elif word == "elseif" and self._branches:
            _, done = self._branches.pop()
            on = not done and all(on for on, _ in self._branches) and self._is_true(condition)
            self._branches.append((on, done or on))
        elif word == "else" and self._branches:
            _, done = self._branches.pop()
            self._branches.append((not done, True))
        elif word in ("end", "endif") and self._branches:
            self._branches.pop()
        else:
            return False
        return True

    def _is_true(self, condition: str) -> bool:
        value = value_of(condition.strip(), self._values)
        return isinstance(value, np.ndarray) and value.size > 0 and bool(np.all(value != 0))

    def _carry_out(self, statement: Statement) -> None:
        text = statement.text
        if text.startswith("function"):
            self._begin(text)
        elif text in ("define_constants", "define_constants()"):
            for function in _COLUMNS:
                self._values |= _columns(function)
        elif (several := _SEVERAL.fullmatch(text)) is not None:
            self._name_columns(several["names"], several["value"].strip())
        elif (one := _ASSIGNMENT.fullmatch(text)) is not None:
            self._assign(one["name"], (one["part"] or "")[1:-1], one["value"], statement.line)
        elif not _HARMLESS.fullmatch(text):
            raise UnknownError("only assignments to the case and to variables are understood")

    def _begin(self, text: str) -> None:
        found = _FUNCTION.fullmatch(text)
        if found is None or not found["given"] or self._values:
            raise UnknownError("a case is one function without arguments that gives its tables")
        if found["given"].startswith("["):
            self._results = tuple(re.findall(r"\w+", found["given"]))
        else:
            self._case = found["given"]

    def _name_columns(self, names: str, function: str) -> None:
        if function not in _COLUMNS:
            raise UnknownError(
                f"of functions with several results only {', '.join(_COLUMNS)} are known"
            )
        places = [float(place) for place in _WHERE[function]]
        given = re.findall(r"[\w~]+", names)
        if len(given) > len(places):
            raise UnknownError(f"{function} has {len(places)} results, and {len(given)} are named")
        for name, place in zip(given, places, strict=False):
            if name != "~":
                self._values[name] = np.array([[place]])

    def _counts(self, name: str) -> bool:
        """Return whether a name is of the case as a whole or of a field that gfor reads."""
        fields = READ if self._results else (self._case, *(f"{self._case}.{f}" for f in READ))
        return name in fields

    def _assign(self, name: str, part: str, text: str, line: int) -> None:
        if name.rpartition(".")[2] in NAMES:
            cells = text.startswith("{") and not part
            self._texts[name] = tuple(_texts_in(text)) if cells else ()
            return
        try:
            if name == self._case and not self._results and re.fullmatch(r"struct\(\s*\)", text):
                return
            value = value_of(text, self._values)
            if part:
                value = self._with_part(name, part, value)
            elif name == self._case:
                raise UnknownError("it replaces the whole case")
            self._values[name] = value
        except UnknownError as error:
            if self._counts(name):
                raise
            self._values[name] = UnknownError(f"{name!r} comes from line {line}: {error}")

    def _with_part(self, name: str, part: str, value: Value) -> Value:
        table = self._values.get(name)
        if isinstance(table, UnknownError):
            raise table
        if not isinstance(table, np.ndarray) or not isinstance(value, np.ndarray):
            raise UnknownError(f"{name!r} is no table of numbers")
        where, table = indices_of(part, self._values, table), table.copy()
        try:
            if len(where) == 2:
                table[np.ix_(*where)] = value
            else:
                flat = table.T.ravel()
                flat[where[0]] = value.T.ravel()
                table = flat.reshape(table.T.shape).T
        except (IndexError, ValueError) as error:
            raise UnknownError("what is assigned does not fit the part of the table") from error
        return table


def _texts_in(cells: str) -> Iterator[str]:
    """Yield the texts of a cell array, ``{'WEST 7'; 'O''NEILL'}``."""
    for found in _CELL.finditer(cells):
        yield (found[1] if found[1] is not None else found[2]).replace("''", "'").strip()


def _columns(function: str) -> dict[str, Value]:
    names: Iterable[str] = _COLUMNS[function].split()
    return {
        name: np.array([[float(place)]])
        for name, place in zip(names, _WHERE[function], strict=True)
    }
