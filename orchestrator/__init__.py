"""Co-simulation of grid-forming converters: ``import orchestrator as gfor``.

A name is imported where it is first used, so that ``import orchestrator`` takes no time; ``__init__.pyi`` lists them.

Examples
--------
>>> import orchestrator as gfor
>>> scenario = gfor.load("two_area").scenario("pod_p", {"grid.X_L": 0.3})
>>> axes = scenario.modes().plot()
"""

import re
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

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
        raise AttributeError(
            f"module {__name__!r} has no attribute {name!r}; it has: {', '.join(_HOMES)}"
        )
    value: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(_HOMES)


class _Package(ModuleType):
    """A package that is called as if it were the study of its name."""

    def __setattr__(self, name: str, value: object) -> None:
        if type(value) is ModuleType:
            value.__class__ = _Package
        super().__setattr__(name, value)

    def __call__(self, *_: object, **__: object) -> None:
        name = self.__name__.rpartition(".")[2]
        method = (
            f"gfor.load('two_area').{name}(…), or " if hasattr(__getattr__("Case"), name) else ""
        )
        raise AttributeError(
            f"{name} is no function: use {method}`gfor {name}` at the terminal; functions: {', '.join(_HOMES)}"
        )


sys.modules[__name__].__class__ = _Package
