"""Connections that delay, disturb or lose what they carry, against what can be computed by hand."""

import numpy as np
import pytest

from orchestrator.core.errors import ComponentError, InputError, NotFiniteError
from orchestrator.devices.fmi import isolated_component
from orchestrator.devices.sandbox.resource_limits import Limits
from orchestrator.systems.coupling import compiled_loop as loops
from orchestrator.systems.coupling import wire_bank
from orchestrator.systems.coupling.events import NotANumber, Silence, WireFault, WireRecovery
from orchestrator.systems.coupling.imperfections import Bias, Delay, DropOut, Noise, Quantisation
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import Schedule, gauss_seidel, jacobi
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu

H = 1e-3
STEPS = 400
IN_TURN = gauss_seidel((("ramp",), ("sink", "other")))


@pytest.fixture(params=["compiled", "python"], autouse=True)
def inner_loop(request, monkeypatch):
    """Every test runs with loop and connections in C, and with both in Python."""
    if request.param == "python":
        monkeypatch.setattr(loops, "loop_library", lambda: None)
        monkeypatch.setattr(wire_bank, "_library", lambda: None)
    elif loops.loop_library() is None or wire_bank._library() is None:
        pytest.skip("no compiler for this platform")
    return request.param


def ramp_into_two():
    """A ramp y = t that feeds two gains of 1, which show what arrives."""
    system = System()
    system.add("ramp", small_fmu("integrator"), {}, {"u": 1.0})
    system.add("sink", small_fmu("gain"))
    system.add("other", small_fmu("gain"))
    system.connect("ramp.y", "sink.u")
    system.connect("ramp.y", "other.u")
    return system


def fault(system, imperfection, begin, end=None, wire=0):
    """An event on one of the ramp's connections, and its end."""
    connection = system.connections[wire]
    system.foresee(connection, imperfection)
    target = connection.target.component
    events = [WireFault(begin, target, connection, imperfection)]
    return events if end is None else [*events, WireRecovery(end, target, connection, imperfection)]


def arrived(system, events=(), schedule=IN_TURN, steps=STEPS, parts=1):
    """What reached the gains in every step, shape (steps, 2)."""
    recorder = Recorder(["sink.y", "other.y"], 1)
    with Master(system, schedule, H) as master:
        rows = []
        for part in range(1, parts + 1):
            master.run(steps * part // parts * H, events if parts == 1 else (), [recorder])
            rows.append(recorder.values[1:].copy())
    return np.concatenate(rows)


def sent(steps=STEPS):
    """The ramp after each step."""
    return np.arange(1, steps + 1) * H


def close(a, b):
    return np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)


# -- delay -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [1, 7, 150])
def test_a_delay_of_so_many_steps_gives_the_value_of_so_many_steps_ago(steps):
    system = ramp_into_two()
    system.disturb(system.connections[0], Delay(steps * H))
    values = arrived(system)
    close(values[:, 0], np.maximum(sent() - steps * H, 0.0))
    close(values[:, 1], sent())


def test_a_delay_that_begins_repeats_the_past_and_one_that_ends_jumps():
    system = ramp_into_two()
    values = arrived(system, fault(system, Delay(50 * H), 100 * H, 200 * H))
    k = np.arange(STEPS)
    close(values[:, 0], np.where((k >= 100) & (k < 200), sent() - 50 * H, sent()))


def test_side_by_side_a_delay_adds_to_the_step_that_the_schedule_takes():
    system = ramp_into_two()
    system.disturb(system.connections[0], Delay(3 * H))
    values = arrived(system, schedule=jacobi(("ramp", "sink", "other")))
    close(values[:, 0], np.maximum(sent() - 4 * H, 0.0))
    close(values[:, 1], sent() - H)


def test_an_event_replaces_the_permanent_delay_until_it_ends():
    system = ramp_into_two()
    system.disturb(system.connections[0], Delay(20 * H))
    values = arrived(system, fault(system, Delay(90 * H), 100 * H, 200 * H))
    k = np.arange(STEPS)
    close(values[:, 0], np.maximum(sent() - np.where((k >= 100) & (k < 200), 90, 20) * H, 0.0))


def test_a_delay_that_is_no_whole_number_of_steps_is_refused_with_the_nearest():
    system = ramp_into_two()
    system.disturb(system.connections[0], Delay(2.4 * H))
    with pytest.raises(
        InputError,
        match=r"ramp.y -> sink.u: a delay of 0.0024 s is no multiple .* nearest is 0.002 s",
    ):
        Master(system, IN_TURN, H)


# -- bias, quantisation, loss ----------------------------------------------------------------------


def test_a_bias_is_added_while_it_lasts():
    system = ramp_into_two()
    system.disturb(system.connections[1], Bias(-2.0))
    values = arrived(system, fault(system, Bias(0.5), 100 * H, 200 * H))
    k = np.arange(STEPS)
    close(values[:, 0], sent() + np.where((k >= 100) & (k < 200), 0.5, 0.0))
    close(values[:, 1], sent() - 2.0)


def test_a_frozen_value_is_the_last_that_arrived():
    system = ramp_into_two()
    values = arrived(system, fault(system, DropOut(), 100 * H, 200 * H))
    k = np.arange(STEPS)
    close(values[:, 0], np.where((k >= 100) & (k < 200), 100 * H, sent()))


def test_what_is_frozen_from_the_beginning_keeps_its_initial_value():
    system = ramp_into_two()
    system.components["ramp"].parameters["x_0"] = 3.0
    system.disturb(system.connections[0], DropOut())
    close(arrived(system)[:, 0], 3.0)


@pytest.mark.parametrize("substitute", [0.0, -4.5])
def test_a_lost_value_is_replaced(substitute):
    system = ramp_into_two()
    values = arrived(system, fault(system, DropOut(substitute), 100 * H, 200 * H))
    k = np.arange(STEPS)
    close(values[:, 0], np.where((k >= 100) & (k < 200), substitute, sent()))


def test_a_quantised_value_is_the_nearest_multiple():
    system = ramp_into_two()
    system.disturb(system.connections[0], Quantisation(0.25))
    values = arrived(system)
    assert np.array_equal(values[:, 0], 0.25 * np.rint(values[:, 1] / 0.25))
    assert set(np.unique(values[:, 0])) == {0.0, 0.25, 0.5}


@pytest.mark.parametrize(
    ("value", "carried"), [(0.125, 0.0), (0.375, 0.5), (-0.125, 0.0), (-0.375, -0.5)]
)
def test_a_half_goes_to_the_even_multiple(value, carried):
    system = ramp_into_two()
    system.components["ramp"].inputs["u"], system.components["ramp"].parameters["x_0"] = 0.0, value
    system.disturb(system.connections[0], Quantisation(0.25))
    assert np.all(arrived(system, steps=3)[:, 0] == carried)


def test_all_at_once_follow_the_sensor_then_the_way_then_the_loss():
    system = ramp_into_two()
    for imperfection in (Delay(10 * H), Bias(0.1), Quantisation(0.05)):
        system.disturb(system.connections[0], imperfection)
    values = arrived(system, fault(system, DropOut(7.0), 300 * H))
    measured = 0.05 * np.rint((values[:, 1] + 0.1) / 0.05)
    late = np.concatenate([np.full(10, 0.1), measured[:-10]])
    close(values[:, 0], np.where(np.arange(STEPS) < 300, late, 7.0))


# -- noise -----------------------------------------------------------------------------------------


def noise_of(noise, steps=20_000, others=(), **options):
    system = ramp_into_two()
    system.components["ramp"].inputs["u"] = 0.0
    system.disturb(system.connections[0], noise)
    for other in others:
        system.disturb(system.connections[1], other)
    return arrived(system, steps=steps, **options)[:, 0]


IN_C = pytest.mark.parametrize("inner_loop", ["compiled"], indirect=True)
"""Of many values: a test below holds those of Python to the same bits."""


@IN_C
def test_noise_has_its_deviation_and_no_memory():
    values = noise_of(Noise(0.3, 1), 20_000)
    n = len(values)
    assert abs(values.mean()) < 4 * 0.3 / np.sqrt(n)
    assert abs(values.std() / 0.3 - 1) < 4 / np.sqrt(2 * n)
    assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 4 / np.sqrt(n)


@IN_C
def test_noise_with_a_bandwidth_has_the_same_deviation_and_the_low_pass_memory():
    values = noise_of(Noise(0.3, 1, bandwidth=20.0), 60_000)
    keep = np.exp(-2 * np.pi * 20.0 * H)
    effective = len(values) * (1 - keep) / (1 + keep)
    assert abs(values.std() / 0.3 - 1) < 4 / np.sqrt(2 * effective)
    assert abs(np.corrcoef(values[1:], values[:-1])[0, 1] - keep) < 4 / np.sqrt(effective)


def test_noise_is_the_same_to_the_last_bit_whatever_else_there_is():
    alone = noise_of(Noise(0.3, 1, 50.0), 1000)
    assert np.array_equal(
        alone, noise_of(Noise(0.3, 1, 50.0), 1000, others=[Noise(1.0, 1), Delay(5 * H)])
    )
    assert np.array_equal(alone, noise_of(Noise(0.3, 1, 50.0), 1000, parts=7))
    assert not np.array_equal(alone, noise_of(Noise(0.3, 2, 50.0), 1000))


def test_two_connections_with_one_seed_have_different_noise():
    system = ramp_into_two()
    for connection in system.connections:
        system.disturb(connection, Noise(1.0, 5))
    values = arrived(system, steps=3000)
    assert abs(np.corrcoef((values - sent(3000)[:, None]).T)[0, 1]) < 4 / np.sqrt(3000)


def test_c_and_python_give_the_same_bits(monkeypatch):
    def everything():
        system = ramp_into_two()
        for imperfection in (Delay(13 * H), Bias(0.1), Quantisation(1e-3), Noise(0.3, 1, 50.0)):
            system.disturb(system.connections[0], imperfection)
        return arrived(system, fault(system, DropOut(), 300 * H, 350 * H))

    one = everything()
    monkeypatch.setattr(wire_bank, "_library", lambda: None)
    assert np.array_equal(one, everything())


# -- state -----------------------------------------------------------------------------------------


def test_a_run_from_a_saved_state_is_the_same_run_to_the_last_bit():
    system = ramp_into_two()
    for imperfection in (Delay(13 * H), Noise(0.3, 1, 50.0)):
        system.disturb(system.connections[0], imperfection)
    with Master(system, IN_TURN, H) as master:
        master.run(0.123)
        ramp, wires, index = (
            master.components["ramp"].get(["y"])["y"],
            master.wires.state(),
            master.index,
        )
        master.run(0.3)
        expected = master.arriving("sink").copy()
    with Master(system, IN_TURN, H) as master:
        master.components["ramp"].set({"x": ramp})
        master.exchanges["ramp"].outputs.read()
        master.wires.restore(wires)
        master.index = index
        master.run(0.3)
        assert np.array_equal(master.arriving("sink"), expected)


# -- the undisturbed run, and what is refused ------------------------------------------------------


def test_until_a_fault_begins_the_run_is_the_undisturbed_one_to_the_last_bit():
    undisturbed = arrived(ramp_into_two())
    system = ramp_into_two()
    values = arrived(system, fault(system, Bias(1.0), 300 * H))
    assert np.array_equal(values[:300], undisturbed[:300])
    assert not np.array_equal(values[300:], undisturbed[300:])


def test_a_system_without_imperfections_has_no_bank_in_its_loop():
    with Master(ramp_into_two(), IN_TURN, H) as master:
        assert not master.wires
        assert [len(group) for group in master._turns()] == [1, 2]


@pytest.mark.parametrize(
    "schedule",
    [
        Schedule("side by side", (("ramp", "sink", "other"),), extrapolation=1.0),
        Schedule("wires", (("ramp", "sink", "other"),), wire_by_wire=True),
    ],
)
def test_a_schedule_of_another_master_refuses_by_the_connections_name(schedule):
    system = ramp_into_two()
    system.disturb(system.connections[0], Bias(1.0))
    with pytest.raises(InputError, match=r"ramp.y -> sink.u.*leave the imperfections out"):
        Master(system, schedule, H)


def test_a_fault_that_was_not_announced_is_refused():
    system = ramp_into_two()
    connection = system.connections[0]
    events = [WireFault(0.1, "sink", connection, Bias(1.0))]
    with Master(system, IN_TURN, H) as master, pytest.raises(InputError, match=r"System\.foresee"):
        master.run(0.2, events)


def test_the_same_kind_twice_is_refused():
    system = ramp_into_two()
    system.disturb(system.connections[0], Bias(1.0))
    with pytest.raises(InputError, match="has bias 1 already, and gets bias 2; remove one"):
        system.disturb(system.connections[0], Bias(2.0))


# -- faults of components --------------------------------------------------------------------------


def test_a_component_that_gives_no_numbers_ends_the_run_at_that_time():
    recorder = Recorder(["sink.y"], 1)
    with (
        Master(ramp_into_two(), IN_TURN, H) as master,
        pytest.raises(NotFiniteError, match=r"'ramp' at t = 0.1 s.*y"),
    ):
        master.run(0.4, [NotANumber(0.1, "ramp")], [recorder])
    assert len(recorder.times) == 101


def test_a_component_that_answers_no_more_is_ended_by_the_isolations_limit(monkeypatch):
    monkeypatch.setattr(isolated_component, "Limits", lambda: Limits(seconds=1.0))
    system = ramp_into_two()
    system.components["ramp"].isolated = True
    recorder = Recorder(["sink.y"], 1)
    with (
        Master(system, IN_TURN, H) as master,
        pytest.raises(ComponentError, match=r"'ramp' at t = 0.1 s.*no answer within 1 s"),
    ):
        master.run(0.4, [Silence(0.1, "ramp")], [recorder])
    assert len(recorder.times) == 101


def test_a_component_without_a_process_of_its_own_cannot_fall_silent():
    with (
        Master(ramp_into_two(), IN_TURN, H) as master,
        pytest.raises(InputError, match="isolated = true"),
    ):
        master.run(0.4, [Silence(0.1, "ramp")])
