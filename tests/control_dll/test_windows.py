"""The DLLs for Windows: what both export, and that of 64 bits under Wine beside the FMU's library for Windows.

That of 32 bits was run by hand: a Wine of 64 bits alone ends such programs without a word.
"""

import os
import shutil

import numpy as np
import pytest

from fmus.control_dll.export import DLL_TARGETS
from orchestrator.devices.sandbox import wine
from tests.control_dll.conftest import PODS
from tests.control_dll.hosts import HOST, driven, fmu_call
from tests.support.late import LateLibrary
from tests.support.programs import compiled_program

pytestmark = pytest.mark.slow
lief = LateLibrary("lief")

GIVEN = [f"{name.replace('.', '_')}={value}" for name, value in PODS.items()]
MACHINES = {"win64": "AMD64", "win32": "I386"}
FUNCTIONS = (
    "GetInfo",
    "PrintInfo",
    "FirstCall",
    "CheckParameters",
    "Initialize",
    "Outputs",
    "Iterate",
    "Terminate",
)


@pytest.mark.parametrize("platform", MACHINES)
def test_the_library_exports_the_interface_under_plain_names(written, platform):
    library = lief.PE.parse(str(written(platform).libraries[platform]))
    assert library.header.machine.name == MACHINES[platform]
    assert {entry.name for entry in library.get_export().entries} == {
        f"Model_{name}" for name in FUNCTIONS
    }


@pytest.fixture(scope="module")
def under_wine(tmp_path_factory, written, drive):
    """Signals of a platform's DLL, or of the FMU's library for Windows of 64 bits."""
    if shutil.which("wine") is None:
        pytest.skip("wine is not installed")
    prefix = wine.make_prefix(tmp_path_factory.mktemp("wine"))
    environment = wine.environment(prefix, os.environ)

    def run(platform, call):
        program = compiled_program(HOST, DLL_TARGETS[platform][0])
        words = [wine.find_wine().loader, program, *call]
        return driven(words, drive, tmp_path_factory.mktemp(platform), environment=environment)[0]

    return run


def test_under_wine_64_bits_are_the_fmus_to_the_last_bit(
    part, written, under_wine, drive, tmp_path
):
    ours = under_wine("win64", ["dll", written("win64").libraries["win64"], "IN", "OUT", *GIVEN])
    call, _ = fmu_call(part, PODS, tmp_path, "win64")
    assert len(ours) == len(drive)
    assert np.array_equal(ours, under_wine("win64", call))
