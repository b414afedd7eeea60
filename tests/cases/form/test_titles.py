"""Titles and labels, also those from Python, stand in one line: none forges a line of what is printed."""

import pytest

import orchestrator as gfor
from orchestrator.core.errors import CaseError

FORGED = "quiet\nquestion: none\tof them"
ONE_LINE = r"quiet\nquestion: none\tof them"


def test_ends_of_lines_in_titles_from_python_are_written_out():
    panel = {"label": FORGED, "signal": "gfor.omega"}
    case = gfor.load("infinite_bus").with_(
        title=FORGED,
        scenarios={"dip": {"title": FORGED}},
        plots=[{"name": "one", "title": FORGED, "panels": [panel]}],
    )
    assert case.scenario("dip").title == ONE_LINE
    assert case.file.table.title == ONE_LINE
    (plot,) = case.file.table.plots
    assert (plot.title, plot.panels[0].label) == (ONE_LINE, ONE_LINE)


@pytest.mark.parametrize("character", ["\x1b", "\u202e"])
def test_characters_that_steer_a_terminal_are_refused_in_titles(character):
    case = gfor.load("infinite_bus")
    with pytest.raises(CaseError, match=r"scenarios\.dip\.title"):
        case.with_(scenarios={"dip": {"title": f"a{character}[31mb"}}).scenario("dip")
