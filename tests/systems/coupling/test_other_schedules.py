"""Schedules as other masters have them, against recursions computed by hand. x' = x + H·gain·u; g: y = K·u + offset."""

from itertools import pairwise

import numpy as np
import pytest

from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import Schedule
from tests.systems.coupling.test_master import H, inner_loop, oscillator, ring, system_of  # noqa: F401

STEPS = 20
SIDE_BY_SIDE, IN_TURN = (("a", "b"),), (("a",), ("b",))


def trajectory(system, schedule, names, *, after_exchange=False):
    recorder = Recorder(names, 1, after_exchange=after_exchange)
    with Master(system, schedule, H) as master:
        master.run(STEPS * H, observers=[recorder])
    return recorder.values


def oscillation(first_a, first_b, groups, steps=STEPS):
    """By hand: what feeds a and b in the first step, then the partner's output."""
    (a, b), rows = (1.0, 0.5), [(1.0, 0.5)]
    into_a, into_b = first_a, first_b
    for _ in range(steps):
        new_a = a + H * 30 * into_a
        new_b = b - H * 20 * (new_a if len(groups) == 2 else into_b)
        a, b = new_a, new_b
        into_a, into_b = b, a
        rows.append((a, b))
    return np.array(rows)


@pytest.mark.parametrize("groups", [SIDE_BY_SIDE, IN_TURN])
@pytest.mark.parametrize(
    ("first_inputs", "first"),
    [("consistent", (0.5, 1.0)), ("once", (0.5, 1.0)), ("zero", (0, 0)), ("start", (0, 0))],
)
def test_the_first_step_has_the_inputs_that_the_schedule_says(groups, first_inputs, first):
    found = trajectory(oscillator(), Schedule("other", groups, first_inputs), ["a.y", "b.y"])
    assert np.allclose(found, oscillation(*first, groups), rtol=0, atol=1e-14)


def feedthrough():
    """a: integrator of g's output, g = 0.5·a + 2: what g gives at the start depends on whether a was told it."""
    return system_of(
        ring("a", "g"),
        a=("integrator", {"gain": 10.0, "x_0": 1.0}),
        g=("gain", {"K": 0.5, "offset": 2.0}),
    )


@pytest.mark.parametrize(
    ("first_inputs", "into_a"), [("consistent", 2.5), ("once", 2.0), ("start", 0.0), ("zero", 0.0)]
)
def test_outputs_that_follow_inputs_directly_are_consistent_or_not(first_inputs, into_a):
    found = trajectory(feedthrough(), Schedule("other", (("a", "g"),), first_inputs), ["a.y"])
    assert found[1, 0] == pytest.approx(1 + H * 10 * into_a, abs=1e-14)


def test_start_values_that_differ_cannot_be_taken_from_one_output():
    system = system_of(
        [("s.y", "a.u"), ("s.y", "p.u")],
        s=("integrator", {}, {"u": 1.0}),
        a=("integrator", {}),
        p=("started_gain", {}),
    )
    with pytest.raises(
        InputError, match=r"s\.y feeds a\.u, which starts from 0, and p\.u, which starts from 0\.5"
    ):
        Master(system, Schedule("other", (("s", "a", "p"),), "start"), H)


@pytest.mark.parametrize("extrapolation", [0.5, 1.0])
def test_inputs_rise_on_as_they_rose_before(extrapolation):
    found = trajectory(
        oscillator(), Schedule("other", SIDE_BY_SIDE, extrapolation=extrapolation), ["a.y", "b.y"]
    )
    a, b, rows = np.array([1.0]), np.array([0.5]), [(1.0, 0.5)]
    for _ in range(STEPS):
        ahead_a, ahead_b = (
            v[-1] + extrapolation * (v[-1] - (v[-2] if len(v) > 1 else v[-1])) for v in (a, b)
        )
        a, b = np.append(a, a[-1] + H * 30 * ahead_b), np.append(b, b[-1] - H * 20 * ahead_a)
        rows.append((a[-1], b[-1]))
    assert np.allclose(found, rows, rtol=0, atol=1e-14)


def test_what_has_stepped_already_is_not_extrapolated():
    found = trajectory(oscillator(), Schedule("other", IN_TURN, extrapolation=1.0), ["a.y", "b.y"])
    a, b, before = 1.0, 0.5, 0.5
    for row in found[1:]:
        a += H * 30 * (b + (b - before))
        before, b = b, b - H * 20 * a
        assert row == pytest.approx((a, b), abs=1e-14)


def test_outputs_are_recorded_after_the_exchange_without_changing_the_run():
    schedule = Schedule("other", (("a", "g"),))
    before = trajectory(feedthrough(), schedule, ["a.y", "g.y"])
    after = trajectory(feedthrough(), schedule, ["a.y", "g.y"], after_exchange=True)
    assert np.array_equal(before[:, 0], after[:, 0])
    assert np.allclose(after[:, 1], 0.5 * after[:, 0] + 2, rtol=0, atol=1e-14)
    assert np.allclose(before[1:, 1], 0.5 * before[:-1, 0] + 2, rtol=0, atol=1e-14)


@pytest.mark.parametrize("observed", [False, True])
def test_wire_by_wire_an_output_is_read_after_the_inputs_before_it(observed):
    """a.y → g.u is served first, so g.y → a.u has the newest a already, and looking at it changes nothing."""
    schedule = Schedule("other", (("a", "g"),), "once", wire_by_wire=True)
    found = trajectory(feedthrough(), schedule, ["a.y"], after_exchange=observed)
    a = 1.0
    for (value,) in found[1:]:
        a += H * 10 * (0.5 * a + 2)
        assert value == pytest.approx(a, abs=1e-13)


def test_a_master_that_counts_ticks_tells_differences_of_times():
    """Of times k·H that are rounded, so that its steps are not quite equal: stepped here one by one, digit by digit."""
    found = trajectory(
        oscillator(), Schedule("other", SIDE_BY_SIDE, ticks_per_second=10**9), ["a.y", "b.y"]
    )
    times = [k * 10**6 / 1e9 for k in range(STEPS + 1)]
    with Master(oscillator(), Schedule("plain", SIDE_BY_SIDE), H) as master:
        for k, (time, end) in enumerate(pairwise(times)):
            master.exchange()
            for name, component in master.components.items():
                component.step(time, end - time)
                component.read(master.exchanges[name].outputs)
            assert master.y.tolist() == found[k + 1].tolist()
    assert len({end - time for time, end in pairwise(times)}) > 2


@pytest.mark.parametrize("others", [{"groups": IN_TURN}, {"extrapolation": 1.0}])
def test_wire_by_wire_goes_with_held_inputs_side_by_side_only(others):
    settings = {"groups": SIDE_BY_SIDE, "wire_by_wire": True} | others
    with pytest.raises(InputError, match="wire_by_wire needs a single group and no extrapolation"):
        Master(oscillator(), Schedule("other", **settings), H)
