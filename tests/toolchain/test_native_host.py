"""Native FMUs where there is no Python: a plain C host, many instances and threads, valgrind, Windows, Macs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import pytest

from fmus.toolchain.bill import BILL
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.compiler import TARGETS
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.devices.sandbox import wine
from tests.support.host import OK, H
from tests.support.late import LateLibrary
from tests.support.programs import compiled_program

lief = LateLibrary("lief")

HOST = Path(__file__).with_name("host") / "host.c"
CALLS = (
    "Instantiate",
    "DoStep",
    "GetReal",
    "SetReal",
    "GetFMUstate",
    "SerializeFMUstate",
    "GetDirectionalDerivative",
)


@pytest.fixture(scope="module")
def linux_host():
    if not sys.platform.startswith("linux"):
        pytest.skip("the host is compiled for Linux")
    return compiled_program(HOST, TARGETS["linux64"][0])


def arguments(directory, platform, ending, count, threads, steps):
    md = fmpy.read_model_description(str(directory), validate=False)
    references = {v.name: str(v.valueReference) for v in md.modelVariables}
    library = Path(directory) / "binaries" / platform / f"{md.modelName}{ending}"
    return [
        str(library),
        md.guid,
        str(count),
        str(threads),
        str(steps),
        references["v_re"],
        references["i_re"],
    ]


def expected(open_host, steps):
    """What a Python-backed FMU answers to the same drive."""
    h = open_host("gfor").initialise()
    for k in range(steps):
        h.set(v_re=1 + 0.01 * (k % 7))
        assert h.step(k * H) == OK
    return h.get("i_re")


def test_a_thousand_instances_on_many_threads_give_what_one_gives(linux_host, extracted, open_host):
    call = [str(linux_host), *arguments(extracted("gfor", True), "linux64", ".so", 1000, 16, 40)]
    result = subprocess.run(call, env={}, capture_output=True, text=True, check=False, timeout=120)
    assert (result.returncode, result.stderr) == (
        0,
        ("guid" in result.stderr and result.stderr) or "",
    )
    assert float(result.stdout) == expected(open_host, 40)


@pytest.mark.slow
def test_valgrind_finds_no_leak_and_no_invalid_access(linux_host, extracted):
    if shutil.which("valgrind") is None:
        pytest.skip("valgrind is not installed")
    memcheck = [
        "valgrind",
        "--leak-check=full",
        "--show-leak-kinds=all",
        "--error-exitcode=99",
        "-q",
    ]
    call = [
        *memcheck,
        str(linux_host),
        *arguments(extracted("gfor", True), "linux64", ".so", 1000, 4, 4),
    ]
    result = subprocess.run(call, env={}, capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0, result.stderr[-3000:]


# -- other platforms ---------------------------------------------------------------------------


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory):
    """The converter for all platforms, extracted."""
    fmu = export(NativeFmu(build_model("gfor")), tmp_path_factory.mktemp("everywhere"))
    folder = fmpy.extract(str(fmu))
    yield Path(folder)
    shutil.rmtree(folder)


@pytest.mark.nightly
@pytest.mark.slow
def test_another_machine_builds_the_same_file(everywhere, tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    again = Path(fmpy.extract(str(export(NativeFmu(build_model("gfor")), tmp_path))))
    files = sorted(p.relative_to(everywhere) for p in everywhere.rglob("*") if p.is_file())
    libraries = {"gfor.so", "gfor.dll", "gfor.dylib"}
    assert {p.name for p in files} == {"modelDescription.xml", Path(BILL).name, *libraries}
    assert [p for p in files if (again / p).read_bytes() != (everywhere / p).read_bytes()] == []
    shutil.rmtree(again)


@pytest.mark.slow
def test_the_windows_library_exports_fmi_and_needs_only_what_windows_has(everywhere):
    library = lief.PE.parse(str(everywhere / "binaries/win64/gfor.dll"))
    exported = {entry.name for entry in library.exported_functions}
    assert {f"fmi2{call}" for call in CALLS} <= exported
    assert {name for name in exported if not name.startswith("fmi2")} == {"gfor_step_stack"}
    imported = {entry.name.lower() for entry in library.imports}
    assert all(name == "kernel32.dll" or name.startswith("api-ms-win-crt-") for name in imported), (
        imported
    )


@pytest.mark.slow
def test_the_mac_library_holds_code_for_both_processors(everywhere):
    universal = lief.MachO.parse(str(everywhere / "binaries/darwin64/gfor.dylib"))
    kinds = {part.header.cpu_type for part in universal}
    assert kinds == {lief.MachO.Header.CPU_TYPE.X86_64, lief.MachO.Header.CPU_TYPE.ARM64}
    for part in universal:
        exported = {symbol.name for symbol in part.exported_symbols}
        assert {f"_fmi2{call}" for call in CALLS} <= exported
        assert {library.name for library in part.libraries} == {
            "@rpath/library.dylib",
            "/usr/lib/libSystem.B.dylib",
        }
        if part.header.cpu_type == lief.MachO.Header.CPU_TYPE.ARM64:
            assert part.has_code_signature  # these processors load nothing unsigned


@pytest.mark.slow
def test_the_windows_library_gives_the_same_bits_under_wine(everywhere, tmp_path, open_host):
    if shutil.which("wine") is None:
        pytest.skip("wine is not installed")
    program = compiled_program(HOST, TARGETS["win64"][0])
    environment = wine.environment(wine.make_prefix(tmp_path), os.environ)
    call = [
        wine.find_wine().loader,
        str(program),
        *arguments(everywhere, "win64", ".dll", 3, 1, 40),
    ]
    result = subprocess.run(
        call, env=environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert result.returncode == 0, result.stderr[-2000:]
    assert float(result.stdout) == pytest.approx(expected(open_host, 40), rel=1e-12)
