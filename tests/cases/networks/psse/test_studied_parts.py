"""Parts of a RAW file that nothing joins, files without a reference, and elements at no bus of the file."""

import pytest

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.cases.networks.record_use import details
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.test_solution import MACHINE as NUMBER
from tests.cases.networks.psse.test_solution import solved_records
from tests.cases.networks.test_network_sources import solved

OWN = "20,'OWN       ',18.0,{kind},1,1,1,1.0,0.0"
LOAD = "20,'1 ',1,1,1,10,5,0,0,0,0,1,1,0"
MACHINE = "20,'1 ',10,0,30,-30,1.0,0,50,0,0.2,0,0,1,1,100,50,0,1,1"


@pytest.fixture
def read(tmp_path):
    """Records of the WSCC system, and the slack of the case → its data."""

    def data(found, slack=None):
        (tmp_path / "grid.raw").write_text(raw(33, found), encoding="utf-8")
        return network_data(NetworkTable(raw="grid.raw"), tmp_path, slack)

    return data


def with_island(kind, machine):
    found = records(33)
    found["BUS"].append(OWN.format(kind=kind))
    found["LOAD"].append(LOAD)
    found["GENERATOR"] += [MACHINE] if machine else []
    return found


def texts(data):
    return " ".join(change.text for change in data.changes)


def test_what_no_machine_feeds_is_left_out(read):
    alone, beside = read(records(33)), read(with_island(kind=1, machine=False))
    assert "lead to bus_20, and no machine feeds there: left out" in texts(beside)
    assert beside.buses == alone.buses
    assert solved(beside).voltages == solved(alone).voltages


def test_a_system_of_its_own_is_left_out_or_studied(read):
    beside = read(with_island(kind=3, machine=True))
    assert "no branch leads to bus_20, where machines feed 10 MW: a system of its own" in texts(
        beside
    )
    assert {*beside.generation} == {"bus_1", "bus_2", "bus_3"}
    assert 'such as slack = "bus_20"' in texts(beside)
    studied = read(with_island(kind=3, machine=True), slack="bus_20")
    assert studied.buses == ("bus_20",)
    assert read(with_island(kind=3, machine=True), slack="sg20").buses == ("bus_20",)


def test_machines_apart_without_a_reference_are_left_out_and_asked_about(read):
    beside = read(with_island(kind=2, machine=True))
    assert beside.buses == read(records(33)).buses
    assert "no branch leads to bus_20, where machines feed 10 MW, and none is a reference" in texts(
        beside
    )
    assert 'name one of its buses with a machine, such as slack = "bus_20"' in texts(beside)
    assert read(with_island(kind=2, machine=True), slack="bus_20").buses == ("bus_20",)


def with_reference_in_the_small_part(found):
    """The records with the system's reference moved to the part of one bus."""
    found["BUS"] = [row.replace(",16.5,3,", ",16.5,2,") for row in found["BUS"]]
    return found


def test_the_part_with_the_file_s_reference_is_studied_though_another_is_larger(read):
    found = with_reference_in_the_small_part(with_island(kind=3, machine=True))
    data = read(found)
    assert (data.buses, data.slack) == (("bus_20",), "bus_20")
    # of bus_1 to bus_9 the machine that feeds most is named, and no bus without one
    assert "bus_1, bus_2, bus_3 and 6 more, where machines feed 319.6 MW" in texts(data)
    assert 'such as slack = "bus_2"' in texts(data)


@pytest.mark.parametrize("slack", ["bus_2", "sg2", "bus_3"])
def test_the_slack_of_the_case_switches_to_its_part(slack, read):
    found = with_reference_in_the_small_part(with_island(kind=3, machine=True))
    data = read(found, slack=slack)
    assert data.buses == read(records(33)).buses
    assert "no branch leads to bus_20" in texts(data)


def test_the_largest_machine_stands_in_for_a_reference_that_is_missing(read):
    found = records(33)
    found["BUS"][0] = found["BUS"][0].replace("16.5,3", "16.5,2")
    data = read(found)
    assert data.slack == "bus_1"  # of 247.5 MVA, where others have 192 and 128
    assert "bus_1, which has the largest machines, is taken" in texts(data)
    assert solved(data).voltages == solved(read(records(33))).voltages


@pytest.mark.parametrize(
    ("section", "lines", "lost"),
    [
        (
            "LOAD",
            ["77,'1 ',1,1,1,10,5,2,0,0,-1,1,1,0"],
            "; the 12 MW and 6 Mvar that it draws drop out",
        ),
        ("FIXED SHUNT", ["77,'1 ',1,0,5"], ""),
        ("SWITCHED SHUNT", ["77,1,0,1,1.1,0.9,0,100,'',10.0,1,10.0"], ""),
        ("GENERATOR", [MACHINE.replace("20,", "77,", 1)], "; the 10 MW that it feeds drop out"),
        ("BRANCH", ["4,77,'1 ',0.01,0.1,0,0,0,0,0,0,0,0,1"], ""),
        (
            "TRANSFORMER",
            ["4,77,0,'1 ',1,1,1,0,0,2,'T',1", "0,0.1,100", "1.0,0,0,0,0,0,0", "1.0,0"],
            "",
        ),
    ],
)
def test_an_element_at_a_bus_that_is_not_there_is_told_and_not_used(
    section, lines, lost, read, tmp_path
):
    found, plain = records(33), read(records(33))
    found[section] = [*found[section], *lines]
    data = read(found)
    (said,) = data.changes
    assert said.text == f"not used: the file has no bus 77{lost}"
    number = raw(33, found).splitlines().index(lines[0]) + 1
    assert said.place.endswith(f"grid.raw, line {number}")
    assert solved(data).voltages == solved(plain).voltages
    (listed,) = details(read_raw(tmp_path / "grid.raw").records)
    assert f"line {number}" in listed
    assert "not used: the file has no bus 77" in listed


def test_a_word_for_an_owner_is_asked_about(read):
    found = records(33)
    found["LOAD"][0] = found["LOAD"][0].replace("0,0,0,0,1,1,0", "0,0,0,0,me,1,0")
    data = read(found)
    assert "OWNER is 'me', which is no number" in texts(data)
    assert solved(data).voltages == solved(read(records(33))).voltages


def test_a_solution_at_a_limit_counts_although_QG_is_not_its(read):
    """A machine at its least reactive power, whose record has QG = 0 from before, holds VM as PSS/E's solution does."""
    plain = solved(read(records(33)))
    held = abs(plain.voltages[f"bus_{NUMBER}"])
    found = solved_records(plain, setpoint=held - 0.02, limits=lambda q: (q, 300.0))
    for k, row in enumerate(found["GENERATOR"]):
        fields = row.split(",")
        if fields[0] == str(NUMBER):
            fields[3] = "50"
        found["GENERATOR"][k] = ",".join(fields)
    data = read(found)
    assert "whose voltages need QB or QT there, and not QG" in texts(data)
    assert abs(solved(data).voltages[f"bus_{NUMBER}"]) == pytest.approx(held, abs=1e-7)
