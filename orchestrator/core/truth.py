"""Results whose truth value would be taken for their verdict: ``if modes:`` is true of any object, also of an unstable
system's."""

from collections.abc import Iterable
from typing import ClassVar, NoReturn

from orchestrator.core.attributes import KnownNames
from orchestrator.core.errors import InputError


def all_true(verdicts: Iterable[bool | None]) -> bool | None:
    """Combine verdicts: False where one is false, None where one is not known and none is false, else True."""
    verdicts = list(verdicts)
    if False in verdicts:
        return False
    return None if None in verdicts else True


class NoTruthError(InputError, TypeError):
    """A result was taken for true or false."""


class NoTruth(KnownNames):
    """Refuses to be true or false, and to be compared by ``==`` with another of its kind, which compares no figures.

    ``ask`` says what has the verdict, such as ``.stable``."""

    ask: ClassVar[str] = ".stable, which is True, False, or None where it is not known"

    def __init_subclass__(cls, ask: str = "") -> None:
        super().__init_subclass__()
        if ask:
            cls.ask = ask

    def __bool__(self) -> NoReturn:
        name = type(self).__name__
        raise NoTruthError(
            f"{name} is neither true nor false, as that could be mistaken for its verdict; ask {self.ask}"
        )

    def __eq__(self, other: object) -> bool:
        if self is other or type(self) is not type(other):
            return self is other
        name = type(self).__name__
        raise NoTruthError(
            f"== does not compare the figures of two {name} objects; compare their tables or values, such as "
            "a.table().equals(b.table()), or runs by compare(a, b)"
        )

    __hash__ = object.__hash__
