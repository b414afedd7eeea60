"""Errors about names say which one was probably meant."""

from types import SimpleNamespace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.names import close_names
from orchestrator.cases.settings import assignment
from orchestrator.core.errors import CaseError, InputError
from tests.cases.questions.test_plausibility import CASE

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
        (
            'bus = "b3", p',
            "bus = 3, p",
            "load 'd3' is at bus '3', which does not exist; did you mean 'b3'?",
        ),
        (
            'to = "b3"',
            'to = "bus_3"',
            "line 'l23' ends at bus 'bus_3', which does not exist; did you mean 'b3'?",
        ),
        ('bus = "b2"', 'bus = "middle"', "port 'vsc' is at bus 'middle', which does not exist"),
    ],
)
def test_a_bus_that_is_not_there_is_one_error_with_near_names(tmp_path, old, new, words):
    assert old in CASE
    (problem,) = problems(tmp_path, CASE.replace(old, new))
    assert problem.endswith(words)


def test_an_unknown_kind_of_event_names_the_near_one(tmp_path):
    (problem,) = problems(tmp_path, CASE + EVENT)
    assert "type 'fault' is unknown; did you mean bus_fault or line_fault?" in problem


def test_a_variable_of_a_part_is_found_without_the_part(tmp_path):
    (problem,) = problems(tmp_path, CASE, {"vsc.R_f": 0.05})
    assert "component 'vsc' has no variable 'R_f'; did you mean droop.R_f" in problem


@pytest.mark.parametrize(
    ("wanted", "hint"),
    [
        (
            "gfor*.current_limit",
            "phasor and EMT models name it differently: here it is gfor*.current_demand",
        ),
        (
            "gfor1.current_limit",
            "phasor and EMT models name it differently: here it is gfor1.current_demand",
        ),
        ("gfor1.current_demands", "did you mean gfor1.current_demand?"),
        ("GFOR1.Current_Demand", "did you mean gfor1.current_demand?"),
    ],
)
def test_an_output_of_the_other_kind_of_model_names_its_twin(wanted, hint):
    assert close_names(wanted, ["gfor1.current_demand", "gfor1.p"]) == hint


@pytest.mark.parametrize(
    ("name", "key"), [("own.raw", "raw"), ("own.dyr", "dyr"), ("own.m", "matpower")]
)
def test_another_programs_file_is_no_case(tmp_path, name, key):
    (tmp_path / name).write_text("0, 100.0, 33 /")
    with pytest.raises(
        InputError, match=rf'{name}: this is .*, not a case; .* has {key} = "{name}"'
    ):
        load_case(tmp_path / name)


def test_a_line_is_looked_for_in_the_grid(gfor):
    for words in (
        ("modes", "two_area", "--set", "AB.X=0.1"),
        ("sweep", "two_area", "--vary", "AB.X=1:2:3"),
    ):
        _, _, error = gfor(*words)
        assert "it is of 'grid'" not in error
    for words in (
        ("modes", "wscc9", "--set", "line_4_5.X=0.1"),
        ("sweep", "wscc9", "--vary", "line_4_5.X=1:2:3"),
    ):
        code, _, error = gfor(*words)
        assert code == 2
        assert "it is of 'grid': write grid.line_4_5.…" in error


def test_a_value_of_the_same_digits_in_another_unit_is_asked_about(gfor):
    asked = "is 0.001 times what it is in the files; is the unit meant?"
    found = [
        gfor("modes", "wscc9", "--set", f"grid.load_5.P={value}")[2]
        for value in ("125 kW", "125 MW", "130")
    ]
    assert [asked in error for error in found] == [True, False, False]
    assert 'meant = ["grid.load_5.P"]' in " ".join(found[0].split())


def test_a_pattern_names_variables_as_it_names_components():
    case = load_case("wscc9")
    (found,) = case.prepare(["base"], {"grid.load_*.scale": 0.9})
    own = {
        v: x for v, x in found.system.components["grid"].parameters.items() if v.endswith(".scale")
    }
    assert own == {"load_5.scale": 0.9, "load_6.scale": 0.9, "load_8.scale": 0.9}
    with pytest.raises(CaseError, match=r"no variable 'laod_\*.scale'"):
        case.prepare(["base"], {"grid.laod_*.scale": 0.9})


def test_a_component_that_is_not_there_has_no_variable(monkeypatch):
    monkeypatch.setattr(
        assignment, "_matches", lambda draft, name, variable: ["pod.K"] if variable == "K" else []
    )
    plan = SimpleNamespace(description=SimpleNamespace(variables={"H": None}))
    draft = SimpleNamespace(system=SimpleNamespace(components={"sg1": plan}))
    asked = (("sg1", "H"), ("sg1", "K"), ("sg1", "X"), ("sg2", "H"), ("sg2", "K"))
    assert [assignment._has(draft, *one) for one in asked] == [True, True, False, False, False]


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("L.in_service", 0, "L is switched off by grid.L.connected=false"),
        ("grid.L.status", 1, "L is switched on by grid.L.connected=true"),
        ("L.connected", False, "L is switched off by grid.L.connected=false"),
        ("sg1.out", True, "sg1 is switched off by sg1.connected=false"),
        ("load_2.closed", False, "load_2 is switched off by grid.load_2.scale=0"),
        ("sg*.in_service", 0, "sg* is switched off by sg*.connected=false"),
        ("sg1.status", "closed", "sg1 is switched on by sg1.connected=true"),
    ],
)
def test_an_outage_in_other_words_is_one_error_with_ours(key, value, words):
    with pytest.raises(CaseError) as caught:
        load_case("two_area").prepare(["base"], {key: value})
    assert [str(p) for p in caught.value.problems] == [f"--set {key}: {words}; write that"]


@pytest.mark.parametrize("value", ["tripped", 2, ""])
def test_a_word_that_is_no_state_is_refused(value):
    with pytest.raises(CaseError) as caught:
        load_case("two_area").prepare(["base"], {"sg1.status": value})
    rule = "it must be true or false; sg1 is switched by sg1.connected"
    assert [str(p) for p in caught.value.problems] == [
        f"--set sg1.status: status = {value!r}; {rule}"
    ]
