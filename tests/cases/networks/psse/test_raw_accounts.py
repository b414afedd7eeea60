"""Every record of a RAW file is counted: used, held or not used."""

from collections import Counter

import pytest

from orchestrator.cases.networks.record_use import UseOfRecord, details, in_one_line
from tests.cases.networks.psse import raw, read_text, records


@pytest.fixture
def read(tmp_path):
    def write(revision, found):
        return read_text(tmp_path, raw(revision, found))

    return write


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_every_element_is_counted_once(revision, read):
    found = records(revision)
    uses = read(revision, found).records
    wanted = {section.lower(): len(rows) for section, rows in found.items() if rows}
    wanted["transformer"] //= 4
    wanted |= {"system-wide": 1} if revision > 33 else {}
    assert Counter(record.kind for record in uses) == wanted
    assert {x.kind for x in uses if x.use is not UseOfRecord.USED} <= {"system-wide"}


def test_what_is_held_or_out_of_service_is_told_with_its_line(read):
    found = records(33)
    found["BUS"].append("10,'OUT',230,4,1,1,1,1,0")
    found["LOAD"].append("8,'2 ',0,1,1,7,0,0,0,0,0,1,1,0")
    found["BRANCH"] += ["4,9,'9 ',0.01,0.1,0,0,0,0,0,0,0,0,0", "4,11,'1 ',0,0.00001,0"]
    found["BUS"].append("11,'BUS 11',230,1,1,1,1,1,0")
    found["SWITCHED SHUNT"] = ["5,1,0,1,1.1,0.9,0,100,'',10.0,1,10.0"]
    found["AREA"] = ["1,0,0,10,'ONE'"]
    found["ZONE"] = ["1,'ONE'"]
    found["TRANSFORMER"][2] = found["TRANSFORMER"][2].replace(
        "1.0,0,0,0,0,0,0,0", "1.0,0,0,0,0,0,1,0"
    )
    uses = read(33, found).records
    told = {(x.kind, x.use.value, x.why) for x in uses if x.use is not UseOfRecord.USED}
    assert told == {
        ("bus", "not used", "out of service: IDE = 4"),
        ("load", "not used", "out of service: its status is 0"),
        ("branch", "not used", "out of service: its status is 0"),
        ("branch", "not used", "zero impedance: its buses are one"),
        ("switched shunt", "held", "at BINIT"),
        ("transformer", "held", "its tap or phase shift"),
        ("area", "held", "interchange is not controlled: the machines feed PG"),
        ("zone", "not used", "no effect on the network"),
    }
    assert len(details(uses)) == len(told)
    assert "3 held (1 " in in_one_line(uses)


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_a_status_stands_in_its_column_of_the_revision(revision, read):
    """The columns of PSS/E 33, 34 and 35: a machine's GPNS and branches' names and ratings moved them."""
    columns = {"LOAD": 2, "GENERATOR": 14 if revision < 35 else 15}
    columns |= {"BRANCH": 13 if revision < 34 else 23, "FIXED SHUNT": 2, "TRANSFORMER": 11}
    found = records(revision) | {"FIXED SHUNT": ["5,'1 ',1,0,10"]}
    for section, column in columns.items():
        fields = found[section][0].split(",")
        assert fields[column] == "1"
        fields[column] = "0"
        found[section][0] = ",".join(fields)
    out = {x.kind for x in read(revision, found).records if x.why.endswith("its status is 0")}
    assert out == {section.lower() for section in columns}


def test_a_line_between_merged_buses_is_what_it_draws_to_earth(read):
    """Bus 11 is one with bus 4: a second line between them leaves its charging, and nothing else."""
    found = records(33)
    found["BUS"].append("11,'BUS 11',230,1,1,1,1,1,0")
    found["BRANCH"] += ["4,11,'1 ',0,0.00001,0", "4,11,'2 ',0.01,0.1,0.3"]
    network = read(33, found)
    (four,) = (row for row in network.tables.bus if row[0] == 4)
    assert four[4:6] == pytest.approx([0.0, 30.0], abs=1e-9)
    assert not any({int(row[0]), int(row[1])} == {4} for row in network.tables.branch)


def test_a_line_from_a_bus_to_itself_is_no_element(read):
    """So the solution has it of powsybl-core's ExampleVersion32.raw: what its charging would feed fits nowhere."""
    found = records(33)
    found["BRANCH"].append("4,4,'1 ',0.01,0.1,0.3")
    network = read(33, found)
    (four,) = (row for row in network.tables.bus if row[0] == 4)
    assert not any(four[4:6])
    assert [x.text for x in network.changes if "to itself" in x.text]
    assert ("branch", "from a bus to itself") in {(x.kind, x.why) for x in network.records}
