"""Questions of one kind stand in one line, with a count and the first few names."""

import json
import re

import pytest

from orchestrator.core.question_kinds import by_kind
from tests.cases.networks.psse.test_questions import CASE, DYR, RAW, changed

_TIMES = [
    f"own files/own.dyr, line {n}, sg{n}.machine.T_d10: sg{n}: machine.T_d10 = 0.{n} s is outside of 1 to 20 s; if it "
    f'is meant, say so at the top of the case: meant = ["sg{n}.machine.T_d10"]'
    for n in range(1, 8)
]


def test_a_kind_has_one_line_with_the_first_names_and_a_remedy_for_all():
    other = "line 3, power_flow: limits of reactive power are reached"
    lines = by_kind([_TIMES[0], other, *_TIMES[1:]], "gfor modes x --details")
    assert [*lines] == [_TIMES[0], other]
    first, second = lines.values()
    assert second == other
    assert 'meant = ["*.machine.T_d10"] [and 6 more of this kind (sg2' in first
    assert first.endswith("and 2 more); gfor modes x --details lists all]")


@pytest.mark.parametrize("number", [1, 2])
def test_one_or_two_stand_as_they_are(number):
    assert [*by_kind(_TIMES[:number], "x").values()] == _TIMES[:number]


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
