"""Names of cases, scenarios and plots become names of files: they lead to no other place."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.names import file_name
from orchestrator.core.errors import CaseError

CASE = """name = {case}
[components.gfor]
model = "infinite_bus"
[scenarios.{scenario}]
title = "one"
[[plots]]
name = {plot}
title = "a plot"
panels = [{{ signal = "gfor.p", label = "P" }}]
"""
GOOD = {"case": '"small"', "scenario": '"one"', "plot": '"power"'}
BAD = [
    '"../../../x"',
    '"/abs/x"',
    '".."',
    '""',
    '" "',
    '"a/b"',
    '"a\\\\b"',
    '"C:x"',
    '"nul"',
    '"COM1.txt"',
    '"a\\u0000b"',
    '"a\\nb"',
    f'"{"x" * 201}"',
    '"-rf"',
    '"=1+1"',
    '"a."',
    '"x.part-1"',
    '"manifest.json"',
    '"summary.json"',
    '"modes.CSV"',
    '"report.html"',
]


def problems_of(path):
    """Of a case that can be read in part, or of one that cannot, as one without a name."""
    try:
        return load_case(path).problems
    except CaseError as error:
        return error.problems


def test_the_case_is_sound_but_for_the_names(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(**GOOD), encoding="utf-8")
    assert not problems_of(path)


@pytest.mark.parametrize("kind", GOOD)
@pytest.mark.parametrize("name", BAD)
def test_a_name_that_leads_elsewhere_is_refused_where_the_case_is_read(tmp_path, kind, name):
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(**GOOD | {kind: name}), encoding="utf-8")
    (problem,) = problems_of(path)
    line = {
        "case": "line 1, name",
        "scenario": "line 4, scenarios",
        "plot": "line 7, plots.0.name",
    }[kind]
    assert problem.place.startswith(line)
    assert "name" in problem.text


@pytest.mark.parametrize(
    "name", ["two_area", "Fall 3", "Überlast", "P=0.3", "a.b", "x" * 200, "console", "com10"]
)
def test_names_that_people_use_are_accepted(name):
    assert file_name(name) == name
