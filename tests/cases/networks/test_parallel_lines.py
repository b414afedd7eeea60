"""Several circuits between two buses in a file of lines."""

import pytest

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.core.errors import InputError

TABLE = NetworkTable(lines_file="lines.csv")
HEADER = "from,to,circuit,R,X,B\n"


def lines_of(folder, rows):
    (folder / "lines.csv").write_text(HEADER + rows, encoding="utf-8")
    return network_data(TABLE, folder).lines


def test_circuits_have_names_of_their_own(tmp_path):
    lines = lines_of(
        tmp_path, "1,2,1,0.01,0.1,0\n1,2,2,0.02,0.2,0\n2,3,,0,0.3,0.1\n3,north,b,0,0.3,0.1\n"
    )
    assert [line.name for line in lines] == ["line_1_2", "line_1_2_2", "line_2_3", "line_3_north_b"]
    assert [(line.from_bus, line.to_bus, line.X) for line in lines[:2]] == [
        ("bus_1", "bus_2", x) for x in (0.1, 0.2)
    ]


def test_a_circuit_that_is_no_name(tmp_path):
    with pytest.raises(
        InputError,
        match=r"lines.csv, line 3: circuit = 'b-1'; it becomes part of a name: use letters",
    ):
        lines_of(tmp_path, "1,2,,0.01,0.1,0\n1,2,b-1,0.02,0.2,0\n")
