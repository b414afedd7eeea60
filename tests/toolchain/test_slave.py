"""The slave inside the FMU: through FMPy as a host sees it, and by itself on a bare interpreter."""

import functools
import importlib
import inspect
import json
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.support.host import ERROR, GENERATOR, OK, H, Host, running

ROOT = Path(__file__).parents[2]

# -- misuse ------------------------------------------------------------------------------------

UNKNOWN = 4294967295  # the largest value reference


def _restore_foreign(h, other):
    h.fmu.setFMUstate(other.fmu.getFMUstate())


def _deserialise(h, data):
    h.fmu.setFMUstate(h.fmu.deSerializeFMUstate(data))


def _terminated_step(h, _):
    h.status(h.fmu.terminate)
    assert h.step() == ERROR


# name: (initialised first, what is done, words of the log, status of a proper step afterwards)
MISUSES = {
    "read an unknown reference": (
        True,
        lambda h, _: h.fmu.getReal([999]),
        r"reading value references \[999\]",
        ERROR,
    ),
    "read the largest reference": (
        True,
        lambda h, _: h.fmu.getReal([UNKNOWN]),
        "reading value references",
        ERROR,
    ),
    "set an unknown reference": (
        True,
        lambda h, _: h.fmu.setReal([999], [1.0]),
        "no variable with value reference 999",
        ERROR,
    ),
    "set the largest reference": (
        True,
        lambda h, _: h.fmu.setReal([UNKNOWN], [1.0]),
        "value reference",
        ERROR,
    ),
    "read an output as Integer": (
        True,
        lambda h, _: h.fmu.getInteger([h.vr["p"]]),
        "not all of them are of type",
        ERROR,
    ),
    "read an output as Boolean": (
        True,
        lambda h, _: h.fmu.getBoolean([h.vr["p"]]),
        "not all of them are of type",
        ERROR,
    ),
    "read a string": (True, lambda h, _: h.fmu.getString([0]), "no String variables", ERROR),
    "set a string": (True, lambda h, _: h.fmu.setString([0], ["a"]), "no String variables", ERROR),
    "NaN at an input": (
        True,
        lambda h, _: (h.set(v_im=math.nan), h.status(h.step)),
        r"state \S+ is no longer finite after t = 0 s: input v_im is not a finite number",
        ERROR,
    ),
    "infinity at an input": (
        True,
        lambda h, _: h.set(v_re=math.inf),
        "input v_re is not a finite number",
        ERROR,
    ),
    "NaN at an input before initialisation": (
        False,
        lambda h, _: (h.set(v_re=math.nan), h.status(h.fmu.exitInitializationMode)),
        "initialisation gives no finite value for v_re",
        ERROR,
    ),
    "NaN as a state": (True, lambda h, _: h.set(droop__P_f=math.nan), "no longer finite", ERROR),
    "negative step": (
        True,
        lambda h, _: h.step(0.0, -H),
        "step size -0.0001 s; it must exceed 0",
        OK,
    ),
    "step of NaN": (
        True,
        lambda h, _: h.step(0.0, math.nan),
        "step size nan s; it must exceed 0",
        OK,
    ),
    "endless step": (True, lambda h, _: h.step(0.0, math.inf), "step size inf s", OK),
    "step of zero": (
        True,
        lambda h, _: (h.step(), h.step(0.0, 0.0)),
        "step size 0.0 s; it must exceed 0",
        OK,
    ),
    "first step of zero": (
        True,
        lambda h, _: h.step(0.0, 0.0),
        "step size 0.0 s; it must exceed 0",
        OK,
    ),
    "step before initialisation": (
        False,
        lambda h, _: None,
        "fmi2DoStep is allowed only between initialisation and fmi2Terminate",
        ERROR,
    ),
    "step during initialisation": (
        False,
        lambda h, _: h.status(h.fmu.enterInitializationMode),
        "fmi2DoStep is allowed only between",
        ERROR,
    ),
    "step after terminate": (True, _terminated_step, "fmi2DoStep is allowed only between", ERROR),
    "fixed parameter while running": (
        True,
        lambda h, _: h.set(S_n=100.0),
        "parameter S_n is fixed; it can be set only before the end of initialisation",
        ERROR,
    ),
    "fixed Integer while running": (
        True,
        lambda h, _: h.fmu.setInteger([h.vr["pod_p.N_S"]], [1]),
        r"parameter pod_p\.N_S is fixed",
        ERROR,
    ),
    "parameter below its minimum": (
        True,
        lambda h, _: h.set(pod_p__K=-1.0),
        r"pod_p\.K = -1; .* at least 0",
        ERROR,
    ),
    "parameter above its maximum": (
        True,
        lambda h, _: h.set(pod_p__K=1e6),
        r"pod_p\.K = 1e\+06; it must be at most 100000",
        ERROR,
    ),
    "parameter NaN": (
        True,
        lambda h, _: h.set(pod_p__K=math.nan),
        r"pod_p\.K = nan; .* a finite number",
        ERROR,
    ),
    "Integer above its maximum": (
        False,
        lambda h, _: (h.fmu.setInteger([h.vr["pod_p.N_S"]], [4]), h.initialise()),
        r"pod_p\.N_S = 4; it must be at most 3",
        ERROR,
    ),
    "parameter of another type": (
        False,
        lambda h, _: (h.set(pod_p__N_S=1.0), h.initialise()),
        r"pod_p\.N_S is of type Integer, not Real",
        ERROR,
    ),
    "Boolean as Integer": (
        True,
        lambda h, _: h.fmu.setInteger([h.vr["pod_p.enabled"]], [1]),
        r"pod_p\.enabled is of type Boolean, not Integer",
        ERROR,
    ),
    "set an output": (
        True,
        lambda h, _: h.set(p=1.0),
        "p is computed by the FMU and cannot be set",
        ERROR,
    ),
    "set a derivative": (
        True,
        lambda h, _: h.fmu.setReal([h.vr["der(droop.P_f)"]], [1.0]),
        r"der\(droop\.P_f\) is computed by the FMU",
        ERROR,
    ),
    "set a calculated parameter": (
        True,
        lambda h, _: h.set(droop__P_ref=1.0),
        r"droop\.P_ref is computed by the FMU",
        ERROR,
    ),
    "set an output as Integer": (
        True,
        lambda h, _: h.fmu.setInteger([h.vr["p"]], [1]),
        "p is computed by the FMU and cannot be set",
        ERROR,
    ),
    "set a state before initialisation": (
        False,
        lambda h, _: (h.set(droop__P_f=0.5), h.initialise()),
        r"state droop\.P_f can be set only after initialisation",
        ERROR,
    ),
    "start values that break a rule": (
        False,
        lambda h, _: (h.set(P_0=2.0), h.initialise()),
        r"parameters cannot be used: the power flow asks for more active current .*: lower P_0 or raise S_n",
        ERROR,
    ),
    "two parameters that break a rule together": (
        False,
        lambda h, _: (h.set(feed_forward__tau=2e-5), h.initialise()),
        r"internal_step must be shorter than 2\.5 times feed_forward\.tau",
        ERROR,
    ),
    "tunable parameters that break a rule while running": (
        True,
        lambda h, _: h.set(pod_p__T_S2=0.0),
        r"pod_p\.T_S2 = 0 needs pod_p\.T_S1 = 0 as well",
        ERROR,
    ),
    "state of another FMU": (True, _restore_foreign, "not saved by this FMU", ERROR),
    "serialised state of another FMU": (
        True,
        lambda h, other: _deserialise(h, other.fmu.serializeFMUstate(other.fmu.getFMUstate())),
        "not saved by this FMU",
        ERROR,
    ),
    "garbage as a serialised state": (
        True,
        lambda h, _: _deserialise(h, b"garbage"),
        "not saved by this FMU",
        ERROR,
    ),
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
        print(
            json.dumps([name, {"steps": steps, "log": h.log, "values": repr(values)}]), flush=True
        )
    other.close()
    print('["end", {}]', flush=True)


@functools.cache
def misuse_report(directory, other_directory, kernel):
    code = f"from tests.toolchain.test_slave import run_misuses; run_misuses({directory!r}, {other_directory!r})"
    environment = {**os.environ, "GFOR_COSIM_KERNEL": kernel}
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
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


@pytest.mark.parametrize("kernel", ["compiled", "python"])
def test_a_broken_rule_is_named_even_where_initialisation_divides_by_zero(
    kernel, open_host, monkeypatch
):
    monkeypatch.setenv("GFOR_COSIM_KERNEL", kernel)
    h = open_host(GENERATOR)
    h.set(machine__X_d=0.2)
    h.initialise()
    assert "machine.X_d must exceed machine.X_d1" in "\n".join(h.log)
    assert h.step() == ERROR


# -- failure and recovery -----------------------------------------------------------------------


def test_a_failed_instance_recovers_when_a_good_state_is_restored(open_host):
    h = running(open_host())
    state = h.fmu.getFMUstate()
    future = h.run(5, first=50)
    h.set(v_re=math.nan)
    assert [h.step(), h.step()] == [ERROR, ERROR]
    h.fmu.setFMUstate(state)
    assert h.run(5, first=50) == future


def test_a_state_saved_after_a_broken_rule_is_not_taken_as_good(open_host):
    h = open_host()
    h.set(P_0=2.0)
    h.initialise()
    assert h.step() == ERROR
    h.fmu.setFMUstate(h.fmu.getFMUstate())
    assert h.step() == ERROR


# -- a bare interpreter ------------------------------------------------------------------------

BARE = """
import importlib, json, math, sys
resources, name = sys.argv[1:]
sys.path.insert(0, resources)
for missing in ("numpy", "fmus"):
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
def test_the_slave_runs_where_there_is_neither_numpy_nor_this_package(
    name, kernel, open_host, extracted
):
    compiled, bare = on_a_bare_interpreter(extracted(name), name, kernel)
    here = np.array([np.frombuffer(row) for row in open_host(name).initialise().run(50)])
    assert compiled is (kernel == "")
    if compiled:
        assert np.array_equal(bare, here)
    else:
        scale = np.maximum(1.0, np.abs(here).max(axis=0))
        assert (np.abs(bare - here) / scale).max() < 1e-11


def test_two_fmus_in_one_process_do_not_mix_their_code(open_host, extracted):
    names = ["gfor", GENERATOR]
    together = [open_host(name) for name in names]
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

        def instance():
            sys.path.insert(0, str(resources))
            return module.Slave(instance_name="any", resources=str(resources))

        yield instance
    finally:
        while str(resources) in sys.path:
            sys.path.remove(str(resources))


reference = st.one_of(st.integers(-3, 125), st.sampled_from([2**31, UNKNOWN]))
references = st.lists(reference, max_size=4)
number = st.one_of(
    st.floats(width=64), st.sampled_from([0.0, 1.0, math.nan, math.inf, -math.inf, 1e308])
)
pairs = st.lists(st.tuples(reference, number), max_size=4)
integer_pairs = st.lists(st.tuples(reference, st.integers(-(2**31), 2**31 - 1)), max_size=4)
boolean_pairs = st.lists(st.tuples(reference, st.booleans()), max_size=4)
CALLS = st.one_of(
    st.tuples(
        st.sampled_from(["get_real", "get_integer", "get_boolean", "get_string"]), references
    ),
    st.tuples(st.just("set_real"), pairs),
    st.tuples(st.just("set_integer"), integer_pairs),
    st.tuples(st.just("set_boolean"), boolean_pairs),
    st.tuples(
        st.just("set_string"), st.lists(st.tuples(reference, st.text(max_size=3)), max_size=2)
    ),
    st.tuples(st.just("do_step"), st.sampled_from([H, 5e-4, 1e-5, 0.0, -H, math.nan, math.inf])),
    st.tuples(
        st.sampled_from(
            ["enter_initialization_mode", "exit_initialization_mode", "terminate", "save"]
        ),
        st.none(),
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
            saved.append(
                slave._fmu_state_from_bytes(slave._fmu_state_to_bytes(slave._get_fmu_state()))
            )
        elif call == "restore":
            slave._set_fmu_state(saved[-1] if argument is None else argument)
        else:
            getattr(slave, call)()


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(initialised=st.booleans(), calls=st.lists(CALLS, max_size=20))
def test_no_sequence_of_calls_raises(slave_class, initialised, calls):
    slave = slave_class()
    if initialised:
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
    perform(slave, calls)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
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


def test_what_a_slave_remembers_of_earlier_calls_changes_nothing(slave_class):
    def told(forgetful, in_c=True):
        slave, found = slave_class(), []
        for name in () if in_c else ("do_step", "get_real", "set_real"):
            delattr(slave, name)  # the function in C, before the method
        new = slave._get_fmu_state()
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        u, y, time = slave._first_input, slave._first_output, slave._names.index("pod_p.T_S2")
        sound = slave._get_fmu_state()

        def done(call, *arguments):
            if forgetful:
                slave._now.size, slave._of = math.nan, None
            found.append((call, getattr(slave, call)(*arguments), bytes(slave._z)))

        def steps():
            for size in (H, 7 * H, H):
                done("set_real", [u, u + 1], [1.01, 0.02])
                done("set_real", [u + 1, u], [0.01, 0.99])
                done("do_step", 0.0, size)
                for row in ([y, y + 1], [y + 1, y + 2], [y + 1, y], [y, y + 2]):
                    done("get_real", row)

        steps()
        for call, *arguments in (
            ("set_real", [time], [0.2]),
            ("set_real", [time], [H / 10]),  # a rule is broken, which is found in the step
            ("_set_fmu_state", sound),
            ("set_real", [time], [math.nan]),
            ("_set_fmu_state", sound),
            ("_set_fmu_state", new),
            ("_set_fmu_state", sound),
            ("terminate",),
        ):
            done(call, *arguments)
            steps()
        return found

    forgetful = told(forgetful=True)
    runs = [what for call, what, _ in forgetful if call == "do_step"]
    assert runs[::3] == [True, True, False, True, False, True, False, True, False]
    assert told(forgetful=False) == forgetful
    assert told(forgetful=False, in_c=False) == forgetful


def test_functions_in_c_refuse_as_methods_what_is_no_call(slave_class):
    slave = slave_class()
    assert not inspect.ismethod(slave.do_step)
    for call, *wrong in (("do_step", 0.0), ("get_real",), ("set_real", [0])):
        with pytest.raises(TypeError):
            getattr(slave, call)(*wrong)
    first = slave._first_input
    slave.set_real((first, first + 1), (0.5, 0.25))
    assert slave.get_real((first, first + 1)) == [0.5, 0.25]
    slave.set_real([first, first + 1], [0.75, None])
    assert slave.get_real([first, first + 1]) == [0.75, 0.25]
    assert "must be real number" in slave._failure
