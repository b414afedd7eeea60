"""An event shortly before the end: what still decays is no fault, what grows is one, and the rest is not judged."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.simulation.watch.watch import judge_run
from orchestrator.studies.runs.files import summary_of
from orchestrator.studies.runs.run import run_scenario
from orchestrator.systems.coupling.events import ParameterChange
from tests.simulation.watch.seen import seen_of, system
from tests.support.scenarios import prepare_one

STOP = 15.0


def after(late, course):
    """Rest, and from an event on ``course`` of the time since then."""
    return lambda t: 0.9 + (t > late) * course(np.maximum(t - late, 0.0))


def found(late, course, stop=STOP):
    event = ParameterChange(late, "a", "offset", 1.0)
    return judge_run(seen_of({"a.y": after(late, course)}, stop), system("a"), [event])


def many(rate):
    """Five frequencies that have nothing to do with each other, as the network's own ones."""
    hertz = (23.1, 37.7, 50.0, 68.9, 81.3)
    return lambda t: 0.01 * np.exp(rate * t) * sum(np.sin(2 * np.pi * f * t + f) for f in hertz)


@pytest.mark.parametrize("before", [0.5, 1.0, 1.75])
def test_a_transient_that_still_decays_is_no_fault(before):
    (finding,) = found(STOP - before, many(-0.3 / before))
    assert (finding.kind, finding.time, finding.until) == ("not_judged", STOP - before, None)
    assert f"let the run go on to t = {STOP - before + 2.0:.4g} s" in finding.message


def test_what_goes_on_for_long_enough_is_one():
    kinds = [f.kind for f in found(STOP - 2.5, many(-0.3 / 2.5))]
    assert kinds == ["sustained_oscillation"]


@pytest.mark.parametrize(
    "course", [many(6.0), lambda t: 1e-3 * np.exp(3.0 * t) * np.sin(2 * np.pi * 9.0 * t)]
)
def test_growth_in_a_short_stretch_is_told(course):
    (finding,) = found(STOP - 1.0, course)
    assert (finding.kind, finding.time) == ("growing_oscillation", STOP - 1.0)


def test_a_single_frequency_that_may_decay_slowly_is_not_judged():
    (finding,) = found(STOP - 1.0, lambda t: 0.01 * np.exp(-0.03 * t) * np.sin(2 * np.pi * 9.0 * t))
    assert finding.kind == "not_judged"


def test_an_event_with_too_few_looks_after_it_is_not_judged():
    (finding,) = found(STOP - 0.2, lambda t: 0.01 * np.exp(-t))
    assert finding.kind == "not_judged"
    assert f"between t = {STOP - 0.2:.4g} s and the end at t = {STOP:.4g} s" in finding.message


def test_what_comes_to_rest_in_a_short_time_is_judged():
    assert found(STOP - 1.0, lambda t: 0.01 * np.exp(-20 * t) * np.sin(2 * np.pi * 9.0 * t)) == []


def test_a_trip_half_a_second_before_the_end(tmp_path):
    """The generator's torque still swings with the network's offset current."""
    case = load_case("two_area")
    trip = '[[events]]\ntype = "component_trip"\ncomponent = "gfor"\ntime = "1 s"\n\n[scenarios.'
    text = case.path.read_text(encoding="utf-8").replace("[scenarios.", trip, 1)
    file = tmp_path / "case.toml"
    file.write_text(
        text.replace('time = "1 s"\ncomponent = "grid"', 'time = "0.1 s"\ncomponent = "grid"'),
        "utf-8",
    )
    ready = prepare_one(file, "gfor", stop_time=1.5)
    result = run_scenario(ready)
    assert [f.kind for f in result.findings] == ["not_judged"]
    assert not result.went_unstable
    assert summary_of(result)["stable_in_simulation"] is None


# -- growth that shows no two periods ------------------------------------------------------------------


def grows(rate, angular):
    return lambda t: 0.05 * np.expm1(rate * t) * np.cos(angular * t)


@pytest.mark.parametrize(
    ("rate", "angular", "lasts"), [(5.0, 1.0, 2.5), (1.5, 3.0, 3.0), (1.0, 0.0, 4.0)]
)
def test_growth_of_less_than_two_periods_is_not_judged_and_not_healthy(rate, angular, lasts):
    (finding,) = found(STOP - lasts, grows(rate, angular))
    assert (finding.kind, finding.component, finding.variable, finding.until) == (
        "not_judged",
        "a",
        "y",
        None,
    )
    assert "a.y moves more than before" in finding.message


def test_growth_that_an_event_ends_is_not_healthy():
    events = [ParameterChange(t, "a", "offset", t) for t in (8.0, 9.8)]
    y = lambda t: 0.9 + np.where(t > 9.8, 0.0, (t > 8) * grows(5.0, 6.0)(np.maximum(t - 8, 0)))  # noqa: E731
    (finding,) = judge_run(seen_of({"a.y": y}, STOP), system("a"), events)
    assert (finding.kind, finding.time, finding.until) == ("not_judged", 8.0, 9.8)


@pytest.mark.parametrize(
    "course",
    [
        lambda t: 0.05 * np.exp(-0.3 * t) * np.cos(3.6 * t),
        lambda t: 0.05 * -np.expm1(-t / 7),
        lambda t: 0.01 * t,
        lambda t: 0.05 * -np.expm1(-t / 1.0) * np.exp(-t / 9),
    ],
)
@pytest.mark.parametrize("lasts", [3.0, 5.0, 10.0])
def test_what_settles_or_runs_steadily_departs_from_nothing(course, lasts):
    assert found(STOP - lasts, course) == []
