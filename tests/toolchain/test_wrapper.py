"""The mended binary of pythonfmu, in a host that loads an FMU, frees it, and ends."""

import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest
import pythonfmu

from fmus.toolchain.extras import SetupError
from fmus.toolchain.wrapper import wrapper_binaries

HOST = """
import ctypes, sys

class Callbacks(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("logger", "allocate", "free", "finished", "environment")]

library, guid, resources = sys.argv[1:]
logger = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int)(lambda *_: None)
callbacks = Callbacks(ctypes.cast(logger, ctypes.c_void_p))
fmu = ctypes.CDLL(library)
fmu.fmi2Instantiate.restype = ctypes.c_void_p
instance = fmu.fmi2Instantiate(b"one", 1, guid.encode(), resources.encode(), ctypes.byref(callbacks), 0, 0)
assert instance
fmu.fmi2FreeInstance(ctypes.c_void_p(instance))
print("end")
"""


def fault(library, guid, resources):
    """Whether the host's end touches memory that was freed by then."""
    python = [sys.executable, "-c", HOST, str(library), guid, resources.as_uri()]
    environment = {"PYTHONMALLOC": "malloc"}  # so that valgrind sees every block
    done = subprocess.run(["valgrind", *python], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "end\n"), done.stderr
    return "finalizePythonInterpreter" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_the_end_of_a_process_frees_nothing_twice(fmu_path, tmp_path):
    fmu = fmu_path("infinite_bus")
    folder = Path(fmpy.extract(str(fmu), str(tmp_path)))
    guid, resources = fmpy.read_model_description(str(fmu)).guid, folder / "resources"
    given = Path(pythonfmu.__file__).parent / "resources" / "binaries" / "linux64" / "libpythonfmu-export.so"
    assert fault(given, guid, resources), "pythonfmu has mended it itself: ours can go"
    assert not fault(folder / "binaries" / "linux64" / "infinite_bus.so", guid, resources)


def test_nothing_else_is_changed():
    root = Path(pythonfmu.__file__).parent / "resources" / "binaries"
    for name, mended in wrapper_binaries().items():
        given = (root / name).read_bytes()
        changed = [at for at, (old, new) in enumerate(zip(given, mended, strict=True)) if old != new]
        assert len(changed) == (name.suffix == ".so")


def test_a_pythonfmu_without_binaries_makes_no_fmu(monkeypatch, tmp_path):
    """As while pip replaces it: an FMU that can run nowhere was kept in the cache."""
    monkeypatch.setattr("pythonfmu.__file__", str(tmp_path / "__init__.py"))
    with pytest.raises(SetupError, match="install it again"):
        wrapper_binaries()
