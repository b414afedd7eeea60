"""Files that text parameters of a DLL name: an FMU takes them along, as its DLL runs closed off from all others."""

import contextlib
import re
from collections.abc import Mapping
from pathlib import Path

from fmus.vendor_dll.interface import DATA_TYPES, DllInterface

_LOOKS_LIKE_A_FILE = re.compile(r"[^\n]{1,900}\.[A-Za-z][A-Za-z0-9]{0,4}|[^\n]*[/\\][^\n]*")


def _values(interface: DllInterface, texts: Mapping[str, str]) -> dict[str, str]:
    words = [p for p in interface.parameters if DATA_TYPES[p.data_type].kind == "String"]
    return {p.name: texts.get(p.name, str(p.default)) for p in words}


def places(interface: DllInterface, texts: Mapping[str, str], library: Path, folder: Path) -> dict[str, Path]:
    """Where files would lie that text parameters name.

    ``texts``: Values that somebody gave, absolute or from ``folder`` on.
    ``library``: The DLL, whose own defaults name files in its folder only: it must not choose what it may read."""
    found = {}
    for name, value in _values(interface, texts).items():
        with contextlib.suppress(OSError, ValueError):
            path = ((folder if name in texts else library.parent) / value).resolve()
            if value and (name in texts or library.parent.resolve() in path.parents):
                found[name] = path
    return found


def hidden(interface: DllInterface, texts: Mapping[str, str], files: Mapping[str, Path]) -> str:
    """Which text parameters name files that the DLL does not see, and the remedy; empty where there are none."""
    named = {n: v for n, v in _values(interface, texts).items() if n not in files and _LOOKS_LIKE_A_FILE.fullmatch(v)}
    said = ", ".join(f"{name} = {value!r}" for name, value in named.items())
    return said and (
        f"it sees no files but those that its text parameters name, and of {said} there is none: put it beside the "
        "DLL, or give its path in [texts] of a device's file or with gfor fmu build --text NAME=PATH"
    )
