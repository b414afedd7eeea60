"""The studies that are installed: each is a command and a method of `Case`, ours and those of other distributions."""

import ast
import re
from collections.abc import Collection
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fmus.toolchain.plugins import PlugIns, entries_of, is_own, source_of


def _kinds() -> tuple[type, ...]:
    """Kinds of studies; a list of commands does without their imports, which take a second."""
    from orchestrator.studies.points.study import PointStudy, StudyAtOnce  # noqa: PLC0415 - as above

    return PointStudy, StudyAtOnce


STUDIES: PlugIns[Any] = PlugIns("gfor_cosim.studies", _kinds)
"""Studies by the name of their method; a command has ``-`` for ``_``."""


def unlisted(commands: Collection[str]) -> dict[str, str]:
    """Commands of studies that a list has not, with what each says of itself: others', and new ones of ours.

    A study of others that is called as a listed command is among them."""
    named = {name.replace("_", "-"): name for name in STUDIES}
    return {
        command: _words_of(name)
        for command, name in named.items()
        if command not in commands or not is_own(_first_entry(name))
    }


def _words_of(name: str) -> str:
    """First sentence of the study's module, which is not imported, and its distribution if that is not ours."""
    entry = _first_entry(name)
    try:
        spec = find_spec(entry.module)
        text = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
        first = _first_sentence(ast.get_docstring(ast.parse(text)) or "")
    except (ImportError, OSError, SyntaxError, ValueError):
        first = ""
    words = first[:1].lower() + first[1:] if first else "a study"
    return words if is_own(entry) else f"{words} (of {source_of(entry)})"


def _first_sentence(text: str) -> str:
    """The first sentence of a docstring, on whichever of its lines that ends, without its full stop."""
    paragraph = " ".join(text.partition("\n\n")[0].split())
    return re.split(r"(?<=[.!?])\s", paragraph, maxsplit=1)[0].rstrip(".")


def _first_entry(name: str) -> EntryPoint:
    """Entry of a name; ours, or the first one, if several distributions declare it, which is told where it is used."""
    return entries_of(STUDIES.group)[name][0]
