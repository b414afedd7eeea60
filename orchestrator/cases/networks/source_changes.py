"""Contents of a network's source that our network has in another form, or not at all: listed, by kind."""

from collections import defaultdict
from typing import Self

from orchestrator.core.errors import Problem, QuestionTopic, few
from orchestrator.core.foreign_files import one_line

_MOST_LISTED = 12
"""Records of one text that a question lists in full: more fill a terminal, and hide what is said of them."""

_SHOWN = 4
"""Records that a question names where there are more than that; the others are counted."""


class Remark(str):
    """A sentence on a record, with the kind of those that differ only in the names and figures of their records.

    Parameters
    ----------
    text
        The sentence.
    kind
        The same for all records that are changed in the same way.
    """

    kind: str

    def __new__(cls, text: str, kind: str) -> Self:
        remark = super().__new__(cls, text)
        remark.kind = kind
        return remark

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]  # str has one argument
        return str(self), self.kind


def kind_of(text: str) -> str:
    """Return the kind of a sentence; one without names and figures is its own."""
    return text.kind if isinstance(text, Remark) else text


class Changes:
    """Data that were taken over in another form, by kind, with the lines or names of all that it concerns."""

    def __init__(self, place: str, what: str = "line") -> None:
        self._place, self._what = place, what
        self._items: dict[str, list[int | str]] = defaultdict(list)

    def note(self, item: int | str, text: str) -> None:
        """Add a record by its line, or an element by its name; those with the same text become one row."""
        self._items[text].append(item)

    def as_problems(self) -> list[Problem]:
        """One row for each text, complete: how many, what was done, and every line or name."""
        return [
            Problem(
                f"{self._place}, {self._place_of(items)}",
                text,
                topic=QuestionTopic(kind_of(text)),
                place_in_short=self._in_short(items),
            )
            for text, items in self._items.items()
        ]

    def _place_of(self, items: list[int | str], most: int | None = None) -> str:
        plural = "s" if len(items) > 1 else ""
        names = [one_line(str(item)) for item in items]
        return f"{self._what}{plural} {few(names, most or len(names))}"

    def _in_short(self, items: list[int | str]) -> str:
        if len(items) <= _MOST_LISTED:
            return ""
        return f"{self._place}, {self._place_of(items, _SHOWN)}"
