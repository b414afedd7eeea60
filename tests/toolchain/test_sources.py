"""The C source inside a native FMU: a tool that compiles it gets the same FMU."""

import shutil
import subprocess
import zipfile
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest

from fmus.toolchain.archive import write_archive
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.devices.fmi.validation import fmpys_problems
from orchestrator.face.cli import main

pytestmark = pytest.mark.slow


def simulated(path):
    change = {"droop.delta_P_ref": 0.05}
    found = fmpy.simulate_fmu(
        str(path), stop_time=0.02, step_size=1e-4, output_interval=1e-3, start_values=change
    )
    return np.array([list(row) for row in found])


def source_of(members):
    """The file that the FMU's own description names."""
    root = ElementTree.fromstring(members["modelDescription.xml"])
    (name,) = [e.get("name") for e in root.iter("File")] or [
        e.get("name")
        for e in ElementTree.fromstring(members["sources/buildDescription.xml"]).iter("SourceFile")
    ]
    return members[f"sources/{name}"]


@pytest.mark.parametrize(("version", "folder"), [("2.0", "linux64"), ("3.0", "x86_64-linux")])
def test_gcc_makes_the_same_fmu_of_it(version, folder, tmp_path):
    if shutil.which("gcc") is None:
        pytest.skip("gcc is not installed")
    path = export(NativeFmu(build_model("gfor"), version, sources=True), tmp_path, ("linux64",))
    assert fmpys_problems(path) == []
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    (tmp_path / "gfor.c").write_bytes(source_of(members))
    command = [
        "gcc",
        "-O2",
        "-std=c11",
        "-ffp-contract=off",
        "-shared",
        "-fPIC",
        "gfor.c",
        "-o",
        "gfor.so",
        "-lm",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    members[f"binaries/{folder}/gfor.so"] = (tmp_path / "gfor.so").read_bytes()
    ours, theirs = (
        simulated(path),
        simulated(write_archive(tmp_path / "theirs" / "gfor.fmu", members)),
    )
    assert len(ours) == 21
    assert np.ptp(ours, axis=0)[1:].max() > 1e-4
    np.testing.assert_allclose(theirs, ours, rtol=1e-12, atol=1e-12)


def test_without_the_option_nothing_changes():
    plain, with_source = (NativeFmu(build_model("infinite_bus"), sources=s) for s in (False, True))
    assert b"SourceFiles" not in plain.description()
    assert b"SourceFiles" in with_source.description()
    assert plain.digest == NativeFmu(build_model("infinite_bus")).digest != with_source.digest


def test_python_backed_fmus_have_no_source(tmp_path, capsys):
    assert main(["fmu", "build", "gfor", "--sources", "--dest", str(tmp_path)]) == 2
    assert "add --native" in capsys.readouterr().err
