"""Options that an error names: spelt for the command line while it runs, and as keywords for Python."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

_KEYWORDS = {
    "set": "values",
    "range": "frequencies",
    "min-damping": "least_damping",
    "rank": "ranked",
    "place": "places",
    "event": "events",
    "channel": "channels",
    "out": "folder",
    "dest": "folder",
    "checkpoint": "checkpoints",
    "resume": "checkpoints",
    "parameter": "parameters",
    "text": "texts",
    "try": "steps",
    "federate": "federates",
    "engine helics": "federates",
}
"""Of options that are not spelt as their keywords."""

_CALLS = (
    "run",
    "modes",
    "linearize",
    "steps",
    "sweep",
    "sensitivities",
    "interactions",
    "site",
    "screen",
    "compare",
    "source",
    "identify",
    "design",
    "nyquist",
    "build",
    "check",
    "info",
)
"""Commands that Python has as functions of the same name."""

_KEPT = re.compile(
    r"[^\s'\"]*given[/\\][0-9a-f]{16}[/\\](case|binding|points)\.(?:toml|csv)(?:, line (\d+))?"
)
_COMMAND_ONLY = {"json", "with-linear-model"}
_TYPED = {"modes": {"component", "set", "out"}, "design": {"points"}}
"""Options that the call of the same name lacks: the command stays as it is typed at a terminal."""
_QUOTED = re.compile(
    r"`[^`]*`"
    r"""|(?<!\w)'(?:[^'\\\n]|\\.)*'(?!\w)|(?<!\w)"(?:[^"\\\n]|\\.)*"(?!\w)"""
    r"|(?<![\w/\\-])--(engine helics|[a-z][a-z-]*)"
)
"""A command, a value of the user's as Python writes it, or an option, which alone is spelt anew."""

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


def keyword(option: str) -> str:
    return _KEYWORDS.get(option, option.replace("-", "_"))


def spelled(text: str, words_of_others: str = "") -> str:
    """Spell the options that a text names, such as ``--out``, for who reads it.

    What was given as tables is named as it was given, and not by the file that keeps it. Commands of other programs,
    quoted values and ``words_of_others``, which the text contains, stay as they are: a log of an FMU may name options
    of its own."""
    before, found, after = (
        text.rpartition(words_of_others) if "--" in words_of_others else ("", "", text)
    )
    return f"{_spelled(before)}{found}{_spelled(after)}"


def _spelled(text: str) -> str:
    text = _KEPT.sub(
        lambda m: m[1] + (f", row {int(m[2]) - 1}" if (m[2] or "1") != "1" else ""), text
    )
    return text if _commanded or "--" not in text else _QUOTED.sub(_in_python, text)


def _in_python(found: re.Match[str]) -> str:
    if found[1]:
        return keyword(found[1])
    if not found[0].startswith("`"):
        return found[0]
    if found[0].startswith("`--"):
        return f"`{spelled(found[0][1:-1])}`"
    command, *options = found[0][1:-1].split(" --")
    words = command.split()
    if not options or len(words) < 2 or words[0] != "gfor":
        return found[0]
    given = [option.partition(" ") for option in options]
    if any(name in _TYPED.get(words[1], ()) for name, _, _ in given):
        return found[0]
    if words[1] in _CALLS and not any(name in _COMMAND_ONLY for name, _, _ in given):
        values = [
            f"{keyword(name)}={value!r}" if value else f"{keyword(name)}=True"
            for name, _, value in given
        ]
        return f"`{words[1]}({', '.join(values)})`"
    return found[0]  # Python has no such function: to be typed at a terminal
