"""The statements of a MATLAB file, each with its line, without comments and continuation marks."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

_BLOCK = re.compile(r"^[ \t]*%\{[ \t]*$.*?^[ \t]*%\}[ \t]*$", re.MULTILINE | re.DOTALL)
_PIECE = re.compile(
    r"""(?P<text>(?<![\w\]).}'])'(?:[^'\n]|'')*'|"[^"\n]*")  # a quote behind a value is a transposition
    |(?P<comment>[%\#][^\n]*)
    |(?P<continued>\.\.\.[^\n]*\n)
    |(?P<open>[\[({])
    |(?P<close>[\])}])
    |(?P<end>[;,\n])""",
    re.VERBOSE,
)


class UnendedError(ValueError):
    """A bracket is not closed; ``line`` is where its statement begins."""

    def __init__(self, line: int) -> None:
        super().__init__("a bracket is not closed")
        self.line = line


@dataclass(frozen=True, slots=True)
class Statement:
    line: int
    text: str


def statements(source: str) -> Iterator[Statement]:
    """Split a program at line ends, semicolons and commas outside of brackets."""
    source = source.replace("\r\n", "\n") + "\n"
    source = _BLOCK.sub(lambda found: "\n" * found[0].count("\n"), source)
    kept: list[str] = []
    depth = 0
    at = 0
    begin: int | None = None  # of the statement
    for piece in _PIECE.finditer(source):
        kind, before = piece.lastgroup, source[at : piece.start()]
        if begin is None and (before.strip() or kind in ("text", "open", "close")):
            begin = at + len(before) - len(before.lstrip())
        kept.append(before)
        at = piece.end()
        if kind == "end" and depth == 0:
            if begin is not None:
                yield Statement(source.count("\n", 0, begin) + 1, "".join(kept).strip())
            kept, begin = [], None
        elif kind == "continued":
            kept.append(" ")
        elif kind != "comment":
            depth += (kind == "open") - (kind == "close")
            kept.append(piece[0])
    if begin is not None:
        raise UnendedError(source.count("\n", 0, begin) + 1)
