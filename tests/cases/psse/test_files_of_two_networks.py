"""A RAW and a DYR file that do not belong together are one problem with counts, and a slip at one machine is not."""

import pytest

from orchestrator.cases.case import load_case
from orchestrator.core.errors import CosimError
from tests.studies.screening.five_machines import five_machines


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


def test_a_slip_at_one_machine_names_its_records(tmp_path):
    said = renumbered(tmp_path, {4})
    assert "do not belong together" not in said
    assert "GENROU is of machine '1' at bus 104, which has no generator in the RAW file" in said
    assert "machine '1' at bus 4 has no record of a machine" in said
