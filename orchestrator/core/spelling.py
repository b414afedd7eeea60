"""Texts that name options, which the command line and Python spell in different ways.

A text is put together from words and values: ``Option.OUT + f" {folder}: nothing can be written there"``. Each value
knows its two spellings, so that nothing has to be searched for in the words: a user's own text stays as it is.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Self

_commanded = list[None]()  # one for each that asks for options


@contextmanager
def as_options() -> Iterator[None]:
    """Inside, errors are for somebody who types commands."""
    _commanded.append(None)
    try:
        yield
    finally:
        _commanded.pop()


def for_python() -> bool:
    """Return whether errors are for somebody who writes Python."""
    return not _commanded


class Text(str):
    """Words with options between them.

    As a string it is the command line's, wherever it is printed or kept; `spelled` gives it as its reader needs it.
    Texts are joined by ``+`` and `joined`, which keep the options; an f-string makes one plain string of them.

    Attributes
    ----------
    parts : tuple of str
        Plain words, and each `Spelling` between them.
    """

    parts: tuple[str, ...]

    def __new__(cls, *parts: str) -> Self:
        kept = tuple(one for part in parts for one in parts_of(part))
        text = super().__new__(cls, "".join(kept))
        text.parts = kept
        return text

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.parts

    def __add__(self, other: str) -> "Text":
        return Text(self, other)

    def __radd__(self, other: str) -> "Text":
        return Text(other, self)


class Spelling(Text):
    """One thing that has two spellings, such as an option.

    Parameters
    ----------
    typed
        As it is typed at a command line.
    python
        As it is written in Python.
    """

    python: str

    def __new__(cls, typed: str, python: str) -> Self:
        text = str.__new__(cls, typed)
        text.python = python
        text.parts = (text,)
        return text

    def __getnewargs__(self) -> tuple[Any, ...]:
        return str(self), self.python

    def __getstate__(self) -> None:
        """Nothing beside what it is made from: its only part is itself."""


def parts_of(text: str) -> tuple[str, ...]:
    """Return the words and the options of a text; a plain string is one part."""
    return text.parts if isinstance(text, Text) else (text,)


def spelled(text: str) -> str:
    """Return a text as a plain string for who reads it: with options, or with Python's keywords in their place."""
    return "".join(map(_spelled, parts_of(text)))


def _spelled(part: str) -> str:
    return part.python if isinstance(part, Spelling) and for_python() else part


def stored(text: Text) -> list[list[str]]:
    """Return a text as JSON's types: each part, and beside it its spelling in Python where that is another."""
    return [
        [str(part), part.python] if isinstance(part, Spelling) else [part] for part in text.parts
    ]


def restored(parts: Iterable[Sequence[str]]) -> Text:
    """Return the text that `stored` made these parts of.

    Raises a `TypeError` if they are none."""
    return Text(*(Spelling(*part) if len(part) > 1 else "".join(part) for part in parts))


def joined(between: str, texts: Iterable[str]) -> str:
    """Return texts in one, with their options, as ``between.join(texts)`` would without them."""
    parts = [part for text in texts for part in (between, text)]
    return Text(*parts[1:])
