"""Every record of a DYR file is used, listed, or in the table of what gfor does not have."""

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.cases.networks.psse import missing_models
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.dyr_model_list import known_records
from orchestrator.cases.networks.psse.dyr_units import without_idle_controls
from orchestrator.cases.networks.psse.dyr_uses import record_uses
from orchestrator.cases.networks.psse.machine_model import COMPENSATION
from orchestrator.cases.networks.psse.missing_models import kind_of, reason_of_device
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.cases.networks.psse.unused_models import unused_models
from orchestrator.cases.networks.record_use import UseOfRecord, in_one_line
from orchestrator.cases.networks.unit_row import UnitRow
from orchestrator.core.errors import InputError
from tests.benchmarks import andes_wind
from tests.benchmarks.andes_records import RECORDS
from tests.models.test_psse_traces import RECORDED

MACHINES = [
    Machine(bus, "1 ", 10 + bus, 100.0 * bus, 1.0, 500.0, 0.2j, -99.0, 99.0) for bus in (1, 2, 3)
]
CLASSICAL = "".join(f"{bus} 'GENCLS' 1 4.0 0.0 /\n" for bus in (1, 2, 3))
IEELAL = "9 'IEELAL' * 0.4 0.6 0 1 0 0 1.5 -1 0 2 0 1 0 0 /\n"


def read(tmp_path, text):
    (tmp_path / "grid.dyr").write_text(text)
    return read_dyr(tmp_path / "grid.dyr")


def refusal(tmp_path, text, leaving_out=(), replaced=()):
    with pytest.raises(InputError) as caught:
        machine_models(read(tmp_path, text), MACHINES, leaving_out, replaced)
    return str(caught.value)


def test_comments_slashes_alone_and_double_quotes(tmp_path):
    records = read(
        tmp_path,
        '/ a remark\n/\n// another\n1 "GENCLS" "1 " 4.0 0.0 / and 2 \'GENROU\'\n/\n/\n'
        "2, 'GENCLS', 1,\n 4.0, 0.0 /\n 2 'USRMDL' 1 'OWNEXC' 4 0 1 2 3 4 5.0 /\n/\n",
    )
    assert [(r.line, r.bus, r.name, r.machine) for r in records] == [
        (4, 1, "GENCLS", "1"),
        (7, 2, "GENCLS", "1"),
        (9, 2, "OWNEXC", "1"),
    ]
    assert records[0].values == ("4.0", "0.0")


def test_lines_of_hashes_and_the_mark_of_utf8_are_no_records(tmp_path):
    """Public files have both: IEEE300_dyn_v2_cmld.dyr and IEEE39bus_3AC.dyr of InterPSS."""
    records = read(
        tmp_path, "\ufeff1 'GENCLS' 1 4.0 0.0 /\n#---- loads below\n2 'GENCLS' 1 3 0 /\n"
    )
    assert [(r.line, r.bus, r.name) for r in records] == [(1, 1, "GENCLS"), (3, 2, "GENCLS")]


def test_a_file_that_changes_is_read_anew(tmp_path):
    first = read(tmp_path, "1 'GENCLS' 1 4.0 0.0 /\n")
    first.clear()
    assert [r.bus for r in read(tmp_path, "1 'GENCLS' 1 4.0 0.0 /\n")] == [1]
    assert [r.bus for r in read(tmp_path, "2 'GENCLS' 1 4.0 0.0 /\n")] == [2]


def test_models_that_are_missing_are_one_table(tmp_path):
    many = "".join(f"{bus} 'URST5T' 1 0.1 /\n" for bus in (1, 2, 3))
    many += "2 'VAR2' 1 3 /\n3 'OWNGOV' 1 3 /\n"
    text = refusal(tmp_path, CLASSICAL + many)
    rows = [
        line.split() for line in text.splitlines() if line.split()[:1] in (["URST5T"], ["VAR2"])
    ]
    assert [row[:5] for row in rows] == [
        ["URST5T", "3", "600", "line", "4"],
        ["VAR2", "1", "200", "line", "7"],
    ]
    assert "much: the voltage control" in text
    assert "little: it is slower than these modes" in text
    assert "constant references" in text
    assert "not known: gfor does not know what this model is" in text
    typed = "--dyr-leave-out URST5T --dyr-leave-out OWNGOV --dyr-leave-out VAR2"
    assert (
        text.splitlines()[-1].strip().startswith("to go on without them, write dyr_leave_out = [")
    )
    assert f"(`gfor new {typed}`)" in text.splitlines()[-1]
    machine_models(
        read(tmp_path, CLASSICAL + many), MACHINES, typed.replace("--dyr-leave-out ", "").split()
    )


DC_LINES = """\
'NORTH-SOUTH', 'CDC4T', 5, 5, 0.1, 0.1, 0.6, 0.65,
   60, 640 /
"Link 2 " "VSCHVDCP0 " /
"""


def test_models_of_dc_lines_are_passed_over_and_asked_about(tmp_path):
    """They begin with the line's name, where others have a bus."""
    records = read(tmp_path, CLASSICAL + DC_LINES)
    assert set(machine_models(records, MACHINES)) == {(bus, "1") for bus in (1, 2, 3)}
    uses = record_uses(records, {(bus, "1") for bus in (1, 2, 3)}, ())
    assert [use.why for use in uses[3:]] == [
        "a model of the DC line 'NORTH-SOUTH', which is of no machine",
        "a model of the DC line 'Link 2', which is of no machine",
    ]
    first, second = (str(question) for question in unused_models(records, uses))
    assert "line 4: CDC4T (DC line NORTH-SOUTH) is of no machine and not used: what it" in first
    assert "constant; its model is one of phasors: write models" in " ".join(first.split())
    assert "line 6: VSCHVDCP0 (DC line Link 2)" in second


def test_a_model_of_a_facts_device_says_whose_it_is_and_why_it_is_not_used(tmp_path):
    records = read(
        tmp_path, CLASSICAL + "'F 1' 'SVSMO3T2' 0 0.0 0.1 0.0 25 0.03 9 -9 1 1 0.2 1.2 0.1 0.5 /\n"
    )
    uses = record_uses(records, {(bus, "1") for bus in (1, 2, 3)}, ())
    assert uses[-1].why == "a model of the FACTS device 'F 1', which is of no machine"
    (question,) = (str(question) for question in unused_models(records, uses))
    assert "SVSMO3T2 (FACTS device F 1) is of no machine and not used" in question
    assert "no public source gives the order of its fields" in " ".join(question.split())


@pytest.mark.parametrize("bus", ["A1", "'A1'"])
def test_a_bus_that_is_no_number_is_no_dc_line(tmp_path, bus):
    with pytest.raises(InputError, match=r"'A1 GENCLS 1 4\.0' is no record; one is bus 'MODEL' id"):
        read(tmp_path, f"{bus} GENCLS 1 4.0 0.0 /\n")


@pytest.mark.parametrize("leaving_out", [(), ("GENQEC1",)])
def test_a_machines_own_record_is_never_offered_to_go(tmp_path, leaving_out):
    text = refusal(tmp_path, CLASSICAL.replace("3 'GENCLS'", "3 'GENQEC1'"), leaving_out)
    assert "line 3: no part of ours stands for GENQEC1, the machine itself (1 of 300 MW)" in text
    assert "--dyr-leave-out" not in text
    assert "has no record of a machine" not in text  # one cause, one problem


def test_a_machine_that_a_converter_replaces_needs_no_record(tmp_path):
    records = read(tmp_path, CLASSICAL.replace("3 'GENCLS'", "3 'GENQEC1'"))
    assert set(machine_models(records, MACHINES, (), {(3, "1")})) == {(1, "1"), (2, "1")}


def test_records_of_no_machine_are_listed_and_asked_about(tmp_path):
    text = (
        CLASSICAL
        + IEELAL
        + "9 'CMLDBLU2' 1 5 /\n9 'DISTR1' 1 5 /\n2 'VAR2' 1 3 /\n8 'GENCLS' 1 4 0 /\n"
    )
    records = read(tmp_path, text)
    uses = record_uses(records, {(bus, "1") for bus in (1, 2, 3)}, {(8, "1")}, ["var2"])
    assert [use.use for use in uses] == [UseOfRecord.USED] * 3 + [UseOfRecord.NOT_USED] * 5
    assert [use.why for use in uses[5:]] == [
        "a relay at bus 9, which is of no machine",
        "dyr_leave_out names it",
        "its machine is out of service",
    ]
    line = in_one_line(uses)
    assert line.startswith("8 records: 3 used, 5 not used (1 IEELAL, 1 CMLDBLU2, 1 DISTR1")
    asked = [str(question) for question in unused_models(records, uses)]
    assert len(asked) == 2  # a relay acts on events only
    assert "line 4: IEELAL (bus 9) is of no machine and not used" in asked[0]
    law = "load_model = { active = { z = 0.6, p = 0.4 }, reactive = { i = 1 }, k_pf = 1.5, k_qf = -1 } in [network]"
    assert law in asked[0]


@pytest.mark.parametrize(
    "change", [("0.4 0.6", "0.4 0.5"), ("0 2 0 1", "0 1.3 0 1"), (" 0 /", " /"), ("1.5", "x")]
)
def test_a_load_model_that_is_no_mixture_has_no_law(tmp_path, change):
    records = read(tmp_path, IEELAL.replace(*change))
    (question,) = unused_models(records, record_uses(records, (), ()))
    assert "load_model =" not in str(question)


def test_what_is_known_is_listed():
    records = {record.name: record for record in known_records()}
    assert records["GENROU"].part == "genrou"
    assert records["GENROU"].source
    assert "with dyr_approximate = true: gfl_phasor" in records["REGCA1"].approximated
    assert records["REPCA1"].part == "regca1_repca1_phasor"
    assert all(record.kind and record.part and record.source for record in records.values())
    for name, record in records.items():  # the lists of models say of each what we take it for
        assert kind_of(name) == record.kind.split()[0], name


def test_the_page_has_the_table():
    page = (Path(__file__).parents[4] / ".docs/reference/dynamics-records.md").read_text("utf-8")
    rows = [line for line in page.splitlines() if line.startswith("|")][2:]
    assert rows == [
        f"| {r.name} | {r.kind} | `{r.part}` | {r.held_against} | {r.approximated} |"
        for r in known_records()
    ]


def test_a_device_without_a_model_has_a_reason_which_the_page_lists():
    page = (Path(__file__).parents[4] / ".docs/reference/dynamics-records.md").read_text("utf-8")
    lines = [line for line in page.splitlines() if line.startswith("- ")]
    known = {record.name for record in known_records()}
    table = Path(missing_models.__file__).with_name("model_names.toml").read_text("utf-8")
    without = {*tomllib.loads(table)["device"].split()} - known
    assert without == {name for line in lines for name in line[2:].split(":")[0].split()}
    for line in lines:
        names, _, reason = line[2:].partition(": ")
        assert {reason_of_device(name) for name in names.split()} == {reason}
    assert reason_of_device("SVSMO1T2") == ""


def test_each_record_says_what_it_was_held_against():
    """Recordings and another program's eigenvalues are those of the tests that have them."""
    against = {record.name: record.held_against for record in known_records()}
    assert against["WEHGOV"] == "its diagram's equations, by hand"
    recorded = {
        line.split()[1]
        for known in RECORDED.values()
        for line in known.records.splitlines()
        if line
    }
    assert recorded <= {name for name, peer in against.items() if peer == "PSS/E's recordings"}
    listed = {record.split()[0] for records in RECORDS.values() for record in records}
    computed = {name for name, peer in against.items() if peer == "eigenvalues of ANDES 2.0.0"}
    assert computed == {name for name in listed if name not in recorded} | {*andes_wind.COMPARED}


def test_a_stabilizer_without_an_exciter_is_idle_and_said_so():
    """PSS/E leaves it idle; an exciter that the case chooses for machines without a record makes it act."""
    own = {"machine.H": 4.0, "pss.K_S": 9.0, "exciter.X_C": 0.05}
    row = UnitRow(
        "30",
        "bus_30",
        100.0,
        80.0,
        1.0,
        parts={"machine": "genrou", "stabilizer": "ieeest"},
        parameters={"sg": own},
        lines={"pss.K_S": 7},
    )
    (idle,) = without_idle_controls([row], "one.dyr")
    assert idle.parameters["sg"] == {"machine.H": 4.0}
    assert idle.parts == {"machine": "genrou"}
    assert [(name, place) for name, place, *_ in idle.doubts] == [
        ("pss.K_S", "one.dyr, line 7"),
        ("exciter.X_C", "one.dyr"),
    ]
    for parts, choosing in (({"exciter": "sexs"}, ""), ({}, "30")):
        active = replace(row, parts={**row.parts, **parts})
        assert without_idle_controls([active], "one.dyr", [choosing]) == [active]


@pytest.mark.parametrize(
    ("exciter", "use"), [(None, UseOfRecord.NOT_USED), ("sexs", UseOfRecord.USED)]
)
def test_an_idle_stabilizers_record_is_not_used(exciter, use, tmp_path):
    place = tmp_path / "one.dyr"
    place.write_text("1 GENCLS 1 4 0 /\n1 STAB1 1 1 2 3 4 5 6 7 /\n1 COMP 1 0.05 /\n")
    uses = record_uses(read_dyr(place), {(1, "1")}, (), exciter=exciter)
    assert [one.use for one in uses] == [UseOfRecord.USED, use, use]


@pytest.mark.parametrize(
    ("record", "wanted"),
    [
        ("COMP 1 0.05", {"exciter.X_C": -0.05}),
        ("IEEEVC 1 0.01 0.06", {"exciter.R_C": 0.01, "exciter.X_C": 0.06}),
    ],
)
def test_a_compensator_is_an_impedance_of_the_exciter(record, wanted, tmp_path):
    """COMP takes the drop at its reactance off, IEEEVC adds that at its impedance."""
    place = tmp_path / "one.dyr"
    genrou = "1 GENROU 1 8 0.03 0.4 0.05 6 0 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /"
    place.write_text(f"{genrou}\n1 SEXS 1 0.1 10 100 0.1 0 5 /\n1 {record} /\n")
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    model = machine_models(read_dyr(place), [machine])[1, "1"]
    assert {name: x for name, x in model.parameters.items() if name in COMPENSATION} == wanted
    assert model.parts == {"machine": "genrou", "exciter": "sexs"}


def test_an_event_of_andes_is_no_record_and_told(tmp_path):
    """ANDES writes events, such as a line that trips, behind the records of its example cases."""
    place = tmp_path / "one.dyr"
    place.write_text("1 GENCLS 1 4 0 /\n  Line  'Toggle'  Line_1  1.0 /\n")
    records = read_dyr(place)
    told = [(one.use, one.why) for one in record_uses(records, {(1, "1")}, ())]
    assert told[0] == (UseOfRecord.USED, "")
    assert told[1] == (
        UseOfRecord.NOT_USED,
        "an event of ANDES, of Line_1; [scenarios] has events",
    )
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    assert machine_models(records, [machine])[1, "1"].parts == {"machine": "classical"}


def test_a_limiter_of_excitation_rests_and_is_asked_about(tmp_path):
    """MNLEX1, whose diagram is not public, acts at its limit only; a network with one is read."""
    records = read(tmp_path, CLASSICAL + "2 'MNLEX1' 1 0.1 0.1 1.0 0.3 0.5 0.1 /\n")
    assert machine_models(records, MACHINES)[2, "1"].parts == {"machine": "classical"}
    keys = {(machine.bus, machine.name.strip()) for machine in MACHINES}
    uses = record_uses(records, keys, ())
    assert [use.use for use in uses if use.kind == "MNLEX1"] == [UseOfRecord.NOT_USED]
    (asked,) = unused_models(records, uses)
    assert asked.place.endswith("grid.dyr, line 4")
    assert "MNLEX1 is a limiter of excitation, taken to rest at the operating point" in asked.text


def test_a_static_var_compensator_that_is_missing_is_no_record_that_may_go(tmp_path):
    """Without it nothing stands for its generator of the RAW file; beside a machine it may go."""
    without = CLASSICAL.replace("3 'GENCLS' 1 4.0 0.0 /\n", "")
    record = "3 'CSVGN6' 1 10 0 0 0 0 1 0 1 0 0.1 /\n"
    text = refusal(tmp_path, without + record, ["CSVGN6"])
    assert "CSVGN6, the machine itself (1 of 300 MW); it cannot be left out" in text
    assert "write dyr_leave_out = ['CSVGN6']" in refusal(tmp_path, CLASSICAL + record)
