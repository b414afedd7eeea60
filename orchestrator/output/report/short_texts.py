"""Long texts and lists in short: cut, counted, or those alike told once."""

import re
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

Told = TypeVar("Told")
_FIGURE = re.compile(r"\boutages[ =]\S+\+\S+|[-+]?\b\d[\d.,]*(?:e[-+]?\d+)?")
"""A figure, or an outage of several elements as it is typed."""
_NEXT_SENTENCE = re.compile(r"\. (?=[A-Z])")
LONGEST_REMARK = 120
"""Characters of a remark in a table; JSON and Python have the whole text."""

_ITEMS_SHOWN = 5  # how many of a long list are shown, largest first


def first_few(items: Iterable[Any], text: Callable[[Any], str], most: int = _ITEMS_SHOWN) -> str:
    items = list(items)
    shown = ", ".join(text(item) for item in items[:most])
    return shown + (f" … {len(items)} in all" if len(items) > most else "")


def kinds_of(said: Iterable[tuple[Told, Iterable[str]]]) -> list[tuple[str, list[Told]]]:
    """Texts with all that tell them, the most told first; those that differ only in their figures are one."""
    found: dict[str, tuple[str, list[Told]]] = {}
    for teller, texts in said:
        for kind, text in {_FIGURE.sub("#", text): text for text in texts}.items():
            found.setdefault(kind, (text, []))[1].append(teller)
    return sorted(found.values(), key=lambda kind: -len(kind[1]))


def short(text: str, longest: int) -> str:
    """A remark, cut at a word where it has more characters."""
    return text if len(text) <= longest else f"{text[: longest - 1].rsplit(' ', 1)[0]} …"


def first_sentence(text: str) -> str:
    """A text up to the full stop that a capital letter follows; the whole text where none is."""
    return _NEXT_SENTENCE.split(text, maxsplit=1)[0]


def share_text(entry: tuple[str, float]) -> str:
    """``sg1 28%``."""
    return f"{entry[0]} {entry[1]:.0%}"
