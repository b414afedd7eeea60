"""Limits of two axes: both are named where both are off, and neither is judged where the plant does not reach it."""

from dataclasses import replace
from functools import cache

import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.cause_bench import CauseBench
from orchestrator.studies.validation.cause_pairs import pair_of_limits
from orchestrator.studies.validation.causes import CauseKind, Explanation
from orchestrator.studies.validation.unreached import unreached_limits
from orchestrator.studies.validation.words import explanation_sentence
from tests.studies.validation.recordings import SOLVER, table, with_noise

ON = {"pod_p.enabled": True}
Q, D = "voltage_control.i_q_max", "voltage_control.i_d_max"
FAULT = {
    "time": 1.0,
    "component": "grid",
    "type": "bus_fault",
    "bus": "bus_2",
    "X": 0.1,
    "duration": 0.1,
}


@cache
def bench_of(**limits):
    """A model with limits of 1.1 pu beside a plant with others, in a fault at which it reaches both."""
    case = gfor_in_python.load("two_area").with_(events=[FAULT], solver=SOLVER)
    values = {f"gfor.voltage_control.{name}": value for name, value in limits.items()}
    frame = with_noise(table(case.scenario("pod_p", values).run(stop=1.6).dataset))
    found = gfor_in_python.validate("gfor", frame.set_index("time"), values=ON, step="500 us")
    device, (one,) = found.result.request.device, found.result.comparisons
    return CauseBench(device, [one.event], lambda text: None)


def first_of(bench, value):
    """The limit of the active current by itself, at its best value in these steps."""
    left = bench.errors(bench.responses({Q: value}))
    return bench.explanation(CauseKind.VALUE, Q, 1.1, value, left, unit="pu")


def test_limits_of_two_axes_are_named_together_each_at_its_own_level():
    """The second one moves nothing where the model has it, so that no slope leads to it."""
    bench = bench_of(i_q_max=1.0, i_d_max=0.6)
    first = first_of(bench, 0.9906)
    (both,) = pair_of_limits(bench, bench, first)
    assert both.value == pytest.approx(1.0, rel=0.003)
    assert both.beside == pytest.approx({D: 0.6}, rel=0.01)
    assert both.beside_now == {D: 1.1}
    assert both.left < 0.3 * first.left
    said = explanation_sentence([both, first])
    assert f"together with {D} = {both.beside[D]:.4g} (now 1.1)" in said


def test_a_limit_that_explains_by_itself_is_named_without_another():
    bench = bench_of(i_q_max=1.0)
    assert list(pair_of_limits(bench, bench, first_of(bench, 0.9982))) == []


def test_a_limit_that_is_not_reached_is_said_to_be_untold_and_one_that_acts_is_not():
    bench = bench_of(i_q_max=1.0)
    first = first_of(bench, 1.0)

    def unreached(**values):
        device = bench.device.with_values(values)
        return unreached_limits(device, bench.events, first, bench.report)

    assert unreached() == (D,)
    assert unreached(**{D: 0.6}) == ()  # likely no limit, below the plant's current
    assert unreached(**{Q: 2.0, D: 0.95}) == (D,)
    gain = replace(first, name="pod_p.K", value=100.0)
    assert unreached_limits(bench.device, bench.events, gain, bench.report) == ()
    said = explanation_sentence([first], unreached=(D,))
    assert f"does not come near {D}: the recording does not tell whether that is right" in said


def test_a_number_that_is_no_limit_has_no_limit_beside_it():
    """Nor has one beside which another one stands already."""
    gain = Explanation(CauseKind.VALUE, "pod_p.K", "pu", 200.0, 100.0, 0.02, 0.01)
    bench = bench_of(i_q_max=1.0)
    assert list(pair_of_limits(bench, bench, gain)) == []
    assert list(pair_of_limits(bench, bench, replace(gain, name=Q, beside={D: 1.0}))) == []
