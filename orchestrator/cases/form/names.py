"""Names in a case file: variables in the expression of a signal, and hints at the intended name."""

from __future__ import annotations

import difflib
import fnmatch
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from orchestrator.core.errors import InputError

if TYPE_CHECKING:
    from orchestrator.devices.fmi.description import FmuDescription

# bytes of a name that becomes a file's, in UTF-8: file systems take 255, and something is added to
# it
LONGEST = 200
TWINS = {"current_limit": "current_demand", "current_demand": "current_limit"}
"""Outputs of one meaning in EMT and phasor models."""

SERVICE = ("in_service", "status", "closed", "connected", "enabled", "out", "off")
STATES = dict.fromkeys(("1", "1.0", "true", "yes", "on", "in", "closed"), True)
STATES |= dict.fromkeys(("0", "0.0", "false", "no", "off", "out", "open"), False)
"""What others call the switch of an element."""

_RESERVED = re.compile(r"(?:con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³])(?:\..*)?", re.IGNORECASE)
_RESULTS = re.compile(r".*\.(?:csv|html?|json|nc|pdf|png|svg|toml)", re.IGNORECASE | re.DOTALL)
"""Files that lie in a folder of results, beside one folder for each scenario."""

_FORBIDDEN = re.compile(r'[\x00-\x1f\x7f/\\:*?"<>|]')


def file_name(name: str) -> str:
    """A name that can be that of a file or a folder on every system, and lead to no other place."""
    rule = (
        "it becomes the name of a file or folder: use letters, digits, _ and -, at most 200 bytes"
    )
    if not name.strip():
        raise ValueError(f"this name is empty; {rule}")
    if len(name.encode("utf-8", "surrogatepass")) > LONGEST:
        raise ValueError(f"this name is longer than {LONGEST} bytes ({name[:40]}…); {rule}")
    found = _FORBIDDEN.search(name)
    if found:
        raise ValueError(f"the name {name!r} holds the character {found.group()!r}; {rule}")
    if name[0] in ".-=+@ " or name[-1] in ". ":
        raise ValueError(
            f"the name {name!r} begins or ends with a character that misleads programs; {rule}"
        )
    if any("\ud800" <= letter <= "\udfff" for letter in name):
        raise ValueError(f"the name {name!r} holds half a character; {rule}")
    if _RESERVED.fullmatch(name):
        raise ValueError(f"the name {name!r} is that of a device on Windows; choose another")
    if _RESULTS.fullmatch(name):
        raise ValueError(
            f"the name {name!r} is like those of files among the results, as manifest.json; choose another"
        )
    if ".part-" in name or ".old-" in name:
        raise ValueError(f"the name {name!r} is like those of unfinished results; choose another")
    return name


def close_names(wanted: str, known: Iterable[str], otherwise: str = "") -> str:
    """A hint at the name in another kind of model, at names with the same parts (``line_5_4`` for ``line_4_5``), at the
    same name in a part of the component (``pod_p.K`` for ``K``), or otherwise at similar names."""
    names = list(known)
    head, dot, last = wanted.rpartition(".")
    twin = f"{head}{dot}{TWINS.get(last, last)}"
    if twin != wanted and fnmatch.filter(names, twin):
        return f"phasor and EMT models name it differently: here it is {twin}"
    close = [name for name in names if _parts(name) == _parts(wanted)]
    close = close or [name for name in names if name.endswith(f".{wanted}")][:3]
    number = re.fullmatch(r"\D*(\d+)", wanted)  # as of a bus, which may be written in another way
    close = (
        close or [name for name in names if number and re.fullmatch(rf"\D*{number[1]}", name)][:3]
    )
    close = close or difflib.get_close_matches(wanted, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else otherwise


def no_scenario(wanted: str, known: Iterable[str]) -> str:
    """That a case has no scenario of a name, which ones are near, and all that it has."""
    names = list(known)
    hint = close_names(wanted, names)
    has = f"the case has: {', '.join(names)}"
    return f"there is no scenario {wanted!r}; {f'{hint} ' if hint else ''}{has}"


def hint_at(described: FmuDescription, wanted: str, known: Iterable[str], otherwise: str) -> str:
    """A hint at a variable's name, which may be the FMU's own name of a variable that a binding calls otherwise."""
    bound = getattr(described, "bound_names", None)
    ours = [] if bound is None else bound(wanted)
    if ours:
        return f"the binding calls it {' or '.join(ours)}: write that"
    return close_names(wanted, known, otherwise)


def _parts(name: str) -> list[str]:
    return sorted(re.split(r"[_.]", name.casefold()))


def whose(part: str, variables: Mapping[str, Iterable[str]]) -> str:
    """A hint at the component whose variables have this part, as a grid's have a line's name; "" where none has it."""
    homes = [
        name for name, own in variables.items() if any(one.startswith(f"{part}.") for one in own)
    ]
    return f"; it is of {homes[0]!r}: write {homes[0]}.{part}.…" if homes else ""


def variables_of(expression: str) -> list[str]:
    of = re.fullmatch(r"\s*\|(.+)\|\s*", expression)
    if of:  # the magnitude of a phasor
        return [f"{of[1].strip()}_re", f"{of[1].strip()}_im"]
    names = [part.strip() for part in expression.split(" - ")]
    if not 1 <= len(names) <= 2 or not all(names):
        raise InputError(
            f"signal {expression!r}: write 'component.variable', 'component.variable - component.variable' "
            "or '|component.i|' for the magnitude of i_re and i_im"
        )
    return names
