"""Exported FMUs: valid, reproducible, self-contained, and true to the model they were made from."""

import re
import sys
import time
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from fmus.grid.grid import grid
from fmus.grid.network import Line, Load, Network, Port
from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.exporter import cached, export
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.validation import fmpys_problems

NAMES = [name for name in model_names() if not needs_arguments(name)]
STEP = 1e-4

EXCITERS = ("ac4a", "st1", "st4b")
_PODS_OPEN = {
    f"pod_{x}.{k}": v for x in "pq" for k, v in (("enabled", True), ("N_S", 3), ("limit", 1e9))
}
_BOX_OPEN = {"voltage_control.i_q_max": 1e9, "voltage_control.i_d_max": 1e9}
# The demand beside a box shows the larger component alone.
_CONVERTER_OPEN = _PODS_OPEN | {"current_limit.kind": 1, "current_limit.I_max": 1e9}
_FOLLOWING_OPEN = {"reactive_power.mode": 2, "frequency_droop.enabled": True}
_L2EP_OPEN = {
    "reactive_power.mode": 1,
    "reactive_power.support.V_1": 1.2,
    "current_limit.I_max": 0.85,
}
# Settings under which every declared path of a model carries a signal.
# without it the voltage at the filter is the droop's alone
_VIRTUAL_OPEN = {"virtual_impedance.R_v": 0.02, "virtual_impedance.X_v": 0.1}

# LVPL, the low-voltage gain and the high-voltage limit all act near the operating point.
_PLANT_OPEN = {
    "communication_step": 5e-3,
    "R_port": 0.01,
    "Brkpt": 1.3,
    "Zerox": 0.2,
    "Lvpl1": 1.33,
    "Lvpnt1": 1.1,
    "Volim": 1.0,
    "Khv": 0.5,
}

ALL_PATHS_OPEN = {
    "gfor": _CONVERTER_OPEN,
    "gfor_abc": _CONVERTER_OPEN | {"negative_sequence.R": 0.5},
    "gfor_pod_input": _CONVERTER_OPEN,
    "gfor_phasor": _PODS_OPEN | _BOX_OPEN | _VIRTUAL_OPEN | {"communication_step": 5e-3},
    "synchronous_generator": {"transformer.X_t": 0.1},  # without it v_t is the bus voltage
    "synchronous_generator_phasor": {"communication_step": 5e-3, "transformer.X_t": 0.1},
    "gfl": _FOLLOWING_OPEN,
    "gfl_phasor": _FOLLOWING_OPEN | {"communication_step": 5e-3},
    "gfl_l2ep": _L2EP_OPEN,
    "gfl_l2ep_phasor": _L2EP_OPEN | {"communication_step": 5e-3},
    "static_generation_phasor": {"communication_step": 5e-3, "R": 0.01},
    "csvgn1_phasor": {"communication_step": 5e-3, "R": 0.01},
    "csvgn3_phasor": {"communication_step": 5e-3, "R": 0.01},
    "csvgn5_phasor": {"communication_step": 5e-3, "DV": 0.5, "R": 0.01},
    "cstatt_phasor": {"communication_step": 5e-3, "R": 0.01},
    "lcc_rectifier_phasor": {"communication_step": 5e-3, "R": 0.01, "DELTI": 1.0},
    "lcc_inverter_phasor": {"communication_step": 5e-3, "R": 0.01, "V_dc_0": 495.0},
    "svsmo1_phasor": {"communication_step": 5e-3, "R": 0.01, "Tb2": 0.5, "Kps": 0.01},
    "induction_motor_phasor": {"communication_step": 5e-3, "R2": 0.05, "X2": 0.1, "A": 0.5},
    "induction_generator_phasor": {
        "communication_step": 5e-3,
        "RA": 0.01,
        "Xpp": 0.14,
        "Tpp": 0.02,
    },
    "dera1_phasor": {
        "communication_step": 5e-3,
        "R_port": 0.01,
        "Kqv": 2.0,
        "dbd1": 0.0,
        "dbd2": 0.0,
    },
    "pvd1_phasor": {
        "communication_step": 5e-3,
        "R_port": 0.01,
        "V0": 1.0,
        "V1": 1.0,
        "Xc": 0.05,
        "fdbd": 0.0,
        "Ddn": 2.0,
        **{"Vt0": 0.5, "Vt1": 0.9999, "Vt2": 1.0001, "Vt3": 1.5},
        **{"lvpnt0": 0.2, "lvpnt1": 1.0, "Vtmax": 0.7, "Khv": 2.0},
        **{"Ft0": 0.0, "Ft1": 49.999, "Ft2": 50.001, "Ft3": 500.0},
    },
    "regca1_phasor": _PLANT_OPEN,
    "wecc_plant_phasor": {"communication_step": 5e-3, "Re": 0.01},
    "regca1_repca1_phasor": _PLANT_OPEN,
    "regca1_repca1_remote_phasor": _PLANT_OPEN,
    "plant_controller_phasor": {
        **{"communication_step": 5e-3, "RefFlag": 2, "Fflag": True, "p_0": 0.5, "q_0": 0.1},
        **{"emax": 9.0, "emin": -9.0, "dbd1": 0.0, "dbd2": 0.0, "Kp": 0.1, "Tft": 0.02},
        **{"fdbd1": 0.0, "fdbd2": 0.0, "Ddn": 2.0, "Dup": 2.0, "Tg": 0.0, "Kpg": 0.1},
    },
    "regfm_b1_phasor": {
        "communication_step": 5e-3,
        "Re": 0.01,
        "kpv": 0.5,
        "VdrpFlag": True,
        "ImaxF": 0.55,
    },
    "regfm_c1_phasor": {
        "communication_step": 5e-3,
        "dbVL1": 0.0,
        "dbVH1": 0.0,
        "Vmin": 0.5,
        "PQFlag": False,
        "Imax": 0.7,
        "Kf": 0.9,
    },
    "regfm_a1_phasor": {
        "communication_step": 5e-3,
        "RL": 0.01,
        "kpv": 0.5,
        "kpqmax": 0.01,
        "ImaxF": 1.0,
    },
} | {
    f"synchronous_generator_{e}_phasor": {"communication_step": 5e-3, "machine.X_q2": 0.3}
    for e in EXCITERS
}
# Inputs without which nothing in a model moves.
FED = {
    "two_area_phasor_grid": {
        f"sg1.{k}": v for k, v in (("e_re", 1.0), ("e_im", 0.2), ("y_re", 1.0), ("y_im", -50.0))
    }
}
# Outputs that reach some listed states only where a block is left out (time constant 0), or by the flags of a plant.
BEHIND_LEFT_OUT_BLOCKS = {"P_m", "B", "I_p_command", "I_q_command"}
_IN_SERVICE = {"interruption.of_current": 1.0, "interruption.of_voltage": 1.0}
_LOW = {f"bus_voltage.{name}_re": 0.87 for name in ("once", "twice")} | _IN_SERVICE
_LOW |= {f"bus_voltage.{name}_im": 0.0 for name in ("once", "twice")}
# Values with which limits act that a model does not reach from its operating point by small changes: the inverter's
# angle, the rectifier's angle, and both.
AT_LIMITS = {
    "lcc_rectifier_phasor": (
        {"inverter.V_most": 500.0} | _IN_SERVICE,
        {"inverter.V_most": 500.0} | _IN_SERVICE | {"interruption.of_current": 0.95},
        {"inverter.V_most": 600.0} | _LOW,
        {"inverter.V_most": 600.0} | _LOW | {"interruption.of_voltage": 0.95},
        {"inverter.V_most": 494.0} | _LOW,
    )
}
# States that act at a threshold alone, which small changes do not reach.
BEHIND_THRESHOLDS = {name: {"pll.freezing.awake"} for name in ("gfl_l2ep", "gfl_l2ep_phasor")} | {
    "regfm_b1_phasor": {"delta_ITmax", "delta_ITmin", "Idf", "Qf"},  # at limits, and by VdrpFlag
    "plant_controller_phasor": {"V_filtered", "P_reference"},  # by RefFlag; Tg = 0 leaves it out
    "csvgn1_phasor": {"first", "second"},  # T5 = 0 leaves out the lag between them and the outputs
    "csvgn3_phasor": {"first", "second"},
    "csvgn5_phasor": {"measured", "first", "second"},  # the same of Ts6
    # the same of T2; and a deadband, a rating and a slow control that rest
    "svsmo1_phasor": {
        "measured",
        "gain",
        "above",
        "regulator",
        "deadband.latch",
        "slow.integrator",
    },
    "induction_motor_phasor": {"relay.latch", "relay.opening"},
    "lcc_rectifier_phasor": {
        f"interruption.{name}" for name in ("blocking", "bypassing", "switching")
    },
    "pvd1_phasor": {"trip_high_frequency.lost"},  # a share below 1 % is forgotten
}
# Blocks of the generators and the POD that the literature lets one leave out with a time constant of zero.
LEFT_OUT = {
    "gfor": {"pod_p.enabled": True, "pod_p.T_S1": 0.0, "pod_p.T_S2": 0.0, "pod_p.N_S": 1},
    "synchronous_generator_st1": {
        "exciter.T_C": 0.0,
        "exciter.T_B": 0.0,
        "governor.T_1": 0.0,
        "governor.T_2": 0.0,
    },
}


def description_of(path):
    with zipfile.ZipFile(path) as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def member_names(path):
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def initialised(path, parameters=None):
    component = LoadedComponent("device", read_description(path))
    component.setup(0.0, None)
    component.enter_initialization_mode()
    component.set(parameters or {})
    component.exit_initialization_mode()
    return component


def small(gain=2.0, text="Gain", slope=1.0, rule="K must exceed 0"):
    m = ModelBuilder("small", "A first-order lag")
    K = m.parameter("K", gain, "pu", text, base="S_n")
    u = m.input("u", "pu", "Input", base="S_n")
    x = m.state("x", 0.0, "pu", "State", base="S_n")
    m.derivative(x, slope * (K * u - x))
    m.output("y", x, "pu", "Output", base="S_n")
    m.require(K, rule)
    return m.build()


@pytest.mark.parametrize("name", NAMES)
def test_fmpy_finds_nothing_to_complain_about(name, fmu_path):
    assert fmpys_problems(fmu_path(name)) == []


@pytest.mark.parametrize("name", NAMES)
def test_equal_models_give_equal_files_at_any_time(name, tmp_path, monkeypatch):
    one = export(PythonFmu(build_model(name)), tmp_path / "one")
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 1e7)
    two = export(PythonFmu(build_model(name)), tmp_path / "two")
    assert one.read_bytes() == two.read_bytes()


CHANGES = [{"gain": 2.5}, {"text": "Another gain"}, {"slope": 3.0}, {"rule": "raise K above 0"}]


@pytest.mark.parametrize("change", CHANGES, ids=str)
def test_a_changed_model_has_another_guid(change, tmp_path):
    same = [
        description_of(export(PythonFmu(small()), tmp_path / n, platforms=())).get("guid")
        for n in "ab"
    ]
    changed = description_of(export(PythonFmu(small(**change)), tmp_path / "c", platforms=())).get(
        "guid"
    )
    assert same[0] == same[1] != changed


@pytest.mark.parametrize("name", NAMES)
def test_every_real_variable_has_a_declared_unit_and_the_bounds_of_the_model(name, fmu_path):
    root = description_of(fmu_path(name))
    units = {unit.get("name") for unit in root.iter("Unit")}
    variables = {v.get("name"): v for v in root.iter("ScalarVariable")}
    reals = [v.find("Real") for v in variables.values() if v.find("Real") is not None]
    assert {real.get("unit") for real in reals} == units
    for parameter in build_model(name).parameters:
        (kind,) = variables[parameter.name]
        assert kind.tag == parameter.type
        if parameter.type != "Boolean":
            bounds = [
                None if text is None else float(text) for text in (kind.get("min"), kind.get("max"))
            ]
            assert bounds == [parameter.minimum, parameter.maximum]


def unknowns(root, part):
    """Name of each unknown → names it depends on."""
    names = [v.get("name") for v in root.iter("ScalarVariable")]
    return {
        names[int(u.get("index")) - 1]: {names[int(k) - 1] for k in u.get("dependencies").split()}
        for u in root.iterfind(f"ModelStructure/{part}/Unknown")
    }


@pytest.mark.parametrize("name", NAMES)
def test_initial_unknowns_are_complete_and_list_every_parameter_that_moves_them(name, fmu_path):
    model = build_model(name)
    known = unknowns(description_of(fmu_path(name)), "InitialUnknowns")
    states = [s.name for s in model.states]
    computed = [v.name for v in (*model.calculated, *model.states, *model.outputs)] + [
        f"der({s})" for s in states
    ]
    assert list(known) == sorted(computed, key=list(model.value_references).index)
    moved = 0
    with LoadedComponent(
        "device", read_description(fmu_path(name))
    ) as component:  # never initialised: computed when read
        component.set(FED.get(name, {}))
        batch = RealBatch(component, computed)
        for parameter in model.parameters:
            if parameter.type == "Boolean" or parameter.name == "internal_step":
                continue
            shift = 1 if parameter.type == "Integer" else 1e-3 * abs(parameter.start) + 1e-6
            if parameter.maximum is not None and parameter.start + shift > parameter.maximum:
                shift = -shift
            before = batch.read().copy()
            component.set({parameter.name: parameter.start + shift})
            changed = {n for n, a, b in zip(computed, before, batch.read(), strict=True) if a != b}
            component.set({parameter.name: parameter.start})
            moved += len(changed)
            assert not {n for n in changed if parameter.name not in known[n]}, parameter.name
    assert moved > 0


@pytest.mark.parametrize("name", NAMES)
def test_outputs_and_derivatives_depend_on_what_they_list_and_on_nothing_else(name, fmu_path):
    model, root = build_model(name), description_of(fmu_path(name))
    listed = unknowns(root, "Outputs") | unknowns(root, "Derivatives")
    inputs = [i.name for i in model.inputs]
    outputs = [o.name for o in model.outputs]
    knowns = [*inputs, *(s.name for s in model.states)]
    random = np.random.default_rng(1)
    seen = {unknown: set() for unknown in listed}
    with initialised(fmu_path(name), ALL_PATHS_OPEN.get(name)) as component:
        x, y = RealBatch(component, knowns), RealBatch(component, list(listed))
        origin = x.read().copy()
        for values in ({}, {}, {}, {}, {}, *AT_LIMITS.get(name, ())):
            point = origin + 0.05 * random.standard_normal(len(knowns))
            point[[knowns.index(known) for known in values]] = [*values.values()]
            x.values[:] = point
            x.write()
            base = y.read().copy()
            for k, known in enumerate(knowns):
                x.values[k] = point[k] + 1e-3
                x.write()
                for unknown, a, b in zip(listed, base, y.read(), strict=True):
                    if a != b:
                        seen[unknown].add(known)
                x.values[k] = point[k]
    for unknown in listed:
        assert seen[unknown] <= listed[unknown], unknown
    for output in outputs:
        if output not in BEHIND_LEFT_OUT_BLOCKS:
            assert seen[output] == listed[output] - BEHIND_THRESHOLDS.get(name, set()), output
        assert set(component.description.feedthrough(output)) == seen[output] & set(inputs)


def test_no_two_fmus_bundle_modules_of_the_same_name(fmu_path):
    own = [
        {n for n in member_names(fmu_path(name)) if re.fullmatch(r"resources/[^/]+\.py", n)}
        for name in NAMES
    ]
    assert all(len(modules) == 3 for modules in own)
    assert len(set.union(*own)) == 3 * len(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_the_archive_needs_nothing_but_python(name, fmu_path):
    allowed = set(sys.stdlib_module_names) | {"pythonfmu"}
    with zipfile.ZipFile(fmu_path(name)) as archive:
        own = {
            n: archive.read(n).decode()
            for n in archive.namelist()
            if re.fullmatch(r"resources/[^/]+\.py", n)
        }
        assert not [n for n in archive.namelist() if "numpy" in n]
        binaries = [
            archive.read(n) for n in archive.namelist() if n.startswith("resources/kernel/")
        ]
    for text in own.values():
        imported = set(re.findall(r"^\s*(?:import|from)\s+(\w+)", text, re.MULTILINE))
        assert imported
        assert imported <= allowed | {Path(n).stem for n in own}
    assert binaries


@pytest.mark.parametrize(
    ("name", "parameters"),
    [(name, ALL_PATHS_OPEN.get(name, {})) for name in NAMES] + list(LEFT_OUT.items()),
    ids=[*NAMES, *(f"{name}-left_out" for name in LEFT_OUT)],
)
def test_compiled_and_python_kernel_agree(name, parameters, fmu_path, monkeypatch):
    """100 steps of held random inputs, large enough to meet limits."""
    path, model = fmu_path(name), build_model(name)
    inputs, outputs = [i.name for i in model.inputs], [o.name for o in model.outputs]
    internal = [s.name for s in model.states] + [f"der({s.name})" for s in model.states]
    (module,) = (n for n in member_names(path) if n.startswith("resources/gfor_cosim_kernel_"))

    def run():
        random = np.random.default_rng(2)
        with initialised(path, parameters) as component:
            u, y = RealBatch(component, inputs), RealBatch(component, outputs + internal)
            start, rows = u.read().copy(), [y.read().copy()]
            for k in range(100):
                u.values[:] = start + 0.1 * random.standard_normal(len(inputs))
                u.write()
                component.step(k * STEP, STEP)
                rows.append(y.read().copy())
        return np.array(rows)

    sys.modules.pop(module.removeprefix("resources/")[:-3], None)
    monkeypatch.delenv("GFOR_COSIM_KERNEL", raising=False)
    compiled = run()
    assert module.removeprefix("resources/")[:-3] not in sys.modules
    monkeypatch.setenv("GFOR_COSIM_KERNEL", "python")
    python = run()
    assert module.removeprefix("resources/")[:-3] in sys.modules
    assert np.ptp(compiled, axis=0).max() > 1e-3
    n = len(outputs) + len(model.states)  # derivatives multiply rounding by up to 1e4
    np.testing.assert_allclose(python[:, :n], compiled[:, :n], rtol=1e-12, atol=1e-12)
    scale = np.abs(compiled[:, n:]).max(initial=1.0)
    np.testing.assert_allclose(python[:, n:], compiled[:, n:], rtol=1e-12, atol=1e-12 * scale)


@pytest.fixture(scope="module")
def stiff_fmu():
    """A network with line charging, which the implicit integrator steps."""
    model = grid(
        Network(
            name="charged_line",
            buses=("a", "b"),
            lines=(Line("L", "a", "b", X=0.1, R=0.01, B=0.02),),
            loads=(Load("load_a", "a", p_mw=50.0), Load("load_b", "b", p_mw=80.0, q_mvar=10.0)),
            ports=(Port("one", "a"),),
        )
    )
    assert model.integrator == "sdirk"
    return cached(PythonFmu(model))


def drive_stiff(component, steps=100):
    u, y = (
        RealBatch(component, ["one.i_re", "one.i_im"]),
        RealBatch(component, component.description.outputs),
    )
    rows = []
    for k in range(steps):
        u.values[:] = 1.3 + 0.2 * np.sin(0.1 * k), 0.1 * np.cos(0.3 * k)
        u.write()
        component.step(k * STEP, STEP)
        rows.append(y.read().copy())
    return np.array(rows)


def test_a_stiff_network_is_valid_and_both_kernels_agree(stiff_fmu, monkeypatch):
    assert fmpys_problems(stiff_fmu) == []
    results = []
    for kernel in ("compiled", "python"):
        monkeypatch.setenv("GFOR_COSIM_KERNEL", kernel)
        with initialised(stiff_fmu) as component:
            results.append(drive_stiff(component))
            component.set({"load_b.scale": 2.0, "X_L": 0.05})
            results[-1] = np.vstack([results[-1], drive_stiff(component)])
    assert 0.1 < np.abs(results[0]).max() < 10
    np.testing.assert_allclose(results[1], results[0], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("kernel", ["compiled", "python"])
def test_a_restored_stiff_network_forgets_the_factors_of_other_parameters(
    stiff_fmu, kernel, monkeypatch
):
    monkeypatch.setenv("GFOR_COSIM_KERNEL", kernel)
    with initialised(stiff_fmu) as component, initialised(stiff_fmu) as other:
        drive_stiff(component)
        state = component.save_state()
        future = drive_stiff(component)
        component.set({"X_L": 0.05})
        changed = drive_stiff(component)
        drive_stiff(other, 7)  # another instance between the calls
        component.restore_state(state)
        assert np.array_equal(drive_stiff(component), future)
        component.free_state(state)
    assert not np.array_equal(changed, future)
