"""A RAW and a DYR file that do not belong together are one problem; machines too many are passed over."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CosimError
from tests.studies.screening.five_machines import five_machines
from tests.support.scenarios import prepare_one


def renumbered(folder, machines):
    """The five machines, whose records of some stand at other buses: 100 higher; problems of the case."""
    five_machines(folder)
    path = folder / "five.dyr"
    lines = []
    for line in path.read_text(encoding="utf-8").splitlines():
        bus, _, rest = line.partition(" ")
        lines.append(f"{int(bus) + 100} {rest}" if int(bus) in machines else line)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    with pytest.raises(CosimError) as caught:
        load_case(folder / "five.toml").prepare(["base"])
    return str(caught.value)


@pytest.mark.parametrize(
    ("machines", "records", "places"),
    [
        ({3, 4, 5}, "8 of 14", "(103 '1', 104 '1', 105 '1'; first GENROU in line 7)"),
        ({1, 2, 3, 4, 5}, "14 of 14", "first GENROU in line 1)"),
    ],
)
def test_files_of_two_networks_are_one_problem(tmp_path, machines, records, places):
    said = renumbered(tmp_path, machines)
    assert "five.dyr and the RAW file do not belong together, as it seems: " in said
    assert f"{records} records of machines stand at buses or identifiers that the RAW file" in said
    assert places in said
    assert f"and {len(machines)} of 5 machines have no record (" in said
    assert "which has no generator" not in said
    assert "has no record of a machine" not in said


def test_files_of_one_network_with_records_at_other_buses_are_told_by_machine(tmp_path):
    """Most records have a machine, so the files belong together: the machines without a record are one problem."""
    said = renumbered(tmp_path, {4, 5})
    assert "do not belong together" not in said
    assert "the RAW file does not have GENROU of machine '1' at bus 104, " in said
    assert (
        "2 machines have no record of a machine ('1' at bus 4, '1' at bus 5), which feed " in said
    )
    assert '(`gfor new --replace "machine without record"`), and a converter of ours stands' in said


def test_a_slip_at_one_machine_names_its_records(tmp_path):
    said = renumbered(tmp_path, {4})
    assert "models that may go" not in said  # it would not give the machine a record
    assert "do not belong together" not in said
    assert "the RAW file does not have GENROU of machine '1' at bus 104; if one of them" in said
    assert "machine '1' at bus 4 has no record of a machine" in said


def test_machines_that_the_network_lacks_are_passed_over_in_one_question(tmp_path):
    """PSS/E passes models of machines that are not in the network over; so a file of a larger network serves."""
    five_machines(tmp_path)
    path = tmp_path / "five.dyr"
    own = path.read_text(encoding="utf-8")
    sexs = "'SEXS' {} 0.1 10.0 100.0 0.05 -5.0 5.0 /\n"
    strange = f"104 'GENCLS' 1 4 0 /\n104 {sexs.format(1)}3 {sexs.format(7)}105 'GENCLS' 1 4 0 /\n"
    path.write_text(own + strange, encoding="utf-8")
    found = prepare_one(tmp_path / "five.toml", "base")
    (asked,) = [str(one) for one in found.questions if "does not have" in str(one)]
    line = len(own.splitlines()) + 1
    assert (
        f"five.dyr, line {line}: 4 records of 3 machines that the RAW file does not have" in asked
    )
    assert "(104 '1'; 3 '7', whose bus has '1'; 105 '1'; first GENCLS) are passed over" in asked
    passed = [one for one in found.records if one.line >= line and one.file.endswith("dyr")]
    assert [one.why for one in passed][1] == "the RAW file has no machine '1' at bus 104"
    assert {one.use.value for one in passed} == {"not used"}
    assert len(passed) == len(strange.splitlines())
