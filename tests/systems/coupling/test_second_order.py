"""Schedules in which inputs follow straight lines, against recursions computed by hand and exact solutions."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from orchestrator.core.errors import CouplingError, InputError
from orchestrator.face.api.case import load
from orchestrator.studies.modes.modes import running
from orchestrator.studies.runs.checkpoints import not_kept
from orchestrator.systems.coupling import compiled_loop as loops
from orchestrator.systems.coupling.events import ParameterChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.run import state_of, take_up
from orchestrator.systems.coupling.schedule import Schedule, gauss_seidel, jacobi, midpoint, newton
from orchestrator.systems.coupling.system import System
from tests.systems.coupling.small_fmus import small_fmu
from tests.systems.coupling.test_master import (  # noqa: F401
    H,
    inner_loop,
    oscillator,
    ring,
    system_of,
    trajectory,
)

IN_TURN = (("a",), ("b",))
BOTH = pytest.mark.parametrize("schedule", [midpoint, newton])


@pytest.mark.parametrize("micro_step", [None, 3e-4])
def test_midpoint_extrapolates_what_has_not_stepped_and_averages_what_has(micro_step):
    found = trajectory(oscillator(), midpoint(IN_TURN, micro_step), ["a.y", "b.y"], 50)
    a, b, before = 1.0, 0.5, 0.5
    for row in found[1:]:
        new_a = a + H * 30 * (b + (b - before) / 2)
        new_b = b - H * 20 * (a + new_a) / 2
        a, b, before = new_a, new_b, b
        assert row == pytest.approx((a, b), abs=1e-13)


@pytest.mark.parametrize("micro_step", [None, 3e-4])
def test_newton_gives_the_trapezoidal_rule(micro_step):
    found = trajectory(oscillator(), newton(IN_TURN, micro_step), ["a.y", "b.y"], 50)
    half = H / 2 * np.array([[0.0, 30.0], [-20.0, 0.0]])
    step = np.linalg.solve(np.eye(2) - half, np.eye(2) + half)
    x = np.array([1.0, 0.5])
    for row in found[1:]:
        x = step @ x
        assert row == pytest.approx(x, abs=1e-9)


def test_the_loop_in_c_is_the_loop_in_python_to_the_last_bit(monkeypatch, inner_loop):  # noqa: F811
    """Two areas at 500 µs in five parts, after a load step."""
    if inner_loop == "python":
        return  # compared in the other turn
    ready = load("two_area").scenario("pod_pq", step=5e-4, schedule="midpoint").prepared
    ends = []
    for library in (loops.loop_library, lambda: None):
        monkeypatch.setattr(loops, "loop_library", library)
        with running(ready) as master:
            master.run(0.1, [replace(ready.events[0], time=0.05)])
            ends.append((master.y.copy(), master.before.copy(), master.tracks.saved()))
    assert all(np.array_equal(a, b) for a, b in zip(*ends, strict=True))


def test_a_run_that_is_taken_up_goes_on_to_the_last_bit():
    """From between the load step and the end: lines that are extrapolated need the outputs before."""
    ready = load("two_area").scenario("gfor", step=5e-4, schedule="midpoint").prepared
    event = replace(ready.events[0], time=0.02)
    with running(ready) as master:
        master.run(0.03, [event])
        kept = state_of(master, [], None, False, 0.0, np.zeros(4))
        master.run(0.05, [event])
        whole = master.y.copy()
    with running(ready) as master:
        take_up(master, kept)
        master.run(0.05, [event])
        assert np.array_equal(master.y, whole)
    assert not not_kept(ready)
    assert "derivatives" in not_kept(ready.rescheduled("newton"))["gfor"]


def response(schedule: Schedule, step_size: float) -> np.ndarray:
    """x_a and x_b at t = 0.12 s; at 0.06 s the gain of ``a`` changes."""
    recorder = Recorder(["a.y", "b.y"], 1)
    with Master(oscillator(), schedule, step_size) as master:
        master.run(0.12, [ParameterChange(0.06, "a", "gain", 45.0)], [recorder])
    return recorder.values[-1]


@pytest.mark.parametrize(
    ("schedule", "ratio"),
    [
        (midpoint(IN_TURN), 4),
        (newton(IN_TURN), 4),
        (gauss_seidel(IN_TURN), 2),
        (jacobi(("a", "b")), 2),
    ],
    ids=["midpoint", "newton", "gauss-seidel", "jacobi"],
)
def test_the_error_falls_with_the_square_of_the_step_over_an_event(schedule, ratio):
    exact = np.array([1.0, 0.5])
    for gain in (30.0, 45.0):
        exact = scipy.linalg.expm(0.06 * np.array([[0.0, gain], [-20.0, 0.0]])) @ exact
    errors = [np.abs(response(schedule, h) - exact).max() for h in (2e-3, 1e-3)]
    assert errors[0] / errors[1] == pytest.approx(ratio, rel=0.1)


@BOTH
def test_outputs_that_follow_inputs_directly_agree_after_each_step(schedule):
    system = system_of(
        ring("a", "g"),
        a=("integrator", {"gain": 10.0, "x_0": 1.0}),
        g=("gain", {"K": 0.5, "offset": 2.0}),
    )
    found = trajectory(system, schedule((("g",), ("a",))), ["a.y", "g.y"], 20)
    assert np.allclose(found[:, 1], 0.5 * found[:, 0] + 2, rtol=0, atol=1e-9)


def two_gains() -> System:
    return system_of(ring("a", "b"), a=("gain", {"K": 0.9}), b=("gain", {"K": 1.0, "offset": 1.0}))


def test_midpoint_refuses_a_loop_of_direct_feedthrough_that_newton_solves():
    with (
        Master(two_gains(), midpoint(IN_TURN), H) as master,
        pytest.raises(
            CouplingError,
            match=r"feed-through closes a loop through some of a, b: .* take gauss-seidel",
        ),
    ):
        master.run(H)
    assert trajectory(two_gains(), newton(IN_TURN), ["b.y"], 3)[-1, 0] == pytest.approx(
        10, abs=1e-8
    )


def test_newton_refuses_an_fmu_that_cannot_be_taken_back():
    system = System()
    for name, model in (("a", "integrator"), ("b", "integrator")):
        system.add(name, replace(small_fmu(model), can_save_state=name != "b"))
    for source, target in ring("a", "b"):
        system.connect(source, target)
    with pytest.raises(
        InputError, match="component 'b' declares no canGetAndSetFMUstate; take midpoint"
    ):
        Master(system, newton(IN_TURN), H)


def test_newton_is_stable_in_a_loop_in_which_held_inputs_are_not():
    """ω = √600 rad/s: at H = 0.1 s Gauss-Seidel and midpoint grow, the trapezoidal rule does not."""
    ends = {}
    for schedule in (gauss_seidel(IN_TURN), midpoint(IN_TURN), newton(IN_TURN)):
        ends[schedule.name] = np.abs(
            trajectory(oscillator(), schedule, ["a.y"], 60, step_size=0.1)[-1, 0]
        )
    assert ends["gauss-seidel"] > 1e3
    assert ends["midpoint"] > 1e3
    assert ends["newton"] < 2


@BOTH
def test_a_second_order_schedule_takes_nothing_beside_it(schedule):
    with pytest.raises(InputError, match="needs consistent first inputs, and no extrapolation"):
        replace(schedule(IN_TURN), extrapolation=0.5).check({"a", "b"})
