"""An IEEE/CIGRE DLL as an FMU for co-simulation by FMI 2.0.

The FMU takes along the files that text parameters of the DLL name, as the DLL runs closed off from all others."""

import contextlib
import hashlib
import json
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version as version_of
from pathlib import Path

from fmus.toolchain.archive import digest_of, guid_of, write_archive
from fmus.toolchain.c_text import identity_source
from fmus.toolchain.compiler import ENDINGS, TARGETS, compile_for, recipe
from fmus.vendor_dll.asking import ask
from fmus.vendor_dll.description import dll_description
from fmus.vendor_dll.device import Device
from fmus.vendor_dll.interface import DATA_TYPES, DllInterface
from fmus.vendor_dll.source import device_variables, host_source, host_variables
from fmus.vendor_dll.state_trial import Trial

_LIBRARIES = {"linux64": ("dl",), "win64": (), "darwin64": ()}
_LONGEST = 60  # time for a DLL to tell what it is, or for the trial, from when it is loaded [s]
_MOST_READINGS = 8
"""Of a DLL: each file that it names may make it name another, and in practice two readings are enough."""

_FORMATS = (
    (b"\x7fELF\x02", "linux64", "a library for 64-bit Linux"),
    (b"\x7fELF\x01", None, "a library for 32-bit Linux"),
    (b"MZ", "win64", "a Windows DLL"),
    (b"\xcf\xfa\xed\xfe", "darwin64", "a library for macOS"),
)

_WINDOWS_MACHINES = {
    b"\x4c\x01": "of 32 bits",
    b"\xc4\x01": "of 32 bits for ARM",
    b"\x64\xaa": "for ARM64",
}
"""Machines that nothing here runs, by the field Machine of a DLL's COFF header (Microsoft's "PE Format")."""


class DllError(ValueError):
    """A DLL cannot be made into an FMU."""


@dataclass(frozen=True)
class VendorDll:
    """A vendor's DLL, as it describes itself, with the files that its text parameters name, and where it was looked."""

    path: Path
    interface: DllInterface
    trial: Trial
    platform: str
    files: Mapping[str, Path] = field(default_factory=dict)
    looked: tuple[Path, ...] = ()

    @property
    def identifier(self) -> str:
        """Name of the FMU: the model's own, as a name in C."""
        name = re.sub(
            r"\W+", "_", self.interface.texts["ModelName"] or self.path.stem, flags=re.ASCII
        ).strip("_")
        return name if name[:1].isalpha() else f"dll_{name}"


READER = "fmus.vendor_dll.reading"  # module whose process reads a DLL


def read_dll(
    path: Path | str,
    reader: str = READER,
    also: Sequence[str] = (),
    texts: Mapping[str, str] | None = None,
    folder: Path = Path(),
) -> VendorDll:
    """Read a DLL in a process of its own, and try how it keeps its state."""
    path = Path(path).absolute()
    platform = platform_of(path, also)
    given, files = (
        {name: value for name, value in (texts or {}).items() if isinstance(value, str)},
        dict[str, Path](),
    )
    for _ in range(_MOST_READINGS):
        asked = ask(
            path,
            reader,
            _LONGEST,
            json.dumps(given | {name: str(file) for name, file in files.items()}),
        )
        answer = asked.found
        if not answer:
            again = ask(path, reader, _LONGEST)
            if not again.found:
                raise DllError(f"{path.name}: the process that reads it {again.end}: {again.why}")
            why = f"with inputs that move, the process that ran it {asked.end}: {asked.why}"
            answer = again.found | {
                "trial": Trial("not tried", why=why, passing=asked.passing).as_json()
            }
        if "error" in answer:
            raise DllError(f"{path.name}: {answer['error']}")
        interface = DllInterface.from_json(answer["interface"])
        faults = interface.faults()
        if faults:
            raise DllError(f"{path.name}: {'; '.join(faults)}; its author must mend that")
        looked = places(interface, given, path, folder)
        named = {name: place for name, place in looked.items() if place.is_file()}
        if named == files:
            break
        files = named  # known from what it declares; now it is run with them
    else:
        raise DllError(
            f"{path.name}: the files that its text parameters name are others in each of {_MOST_READINGS} readings; "
            "its author must mend that"
        )
    if asked.in_its_start and (unseen := unseen_files(interface, given, files)):
        raise DllError(f"{path.name}: the process that runs it {asked.end}; {unseen}")
    return VendorDll(
        path, interface, Trial.from_json(answer["trial"]), platform, files, tuple(looked.values())
    )


def platform_of(path: Path, also: Sequence[str] = ()) -> str:
    """FMI 2.0 name of the platform that a library is for."""
    try:
        with path.open("rb") as file:
            head = file.read(8)
    except OSError as error:
        raise DllError(f"{path.name}: cannot be read: {error.strerror}") from error
    here = {"linux": "linux64", "win32": "win64", "darwin": "darwin64"}.get(sys.platform)
    for mark, platform, words in _FORMATS:
        if head.startswith(mark):
            other = _other_windows_machine(path) if platform == "win64" else ""
            if other:
                raise DllError(
                    f"{path.name}: it is a Windows DLL {other}, and those for 64-bit x86 can be run; "
                    "ask its author for such a build"
                )
            if platform != here and platform not in also:
                raise DllError(
                    f"{path.name}: it is {words}, and this machine runs {here}; ask its author for such a build, or "
                    "build the FMU on a machine of its kind"
                )
            assert platform is not None
            return platform
    raise DllError(
        f"{path.name}: it is no shared library (it begins with {head[:4]!r}); give the vendor's .dll or .so file"
    )


def _other_windows_machine(path: Path) -> str:
    """Say for which machine a Windows DLL is, by its head; empty for 64-bit x86, and where the head does not tell."""
    with path.open("rb") as file:
        head = file.read(4096)
    at = int.from_bytes(head[60:64], "little")
    if head[at : at + 4] != b"PE\0\0":
        return ""
    return _WINDOWS_MACHINES.get(head[at + 4 : at + 6], "")


def dll_fmu(
    dll: VendorDll,
    destination: Path,
    texts: Mapping[str, str] | None = None,
    device: Device | None = None,
) -> Path:
    """Write the FMU of a DLL into a folder; it holds the DLL itself."""
    return write_archive(destination / f"{dll.identifier}.fmu", dll_members(dll, texts, device))


def dll_members(
    dll: VendorDll, texts: Mapping[str, str] | None = None, device: Device | None = None
) -> dict[str, bytes]:
    """Members of the archive, by path; otherwise as `dll_fmu`."""
    given = dict(texts or {}) | dict(device.texts if device else {})
    _check_texts(dll, given)
    interface = dll.interface.with_defaults(device.parameters) if device else dll.interface
    circuit = device.around(dll.identifier) if device else None
    variables = host_variables(interface, dll.trial)
    if device and circuit:
        variables = device_variables(interface, dll.trial, device, circuit)
    _check_names(dll, [v.name for v in variables])
    content = dll.path.read_bytes()
    file = _plain(dll.path.name)
    around = (device, circuit) if device and circuit else None
    carried = {name: f"text{n}/{_plain(at.name)}" for n, (name, at) in enumerate(dll.files.items())}
    files = {f"resources/{carried[name]}": at.read_bytes() for name, at in dll.files.items()}
    code = host_source(
        interface,
        dll.trial,
        given,
        carried=carried,
        vendor_file=file,
        variables=variables,
        around=around,
    )
    tool = f"gfor-cosim {version_of('gfor-cosim')}"

    def described(guid: str) -> bytes:
        return dll_description(
            interface,
            dll.trial,
            variables,
            guid=guid,
            identifier=dll.identifier,
            tool=tool,
            circuit=circuit,
        )

    digest = digest_of(
        code,
        described("").decode(),
        hashlib.sha256(content).hexdigest(),
        *recipe(),
        *(hashlib.sha256(held).hexdigest() for held in files.values()),
    )
    guid, (target, *_) = guid_of(digest), TARGETS[dll.platform]
    host = compile_for(
        identity_source(guid, digest) + code,
        target,
        ENDINGS[dll.platform],
        _LIBRARIES[dll.platform],
    )
    return {
        "modelDescription.xml": described(guid),
        f"binaries/{dll.platform}/{dll.identifier}{ENDINGS[dll.platform]}": host.read_bytes(),
        f"resources/{file}": content,
        **files,
    }


def _plain(name: str) -> str:
    """A file's name with nothing in it that a path or C code would take for something else."""
    return re.sub(r"[^\w.-]", "_", name, flags=re.ASCII)


def _check_texts(dll: VendorDll, given: Mapping[str, str]) -> None:
    words = {p.name for p in dll.interface.parameters if DATA_TYPES[p.data_type].kind == "String"}
    unknown = sorted(given.keys() - words)
    if unknown:
        has = ", ".join(sorted(words)) or "none"
        raise DllError(
            f"{dll.path.name}: {unknown[0]!r} is no parameter that is text; there are: {has}"
        )


def _check_names(dll: VendorDll, names: Sequence[str]) -> None:
    taken = Counter(names)
    twice = [name for name, count in taken.items() if count > 1]
    if twice:
        raise DllError(
            f"{dll.path.name}: the name {twice[0]!r} would stand for two variables of the FMU; rename it in the DLL"
        )


_LOOKS_LIKE_A_FILE = re.compile(r"[^\n]{1,900}\.[A-Za-z][A-Za-z0-9]{0,4}|[^\n]*[/\\][^\n]*")


def _values(interface: DllInterface, texts: Mapping[str, str]) -> dict[str, str]:
    words = [p for p in interface.parameters if DATA_TYPES[p.data_type].kind == "String"]
    return {p.name: texts.get(p.name, str(p.default)) for p in words}


def places(
    interface: DllInterface, texts: Mapping[str, str], library: Path, folder: Path
) -> dict[str, Path]:
    """Where files would lie that text parameters name.

    ``texts``: Values that somebody gave, absolute or from ``folder`` on.
    ``library``: The DLL, whose own defaults name files in its folder only: it must not choose what it may read."""
    found = {}
    for name, value in _values(interface, texts).items():
        with contextlib.suppress(OSError, ValueError):
            path = ((folder if name in texts else library.parent) / value).resolve()
            if value and (name in texts or library.parent.resolve() in path.parents):
                found[name] = path
    return found


def unseen_files(
    interface: DllInterface, texts: Mapping[str, str], files: Mapping[str, Path]
) -> str:
    """Which text parameters name files that the DLL does not see, and the remedy; empty where there are none."""
    named = {
        n: v
        for n, v in _values(interface, texts).items()
        if n not in files and _LOOKS_LIKE_A_FILE.fullmatch(v)
    }
    said = ", ".join(f"{name} = {value!r}" for name, value in named.items())
    return said and (
        f"it sees no files but those that its text parameters name, and of {said} there is none: put it beside the "
        "DLL, or give its path in [texts] of a device's file or with gfor fmu build --text NAME=PATH"
    )
