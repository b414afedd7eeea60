"""The devices that one command certifies: a name, a file, a binding and values for each."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.cases.form.schema import Value
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option

_NAME = re.compile(r"[\w+-][\w.+-]*")  # what a device may be called: its name is that of a folder


@dataclass(frozen=True)
class Device:
    # by which reports and folders call it; no two devices of a command share one, whatever the case of its letters.
    name: str
    file: Path
    binding: Path | None = None
    values: Mapping[str, Value] = field(default_factory=dict)


def devices_of(
    files: Sequence[str], bindings: Sequence[str] = (), settings: Sequence[tuple[str, Value]] = ()
) -> list[Device]:
    """The devices of a command line.

    ``files``: ``FILE`` or ``NAME=FILE``. Without a name a device is called by its file, and where several files have
    one name by their folders as well.
    ``bindings``: ``FILE`` of the only device, or ``NAME=FILE``.
    ``settings``: ``VARIABLE`` or ``NAME:VARIABLE`` with a value. The last one counts; a device's own counts before one
    of all.

    Raises `InputError` if two devices have one name, a binding does not say whose it is, a device has two, or a value
    is of a device that is not there."""
    named = [_split(text) for text in files]
    names = _names(named)
    own = _bindings(names, bindings)
    values: dict[str, dict[str, Value]] = {name: {} for name in names}
    for_one = [
        (whose, name, value) for text, value in settings for whose, name in [_whose(text, names)]
    ]
    for whose, name, value in sorted(for_one, key=lambda entry: entry[0] is not None):
        for device in names if whose is None else [whose]:
            values[device].pop(name, None)
            values[device][name] = value
    return [
        Device(name, path, own.get(name), values[name])
        for name, (_, path) in zip(names, named, strict=True)
    ]


def _split(text: str) -> tuple[str | None, Path]:
    """The name that is given, and the file; a file whose own name holds the sign stays whole."""
    name, sign, rest = text.partition("=")
    if not sign or Path(text).exists() or "/" in name or "\\" in name:
        return None, Path(text)
    if not _NAME.fullmatch(name):
        rule = (
            "since its folder gets that name; take letters, digits and ._+- with no point in front"
        )
        raise InputError(f"{text}: a device cannot be called {name!r}, {rule}")
    if not rest:
        raise InputError(f"{text}: the file of {name} is missing; write {name}=FILE.fmu")
    return name, Path(rest)


def _names(named: Sequence[tuple[str | None, Path]]) -> list[str]:
    paths = [path.parent.resolve() / path.name for _, path in named]
    found = [given or path.stem for (given, _), path in zip(named, paths, strict=True)]
    unnamed = [k for k, (given, _) in enumerate(named) if given is None]
    for stem in {name.casefold() for name in _doubles([found[k] for k in unnamed])}:
        alike = [k for k in unnamed if paths[k].stem.casefold() == stem]
        for depth in range(1, max(len(paths[k].parts) for k in alike)):
            longer = [_called(paths[k], depth) for k in alike]
            if not _doubles(longer):
                for k, name in zip(alike, longer, strict=True):
                    found[k] = name
                break
    twice = _doubles(found)
    if twice:
        name = twice[0]
        files = [
            path
            for other, (_, path) in zip(found, named, strict=True)
            if other.casefold() == name.casefold()
        ]
        remedy = " ".join(f"{name}_{number}={path}" for number, path in enumerate(files, 1))
        raise InputError(
            f"{', '.join(map(str, files))}: {len(files)} devices are called {name!r}, so that they would share one "
            f"folder for their results; give each a name of its own, as in {remedy}"
        )
    return found


def _called(path: Path, depth: int) -> str:
    """The file's name without its ending, after those of so many folders around it."""
    folders = [part for part in path.parts[:-1] if part != path.anchor]
    return "_".join([*folders[max(0, len(folders) - depth) :], path.stem])


def _doubles(names: Sequence[str]) -> list[str]:
    """Names that are there more than once; some file systems take capitals for small letters."""
    count = Counter(name.casefold() for name in names)
    return [name for name in names if count[name.casefold()] > 1]


def _bindings(names: Sequence[str], given: Sequence[str]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    for text in given:
        name, sign, rest = text.partition("=")
        if sign and name in names:
            path = Path(rest)
        elif len(names) == 1:
            name, path = names[0], Path(text)
        else:
            form = f"with several devices write NAME=FILE.toml, with NAME one of {', '.join(names)}"
            raise InputError(Option.BINDING + f" {text}: it does not say whose it is; {form}")
        if name in found:
            raise InputError(
                Option.BINDING
                + f" {text}: {name} has {found[name]} already; a device has one binding"
            )
        found[name] = path
    return found


def _whose(text: str, names: Sequence[str]) -> tuple[str | None, str]:
    name, sign, rest = text.partition(":")
    if sign and len(names) > 1 and name not in names:
        raise InputError(
            Option.SET + f" {text}: there is no device {name!r}; the devices are {', '.join(names)}"
        )
    return (name, rest) if sign and name in names else (None, text)
