"""Tapes: the same bits as compiled code, whatever changes in a run, and no damaged one is executed."""

import ctypes
import math
import struct
import zipfile
import zlib

import numpy as np
import pytest

from fmus.toolchain import python_fmu
from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.exporter import export
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from fmus.toolchain.symbols import if_else
from fmus.toolchain.tape import tape_of
from fmus.toolchain.tape_kernel import Kernel
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from tests.support.kernels import KERNELS, compiled, tape_library, taped, vector
from tests.support.written_out import written_out

NAMES = [name for name in model_names() if not needs_arguments(name)]
_HEAD = 24  # bytes before those that the checksum is of


def bits(values):
    """To compare: every number by its bits, −0.0 apart from 0.0; a NaN is a NaN."""
    numbers = np.array(values)
    return np.where(np.isnan(numbers), -1, numbers.view(np.int64)).tolist()


@pytest.mark.parametrize("name", NAMES)
def test_a_tape_has_the_bits_of_compiled_code(name):
    """At random parameters, inputs and states, through steps, with parameters that change between them."""
    model = written_out(build_model(name))
    by_code, by_tape, random = compiled(model), taped(model), np.random.default_rng(3)
    first, nu, nx = (
        len(model.parameters) + len(model.calculated),
        len(model.inputs),
        len(model.states),
    )
    step = model.parameters[0].start
    moved, finite = set(), 0
    for _ in range(6):
        one = vector(model)
        for k, parameter in enumerate(model.parameters[1:], start=1):
            if parameter.type == "Real" and random.random() < 0.3:
                one[k] *= random.uniform(0.8, 1.25)
        two = vector(model)
        two[:] = one[:]
        for kernel, z in ((by_code, one), (by_tape, two)):
            kernel.initialise(z)
        assert bits(one) == bits(two)
        for _ in range(8):
            changed = np.array(one)
            changed[first : first + nu + nx] *= 1 + 0.1 * random.standard_normal(nu + nx)
            changed[first : first + nu + nx] += 0.01 * random.standard_normal(nu + nx)
            tuned = int(random.integers(1, len(model.parameters)))
            changed[tuned] *= random.uniform(0.5, 2.0)
            results = []
            for kernel, z in ((by_code, one), (by_tape, two)):
                z[:] = changed
                margins = (ctypes.c_double * (len(model.requirement_texts) + 1))()
                kernel.outputs(z)
                kernel.requirements(z, margins)
                kernel.derivatives(z)
                seen = [*z, *margins]
                status = kernel.advance(z, step, 2)
                results.append((status, bits(seen), bits(z)))
            assert results[0] == results[1]
            moved.add(tuple(results[0][2]))
            finite += results[0][0] == 0
    assert len(moved) == 48
    assert finite > 20


def ratio():
    """What stands for everything that is evaluated only when a parameter changes."""
    m = ModelBuilder("ratio", "A gain 1/k")
    k = m.parameter("k", 2.0, "1", "Divisor", tunable=True)
    m.parameter("further", 2.0, "1", "Nothing depends on it")
    u = m.input("u", "1", "Input", start=1.0)
    x = m.state("x", 1.0, "1", "State")
    m.derivative(x, u / k * (1 / (k * k)) - x)
    m.output("y", 1 / k, "1", "Fixed by the parameter")
    m.output("larger", u * if_else(k > 1, 3.0, -0.0), "1", "Chosen by it")
    m.require(k + 5, "k must exceed -5")
    return m.build()


@pytest.mark.parametrize("kernel", KERNELS)
def test_what_a_parameter_fixes_follows_each_of_its_changes(kernel):
    """By its bits: 0.0 after −0.0 and a NaN after a number are changes. A NaN after itself is none."""
    model = ratio()
    code, z, at = KERNELS[kernel](model), vector(model), model.value_references
    code.initialise(z)
    for value in (2.0, 0.0, -0.0, math.nan, math.nan, 4.0, -0.0, 0.0, 0.5, 2.0):
        z[at["k"]] = value
        for call in (code.outputs, lambda z: code.advance(z, 1e-4, 1)):
            z[at["y"]] = 7.0
            call(z)
            wanted = 1 / value if value else math.copysign(math.inf, value)
            if call is code.outputs or math.isfinite(wanted):
                assert bits([z[at["y"]]]) == bits([wanted])
                assert z[at["larger"]] == (3.0 if value > 1 else 0.0)
        z[at["x"]] = 1.0
        code.derivatives(z)
        rate = wanted * wanted * wanted - 1.0
        assert z[at["der(x)"]] == pytest.approx(rate, rel=1e-15, nan_ok=True)


def test_instances_with_other_parameters_take_turns():
    """Each has what its own parameters fix, though one library and one tape serve them all."""
    model = build_model("two_area_grid")
    content, at, courses = tape_of(model), model.value_references, []
    names = ["X_12", "load_1.scale"] if "X_12" in at else [p.name for p in model.parameters[1:3]]

    def started(kernel, factor):
        z = vector(model)
        for name in names:
            z[at[name]] *= factor
        kernel.initialise(z)
        return z

    def step(kernel, z, k):
        for i in range(len(model.inputs)):
            z[len(model.parameters) + len(model.calculated) + i] = math.sin(i + 0.1 * k)
        kernel.advance(z, 1e-4, 2)
        return bits(z)

    for alone in (0.5, 1.0, 2.0):
        kernel = taped(model, content)
        z = started(kernel, alone)
        courses.append([step(kernel, z, k) for k in range(20)])
    kernels = [taped(model, content) for _ in range(3)]
    instances = [
        started(kernel, factor) for kernel, factor in zip(kernels, (0.5, 1.0, 2.0), strict=True)
    ]
    by_turns = [
        [step(kernel, z, k) for kernel, z in zip(kernels, instances, strict=True)]
        for k in range(20)
    ]
    assert [list(course) for course in zip(*by_turns, strict=True)] == courses
    assert courses[0] != courses[1] != courses[2]


# -- damage --------------------------------------------------------------------------------------


def fault(content, model):
    found = tape_library().tape_fault(
        content, len(content), len(model.value_references), len(model.requirement_texts)
    )
    return found and found.decode()


def sealed(content):
    """With the checksum and the length of what it holds."""
    head = struct.pack(
        "<8s4I", *struct.unpack_from("<8sI", content), len(content), zlib.crc32(content[_HEAD:]), 0
    )
    return head + content[_HEAD:]


@pytest.fixture(scope="module")
def stiff():
    """A model with every kind of list: steps implicitly, and has parameters, numbers and rules."""
    model = build_model("gfor")
    return model, tape_of(model)


def test_any_bit_that_differs_is_found(stiff):
    model, content = stiff
    assert fault(content, model) is None
    assert sealed(content) == content
    random = np.random.default_rng(1)
    for place in {*range(_HEAD - 4), *random.integers(_HEAD, len(content), 300).tolist()}:
        damaged = bytearray(content)
        damaged[place] ^= 1 << int(random.integers(8))
        assert fault(bytes(damaged), model) is not None, place
        with pytest.raises(ValueError, match=r"^it is|^its"):
            Kernel(bytes(damaged), len(model.value_references))
    for length in (0, 7, 20, _HEAD, 100, len(content) - 1):
        assert fault(content[:length], model) in ("it is no tape", "it is not whole")


def test_an_older_version_and_another_model_are_named(stiff):
    model, content = stiff
    older = content[:8] + struct.pack("<I", 0) + content[12:]
    assert fault(older, model) == "it is of another version"
    assert fault(content, ratio()) == "it is of another model"
    for damaged, of, why in (
        (older, model, "another version"),
        (content, ratio(), "another model"),
    ):
        with pytest.raises(ValueError, match=why):
            Kernel(damaged, len(of.value_references))


@pytest.mark.parametrize("name", ["gfor", "two_area_grid", "two_area_phasor_grid"])
def test_a_tape_with_a_right_checksum_and_wrong_contents_reads_nothing_beyond_its_own(name):
    """Refused, or harmless: every operand and every list stays within what the workspace holds."""
    model, random, refused, ran = build_model(name), np.random.default_rng(5), 0, 0
    content, library = tape_of(model), tape_library()
    for place in random.integers(_HEAD // 4 + 2, len(content) // 4, 1500).tolist():
        words = np.frombuffer(content, dtype=np.int32).copy()
        words[place] = random.choice(
            [-1, 0, 1, words[place] + 1, words[place] - 1, 2**27, 2**31 - 1, len(content)]
        )
        damaged = sealed(words.tobytes())
        if fault(damaged, model) is not None:
            refused += 1
            continue
        size = library.workspace_size(damaged)
        guard = (ctypes.c_double * (size + 64))()  # up to a gigabyte, of which little is touched
        guard[size:] = [3.25] * 64
        library.begin(damaged, guard)
        z = vector(model)
        library.initialise(z, guard)
        library.advance(z, 1e-4, 2, guard)
        library.derivatives(z, guard)
        assert list(guard[size:]) == [3.25] * 64
        ran += 1
    assert refused > 500
    assert ran > 0


# -- in an FMU -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kernel", ["", "python"], ids=["compiled", "python"])
def test_an_fmu_with_a_damaged_tape_is_not_instantiated_and_says_why(
    kernel, fmu_path, tmp_path, monkeypatch, capfd
):
    monkeypatch.setenv("GFOR_COSIM_KERNEL", kernel)
    hurt = tmp_path / "hurt.fmu"
    with zipfile.ZipFile(fmu_path("two_area_grid")) as archive, zipfile.ZipFile(hurt, "w") as copy:
        for name in archive.namelist():
            content = bytearray(archive.read(name))
            if name == "resources/tape.bin":
                content[200] ^= 4
            if name.endswith(
                (".py", ".txt", ".json")
            ):  # modules of another name than those that run already
                content = content.replace(b"gfor_cosim_", b"hurt_")
            copy.writestr(name.replace("gfor_cosim_", "hurt_"), bytes(content))
    with (
        pytest.raises(ComponentError) as refused,
        LoadedComponent("device", read_description(hurt)),
    ):
        pass
    assert (
        "resources/tape.bin is damaged (its checksum differs)"
        in str(refused.value) + capfd.readouterr().err
    )


def test_without_a_compiler_a_device_runs_as_a_tape_with_the_same_bits(tmp_path, monkeypatch):
    model, courses = build_model("gfor"), []

    def started(component):
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.set({"pod_p.enabled": True})
        component.exit_initialization_mode()

    def course(path):
        rows = []
        with LoadedComponent("device", read_description(path)) as component:
            u = RealBatch(component, [i.name for i in model.inputs])
            y = RealBatch(component, [*model.value_references][-60:])

            def step(k):
                u.values[:] = start + 0.05 * math.sin(0.3 * k)
                u.write()
                component.step(k * 1e-4, 1e-4)
                rows.append(bits(y.read()))

            started(component)
            start = u.read().copy()
            for k in range(60):
                if k == 30:
                    component.set({"pod_p.K": 20.0})
                step(k)
            state = component.save_state()
            component.set({"pod_p.K": 1.0})
            step(60)
            component.restore_state(state)
            component.free_state(state)
            step(60)
            component.reset()
            started(component)
            step(0)
        assert rows[60] != rows[61]  # the parameter is restored with the state
        assert rows[62] == rows[0]
        return rows

    for missing in (False, True):
        if missing:
            monkeypatch.setattr(python_fmu, "installed_version", lambda library: "")
        path = export(PythonFmu(model), tmp_path / str(missing))
        with zipfile.ZipFile(path) as archive:
            members = [
                member for member in archive.namelist() if member.startswith("resources/kernel/")
            ]
        assert [("tape" in member) for member in members] == [missing]
        courses.append(course(path))
    assert courses[0] == courses[1]


@pytest.mark.parametrize("name", ["two_area_grid", "two_area_phasor_grid"])
def test_a_network_brings_no_code_of_its_own(name, fmu_path):
    with zipfile.ZipFile(fmu_path(name)) as archive:
        members = archive.namelist()
    assert [m for m in members if m.startswith("resources/kernel/")] == [
        "resources/kernel/linux64/tape.so"
    ]
