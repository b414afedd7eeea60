"""Native FMUs: the same answers as the Python-backed ones, exact derivatives, and a status for every bad call."""

import math
import re
import zipfile
from dataclasses import replace

import fmpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.exporter import cached, export
from fmus.toolchain.native_fmu import NativeFmu
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.devices.fmi.validation import fmpys_problems
from tests.support.host import DISCARD, ERROR, GENERATOR, OK, H, running

MODELS = [name for name in model_names() if not needs_arguments(name)]
SOME = ["gfor", "gfor_abc", "gfor_phasor", "two_area_phasor_grid", GENERATOR, "two_area_grid"]


# -- the file ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MODELS)
def test_a_native_fmu_is_valid_and_carries_no_python(name, fmu_path, extracted):
    path = fmu_path(name, True)
    assert fmpys_problems(path) == []
    md = fmpy.read_model_description(str(path), validate=True)  # against the standard's schema
    assert md.coSimulation.providesDirectionalDerivative
    assert not md.coSimulation.needsExecutionTool
    assert read_description(path).states_are_settable
    with zipfile.ZipFile(path) as archive:
        others = [
            n for n in archive.namelist() if n.startswith("resources") or "python" in n.lower()
        ]
    assert others == (["resources/model.bin"] if build_model(name).kind == "network" else [])


def test_equal_models_give_equal_files(tmp_path):
    model = build_model("two_area_grid")
    first, second = (export(NativeFmu(model), tmp_path / part, ("linux64",)) for part in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_a_wrong_guid_gives_no_instance_and_says_why(extracted):
    description = read_description(cached(NativeFmu(build_model("gfor"))))
    with LoadedComponent("good", description) as component:
        assert component.get(["S_n"]) == {"S_n": 1500.0}
    # a part of the right one passes our own check
    wrong = replace(description, guid=description.guid[:-3])
    with pytest.raises(ComponentError, match=r"the guid \S+ is not this FMU's, which is \{"):
        LoadedComponent("wrong", wrong)


# -- the same answers --------------------------------------------------------------------------


@pytest.mark.parametrize("name", SOME)
def test_both_kinds_give_the_same_bits(name, open_host):
    backed, native = (open_host(name, native=kind) for kind in (False, True))
    assert native.everything() == backed.everything()
    assert native.initialise().everything() == backed.initialise().everything()
    assert native.run(200) == backed.run(200)
    assert native.log == backed.log == []


def test_both_kinds_give_the_same_bits_with_controllers_and_limits(open_host):
    rows = []
    for kind in (False, True):
        h = open_host("gfor", native=kind)
        h.set(P_0=0.7, Q_0=0.1, v_0=1.02)
        h.fmu.setInteger([h.vr["pod_q.N_S"]], [1])
        h.initialise()
        h.fmu.setBoolean([h.vr["pod_p.enabled"], h.vr["pod_q.enabled"]], [True, True])
        h.set(pod_p__limit=1e-4)
        rows.append(h.run(500))
    assert rows[0] == rows[1]


# -- derivatives -------------------------------------------------------------------------------


def variables(h):
    """Value references by role."""
    md = h.md
    states = [d.variable.derivative for d in md.derivatives]
    return {
        "inputs": [v.valueReference for v in md.modelVariables if v.causality == "input"],
        "states": [v.valueReference for v in states],
        "outputs": [v.valueReference for v in md.modelVariables if v.causality == "output"],
        "rates": [d.variable.valueReference for d in md.derivatives],
        "tunable": [
            v.valueReference
            for v in md.modelVariables
            if v.variability == "tunable" and v.type == "Real"
        ],
        "fixed": [
            v.valueReference
            for v in md.modelVariables
            if v.causality == "parameter" and v.variability == "fixed" and v.type == "Real"
        ],
    }


def test_a_derivative_that_is_not_finite_is_refused_by_name(open_host):
    """The magnitude of a voltage has none at zero."""
    h = open_host("two_area_grid", native=True).initialise()
    h.set(
        **dict.fromkeys(
            ("sg1__i_re", "sg1__i_im", "gfor__i_re", "gfor__i_im", "sg2__i_re", "sg2__i_im"), 0.0
        )
    )
    h.set(**{"L.i_re": 0.0, "L.i_im": 0.0})
    assert h.status(derivative_of("bus_2.v", "sg1.i_re"), h) == DISCARD
    assert "bus_2.v is not finite" in h.log[-1]


def central(read, write, reference, size):
    """d(read) by one variable, extrapolated from two sizes."""
    value = write.get_value(reference)

    def quotient(step):
        write.set_value(reference, value + step)
        ahead = np.array(read())
        write.set_value(reference, value - step)
        behind = np.array(read())
        write.set_value(reference, value)
        return (ahead - behind) / (2 * step)

    return (4 * quotient(size / 2) - quotient(size)) / 3


def inside(h, references):
    """Those whose values lie well within their bounds, so that they can be moved both ways."""
    values = dict(zip(references, h.fmu.getReal(references), strict=True))
    bounds = {
        r: (float(v.min or -math.inf), float(v.max or math.inf))
        for r, v in enumerate(h.md.modelVariables)
    }
    return [r for r, value in values.items() if bounds[r][0] + 1e-3 < value < bounds[r][1] - 1e-3]


class Reals:
    """Real variables of an instance by reference."""

    def __init__(self, h):
        self._fmu = h.fmu

    def get_value(self, reference):
        return self._fmu.getReal([reference])[0]

    def set_value(self, reference, value):
        self._fmu.setReal([reference], [value])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", SOME)
def test_directional_derivatives_equal_central_differences_at_random_states(name, seed, open_host):
    h = open_host(name, native=True).initialise()
    h.run(20)
    role, random = variables(h), np.random.default_rng(seed)
    x = np.array(h.fmu.getReal(role["states"]))
    h.fmu.setReal(role["states"], list(x + 0.02 * random.standard_normal(len(x))))
    unknowns = role["outputs"] + role["rates"]
    for reference in role["inputs"] + role["states"] + inside(h, role["tunable"])[:6]:
        exact = np.array(h.fmu.getDirectionalDerivative(unknowns, [reference], [1.0]))
        difference = central(lambda: h.fmu.getReal(unknowns), Reals(h), reference, 1e-4)
        scale = np.maximum(1.0, np.abs(exact))
        assert np.abs(exact - difference).max() <= 1e-6 * max(scale.max(), 1.0)


def test_a_directional_derivative_is_linear_in_its_seeds(open_host):
    h = running(open_host("gfor", native=True))
    role = variables(h)
    known, seeds = role["inputs"] + role["states"], np.linspace(-1, 1, 2 + len(role["states"]))
    single = [h.fmu.getDirectionalDerivative(role["rates"], [r], [1.0]) for r in known]
    together = h.fmu.getDirectionalDerivative(role["rates"], known, list(seeds))
    np.testing.assert_allclose(together, seeds @ np.array(single), rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("name", SOME)
def test_in_initialisation_derivatives_are_by_parameters(name, open_host):
    """Of states and outputs of the operating point, such as the angle by the active power."""
    h = open_host(name, native=True)
    h.fmu.setupExperiment(startTime=0.0)
    h.fmu.enterInitializationMode()
    role = variables(h)
    unknowns = role["states"] + role["outputs"]
    h.fmu.setReal(role["inputs"], list(np.linspace(0.9, 1.1, len(role["inputs"]))))
    for reference in inside(h, role["fixed"])[:12]:
        exact = np.array(h.fmu.getDirectionalDerivative(unknowns, [reference], [1.0]))
        size = 1e-5 * max(1.0, abs(h.fmu.getReal([reference])[0]))
        difference = central(lambda: h.fmu.getReal(unknowns), Reals(h), reference, size)
        assert np.abs(exact - difference).max() <= 1e-6 * max(1.0, np.abs(exact).max())


# -- bad calls ---------------------------------------------------------------------------------

UNKNOWN = 4294967295


def derivative_of(unknown, known):
    return lambda h: h.fmu.getDirectionalDerivative([h.vr[unknown]], [h.vr[known]], [1.0])


# name: (initialised first, call, status that the standard asks for, words of the log)
BAD = {
    "read an unknown reference": (
        True,
        lambda h: h.fmu.getReal([UNKNOWN]),
        ERROR,
        "no variable with value reference",
    ),
    "set an unknown reference": (
        True,
        lambda h: h.fmu.setReal([999], [1.0]),
        ERROR,
        "value reference 999",
    ),
    "read an output as Integer": (
        True,
        lambda h: h.fmu.getInteger([h.vr["p"]]),
        ERROR,
        "p is no Integer variable",
    ),
    "read a Boolean as Real": (
        True,
        lambda h: h.fmu.getReal([h.vr["connected"]]),
        ERROR,
        "connected is no Real",
    ),
    "read a string": (True, lambda h: h.fmu.getString([0]), ERROR, "no String variables"),
    "set a string": (True, lambda h: h.fmu.setString([0], ["a"]), ERROR, "no String variables"),
    "NaN at an input": (
        True,
        lambda h: h.set(v_im=math.nan),
        DISCARD,
        r"v_im = -?nan; it must be a finite number",
    ),
    "infinity at an input": (True, lambda h: h.set(v_re=math.inf), DISCARD, "v_re = inf"),
    "NaN as a state": (True, lambda h: h.set(droop__P_f=math.nan), DISCARD, "droop.P_f"),
    "parameter NaN": (
        True,
        lambda h: h.set(pod_p__K=math.nan),
        DISCARD,
        r"pod_p.K = -?nan; it must be a finite",
    ),
    "parameter too low": (
        True,
        lambda h: h.set(pod_p__K=-1.0),
        DISCARD,
        "pod_p.K = -1; it must be at least 0",
    ),
    "parameter too high": (
        True,
        lambda h: h.set(pod_p__K=1e6),
        DISCARD,
        r"pod_p.K = 1e\+06; it must be at most 1",
    ),
    "Integer too high": (
        False,
        lambda h: h.fmu.setInteger([h.vr["pod_p.N_S"]], [4]),
        DISCARD,
        "at most 3",
    ),
    "step of zero": (
        True,
        lambda h: h.fmu.doStep(0.0, 0.0),
        ERROR,
        "step size 0 s; it must exceed 0",
    ),
    "negative step": (
        True,
        lambda h: h.fmu.doStep(0.0, -H),
        ERROR,
        "step size -0.0001 s; it must exceed 0",
    ),
    "step of NaN": (True, lambda h: h.fmu.doStep(0.0, math.nan), ERROR, "it must exceed 0"),
    "endless step": (True, lambda h: h.fmu.doStep(0.0, 1e9), DISCARD, "it must be at most 100 s"),
    "step before initialisation": (
        False,
        lambda h: h.fmu.doStep(0.0, H),
        ERROR,
        "fmi2DoStep is not allowed before",
    ),
    "initialise twice": (
        True,
        lambda h: h.fmu.enterInitializationMode(),
        ERROR,
        "not allowed after initialisation",
    ),
    "leave initialisation first": (
        False,
        lambda h: h.fmu.exitInitializationMode(),
        ERROR,
        "before initialisation",
    ),
    "terminate first": (
        False,
        lambda h: h.fmu.terminate(),
        ERROR,
        "fmi2Terminate is not allowed before",
    ),
    "fixed parameter while running": (
        True,
        lambda h: h.set(S_n=1.0),
        ERROR,
        "parameter S_n is fixed",
    ),
    "set an output": (
        True,
        lambda h: h.set(p=1.0),
        ERROR,
        "p is computed by the FMU and cannot be set",
    ),
    "set a calculated parameter": (
        True,
        lambda h: h.set(droop__P_ref=1.0),
        ERROR,
        "droop.P_ref is computed",
    ),
    "set a state too early": (
        False,
        lambda h: h.set(droop__P_f=0.5),
        ERROR,
        "only after initialisation",
    ),
    "Real as Integer": (
        True,
        lambda h: h.fmu.setInteger([h.vr["pod_p.K"]], [1]),
        ERROR,
        "pod_p.K is no Integer",
    ),
    "a rule broken": (
        False,
        lambda h: (h.set(P_0=2.0), h.initialise()),
        ERROR,
        "lower P_0 or raise S_n",
    ),
    "a rule broken while running": (
        True,
        lambda h: (h.set(pod_p__T_S2=0.0), h.fmu.doStep(0.0, H)),
        ERROR,
        "pod_p.T_S2 = 0 needs",
    ),
    "derivative of an input": (
        True,
        derivative_of("v_re", "v_re"),
        ERROR,
        "v_re is no unknown here",
    ),
    "derivative by an output": (True, derivative_of("p", "q"), ERROR, "q is not known here"),
    "derivative too early": (
        False,
        derivative_of("p", "v_re"),
        ERROR,
        "only from initialisation on",
    ),
    "input derivatives": (
        True,
        lambda h: h.fmu.fmi2SetRealInputDerivatives(h.fmu.component, None, 1, None, None),
        ERROR,
        "cannot interpolate",
    ),
    "cancel": (True, lambda h: h.fmu.fmi2CancelStep(h.fmu.component), ERROR, "no step to cancel"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_call_gets_the_standards_status_and_words(name, open_host):
    initialised, call, status, words = BAD[name]
    h = open_host("gfor", instance="misused", native=True)
    if initialised:
        h.initialise()
        h.run(3)
        before = h.everything()
    assert h.status(call, h) == status
    assert re.search(words, "\n".join(h.log)), h.log
    assert "misused" in h.log[-1]
    if initialised and "rule" not in name:
        assert h.everything() == before  # nothing was taken
    if status == DISCARD and initialised:
        assert h.step() == OK
    if status == ERROR:
        assert h.status(h.fmu.doStep, 0.0, H) == ERROR  # the standard: reset, restore or free
        h.fmu.reset()
        assert h.initialise().step() == OK


def test_after_termination_values_can_be_read_and_nothing_else(open_host):
    h = open_host("gfor", native=True).initialise()
    h.run(5)
    h.fmu.terminate()
    assert math.isfinite(h.get("p"))
    assert h.status(lambda: h.set(v_re=1.0)) == ERROR
    assert h.step() == ERROR
    h.fmu.reset()
    assert h.initialise().step() == OK


def test_a_step_that_diverges_is_discarded_and_leaves_the_instance_where_it_was(open_host):
    h = open_host("gfor", native=True).initialise()
    h.run(3)
    before = h.everything()
    h.set(v_re=1e200)
    assert h.step() == DISCARD
    assert re.search(
        r"state \S+ is no longer finite after t = 0 s: the solution diverges", h.log[-1]
    )
    h.set(v_re=np.frombuffer(before)[h.reals.index("v_re")])
    assert h.everything() == before
    assert h.step() == OK


references = st.lists(st.one_of(st.integers(0, 130), st.just(UNKNOWN)), max_size=4)
number = st.one_of(st.floats(width=64), st.sampled_from([0.0, 1.0, math.nan, math.inf, 1e308]))
CALLS = st.one_of(
    st.tuples(st.sampled_from(["getReal", "getInteger", "getBoolean"]), references),
    st.tuples(st.just("setReal"), st.lists(st.tuples(st.integers(0, 130), number), max_size=4)),
    st.tuples(
        st.just("setInteger"),
        st.lists(st.tuples(st.integers(0, 130), st.integers(-9, 9)), max_size=2),
    ),
    st.tuples(
        st.just("setBoolean"), st.lists(st.tuples(st.integers(0, 130), st.booleans()), max_size=2)
    ),
    st.tuples(st.just("doStep"), st.sampled_from([H, 5e-4, 1e-5, 0.0, -H, math.nan, math.inf])),
    st.tuples(
        st.sampled_from(
            [
                "enterInitializationMode",
                "exitInitializationMode",
                "terminate",
                "reset",
                "save",
                "restore",
            ]
        ),
        st.none(),
    ),
    st.tuples(st.just("derivative"), st.tuples(references, references)),
)


def perform(h, call, argument, saved):
    """Status of one call."""
    if call == "save":
        saved.append(h.fmu.getFMUstate())
        return OK
    if call == "restore":
        return h.status(h.fmu.setFMUstate, saved[-1]) if saved else OK
    if call == "derivative":
        return h.status(h.fmu.getDirectionalDerivative, *argument, [1.0] * len(argument[1]))
    if call == "doStep":
        return h.status(h.fmu.doStep, 0.0, argument)
    if call.startswith("set"):
        return h.status(getattr(h.fmu, call), [r for r, _ in argument], [v for _, v in argument])
    return h.status(getattr(h.fmu, call), *([argument] if call.startswith("get") else []))


@settings(
    max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(initialised=st.booleans(), calls=st.lists(CALLS, max_size=25))
def test_any_sequence_of_calls_keeps_to_the_state_machine(open_host, initialised, calls):
    h = open_host("gfor", native=True)
    if initialised:
        h.initialise()
    stepping, failed, saved = initialised, False, []
    states = []  # what the instance was when each state was saved
    for call, argument in calls:
        said = len(h.log)
        status = perform(h, call, argument, saved)
        assert status in (OK, DISCARD, ERROR)
        assert status == OK or len(h.log) > said  # what is refused is explained
        if call == "doStep" and (failed or not stepping):
            assert status == ERROR
        if call == "save":
            states.append((stepping, failed))
        if call == "restore" and saved:
            assert status == OK
            stepping, failed = states[-1][0], False
        elif call == "reset":
            stepping, failed = False, False
        elif status == ERROR:
            failed = True
        elif status == OK and call in ("exitInitializationMode", "terminate"):
            stepping = call == "exitInitializationMode"
    h.fmu.reset()
    fresh = open_host("gfor", native=True)
    assert h.initialise().run(3) == fresh.initialise().run(3)
    h.close(), fresh.close()
