"""Results of an earlier day, as a notebook shows them."""

import re

import pytest

import orchestrator as gfor
from orchestrator.face.cli import main

pytestmark = pytest.mark.usefixtures("undrawn")


def test_a_folder_shows_the_verdict_of_each_scenario_in_its_own_colour_on_top(tmp_path):
    out = tmp_path / "run"
    chosen = ["--scenario", "base", "--scenario", "gfor"]
    assert main(["run", "two_area_rms", *chosen, "--stop", "0.1", "--out", str(out)]) == 0
    shown = gfor.open(out)._repr_html_()
    verdicts = re.findall(r"color: ([^\"]+)\"><b>([^<]+)</b>", shown)
    assert [text.partition(": ")[0] for _, text in verdicts] == ["Base (only SG)", "SG + GFOR"]
    assert ["UNSTABLE" in text for _, text in verdicts] == [True, False]
    assert len({colour for colour, _ in verdicts}) == 2
    assert shown.index("UNSTABLE") < shown.index(str(out))
    assert "gfor run two_area_rms --scenario base" in shown
    assert "modes.csv" in shown


def test_a_folder_that_was_changed_says_so_in_the_place_of_its_verdict(tmp_path):
    folder = gfor.load("two_area_rms").screen(scenario="gfor").save(tmp_path)[0].parent
    file = folder / "screening.json"
    file.write_text(file.read_text("utf-8").replace('"stable": true', '"stable": null'), "utf-8")
    shown = gfor.open(folder)._repr_html_()
    assert "it was damaged, changed" in shown[: shown.index("<p>cells.json")]
    assert "stable everywhere" not in shown
