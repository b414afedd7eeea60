"""DLLs of our own with a planted defect: each is caught by name, and none gets a healthy verdict."""

import pytest

from fmus.vendor_dll.fmu import read_dll
from orchestrator.core.errors import CosimError, InputError
from orchestrator.devices.acceptance.runner import check_fmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.vendor_files import as_fmu
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.support.vendor_dlls import CALLS, INTERFACE, compiled, lag

LATE = "if (s->time > 0.005) "

CAUGHT = {
    # what is planted: (source, what the message says)
    "an error code": (
        lag(do=LATE + '{ s->error = "IGBT fault"; return 2; }'),
        "error of the DLL: IGBT fault",
    ),
    "an unknown code": (lag(do=LATE + "return 9;"), "Model_Outputs returns 9; the interface knows"),
    "not a number": (lag(do=LATE + "((double *)s->out)[0] = NAN;"), "y is no longer finite"),
    "a state that is infinite": (
        lag(do=LATE + "s->doubles[0] = INFINITY;"),
        "DoubleStates[1] is no longer finite",
    ),
    "a write behind its states": (
        lag(do=LATE + "s->doubles[1] = 1;"),
        "wrote outside of its double states",
    ),
    "a write behind its outputs": (
        lag(do="((double *)s->out)[1] = 1;"),
        "wrote outside of its outputs",
    ),
    "a write before its parameters": (
        lag(do="((double *)s->par)[-1] = 1;"),
        "wrote outside of its parameters",
    ),
    "more inputs than declared, written": (
        lag(do="((double *)s->in)[1] = 1;"),
        "wrote outside of its inputs",
    ),
    "a crash in a sample": (lag(do=LATE + "abort();"), "SIGABRT"),
    "a crash in initialise": (lag(begin="*(volatile int *)0 = 1;"), "SIGSEGV"),
    "an error in initialise": (
        lag(begin='{ s->error = "no licence"; return 2; }'),
        "error of the DLL: no licence",
    ),
    "an initial value that is none": (
        lag(begin="((double *)s->out)[0] = NAN;"),
        "Model_Initialize gives no finite value for y",
    ),
}

REFUSED = {
    "a missing function": (
        lag(calls=CALLS.replace("Model_Initialize", "Model_Init")),
        "no function Model_Initialize",
    ),
    "no functions at all": ("int answer;", "it has no function Model_GetInfo"),
    "another alignment": (
        INTERFACE.replace("int32_t n_in;", "__attribute__((aligned(64))) int32_t n_in;")
        + lag()[len(INTERFACE) :],
        "its structures are of another layout",
    ),
    "packed structures": ("#pragma pack(1)\n" + lag(), "layout"),
    "a sample time below 0 that is no number": (
        lag(sample_time="-NAN"),
        "its sample time is nan s",
    ),
    "an endless sample time": (lag(sample_time="INFINITY"), "its sample time is inf s"),
    "negative states": (lag(doubles=-1), "none may be negative"),
    "bounds turned": (
        lag().replace("{.d = 0.001}, {.d = 10}", "{.d = 10}, {.d = 0.001}"),
        "between which nothing is",
    ),
    "another version of the interface": (
        lag().replace("{1, 1, 0, 0}", "{3, 0, 0, 0}"),
        "version 3.0.0.0",
    ),
}


def run(source, folder):
    """A run of 20 ms, in a process of its own as a study has it."""
    description = read_description(compiled(source, folder))
    with open_component("vendor", description) as component:
        component.setup(0.0, None)
        component.set({"u": 0.7})
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        for k in range(200):
            component.step(k * 1e-4, 1e-4)
            component.values(["y"])
    return description


@pytest.mark.parametrize("planted", CAUGHT)
def test_a_defect_that_shows_in_the_run_is_named(tmp_path, planted):
    source, words = CAUGHT[planted]
    with pytest.raises(CosimError) as caught:
        run(source, tmp_path)
    assert words in str(caught.value)


@pytest.mark.parametrize("planted", REFUSED)
def test_a_defect_in_what_it_declares_is_refused(tmp_path, planted):
    source, words = REFUSED[planted]
    with pytest.raises(InputError) as caught:
        run(source, tmp_path)
    assert words in str(caught.value)


KEEPING = {
    "a hidden global": (lag(state="own", doubles=0, head="static double own; "), "library"),
    "memory that it allocates": (
        lag(
            state="(*own)",
            doubles=0,
            head="static double *volatile own; "
            "int32_t Model_FirstCall(struct instance *s) { own = malloc(8); *own = 0; return 0; } ",
        ),
        "hidden",
    ),
    "a file": (
        lag(
            head="#include <stdio.h>\nstatic int n; ",
            do='FILE *f = fopen("n", "a+"); if (f) { fputc(1, f); ((double *)s->out)[0] += ftell(f); fclose(f); }',
        ),
        "hidden",
    ),
    "an honest one": (lag(), "arrays"),
}


@pytest.mark.parametrize("planted", KEEPING)
def test_where_it_keeps_its_state_is_named(tmp_path, planted):
    source, kept = KEEPING[planted]
    assert read_dll(compiled(source, tmp_path)).trial.state == kept


def test_a_sample_that_hangs_is_given_up_by_name(tmp_path):
    source = lag(head="#include <unistd.h>\n", do="if (s->time > 0.05) for (;;) pause();")
    fmu = as_fmu(compiled(source, tmp_path))
    report = check_fmu(fmu, limits=Limits(seconds=1.0), only=("runs",), run_for=0.5)
    assert not report.trusted
    assert any("hang" in fault or "time" in fault for fault in report.faults), report.faults


def test_a_run_cannot_write_beside_its_own_folder(tmp_path):
    mark = tmp_path / "mark"
    text = f'FILE *f = fopen("{mark}", "w"); if (f) {{ fputc(1, f); fclose(f); ((double *)s->out)[0] = 99; }}'
    assert run(lag(head="#include <stdio.h>\n", do=text), tmp_path)
    assert not mark.exists()


@pytest.mark.parametrize(
    ("default", "fault"), [("{.d = 50}, {.d = 0.001}", "start"), ("{.d = 0.01}, {.d = 0.001}", "")]
)
def test_a_default_outside_of_its_bounds_fails_the_acceptance_test(tmp_path, default, fault):
    source = lag().replace("{.d = 0.01}, {.d = 0.001}", default)
    report = check_fmu(as_fmu(compiled(source, tmp_path)), only=("declared_starts",))
    assert [result.check for result in report.failures] == (["declared_starts"] if fault else [])


def test_a_range_that_is_not_declared_is_none(tmp_path):
    source = lag().replace("{.d = 0.001}, {.d = 10}", "{.d = 0}, {.d = 0}")
    (parameter,) = read_dll(compiled(source, tmp_path)).interface.parameters
    assert (parameter.default, parameter.minimum, parameter.maximum) == (0.01, None, None)


@pytest.mark.parametrize("time", [0, -1e-4])
def test_without_a_sample_time_each_step_is_a_sample(tmp_path, time):
    source = lag(sample_time=time, calls=CALLS.replace("INFO.sample_time", "1e-4"))
    assert run(source, tmp_path).sample_time is None
