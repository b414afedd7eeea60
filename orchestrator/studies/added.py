"""The studies that are installed: each is a command and a method of `Case`, ours and those of other distributions."""

import ast
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from fmus.toolchain.plugins import PlugIns, is_own, source_of


def _kinds() -> tuple[type, ...]:
    """Kinds of studies; a list of commands does without their imports, which take a second."""
    from orchestrator.studies.points.study import PointStudy, StudyAtOnce  # noqa: PLC0415 - as above

    return PointStudy, StudyAtOnce


STUDIES: PlugIns[Any] = PlugIns("gfor_cosim.studies", _kinds)
"""Studies by the name of their method; a command has ``-`` for ``_``."""


def others() -> dict[str, str]:
    """Return the studies of other distributions, with what each says of itself for a list of commands."""
    return {name: _words_of(name) for name in STUDIES if not is_own(STUDIES.entry(name))}


def _words_of(name: str) -> str:
    """First sentence of the study's module, which need not be imported; its distribution where that has none."""
    entry = STUDIES.entry(name)
    try:
        spec = find_spec(entry.module)
        text = Path(spec.origin).read_text(encoding="utf-8") if spec and spec.origin else ""
        first = (ast.get_docstring(ast.parse(text)) or "").partition("\n")[0].rstrip(".")
    except (ImportError, OSError, SyntaxError, ValueError):
        first = ""
    words = first[:1].lower() + first[1:] if first else "a study"
    return f"{words} (of {source_of(entry)})"
