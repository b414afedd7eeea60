"""Parameters that made a recording are found again, and what it cannot tell is named."""

import json
import warnings
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import orchestrator as gfor_in_python
from orchestrator.core.errors import INTERRUPTED
from orchestrator.studies.validation import fit
from orchestrator.studies.validation.hidden import HiddenVoltage
from orchestrator.studies.validation.parameters import Adjustable, Wanted
from orchestrator.studies.validation.view import Validation, parts
from tests.benchmarks.validation_draws import TRUTH, starts_of
from tests.studies.validation.recordings import (
    of_pmu,
    phasor_plant,
    table,
    with_noise,
    written,
)

ON = {"pod_p.enabled": True}
MODEL, STEP = "gfor_phasor", "1 ms"
"""Of fits, each of which drives it 10 to 100 times: of phasors, where nothing is fitted that these do not have."""

EMT_STEP = "500 us"


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return written(with_noise(phasor_plant()), tmp_path_factory.mktemp("fit"))


def test_a_gain_is_found_within_its_interval(gfor, recording):
    options = ("--set", "pod_p.enabled=true", "--fit", "pod_p.K", "--step", STEP, "--json")
    code, out, _ = gfor("validate", MODEL, str(recording), *options)
    assert code == 0
    (found,) = json.loads(out)["fit"]
    assert found["parameter"] == "pod_p.K"
    assert found["identifiable"]
    assert found["holds"]
    assert found["low"] < 120 < found["high"]
    assert found["value"] == pytest.approx(120, rel=0.05)
    assert found["high"] - found["low"] < 30


def test_intervals_beside_an_error_that_stays_do_not_hold(recording, monkeypatch):
    """Its droop is wrong, which the fit of a gain cannot mend; other starts find no more."""
    monkeypatch.setattr(fit, "_starts", lambda residuals, told, switches: iter([told]))
    given = {"values": ON | {"droop.R_f": 0.09}, "fit": "pod_p.K", "step": STEP}
    found = gfor_in_python.validate(MODEL, recording, **given)
    assert not found.result.fit.reached
    assert not found.as_json()["fit"][0]["holds"]
    assert "95 %, does not hold" in found.html()


@pytest.mark.slow
def test_what_did_not_run_is_counted_where_something_is_asked_or_searched(recording):
    """A right model of which nothing is asked: another reading that did not run is in JSON alone."""
    found = gfor_in_python.validate(MODEL, recording, values=ON | {"pod_p.K": 120.0})
    result = found.result
    result.request.device.trials.note(
        "P and Q of one phase", gfor_in_python.CosimError("too large")
    )
    counted = "1 trial of other readings or values did not run: P and Q of one phase (too large)."
    assert not any(counted in str(one) for one in parts(found))
    assert len(found.as_json()["refused"]) == 1
    searched = Validation(replace(result, request=replace(result.request, explain=True)))
    assert any(counted in str(one) for one in parts(searched))


def test_a_switched_off_controller_is_seen_and_its_gain_with_it(recording):
    wanted = "pod_p.enabled, pod_p.K"
    found = gfor_in_python.validate(MODEL, recording, fit=wanted, step=STEP).fitted()
    by_name = found.set_index("parameter")
    assert bool(by_name.loc["pod_p.enabled", "value"]) is True
    assert by_name.loc["pod_p.K", "value"] == pytest.approx(120, rel=0.05)


def test_what_moves_nothing_is_named_before_the_fit_and_left(recording):
    given = {"values": ON, "fit": "pod_q.K, pod_p.K", "step": STEP}
    found = gfor_in_python.validate(MODEL, recording, **given).fitted()
    by_name = found.set_index("parameter")
    assert not by_name.loc["pod_q.K", "identifiable"]
    assert by_name.loc["pod_q.K", "why_not"] == "no effect"
    assert by_name.loc["pod_q.K", "value"] == by_name.loc["pod_q.K", "start"]
    assert by_name.loc["pod_p.K", "identifiable"]


def test_names_and_bounds_that_do_not_fit_are_refused_before_anything_is_driven(gfor, tmp_path):
    still = {"time [s]": [0.0, 0.1], "v_pu": 1.0, "angle_deg": 0.0, "p_mw": 1.0, "q_mvar": 0.0}
    recording = written(pd.DataFrame(still), tmp_path)  # in which no event is found
    code, _, err = gfor("validate", "gfor", str(recording), "--fit", "pod_p.KK")
    assert code == 2
    assert "pod_p.K" in err
    options = ("--fit", "pod_p.K", "--bounds", "pod_p.K=-5:10")
    code, _, err = gfor("validate", MODEL, str(recording), *options)
    assert code == 2
    assert "0 to 100000" in err.replace("1e+05", "100000")


def test_three_parameters_are_found_from_a_start_at_which_the_ringing_is_out_of_phase():
    frame = with_noise(phasor_plant(), 0).set_index("time")
    names = list(TRUTH)[:3]
    values = ON | starts_of(0, names)
    found = gfor_in_python.validate(MODEL, frame, values=values, fit=names, step=STEP)
    assert found.result.fit.reached
    for row in found.fitted().itertuples():
        assert row.low < TRUTH[row.parameter] < row.high
        assert row.high - row.low < 0.05 * TRUTH[row.parameter]


def test_an_event_that_is_kept_back_confirms_the_fit(gfor, recording, tmp_path):
    other = with_noise(phasor_plant(scale=0.95), 2)
    kept = written(other, tmp_path, "other.csv")
    options = ("--set", "pod_p.enabled=true", "--set", "pod_p.K=60", "--fit", "pod_p.K")
    options += ("--step", STEP)
    code, out, _ = gfor(
        "validate", MODEL, str(recording), *options, "--hold-back", str(kept), "--json"
    )
    assert code == 0
    fitted, held = json.loads(out)["fit_events"]
    assert (fitted["fitted"], held["fitted"]) == (True, False)
    assert held["recording"] == str(kept)
    assert held["rms_after_pu"] < 0.2 * held["rms_before_pu"]
    assert held["agrees"] is True


def test_an_interrupted_fit_keeps_the_best_values_so_far(recording):
    said = []

    def report(text):
        said.append(text)
        if sum(one.startswith("fit:") for one in said) == 2:
            raise KeyboardInterrupt

    given = {"values": ON | {"pod_p.K": 60.0}, "fit": "pod_p.K", "step": STEP}
    found = gfor_in_python.validate(MODEL, recording, report=report, **given)
    content = found.as_json()
    assert content["fit_finished"] is False
    (one,) = content["fit"]
    assert one["value"] != 60
    assert (one["low"], one["high"]) == (None, None)
    # not that there is nothing better: a fit that was not ended has not found that
    assert one["why_not"] == "interrupted"
    (check,) = content["fit_events"]
    assert check["rms_after_pu"] < check["rms_before_pu"]


def test_the_command_ends_an_interrupted_fit_with_its_figures(gfor, recording, monkeypatch):
    def stopped(residuals, told, switches, best):
        best.values = {"pod_p.K": 100.0}
        raise KeyboardInterrupt

    monkeypatch.setattr(fit, "_least_squares", stopped)
    options = ("--set", "pod_p.enabled=true", "--fit", "pod_p.K", "--step", STEP, "--json")
    code, out, _ = gfor("validate", MODEL, str(recording), *options)
    assert code == INTERRUPTED
    assert json.loads(out)["fit"][0]["value"] == 100


class CreepingErrors:
    """Errors of scatter 1 with one parameter, and a hidden voltage whose last part is found by halves."""

    def __init__(self, count=400):
        random = np.random.default_rng(1)
        self.noise = random.standard_normal(2 * count)
        self.way = np.sin(np.arange(2 * count) / 20)
        event = SimpleNamespace(recording=SimpleNamespace(interval=0.01))
        self.stretches = [SimpleNamespace(rows=np.arange(count), event=event)]
        self.hidden = [HiddenVoltage("hidden", 0, 0, 1 + 0j, 1.0)]
        self.runs = 0

    def report(self, text):
        pass

    def at(self, values):
        self.runs += 1
        creeps = (values.get("hidden", 0.0) - 1.0) ** 2
        return np.append(self.noise + self.way * (values["K"] - 110.0), creeps)

    def slopes(self, values, steps, *, both_sides=True):
        return np.append(self.way, 0.0)[:, None]

    def hidden_slopes(self, values):
        slope = 2 * (values.get("hidden", 0.0) - 1.0)
        return np.append(np.zeros(len(self.way)), slope)[:, None]


def test_a_fit_ends_where_no_value_moves_any_more_by_what_it_is_uncertain(monkeypatch):
    """By hand: K is a mean whose scatter is 1/|way|, and what is hidden creeps on without it."""
    runs = {}
    for gain in (fit._UNTOLD_GAIN, 0.0):
        monkeypatch.setattr(fit, "_UNTOLD_GAIN", gain)
        errors = CreepingErrors()
        best = fit._Best()
        told = [Adjustable("K", "1", start=80.0, low=0.0, high=1000.0)]
        stage = fit._Stage(errors, 0.0, 1e-12, best, both_sides=True)
        fit._stage_end(stage, told, {}, np.array([80.0 / told[0].reach, 0.0]))
        runs[gain] = errors.runs
        exact = 110.0 - float(errors.noise @ errors.way) / float(errors.way @ errors.way)
        scatter = 1 / np.sqrt(float(errors.way @ errors.way))
        assert abs(best.values["K"] - exact) < scatter / 7
    assert runs[0.02] < 0.7 * runs[0.0]


class RefusingErrors:
    """Errors of a device that does not run from any value on: all are alike, and have no slope."""

    hidden = ()
    stretches = (
        SimpleNamespace(
            rows=np.arange(200),
            event=SimpleNamespace(recording=SimpleNamespace(interval=1e-3)),
        ),
    )

    def __init__(self):
        self.rough = self

    def at(self, values):
        return np.full(400, 1e3)

    def slopes(self, values, steps, *, both_sides=True):
        return np.zeros((400, len(steps)))

    def hidden_slopes(self, values):
        return np.empty((400, 0))

    def report(self, text):
        pass


def test_a_start_from_which_no_device_runs_ends_there_without_a_warning():
    best = fit._Best()
    begin = [Adjustable("I_max", "pu", start=0.5, low=0.0, high=10.0)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fit._least_squares(RefusingErrors(), begin, {}, best)
    assert best.values == {"I_max": 0.5}


@pytest.mark.slow
def test_an_interval_holds_what_the_voltage_may_do_between_slow_samples():
    """A plant that swings through the fault of the other area, by means over a period, 50 of them in a second."""
    fault = {"time": 1.0, "component": "grid", "type": "bus_fault", "bus": "bus_3"}
    case = gfor_in_python.load("two_area_rms").with_(
        events=[fault | {"X": 0.02, "duration": 0.1}],
        solver={"step_size": "100 us", "record_interval": "1 ms", "record_filter": "low-pass"},
    )
    ran = case.scenario("pod_p", {"gfor.pod_p.K": 110.0}).run(stop=4.0).dataset
    frame = of_pmu(with_noise(table(ran)), mean=20).set_index("time")
    given = {"values": ON, "fit": "pod_p.K", "step": "1 ms"}
    found = gfor_in_python.validate("gfor_phasor", frame, **given)
    (row,) = found.fitted().itertuples()
    assert row.low < 110 < row.high


@pytest.mark.parametrize("reached", [True, False])
def test_the_wrong_position_of_a_switch_is_fitted_once_where_the_other_one_will_do(
    monkeypatch, reached
):
    fitted = []

    def leaves(residuals, told, switches, best):
        fitted.append(switches["on"])
        good = switches["on"] and reached
        best.cost, best.rms, best.values = (1.0, 1.0, {}) if good else (1e4, 100.0, {})

    def start(residuals, told, switches):
        return iter([told] * 5)

    monkeypatch.setattr(fit, "_least_squares", leaves)
    monkeypatch.setattr(fit, "_starts", start)
    monkeypatch.setattr(fit, "identifiable", lambda residuals, numbers, switches: (numbers, {}))
    wanted = Wanted([Adjustable("K", "1", start=80.0, low=0.0, high=1000.0)], ["on"])
    fit._search(CreepingErrors(), wanted, [])
    assert fitted == [False, True] if reached else sorted(fitted) == [False] * 5 + [True] * 5


@pytest.fixture(scope="module")
def limited():
    """A plant at its limit of the current in a fault, from 0.5 s before it to 0.9 s after it."""
    fault = {"time": 1.0, "component": "grid", "type": "bus_fault", "bus": "bus_2"}
    case = gfor_in_python.load("two_area").with_(
        events=[fault | {"X": 0.01, "duration": 0.1}],
        solver={"record_interval": "1 ms", "record_filter": "low-pass"},
    )
    own = {"gfor.current_limit.kind": 3, "gfor.current_limit.I_max": 1.0}
    frame = with_noise(table(case.scenario("pod_p", own).run(stop=2.0).dataset), 2)
    return frame[frame.time >= 0.5]


def fit_of_limit(frame, **wrong):
    """The fit of a limit of 1.1 pu, in a model of which other values may be wrong."""
    values = {"current_limit.kind": 3, "current_limit.I_max": 1.1} | wrong
    given = {"values": ON | values, "fit": "current_limit.I_max", "step": EMT_STEP}
    return gfor_in_python.validate("gfor", frame.set_index("time"), **given).result.fit


@pytest.mark.slow
def test_a_limit_at_the_truth_holds_though_a_jump_leaves_more_than_noise(limited):
    """What a fault's begin and end leave between two samples is no error of the model's."""
    found = fit_of_limit(limited)
    (limit,) = found.parameters
    assert limit.low < 1.0 < limit.high
    assert found.error_after > 3  # times the noise, as the samples are
    assert found.beyond < 1.5
    assert found.holds


@pytest.mark.slow
def test_a_limit_beside_another_wrong_value_does_not_hold(limited, monkeypatch):
    monkeypatch.setattr(fit, "_starts", lambda residuals, told, switches: iter([told]))
    found = fit_of_limit(limited, **{"transformer.X_t": 0.2})
    assert found.beyond > 10
    assert not found.holds
