"""How an FMU is brought to life: in this process or in one of its own, behind a binding or not."""

import filecmp
from functools import cache
from pathlib import Path

from fmus.toolchain.cache import cache_directory, intact
from orchestrator.devices.fmi.bound_component import BoundComponent, compiled_adapter
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.converted_component import (
    ConvertedComponent,
    ConvertedDescription,
    native,
)
from orchestrator.devices.fmi.description import FmuDescription, runs_under_wine
from orchestrator.devices.fmi.fmi3 import adapter_path
from orchestrator.devices.fmi.isolated_component import IsolatedComponent
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.devices.sandbox.compiled_programs import compile_programs
from orchestrator.devices.sandbox.protections_in_force import Protection


def is_ours(path: Path) -> bool:
    """Return whether an FMU is one that this machine's own toolchain built, or a copy of it to the last byte.

    What a file says of itself does not count, nor does its place: a built file that was changed since is a stranger."""
    built = cache_directory("fmus")
    if path.resolve().is_relative_to(_resolved(built)):
        return intact(path) or not path.exists()  # described already, and built before it runs
    found = path.stat()
    seen = (
        path,
        found.st_size,
        found.st_mtime_ns,
        built,
        built.exists() and built.stat().st_mtime_ns,
    )
    if seen in _STRANGERS:
        return False
    is_copy = any(
        file.stat().st_size == found.st_size
        and filecmp.cmp(path, file, shallow=False)
        and intact(file)
        for file in built.glob("*/*.fmu")
    )
    if not is_copy:
        _STRANGERS.add(seen)
    return is_copy


_STRANGERS: set[tuple[object, ...]] = set()
"""Files that were compared with every built FMU and are no copy of one, with what both were like then.

A run asks some twenty times, and a cache may hold hundreds. Whoever counts as a stranger too long only runs in a
process of its own; that a file is ours is looked at each time."""


@cache
def _resolved(folder: Path) -> Path:
    """A folder without links; one that is elsewhere later holds no file that is ours by its place alone."""
    return folder.resolve()


def compile_adapters(description: FmuDescription) -> None:
    """Compile what an FMU runs behind, or find it compiled: a process with limits does not see the cache."""
    description = native(description)
    if isinstance(description, BoundDescription):
        compiled_adapter()
        description = description.inner
    if description.fmi_version == "3.0":
        adapter_path()
    if runs_under_wine(description):
        compile_programs()


def is_isolated(description: FmuDescription, isolated: bool | None) -> bool:
    """Return whether an FMU runs in a process of its own: as asked, else where it is not one of ours."""
    if isolated is not None:
        return isolated
    return not is_ours(description.path)


def open_component(
    name: str,
    description: FmuDescription,
    directory: Path | None = None,
    *,
    isolated: bool | None = None,
) -> Component:
    """Instantiate an FMU; behind a `BoundDescription` it speaks our port, and behind a `ConvertedDescription` it takes
    and gives what its connections carry.

    ``directory``: where its archive is extracted; by default a new temporary folder of its own.
    ``isolated``: whether it runs in a process of its own; by default all but our own FMUs do."""
    compile_adapters(description)
    if isinstance(description, ConvertedDescription):
        return ConvertedComponent(
            open_component(name, description.inner, directory, isolated=isolated), description
        )
    if isinstance(description, BoundDescription):
        return BoundComponent(
            open_component(name, description.inner, directory, isolated=isolated), description
        )
    if is_isolated(description, isolated):
        return IsolatedComponent(name, description, directory)
    return LoadedComponent(name, description, directory, ours=is_ours(description.path))


def protections_of(component: Component) -> tuple[Protection, ...]:
    """Return what keeps a component's FMU from the rest of the machine; nothing where it runs in this process."""
    if isinstance(component, BoundComponent | ConvertedComponent):
        return protections_of(component.inner)
    return component.protections if isinstance(component, IsolatedComponent) else ()
