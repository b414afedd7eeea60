"""How an FMU is brought to life: in this process or in one of its own, behind a binding or not."""

import filecmp
from pathlib import Path

from fmus.toolchain.cache import cache_directory
from orchestrator.fmi.bound import BoundComponent, compiled_adapter
from orchestrator.fmi.component import Component
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.fmi3 import adapter_path
from orchestrator.fmi.isolation import IsolatedComponent
from orchestrator.fmi.loaded import LoadedComponent
from orchestrator.fmi.port import BoundDescription


def is_ours(path: Path) -> bool:
    """Whether an FMU is one that this machine's own toolchain built, or a copy of it to the last byte.

    What a file says of itself does not count.
    """
    built = cache_directory("fmus")
    if path.resolve().is_relative_to(built.resolve()):
        return True
    size = path.stat().st_size
    return any(file.stat().st_size == size and filecmp.cmp(path, file, shallow=False) for file in built.glob("*/*.fmu"))


def compile_adapters(description: FmuDescription) -> None:
    """Compile what an FMU runs behind, or find it compiled: a process with limits neither sees the cache nor fills it.

    Raises
    ------
    InputError
        If it cannot be compiled here.
    """
    if isinstance(description, BoundDescription):
        compiled_adapter()
        description = description.native
    if description.fmi_version == "3.0":
        adapter_path()


def open_component(
    name: str, description: FmuDescription, directory: Path | None = None, *, isolated: bool | None = None
) -> Component:
    """Instantiate an FMU.

    Parameters
    ----------
    name
        Name of the instance, used in errors and results.
    description
        The FMU; a `BoundDescription` gives a component that speaks our port.
    directory
        Where its archive is extracted; by default a new temporary folder of its own.
    isolated
        Whether it runs in a process of its own; by default all but our own FMUs do.

    Raises
    ------
    ComponentError
        If the FMU gives no instance.
    InputError
        If what it runs behind cannot be compiled.
    """
    compile_adapters(description)
    if isinstance(description, BoundDescription):
        return BoundComponent(open_component(name, description.native, directory, isolated=isolated), description)
    if isolated or (isolated is None and not is_ours(description.path)):
        return IsolatedComponent(name, description, directory)
    return LoadedComponent(name, description, directory)
