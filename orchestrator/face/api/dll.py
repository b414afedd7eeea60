"""IEEE/CIGRE DLLs: FMUs of those that vendors deliver, and our own control as one."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from fmus.toolchain.extras import require
from orchestrator.core.asked import names
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.vendor_files import DEVICE_ENDING, READER, foreign_platforms

KEPT_IN = {
    "arrays": "its state is in the host's arrays: it can be saved, restored and perturbed",
    "library": "it keeps state in variables of its own: each instance gets a copy of the library, whose writable "
    "memory is part of the state",
    "hidden": "it keeps state where a host cannot save it, so it can be run and measured from outside "
    "(`gfor modes --black-box`), and not perturbed",
    "not tried": "how it keeps its state could not be tried, so its state is not saved",
}
"""Where a DLL keeps its state, and the way that is chosen for it."""


class BuiltDll(NamedTuple):
    """The FMU of a DLL.

    Attributes
    ----------
    path
        Of the FMU.
    told
        What was found out about the DLL, in lines.
    """

    path: Path
    told: tuple[str, ...]


def build_from_dll(
    dll: str | Path, folder: str | Path = ".", *, texts: Mapping[str, str] | None = None
) -> BuiltDll:
    """Make an FMU of a vendor's controller, which was delivered as IEEE/CIGRE DLL.

    Parameters
    ----------
    dll
        The vendor's ``.so`` or ``.dll``, for this machine; or a device's file, which lays a circuit around one.
    folder
        Where the FMU is written.
    texts
        Value of parameters that are text, by name, for good. A file that one names goes into the FMU.

    Raises
    ------
    InputError
        If the file is no such DLL, or declares what no host can run.
    MissingLibraryError
        If the extra that builds FMUs is not installed.
    """
    require("building FMUs", "ziglang")
    from fmus.vendor_dll.device import DeviceFileError, device_of, read_device_file  # noqa: PLC0415 - as below
    from fmus.vendor_dll.fmu import DllError, dll_fmu, read_dll  # noqa: PLC0415 - needs the extra `build`

    try:
        library, table = Path(dll), None
        if library.suffix.lower() == DEVICE_ENDING:
            library, table = read_device_file(library)
        also = foreign_platforms(library)
        of_device = (table or {}).get("texts")
        given = {**(of_device if isinstance(of_device, dict) else {}), **(texts or {})}
        place = Path(dll).parent if table else Path()
        read = (
            read_dll(library, READER, also, given, place)
            if also
            else read_dll(library, texts=given, folder=place)
        )
        device = None if table is None else device_of(Path(dll), table, read.interface)
        path = dll_fmu(read, Path(folder), texts, device)
    except (DllError, DeviceFileError) as error:
        raise InputError(str(error)) from error
    interface, trial = read.interface, read.trial
    counts = ", ".join(
        f"{n} {kind}"
        for n, kind in zip(interface.states, ("integer", "float", "double"), strict=True)
        if n
    )
    rate = (
        f"a sample every {interface.sample_time:g} s"
        if interface.sample_time > 0
        else "a sample in every step"
    )
    about = (
        f"{interface.texts['ModelName']} {interface.texts['ModelVersion']}".strip()
        or read.path.name
    )
    why = f" ({trial.why})" if trial.why else ""
    moving = len(trial.doubles) + len(trial.floats)
    return BuiltDll(
        path,
        (
            f"{about}: {rate}; declared states: {counts or 'none'}",
            f"state: {KEPT_IN[trial.state]}{why}"
            + (f"; {moving} numbers there move" if moving else ""),
        ),
    )


class ExportedDll(NamedTuple):
    """A control part as IEEE/CIGRE DLL.

    Attributes
    ----------
    libraries
        Paths by platform.
    sheet
        The data sheet: what the host builds around the control.
    """

    libraries: dict[str, Path]
    sheet: Path


def export_dll(
    name: str,
    folder: str | Path = ".",
    *,
    platforms: Sequence[str] | None = None,
    sample_time: float = 2e-5,
    values: Mapping[str, float] | None = None,
    report: Callable[[str], None] = lambda text: None,
) -> ExportedDll:
    """Write the control part of a converter as IEEE/CIGRE DLL, for EMT programs.

    Parameters
    ----------
    name
        Of the converter, such as ``"gfor"``.
    folder
        Where the libraries' folders and the data sheet are written.
    platforms
        Of ``"linux64"``, ``"win32"``, ``"win64"``; by default all.
    sample_time
        Between two calls of the control [s].
    values
        Other defaults of the DLL's parameters, by name; Booleans as 0 or 1.
    report
        Called with a sentence before each part of the work.

    Raises
    ------
    InputError
        If there is no such control part, or it cannot be written like that.
    MissingLibraryError
        If the extra that builds FMUs is not installed.
    """
    require("writing a DLL", "ziglang")
    from fmus.control_dll import export  # noqa: PLC0415 - needs the extra `build`

    place = path_of(folder, "folder", "folder")
    chosen = tuple(export.DLL_TARGETS) if platforms is None else names(platforms, "platforms")
    try:
        written = export.write_dll(
            export.control_part_of(name), place, chosen, sample_time, values, report
        )
    except export.ControlDllError as error:
        raise InputError(str(error)) from error
    return ExportedDll(written.libraries, written.sheet)
