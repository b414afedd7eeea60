"""Questions about a case file that has not changed are shown whole by the first command, and then counted."""

import io
import json
import re
import shlex
from contextlib import redirect_stderr, redirect_stdout
from types import SimpleNamespace

import pytest

from orchestrator.core.errors import Problem
from orchestrator.face.cli import main
from orchestrator.face.cli.terminal import with_announced_questions
from tests.cases.networks.psse.test_questions import CASE, DYR, RAW


@pytest.fixture
def case(tmp_path):
    """A case of a RAW file with several questions, which no command has shown."""
    (tmp_path / "areas.raw").write_text(RAW)
    (tmp_path / "areas.dyr").write_text(DYR)
    (tmp_path / "case.toml").write_text(CASE)
    return tmp_path / "case.toml"


def asked(gfor, *words):
    code, out, err = gfor(*words)
    assert code == 0, err
    return out, [line for line in err.splitlines() if line.startswith("question: ")]


def test_the_second_command_counts_what_the_first_has_shown(gfor, case):
    _, first = asked(gfor, "modes", case)
    assert len(first) >= 2
    _, (line,) = asked(gfor, "scr", case)
    assert line.startswith(f"question: {len(first)} questions about case.toml are those of an ")
    (typed,) = re.findall("; gfor (.*?) shows them", line)
    assert asked(gfor, *shlex.split(typed))[1] == first, "the remedy works as it is typed"
    out, told = asked(gfor, "modes", case, "--json")
    assert told == first
    assert {x.removeprefix("question: ") for x in first} <= {*json.loads(out)["questions"]}


def test_a_question_of_another_value_is_shown_beside_the_count(gfor, case):
    _, first = asked(gfor, "modes", case)
    _, (fresh, line) = asked(gfor, "modes", case, "--set", "sg1.P_0=0.5")
    assert "sg1.P_0 cannot act" in fresh
    assert f"{len(first)} other questions" in line


def test_a_changed_file_is_asked_about_anew(gfor, case):
    _, first = asked(gfor, "modes", case)
    case.write_text(CASE + "# looked at\n")
    assert asked(gfor, "modes", case)[1] == first


def test_questions_stand_below_the_answer(case):
    screen = io.StringIO()
    with redirect_stdout(screen), redirect_stderr(screen):
        assert main(["modes", str(case)]) == 0
    before, _, after = screen.getvalue().partition("question: ")
    assert "Verdict" in before
    assert "Verdict" not in after


def test_questions_are_said_where_no_answer_comes(case):
    screen = io.StringIO()
    with redirect_stdout(screen), redirect_stderr(screen):
        assert main(["sensitivities", str(case), "--mode", "nowhere"]) != 0
    questions, _, error = screen.getvalue().rpartition("error: ")
    assert "question: " in questions
    assert "nowhere" in error


COMMANDS = (
    ("modes",),
    ("run", "--stop", "0.05"),
    ("sweep", "--vary", "sg1.machine.H=6:7:2"),
    ("screen", "--outages", "line_5_6", "--workers", "1"),
    ("sensitivities", "--parameter", "sg1.machine.H"),
)


@pytest.mark.parametrize("words", COMMANDS, ids=lambda words: words[0])
def test_questions_are_announced_above_the_tables_that_they_stand_below(
    words, gfor, case, tmp_path
):
    command, *options = words
    out = ("--out", tmp_path / "results")
    screen, err = asked(gfor, command, case, *options, *out)
    lines = screen.splitlines()
    (place,) = [k for k, line in enumerate(lines) if re.match(r"\d questions? below: ", line)]
    assert lines[place].startswith(f"{len(err)} questions below: ")
    tables = [k for k, line in enumerate(lines) if line.startswith("┏")]
    assert place < tables[-1]
    assert len([k for k in tables if k < place]) <= 1


def printed(parts, questions):
    scenario = SimpleNamespace(questions=[Problem("a.csv, line 3", "is it?")] * questions)
    return list(with_announced_questions(parts, [scenario]))


def test_the_line_follows_what_the_answer_begins_with():
    table, line = object(), "1 question below: a.csv, line 3"
    assert printed(["stable", "", table, "end"], 1) == ["stable", line, "", table, "end"]
    assert printed([table, "", table], 1) == [table, line, "", table]
    assert printed(["stable", "of it"], 1) == ["stable", "of it", line]
    assert printed(["stable", "", table, ""], 0) == ["stable", "", table, ""]
