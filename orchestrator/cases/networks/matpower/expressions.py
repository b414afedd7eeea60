"""Values of MATLAB's expressions: numbers, tables, indices, arithmetic and a few functions."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

Value = Any  # a table of two dimensions of numbers or truth values; text, and lists of it, as str and list


class UnknownError(ValueError):
    """An expression that is not understood."""


_TOKEN = re.compile(
    r"""(?P<blank>[ \t\n]+)
    |(?P<number>(?:\d+(?:\.(?![*/^])\d*)?|\.\d+)(?:[eEdD][+-]?\d+)?)
    |(?P<text>'(?:[^'\n]|'')*'|"[^"\n]*")
    |(?P<name>[A-Za-z_]\w*)
    |(?P<mark>\.\*|\./|\.\^|==|~=|!=|<=|>=|&&|\|\||[-+*/^<>&|~!()\[\]{},;:.'])""",
    re.VERBOSE,
)
_NUMBERS = {
    "pi": np.pi,
    "Inf": np.inf,
    "inf": np.inf,
    "NaN": np.nan,
    "nan": np.nan,
    "eps": 2.0**-52,
}
_NUMBERS |= {"true": 1.0, "false": 0.0}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "sqrt": np.sqrt,
    "abs": np.abs,
    "exp": np.exp,
    "log": np.log,
    "isinf": np.isinf,
    "isnan": np.isnan,
    "deg2rad": np.radians,
    "rad2deg": np.degrees,
}
_OTHER_FUNCTIONS = ("find", "size", "ones", "zeros", "sum")
_LEVELS: tuple[tuple[str, ...], ...] = (
    ("||", "|"),
    ("&&", "&"),
    ("<", "<=", ">", ">=", "==", "~=", "!="),
    (":",),
    ("+", "-"),
    ("*", "/", ".*", "./"),
)
"""Operators from the weakest to the strongest; signs and powers are stronger."""

_BINARY: dict[str, Callable[[Any, Any], Any]] = {
    "||": np.logical_or,
    "|": np.logical_or,
    "&&": np.logical_and,
    "&": np.logical_and,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
    "==": np.equal,
    "~=": np.not_equal,
    "!=": np.not_equal,
    "+": np.add,
    "-": np.subtract,
    ".*": np.multiply,
    "./": np.divide,
    ".^": np.power,
}


def value_of(text: str, values: Mapping[str, Value]) -> Value:
    """Value of an expression; ``values``: variables by name, with fields as ``mpc.bus``.

    Raises `UnknownError` with what is not understood."""
    table = numeric_table(text)
    if table is not None:
        return table
    reader = _Reader(text, values)
    found = reader.expression()
    reader.finish()
    return found


def indices_of(text: str, values: Mapping[str, Value], of: np.ndarray) -> list[np.ndarray]:
    """Indices from 0 of what stands in the brackets behind a table, for each of its dimensions."""
    reader = _Reader(text, values)
    found = reader.indices(of)
    reader.finish()
    return found


def numeric_table(text: str) -> np.ndarray | None:
    """A table that holds numbers alone, read fast; None if it holds more than that."""
    if not (text.startswith("[") and text.endswith("]")) or "_" in text:
        return None
    rows = [row.replace(",", " ").split() for row in re.split(r"[;\n]", text[1:-1])]
    try:
        found = [[float(word) for word in row] for row in rows if row]
    except ValueError:
        return None
    if len({len(row) for row in found}) > 1:
        raise UnknownError("the rows of a table differ in length")
    return np.array(found, dtype=float).reshape(len(found), -1 if found else 0)


class _Reader:
    def __init__(self, text: str, values: Mapping[str, Value]) -> None:
        self._values = values
        self._tokens = _tokens(text)
        self._at = 0
        self._in_table = [False]
        self._ends: list[int] = []

    # -- tokens ----------------------------------------------------------------

    def _peek(self, *, blanks: bool = False) -> tuple[str, str]:
        at = self._at
        while not blanks and at < len(self._tokens) and self._tokens[at][0] == "blank":
            at += 1
        return self._tokens[at] if at < len(self._tokens) else ("", "")

    def _next(self) -> tuple[str, str]:
        while self._at < len(self._tokens) and self._tokens[self._at][0] == "blank":
            self._at += 1
        found = self._peek()
        self._at += 1
        return found

    def _take(self, mark: str) -> bool:
        if self._peek() == ("mark", mark):
            self._next()
            return True
        return False

    def _demand(self, mark: str) -> None:
        if not self._take(mark):
            raise UnknownError(f"{self._peek()[1]!r} stands where {mark!r} should")

    def finish(self) -> None:
        if self._peek() != ("", ""):
            raise UnknownError(f"{self._peek()[1]!r} is not understood")

    def _begins_element(self) -> bool:
        """Return whether a blank in a table ends an element here: ``[1 -2]`` has two, and ``[1 - 2]`` one."""
        if not self._in_table[-1] or self._peek(blanks=True)[0] != "blank":
            return False
        rest = self._tokens[self._at + 1 : self._at + 3]
        signed = len(rest) == 2 and rest[0][1] in ("+", "-", "~") and rest[1][0] != "blank"
        return signed or (bool(rest) and rest[0][1] in ("(", "[", "{", "'"))

    # -- grammar ---------------------------------------------------------------

    def expression(self, level: int = 0) -> Value:
        if level == len(_LEVELS):
            return self._signed()
        found = self.expression(level + 1)
        parts = [found]
        while not self._begins_element() and self._peek()[1] in _LEVELS[level]:
            if self._peek()[0] != "mark" or self._colon_alone():
                break
            mark = self._next()[1]
            parts.append(self.expression(level + 1))
            if mark != ":":
                parts = [_combined(mark, parts[0], parts[1])]
        return _range(parts) if len(parts) > 1 else parts[0]

    def _colon_alone(self) -> bool:
        at = next(k for k in range(self._at, len(self._tokens)) if self._tokens[k][0] != "blank")
        after = [token for token in self._tokens[at + 1 :] if token[0] != "blank"]
        return self._tokens[at][1] == ":" and (not after or after[0][1] in (",", ")"))

    def _signed(self) -> Value:
        kind, text = self._peek()
        if kind == "mark" and text in ("+", "-", "~", "!"):
            self._next()
            value = _numeric(self._signed())
            if text in ("~", "!"):
                return value == 0
            return -value if text == "-" else value
        base = self._postfixed()
        while not self._begins_element() and self._peek() in (("mark", "^"), ("mark", ".^")):
            mark = self._next()[1]
            base = _combined(mark, base, self._power())
        return base

    def _power(self) -> Value:
        if self._take("-"):
            return -_numeric(self._power())
        return self._postfixed()

    def _postfixed(self) -> Value:
        found = self._primary()
        while not self._begins_element() and self._peek(blanks=True) == ("mark", "'"):
            self._next()
            found = _numeric(found).T
        return found

    def _primary(self) -> Value:
        kind, text = self._next()
        if kind == "number":
            return np.array([[float(re.sub("[dD]", "e", text))]])
        if kind == "text":
            return text[1:-1]
        if kind == "name":
            return self._value_by_name(text)
        if text == "(":
            self._in_table.append(False)
            found = self.expression()
            self._demand(")")
            self._in_table.pop()
            return found
        if text in ("[", "{"):
            return self._table(cell=text == "{")
        raise UnknownError(f"{text!r} is not understood" if text else "something is missing")

    def _table(self, *, cell: bool) -> Value:
        end = "}" if cell else "]"
        self._in_table.append(True)
        rows: list[list[Value]] = [[]]
        while True:
            kind, text = self._peek(blanks=True)
            if kind == "blank":
                if "\n" in text:
                    rows.append([])
                self._at += 1
            elif text in (",", ";", end):
                self._at += 1
                if text == ";":
                    rows.append([])
                if text == end:
                    break
            else:
                rows[-1].append(self.expression())
        self._in_table.pop()
        if cell:
            return [value for row in rows for value in row]
        try:
            return _stacked([row for row in rows if row])
        except ValueError as error:
            raise UnknownError("the rows of a table differ in length") from error

    def _value_by_name(self, name: str) -> Value:
        while self._peek(blanks=True) == ("mark", "."):
            self._next()
            name = f"{name}.{self._next()[1]}"
        if name == "end" and self._ends:
            return np.array([[float(self._ends[-1])]])
        called = self._peek(blanks=True) == ("mark", "(")
        if name in self._values:
            found = self._values[name]
            if isinstance(found, UnknownError):
                raise found
            if not called:
                return found
            self._next()
            table = _numeric(found)
            where = self.indices(table)
            self._demand(")")
            return _part(table, where)
        if name in _NUMBERS:
            return np.array([[_NUMBERS[name]]])
        if not called:
            raise UnknownError(f"{name!r} has no value")
        return self._call(name)

    def _call(self, name: str) -> Value:
        if name not in (*_FUNCTIONS, *_OTHER_FUNCTIONS):
            raise UnknownError(f"the function {name!r} is not known here")
        self._next()
        self._in_table.append(False)
        given: list[Value] = []
        while not self._take(")"):
            given.append(self.expression())
            if self._peek()[1] != ")":
                self._demand(",")
        self._in_table.pop()
        if name in _FUNCTIONS and len(given) == 1:
            return _FUNCTIONS[name](_numeric(given[0]))
        if name == "find" and len(given) == 1:
            table = _numeric(given[0])
            flat = 1.0 + np.flatnonzero(table.T)
            return flat.reshape(1, -1) if table.shape[0] == 1 else flat.reshape(-1, 1)
        if name == "size" and len(given) == 2:
            return np.array([[float(_numeric(given[0]).shape[int(_single(given[1])) - 1])]])
        if name in ("ones", "zeros") and len(given) == 2:
            shape = [int(_single(value)) for value in given]
            return np.full(shape, float(name == "ones"))
        if name == "sum" and len(given) == 1:
            table = _numeric(given[0])
            return np.sum(table, axis=1 if table.shape[0] == 1 else 0).reshape(1, -1)
        raise UnknownError(f"{name!r} is not known here with {len(given)} arguments")

    def indices(self, of: np.ndarray) -> list[np.ndarray]:
        self._in_table.append(False)
        count = self._count_of_indices()
        if count not in (1, 2):
            raise UnknownError(f"a table has one or two indices, and {count} stand here")
        sizes = of.shape if count == 2 else (of.size,)
        found = []
        for k, size in enumerate(sizes):
            if k:
                self._demand(",")
            found.append(self._index(size))
        self._in_table.pop()
        return found

    def _count_of_indices(self) -> int:
        depth = 0
        count = 1
        for kind, text in self._tokens[self._at :]:
            if kind == "mark":
                depth += (text in "([{") - (text in ")]}")
                count += text == "," and depth == 0
            if depth < 0:
                break
        return count

    def _index(self, size: int) -> np.ndarray:
        if self._peek() == ("mark", ":") and self._colon_alone():
            self._next()
            return np.arange(size)
        self._ends.append(size)
        value = _numeric(self.expression())
        self._ends.pop()
        if value.dtype == bool:
            return np.flatnonzero(value.T)
        found = value.T.ravel()
        if (found != np.round(found)).any() or (found < 1).any():
            raise UnknownError("an index must be a whole number from 1 on")
        return found.astype(int) - 1


def _tokens(text: str) -> list[tuple[str, str]]:
    found, at = [], 0
    while at < len(text):
        token = _TOKEN.match(text, at)
        if token is None:
            raise UnknownError(f"{text[at]!r} is not understood")
        kind, quoted = token.lastgroup or "", token["text"]
        if (
            quoted
            and quoted[0] == "'"
            and at
            and (text[at - 1].isalnum() or text[at - 1] in "_)]}'.")
        ):
            kind, end = "mark", at + 1  # a transposition
        else:
            end = token.end()
        found.append((kind, text[at:end]))
        at = end
    return found


def _stacked(rows: Sequence[Sequence[Value]]) -> np.ndarray:
    if not rows:
        return np.zeros((0, 0))
    return np.vstack([np.hstack([*map(_numeric, row)]) for row in rows])


def _numeric(value: Value) -> np.ndarray:
    if not isinstance(value, np.ndarray):
        raise UnknownError(f"{value!r} is no number")
    return value


def _single(value: Value) -> float:
    table = _numeric(value)
    if table.size != 1:
        raise UnknownError("one number is needed, and a table stands there")
    return float(table.item())


def _combined(mark: str, one: Value, other: Value) -> Value:
    left, right = _numeric(one), _numeric(other)
    if mark == "*" and left.size > 1 and right.size > 1:
        if left.shape[1] != right.shape[0]:
            raise UnknownError("the tables of a product do not fit")
        return np.asarray(left @ right)
    if (mark == "/" and right.size > 1) or (mark == "^" and max(left.size, right.size) > 1):
        raise UnknownError(f"{mark!r} with a table is not understood")
    operator = _BINARY[mark if mark in _BINARY else f".{mark}"]
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(operator(left, right))
    except ValueError as error:
        raise UnknownError("two tables of different size are combined") from error


def _range(parts: Sequence[Value]) -> np.ndarray:
    first, *middle, last = (_single(part) for part in parts)
    step = middle[0] if middle else 1.0
    count = int(np.floor((last - first) / step + 1e-9)) + 1 if step else 0
    return (first + step * np.arange(max(count, 0))).reshape(1, -1)


def _part(table: np.ndarray, where: Sequence[np.ndarray]) -> np.ndarray:
    try:
        if len(where) == 2:
            return np.asarray(table[np.ix_(*where)])
        found = table.T.ravel()[where[0]]
    except IndexError as error:
        raise UnknownError("an index lies beyond the table") from error
    return np.reshape(found, (1, -1) if table.shape[0] == 1 else (-1, 1))
