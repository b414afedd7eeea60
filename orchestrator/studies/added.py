"""The studies of this package: each stands in a room of its own with a module ``command``, found where it lies."""

from importlib import import_module
from pathlib import Path
from typing import Any

_ROOT = Path(__file__).parent
_CALLED = {"screening": "screen", "siting": "site", "coordinated_design": "design"}
"""Room → command, where they are not called alike."""


def rooms() -> dict[str, str]:
    found = sorted(path.parent.name for path in _ROOT.glob("*/command.py"))
    return {_CALLED.get(room, room): room for room in found}


def words_of(room: str) -> str:
    """Return what a room says of itself, for a list of commands."""
    text = (
        (import_module(f"{__package__}.{room}").__doc__ or "")
        .strip()
        .partition("\n")[0]
        .rstrip(".")
    )
    return text[:1].lower() + text[1:]


def study_in(room: str) -> Any:
    return import_module(f"{__package__}.{room}.command").STUDY
