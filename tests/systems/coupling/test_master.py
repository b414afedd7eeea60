"""The master against recursions computed by hand, and what it leaves behind when something fails."""

import tempfile
from dataclasses import dataclass

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from orchestrator.core.errors import ComponentError, InputError
from orchestrator.devices.fmi import unpacked
from orchestrator.devices.fmi.description import read_description
from orchestrator.systems.coupling import compiled_loop as loops
from orchestrator.systems.coupling.clock import Clock
from orchestrator.systems.coupling.events import Event, ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import Schedule, gauss_seidel, jacobi
from orchestrator.systems.coupling.system import System
from tests.devices.acceptance.gallery.build import Source, Variable, build
from tests.systems.coupling.small_fmus import lag_factor, small_fmu

H = 1e-3
STEPS = 200
TOLERANCE = 1e-12


@pytest.fixture(params=["compiled", "python"], autouse=True)
def inner_loop(request, monkeypatch):
    """Every test runs with the loop in C and with the loop in Python."""
    if request.param == "python":
        monkeypatch.setattr(loops, "loop_library", lambda: None)
    elif loops.loop_library() is None:
        pytest.skip("no compiler for this platform")
    return request.param


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """An empty folder where temporary folders are made; none is kept for a later system, nor from an earlier one."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    monkeypatch.setattr(unpacked, "_folders", {})
    monkeypatch.setattr(unpacked, "_MOST_UNUSED", 0)
    return folder


def system_of(wires=(), **components):
    """A system of small FMUs: name = (model, parameters[, inputs])."""
    system = System()
    for name, (model, *values) in components.items():
        system.add(name, small_fmu(model), *values)
    for source, target in wires:
        system.connect(source, target)
    return system


def ring(*names):
    """Wires y → u around a ring."""
    return [(f"{a}.y", f"{b}.u") for a, b in zip(names, (*names[1:], names[0]), strict=True)]


def oscillator():
    """Two integrators in a ring: ẋ_a = 30·x_b, ẋ_b = −20·x_a."""
    return system_of(
        ring("a", "b"),
        a=("integrator", {"gain": 30.0, "x_0": 1.0}),
        b=("integrator", {"gain": -20.0, "x_0": 0.5}),
    )


def trajectory(system, schedule, names, steps=STEPS, events=(), step_size=H):
    recorder = Recorder(names, 1)
    with Master(system, schedule, step_size) as master:
        master.run(steps * step_size, events, [recorder])
    assert recorder.times.tolist() == [k * step_size for k in range(steps + 1)]
    return recorder.values


def recursion(step, start, steps=STEPS):
    """Points of x' = step(x)."""
    points = [np.array(start, float)]
    for _ in range(steps):
        points.append(np.array(step(*points[-1]), float))
    return np.array(points)


# -- schedules -------------------------------------------------------------------------------------


def test_two_integrators_side_by_side():
    seen = trajectory(oscillator(), jacobi(("a", "b")), ["a.y", "b.y"])
    expected = recursion(lambda a, b: (a + H * 30 * b, b - H * 20 * a), (1.0, 0.5))
    assert np.abs(seen - expected).max() < TOLERANCE


@pytest.mark.parametrize(
    ("groups", "step"),
    [
        ((("a",), ("b",)), lambda a, b: ((new := a + H * 30 * b), b - H * 20 * new)),
        ((("b",), ("a",)), lambda a, b: (a + H * 30 * (new := b - H * 20 * a), new)),
    ],
    ids=["a first", "b first"],
)
def test_two_integrators_one_after_the_other(groups, step):
    seen = trajectory(oscillator(), gauss_seidel(groups), ["a.y", "b.y"])
    assert np.abs(seen - recursion(step, (1.0, 0.5))).max() < TOLERANCE


@pytest.mark.parametrize("step_size", [1e-4, 1e-3, 1.7e-3], ids=lambda h: f"H = {h} s")
def test_two_lags_one_after_the_other(step_size):
    system = system_of(
        ring("a", "b"), a=("lag", {"T": 0.005, "x_0": 2.0}), b=("lag", {"T": 0.02, "x_0": -1.0})
    )
    seen = trajectory(system, gauss_seidel((("a",), ("b",))), ["a.y", "b.y"], step_size=step_size)
    keep_a, keep_b = lag_factor(step_size, 0.005), lag_factor(step_size, 0.02)

    def step(a, b):
        a = keep_a * a + (1 - keep_a) * b
        return a, keep_b * b + (1 - keep_b) * a

    assert np.abs(seen - recursion(step, (2.0, -1.0))).max() < TOLERANCE


def test_a_group_of_two_before_a_third():
    """Within the first group nobody sees a new value; the third sees both."""
    system = system_of(
        [("c.y", "a.u"), ("a.y", "b.u"), ("b.y", "c.u")],
        a=("integrator", {"gain": 30.0, "x_0": 1.0}),
        b=("integrator", {"gain": -20.0, "x_0": 0.5}),
        c=("lag", {"T": 0.01, "x_0": 0.2}),
    )
    seen = trajectory(system, gauss_seidel((("a", "b"), ("c",))), ["a.y", "b.y", "c.y"])
    keep = lag_factor(H, 0.01)

    def step(a, b, c):
        new_b = b - H * 20 * a
        return a + H * 30 * c, new_b, keep * c + (1 - keep) * new_b

    assert np.abs(seen - recursion(step, (1.0, 0.5, 0.2))).max() < TOLERANCE


@pytest.mark.parametrize("delayed", [True, False], ids=["jacobi", "gauss-seidel"])
def test_direct_feedthrough_is_delayed_by_a_step_only_where_the_schedule_says_so(delayed):
    system = system_of(ring("x", "k"), x=("integrator", {"x_0": 2.0}), k=("gain", {"K": -40.0}))
    schedule = jacobi(("x", "k")) if delayed else gauss_seidel((("x",), ("k",)))
    seen = trajectory(system, schedule, ["x.y", "k.y"])

    def step(x, y):
        new = x + H * y
        return new, -40 * (x if delayed else new)

    expected = recursion(step, (2.0, -80.0))  # initialisation has already passed x through the gain
    assert np.abs(seen - expected).max() < 40 * TOLERANCE


def test_what_is_fed_through_arrives_before_the_first_step_however_long_the_chain():
    """Twelve gains, each before the one that feeds it, need a pass each; the last one feeds nobody."""
    count = 12
    names = [f"k{n}" for n in range(count)]
    system = system_of(
        [(f"{a}.y", f"{b}.u") for a, b in zip(["x", *names], names, strict=False)],
        x=("integrator", {"x_0": 3.0}, {"u": 0.0}),
        **{name: ("gain", {"K": 2.0}) for name in names},
    )
    with Master(
        system, gauss_seidel(tuple((name,) for name in [*reversed(names), "x"])), H
    ) as master:
        first = dict(zip(master.output_names, master.y.tolist(), strict=True))
    assert first == {"x.y": 3.0} | {f"k{n}.y": 3.0 * 2.0 ** (n + 1) for n in range(count - 1)}


def test_a_loop_of_gains_starts_where_it_agrees_with_itself():
    system = system_of(
        ring("a", "b"), a=("gain", {"K": 0.5, "offset": 1.0}), b=("gain", {"K": 0.5})
    )
    with Master(system, jacobi(("a", "b")), H) as master:
        assert master.y == pytest.approx([4 / 3, 2 / 3], rel=1e-9)


def test_one_output_feeds_several_inputs():
    system = system_of(
        [("x.y", "k.u"), ("x.y", "m.u")],
        x=("integrator", {"x_0": 3.0}, {"u": 5.0}),
        k=("gain", {"K": 2.0}),
        m=("gain", {"K": -4.0}),
    )
    seen = trajectory(system, gauss_seidel((("x",), ("k", "m"))), ["x.y", "k.y", "m.y"], 50)
    x = 3.0 + 5.0 * H * np.arange(51)
    assert np.abs(seen - np.outer(x, (1, 2, -4))).max() < TOLERANCE


def test_a_run_in_two_parts_is_the_run_in_one():
    whole, parts = Recorder(["a.y", "b.y"], 1), Recorder(["a.y", "b.y"], 1)
    schedule = gauss_seidel((("a",), ("b",)))
    with Master(oscillator(), schedule, H) as master:
        master.run(20 * H, (), [whole])
    with Master(oscillator(), schedule, H) as master:
        master.run(7 * H)
        assert (master.index, master.time) == (7, 7 * H)
        master.run(20 * H, (), [parts])
    assert parts.times.tolist() == whole.times[7:].tolist()
    assert parts.values.tolist() == whole.values[7:].tolist()


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        ((("a",),), "not in any group: b"),
        ((("a",), ("b",), ("a",)), "listed more than once: a"),
        ((("a", "b", "c"),), "not components: c"),
        ((("a", "a"), ("z",)), "not in any group: b; not components: z; listed more than once: a"),
    ],
)
def test_a_schedule_that_does_not_fit_the_components(groups, words):
    with pytest.raises(InputError) as caught:
        Master(oscillator(), Schedule("mine", groups), H)
    assert str(caught.value) == f"schedule 'mine': {words}; list every component exactly once"


# -- time ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("step_size", [1e-4, 5e-5, 1 / 3000])
def test_the_clock_does_not_drift(step_size):
    clock = Clock(step_size)
    for index in (0, 1, 999_999, 1_000_000, 123_456_789):
        assert clock.time(index) == index * step_size
        assert clock.index(clock.time(index), "this") == index


def test_after_a_million_steps_the_clock_shows_a_hundred_seconds():
    assert Clock(1e-4).time(1_000_000) == 100.0
    assert Clock(1e-4).index(100.0, "this") == 1_000_000


@pytest.mark.parametrize("step_size", [0.0, -1e-3, float("nan")])
def test_a_step_size_that_no_clock_can_have(step_size):
    with pytest.raises(InputError, match=r"communication step size .* must exceed 0"):
        Clock(step_size)


@pytest.mark.parametrize(
    ("time", "nearest"), [(0.00234, "0.002"), (0.00251, "0.003"), (-0.001, "0")]
)
def test_a_time_between_communication_points(time, nearest):
    with pytest.raises(InputError) as caught:
        Clock(H).index(time, "the stop")
    text = f"the stop at {time:g} s is not a communication point; with steps of 0.001 s the nearest is {nearest} s"
    assert str(caught.value) == text


@pytest.mark.parametrize("time", [float("inf"), float("-inf")])
def test_an_infinite_time_is_refused(time):
    with pytest.raises(InputError, match="the stop"):
        Clock(H).index(time, "the stop")


@pytest.fixture(scope="session")
def told_time(tmp_path_factory):
    """An FMU that repeats the time and the size of the step that it was told."""
    variables = [Variable("u", 0, "input", 0, "1")]
    variables += [
        Variable(name, k, "output", unit="s") for k, name in enumerate(("time", "step"), start=1)
    ]
    variables += [Variable("held", 3, "output", unit="1")]
    source = Source("told_time", "../../../systems/coupling/told_time.c", {}, tuple(variables))
    return read_description(build(source, tmp_path_factory.mktemp("told_time")))


def test_a_step_is_told_the_time_at_which_it_begins_and_gets_the_input_of_then(told_time):
    """An FMU with a clock of its own, or with a table over time, would run ahead by a step and nothing would show."""
    system = system_of(x=("integrator", {"x_0": 7.0}, {"u": 1.0}))
    system.add("clock", told_time)
    system.connect("x.y", "clock.u")
    names = ["clock.time", "clock.step", "clock.held"]
    recorder = Recorder(names, 1)
    with Master(system, jacobi(("clock", "x")), H) as master:
        master.run(2 * H)
        master.run(6 * H, (), [recorder])
    for k, (time, step, held) in zip(range(1, 6), recorder.values, strict=False):
        assert time == k * H
        assert step == H
        assert held == pytest.approx(7.0 + k * H, abs=TOLERANCE)


# -- events ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "schedule", [jacobi(("k", "x")), gauss_seidel((("x",), ("k",)))], ids=lambda s: s.name
)
@pytest.mark.parametrize("at", [0, 3])
def test_an_event_counts_from_the_step_that_starts_at_its_time(schedule, at):
    """The gain's output jumps with its parameter; the integrator sees it in the very next step."""
    system = system_of([("k.y", "x.u")], k=("gain", {"K": 2.0}, {"u": 1.0}), x=("integrator",))
    seen = trajectory(system, schedule, ["x.y"], 6, [ParameterChange(at * H, "k", "K", 5.0)])[:, 0]
    rates = [2.0 if k < at else 5.0 for k in range(6)]
    assert np.abs(seen - H * np.cumsum([0.0, *rates])).max() < TOLERANCE


def test_events_at_one_time_happen_in_their_order_and_none_is_lost():
    system = system_of(x=("integrator", {}, {"u": 1.0}), z=("integrator", {}, {"u": 1.0}))
    events = [
        ParameterChange(2 * H, "x", "gain", 7.0),
        ParameterChange(2 * H, "x", "gain", 3.0),
        ParameterChange(2 * H, "z", "u", -1.0),
    ]
    seen = trajectory(system, jacobi(("x", "z")), ["x.y", "z.y"], 4, events)
    assert np.abs(seen[:, 0] - H * np.array([0, 1, 2, 5, 8])).max() < TOLERANCE
    assert np.abs(seen[:, 1] - H * np.array([0, 1, 2, 1, 0])).max() < TOLERANCE


@dataclass(frozen=True, slots=True)
class BothGains(Event):
    """Sets variables of two components at once."""

    def changes(self):
        return {"k": {"K": 5.0}, self.component: {"gain": 2.0}}


def test_an_event_may_change_several_components_before_their_partners_see_any_of_it():
    system = system_of([("k.y", "x.u")], k=("gain", {"K": 1.0}, {"u": 1.0}), x=("integrator",))
    event = BothGains(2 * H, "x")
    seen = trajectory(system, jacobi(("k", "x")), ["x.y"], 4, [event])[:, 0]
    assert np.abs(seen - H * np.array([0, 1, 2, 12, 22])).max() < TOLERANCE
    assert str(event) == "t = 0.002 s: k.K = 5, x.gain = 2"


def test_an_event_that_breaks_a_rule_of_the_fmu_is_refused_before_its_partners_see_it():
    system = system_of([("k.y", "x.u")], k=("guarded_gain", {}, {"u": 1.0}), x=("integrator",))
    rule = r"component 'k' at t = 0\.002 s: .* K must exceed 0; raise it"
    with (
        Master(system, gauss_seidel((("x",), ("k",))), H) as master,
        pytest.raises(ComponentError, match=rule),
    ):
        master.run(0.01, [ParameterChange(2 * H, "k", "K", 0.0)])


def test_an_event_between_communication_points_stops_the_run_before_it_starts():
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        with pytest.raises(
            InputError, match=r"an event at 0\.0025 s is not a communication point.* nearest"
        ):
            master.run(0.01, [ParameterChange(0.0025, "a", "gain", 1.0)])
        assert master.index == 0


def test_a_stop_between_communication_points():
    with (
        Master(oscillator(), jacobi(("a", "b")), H) as master,
        pytest.raises(InputError, match="the stop at"),
    ):
        master.run(0.0105)


def test_an_event_that_the_fmu_refuses_names_time_component_and_reason():
    system = system_of(k=("gain", {}, {"u": 1.0}))
    recorder = Recorder(["k.y"], 1)
    with Master(system, jacobi(("k",)), H) as master, pytest.raises(ComponentError) as caught:
        master.run(0.01, [ParameterChange(0.004, "k", "offset", 1.0)], [recorder])
    assert (caught.value.component, caught.value.time) == ("k", 0.004)
    assert "component 'k' at t = 0.004 s: setting offset = 1.0" in str(caught.value)
    assert "parameter offset is fixed" in str(caught.value)
    assert len(recorder.times) == 5


# -- systems on paper ------------------------------------------------------------------------------


def test_inputs_that_nothing_feeds_are_all_named():
    system = system_of([("a.y", "b.u")], a=("integrator",), b=("gain",), c=("lag",))
    with pytest.raises(
        InputError, match=r"inputs that nothing feeds: a\.u, c\.u; connect them or give"
    ):
        Master(system, jacobi(("a", "b", "c")), H)


def test_constants_feed_inputs_from_the_first_step():
    system = system_of(
        x=("integrator", {"gain": 4.0, "x_0": 1.0}, {"u": 2.5}), k=("gain", {}, {"u": -6.0})
    )
    seen = trajectory(system, jacobi(("x", "k")), ["x.y", "k.y"], 3)
    assert np.abs(seen - [[1 + 10 * H * k, -6] for k in range(4)]).max() < TOLERANCE


@pytest.mark.parametrize(
    ("source", "target", "reason"),
    [
        ("a.y", "b.u", "b.u is already fed by k.y"),
        ("p.p", "a.u", "p.p is in MW and a.u in 1; units must be equal"),
        ("a.u", "k.u", "a.u is of causality input; a connection starts at an output"),
        ("a.x", "k.u", "a.x is of causality local; a connection starts at an output"),
        ("a.y", "k.K", "k.K is of causality parameter; a connection ends at an input"),
        ("a.y", "k.y", "k.y is of causality output; a connection ends at an input"),
        ("none.y", "k.u", "there is no component 'none'; components: a, b, k, p"),
        ("a.y", "none.u", "there is no component 'none'; components: a, b, k, p"),
        ("a.none", "k.u", "component 'a' has no variable 'none'"),
        ("a.y", "k.none", "component 'k' has no variable 'none'"),
        ("a", "k.u", "component 'a' has no variable ''"),
    ],
)
def test_a_connection_that_cannot_be_made_names_both_ends_and_why(source, target, reason):
    wires = [("k.y", "b.u")]
    system = system_of(
        wires, a=("integrator",), b=("integrator",), k=("gain",), p=("power_source",)
    )
    with pytest.raises(InputError) as caught:
        system.connect(source, target)
    assert str(caught.value).startswith(f"connection {source} → {target}: {reason}")
    assert len(system.connections) == 1


def test_connections_that_were_put_into_the_list_itself_feed_their_inputs_too():
    components = {"a": ("integrator",), "b": ("integrator",), "k": ("gain",)}
    system, other = (
        system_of([("k.y", "b.u")], **components),
        system_of([("k.y", "b.u"), ("b.y", "a.u")], **components),
    )
    system.connections.append(other.connections[1])
    with pytest.raises(InputError, match=r"a\.u is already fed by b\.y"):
        system.connect("k.y", "a.u")
    # another list of the same length
    system.connections = [other.connections[1], other.connections[1]]
    system.connect("k.y", "b.u")
    with pytest.raises(InputError, match=r"b\.u is already fed by k\.y"):
        system.connect("a.y", "b.u")


def test_a_name_is_taken_once():
    with pytest.raises(InputError, match="component 'a' is added twice"):
        system_of(a=("gain",)).add("a", small_fmu("lag"))


# -- observers -------------------------------------------------------------------------------------


class Probe:
    """Writes down what it is called with."""

    def __init__(self, every, calls, name="probe"):
        self.every, self.calls, self.name = every, calls, name

    def begin(self, master, stop_index):
        self.calls.append((self.name, "begin", stop_index))

    def observe(self, master):
        self.calls.append((self.name, "observe", master.index))

    def end(self, master):
        self.calls.append((self.name, "end", master.index))

    @property
    def observed(self):
        return [value for name, call, value in self.calls if (name, call) == (self.name, "observe")]


def test_observers_are_begun_called_and_ended_in_order():
    calls = []
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        master.run(2 * H, (), [Probe(1, calls)])
    assert calls == [
        ("probe", "begin", 2),
        *[("probe", "observe", k) for k in (0, 1, 2)],
        ("probe", "end", 2),
    ]


def test_each_observer_looks_as_often_as_it_wants_whatever_others_and_events_do():
    calls = []
    fast, slow = Probe(3, calls, "fast"), Probe(5, calls, "slow")
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        master.run(16 * H, [ParameterChange(k * H, "a", "gain", 1.0) for k in (4, 6)], [fast, slow])
    assert fast.observed == [0, 3, 6, 9, 12, 15]
    assert slow.observed == [0, 5, 10, 15]


def test_an_observer_is_not_passed_over_on_a_long_stretch():
    calls = []
    with Master(oscillator(), jacobi(("a", "b")), 1e-4) as master:
        master.run(0.35, (), [Probe(1700, calls)])
        assert master.index == 3500
    assert [value for _, call, value in calls if call == "observe"] == [0, 1700, 3400]


def test_observers_are_ended_after_a_failure_at_the_point_that_was_reached():
    calls = []
    with Master(diverging(), ORDER, H) as master, pytest.raises(ComponentError):
        master.run(1.0, (), [Probe(50, calls)])
    assert [call for _, call, _ in calls] == ["begin", *["observe"] * (len(calls) - 2), "end"]
    assert calls[-2][2] <= calls[-1][2] == master.index < calls[-2][2] + 50


def test_observers_already_begun_are_ended_if_another_cannot_begin():
    calls = []
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        with pytest.raises(
            InputError, match=r"cannot record 'a\.nothing'.*`gfor fmu info` lists them"
        ):
            master.run(H, (), [Probe(1, calls), Recorder(["a.nothing"], 1)])
        assert master.index == 0
    assert [call for _, call, _ in calls] == ["begin", "observe", "end"]


def test_the_recorder_keeps_the_order_of_its_names_and_its_interval():
    recorder = Recorder(["b.y", "a.y", "b.u"], 4)
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        master.run(10 * H, (), [recorder])
    a, b = recursion(lambda a, b: (a + H * 30 * b, b - H * 20 * a), (1.0, 0.5), 10).T
    assert recorder.times.tolist() == [0, 4 * H, 8 * H]
    # an input is what the last step was given
    expected = np.column_stack([b, a, np.append(a[0], a[:-1])])[::4]
    assert np.abs(recorder.values - expected).max() < TOLERANCE


# -- failure ---------------------------------------------------------------------------------------

BLOW_UP = np.pi / 2 / 50  # [s] of ẋ = x² + 50² from 0
ORDER = gauss_seidel((("k",), ("x",)))


def diverging():
    """A component that becomes infinite after about 31 ms, fed through another."""
    return system_of([("k.y", "x.u")], k=("gain", {"K": 50.0}, {"u": 50.0}), x=("blow_up",))


def test_a_failing_fmu_is_named_with_the_time_and_its_own_words():
    with Master(diverging(), ORDER, H) as master:
        with pytest.raises(ComponentError) as caught:
            master.run(1.0)
        error = caught.value
        assert (error.component, error.call, error.exit_code) == ("x", "fmi2DoStep", 1)
        assert error.time == master.time == master.index * H
    assert abs(error.time - BLOW_UP) < 2 * H
    text = str(error)
    assert text.startswith(f"component 'x' at t = {error.time:.6g} s: fmi2DoStep returned fmi2")
    assert "x: state x is no longer finite" in text
    assert "the solution diverges" in text


def test_what_was_recorded_before_a_failure_is_kept():
    recorder = Recorder(["x.y", "k.y"], 1)
    with Master(diverging(), ORDER, H) as master, pytest.raises(ComponentError) as caught:
        master.run(1.0, (), [recorder])
    assert recorder.times.tolist() == [k * H for k in range(master.index + 1)]
    assert recorder.times[-1] == caught.value.time
    early = recorder.times < 0.02
    exact = 50 * np.tan(50 * recorder.times[early])
    assert recorder.values[early, 0] == pytest.approx(exact, rel=1e-6)
    assert np.isfinite(recorder.values).all()


@pytest.fixture
def freed(monkeypatch):
    """Names of the instances that were freed."""
    names, free = [], FMU2Slave.freeInstance

    def note(fmu):
        names.append(fmu.instanceName)
        free(fmu)

    monkeypatch.setattr(FMU2Slave, "freeInstance", note)
    return names


def test_after_a_failure_every_fmu_is_freed_and_its_folder_gone(temporary, freed):
    with Master(diverging(), ORDER, H) as master:
        assert len(list(temporary.iterdir())) == 2
        with pytest.raises(ComponentError):
            master.run(1.0)
    assert list(temporary.iterdir()) == []
    assert sorted(freed) == ["k", "x"]
    master.close()  # again, without harm
    assert len(freed) == 2


def test_a_component_that_cannot_be_initialised_leaves_nothing_behind(temporary, freed):
    system = system_of([("k.y", "bad.u")], k=("gain", {}, {"u": 1.0}), bad=("lag", {"T": -1.0}))
    with pytest.raises(ComponentError) as caught:
        Master(system, jacobi(("k", "bad")), H)
    assert "component 'bad'" in str(caught.value)
    assert "T must exceed 0; raise it" in str(caught.value)
    assert list(temporary.iterdir()) == []
    assert sorted(freed) == ["bad", "k"]


def test_a_system_that_cannot_run_never_unpacks_an_fmu(temporary):
    with pytest.raises(InputError, match=r"x\.u"):
        Master(system_of(x=("integrator",)), jacobi(("x",)), H)
    assert list(temporary.iterdir()) == []


def test_instances_of_one_fmu_share_its_folder_and_nothing_else(temporary):
    system = system_of(
        a=("integrator", {"x_0": 1.0}, {"u": 1.0}), b=("integrator", {"x_0": 2.0}, {"u": -1.0})
    )
    with Master(system, jacobi(("a", "b")), H) as master:
        assert len(list(temporary.iterdir())) == 1
        master.run(5 * H)
        values = [master.components[name].get(["y"])["y"] for name in "ab"]
    assert values == pytest.approx([1 + 5 * H, 2 - 5 * H], abs=TOLERANCE)
    assert list(temporary.iterdir()) == []


# -- statistics ------------------------------------------------------------------------------------


def test_statistics_count_steps_and_share_out_the_time():
    with Master(oscillator(), gauss_seidel((("b",), ("a",))), H) as master:
        master.run(0.1)
        statistics = master.run(0.5)
    assert statistics.steps == 400
    assert [c.name for c in statistics.components] == ["b", "a"]
    assert [c.steps for c in statistics.components] == [400, 400]
    assert all(0 < c.share < 1 for c in statistics.components)
    assert 0 < sum(c.seconds for c in statistics.components) < statistics.seconds
    assert statistics.share_in_fmus == pytest.approx(
        sum(c.seconds for c in statistics.components) / statistics.seconds
    )
    assert 0 < statistics.share_in_fmus < 1
    assert statistics.steps_per_second == pytest.approx(400 / statistics.seconds)
    assert statistics.simulated == pytest.approx(0.4)
    assert statistics.real_time_factor == pytest.approx(0.4 / statistics.seconds)
    assert statistics.threads == 1


def test_a_run_of_no_steps():
    with Master(oscillator(), jacobi(("a", "b")), H) as master:
        statistics = master.run(0.0)
    assert (statistics.steps, statistics.steps_per_second) == (0, 0.0)
