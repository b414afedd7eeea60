"""Co-simulation of grid-forming converters: ``import orchestrator as gfor``.

A name is imported where it is first used, so that ``import orchestrator`` takes no time; ``__init__.pyi`` lists them.

Examples
--------
>>> import orchestrator as gfor
>>> scenario = gfor.load("two_area").scenario("pod_p", {"grid.X_L": 0.3})
>>> axes = scenario.modes().plot()
"""

import re
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path

from orchestrator.former_paths import install

_STUB = Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")
_HOMES = {
    name: home
    for home, name in re.findall(
        r"^from orchestrator\.(\S+) import \S+ as (\S+)$", _STUB, re.MULTILINE
    )
}
"""Name → module of this package that defines it, as ``__init__.pyi`` has them."""

__all__ = [*_HOMES]  # noqa: PLE0604 - names all the same


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        if name.startswith("_"):
            raise AttributeError(_absence(name))
        errors = import_module(f"{__name__}.core.attributes")  # a notebook shows its sentence alone
        raise errors.NoSuchAttributeError(_absence(name))
    value: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def _absence(name: str) -> str:
    """Return why there is no such name: it may be that of a command or of a method of a case."""
    absent, known = f"module {__name__!r} has no attribute {name!r}", ", ".join(_HOMES)
    if name.startswith("_"):
        return absent
    ways = [f"`gfor {name}` at the terminal"] * (
        name in import_module(f"{__name__}.face.cli").COMMANDS
    )
    if hasattr(__getattr__("Case"), name):
        ways.insert(0, f"gfor.load('two_area').{name}(…)")
    if not ways:
        near = get_close_matches(name, _HOMES, 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        return f"{absent}; it has: {known}{meant}"
    return f"{absent}: use {', or '.join(ways)}; functions: {known}"


def __dir__() -> list[str]:
    return sorted(_HOMES)


install()
