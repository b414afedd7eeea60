"""A fault that is planted in the plant and not in its model is named, with its size, from the recording alone."""

from dataclasses import replace

import numpy as np
import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.cause_numbers import (
    Promise,
    numbers_by_factors,
    numbers_by_slope,
)
from orchestrator.studies.validation.causes import CauseKind, Explanation, without_worse_ways
from orchestrator.studies.validation.hidden import HiddenPart
from orchestrator.studies.validation.lagged import lag_alone
from orchestrator.studies.validation.parameters import Adjustable
from orchestrator.studies.validation.questions import QuestionKind
from orchestrator.studies.validation.words import explanation_sentence, sentence
from tests.benchmarks.validation_draws import TRUTH
from tests.studies.validation.recordings import phasor_plant, run, table, with_noise
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
ON = {"pod_p.enabled": True}
STEP = "500 us"
"""Of the device, so that less time goes."""

FINE = "200 us"
"""Where a limit, a lag or the noise decides what is found."""


def part(frame, end=3.0):
    """From half a second before the event on: what is before shows the noise alone."""
    return frame[frame.time.between(0.5, end)]


def explained(frame, device="gfor", **more):
    frame = frame.set_index("time")
    found = gfor_in_python.validate(device, frame, explain=True, **{"step": STEP} | more)
    return found.result.explanations


def test_a_wrong_inertia_is_named_with_the_plants():
    step = {"time": 0.5, "component": "grid", "type": "load_change", "load": "load_7", "scale": 1.1}
    case = gfor_in_python.load("k2a").with_(
        events=[step], solver={"record": ["*"], "record_interval": "5 ms"}
    )
    ran = case.scenario("no_pss", {"sg1.machine.H": 5.2}).run(stop=3.0).dataset
    frame = with_noise(table(ran, unit="sg1", bus="grid.bus_1"))
    best, second, *_ = explained(frame, "k2a", component="sg1", scenario="no_pss", step="1 ms")
    assert best.name == "machine.H"
    assert best.now == 6.5
    assert best.value == pytest.approx(5.2, rel=0.01)
    assert best.explains
    assert not second.explains


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_an_inertia_that_is_off_by_a_factor_is_named(factor):
    """It swings out of phase all the way, so that no slope leads there; nothing has to be held in step for it."""
    step = {"time": 0.5, "component": "grid", "type": "load_change", "load": "load_7", "scale": 1.1}
    case = gfor_in_python.load("k2a").with_(
        events=[step], solver={"record": ["*"], "record_interval": "5 ms"}
    )
    ran = case.scenario("no_pss", {"sg1.machine.H": 6.5 * factor}).run(stop=3.0).dataset
    frame = with_noise(table(ran, unit="sg1", bus="grid.bus_1"))
    given = {"component": "sg1", "scenario": "no_pss", "step": "1 ms", "explain": True}
    found = gfor_in_python.validate("k2a", frame.set_index("time"), **given).result
    best, *others = found.explanations
    assert not found.explained_in_step
    assert (best.name, best.value) == ("machine.H", pytest.approx(6.5 * factor, rel=0.01))
    assert best.explains
    assert not any(one.explains for one in others)


@pytest.mark.parametrize(("name", "plants"), [("pod_p.K", 50.0), ("droop.tau_P", 0.4)])
def test_a_number_that_is_off_by_four_is_named_alone(name, plants):
    plant = phasor_plant(**{"pod_p__K": 200.0, name.replace(".", "__"): plants})
    best, *others = explained(with_noise(plant), "gfor_phasor", values=ON, step="1 ms")
    assert (best.name, best.value) == (name, pytest.approx(plants, rel=0.01))
    assert not best.leaves_much
    assert not any(one.explains for one in others)


@pytest.mark.parametrize("also", [{"droop.R_f": 0.04}, {}])
def test_two_numbers_that_are_off_at_once_are_named_together_and_one_alone(also):
    values = ON | {"pod_p.K": 90.0} | also
    causes = explained(with_noise(phasor_plant()), "gfor_phasor", values=values, step="1 ms")
    best, *others = causes
    assert (best.name, best.value) == ("pod_p.K", pytest.approx(120, rel=0.01))
    assert best.beside == pytest.approx(dict.fromkeys(also, 0.05), rel=0.01)
    assert best.beside_now == also
    assert not best.leaves_much
    assert [one.name for one in others if one.cause is CauseKind.PAIR] == []
    said = explanation_sentence(causes)
    assert ("together with droop.R_f" in said) == bool(also)


@pytest.mark.parametrize("also", [{"droop.R_V": 0.045}, {"droop.R_f": 0.04}, {}])
def test_a_number_beside_a_switch_that_is_off_is_named_and_none_where_the_switch_is_all(also):
    """Phasors: the plant has POD-P on with a gain of 120."""
    causes = explained(with_noise(phasor_plant()), "gfor_phasor", values=also, step="1 ms")
    best, *others = causes
    assert (best.name, best.now, best.value) == ("pod_p.enabled", False, True)
    truth = {"pod_p.K": 120.0} | {name: TRUTH[name] for name in also}
    assert best.beside == pytest.approx(truth, rel=0.01)
    assert (best.cause is CauseKind.PAIR) == bool(also)
    assert not best.leaves_much
    assert not any(one.explains and one.beside != best.beside for one in others)
    assert best.share > 0.99
    said = explanation_sentence(causes)
    assert said.startswith("The likeliest cause")
    assert all(f"together with {name}" in said for name in also)
    assert ("pod_p.enabled by itself" in said) == bool(also)


class TwoValleys:
    """A bench whose error has a valley at the model's value and a deeper one at four times it."""

    def __init__(self):
        self.asked = []
        self.idle = []
        self.error = np.array([0.5, 1.0])

    def report(self, text):
        pass

    def announce(self, each):
        self.announced = list(each)

    def responses(self, values):
        self.asked.append(values["x"])
        return values["x"]

    def errors(self, x):
        near, far = abs(x - 1.0), abs(np.log(x / 4.0))
        return self.error + near if near < 0.3 else np.array([0.3, 0.5]) * far

    def explanation(self, cause, name, now, value, left, *, unit):
        return Explanation(cause, name, unit, now, value, 1.0, float(np.sqrt(left @ left)))


def test_doublings_lead_where_no_slope_does():
    bench = TwoValleys()
    number = Adjustable("x", "s", start=1.0, low=0.1, high=100.0)
    promise = Promise(number, [], np.array([1.0, 1.0]))
    (found,) = numbers_by_factors(bench, bench, [promise])
    assert found.value == pytest.approx(4.0, rel=0.01)
    assert bench.asked[:4] == [0.5, 2.0, 4.0, 8.0]
    low = replace(number, high=1.9, low=0.6)
    assert list(numbers_by_factors(bench, bench, [replace(promise, number=low)])) == []


class Valleys:
    """A bench whose error has one valley for each number; what is asked for at once is noted."""

    def __init__(self, best):
        self.best = best
        self.error = np.array(list(best.values())) - 1.0
        self.base, self.idle, self.announced = [], [], []

    def report(self, text):
        pass

    def announce(self, each):
        self.announced.append([name for values in each for name in values])

    def responses(self, values):
        return [np.array([values.get(name, 1.0) for name in self.best])]

    def errors(self, responses):
        moved = np.array(list(self.best.values())) - responses[0]
        return moved + 0.1 * moved**2

    def explanation(self, cause, name, now, value, left, *, unit):
        return Explanation(cause, name, unit, now, value, 1.0, float(np.sqrt(left @ left)))


def test_numbers_are_followed_side_by_side_each_to_its_own_best_value():
    best = {"x": 1.3, "y": 0.8, "z": 1.0}
    bench = Valleys(best)
    promises = [
        Promise(Adjustable(name, "s", start=1.0, low=0.1, high=16.0), [], -np.eye(3)[k])
        for k, name in enumerate(best)
    ]
    found = {one.name: one.value for one in numbers_by_slope(bench, bench, promises)}
    assert found == pytest.approx(best, abs=0.02)
    assert bench.announced[0] == ["x", "y"]  # z is where it leaves the least


def test_a_cause_that_leaves_clearly_more_than_the_first_explains_nothing():
    """0.0012 of 0.005 is 79 % of the squared error, and nothing beside a cause that leaves the scatter."""
    right = Explanation(CauseKind.VALUE, "droop.tau_P", "s", 0.1, 0.25, 0.005, 0.0004, noise=0.0003)
    wrong = replace(right, name="pod_p.T_S1", left=0.0022)
    assert wrong.explains
    alike = replace(right, name="droop.R_f", left=0.0005)
    first, second, third = without_worse_ways([right, alike, wrong])
    assert (first.explains, second.explains, third.explains) == (True, True, False)
    said = explanation_sentence([first, second, third])
    assert "hardly apart from droop.R_f" in said
    assert "T_S1" not in said
    assert without_worse_ways([right, replace(right, value=0.2, left=0.001)]) == [right]


def test_a_large_reactance_that_keeps_a_model_from_falling_is_no_cause_of_all():
    """The plant's axes are limited to 0.95 pu, the model's to 1.1: beside that, the model falls out of step.

    It does so within the 1.4 s after the step that are recorded."""
    limits = {f"gfor__voltage_control__i_{axis}_max": 0.95 for axis in "dq"}
    frame = with_noise(table(run("pod_p", stop=2.4, scale=1.12, **limits))).set_index("time")
    found = gfor_in_python.validate("gfor", frame, values=ON, step="500 us", explain=True).result
    best = found.explanations[0]
    assert found.explained_in_step
    assert best.name in {"voltage_control.i_d_max", "voltage_control.i_q_max"}
    assert best.value == pytest.approx(0.95, rel=0.03)


def test_a_wrong_droop_is_named_though_what_the_samples_do_not_hold_makes_most_of_the_error():
    """A record of 1 kHz does not hold how the voltage jumps; the converter rings with it, less than the 1.5 s here."""
    frame = with_noise(table(run("pod_p", stop=2.5, gfor__droop__R_f=0.048)))
    best, *_ = explained(part(frame), values=ON)
    assert (best.cause, best.name, best.now) == (CauseKind.VALUE, "droop.R_f", 0.05)
    assert best.value == pytest.approx(0.048, rel=0.01)
    assert best.share > 0.9


def test_what_the_voltage_between_samples_makes_is_taken_out_and_costs_what_is_unlikely():
    """Beside the formula: least squares with the unknown's size, in its likely size, as one more row."""
    ringing = np.exp(-np.arange(200) / 20) * np.cos(np.arange(200))
    other = np.sin(np.arange(200) / 50)
    part = HiddenPart.of([ringing], [0.1], scatter=0.01)
    *rest, cost = part.taken_out_of(1e-3 * ringing)
    assert np.abs(rest).max() < 1e-5
    assert abs(cost) == pytest.approx(1e-3 / 0.1 * 0.01, rel=0.01)
    left = part.taken_out_of(other)
    size = ringing @ other / (ringing @ ringing + 0.1**2)
    assert left @ left == pytest.approx(
        np.sum((other - size * ringing) ** 2) + (0.1 * size) ** 2, rel=1e-9
    )
    assert HiddenPart.of([], [], 0.01).taken_out_of(other) is other


def test_a_response_that_comes_30_ms_late_is_named_with_its_time():
    frame = with_noise(table(run("pod_p", stop=3.0)))
    late = {c: np.interp(frame.time - 0.03, frame.time, frame[c]) for c in ("p_mw", "q_mvar")}
    best, second, *_ = explained(part(frame.assign(**late), end=2.0), values=ON)
    assert (best.cause, best.name) == (CauseKind.DELAY, "delay of the whole response")
    assert best.value == pytest.approx(0.03, abs=0.002)
    assert best.explains
    assert not second.explains


def test_a_limit_of_the_current_that_the_model_lacks_is_named_with_its_level():
    limits = {"gfor__current_limit__kind": 1, "gfor__current_limit__I_max": 1.05}
    frame = with_noise(table(run("pod_p", stop=3.0, scale=1.12, **limits)))
    best, *_ = found = explained(part(frame), values=ON)
    assert (best.name, best.value) == ("current_limit.kind", 1)
    assert best.beside["current_limit.I_max"] == pytest.approx(1.05, rel=0.002)
    assert best.share > 0.99
    (limit,) = (one for one in found if one.cause is CauseKind.LIMIT)
    assert limit.value == pytest.approx(1.05, rel=0.01)


def test_a_limit_of_the_current_that_is_too_high_in_the_model_is_named_with_the_plants():
    """A plant at its limit falls out of step by a thousandth: the level that is read off the record is not enough.

    It is at its limit from the step on, of which 1.2 s are recorded."""
    limits = {"gfor__current_limit__kind": 1, "gfor__current_limit__I_max": 1.02}
    frame = with_noise(table(run("pod_p", stop=2.2, scale=1.12, **limits)))
    values = ON | {"current_limit.kind": 1, "current_limit.I_max": 1.2}
    best, *_ = explained(part(frame), values=values, step=FINE)
    assert (best.cause, best.name, best.now) == (CauseKind.VALUE, "current_limit.I_max", 1.2)
    assert best.value == pytest.approx(1.02, rel=0.001)
    assert best.share > 0.99


def test_no_cause_is_read_from_what_follows_a_setpoint_that_changed():
    """A right model, and a plant whose reference steps: a washout explained most of it, and was named."""
    frame = with_noise(phasor_plant(pod_p__K=200.0))
    moved = frame.assign(p_mw=frame.p_mw + 75 * (frame.time > 2.5)).set_index("time")
    found = gfor_in_python.validate("gfor_phasor", moved, values=ON, step="1 ms", explain=True)
    (question,) = [
        one for one in found.as_json()["events"][0]["questions"] if one["kind"] == "setpoint"
    ]
    assert 2.2 < question["figures"]["stop"] < 2.5
    assert all(one.error < 0.01 for one in found.result.explanations)  # 0.03 with what follows
    assert "pod_p.T_W" not in [one.name for one in found.result.explanations if one.explains]
    (said,) = (one for one in found.questions if "did a setpoint change?" in one)
    assert "No cause that was tried explains it" in said
    assert "--explain" not in said


@pytest.mark.slow
def test_a_setpoint_that_changes_within_the_event_is_no_gain():
    """A right model: a gain explained most of the step, and was named."""
    frame = with_noise(phasor_plant(pod_p__K=200.0)).iloc[::20]
    moved = frame.assign(p_mw=frame.p_mw + 68 * (frame.time > 1.05)).set_index("time")
    found = gfor_in_python.validate("gfor_phasor", moved, values=ON, step="1 ms", explain=True)
    (question,) = [
        one for one in found.as_json()["events"][0]["questions"] if one["kind"] == "setpoint"
    ]
    assert question["figures"]["offset"] == pytest.approx(68 / 1500, rel=0.02)
    assert question["figures"]["at"] == pytest.approx(1.05, abs=0.03)
    assert "No cause that was tried explains it" in question["text"]
    assert all(one.error < 0.01 for one in found.result.explanations)  # 0.04 with the step
    assert "pod_p.K" not in [one.name for one in found.result.explanations if one.explains]


@pytest.mark.slow
def test_a_pod_that_is_off_in_the_plant_is_named_as_a_switch_and_no_setpoint_is_asked_about():
    """From 50 samples a second a model with the POD on leaves for good, as if a setpoint had changed."""
    slow = with_noise(phasor_plant(pod_p__enabled=False)).iloc[::20]
    asked, found = (
        gfor_in_python.validate(
            "gfor_phasor", slow.set_index("time"), values=ON, step="1 ms", explain=explain
        )
        for explain in (False, True)
    )
    (said,) = (one for one in asked.questions if "did a setpoint change?" in one)
    assert "Type --explain" in said
    assert "parameter" not in said
    assert not any("setpoint" in one for one in found.questions)
    best = found.result.explanations[0]
    assert (best.name, best.value, best.beside) == ("pod_p.enabled", False, {})


def test_a_switch_leads_before_a_gain_of_nearly_nothing_that_leaves_as_little():
    gain = Explanation(CauseKind.VALUE, "pod_p.K", "pu", 200.0, 0.2, 0.03, 0.0007218, noise=5e-5)
    switch = replace(
        gain, cause=CauseKind.POSITION, name="pod_p.enabled", now=True, value=False, left=0.0007229
    )
    assert [one.name for one in without_worse_ways([gain, switch])] == [
        "pod_p.enabled",
        "pod_p.K",
    ]
    worse = replace(switch, left=0.0008)
    assert without_worse_ways([gain, worse])[0].name == "pod_p.K"
    other = replace(switch, beside={"pod_p.limit": 0.1})  # it has a freedom as well
    assert without_worse_ways([gain, other])[0].name == "pod_p.K"


def test_a_rest_above_the_scatter_is_told_with_what_looks_for_a_second_cause():
    """A gain of 140 and a droop of Q of 0.05: the first leaves 0.0009 pu, and the second is seen beside it alone."""
    gain = Explanation(CauseKind.VALUE, "pod_p.K", "pu", 200.0, 139.6, 0.02, 0.0009, noise=0.0002)
    said = explanation_sentence([gain])
    assert "0.0009 pu (rms) are left, 4 times the recording's own noise" in said
    assert said.endswith("A second cause is looked for with --set pod_p.K=139.6 --explain.")
    much = explanation_sentence([replace(gain, left=0.004)])
    assert "something else may be off" in much
    assert "No second number or switch beside it explains most of that" in much
    assert "--set pod_p.K=139.6 --explain" in much
    assert "No second" not in explanation_sentence([replace(gain, left=0.004)], finished=False)
    assert "second cause" not in explanation_sentence([replace(gain, left=0.0005)])
    late = replace(gain, cause=CauseKind.DELAY, name="delay of the whole response", value=0.03)
    assert "second cause" not in explanation_sentence([late])


def test_an_error_that_is_noise_has_no_cause_and_one_clearly_beyond_it_has():
    """Figures of a right model, whose filter was accused with 100 %, and of a wrong droop (0.0005 pu is little)."""
    noise = Explanation(
        CauseKind.VALUE, "filter.X_c", "pu", 0.15, 0.06383, 2.581e-4, 2.363e-4, noise=2.431e-4
    )
    assert noise.share > 0.99
    assert not noise.explains
    said = explanation_sentence([noise])
    assert said.startswith("There is nothing to explain")
    assert "X_c" not in said
    little = replace(noise, error=3.3e-4, left=2.35e-4, noise=2.1e-4)  # less than a third goes away
    assert little.share > 0.75
    assert not little.explains
    assert explanation_sentence([little]).startswith("There is nothing to explain")
    wrong = replace(noise, name="droop.R_f", error=5.2e-4, left=2.2e-4, noise=1.9e-4)
    assert wrong.explains
    assert explanation_sentence([wrong]).startswith("The likeliest cause is droop.R_f")


def test_no_cause_is_likely_beside_a_right_model():
    """With this noise a filter's reactance, a droop's time and a resistance explained 70 to 100 %."""
    frame = with_noise(table(run("pod_p", stop=4.0)), seed=11).set_index("time")
    found = gfor_in_python.validate("gfor", frame, values=ON, explain=True, step=FINE)
    causes = found.result.explanations
    assert causes[0].share > 0.9
    assert not any(one.explains for one in causes)
    assert "There is nothing to explain" in found.html()
    assert "X_c" not in found.html()


def test_a_cause_beside_another_is_not_said_to_be_all():
    """What one value leaves is counted in scatters of the recording; two ways to one value are one cause."""
    alone = Explanation(CauseKind.VALUE, "pod_p.K", "pu", 200.0, 120.0, 0.04, 0.0009, noise=0.0006)
    beside = replace(alone, value=110.0, left=0.0019)
    assert not alone.leaves_much
    assert beside.leaves_much
    assert "something else may be off" not in explanation_sentence([alone])
    assert "0.0019 pu (rms) are left, 3 times the recording's own noise" in explanation_sentence(
        [beside]
    )
    assert alone.same_as(replace(alone, left=0.001))
    assert alone.same_as(beside)
    assert not alone.same_as(replace(alone, name="pod_p.T_W"))


def behind_a_lag(frame, column, seconds=0.1):
    part = 1e-3 / seconds
    first = frame[column][0]
    return frame.assign(
        **{column: scipy_signal.lfilter([part], [1, part - 1], frame[column] - first) + first}
    )


def test_a_lag_that_leaves_noise_alone_is_the_cause_and_nothing_is_tried_beside_it():
    noisy = with_noise(behind_a_lag(table(run("pod_p", stop=4.0)), "p_mw"))
    found = gfor_in_python.validate(
        "gfor", noisy.set_index("time"), values=ON, explain=True, step=FINE
    ).result
    (lag,) = found.explanations
    assert (lag.cause, lag.name) == (CauseKind.LAG, "lag of P")
    assert lag.value == pytest.approx(0.1, rel=0.05)
    assert lag.values == {}
    said = explanation_sentence(found.explanations)
    assert said.startswith("The likeliest cause is P behind a lag of 1")
    (asked,) = [sentence(one) for one in found.comparisons[0].questions]
    assert asked.endswith(
        "export P without the filter, or, if another column holds it so, give --channel 'p=COLUMN'"
    )


def test_a_lag_beside_a_wrong_parameter_is_not_all():
    noisy = with_noise(behind_a_lag(table(run("pod_p", stop=4.0)), "p_mw"))
    off = ON | {"droop.R_V": 0.05}
    found = gfor_in_python.validate("gfor", noisy.set_index("time"), values=off, step=FINE).result
    assert [one.kind for one in found.comparisons[0].questions] == [QuestionKind.LAGGED]
    assert lag_alone(found.comparisons) is None
