"""Python modules inside an FMU: its own code finds them first, and nobody else ever does.

A Python-backed FMU runs in our interpreter. Its wrapper puts the FMU's resources first on ``sys.path``, so that each
module of the FMU would stand before an installed one of that name, and stay in ``sys.modules`` for all. Here an import
looks into the FMU only where code of the FMU asks, or its binary does."""

import builtins
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from importlib.machinery import EXTENSION_SUFFIXES, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

_import = builtins.__import__


class BroughtModules:
    """The modules under an FMU's resources, for as long as it is loaded."""

    def __init__(self, resources: str) -> None:
        self.root, self._users = resources, 0
        self._places = [resources]
        self._names: set[str] | None = None
        self._shown: set[str] = set()
        self._aside: dict[str, ModuleType] = {}

    @contextmanager
    def loading(self) -> Iterator[None]:
        """While the binary's first call runs: what it imports is the FMU's; the search path stays ours."""
        if not _modules_in(self.root):
            yield
            return
        self._users += 1
        _living[self.root] = self
        _loading.append(self)
        builtins.__import__ = _imported
        self.settle()
        try:
            yield
        finally:
            _loading.remove(self)
            for top in tuple(self._shown):
                self._swap(top)
            self.settle()

    def close(self) -> None:
        """Forget them with the last instance that uses the folder."""
        self._users -= 1
        if self.root in sys.path:
            sys.path.remove(self.root)  # once for each instance
        if self._users <= 0 and self.root in _living:
            del _living[self.root]
            sys.path[:] = [place for place in sys.path if not self.holds(place)]
            if not _living:
                builtins.__import__ = _import

    def holds(self, file: object) -> bool:
        return isinstance(file, str) and (
            file == self.root or file.startswith((f"{self.root}/", f"{self.root}\\"))
        )

    def offers(self, top: str) -> bool:
        """Return whether the FMU brings this module, and not just a copy of the installed one."""
        return top in (self._names or ())

    def may_stand_first(self, top: str) -> bool:
        return self.offers(top) or bool(self._shown) or self in _loading

    def settle(self) -> None:
        """Put the FMU's folders behind all others in the search path."""
        added = [place for place in sys.path if self.holds(place)]
        if sys.path[len(sys.path) - len(added) :] != added:
            sys.path[:] = [place for place in sys.path if not self.holds(place)] + added
        self._note_folders()

    def _note_folders(self) -> None:
        new = [
            place
            for place in dict.fromkeys(sys.path)
            if self.holds(place) and place not in self._places
        ]
        if new or self._names is None:
            self._places += new
            offered = {name for place in self._places for name in _modules_in(place)}
            self._names = self._names or set()
            self._names = {name for name in offered if not self._stays(name)}

    def _stays(self, top: str) -> bool:
        """Tell if the installed one serves: no process can load compiled modules twice, and equal ones need not be."""
        if top in sys.builtin_module_names:
            return True
        files = [
            getattr(sys.modules[name], "__file__", None) or "" for name in _names(sys.modules, top)
        ]
        if any(file.endswith(tuple(EXTENSION_SUFFIXES)) for file in files):
            return True
        installed = [
            place for place in sys.path if not any(one.holds(place) for one in _living.values())
        ]
        ours = PathFinder.find_spec(top, installed)
        brought = PathFinder.find_spec(top, self._places)
        if ours is None or brought is None or not (ours.origin and brought.origin):
            return False
        if Path(brought.origin).name != "__init__.py":
            return _equal(Path(brought.origin), Path(ours.origin))
        folder, its = Path(brought.origin).parent, Path(ours.origin).parent
        return all(_equal(file, its / file.relative_to(folder)) for file in folder.rglob("*.py"))

    @contextmanager
    def seen(self, top: str, own: bool) -> Iterator[None]:
        self._note_folders()
        changed, first = (top in self._shown) != own, bool(sys.path) and self.holds(sys.path[0])
        if changed:
            self._swap(top)
        held = [place for place in sys.path if self.holds(place)]
        sys.path[:] = (self._places if own else []) + [
            place for place in sys.path if not self.holds(place)
        ]
        try:
            yield
        finally:
            rest = [place for place in sys.path if not self.holds(place)]
            held += [
                place
                for place in sys.path
                if self.holds(place) and place not in (*self._places, *held)
            ]
            sys.path[:] = held + rest if first else rest + held
            if changed:
                self._swap(top)

    def show(self, top: str) -> None:
        """Have a module stand in ``sys.modules`` while the binary loads, which takes it from there."""
        if top not in self._shown:
            self._swap(top)

    def _swap(self, top: str) -> None:
        shown, hidden = _of(sys.modules, top), _of(self._aside, top)
        sys.modules.update(hidden)
        self._aside.update(shown)
        self._shown ^= {top}


_known: dict[str, BroughtModules] = {}
_living: dict[str, BroughtModules] = {}
_loading: list[BroughtModules] = []


def brought_by(resources: Path) -> BroughtModules:
    """The modules of an FMU that lies in this folder, for all its instances: a class made for each would never go."""
    for place in [place for place in _known.keys() - _living.keys() if not os.path.exists(place)]:
        del _known[place]
    return _known.setdefault(str(resources), BroughtModules(str(resources)))


def _modules_in(place: str) -> set[str]:
    """Names of the modules and packages in a folder; to ask Python's ``pkgutil`` would import again."""
    files = list(Path(place).iterdir()) if Path(place).is_dir() else []
    endings = (".py", *EXTENSION_SUFFIXES)
    return {file.name.partition(".")[0] for file in files if file.name.endswith(endings)} | {
        folder.name for folder in files if (folder / "__init__.py").exists()
    }


def _of(modules: dict[str, ModuleType], top: str) -> dict[str, ModuleType]:
    """Take a package with all that lies in it out of a table of modules."""
    return {name: modules.pop(name) for name in _names(modules, top)}


def _names(modules: Mapping[str, ModuleType], top: str) -> list[str]:
    """Names of a package and all that lies in it; parts of one that failed to import stay without it."""
    inside, own = f"{top}.", [top] if top in modules else []
    # asked at each import, among thousands: most have no parts, which one search through all names says sooner
    if f"\n{inside}" not in "\n" + "\n".join(modules):
        return own
    return own + [name for name in modules if name.startswith(inside)]


def _equal(one: Path, other: Path) -> bool:
    return other.is_file() and one.read_bytes() == other.read_bytes()


def _imported(
    name: str,
    globals: Mapping[str, Any] | None = None,
    locals: Mapping[str, Any] | None = None,
    fromlist: Sequence[str] | None = (),
    level: int = 0,
) -> ModuleType:
    """In the place of Python's ``__import__``, as long as an FMU with modules is loaded."""
    top = (str((globals or {}).get("__package__") or "") if level else name).partition(".")[0]
    own_first = [one for one in _living.values() if one.may_stand_first(top)]
    if not own_first:  # so it is at each call into an FMU, which imports NumPy again
        return _import(name, globals, locals, fromlist or (), level)
    with ExitStack() as views:
        for brought in own_first:
            own = brought.offers(top) and brought.holds((globals or {}).get("__file__"))
            if brought.offers(top) and _by_its_binary(brought, globals):
                brought.show(top)
                own = True
            views.enter_context(brought.seen(top, own=own))
        return _import(name, globals, locals, fromlist or (), level)


def _by_its_binary(brought: BroughtModules, importer: Mapping[str, Any] | None) -> bool:
    """Return whether the FMU's binary imports: it does so in the name of FMPy, which calls it."""
    named = importer is None or str(importer.get("__name__")).partition(".")[0] in {
        "fmpy",
        "ctypes",
    }
    return named and _loading[-1:] == [brought]
