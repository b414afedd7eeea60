"""Questions about a new case's data, as comments above the lines that they are about."""

import re
import textwrap
from collections.abc import Sequence
from pathlib import Path

from orchestrator.core.errors import Problem
from orchestrator.core.options import Option
from orchestrator.core.question_kinds import by_kind

LINE_OF_TEXT = re.compile(r"line (\d+)")  # of the text, as places of questions begin


def with_questions(
    text: str, questions: Sequence[Problem], sources: dict[str, Path]
) -> tuple[str, list[int]]:
    """The text with every question as a comment above the line that it is about, and each line's new number."""
    lines = text.splitlines()
    above: dict[int, list[str]] = {}
    told = {
        ("" if one.place.startswith("line ") else f"{one.place}: ") + one.text: one
        for one in questions
    }
    for first, shown in by_kind(told, ("gfor modes CASE " + Option.DETAILS)).items():
        place = _line_of(told[first], lines, sources)
        above.setdefault(place, []).extend(
            textwrap.wrap(
                f"question: {shown}",
                116,
                initial_indent="# ",
                subsequent_indent="#   ",
                break_long_words=False,
            )
        )
    written: list[str] = []
    numbers = []
    for k, line in enumerate(lines):
        written += [*above.get(k, []), line]
        numbers.append(len(written))
    return "\n".join([*written, ""]), numbers


def _line_of(question: Problem, lines: Sequence[str], sources: dict[str, Path]) -> int:
    """Index of the line that a question is about: its own, that of the file that it names, else the first."""
    for key, path in sources.items():
        if path.name in question.place:
            return next(k for k, line in enumerate(lines) if line.startswith(f"{key} = "))
    found = LINE_OF_TEXT.match(question.place)
    return int(found[1]) - 1 if found else 2
