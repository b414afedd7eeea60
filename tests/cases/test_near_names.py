"""Errors about names say which one was probably meant."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.names import close_names
from orchestrator.errors import CaseError, InputError
from tests.cases.test_plausibility import CASE

EVENT = '[[events]]\ntype = "fault"\ntime = "0.05 s"\nbus = "b2"\n'


def problems(tmp_path, text, overrides=None):
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        load_case(tmp_path / "case.toml").prepare((), overrides or {})
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('bus = "b2"', 'bus = "B2"', "at bus 'B2', which does not exist; did you mean 'b2'?"),
        ('bus = "b2"', "bus = 2", "at bus '2', which does not exist; did you mean 'b2'?"),
        ('bus = "b3", p', "bus = 3, p", "load 'd3' is at bus '3', which does not exist; did you mean 'b3'?"),
        ('to = "b3"', 'to = "bus_3"', "line 'l23' ends at bus 'bus_3', which does not exist; did you mean 'b3'?"),
        ('bus = "b2"', 'bus = "middle"', "port 'vsc' is at bus 'middle', which does not exist"),
    ],
)
def test_a_bus_that_is_not_there_is_one_error_with_near_names(tmp_path, old, new, words):
    assert old in CASE
    (problem,) = problems(tmp_path, CASE.replace(old, new))
    assert problem.endswith(words)


def test_an_unknown_kind_of_event_names_the_near_one(tmp_path):
    (problem,) = problems(tmp_path, CASE + EVENT)
    assert "type 'fault' is unknown; did you mean bus_fault?" in problem


def test_a_variable_of_a_part_is_found_without_the_part(tmp_path):
    (problem,) = problems(tmp_path, CASE, {"vsc.R_f": 0.05})
    assert "component 'vsc' has no variable 'R_f'; did you mean droop.R_f" in problem


@pytest.mark.parametrize(
    ("wanted", "hint"),
    [
        ("gfor*.current_limit", "phasor and EMT models name it differently: here it is gfor*.current_demand"),
        ("gfor1.current_limit", "phasor and EMT models name it differently: here it is gfor1.current_demand"),
        ("gfor1.current_demands", "did you mean gfor1.current_demand?"),
    ],
)
def test_an_output_of_the_other_kind_of_model_names_its_twin(wanted, hint):
    assert close_names(wanted, ["gfor1.current_demand", "gfor1.p"]) == hint


@pytest.mark.parametrize(("name", "key"), [("own.raw", "raw"), ("own.dyr", "dyr"), ("own.m", "matpower")])
def test_another_programs_file_is_no_case(tmp_path, name, key):
    (tmp_path / name).write_text("0, 100.0, 33 /")
    with pytest.raises(InputError, match=rf'{name}: this is .*, not a case; .* has {key} = "{name}"'):
        load_case(tmp_path / name)
