"""Export of a model as a Python-backed FMU (FMI 2.0 co-simulation) with pythonfmu's binaries.

The archive is written here and not by pythonfmu's own builder, because equal models must give equal
files, every bundled module needs a name of its own (all Python-backed FMUs of a process share
``sys.modules``), and the model description needs units, bounds and dependencies.
"""

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path

import pythonfmu

from fmus.toolchain.archive import digest_of, guid_of, write_archive
from fmus.toolchain.cache import cache_directory
from fmus.toolchain.compiler import ENDINGS, compile_library, host_platform, recipe
from fmus.toolchain.description import model_description
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model import Model
from fmus.toolchain.python_kernel import python_source
from fmus.toolchain.wrapper import wrapper_binaries

_SLAVE, _WRAPPER = (Path(__file__).with_name(name) for name in ("slave.py", "wrapper.py"))


def export(
    model: Model,
    destination: Path,
    platforms: tuple[str, ...] | None = None,
    extra: Mapping[str, bytes] | None = None,
) -> Path:
    """Write ``<model name>.fmu`` into a folder.

    Parameters
    ----------
    model
        What to export.
    destination
        Folder; it is created where missing.
    platforms
        FMI platforms to compile the kernel for; by default this machine's. Elsewhere the FMU
        evaluates the same equations in pure Python.
    extra
        Further members of the archive, by path.

    Returns
    -------
    pathlib.Path
        The FMU.

    Raises
    ------
    ValueError, RuntimeError
        As `compile_library`.
    """
    if platforms is None:
        host = host_platform()
        platforms = (host,) if host else ()
    return write_archive(destination / f"{model.name}.fmu", _contents(model, platforms) | dict(extra or {}))


def cached(model: Model) -> Path:
    """Return this machine's FMU of a model, building it only if it was not built before."""
    sources = _Sources(model)
    folder = cache_directory("fmus") / sources.digest[:32]
    target = folder / f"{model.name}.fmu"
    return target if target.exists() else export(model, folder)


class _Sources:
    """Everything an FMU is made from, with one hash over all of it."""

    def __init__(self, model: Model) -> None:
        self.c = c_source(model)
        self.python = python_source(model)
        self.slave = _SLAVE.read_text(encoding="utf-8")
        self.tool = f"gfor-cosim {version('gfor-cosim')} with PythonFMU {version('pythonfmu')}"
        description = model_description(model, "", model.name, self.tool).decode()
        exporter = "".join(file.read_text(encoding="utf-8") for file in (Path(__file__), _WRAPPER))
        data = json.dumps(_slave_data(model))
        self.digest = digest_of(self.c, self.python, self.slave, description, data, exporter, *recipe())
        self.guid = guid_of(self.digest)


def _contents(model: Model, platforms: tuple[str, ...]) -> dict[str, bytes]:
    sources = _Sources(model)
    tag = sources.digest[:16]
    kernel_module = f"gfor_cosim_kernel_{tag}"
    slave_module = f"gfor_cosim_slave_{tag}"
    contents: dict[str, bytes] = {
        "modelDescription.xml": model_description(model, sources.guid, model.name, sources.tool),
        "resources/slavemodule.txt": slave_module.encode(),
        f"resources/{slave_module}.py": sources.slave.encode(),
        f"resources/{kernel_module}.py": sources.python.encode(),
        "resources/model.json": json.dumps(
            _slave_data(model) | {"hash": sources.digest, "kernel_module": kernel_module}, ensure_ascii=False
        ).encode(),
    }
    for platform in platforms:
        library = compile_library(sources.c, platform)
        contents[f"resources/kernel/{platform}/kernel{ENDINGS[platform]}"] = library.read_bytes()
    package = Path(pythonfmu.__file__).parent
    for file in sorted(package.glob("*.py")):
        contents[f"resources/pythonfmu/{file.name}"] = file.read_bytes()
    for file, binary in wrapper_binaries().items():
        contents[f"binaries/{file.parent.name}/{model.name}{file.suffix}"] = binary
    return contents


def _slave_data(model: Model) -> dict[str, object]:
    """What the slave knows of its model."""
    first_input = len(model.parameters) + len(model.calculated)
    start = {index: p.start for index, p in enumerate(model.parameters)}
    start |= {first_input + index: i.start for index, i in enumerate(model.inputs)}
    return {
        "name": model.name,
        "names": list(model.value_references),
        "counts": {
            "parameters": len(model.parameters),
            "calculated": len(model.calculated),
            "inputs": len(model.inputs),
            "states": len(model.states),
            "outputs": len(model.outputs),
        },
        "parameters": [[p.type, p.minimum, p.maximum, p.tunable] for p in model.parameters],
        "start": start,
        "requirements": list(model.requirement_texts),
        "internal_step": model.value_references["internal_step"],
    }
