"""FMUs of FMI 3.0 behind the adapter: ours, somebody else's, and one with every type."""

import re
import zipfile
from pathlib import Path

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.compiler import compile_library, host_platform
from fmus.toolchain.exporter import export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.cases.built_in import two_area
from orchestrator.cases.case import load_case
from orchestrator.core.errors import ComponentError, EndedError, FmuFileError
from orchestrator.devices.acceptance.checks.all import CHECKS
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.fmi3 import adapter_path
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.sandbox.mailbox import mailbox_library
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.periodic import model_of
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.modes.modes import running

H = 1e-4
MODELS = ("gfor", "synchronous_generator_st4b", "synchronous_generator_st1")
SMALL = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="small3" instantiationToken="small3">
  <CoSimulation modelIdentifier="small3" canGetAndSetFMUState="true" canSerializeFMUState="true"
                canHandleVariableCommunicationStepSize="true"/>
  <TypeDefinitions>
    <EnumerationType name="Choice"><Item name="no" value="0"/><Item name="yes" value="1"/></EnumerationType>
  </TypeDefinitions>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent"/>
    <Float64 name="total" valueReference="1" causality="output"/>
    <Float32 name="add" valueReference="2" causality="parameter" variability="tunable" start="0.1"/>
    {integers}
    <Enumeration name="choice" valueReference="11" causality="parameter" declaredType="Choice" start="0"/>
    <Boolean name="truth" valueReference="12" causality="parameter" start="false"/>
    <Int32 name="trouble" valueReference="13" causality="parameter" variability="tunable" start="0"/>
    <Float64 name="many" valueReference="14" causality="parameter" start="1 2"><Dimension start="2"/></Float64>
    <String name="text" valueReference="15" causality="parameter"><Start value="x"/></String>
    <Clock name="clock" valueReference="16" causality="input" intervalVariability="triggered"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="1"/></ModelStructure>
</fmiModelDescription>
"""
BITS = {f"{sign}Int{bits}": bits for bits in (8, 16, 32, 64) for sign in ("", "U")}


@pytest.fixture(scope="session")
def ours(tmp_path_factory):
    """Name of a model and version of FMI → native FMU for this machine."""
    built = {}

    def build(name, version):
        if (name, version) not in built:
            folder = tmp_path_factory.mktemp(f"{name}_{version}".replace(".", "_"))
            built[name, version] = export(
                NativeFmu(build_model(name), version), folder, (host_platform(),)
            )
        return built[name, version]

    return build


@pytest.fixture
def small(tmp_path):
    """The FMU of small3.c, with another token or without its last function."""

    def write(token="small3", *, whole=True, declares=""):
        source = (Path(__file__).parent / "small3.c").read_text(encoding="utf-8")
        source = source if whole else f"#define WITHOUT_DERIVATIVE\n{source}"
        integers = "".join(
            f'<{kind} name="{kind.lower()}" valueReference="{3 + k}" causality="parameter" start="0"/>'
            for k, kind in enumerate(BITS)
        )
        path = tmp_path / "small3.fmu"
        with zipfile.ZipFile(path, "w") as archive:
            text = SMALL.format(integers=integers).replace('Token="small3"', f'Token="{token}"')
            text = text.replace("<CoSimulation", f"<CoSimulation {declares}")
            archive.writestr("modelDescription.xml", text)
            archive.writestr(
                "binaries/x86_64-linux/small3.so", compile_library(source, "linux64").read_bytes()
            )
        return read_description(path)

    return write


def initialised(component):
    component.setup(0.0, 1.0)
    component.enter_initialization_mode()
    component.exit_initialization_mode()
    return component


# -- ours ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("isolated", [False, True])
def test_both_versions_give_the_same_bits(ours, isolated):
    found = []
    for version in ("2.0", "3.0"):
        description = read_description(ours("gfor", version))
        assert (description.fmi_version, description.states_are_settable) == (version, True)
        with open_component("c", description, isolated=isolated) as c:
            c.set({"P_0": 0.5, "pod_p.enabled": True, "pod_p.N_S": 1})
            initialised(c)
            for k in range(100):
                c.set({"v_re": 1 - 0.02 * (k > 20)})
                c.step(k * H, H)
            state = c.save_state()
            content = c.serialize_state(state)
            reals = [
                n
                for n, v in description.variables.items()
                if v.type == "Real" and v.causality != "independent"
            ]
            before = c.get(reals)
            c.step(100 * H, H)
            c.restore_state(c.deserialize_state(content))
            assert c.get(reals) == before
            c.free_state(state)
            found.append((before, c.values(["pod_p.enabled", "pod_p.N_S"])))
    assert found[0] == found[1]


@pytest.mark.slow
def test_the_two_area_system_of_fmi_3(ours, tmp_path):
    """The same linear blocks to the last bit; modes to the rounding of eigenvalues of a map over 100 µs.

    By perturbation, and by directional derivatives.
    """
    found = []
    for version in ("2.0", "3.0"):
        text = (Path(two_area.__file__).parent / "case.toml").read_text(encoding="utf-8")
        for name in MODELS:
            text = text.replace(f'model = "{name}"', f'fmu = "{ours(name, version)}"')
        assert text.count('model = "') == 1  # the grid, which knows the network
        path = tmp_path / f"case_{version[0]}.toml"
        path.write_text(text, encoding="utf-8")
        case = load_case(str(path))
        (ready,) = case.prepare(["pod_pq"], {"grid.native": True})
        found.append([])
        with running(ready) as master:
            assert find_operating_point(master).residual < 1e-9
            for directional in (False, True):
                blocks = Blocks(master, directional=directional)
                values = eigenvalues(model_of(master, blocks))
                swings = [v for v in values if 0.1 < v.imag / (2 * np.pi) < 2.0]
                found[-1].append((blocks.components, np.array(swings)))
    for (blocks, modes), (others, other_modes) in zip(*found, strict=True):
        assert list(blocks) == list(others)
        for name, block in blocks.items():
            for matrix in ("A", "B", "C", "D"):
                assert np.array_equal(getattr(block, matrix), getattr(others[name], matrix)), (
                    name,
                    matrix,
                )
        assert len(modes) > 3
        assert np.allclose(modes, other_modes, rtol=0, atol=1e-7)


def test_a_refused_value_is_told_in_words_of_fmi_3(ours):
    words = "returned fmi3Discard: c: parameter P_0 = 5; it must be at most 2"
    with (
        open_component("c", read_description(ours("gfor", "3.0"))) as c,
        pytest.raises(ComponentError, match=words),
    ):
        c.set({"P_0": 5.0})


OF_ITS_EQUATIONS = ("pod", "anti_windup", "after_dips", "limits", "evenness")
"""Checks that watch for minutes what the equations do, which give the same bits in both versions."""


@pytest.mark.slow
@pytest.mark.parametrize("left_out", [OF_ITS_EQUATIONS, ()], ids=["of the interface", "all"])
def test_its_acceptance_tests_find_nothing(ours, left_out):
    """With a run as long as those of the gallery."""
    asked = tuple(name for name in CHECKS if name not in left_out)
    assert len(asked) == len(CHECKS) - len(left_out)
    report = check_fmu(ours("gfor", "3.0"), None, Limits(seconds=10.0), asked, run_for=0.5)
    assert report.failures == []
    assert report.trusted


def test_no_fmu_waits_for_a_compiler_while_it_is_checked(ours, gfor, monkeypatch):
    """It took seconds of the FMU's time limit, and a good FMU was said to hang."""
    for variable in ("GFOR_COSIM_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)  # in the home folder, as a user has it
    fmu = ours("gfor", "3.0")
    adapter_path.__wrapped__()
    mailbox_library.__wrapped__()
    monkeypatch.setenv("ZIG_LIB_DIR", str(fmu.parent))
    with pytest.raises(RuntimeError, match="the C compiler"):
        compile_library("int never_compiled_before;", host_platform())
    code, out, err = gfor("fmu", "check", fmu, "--only", "runs")
    assert (re.findall(r"^fail.*", out, re.MULTILINE), code, err) == ([], 0, "")


# -- somebody else's -------------------------------------------------------------------------------


def test_an_fmu_of_pythonfmu3(tmp_path):
    builder = pytest.importorskip("pythonfmu3.builder")
    fmu = builder.FmuBuilder.build_FMU(Path(__file__).parent / "slave3.py", dest=tmp_path)
    description = read_description(fmu)
    assert description.inputs == ("u",)
    for isolated in (False, True):
        with open_component("lag", description, isolated=isolated) as lag:
            lag.set({"T": 0.25, "order": 2, "active": True})
            initialised(lag)
            lag.set({"u": 1.0})
            y = 0.0
            for k in range(50):
                lag.step(0.01 * k, 0.01)
                y += 0.01 * 2 * (1 - y) / 0.25
            assert lag.get(["y"])["y"] == y
            assert lag.values(["order", "active"]) == {"order": 2, "active": True}


# -- every type ------------------------------------------------------------------------------------


def test_every_numeric_type_is_set_and_read(small):
    description = small()
    extremes = {
        kind.lower(): min(2 ** (bits - (kind[0] != "U")) - 1, 2**31 - 1)
        for kind, bits in BITS.items()
    }
    with open_component("c", description, isolated=False) as c:
        values = {**extremes, "choice": 1, "truth": True, "add": 0.25}
        c.set(values)
        assert c.values(values) == values
        low = {"int8": -128, "int16": -(2**15), "int32": -(2**31), "int64": -(2**31), "uint64": 0}
        c.set(low)
        assert c.values(low) == low
        initialised(c)
        for k in range(3):
            c.step(k * H, H)
        assert c.get(["total", "add", "time"]) == {"total": 0.75, "add": 0.25, "time": 3 * H}
        for name, value in (("int8", 128), ("uint8", -1), ("uint64", -1)):
            with pytest.raises(
                ComponentError, match=f"cannot be {value}: its type does not reach so far"
            ):
                c.set({name: value})


@pytest.mark.parametrize(
    ("trouble", "word"),
    [
        (
            1,
            "it ended its simulation at t = 0.0001 s by itself, which is no error; let the run stop by then",
        ),
        (2, "returned early from its step, at t = 5e-05 s"),
        (3, "at t = 0 s: fmi3DoStep returned fmi3Error: 99 % of it is broken"),
    ],
)
def test_what_a_step_may_say(small, trouble, word):
    with open_component("c", small(), isolated=False) as c:
        c.set({"trouble": trouble})
        initialised(c)
        with pytest.raises((ComponentError, EndedError), match=word):
            c.step(0.0, H)


def test_what_this_master_cannot_set_is_named(small):
    with open_component("c", small(), isolated=False) as c:
        for name, kind in (("many", "Array"), ("text", "String"), ("clock", "Clock")):
            with pytest.raises(
                Exception, match=f"variable '{name}' is of type {kind}, which cannot be set here"
            ):
                c.set({name: 1.0})


def test_no_instance(small):
    with pytest.raises(
        ComponentError,
        match=r"fmi3InstantiateCoSimulation returned no instance: 100% of the tokens are wrong #1",
    ):
        open_component("c", small(token="other"), isolated=False)


def test_a_function_that_is_missing(small):
    """One that nothing declared needs may be; one that is declared may not."""
    with open_component("c", small(whole=False), isolated=False) as c:
        initialised(c).step(0.0, H)
        with pytest.raises(
            ComponentError,
            match="fmi3GetDirectionalDerivative returned nothing: its binary has no such",
        ):
            c.jacobian(["total"], ["add"])
    declared = small(whole=False, declares='providesDirectionalDerivatives="true"')
    with pytest.raises(
        ComponentError,
        match="its binary has no function fmi3GetDirectionalDerivative, which an FMU that",
    ):
        open_component("c", declared, isolated=False)


def test_a_binary_in_the_folder_of_fmi_2(small, tmp_path):
    moved = tmp_path / "moved.fmu"
    with zipfile.ZipFile(small().path) as source, zipfile.ZipFile(moved, "w") as target:
        for name in source.namelist():
            target.writestr(name.replace("x86_64-linux", "linux64"), source.read(name))
    with pytest.raises(ComponentError, match=r"it has no binaries/x86_64-linux/small3\.so"):
        open_component("c", read_description(moved), isolated=False)


def test_what_is_no_co_simulation(small, tmp_path):
    small()
    text = SMALL.format(integers="").replace("<CoSimulation", "<ModelExchange")
    with zipfile.ZipFile(tmp_path / "exchange.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", text)
    with pytest.raises(FmuFileError, match="it is not an FMU for co-simulation"):
        read_description(tmp_path / "exchange.fmu")
