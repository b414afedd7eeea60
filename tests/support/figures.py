"""Whether what goes out, as JSON or a page, shows figures of the object that it was made from, and no others.

Nobody computes with a figure that only goes out, so a wrong unit in it fails no other test."""

import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from html import unescape

import numpy as np

_NUMBER = re.compile(r"[-−+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def figures_of(source):
    """Every number in an object, and what is told of it: its part of 100, and a mode's frequency and damping."""
    found = set()
    for value in _values(source):
        if isinstance(value, complex):
            parts = [value.real, value.imag, abs(value.imag), value.imag / (2 * np.pi)]
            if abs(value):
                parts += [-value.real / abs(value), -100 * value.real / abs(value)]
            found.update(parts)
        else:
            found.update((value, abs(value), 100 * value))
    return np.array(sorted(found))


def _values(source):
    if isinstance(source, str | bytes | None) or callable(source):
        return
    if isinstance(source, bool | np.bool_ | int | float | np.integer | np.floating):
        yield float(source)
    elif isinstance(source, complex | np.complexfloating):
        yield complex(source)
    elif isinstance(source, np.ndarray):
        yield from (x for one in source.ravel().tolist() for x in _values(one))
    elif isinstance(source, Mapping):
        yield from (x for pair in source.items() for one in pair for x in _values(one))
    elif isinstance(source, list | tuple | set):
        yield from (x for one in source for x in _values(one))
    elif is_dataclass(source):
        yield from (x for f in fields(source) for x in _values(getattr(source, f.name)))
    else:
        yield from (x for one in vars(source).values() for x in _values(one))


def foreign_in_json(said, source, place=""):
    """Places of numbers in JSON's types that are no figure of the object, with the number."""
    known = figures_of(source)
    return [
        (where, value)
        for where, value in _numbers(said, place)
        if not np.isclose(known, value, rtol=1e-9, atol=1e-12).any()
    ]


def _numbers(said, place):
    if isinstance(said, Mapping):
        for key, inner in said.items():
            yield from _numbers(inner, f"{place}.{key}")
    elif isinstance(said, list | tuple):
        for number, inner in enumerate(said):
            yield from _numbers(inner, f"{place}.{number}")
    elif isinstance(said, int | float) and not isinstance(said, bool):
        yield place, float(said)


def foreign_in_text(text, source):
    """Numbers of a page that are no figure of the object, rounded as they are shown."""
    known, shown = figures_of(source), unescape(re.sub(r"<[^>]*>", " ", text)).replace("j", " ")
    found = []
    for word in _NUMBER.findall(shown):
        decimals = len(word.partition("e")[0].partition(".")[2])
        value = float(word.replace("−", "-"))
        if not (np.abs(known - value) <= 0.5000001 * 10.0**-decimals).any():
            found.append(word)
    return found
