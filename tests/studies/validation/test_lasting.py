"""An error within a planner's limits that lasts and is no noise is said beside the verdict."""

import orchestrator as gfor_in_python
from orchestrator.studies.validation.lasting import lasting_errors
from orchestrator.studies.validation.words import lasting_sentence
from tests.studies.validation.recordings import limits_of_errors, run, table, with_noise


def lasting(folder, **values):
    frame = with_noise(table(run("pod_p", stop=4.0, **values))).set_index("time")
    values, limits = {"pod_p.enabled": True}, limits_of_errors(folder)
    found = gfor_in_python.validate("gfor", frame, values=values, limits=limits, step="200 us")
    return found, lasting_errors(found.result.comparisons)


def test_a_droop_that_is_off_by_a_quarter_is_said_though_all_limits_are_met(tmp_path):
    found, errors = lasting(tmp_path, gfor__droop__R_V=0.04991)
    assert found.verdict == "met"
    assert [one.signal for one in errors] == ["q"]
    said = lasting_sentence(errors, explained=False)
    assert "the error of Q after the event" in said
    assert "type --explain" in said
    assert "--explain" not in lasting_sentence(errors, explained=True)
    assert "but clearly more than the recording" in found.html()


def test_a_right_model_has_no_lasting_error(tmp_path):
    _, errors = lasting(tmp_path)
    assert errors == []
    assert lasting_sentence(errors, explained=False) == ""
