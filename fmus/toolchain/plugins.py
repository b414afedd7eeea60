"""Plug-ins: what installed distributions declare under this project's entry-point groups.

Models, studies, grid codes, acceptance checks, readers of recordings, engines and masters are found here by name. Ours
are declared in pyproject.toml, others' in the same way in theirs.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cache, cached_property
from importlib.metadata import Distribution, EntryPoint, entry_points
from types import ModuleType
from typing import Any, Generic, TypeVar

from fmus.toolchain.extras import SetupError

OWN = "gfor-cosim"
"""Name of our distribution: each group has at least one entry of it."""

Kind = TypeVar("Kind")


class PlugInError(SetupError):
    """An installed plug-in cannot be used; the message names its distribution."""


@cache
def entries_of(group: str) -> Mapping[str, tuple[EntryPoint, ...]]:
    """Entries of a group by name, those of our distribution first.

    A name has several entries if several distributions declare it.

    Raises
    ------
    SetupError
        If our own distribution declares none: its installed metadata are older than the code.
    """
    entries = sorted(_all_entries().select(group=group), key=lambda entry: not is_own(entry))
    if not any(map(is_own, entries)):
        raise SetupError(
            f"the installed metadata of {OWN} declare no {group!r}: they are older than its code. Install it again: "
            f"`pip install -e .` in the checkout, or `pip install --force-reinstall --no-deps {OWN}`"
        )
    by_name: dict[str, tuple[EntryPoint, ...]] = {}
    for entry in entries:
        by_name[entry.name] = (*by_name.get(entry.name, ()), entry)
    return by_name


@cache
def _all_entries() -> Any:
    """Entries of all groups, read once: looking through all distributions takes tens of milliseconds."""
    return entry_points()


def is_own(entry: EntryPoint) -> bool:
    """Return whether our own distribution declares an entry."""
    return _name_of(entry.dist) == OWN


@cache
def _name_of(distribution: Distribution | None) -> str:
    """Name of a distribution, whose metadata are parsed for it."""
    return "an unknown distribution" if distribution is None else distribution.name


def source_of(entry: EntryPoint) -> str:
    """Name and version of the distribution that declares an entry."""
    version = "" if entry.dist is None else f" {entry.dist.version}"
    return f"{_name_of(entry.dist)}{version}"


def entry_of(group: str, name: str) -> EntryPoint:
    """Give the one entry of a name.

    Raises
    ------
    KeyError
        If there is none.
    PlugInError
        If several distributions declare it.
    """
    entry, *others = entries_of(group)[name]
    if others:
        both = " and ".join(source_of(one) for one in (entry, *others))
        raise PlugInError(
            f"{both} declare the same {group} {name!r}; uninstall one of them, or rename it there"
        )
    return entry


def load(entry: EntryPoint, kind: type | tuple[type, ...]) -> Any:
    """Import what an entry declares, which has to be of a kind.

    Raises
    ------
    PlugInError
        If it cannot be imported or is of another kind.
    """
    declares = f"{source_of(entry)} declares {entry.group} {entry.name!r} as {entry.value}"
    try:
        found = entry.load()
    except (
        Exception
    ) as error:  # a stranger's module may raise anything; ours say themselves what is wrong
        if is_own(entry):
            raise
        reason = f"{type(error).__name__}: {error}"
        raise PlugInError(
            f"{declares}, which cannot be imported ({reason}); mend or uninstall it"
        ) from error
    if not isinstance(found, kind):
        raise PlugInError(
            f"{declares}, which is of the type {type(found).__name__}; it has to be a {_in_words(kind)}"
        )
    return found


def _in_words(kind: type | tuple[type, ...]) -> str:
    kinds = kind if isinstance(kind, tuple) else (kind,)
    return " or ".join(one.__name__ for one in kinds)


class PlugIns(Mapping[str, Kind], Generic[Kind]):
    """Objects of a group by the names of their entries, each imported where it is first asked for.

    ``kinds``: gives the types that an object may have."""

    def __init__(self, group: str, kinds: Callable[[], tuple[type, ...]]) -> None:
        self.group = group
        self._kinds = kinds
        self._loaded: dict[str, Kind] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(entries_of(self.group))

    def __len__(self) -> int:
        return len(entries_of(self.group))

    def __contains__(self, name: object) -> bool:
        return name in entries_of(self.group)

    def __getitem__(self, name: str) -> Kind:
        if name not in self._loaded:
            self._loaded[name] = load(self.entry(name), self._kinds())
        return self._loaded[name]

    def entry(self, name: str) -> EntryPoint:
        """Give the entry of a name; its object need not be imported."""
        return entry_of(self.group, name)


class Collections(Mapping[str, Kind], Generic[Kind]):
    """Objects of a group whose entries are mappings: each has objects by name, kept in its order."""

    def __init__(self, group: str, kind: type[Kind] | tuple[type, ...]) -> None:
        self.group = group
        self._kind = kind

    @cached_property
    def _objects(self) -> dict[str, tuple[EntryPoint, Kind]]:
        found: dict[str, tuple[EntryPoint, Kind]] = {}
        for name in entries_of(self.group):
            entry = entry_of(self.group, name)
            for key, value in load(entry, Mapping).items():
                self._check(entry, key, value)
                if key in found:
                    both = f"{source_of(found[key][0])} and {source_of(entry)}"
                    raise PlugInError(
                        f"{both} have the same {self.group} {key!r}; uninstall one of them, or rename it there"
                    )
                found[key] = (entry, value)
        return found

    def _check(self, entry: EntryPoint, key: object, value: object) -> None:
        if not isinstance(value, self._kind):
            raise PlugInError(
                f"{source_of(entry)}: {entry.value} has {key!r} of the type {type(value).__name__}; "
                f"{self.group} has to be a {_in_words(self._kind)}"
            )

    def __iter__(self) -> Iterator[str]:
        return iter(self._objects)

    def __len__(self) -> int:
        return len(self._objects)

    def __getitem__(self, name: str) -> Kind:
        return self._objects[name][1]

    def module_of(self, name: str) -> str:
        """Give the module that declares an object: what depends on the object depends on it."""
        return self._objects[name][0].module


def import_modules(group: str) -> None:
    """Import the modules that a group declares, ours first; importing them enters what they hold."""
    for name in entries_of(group):
        load(entry_of(group, name), ModuleType)
