"""Whether what goes out, as JSON or a page, shows figures of the object that it was made from, and no others.

Nobody computes with a figure that only goes out, so a wrong unit in it fails no other test. A figure has its sign, and
is 100 times one of the object only where percent are said: by a key, a heading, or the sign behind it."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from html import unescape
from pathlib import PurePath

import numpy as np

_NUMBER = re.compile(r"([-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(\s*(?:%|Hz))?")
_PERCENT = re.compile(r"percent|%", re.IGNORECASE)
_POINTS = re.compile(
    r"_points\b|\[points\]"
)  # a difference of percent, which an object may hold as such
_HERTZ = re.compile(r"hz\b", re.IGNORECASE)


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
    """Every number in an object; those whose own name says percent are no ratios."""
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
            hertz.add(value)
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
        if not np.isclose(known.of(_key(where)), value, rtol=1e-9, atol=1e-12).any()
    ]


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
    known, shown = figures_of(source), unescape(re.sub(r"<[^>]*>", " ", text)).replace("j", " ")
    found = []
    for word, unit in _NUMBER.findall(shown):
        decimals = len(word.partition("e")[0].partition(".")[2])
        value = float(word.replace("−", "-"))
        words = unit or heading
        figures = known.of(words) if words else np.append(known.plain, known.hertz)
        if not (np.abs(figures - value) <= 0.5000001 * 10.0**-decimals).any():
            found.append(word)
    return found


def unseen_slips(said, source):
    """Figures in JSON that a factor of 100 or a lost sign would pass unseen, with the slip; empty where none would.

    Counts, and numbers that are 0, have no unit and no sign to lose."""
    found = []
    for place, value in _numbers(said, ""):
        slips = {"100 times": 100 * value, "a hundredth": value / 100, "lost sign": -value}
        if value == 0 or (value == int(value) and not _PERCENT.search(place)):
            continue
        found += [
            (place, slip)
            for slip, wrong in slips.items()
            if not foreign_in_json(_with(said, place.split(".")[1:], wrong), source)
        ]
    return found


def _with(said, keys, value):
    """JSON's types with another number at a place."""
    if not keys:
        return value
    if isinstance(said, Mapping):
        # a key may hold dots itself
        names = [key for key in said if ".".join(keys).startswith(str(key))]
        key = max(names, key=len)
        rest = ".".join(keys)[len(str(key)) :].removeprefix(".")
        return {**said, key: _with(said[key], rest.split(".") if rest else [], value)}
    place = int(keys[0])
    return [*said[:place], _with(said[place], keys[1:], value), *said[place + 1 :]]
