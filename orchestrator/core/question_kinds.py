"""Questions of one kind in one line: the first of them, how many more there are, and about what."""

import re
from collections.abc import Iterable, Iterator, Sequence

from orchestrator.core.errors import few

_LEAST = 3  # questions of a kind from which one line stands for them
_SHOWN = 4  # names of the others
_OWN = re.compile(r"""'[^']*'|"[^"]*"|[^\s:,]*[/\\][^\s:,]*|[^\s:,;()]*\d[^\s:,;()]*""")
"""Names, files and numbers: what differs between questions of one kind."""

_NAME = re.compile(r"(?<![\w.])(?:[a-z]\w*?_?\d\w*)(?=[.:, ])")
_MEANT = re.compile(r'meant = \["[^"]+?\.([\w.]+)"\]')


def by_kind(texts: Iterable[str], command: str = "") -> dict[str, str]:
    """Return lines by the first question that they are for: each kind of which there are several has one line.

    Questions are of one kind if they differ in names, places and numbers alone.

    ``command``: lists all of them; it is not named where it is empty."""
    kinds: dict[str, list[str]] = {}
    for text in texts:
        kinds.setdefault(_OWN.sub("#", text), []).append(text)
    return dict(pair for own in kinds.values() for pair in _lines(own, command))


def _lines(own: Sequence[str], command: str) -> Iterator[tuple[str, str]]:
    if len(own) < _LEAST:
        yield from zip(own, own, strict=True)
        return
    first, others = own[0], own[1:]
    names = dict.fromkeys(name for text in others for name in _names(text)[:1])
    about = f" ({few(names, _SHOWN)})" if names else ""
    answers = {found[1] for text in own if (found := _MEANT.search(text))}
    if len(answers) == 1:
        first = _MEANT.sub(f'meant = ["*.{answers.pop()}"]', first)
    listed = f"; {command} lists all" if command else ""
    yield own[0], f"{first} [and {len(others)} more of this kind{about}{listed}]"


def _names(text: str) -> list[str]:
    """Names of elements in a question, behind its place."""
    return _NAME.findall(re.sub(r"\S*[/\\]\S*|\bline \d+", "", text))
