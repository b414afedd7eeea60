"""Hashes of this package's code: of all that computes, and of what the points of one module depend on."""

import hashlib
import inspect
import json
import os
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.util import find_spec
from pathlib import Path
from types import CodeType

from fmus.toolchain.extras import installed_version

_ROOT = Path(__file__).parents[2]
_SHOWING = ("devices/acceptance", "face", "output/report", "simulation/interop")
"""Folders whose code does not change the result of any point; a test checks that the code of a point never imports
them."""

_HAS_DOCSTRING = int(getattr(inspect, "CO_HAS_DOCSTRING", 0))
"""Flag of a function with a docstring, from Python 3.14 on; before, the first constant is None without one."""

# what computes the figures beside our code; another version may give others
LIBRARIES = ("numpy", "scipy")


@cache
def library_versions() -> dict[str, str]:
    """Versions of `LIBRARIES`; empty text for one that is not installed."""
    return {library: installed_version(library) for library in LIBRARIES}


@cache
def code_hash() -> str:
    """Hash of the versions and of the code, C included, to the last comma: workers of one study have the same."""
    return _hash_of_files()


def _hash_of_files() -> str:
    hasher = _of_versions()
    for name in _code_names():
        hasher.update(name.encode() + b"\0" + (_ROOT / name).read_bytes())
    return hasher.hexdigest()


def _of_versions() -> "hashlib._Hash":
    return hashlib.sha256(
        f"{installed_version('gfor-cosim')}\0{json.dumps(library_versions())}".encode()
    )


def code_files() -> list[Path]:
    return [_ROOT / name for name in _code_names()]


def _code_names() -> list[str]:
    return sorted(_names_below(_ROOT, (".py", ".c", ".h"), _SHOWING))


def _names_below(
    folder: Path, endings: tuple[str, ...], without: tuple[str, ...] = ()
) -> Iterator[str]:
    """Names of files from a folder on, in no order; ``without``: folders that are left out.

    Paths of a thousand files take a tenth of a second to make and to compare, names a hundredth.
    """
    for place, inside, names in os.walk(folder):
        within = place[len(str(folder)) + 1 :].replace(os.sep, "/")
        start = f"{within}/" if within else ""
        inside[:] = [one for one in inside if f"{start}{one}" not in without]
        yield from (f"{start}{name}" for name in names if name.endswith(endings))


@cache
def numbers_hash(*modules: str) -> str:
    """Hash of the versions and of what computes points: some modules, and all that these import.

    Comments and docstrings do not count, and no module that is not imported; every other text counts, as it may be a
    value: words that say where a vendor's current is positive turn it. Where the files are others than
    those that this process has loaded, it is the hash of what was loaded, to the last comma.

    ``modules``: of this package, or of a plug-in, whose own package then counts as well."""
    if _hash_of_files() != code_hash():
        return code_hash()
    hasher, files = _of_versions(), _module_files(modules)
    needed = needed_modules(*modules)
    for name in sorted(needed):
        hasher.update(repr((name, list(_computing(_code(name, files[name]))))).encode())
    folders = {files[name].parent for name in needed}
    for file in sorted(c for folder in folders for c in folder.glob("*.[ch]")):
        place = file.relative_to(_ROOT) if file.is_relative_to(_ROOT) else Path(file.name)
        hasher.update(place.as_posix().encode() + b"\0" + file.read_bytes())
    return hasher.hexdigest()


def needed_modules(*modules: str) -> set[str]:
    """Some modules and all of their packages and of this one that they import, anywhere."""
    files, needed, pending = _module_files(modules), set[str](), [*modules]
    while pending:
        name = pending.pop()
        if name not in needed:
            needed.add(name)
            pending += _imported(_code(name, files[name]), files)
    return needed


def _module_files(modules: Iterable[str]) -> dict[str, Path]:
    """Files of this package, and of the packages of other modules, by the modules' names."""
    found = _files_of_package(_ROOT.name, _ROOT)
    for package in {module.partition(".")[0] for module in modules} - {_ROOT.name}:
        spec = find_spec(package)
        assert spec is not None
        for folder in spec.submodule_search_locations or ():
            found |= _files_of_package(package, Path(folder))
        if spec.submodule_search_locations is None and spec.origin is not None:
            found[package] = Path(spec.origin)
    return found


def _files_of_package(package: str, folder: Path) -> dict[str, Path]:
    return {
        f"{package}/{name}".removesuffix(".py").removesuffix("/__init__").replace("/", "."): (
            folder / name
        )
        for name in _names_below(folder, (".py",))
    }


@cache
def _code(name: str, file: Path) -> CodeType:
    code = SourceFileLoader(name, str(file)).get_code(name)
    assert code is not None
    return code


def _imported(code: CodeType, files: dict[str, Path]) -> Iterator[str]:
    here = [name for name in code.co_names if name in files]
    yield from here
    yield from (
        f"{package}.{name}"
        for package in here
        for name in code.co_names
        if f"{package}.{name}" in files
    )
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _imported(constant, files)


def _computing(code: CodeType) -> Iterator[object]:
    yield code.co_code, code.co_names, code.co_varnames, code.co_flags, code.co_exceptiontable
    yield (
        code.co_argcount,
        code.co_posonlyargcount,
        code.co_kwonlyargcount,
        code.co_freevars,
        code.co_cellvars,
    )
    docstring = _docstring(code)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _computing(constant)
        elif constant is not docstring:
            yield sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant


def _docstring(code: CodeType) -> str | None:
    """Return the docstring of a function, class or module among its constants."""
    if "__doc__" in code.co_names:  # a class or a module: the first text that is not its name
        texts = (text for text in code.co_consts if isinstance(text, str))
        return next((text for text in texts if text != code.co_qualname), None)
    first = code.co_consts[0] if code.co_consts else None
    named = not code.co_name.startswith("<")  # a comprehension has no docstring, nor a lambda
    marked = _HAS_DOCSTRING == 0 or bool(code.co_flags & _HAS_DOCSTRING)
    return first if isinstance(first, str) and named and marked else None


code_hash()  # now, so that it is the hash of what is loaded
