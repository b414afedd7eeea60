"""Names that an object of the public face does not have: an error that says what was meant, also where one is set."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from orchestrator.core.errors import InputError


class NoSuchAttributeError(InputError, AttributeError):
    """An object has nothing of that name."""


class KnownNames:
    """Refuses names that it lacks, with the nearest of its own or the place where the name is."""

    # how a name is written that stands at another place
    _elsewhere: ClassVar[Mapping[str, str]] = {}

    if not TYPE_CHECKING:  # type checkers would take every name for known

        def __getattr__(self, name: str) -> Any:
            if hasattr(type(self), name):  # a property failed, and its own error counts
                return object.__getattribute__(self, name)
            absent = f"{type(self).__name__!r} object has no attribute {name!r}"
            if name.startswith("_"):
                raise AttributeError(absent)
            raise NoSuchAttributeError(f"{absent}{self._hint(name)}")

    def _hint(self, name: str) -> str:
        if name in self._elsewhere:
            return f"; it is {self._elsewhere[name]}"
        own = [known for known in dir(self) if not known.startswith("_")]
        near = difflib.get_close_matches(name, own, 1)
        return f"; did you mean .{near[0]}?" if near else f"; it has {', '.join(own)}"


class Unchanged(KnownNames):
    """Refuses that a public name is set which it does not have: nothing would read it."""

    _own: ClassVar[frozenset[str]] = frozenset()  # names that it sets itself
    _instead: ClassVar[str] = ""  # how it is changed

    def __setattr__(self, name: str, value: object) -> None:
        if name not in self._own and not name.startswith("_"):
            raise NoSuchAttributeError(
                f"{type(self).__name__}.{name} cannot be set, and nothing was changed; {self._instead}"
            )
        super().__setattr__(name, value)
