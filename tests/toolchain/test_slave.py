"""The slave inside the FMU: through FMPy as a host sees it, and by itself on a bare interpreter."""

import functools
import importlib
import json
import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import calloc, free
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

ROOT = Path(__file__).parents[2]
H = 1e-4
OK, DISCARD = 0, 2
GENERATOR = "synchronous_generator_st1"


class Host:
    """One instance through FMPy, with everything it logged."""

    def __init__(self, directory, instance="one"):
        md = fmpy.read_model_description(str(directory), validate=False)
        self.md = md
        self.vr = {v.name: v.valueReference for v in md.modelVariables}
        self.reals = [v.name for v in md.modelVariables if v.type == "Real"]
        self.log = []
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(lambda *a: self.log.append(a[-1].decode()))
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        identifier = md.coSimulation.modelIdentifier
        self.fmu = FMU2Slave(
            guid=md.guid, unzipDirectory=str(directory), modelIdentifier=identifier, instanceName=instance
        )
        self.fmu.instantiate(callbacks=self._callbacks, loggingOn=True)

    def initialise(self):
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def status(self, function, *arguments):
        """Status of a call that may be refused."""
        try:
            function(*arguments)
        except FMICallException as error:
            return error.status
        return OK

    def step(self, time=0.0, size=H):
        return self.status(self.fmu.doStep, time, size)

    def set(self, **values):
        self.fmu.setReal([self.vr[name.replace("__", ".")] for name in values], list(values.values()))

    def get(self, *names):
        values = self.fmu.getReal([self.vr[name] for name in names])
        return values[0] if len(names) == 1 else values

    def everything(self):
        """Every Real as bits, so that NaN and −0 count."""
        return np.array(self.get(*self.reals)).tobytes()

    def run(self, steps=50, first=0):
        """Drive with varying inputs; every Real after every step."""
        inputs = [v.name for v in self.md.modelVariables if v.causality == "input"]
        rows = []
        for k in range(first, first + steps):
            self.fmu.setReal([self.vr[n] for n in inputs], [drive(k, j) for j in range(len(inputs))])
            assert self.step(k * H) == OK, self.log
            rows.append(self.everything())
        return rows

    def close(self):
        self.fmu.freeInstance()


def drive(step, channel):
    return (1.0 if channel == 0 else 0.0) + 0.03 * math.sin(0.05 * step + channel)


@pytest.fixture(scope="session")
def extracted(fmu_path):
    folders = {}

    def extract(name):
        if name not in folders:
            folders[name] = str(fmpy.extract(str(fmu_path(name))))
        return folders[name]

    yield extract
    for folder in folders.values():
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def host(extracted):
    open_hosts = []

    def create(name="gfor", instance="one"):
        open_hosts.append(Host(extracted(name), instance))
        return open_hosts[-1]

    yield create
    for instance in open_hosts:
        instance.close()


# -- misuse ------------------------------------------------------------------------------------

UNKNOWN = 4294967295  # the largest value reference


def _restore_foreign(h, other):
    h.fmu.setFMUstate(other.fmu.getFMUstate())


def _deserialise(h, data):
    h.fmu.setFMUstate(h.fmu.deSerializeFMUstate(data))


def _terminated_step(h, _):
    h.status(h.fmu.terminate)
    assert h.step() == DISCARD


# name: (initialised first, what is done, words of the log, status of a proper step afterwards)
MISUSES = {
    "read an unknown reference": (
        True,
        lambda h, _: h.fmu.getReal([999]),
        r"reading value references \[999\]",
        DISCARD,
    ),
    "read the largest reference": (True, lambda h, _: h.fmu.getReal([UNKNOWN]), "reading value references", DISCARD),
    "set an unknown reference": (
        True,
        lambda h, _: h.fmu.setReal([999], [1.0]),
        "no variable with value reference 999",
        DISCARD,
    ),
    "set the largest reference": (True, lambda h, _: h.fmu.setReal([UNKNOWN], [1.0]), "value reference", DISCARD),
    "read an output as Integer": (
        True,
        lambda h, _: h.fmu.getInteger([h.vr["p"]]),
        "not all of them are of type",
        DISCARD,
    ),
    "read an output as Boolean": (
        True,
        lambda h, _: h.fmu.getBoolean([h.vr["p"]]),
        "not all of them are of type",
        DISCARD,
    ),
    "read a string": (True, lambda h, _: h.fmu.getString([0]), "no String variables", DISCARD),
    "set a string": (True, lambda h, _: h.fmu.setString([0], ["a"]), "no String variables", DISCARD),
    "NaN at an input": (
        True,
        lambda h, _: (h.set(v_im=math.nan), h.status(h.step)),
        r"state \S+ is no longer finite after t = 0 s: input v_im is not a finite number",
        DISCARD,
    ),
    "infinity at an input": (True, lambda h, _: h.set(v_re=math.inf), "input v_re is not a finite number", DISCARD),
    "NaN at an input before initialisation": (
        False,
        lambda h, _: (h.set(v_re=math.nan), h.status(h.fmu.exitInitializationMode)),
        "initialisation gives no finite value for v_re",
        DISCARD,
    ),
    "NaN as a state": (True, lambda h, _: h.set(droop__P_f=math.nan), "no longer finite", DISCARD),
    "negative step": (True, lambda h, _: h.step(0.0, -H), "step size -0.0001 s; it must exceed 0", OK),
    "step of NaN": (True, lambda h, _: h.step(0.0, math.nan), "step size nan s; it must exceed 0", OK),
    "endless step": (True, lambda h, _: h.step(0.0, math.inf), "step size inf s", OK),
    "step of zero": (True, lambda h, _: (h.step(), h.step(0.0, 0.0)), "step size 0.0 s; it must exceed 0", OK),
    "first step of zero": (True, lambda h, _: h.step(0.0, 0.0), "step size 0.0 s; it must exceed 0", OK),
    "step before initialisation": (
        False,
        lambda h, _: None,
        "fmi2DoStep is allowed only between initialisation and fmi2Terminate",
        DISCARD,
    ),
    "step during initialisation": (
        False,
        lambda h, _: h.status(h.fmu.enterInitializationMode),
        "fmi2DoStep is allowed only between",
        DISCARD,
    ),
    "step after terminate": (True, _terminated_step, "fmi2DoStep is allowed only between", DISCARD),
    "fixed parameter while running": (
        True,
        lambda h, _: h.set(S_n=100.0),
        "parameter S_n is fixed; it can be set only before the end of initialisation",
        DISCARD,
    ),
    "fixed Integer while running": (
        True,
        lambda h, _: h.fmu.setInteger([h.vr["pod_p.N_S"]], [1]),
        r"parameter pod_p\.N_S is fixed",
        DISCARD,
    ),
    "parameter below its minimum": (True, lambda h, _: h.set(pod_p__K=-1.0), r"pod_p\.K = -1; .* at least 0", DISCARD),
    "parameter above its maximum": (
        True,
        lambda h, _: h.set(pod_p__K=1e6),
        r"pod_p\.K = 1e\+06; it must be at most 100000",
        DISCARD,
    ),
    "parameter NaN": (True, lambda h, _: h.set(pod_p__K=math.nan), r"pod_p\.K = nan; .* a finite number", DISCARD),
    "Integer above its maximum": (
        False,
        lambda h, _: (h.fmu.setInteger([h.vr["pod_p.N_S"]], [4]), h.initialise()),
        r"pod_p\.N_S = 4; it must be at most 3",
        DISCARD,
    ),
    "parameter of another type": (
        False,
        lambda h, _: (h.set(pod_p__N_S=1.0), h.initialise()),
        r"pod_p\.N_S is of type Integer, not Real",
        DISCARD,
    ),
    "Boolean as Integer": (
        True,
        lambda h, _: h.fmu.setInteger([h.vr["pod_p.enabled"]], [1]),
        r"pod_p\.enabled is of type Boolean, not Integer",
        DISCARD,
    ),
    "set an output": (True, lambda h, _: h.set(p=1.0), "p is computed by the FMU and cannot be set", DISCARD),
    "set a derivative": (
        True,
        lambda h, _: h.fmu.setReal([h.vr["der(droop.P_f)"]], [1.0]),
        r"der\(droop\.P_f\) is computed by the FMU",
        DISCARD,
    ),
    "set a calculated parameter": (
        True,
        lambda h, _: h.set(droop__P_ref=1.0),
        r"droop\.P_ref is computed by the FMU",
        DISCARD,
    ),
    "set an output as Integer": (
        True,
        lambda h, _: h.fmu.setInteger([h.vr["p"]], [1]),
        "p is computed by the FMU and cannot be set",
        DISCARD,
    ),
    "set a state before initialisation": (
        False,
        lambda h, _: (h.set(droop__P_f=0.5), h.initialise()),
        r"state droop\.P_f can be set only after initialisation",
        DISCARD,
    ),
    "start values that break a rule": (
        False,
        lambda h, _: (h.set(P_0=2.0), h.initialise()),
        r"parameters cannot be used: the power flow asks for more active current .*: lower P_0 or raise S_n",
        DISCARD,
    ),
    "two parameters that break a rule together": (
        False,
        lambda h, _: (h.set(feed_forward__tau=2e-5), h.initialise()),
        r"internal_step must be shorter than 2\.5 times feed_forward\.tau",
        DISCARD,
    ),
    "tunable parameters that break a rule while running": (
        True,
        lambda h, _: h.set(pod_p__T_S2=0.0),
        r"pod_p\.T_S2 = 0 needs pod_p\.T_S1 = 0 as well",
        DISCARD,
    ),
    "state of another FMU": (True, _restore_foreign, "not saved by this FMU", DISCARD),
    "serialised state of another FMU": (
        True,
        lambda h, other: _deserialise(h, other.fmu.serializeFMUstate(other.fmu.getFMUstate())),
        "not saved by this FMU",
        DISCARD,
    ),
    "garbage as a serialised state": (True, lambda h, _: _deserialise(h, b"garbage"), "not saved by this FMU", DISCARD),
}


def run_misuses(directory, other_directory):
    """Each misuse three times on an instance of its own; one line of JSON each. Run in a subprocess."""
    other = Host(other_directory, "other").initialise()
    for name, (initialised, action, _, _) in MISUSES.items():
        h = Host(directory, "misused")
        if initialised:
            h.initialise()
        for _ in range(3):
            h.status(action, h, other)
        steps = [h.step(k * H) for k in range(3)]
        values = h.get("p", "der(droop.P_f)")
        h.close()
        print(json.dumps([name, {"steps": steps, "log": h.log, "values": repr(values)}]), flush=True)
    other.close()
    print('["end", {}]', flush=True)


@functools.cache
def misuse_report(directory, other_directory, kernel):
    code = f"from tests.toolchain.test_slave import run_misuses; run_misuses({directory!r}, {other_directory!r})"
    environment = {**os.environ, "GFOR_COSIM_KERNEL": kernel}
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=60
    )
    lines = [json.loads(line) for line in result.stdout.splitlines() if line.startswith("[")]
    return result.returncode, dict(lines), result.stderr


# (misuse, kernel) that are not yet refused as they should be.
@pytest.mark.parametrize("kernel", ["", "python"], ids=["compiled", "python"])
@pytest.mark.parametrize("name", MISUSES)
def test_misuse_is_refused_in_words_and_never_crashes(name, kernel, extracted):
    _, words, status = MISUSES[name][1:]
    code, report, stderr = misuse_report(extracted("gfor"), extracted(GENERATOR), kernel)
    assert name in report, f"the process died in or before this misuse, code {code}: {stderr}"
    assert "Traceback" not in stderr
    log = "\n".join(report[name]["log"])
    assert re.search(words, log), log
    assert "misused" in log  # names the instance
    assert report[name]["steps"] == [status] * 3


@pytest.mark.parametrize("kernel", ["", "python"], ids=["compiled", "python"])
def test_the_process_outlives_all_misuse(kernel, extracted):
    code, report, stderr = misuse_report(extracted("gfor"), extracted(GENERATOR), kernel)
    assert (code, "end" in report) == (0, True), stderr


@pytest.mark.parametrize(
    "kernel",
    [
        "compiled",
        "python",
    ],
)
def test_a_broken_rule_is_named_even_where_initialisation_divides_by_zero(kernel, host, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_KERNEL", kernel)
    h = host(GENERATOR)
    h.set(machine__X_d=0.2)
    h.initialise()
    assert "machine.X_d must exceed machine.X_d1" in "\n".join(h.log)
    assert h.step() == DISCARD


# -- state -------------------------------------------------------------------------------------


def spoil(h):
    """Change parameters, inputs and states of a running converter."""
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [False])
    h.set(droop__R_f=0.01, pod_p__K=3.0, v_re=0.7, droop__theta=1.0, filter__u_c_q=0.2)
    h.run(7, first=1000)


def running(h):
    h.initialise()
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [True])
    h.set(pod_p__K=50.0)
    h.run(50)
    return h


def test_a_saved_state_restores_everything_and_the_same_future(host):
    h = running(host())
    state, before = h.fmu.getFMUstate(), h.everything()
    future = h.run(50, first=50)
    spoil(h)
    assert h.everything() != before
    h.fmu.setFMUstate(state)
    assert h.everything() == before
    assert h.fmu.getBoolean([h.vr["pod_p.enabled"]]) == [True]
    assert h.run(50, first=50) == future
    h.fmu.setFMUstate(state)  # a state can be restored more than once
    assert h.everything() == before
    h.fmu.freeFMUstate(state)
    assert h.log == []


def test_a_serialised_state_continues_in_another_instance(host):
    h, twin = running(host()), host(instance="twin").initialise()
    state = h.fmu.getFMUstate()
    data, before = h.fmu.serializeFMUstate(state), h.everything()
    future = h.run(50, first=50)
    twin.fmu.setFMUstate(twin.fmu.deSerializeFMUstate(data))
    assert twin.everything() == before
    assert twin.fmu.serializeFMUstate(twin.fmu.getFMUstate()) == data
    assert twin.run(50, first=50) == future


def test_a_state_saved_before_initialisation_keeps_its_parameters(host):
    h = host()
    h.set(P_0=0.4)
    state, before = h.fmu.getFMUstate(), h.everything()
    h.set(P_0=0.5)
    h.initialise()
    h.run(3)
    h.fmu.setFMUstate(state)
    assert h.everything() == before
    h.initialise()
    assert h.get("p") == pytest.approx(0.4, abs=1e-12)


def test_a_failed_instance_recovers_when_a_good_state_is_restored(host):
    h = running(host())
    state = h.fmu.getFMUstate()
    future = h.run(5, first=50)
    h.set(v_re=math.nan)
    assert [h.step(), h.step()] == [DISCARD, DISCARD]
    h.fmu.setFMUstate(state)
    assert h.run(5, first=50) == future


def test_a_state_saved_after_a_broken_rule_is_not_taken_as_good(host):
    h = host()
    h.set(P_0=2.0)
    h.initialise()
    assert h.step() == DISCARD
    h.fmu.setFMUstate(h.fmu.getFMUstate())
    assert h.step() == DISCARD


def test_reset_brings_back_start_values(host):
    h, fresh = host(), host(instance="fresh")
    start = fresh.everything()
    h.set(P_0=0.5)
    running(h)
    assert h.everything() != start
    h.fmu.reset()
    assert h.everything() == start
    assert h.step() == DISCARD
    assert h.initialise().run(10) == fresh.initialise().run(10)


def test_instances_are_independent(host):
    alone = running(host()).run(50, first=50)
    one, two = running(host()), host(instance="two")
    two.set(P_0=0.3)
    two.initialise()
    mixed = []
    for k in range(50):
        two.run(1, first=7 * k)
        mixed += one.run(1, first=50 + k)
    assert mixed == alone


# -- values ------------------------------------------------------------------------------------


def test_outputs_are_fresh_after_setting_inputs_without_a_step(host):
    """The grid's voltage is v = Σ i / G, with G = P / v_0² = 26 pu at bus 2."""
    h = host("two_area_grid").initialise()
    line = h.get("L.i_re")
    h.set(sg1__i_re=10.0, gfor__i_re=16.0)
    assert h.get("bus_2.v_re") == pytest.approx((26.0 - line) / 26.0, rel=1e-14)
    h.set(gfor__i_re=3.0)
    assert h.get("bus_2.v_re") == pytest.approx((13.0 - line) / 26.0, rel=1e-14)
    h.set(load_2__scale=2.0)
    assert h.get("bus_2.v_re") == pytest.approx((13.0 - line) / 52.0, rel=1e-14)


def test_initialisation_meets_the_power_flow(host):
    h = host()
    h.set(P_0=0.6, Q_0=0.1, v_0=1.02, theta_0=0.3, v_re=1.02 * math.cos(0.3), v_im=1.02 * math.sin(0.3))
    h.initialise()
    assert h.get("p", "q") == pytest.approx([0.6, 0.1], abs=1e-13)
    derivatives = [n for n in h.reals if n.startswith("der(")]
    assert np.abs(h.get(*derivatives)).max() < 1e-9


def test_states_can_be_set_after_initialisation(host):
    h = host().initialise()
    h.set(droop__P_f=0.7)
    assert h.get("droop.P_f") == 0.7
    assert h.get("omega") == pytest.approx(1 + 0.05 * (h.get("droop.P_ref") - 0.7), abs=1e-15)


@pytest.mark.parametrize("name", ["gfor", GENERATOR, "two_area_grid"])
def test_derivatives_equal_a_finite_difference(name, host):
    h = host(name).initialise()
    h.run(20)
    states = [d.variable.derivative.name for d in h.md.derivatives]
    rate = np.array(h.get(*(f"der({s})" for s in states)))
    start, x = h.fmu.getFMUstate(), np.array(h.get(*states))

    def quotient(size):
        h.fmu.setFMUstate(start)
        assert h.step(20 * H, size) == OK
        return (np.array(h.get(*states)) - x) / size

    extrapolated = 2 * quotient(5e-8) - quotient(1e-7)
    assert np.abs(rate).max() > 1e-2
    np.testing.assert_allclose(extrapolated, rate, rtol=1e-5, atol=1e-6 * np.abs(rate).max())


def test_one_long_step_equals_its_short_ones_exactly(host):
    long, short = host(), host(instance="short")
    for h in (long, short):
        h.initialise()
        h.set(v_re=0.95, v_im=0.05)
    assert long.step(0.0, 5e-4) == OK
    assert [short.step(k * H) for k in range(5)] == [OK] * 5
    assert long.everything() == short.everything()


def test_the_internal_step_cuts_a_communication_step(host):
    coarse, fine = host(), host(instance="fine")
    fine.set(internal_step=2.5e-5)
    for h in (coarse, fine):
        h.initialise()
        h.set(v_re=0.95)
        assert h.step() == OK
    x = "feed_forward.u_q"
    assert fine.get(x) != coarse.get(x)
    assert fine.get(x) == pytest.approx(coarse.get(x), abs=1e-3)
    quarters = host(instance="quarters").initialise()
    quarters.set(v_re=0.95)
    assert [quarters.step(k * H / 4, H / 4) for k in range(4)] == [OK] * 4
    assert quarters.get(x) == fine.get(x)


def test_tunable_parameters_take_effect_while_running(host):
    h = host().initialise()
    for k in range(500):
        h.set(v_im=0.1 * math.sin(6.0 * k * H))
        assert h.step(k * H) == OK
    assert h.get("delta_p_pod") == 0.0
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [True])
    h.set(pod_p__K=10.0)
    ten = h.get("delta_p_pod")
    assert 1e-6 < abs(ten) < 0.1
    h.set(pod_p__K=20.0)
    assert h.get("delta_p_pod") == pytest.approx(2 * ten, rel=1e-14)
    h.set(pod_p__limit=abs(ten))
    assert abs(h.get("delta_p_pod")) == abs(ten)
    assert h.step(500 * H) == OK
    h.fmu.setBoolean([h.vr["pod_p.enabled"]], [False])
    assert h.get("delta_p_pod") == 0.0


# -- a bare interpreter ------------------------------------------------------------------------

BARE = """
import importlib, json, math, sys
resources, name = sys.argv[1:]
sys.path.insert(0, resources)
for missing in ("numpy", "casadi"):
    try:
        importlib.import_module(missing)
    except ImportError:
        pass
    else:
        raise SystemExit(missing + " is here after all")
slave = importlib.import_module(open(resources + "/slavemodule.txt").read().strip())
one = slave.Slave(instance_name="bare", resources=resources)
one.setup_experiment(0.0, None, None)
one.enter_initialization_mode()
one.exit_initialization_mode()
first, end, count = one._first_input, one._first_state, len(one._names)
reals = [i for i in range(count) if i >= len(one._parameters) or one._parameters[i][0] == "Real"]
rows = []
for k in range(50):
    drive = [(1.0 if j == 0 else 0.0) + 0.03 * math.sin(0.05 * k + j) for j in range(end - first)]
    one.set_real(list(range(first, end)), drive)
    assert one.do_step(k * 1e-4, 1e-4), [m.msg for m in one.log_queue]
    rows.append([v.hex() for v in one.get_real(reals)])
assert one.log_queue == []
print(json.dumps({"compiled": one._kernel.__class__.__name__ == "PyDLL", "rows": rows}))
"""


@functools.cache
def on_a_bare_interpreter(directory, name, kernel):
    """Whether the compiled kernel ran, and every Real after each of 50 steps."""
    environment = {**os.environ, "GFOR_COSIM_KERNEL": kernel}
    result = subprocess.run(
        [sys.executable, "-I", "-S", "-c", BARE, str(Path(directory) / "resources"), name],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert result.returncode == 0, result.stderr
    answer = json.loads(result.stdout)
    return answer["compiled"], np.array([[float.fromhex(v) for v in row] for row in answer["rows"]])


@pytest.mark.parametrize("name", ["gfor", GENERATOR, "two_area_grid"])
@pytest.mark.parametrize("kernel", ["", "python"], ids=["compiled", "python"])
def test_the_slave_runs_where_there_is_neither_numpy_nor_casadi(name, kernel, host, extracted):
    compiled, bare = on_a_bare_interpreter(extracted(name), name, kernel)
    here = np.array([np.frombuffer(row) for row in host(name).initialise().run(50)])
    assert compiled is (kernel == "")
    if compiled:
        assert np.array_equal(bare, here)
    else:
        scale = np.maximum(1.0, np.abs(here).max(axis=0))
        assert (np.abs(bare - here) / scale).max() < 1e-11


def test_two_fmus_in_one_process_do_not_mix_their_code(host, extracted):
    names = ["gfor", GENERATOR]
    together = [host(name) for name in names]
    rows = [[], []]
    for h in together:
        h.initialise()
    for k in range(50):
        for h, collected in zip(together, rows, strict=True):
            collected.extend(h.run(1, first=k))
    for name, collected in zip(names, rows, strict=True):
        _, alone = on_a_bare_interpreter(extracted(name), name, "")
        assert np.array_equal(np.array([np.frombuffer(row) for row in collected]), alone)


# -- any sequence of calls ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def slave_class(extracted):
    """The slave of the converter's FMU, imported as the wrapper would."""
    resources = Path(extracted("gfor")) / "resources"
    sys.path.insert(0, str(resources))
    try:
        module = importlib.import_module((resources / "slavemodule.txt").read_text().strip())
        yield lambda: module.Slave(instance_name="any", resources=str(resources))
    finally:
        sys.path.remove(str(resources))


reference = st.one_of(st.integers(-3, 125), st.sampled_from([2**31, UNKNOWN]))
references = st.lists(reference, max_size=4)
number = st.one_of(st.floats(width=64), st.sampled_from([0.0, 1.0, math.nan, math.inf, -math.inf, 1e308]))
pairs = st.lists(st.tuples(reference, number), max_size=4)
integer_pairs = st.lists(st.tuples(reference, st.integers(-(2**31), 2**31 - 1)), max_size=4)
boolean_pairs = st.lists(st.tuples(reference, st.booleans()), max_size=4)
CALLS = st.one_of(
    st.tuples(st.sampled_from(["get_real", "get_integer", "get_boolean", "get_string"]), references),
    st.tuples(st.just("set_real"), pairs),
    st.tuples(st.just("set_integer"), integer_pairs),
    st.tuples(st.just("set_boolean"), boolean_pairs),
    st.tuples(st.just("set_string"), st.lists(st.tuples(reference, st.text(max_size=3)), max_size=2)),
    st.tuples(st.just("do_step"), st.sampled_from([H, 5e-4, 1e-5, 0.0, -H, math.nan, math.inf])),
    st.tuples(
        st.sampled_from(["enter_initialization_mode", "exit_initialization_mode", "terminate", "save"]), st.none()
    ),
    st.tuples(st.just("restore"), st.one_of(st.none(), st.binary(max_size=40))),
)


def perform(slave, calls):
    """Do the calls as the wrapper does; a list of values must come back whole."""
    saved = [slave._get_fmu_state()]
    for call, argument in calls:
        if call.startswith("get"):
            assert len(getattr(slave, call)(argument)) == len(argument)
        elif call.startswith("set"):
            getattr(slave, call)([r for r, _ in argument], [v for _, v in argument])
        elif call == "do_step":
            before = len(slave.log_queue)
            done = slave.do_step(0.0, argument)
            assert isinstance(done, bool)
            assert done or len(slave.log_queue) > before  # what is discarded is explained
        elif call == "save":
            saved.append(slave._fmu_state_from_bytes(slave._fmu_state_to_bytes(slave._get_fmu_state())))
        elif call == "restore":
            slave._set_fmu_state(saved[-1] if argument is None else argument)
        else:
            getattr(slave, call)()


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(initialised=st.booleans(), calls=st.lists(CALLS, max_size=20))
def test_no_sequence_of_calls_raises(slave_class, initialised, calls):
    slave = slave_class()
    if initialised:
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
    perform(slave, calls)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(initialised=st.booleans(), calls=st.lists(CALLS, max_size=10))
def test_no_sequence_of_calls_raises_in_the_python_kernel(slave_class, initialised, calls):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("GFOR_COSIM_KERNEL", "python")
        slave = slave_class()
    if initialised:
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
    perform(slave, calls)


def test_a_damaged_state_of_the_right_length_does_not_make_reading_raise(slave_class):
    slave = slave_class()
    state = slave._get_fmu_state()
    slave._set_fmu_state(state[:18] + b"\xff" * (len(state) - 18))  # every value is NaN
    assert slave.get_integer([slave._names.index("pod_p.N_S")]) == [0]


def test_a_step_of_more_parts_than_a_c_int_holds_is_refused(slave_class):
    slave = slave_class()
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    slave.set_real([slave._first_input], [0.9])
    assert slave.do_step(0.0, 2**32 * H) is False
