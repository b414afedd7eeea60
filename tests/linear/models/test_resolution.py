"""Whether a communication step resolves the modes: refused, warned of or silent, and the advice helps."""

import re

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.linear.doubts.examination import Pair
from orchestrator.studies.modes.modes import compute_modes


def modes_at(step, case="two_area", scenario="gfor", frequency_range=(0.1, 2.0)):
    loaded = load_case(case)
    (prepared,) = loaded.prepare([scenario], {}, step)
    return compute_modes(prepared, frequency_range)


def advised(text):
    return float(re.search(r"take a step of (\S+) s", text)[1])


def test_an_emt_model_at_100_ms_is_refused_with_a_step_that_helps():
    """The step map has −30 % at 1.4 Hz, the system 10.6 % at 0.58 Hz."""
    with pytest.raises(
        InputError, match=r"does not resolve a mode.*0\.58\d* Hz with 10\.6 % damping"
    ) as caught:
        modes_at(0.1)
    step = advised(str(caught.value))
    assert step >= 1e-4
    result = modes_at(step)
    assert result.warnings == ()
    assert result.electromechanical.damping_percent == pytest.approx(10.59, abs=0.2)


@pytest.mark.parametrize(("case", "step"), [("two_area", 0.02), ("two_area_rms", 0.05)])
def test_a_step_that_hides_an_instability_is_refused(case, step):
    """The base case grows. At these steps its step map shows a mode with 17 % and with 2.9 % instead."""
    with pytest.raises(InputError, match=r"Hz with -(0\.91|1\.04) % damping"):
        modes_at(step, case, "base")


def test_a_step_that_moves_a_mode_is_warned_of_and_the_advice_helps():
    (text,) = modes_at(0.02, "two_area_rms", "pod_p").warnings
    assert "moves a mode" in text
    assert modes_at(advised(text), "two_area_rms", "pod_p").warnings == ()


def test_an_unstable_coupling_comes_with_a_step_at_which_it_is_stable():
    warnings = modes_at(2e-3).warnings
    assert "coupling is numerically unstable" in warnings[0]
    assert "Gauss-Seidel" not in " ".join(warnings)  # it has that schedule already
    assert modes_at(advised(warnings[1])).warnings == ()


@pytest.mark.parametrize("step", [5e-5, 1e-4, 2e-4, 5e-4])
@pytest.mark.parametrize("scenario", ["base", "pod_pq"])
def test_the_steps_of_the_readme_raise_no_question(step, scenario):
    assert modes_at(step, scenario=scenario).warnings == ()


@pytest.mark.parametrize("step", [5e-3, 1e-2])
@pytest.mark.parametrize("scenario", ["base", "gfor", "pod_p", "pod_q", "pod_pq"])
def test_phasor_models_at_milliseconds_raise_no_question(step, scenario):
    assert modes_at(step, "two_area_rms", scenario).warnings == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "scenario"), [("infinite_bus", "dip"), ("norm631", "without"), ("norm631", "with")]
)
def test_built_in_cases_at_their_own_step_raise_no_question(case, scenario):
    assert modes_at(None, case, scenario).warnings == ()


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["base", "pod_pq"])
def test_a_large_case_at_its_own_step_raises_no_question(scenario):
    assert modes_at(None, "ieee39", scenario).warnings == ()


def test_a_wide_range_is_no_reason_to_refuse_the_slow_modes():
    result = modes_at(2e-4, frequency_range=(0.1, 4000.0))
    assert result.electromechanical is not None


@pytest.mark.parametrize(
    ("seen", "exact", "lost"),
    [
        (-0.38 + 3.66j, -0.39 + 3.66j, False),
        (-0.01 + 3.66j, 0.01 + 3.66j, False),  # on the other side, but within what a step may move
        (-0.04 + 3.66j, 0.04 + 3.66j, True),
        (-0.38 + 3.2j, -0.38 + 3.66j, True),
    ],
)
def test_a_mode_is_lost_when_it_is_far_off_or_its_verdict_is_turned(seen, exact, lost):
    assert Pair(seen, exact).is_lost is lost
