"""A cause that was found while the model was held in step: up to where it holds without that, and what confirms it."""

import json
import re
import shlex
from types import SimpleNamespace

import numpy as np
import pytest

import orchestrator as gfor_in_python
from orchestrator.studies.validation.causes import CauseKind, Explanation
from orchestrator.studies.validation.plain_part import PlainPart, _leaves_at, plain_part
from orchestrator.studies.validation.words import explanation_sentence
from tests.studies.validation.recordings import run, table, with_noise, written

ON = {"pod_p.enabled": True}
STEP = "500 us"  # of the device, where no value is found to a part in thousand
LIMIT = "voltage_control.i_q_max"
FOUND = Explanation(CauseKind.VALUE, LIMIT, "pu", 1.1, 0.9218, 0.17, 0.013, noise=2e-4)
"""Found while the model was held in step beside a plant with 0.93."""


@pytest.fixture(scope="module")
def limited(tmp_path_factory):
    """A plant at its limit of the active current, which no recorded voltage keeps in step."""
    frame = with_noise(
        table(run("pod_p", stop=2.0, scale=1.06, gfor__voltage_control__i_q_max=0.93))
    )
    return written(frame, tmp_path_factory.mktemp("limited"))


def part_of(recording, cause, step=STEP, **values):
    found = gfor_in_python.validate("gfor", recording, values=ON | values, step=step).result
    device = found.request.device
    with device.shelf.keeping():
        return plain_part(device, [one.event for one in found.comparisons], cause)


def test_a_limit_is_found_again_before_the_model_leaves_and_the_command_confirms_it(gfor, limited):
    part = part_of(limited, FOUND, step="200 us")
    assert part.values[LIMIT] == pytest.approx(0.93, rel=3e-4)
    assert part.confirms
    assert not part.to_end
    assert 1.05 < part.until < 1.4
    said = explanation_sentence([FOUND], in_step=True, plain=part)
    (typed,) = re.findall(r"confirm it with (--set .*? --stop [\d.]*\d)", said)
    errors = []
    for given in (typed, typed.partition("--stop")[1] + typed.partition("--stop")[2]):
        options = ("--set", "pod_p.enabled=true", *shlex.split(given), "--step", "200 us")
        _, out, _ = gfor("validate", "gfor", str(limited), *options, "--json")
        (event,) = json.loads(out)["events"]
        errors.append(max(w["p"]["mean_abs_error_pu"] for w in event["windows"]))
    assert errors[0] < 0.1 * errors[1]


def test_a_cause_with_which_the_model_leaves_at_once_is_confirmed_by_nothing(limited):
    wrong = Explanation(CauseKind.VALUE, "virtual_impedance.R_v", "pu", 0.0, 0.84, 0.15, 0.056)
    part = part_of(limited, wrong)
    assert not part.shows
    assert not part.confirms
    said = explanation_sentence([wrong], in_step=True, plain=part)
    assert re.search(r"leaves the plant at once, at (0.99|1.0)", said)
    assert "confirm it with" not in said


def test_a_value_that_holds_to_the_end_is_confirmed_there():
    frame = with_noise(table(run("pod_p", stop=2.0))).set_index("time")
    right = Explanation(CauseKind.VALUE, "droop.R_f", "pu", 0.03, 0.049, 0.01, 0.001)
    part = part_of(frame, right, **{"droop.R_f": 0.03})
    assert part.to_end
    assert part.confirms
    assert part.left < 0.2 * part.error
    said = explanation_sentence([right], in_step=True, plain=part)
    assert "confirm it with --set droop.R_f=0.049. An interval is not given" in said
    assert "--stop" not in said
    assert "--fit" not in said


def test_what_takes_less_than_most_of_the_error_away_confirms_nothing():
    part = PlainPart("rec.csv", {LIMIT: 0.95}, 1.4, to_end=False, shows=True, error=0.05, left=0.04)
    assert not part.confirms
    said = explanation_sentence([FOUND], in_step=True, plain=part)
    assert "0.04 of 0.05 pu (rms) are left: the recording does not confirm the cause" in said
    assert said.endswith("--explain --stop 1.4 looks at that part alone.")


def test_what_gives_way_is_not_taken_for_a_second_cause():
    assert "something else may be off" in explanation_sentence([FOUND])
    assert "something else may be off" not in explanation_sentence([FOUND], in_step=True)


def test_a_cause_without_values_has_no_part(limited):
    late = Explanation(CauseKind.DELAY, "delay of the whole response", "s", 0.0, 0.03, 0.1, 0.01)
    assert part_of(limited, late) is None


def test_a_model_leaves_where_it_is_off_by_a_twentieth_of_the_movement():
    """By hand: a plant that moves by 0.4 pu, and a model that is off by a ramp of 0.1 pu/s from 1 s on."""
    times = np.arange(0, 3, 1e-3)
    power = 0.9 - 0.4 * (times > 1) + 0j
    recording = SimpleNamespace(interval=1e-3, power=power, times=times)
    event = SimpleNamespace(
        recording=recording,
        windows=SimpleNamespace(begin=1.0),
        start=SimpleNamespace(power=0.9 + 0j),
    )
    assert _leaves_at(event, power + 0.1 * np.clip(times - 1, 0, None)) == pytest.approx(
        1.2, abs=0.02
    )
    assert _leaves_at(event, power + 0.019) is None
