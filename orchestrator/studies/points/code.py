"""Hashes of this package's code: of all that computes, and of what the points of one module depend on."""

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.machinery import SourceFileLoader
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import CodeType

from fmus.toolchain.extras import installed_version

_ROOT = Path(__file__).parents[2]
_SHOWING = ("devices/acceptance", "face", "output/report", "simulation/interop")
"""Folders whose code does not change the result of any point; a test checks that the code of a point never imports
them."""

# what computes the figures beside our code; another version may give others
LIBRARIES = ("numpy", "scipy")

_SENTENCE = re.compile(r"^(?!\d)(?=.*[a-z]{2})(?=.* )(?!.*->)(?!.*;\n)", re.DOTALL)
"""Texts that tell something: docstrings, and pieces of messages. Names and values are without a space, or begin with a
digit, as ``50 Hz``."""


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
    for file in code_files():
        hasher.update(file.relative_to(_ROOT).as_posix().encode() + b"\0" + file.read_bytes())
    return hasher.hexdigest()


def _of_versions() -> "hashlib._Hash":
    return hashlib.sha256(f"{version('gfor-cosim')}\0{json.dumps(library_versions())}".encode())


def code_files() -> list[Path]:
    showing = [_ROOT / folder for folder in _SHOWING]
    files = [file for ending in ("py", "c", "h") for file in _ROOT.rglob(f"*.{ending}")]
    return sorted(file for file in files if not any(map(file.is_relative_to, showing)))


@cache
def numbers_hash(*modules: str) -> str:
    """Hash of the versions and of what computes points: some modules, and all that these import.

    Comments, docstrings and sentences do not count, and no module that is not imported. Where the files are others than
    those that this process has loaded, it is the hash of what was loaded, to the last comma.

    ``modules``: of this package, or of a plug-in, whose own package then counts as well."""
    if _hash_of_files() != code_hash():
        return code_hash()
    hasher, files = _of_versions(), _module_files(modules)
    needed = needed_modules(*modules)
    for name in sorted(needed):
        hasher.update(repr((name, list(_computing(_code(name, files[name]))))).encode())
    for file in sorted({c for name in needed for c in files[name].parent.glob("*.[ch]")}):
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
    parts = {
        file: (package, *file.relative_to(folder).with_suffix("").parts)
        for file in folder.rglob("*.py")
    }
    return {".".join(names).removesuffix(".__init__"): file for file, names in parts.items()}


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
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _computing(constant)
        elif not (isinstance(constant, str) and _SENTENCE.match(constant)):
            yield sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant


code_hash()  # now, so that it is the hash of what is loaded
