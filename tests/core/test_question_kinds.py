"""Questions of one kind stand in one line, with a count and the first few names."""

import json
import re

import pytest

from orchestrator.core.errors import Problem, QuestionTopic
from orchestrator.core.question_kinds import by_kind, questions_below
from tests.cases.networks.psse.test_questions import CASE, DYR, RAW, changed


def question_about(n):
    name = f"sg{n}.machine.T_d10"
    return Problem(
        f"own files/own.dyr, line {n}, {name}",
        f"sg{n}: machine.T_d10 = 0.{n} s is outside of 1 to 20 s; if it is meant, say so at the top of the case: "
        f'meant = ["{name}"]',
        topic=QuestionTopic("T_d10 outside of 1 to 20 s", f"sg{n}", (name,)),
    )


_TIMES = {str(question): question for question in map(question_about, range(1, 8))}


def test_a_kind_has_one_line_with_the_first_names_and_a_remedy_for_all():
    limits = Problem("line 3, power_flow", "limits of reactive power are reached")
    (first_time, *_), other = _TIMES, str(limits)
    lines = by_kind(
        {first_time: _TIMES[first_time], other: limits} | _TIMES, "gfor modes x --details"
    )
    assert [*lines] == [first_time, other]
    first, second = lines.values()
    assert second == other
    assert 'meant = ["*.machine.T_d10"] [and 6 more of this kind (sg2' in first
    assert first.endswith("and 2 more); gfor modes x --details lists all]")


@pytest.mark.parametrize("number", [1, 2])
def test_one_or_two_stand_as_they_are(number):
    some = dict([*_TIMES.items()][:number])
    assert [*by_kind(some, "x").values()] == [*some]


def test_sentences_that_differ_in_figures_alone_are_of_no_common_kind():
    """The words of a user's own file decide nothing."""
    texts = {f"bus {n} is 'weak {n}'": Problem("", f"bus {n} is 'weak {n}'") for n in range(5)}
    assert [*by_kind(texts).values()] == [*texts]


def test_an_answer_for_all_is_named_only_where_one_variable_is_asked_about():
    def asked(variable):
        text = f'{variable} is odd: meant = ["{variable}"]'
        return Problem("", text, topic=QuestionTopic("odd", variable, (variable,)))

    several = [asked(f"sg1.{name}") for name in ("H", "D", "K")]
    (line,) = by_kind({q.text: q for q in several}).values()
    assert 'meant = ["sg1.H"] [and 2 more of this kind (sg1.D, sg1.K)]' in line


def test_a_command_shows_a_kind_once_and_its_remedy_answers_all(gfor, tmp_path):
    records = [f"{bus} 'GENROU' 1  8.0" for bus in (1, 2, 3)]
    dyr = changed(DYR, *((old, old.replace("8.0", f"0.{k + 5}")) for k, old in enumerate(records)))
    (tmp_path / "areas.raw").write_text(RAW)
    (tmp_path / "areas.dyr").write_text(dyr)
    case = tmp_path / "case.toml"
    case.write_text(CASE)
    _, _, err = gfor("scr", case)
    (line,) = [text for text in err.splitlines() if "T_d10" in text]
    assert re.search(r"and 2 more of this kind \(sg2.*, sg3.*\); gfor modes", line)
    found = json.loads(gfor("scr", case, "--json")[1])
    answer = line.partition("top of the case: ")[2].partition(" [and")[0]
    case.write_text(f"{answer}\n{CASE}")
    code, _, err = gfor("scr", case)
    assert code == 0
    assert "T_d10" not in err
    assert found["scenarios"]


def test_a_line_beside_the_answer_tells_of_questions_below():
    """A green "stable" stood forty lines above the question whether an inertia of 6500 s is meant."""
    one = Problem(
        "--set sg1.machine.H", "too large", topic=QuestionTopic("H", "sg1", ("sg1.machine.H",))
    )
    other = Problem("loads.csv, line 3", "no load")
    assert questions_below([]) == []
    assert questions_below([one, one]) == ["1 question below: sg1.machine.H"]
    assert questions_below([one, other]) == ["2 questions below: sg1.machine.H, loads.csv, line 3"]
