"""The dialects in which PSS/E's files come: each gives the same network, and each trap is told."""

from dataclasses import replace

import pytest

from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import network_data
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.cases.networks.psse.titles import section_of
from tests.cases.networks.psse import ORDER, raw, records
from tests.cases.networks.psse.older_texts import with_shunts_in_buses


@pytest.fixture
def read(tmp_path):
    """Content of a file → its network."""

    def network(content, name="grid.raw"):
        content = content if isinstance(content, bytes) else content.encode()
        (tmp_path / name).write_bytes(content)
        return network_data(NetworkTable(raw=name), tmp_path)

    return network


def texts(data):
    return " ".join(problem.text for problem in data.changes)


def with_blanks(text):
    """The same with blanks for delimiters, where no field is empty."""
    return "\n".join(
        line if line.startswith("0 /") else line.replace(",", "  ") for line in text.splitlines()
    )


SAME = {
    "revision 31": raw().replace("100.0,33", "100.0,31"),
    "revision 32": raw().replace("100.0,33", "100.0,32"),
    "lower case": raw().lower(),
    "carriage returns alone": raw().replace("\n", "\r"),
    "Latin-1": raw().encode("latin-1").replace(b"BUS 4", b"B\xfcS 4"),
    "blanks": with_blanks(raw()),
    "tabs": raw().replace(",", "\t,\t"),
    "double quotes": raw().replace("'", '"'),
    "comment lines": raw().replace(
        "BEGIN LOAD DATA", "BEGIN LOAD DATA\n// a comment\n@! one\n/\n/ one more"
    ),
    "an apostrophe in a name": raw().replace("'BUS 4     '", "'O'WEST ~1'"),
    "a doubled apostrophe": raw().replace("'BUS 4     '", "'4'' WEST  '"),
    "a header with blanks": raw().replace("0,100.0,33,0,1,60.0", "  0   100.0  33  0  1  60.0"),
    "titles of a converter": raw().replace("BEGIN AREA DATA", "BEGIN AREA INTERCHANGE DATA"),
    "what is out of service points nowhere": raw().replace(
        "0 / END OF BRANCH", "4,77,'9 ',0.01,0.1,0,0,0,0,0,0,0,0,0,1,0,1,1\n0 / END OF BRANCH"
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_a_dialect_gives_the_same_network(name, read):
    usual, other = read(raw()), read(SAME[name])
    assert other.lines == usual.lines
    assert other.loads == usual.loads
    assert other.generation == usual.generation
    assert other.buses == usual.buses


@pytest.mark.parametrize("revision", [29, 30])
def test_revisions_before_31_have_their_shunts_in_the_buses(revision, read):
    usual, other = read(raw()), read(with_shunts_in_buses(revision))
    assert (other.lines, other.loads) == (usual.lines, usual.loads)
    assert [(x.bus, x.b_mvar) for x in other.shunts] == [("bus_5", pytest.approx(50))]


def test_buses_of_revision_30_under_a_later_revision_are_read_as_they_are(read):
    """As a public file of three buses has them; read by REV, VM would be the owner, and VA the voltage in degrees."""
    found = records(33)
    found["BUS"] = [
        ",".join([*line.split(",")[:4], "0.000,0.000,1,1", *line.split(",")[7:9], "1"])
        for line in found["BUS"]
    ]
    found["BUS"][4] = found["BUS"][4].replace("0.000,0.000", "0.000,50.000")
    found["FIXED SHUNT"] = ["6,'1 ',1,0,20"]
    usual, other = read(raw()), read(raw(33, found))
    assert (other.lines, other.loads, other.generation) == (
        usual.lines,
        usual.loads,
        usual.generation,
    )
    assert {x.bus: x.b_mvar for x in other.shunts} == pytest.approx({"bus_5": 50, "bus_6": 20})
    assert "as in revision 30" in texts(other)


def test_one_line_of_titles_costs_no_bus(read):
    data = read(raw().replace("figure 7.4\n", ""))
    assert data.buses == read(raw()).buses
    assert "one line of titles" in texts(data)


def test_sections_of_a_substation_end_no_data(read):
    inner = "1,'NORTH',0,0\n0 / END OF SUBSTATION NODE DATA, BEGIN SUBSTATION SWITCHING DEVICE DATA\n1,2,'1'\n0\n0"
    text = raw(35).replace("BEGIN SUBSTATION DATA", f"BEGIN SUBSTATION DATA\n{inner}")
    assert read(text).lines == read(raw(35)).lines


@pytest.mark.parametrize(
    ("title", "section"),
    [
        ("TRANSFORMER IMPEDANCE CORRECTION TABLES", "impedance correction"),
        ("Area interchange", "area"),
        ("VOLTAGE SOURCE CONVERTER", "vsc dc line"),
        ("NON TRANSFORMER BRANCH", "branch"),
        ("FIXED BUS SHUNT", "fixed shunt"),
        ("TWO-TERMINAL DC TRANSMISSION LINE", "two-terminal dc"),
        ("INTER-AREA TRANSFER", "inter-area transfer"),
        *((name, name.lower()) for name in ORDER),
    ],
)
def test_a_title_is_known_by_its_meaning(title, section):
    assert section_of(title) == section


def test_zero_impedance_makes_one_bus(read):
    """A line of 1e-6 pu to a bus with a load: the load stands at the other bus."""
    found = records(33)
    found["BUS"].append("10,'TIED',230.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9")
    found["LOAD"].append("10,'1 ',1,1,1,30,10,0,0,0,0,1,1,0")
    found["BRANCH"].append("8,10,'1 ',0,1e-6,0,0,0,0,0,0,0,0,1,1,0,1,1")
    data = read(raw(33, found))
    assert data.buses == read(raw()).buses
    (load,) = [x for x in data.loads if x.bus == "bus_8"]
    assert (load.p_mw, load.q_mvar) == (130, 45)
    assert "the buses are one" in texts(data)


WHOLE = "8,10,'1 ',0.0119,0.1008,0,0,0,0,0,0,0,0,1,1,3,1,1"
"""A line to a bus with a load."""


@pytest.mark.parametrize(
    ("record", "words"),
    [
        (WHOLE, ""),
        (
            WHOLE.replace("0.0119,0.1008,", ""),
            "16 values, where the other branches have 18 or more, and taken as a zero impedance line (X = 0 pu)",
        ),
        ("8,10,'1 '", "3 values, where the other branches have 18 or more, and taken as a zero"),
        ("8,10,'1 '", "(it has no X): are values missing?"),
        # whole records without impedance, of one owner and out of service
        (WHOLE.replace("0.1008", "0"), ""),
        (WHOLE.replace("0,1,1,3", "0,0,1,3"), ""),
    ],
)
def test_a_short_record_of_a_branch_is_told_to_be_short(read, record, words):
    found = records(33)
    found["BUS"].append("10,'TIED',230.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9")
    found["BRANCH"].append(record)
    data = read(raw(33, found))
    said = [x for x in data.changes if "the record is short, of" in x.text]
    assert len(said) == bool(words)
    for one in said:
        assert words in one.text
        number = raw(33, found).splitlines().index(record) + 1
        assert one.place.endswith(f"grid.raw, line {number}")


def test_a_short_record_that_its_shift_takes_out_of_service_is_told(read):
    found = records(33)
    found["BRANCH"].append(
        "8,9,'2 ',0.1008,0,0,0,0,0,0,0,0,1,0,0,1,1"
    )  # without R: MET stands in ST
    assert "17 values, where the other branches have 18 or more, and taken as out of service" in (
        texts(read(raw(33, found)))
    )


@pytest.mark.parametrize(("line", "is_one"), [("0.012,1e-4,0", True), ("0.012,1e-4,0.02", False)])
def test_resistance_does_not_keep_buses_apart_and_charging_does(read, line, is_one):
    """So PSS/E's solution has it of psse_raw/case8_voltage_wind_correction.raw (NREL-Sienna/PowerSystemsTestData).

    Its buses 101 and 102 have one voltage with R = 0.012 pu between them, and 101 and 105 two, with charging."""
    found = records(33)
    found["BUS"].append("10,'TIED',230.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9")
    found["BRANCH"].append(f"8,10,'1 ',{line},0,0,0,0,0,0,0,1,1,0,1,1")
    data = read(raw(33, found))
    assert ("bus_10" not in data.buses) is is_one
    assert ("R of 0.012 pu has no effect" in texts(data)) is is_one


def test_a_closed_switching_device_makes_one_bus(read):
    found = records(34)
    found["BUS"] += [f"{n},'TIED',230.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9" for n in (10, 11)]
    found["SYSTEM SWITCHING DEVICE"] = [
        f"8,{n},'1 ',1e-4,{','.join(['0'] * 12)},{state},1,1,2,'S'"
        for n, state in ((10, 1), (11, 0))
    ]
    found["BRANCH"].append("9,11,'1 ',0,0.1,0,'',0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,1,1,0,1,1")
    data = read(raw(34, found))
    assert "bus_10" not in data.buses
    assert "bus_11" in data.buses
    assert not [line for line in data.lines if {line.from_bus, line.to_bus} == {"bus_8", "bus_11"}]


def test_charging_of_a_line_without_impedance_stays(read):
    found = records(33)
    found["BUS"].append("10,'TIED',230.0,1,1,1,1,1.0,0.0,1.1,0.9,1.1,0.9")
    found["BRANCH"].append("8,10,'1 ',0,1e-6,0.2,0,0,0,0.01,0.03,0,0.05,1,1,0,1,1")
    data = read(raw(33, found))
    (shunt,) = [x for x in data.shunts if x.bus == "bus_8"]
    assert (shunt.g_mw, shunt.b_mvar) == pytest.approx((1, 28))


def test_two_machines_stay_at_their_buses(read):
    found = records(33)
    found["BRANCH"].append("2,3,'9 ',0,1e-6,0,0,0,0,0,0,0,0,1,1,0,1,1")
    data = read(raw(33, found))
    assert {"bus_2", "bus_3"} <= {*data.generation}
    assert "zero impedance line between two buses with machines" in texts(data)


def test_a_power_above_mbase_is_asked_about(read):
    data = read(raw().replace(",192.0,", ",100,").replace(",100,192.0,", ",100,250,"))
    assert "PG or QG exceeds MBASE, which is the base of the machine's data" in texts(data)
    assert data.generation["bus_2"].rating_mva > 163


def test_a_negative_conductance_is_taken(read):
    found = records(33)
    found["FIXED SHUNT"].append("5,'1 ',1,-20,0")
    assert [(x.bus, x.g_mw) for x in read(raw(33, found)).shunts] == [("bus_5", pytest.approx(-20))]


def test_data_for_another_case_are_read_as_a_whole(read):
    assert "IC = 1" in texts(read(raw().replace("0,100.0,33", "1,100.0,33", 1)))


def test_a_line_that_stands_twice_is_a_parallel_circuit(read):
    """So the solutions have it of the IEEE's 118 and 57 buses as Illinois publishes them: each line is there."""
    found = records(33)
    found["BRANCH"] += [
        "7,8,'1 ',0.01,0.08,0.1,0,0,0,0,0,0,0,1,1,0,1,1",
        "7,8,'2 ',0.02,0.09,0.1,0,0,0,0,0,0,0,1,1,0,1,1",
    ]
    data = read(raw(33, found))
    between = [x for x in data.lines if {x.from_bus, x.to_bus} == {"bus_7", "bus_8"}]
    assert [line.X for line in between] == [0.072, 0.08, 0.09]
    circuits = {data.branch_names[line.name].circuit for line in between}
    assert circuits == {"1", "2", "3"}
    assert "the branch [7, 8] 1 stands in line" in texts(data)
    assert "a parallel circuit, 3, is taken" in texts(data)


def test_a_ratio_of_0_is_the_nominal_one(read):
    """MATPOWER's ``save2psse`` writes 0 for a ratio that its case does not give."""
    found = records(33)
    found["TRANSFORMER"][2] = found["TRANSFORMER"][2].replace("1.0,", "0,", 1)
    data, usual = read(raw(33, found)), read(raw())
    assert data.lines == usual.lines
    assert "WINDV is 0" in texts(data)


NAMED = {
    "SWITCHED SHUNT": ("5,'1 ',1,0,1,1.03,0.97,0,0,100,'',10.0,{}1,2,10.0", "'CAPACITOR',"),
    "SYSTEM SWITCHING DEVICE": ("4,5,'1 ',0.02,{},0,1,1,2,''", "'SUMMER'"),
    "INDUCTION MACHINE": (
        "5,'1',1,1,1,1,1,1,{}1,1,20,18,1,10,0,0,0,0,0,0.03,3,0.01,0.2",
        "'PUMP',",
    ),
}


@pytest.mark.parametrize("section", NAMED)
def test_names_of_revision_36_move_no_column(section, tmp_path):
    """PSS/E 36 writes a name amid these records, and a set of ratings in the place of twelve ratings."""
    record, name = NAMED[section]
    found = []
    for revision, text in (
        (35, ",".join(["0"] * 12) if section.startswith("SYSTEM") else ""),
        (36, name),
    ):
        lines = records(revision)
        lines[section] = [record.format(text)]
        (tmp_path / "grid.raw").write_text(raw(revision, lines))
        found.append(read_raw(tmp_path / "grid.raw"))
    older, newer = found
    assert (older.tables.bus == newer.tables.bus).all()
    assert (older.tables.branch == newer.tables.branch).all()
    assert [replace(x, line=0, place="") for x in older.devices] == [
        replace(x, line=0, place="") for x in newer.devices
    ]
    assert [x.use for x in older.records] == [x.use for x in newer.records]
