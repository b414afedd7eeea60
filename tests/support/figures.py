"""Whether what goes out, as JSON or a page, shows figures of the object that it was made from, and no others.

Nobody computes with a figure that only goes out, so a wrong unit in it fails no other test. A figure has its sign, and
is 100 times one of the object only where percent are said: by a key, a heading, or the sign behind it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from html import unescape
from pathlib import PurePath

import numpy as np

_NUMBER = re.compile(r"(?<![\w.])([-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?!\w|\.\d)(\s*(?:%|Hz))?")
"""One within a name or a version, such as T_S1 or 0.3.0, is none."""

_GUID = re.compile(r"[0-9a-fA-F]{8}(?:-[0-9a-fA-F]{4}){3}-[0-9a-fA-F]{12}")
"""Of an FMU; a part such as 8e58 is no figure."""

_PERCENT = re.compile(r"percent|%", re.IGNORECASE)
_POINTS = re.compile(
    r"_points\b|\[points\]"
)  # a difference of percent, which an object may hold as such
_HERTZ = re.compile(r"hz\b", re.IGNORECASE)
_NO_HERTZ = re.compile(r"imag|real|rad|_deg|_mw|_mva|_pu|_s\b", re.IGNORECASE)


@dataclass(frozen=True)
class Figures:
    """``plain``: as they are, and a complex one's parts and damping ratio; ``hertz``: with its frequency instead."""

    plain: np.ndarray
    hertz: np.ndarray
    percent: np.ndarray

    def of(self, words):
        """Those that may stand behind a key, a heading or before a unit."""
        if _POINTS.search(words):
            return np.append(self.plain, self.percent)
        if _PERCENT.search(words):
            return self.percent
        return self.hertz if _HERTZ.search(words) else self.plain


def figures_of(source):
    """Every number in an object, unless they are known; those whose own name says percent are no ratios."""
    if isinstance(source, Figures):
        return source
    plain, hertz, percent = set(), set(), set()
    for name, value in _values(source):
        if isinstance(value, complex):
            plain.update([value.real, value.imag])
            hertz.add(value.imag / (2 * np.pi))
            if abs(value):
                plain.add(-value.real / abs(value))
                percent.add(-100 * value.real / abs(value))
        elif _PERCENT.search(name) or _POINTS.search(name):
            percent.add(value)
        else:
            plain.add(value)
            if not _NO_HERTZ.search(name):
                hertz.add(value)
            if not _HERTZ.search(name):
                percent.add(100 * value)
    return Figures(*(np.array(sorted(values)) for values in (plain, hertz, percent)))


def _values(source, name=""):
    if isinstance(source, str | bytes | PurePath | None) or callable(source):
        return
    if isinstance(source, bool | np.bool_ | int | float | np.integer | np.floating):
        yield name, float(source)
    elif isinstance(source, complex | np.complexfloating):
        yield name, complex(source)
    elif isinstance(source, np.ndarray):
        yield from (x for one in source.ravel().tolist() for x in _values(one, name))
    elif isinstance(source, Mapping):
        yield from (x for key, one in source.items() for x in _values(one, f"{name}.{key}"))
        yield from (x for key in source for x in _values(key, name))
    elif isinstance(source, list | tuple | set | frozenset):
        yield from (x for one in source for x in _values(one, name))
    elif is_dataclass(source):
        yield from (x for f in fields(source) for x in _values(getattr(source, f.name), f.name))
    else:
        yield from (x for key, one in vars(source).items() for x in _values(one, key))


def foreign_in_json(said, source, place=""):
    """Places of numbers in JSON's types that are no figure of the object, with the number."""
    known = figures_of(source)
    return [
        (where, value)
        for where, value in _numbers(said, place)
        if not _is_one(value, known.of(_key(where)))
    ]


def _is_one(value, figures):
    return np.isclose(figures, value, rtol=1e-9, atol=1e-12).any()


def _key(place):
    """The key behind which a number stands, alone or in a list."""
    return re.sub(r"(\.\d+)+$", "", place).rpartition(".")[2]


def _numbers(said, place):
    if isinstance(said, Mapping):
        for key, inner in said.items():
            yield from _numbers(inner, f"{place}.{key}")
    elif isinstance(said, list | tuple):
        for number, inner in enumerate(said):
            yield from _numbers(inner, f"{place}.{number}")
    elif isinstance(said, int | float) and not isinstance(said, bool):
        yield place, float(said)


def foreign_in_text(text, source, heading=""):
    """Numbers of a page that are no figure of the object, rounded as they are shown.

    ``heading``: of the column, which may say percent."""
    known, found = figures_of(source), []
    for word, unit in _NUMBER.findall(_plain(text)):
        mantissa, _, exponent = word.partition("e")
        decimals = len(mantissa.partition(".")[2]) - int(exponent or 0)
        value = float(word.replace("−", "-"))
        words = unit or heading
        figures = known.of(words) if words else np.append(known.plain, known.hertz)
        if not (np.abs(figures - value) <= 0.5000001 * 10.0**-decimals).any():
            found.append(word)
    return found


def _plain(text):
    """A piece of HTML as a reader sees it, without GUIDs; j of a complex number stands before a number."""
    seen = _GUID.sub(" ", unescape(re.sub(r"<[^>]*>", " ", text)))
    return re.sub(r"\bj(?=\d)", " ", seen)


SLIPS = {
    "1000 times": 1000,
    "100 times": 100,
    "2π times": 2 * np.pi,
    "a 2π-th": 1 / (2 * np.pi),
    "a hundredth": 1 / 100,
    "a thousandth": 1 / 1000,
    "lost sign": -1,
}
"""Factors by which a figure in a wrong unit, or without its sign, differs."""


_TELLING = 3
"""Significant digits from which on a figure resembles no other by chance."""


def unseen_slips(said, source):
    """Figures in JSON in which one of `SLIPS` would pass unseen, with the slip; empty where none would.

    Counts, and numbers that are 0, have no unit and no sign to lose; what has few digits is not tried."""
    known = figures_of(source)
    return [
        (place, slip)
        for place, value in _numbers(said, "")
        if value != int(value) and _digits(f"{value:.15g}") >= _TELLING
        for slip, factor in SLIPS.items()
        if _is_one(factor * value, known.of(_key(place)))
    ]


def _digits(word):
    """Significant digits of a number as it is written, without zeros at its end."""
    return len(word.partition("e")[0].replace(".", "").strip("-−+0"))


def cells_of(page):
    """Each cell of a page's tables: the table's caption, the column's heading, and the cell's HTML."""
    return (cell for row in rows_of(page) for cell in row)


def rows_of(page):
    """The cells of each row of a page's tables, as `cells_of` has them."""
    for table in re.findall(r"<table.*?</table>", page, re.DOTALL):
        caption = "".join(re.findall(r"<caption>(.*?)</caption>", table))
        headings = re.findall(r"<th(?: [^>]*)?>(.*?)</th>", table)
        for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)[1:]:
            cells = re.findall(r"<td[^>]*>(.*?)</td>", row, re.DOTALL)
            # a table of points tells a mode in its heading by its percent
            of_points = " [points]" if "points of damping" in caption else ""
            yield [
                (unescape(caption), unescape(heading) + of_points, cell)
                for heading, cell in zip(headings, cells, strict=True)
            ]


_ROUNDED = 0.02
"""Error of a frequency [Hz] or a damping [%] from an eigenvalue with three decimals."""


def unlike_eigenvalues(page):
    """Rows of a page whose frequency [Hz] or damping [%] is not that of the eigenvalue [rad/s] beside it."""
    found = []
    for row in rows_of(page):
        # a reference's damping may stand in a later column of that name
        shown = {heading: _NUMBER.findall(_plain(cell)) for _, heading, cell in reversed(row)}
        parts = [
            float(word.replace("−", "-"))
            for word, _ in shown.get("λ [rad/s]") or shown.get("Mode [rad/s]", ())
        ]
        if len(parts) != 2:
            continue
        value = complex(*parts)
        of_value = {
            "f [Hz]": value.imag / (2 * np.pi),
            "Damping [%]": -100 * value.real / abs(value),
        }
        found += [
            (heading, word, exact)
            for heading, exact in of_value.items()
            for word, _ in shown.get(heading, ())
            if abs(float(word.replace("−", "-")) - exact) > _ROUNDED
        ]
    return found


def prose_of(page):
    """The sentences of a page: what stands in no table, picture, script or code, and in no title of a section."""
    beside = r"<(table|svg|script|style|head|pre|code|nav|header|h2|h3)\b.*?</\1>"
    return re.sub(beside, " ", page, flags=re.DOTALL)


def foreign_in_page(page, source):
    """Numbers of a page that are no figure of the object, each with the column or the sentence that it stands in."""
    source = figures_of(source)
    found = [
        (f"{caption}: {heading}", word)
        for caption, heading, cell in cells_of(page)
        for word in foreign_in_text(cell, source, heading)
    ]
    return found + [("prose", word) for word in foreign_in_text(prose_of(page), source)]


def unseen_in_page(page, source):
    """Figures of a page's tables in which one of `SLIPS` would pass unseen, with the slip, as `unseen_slips`."""
    source = figures_of(source)
    return [
        (f"{caption}: {heading}", word, slip)
        for caption, heading, cell in cells_of(page)
        for word, _ in _NUMBER.findall(_plain(cell))
        if "." in word and _digits(word) >= _TELLING
        for slip, factor in SLIPS.items()
        if not foreign_in_text(_slipped(cell, word, factor), source, heading)
    ]


def _slipped(cell, word, factor):
    """A cell with a factor at one of its numbers, with digits enough not to become 0."""
    mantissa, e, exponent = word.replace("−", "-").partition("e")
    value = factor * float(mantissa)
    return _plain(cell).replace(word, f"{value:.9f}{e}{exponent}", 1)
