"""The recipe for a Python-backed FMU (FMI 2.0 co-simulation) with pythonfmu's binaries.

The archive is written here and not by pythonfmu's own builder, because equal models must give equal
files, every bundled module needs a name of its own (all Python-backed FMUs of a process share
``sys.modules``), and the model description needs units, bounds and dependencies."""

import json
from importlib.metadata import version
from pathlib import Path

import pythonfmu

from fmus.toolchain.archive import digest_of, guid_of
from fmus.toolchain.compiler import ENDINGS, compile_library, joined_source, library_of, recipe
from fmus.toolchain.description import model_description, with_guid
from fmus.toolchain.exporter import this_machine
from fmus.toolchain.extras import installed_version
from fmus.toolchain.kernel import c_source
from fmus.toolchain.model import Model
from fmus.toolchain.tape import LIBRARY, tape_of
from fmus.toolchain.wrapper import wrapper_binaries

_SLAVE, _WRAPPER, _TAPE_KERNEL = (
    Path(__file__).with_name(name) for name in ("slave.py", "wrapper.py", "tape_kernel.py")
)

_IN_C = Path(__file__).with_name("c") / "slave.c"

_EXECUTED = """import ctypes
from {} import Slave
ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))
"""
"""Code that the wrapper executes for each instance: a class that were made there would stay in memory.

The wrapper also gives back the module's dictionary, which it never took.
"""


class PythonFmu:
    """All parts of a Python-backed FMU, with one hash over them."""

    cache_prefix = ""

    def __init__(self, model: Model) -> None:
        self.model = model
        self._tape = tape_of(model)
        compiled = model.compiled and installed_version("ziglang")
        self._c = c_source(model) + _IN_C.read_text(encoding="utf-8") if compiled else ""
        code = self._c or joined_source(*LIBRARY)
        self._python = _TAPE_KERNEL.read_text(encoding="utf-8")
        self._slave = _SLAVE.read_text(encoding="utf-8")
        self._tool = f"gfor-cosim {version('gfor-cosim')} with PythonFMU {version('pythonfmu')}"
        self._description = description = model_description(
            model, "", model.name, self._tool
        ).decode()
        exporter = "".join(file.read_text(encoding="utf-8") for file in (Path(__file__), _WRAPPER))
        data = json.dumps(_slave_data(model))
        self.digest = digest_of(
            self._tape.hex(),
            code,
            self._python,
            self._slave,
            description,
            data,
            exporter,
            *recipe(),
        )

    def default_platforms(self) -> tuple[str, ...]:
        return this_machine()

    def host_platforms(self) -> tuple[str, ...]:
        """That of this machine; where there is none, the FMU evaluates its equations in pure Python."""
        return this_machine()

    def description(self) -> bytes:
        """The text of modelDescription.xml, for which nothing is compiled."""
        return with_guid(self._description, guid_of(self.digest))

    def contents(self, platforms: tuple[str, ...]) -> dict[str, bytes]:
        """The archive's members, with a kernel for each platform [FMI 2.0 names]."""
        model, tag = self.model, self.digest[:16]
        kernel_module = f"gfor_cosim_kernel_{tag}"
        slave_module, class_module = f"gfor_cosim_slave_{tag}", f"gfor_cosim_class_{tag}"
        contents: dict[str, bytes] = {
            "modelDescription.xml": self.description(),
            "resources/slavemodule.txt": slave_module.encode(),
            f"resources/{slave_module}.py": _EXECUTED.format(class_module).encode(),
            f"resources/{class_module}.py": self._slave.encode(),
            f"resources/{kernel_module}.py": self._python.encode(),
            "resources/tape.bin": self._tape,
            "resources/model.json": json.dumps(
                _slave_data(model) | {"hash": self.digest, "kernel_module": kernel_module},
                ensure_ascii=False,
            ).encode(),
        }
        for platform in platforms:
            name, library = (
                ("kernel", compile_library(self._c, platform))
                if self._c
                else ("tape", library_of(platform, *LIBRARY))
            )
            contents[f"resources/kernel/{platform}/{name}{ENDINGS[platform]}"] = (
                library.read_bytes()
            )
        package = Path(pythonfmu.__file__).parent
        for file in sorted(package.glob("*.py")):
            contents[f"resources/pythonfmu/{file.name}"] = file.read_bytes()
        for file, binary in wrapper_binaries().items():
            contents[f"binaries/{file.parent.name}/{model.name}{file.suffix}"] = binary
        return contents


def _slave_data(model: Model) -> dict[str, object]:
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
