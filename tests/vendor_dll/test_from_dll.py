"""A vendor's IEEE/CIGRE DLL as an FMU: what it computes, what it says, where its state is, and planted faults."""

import itertools
import sys

import numpy as np
import pytest

from fmus.vendor_dll import fmu as dll_module
from fmus.vendor_dll.fmu import DllError, dll_fmu, read_dll
from fmus.vendor_dll.interface import DllParameter, Signal, layout
from orchestrator.core.errors import ComponentError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent
from orchestrator.face.cli import main
from orchestrator.linear.models.component_linearization import linearize_component
from orchestrator.systems.coupling.turns import Exchange
from tests.support.vendor_dlls import CALLS, INTERFACE, compiled, lag


def started(description, start=0.0, **values):
    """A running instance."""
    component = LoadedComponent("vendor", description)
    component.set(values)
    component.setup(start, None)
    component.enter_initialization_mode()
    component.exit_initialization_mode()
    return component


@pytest.fixture
def described(tmp_path):
    """Description of the FMU of a DLL's source."""

    def make(source, name="controller"):
        return read_description(
            dll_fmu(read_dll(compiled(source, tmp_path, name)), tmp_path / name)
        )

    return make


def recursion(u, samples, T=0.01, y=0.0, h=1e-4):
    """The lag, by hand."""
    for _ in range(samples):
        y += (u - y) * h / T
    return y


def steps(component, step, count, start=0.0):
    for k in range(count):
        component.step(start + k * step, step)
    return component.values(["y"])["y"]


@pytest.mark.parametrize(
    ("step", "count", "samples"),
    [(1e-4, 30, 30), (1e-3, 3, 30), (3.3e-4, 10, 33), (2.5e-5, 41, 11)],
)
def test_samples_are_counted_in_integers_under_any_step(described, step, count, samples):
    """A sample at each multiple of 100 µs from 0 on that lies before the end."""
    with started(described(lag()), u=0.7) as component:
        assert steps(component, step, count) == recursion(0.7, samples)
        assert component.values(["samples"])["samples"] == samples


def test_a_long_search_path_does_not_keep_a_dll_from_being_read(tmp_path, monkeypatch):
    """Hosts of Python-backed FMUs lengthen sys.path; Linux takes no variable of more than 128 KiB."""
    monkeypatch.setattr(
        "sys.path", [*sys.path, *(f"/somewhere/{'x' * 60}/{k}" for k in range(3000))]
    )
    assert read_dll(compiled(lag(), tmp_path, "controller")).interface.sample_time == 1e-4


def test_a_million_steps_lose_no_sample(described):
    with started(described(lag()), start=0.3, u=0.7) as component:
        for k in range(30_000):
            component.step(0.3 + k * 1e-4, 1e-4)
        assert component.values(["samples"])["samples"] == 30_000


def test_without_a_sample_time_of_its_own_each_step_is_a_sample(described):
    fixed = lag(sample_time=-1, calls=CALLS.replace("INFO.sample_time", "1e-3"))
    with started(described(fixed), u=0.7) as component:
        assert steps(component, 2e-3, 5) == recursion(0.7, 5, h=1e-3)


def test_the_initial_output_reaches_the_dll_before_it_initialises(described):
    with started(described(lag()), **{"initial.y": 0.4}, u=0.7) as component:
        assert component.values(["y"])["y"] == 0.4
        assert steps(component, 1e-4, 5) == recursion(0.7, 5, y=0.4)


def test_a_compiler_agrees_where_each_value_lies():
    rows = [
        *(
            Signal("a", "", "", 2, 1),
            Signal("b", "", "", 9, 1),
            Signal("c", "", "", 4, 3),
            Signal("d", "", "", 8, 1),
        ),
        *(Signal("e", "", "", 1, 5), Signal("f", "", "", 10, 1), Signal("g", "", "", 3, 1)),
    ]
    found = layout(rows)
    import ctypes  # noqa: PLC0415 - the compiler's own idea of the same structure

    class Structure(ctypes.Structure):
        _fields_ = [
            *(
                ("a", ctypes.c_int8),
                ("b", ctypes.c_double),
                ("c", ctypes.c_int16 * 3),
                ("d", ctypes.c_float),
            ),
            *(("e", ctypes.c_char * 5), ("f", ctypes.c_char_p), ("g", ctypes.c_uint8)),
        ]

    firsts = [next(p.offset for p in found.places if p.row is row) for row in rows]
    assert firsts == [getattr(Structure, name).offset for name in "abcdefg"]
    assert found.size == ctypes.sizeof(Structure)


MIXED = (
    INTERFACE
    + """
static const struct signal IN[] = {{"flag", "", "", 3, 1}, {"u", "", "kV", 9, 1}, {"tap", "", "", 4, 3},
    {"f", "", "Hz", 8, 1}, {"note", "", "", 10, 1}, {"n", "", "", 7, 1}},
    OUT[] = {{"sum", "", "", 9, 1}, {"most", "", "", 5, 2}, {"half", "", "", 8, 1}};
static const struct parameter PAR[] = {{"mode", "", "", "", 2, 1, {.i8 = -3}, {.i8 = -5}, {.i8 = 5}},
    {"label", "", "", "", 10, 1, {.s = "abc"}}, {"gain", "", "", "", 8, 0, {.f = 1.5f}, {.f = 0}, {.f = 9}}};
struct in { uint8_t flag; double u; int16_t tap[3]; float f; const char *note; uint32_t n; };
struct out { double sum; uint16_t most[2]; float half; };
struct par { int8_t mode; const char *label; float gain; };
static const struct info INFO = {{1, 1, 0, 0}, {"mixed types"}, 1e-3, 0, 6, IN, 3, OUT, 3, PAR, 2, 1, 1};
const struct info *Model_GetInfo(void) { return &INFO; }
int32_t Model_Initialize(struct instance *s) { return 0; }
int32_t Model_Outputs(struct instance *s) {
    const struct in *u = s->in; struct out *y = s->out; const struct par *p = s->par;
    y->sum = p->gain * (u->flag + u->u + u->tap[0] + 10 * u->tap[1] + 100 * u->tap[2] + u->f + u->n) + p->mode
        + 1000 * strlen(p->label) + (u->note ? strlen(u->note) : 1e9);
    y->most[0] = u->flag; y->most[1] = 60000; y->half = u->f / 2; s->ints[0]++; s->floats[0] = u->f;
    return 0;
}
"""
)


def test_every_type_and_width_arrives_where_the_compiler_looks(described):
    description = described(MIXED)
    inputs = {"flag": 200, "u": 0.25, "tap[1]": -1, "tap[2]": 2, "tap[3]": -3, "f": 0.5, "n": 3e9}
    with started(description, **inputs, mode=4) as component:
        component.step(0.0, 1e-3)
        total = 1.5 * (200 + 0.25 - 1 + 20 - 300 + 0.5 + 3e9) + 4 + 3000
        assert component.values(
            ["sum", "most[1]", "most[2]", "half", "IntStates[1]", "FloatStates[1]"]
        ) == {
            **{
                "sum": total,
                "most[1]": 200,
                "most[2]": 60000,
                "half": 0.25,
                "IntStates[1]": 1,
                "FloatStates[1]": 0.5,
            }
        }


def test_text_is_chosen_when_the_fmu_is_made(tmp_path):
    dll = read_dll(compiled(MIXED, tmp_path))
    description = read_description(dll_fmu(dll, tmp_path / "fmu", {"label": "abcdefgh"}))
    with started(description) as component:
        component.step(0.0, 1e-3)
        assert component.values(["sum"])["sum"] == 8000 - 3
    with pytest.raises(DllError, match="'labl' is no parameter that is text; there are: label"):
        dll_fmu(dll, tmp_path, {"labl": "x"})


HEAP = "static double *own; "
"""State where no host finds it."""

PLACES = {
    "arrays": lag(),
    "library": lag(state="own", doubles=0, head="static double own; "),
    "hidden": lag(
        state="own[0]",
        doubles=0,
        head=HEAP,
        calls=CALLS.replace("{ STATE =", "{ own = malloc(8 + s->mode); STATE ="),
    ),
}


@pytest.mark.parametrize("place", PLACES)
def test_where_the_state_is_is_found_out(described, tmp_path, place):
    assert read_dll(compiled(PLACES[place], tmp_path)).trial.state == place
    description = described(PLACES[place], place)
    assert description.can_save_state == (place != "hidden")
    assert description.can_serialize_state == (place == "arrays")


@pytest.mark.parametrize("place", ["arrays", "library"])
def test_a_restored_state_repeats_bit_for_bit(described, place):
    with started(described(PLACES[place]), u=0.7) as component:
        steps(component, 1e-4, 50)
        saved = component.save_state()
        first = steps(component, 1e-4, 50, 5e-3)
        component.restore_state(saved)
        assert steps(component, 1e-4, 50, 5e-3) == first
        component.free_state(saved)


BLOCKED = lag(
    do="static double w; if (((double *)s->in)[0] > 0.7) w += 0.01; ((double *)s->out)[0] += w;"
)
SINGLE = lag(
    state="own",
    doubles=0,
    head="static float own; ",
    calls=CALLS.replace("((double *)s->in)[0]", "((float *)s->in)[0]"),
).replace('"pu", 9, 1}}, OUT', '"pu", 8, 1}}, OUT')


@pytest.mark.parametrize(
    "source", [BLOCKED, SINGLE], ids=["blocked below 0.7 pu", "single precision"]
)
def test_a_variable_of_its_own_is_found_where_it_hides(described, tmp_path, source):
    assert read_dll(compiled(source, tmp_path)).trial.state == "library"
    with started(described(source, "again"), u=1.0) as component:
        steps(component, 1e-4, 50)
        saved = component.save_state()
        first = steps(component, 1e-4, 50, 5e-3)
        component.restore_state(saved)
        assert steps(component, 1e-4, 50, 5e-3) == first
        component.free_state(saved)


def test_a_serialised_state_serves_another_instance(described):
    description = described(lag())
    with started(description, u=0.7) as one, started(description, u=-0.3) as other:
        steps(one, 1e-4, 20)
        content = one.serialize_state(one.save_state())
        other.restore_state(other.deserialize_state(content))
        assert steps(other, 1e-4, 20, 2e-3) == steps(one, 1e-4, 20, 2e-3) == recursion(0.7, 40)


def test_instances_share_no_variables_of_the_library(described):
    description = described(PLACES["library"])
    with started(description, u=0.7) as one, started(description, u=-0.2) as other:
        for k in range(40):
            one.step(k * 1e-4, 1e-4)
            other.step(k * 1e-4, 1e-4)
        assert [c.values(["y"])["y"] for c in (one, other)] == [
            recursion(0.7, 40),
            recursion(-0.2, 40),
        ]


def test_a_reset_begins_anew_with_the_librarys_own_variables(described):
    with started(
        described(lag(do="((double *)s->out)[0] += 100 * calls++;", head="static int calls; ")),
        u=0.7,
    ) as component:
        first = steps(component, 1e-4, 3)
        component.reset()
        component.set({"u": 0.7})
        component.setup(0.0, None)
        component.enter_initialization_mode()
        component.exit_initialization_mode()
        assert steps(component, 1e-4, 3) == first


@pytest.mark.parametrize("place", ["arrays", "library"])
def test_perturbing_its_states_gives_the_lags_own_factor(described, place):
    """λ = 1 - h/T of the sampled lag, over 5 samples of a step, wherever its state is."""
    description = described(PLACES[place])
    with started(description, **{"initial.y": 0.7}, u=0.7) as component:
        exchange = Exchange(
            component,
            RealBatch(component, ["u"]),
            RealBatch(component, ["y"]),
            slice(0, 1),
            np.zeros(1, dtype=np.int64),
        )
        found = linearize_component(exchange, 0.0, 5e-4)
        eigenvalues = np.linalg.eigvals(found.A)
        assert np.abs(eigenvalues).max() == pytest.approx((1 - 1e-4 / 0.01) ** 5, rel=1e-6)
        k = found.states.index("held.y")
        assert found.C[0, k] == pytest.approx(1.0)
        assert found.B[k, 0] == pytest.approx(1 - (1 - 1e-4 / 0.01) ** 5, rel=1e-6)


FAULTS = {
    "an error in the DLL's words": (
        {"do": 'if (s->time > 0.01) { s->error = "DC voltage lost"; return 2; }'},
        "Model_Outputs at t = 0.0101 s ends with an error of the DLL: DC voltage lost",
    ),
    "not a number": (
        {"do": "if (s->time > 0.01) ((double *)s->out)[0] = NAN;"},
        "y is no longer finite after t = 0.0101 s",
    ),
    "writing outside of its arrays": (
        {"do": "if (s->time > 0.01) s->doubles[3] = 1;"},
        "Model_Outputs wrote outside of its double states (8 bytes): after the last",
    ),
    "writing before its outputs": (
        {"do": "if (s->time > 0.01) ((double *)s->out)[-1] = 1;"},
        "Model_Outputs wrote outside of its outputs (8 bytes): before the first",
    ),
    "an answer that nobody knows": (
        {"do": "if (s->time > 0.01) return 7;"},
        "Model_Outputs returns 7",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_named(described, fault):
    planted, words = FAULTS[fault]
    source = lag(**planted).replace('"T", "", "Time constant"', '"T", "", "Zeitkonstante"')
    with started(described(source), u=0.7) as component, pytest.raises(ComponentError) as caught:
        steps(component, 1e-4, 300)
    assert words in str(caught.value)


ABORT, LOOP = (
    f"#include <unistd.h>\n__attribute__((constructor)) static void begin(void) {{ {words} }} "
    for words in ("abort();", "for (;;) pause();")
)
TWICE = '"y", "", "", 9, 1}, {"y", "Lagged'
BROKEN = {
    "no IEEE/CIGRE DLL": ("int x;", "it has no function Model_GetInfo, so it is no IEEE/CIGRE DLL"),
    "a missing function": (
        lag(calls=CALLS.replace("Model_Outputs", "Model_Output")),
        "no function Model_Outputs",
    ),
    "two of one name": (
        lag().replace('"y", "Lagged', TWICE).replace("1, OUT", "2, OUT"),
        "has the name of output 1",
    ),
    "an unknown type": (
        lag().replace('"pu", 9, 1}}, OUT', '"pu", 11, 1}}, OUT'),
        "input 1 ('u') has data type 11",
    ),
    "no width": (
        lag().replace('"pu", 9, 1}}, OUT', '"pu", 9, 0}}, OUT'),
        "input 1 ('u') has width 0",
    ),
    "another layout": (
        lag().replace("int32_t n_in;", "__attribute__((aligned(256))) int32_t n_in;"),
        "is of another layout",
    ),
    "a crash on loading": (lag(head=ABORT), "ends with SIGABRT"),
    "no sample time": (lag(sample_time="NAN"), "its sample time is nan s"),
    "too short a sample time": (
        lag(sample_time=1e-15),
        "its sample time is 1e-15 s; at least 1e-09 s",
    ),
    "bounds the wrong way": (
        lag().replace("{.d = 0.001}, {.d = 10}", "{.d = 10}, {.d = 0.001}"),
        "10.0 to 0.001",
    ),
    "a name that cannot be written": (
        lag().replace('"y", "Lag', '"y\\001", "Lag'),
        "a name that cannot be written",
    ),
    "a name that is taken": (
        lag().replace('"y", "Lag', '"DoubleStates[1]", "Lag'),
        "would stand for two variables",
    ),
}


@pytest.mark.parametrize("broken", BROKEN)
def test_a_broken_dll_is_refused_in_one_line(tmp_path, capsys, broken):
    source, words = BROKEN[broken]
    library = compiled(source, tmp_path)
    assert main(["fmu", "build", "--from-dll", str(library), "--dest", str(tmp_path)]) == 2
    printed = capsys.readouterr().err
    assert "controller.so: " in printed
    assert words in " ".join(printed.split())
    assert "Traceback" not in printed
    assert not list(tmp_path.glob("*.fmu"))


def test_a_dll_that_hangs_is_given_up(tmp_path, monkeypatch):
    monkeypatch.setattr(dll_module, "_LONGEST", 3)
    library = compiled(lag(head=LOOP), tmp_path)
    with pytest.raises(DllError, match="does not end within 3 s"):
        read_dll(library)


def test_a_dll_that_names_another_file_at_each_reading_is_given_up(tmp_path, monkeypatch):
    files = itertools.count()

    def another(*_):
        path = tmp_path / f"table_{next(files)}.txt"
        path.touch()
        return {"table": path}

    monkeypatch.setattr(dll_module, "places", another)
    with pytest.raises(DllError, match="are others in each of 8 readings"):
        read_dll(compiled(lag(), tmp_path))


def test_a_dll_that_crashes_with_moving_inputs_is_still_described(described, tmp_path):
    library = compiled(lag(do="if (((double *)s->in)[0] != 0) abort();"), tmp_path)
    trial = read_dll(library).trial
    assert trial.state == "not tried"
    assert "SIGABRT" in trial.why


@pytest.mark.parametrize(
    ("head", "words"),
    [
        (b"MZ" + bytes(98), "a Windows DLL"),
        (b"\x7fELF\x01" + bytes(95), "32-bit Linux"),
        (b"PK\3\4", "no shared library"),
    ],
)
def test_a_library_of_another_machine_is_refused(tmp_path, head, words):
    file = tmp_path / "vendor.dll"
    file.write_bytes(head)
    with pytest.raises(DllError, match=words):
        read_dll(file)


def test_the_command_tells_what_was_found_out(tmp_path, capsys):
    library = compiled(PLACES["library"], tmp_path)
    assert main(["fmu", "build", "--from-dll", str(library), "--dest", str(tmp_path)]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "lag 1.0: a sample every 0.0001 s; declared states: none" in printed
    assert "it keeps state in variables of its own" in printed
    assert "lag.fmu" in printed


def test_a_parameter_that_the_dll_changes_is_told(described):
    source = lag(
        head="int32_t Model_CheckParameters(struct instance *s) { ((double *)s->par)[0] = 0.02; return 0; } "
    )
    with started(described(source), u=0.7) as component:
        assert steps(component, 1e-4, 10) == recursion(0.7, 10, T=0.02)
        assert component.values(["T"])["T"] == 0.02


def test_parameters_are_held_to_the_dlls_own_bounds(described):
    with pytest.raises(ComponentError, match=r"parameter T = 11; the DLL allows 0\.001 to 10"):
        started(described(lag()), T=11.0)


def test_bounds_and_defaults_are_read_in_the_parameters_own_type(tmp_path):
    parameters = read_dll(compiled(MIXED, tmp_path)).interface.parameters
    assert parameters[0] == DllParameter("mode", "", "", "", 2, True, -3, -5, 5)
    assert (parameters[1].default, parameters[2].default) == ("abc", 1.5)
