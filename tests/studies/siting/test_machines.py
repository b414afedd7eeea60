"""Machines as places of a POD at the voltage regulator: residues, the coupled FMUs, and the design that is offered."""

import json
import re
import shlex
import shutil

import pytest

from orchestrator.cases.case import as_typed, load_case
from orchestrator.core.errors import InputError
from orchestrator.studies.siting.machine_view import MachineSiting
from orchestrator.studies.siting.machines import find_machines
from orchestrator.studies.siting.study import SiteRequest

GOVERNED = {"sg*.governor": "tgov1"}


def machines(**asked):
    given = {"scenario": "thyristor", "values": GOVERNED, "confirm": 0}
    return find_machines(load_case("kundur"), SiteRequest("regulator", **given | asked))


def test_every_machine_of_kundur_agrees_with_the_coupled_fmus():
    """Predicted and coupled shift by a small gain differ by less than 1 %."""
    found = machines(confirm=4)
    assert [one.bus for one in found.confirmations] == list(found.ranking)
    assert max(one.error for one in found.confirmations) < 0.01
    shifts = found.shifts["inter-area"]
    assert sorted(shifts, key=lambda name: -shifts[name].damping) == list(found.ranking)
    assert all(one.damping > 10 for one in found.confirmations)


def test_the_command_designs_at_the_best_machine_with_that_angle(gfor, tmp_path):
    found = MachineSiting(machines())
    (typed,) = re.findall(r"with: gfor (.*)$", found.answer)
    words = [*shlex.split(typed), "--no-margins", "--delta-gain", "0.5", "--json"]
    code, out, error = gfor(*words, "--out", str(tmp_path / "pod.toml"))
    assert code == 0, error
    design = json.loads(out)
    best = found.ranking[0]
    assert design["components"] == [best]
    shift = found.result.shifts["inter-area"][best]
    # the mode is that of the step map here, and that of the continuous system there
    assert design["sensitivity"]["phase_deg"] == pytest.approx(shift.angle, abs=1.0)
    assert design["sensitivity"]["magnitude"] == pytest.approx(abs(shift.change), rel=0.02)


def test_the_command_names_the_file_of_a_case_that_is_not_built_in(tmp_path):
    """Its name in the file is not what the command takes."""
    copied = tmp_path / "my grid" / "mine.toml"
    shutil.copytree(load_case("two_area").path.parent, copied.parent)
    (copied.parent / "case.toml").rename(copied)
    assert as_typed(load_case(copied)) == f"'{copied}'"
    assert as_typed(load_case("two_area")) == "two_area"
    assert load_case(shlex.split(as_typed(load_case(copied)))[0]).name == "two_area"


def test_stabilised_and_fixed_machines_are_told_and_not_confirmed(gfor):
    values = GOVERNED | {"sg4.stabilizer": "pss1a"}
    found = MachineSiting(machines(values=values))
    assert found.result.stabilised == ("sg4",)
    assert "--component sg4" not in found.answer
    assert any("with a stabiliser, which a POD would replace" in text for text in found.remarks)
    _, out, _ = gfor("site", "two_area_rms", "--device", "regulator", "--json")
    content = json.loads(out)
    assert content["confirmed"] == []
    assert any("of a model without a stabiliser to choose" in text for text in content["remarks"])


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"outages": "n-1"}, "--outages belongs to a device at a bus"),
        ({"buses": ("bus_1",)}, "--buses belongs to a device at a bus"),
        ({"scenario": "manual"}, "no machine has a voltage regulator"),
    ],
)
def test_what_does_not_go_together_is_refused(asked, words):
    with pytest.raises(InputError, match=words):
        machines(**asked)


def test_files_are_written(tmp_path):
    written = MachineSiting(machines()).save(tmp_path / "where")
    assert [file.name for file in written] == ["machines.json", "machines.csv", "machines.html"]
    assert "sg4" in written[2].read_text("utf-8")
