"""RAW files of revisions 23 to 28, in which loads are in buses and transformers among branches."""

import math

import pytest

from orchestrator.cases.networks.conversion import import_network
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import (
    BUSES,
    LINES,
    LOADS,
    MACHINES,
    REACTANCES,
    TRANSFORMERS,
    raw,
    records,
)

HEAD = "0  100.0\nWSCC, 9 buses\nSauer and Pai\n"
TAIL = (
    *("AREA", "TWO-TERMINAL DC", "SWITCHED SHUNT", "IMPEDANCE CORRECTION", "MULTI-TERMINAL DC"),
    *("MULTI-SECTION LINE", "ZONE", "INTER-AREA TRANSFER", "OWNER", "FACTS DEVICE"),
)


def old(revision, *, named=True, ratio=1.0, charging=0.0, adjustments=(), shunts=()):
    """Text of the system in an old revision, as GridPACK's files of revision 23 have it."""
    sections = {"BUS": [], "LOAD": [], "GENERATOR": [], "BRANCH": []}
    for n, (kv, kind, vm) in BUSES.items():
        p, q = LOADS.get(n, (0, 0))
        if revision == 23:
            bus = f"{n},{kind},{p},{q},0,0,1,{vm},0.0,'BUS {n}',{kv},1"
        else:
            bus = f"{n},'BUS {n}',{kv},{kind},0,0,1,1,{vm},0.0,1"
        sections["BUS"].append(bus)
    sections["LOAD"] = [f"{n},'1',1,1,1,{p},{q}" for n, (p, q) in LOADS.items()]
    sections["GENERATOR"] = [
        f"{n},'1 ',{p},0,300,-300,{v},0,{base},0,{REACTANCES[n]},0,0,1,1,100,{base},0"
        for n, (p, v, base) in MACHINES.items()
    ]
    sections["BRANCH"] = [
        f"{i},{j},'1 ',{r},{x},{b},0,0,0,0,0,0,0,0,0,1" for i, j, r, x, b in LINES
    ]
    sections["BRANCH"] += [
        f"{i},{-j},'1 ',0,{x},{charging},0,0,0,{ratio},0,0,0,0,0,1" for i, j, x in TRANSFORMERS
    ]
    sections["TRANSFORMER ADJUSTMENT"] = [*adjustments]
    sections |= {name: [*shunts] if name == "SWITCHED SHUNT" else [] for name in TAIL}
    if revision == 23:
        del sections["LOAD"]
    names = [*sections]
    lines = []
    for name, following in zip(names, [*names[1:], ""], strict=True):
        begin = f", BEGIN {following} DATA" if following else ""
        lines += [*sections[name], f"0 / END OF {name} DATA{begin}" if named else "0"]
    head = HEAD if revision == 23 else HEAD.replace("100.0", f"100.0,{revision}", 1)
    return head + "\n".join([*lines, ""])


@pytest.fixture
def read(tmp_path):
    def of(text):
        (tmp_path / "nine.raw").write_text(text)
        return read_raw(tmp_path / "nine.raw")

    return of


def elements(found):
    network = import_network(found.tables, joined=False)
    return network.lines, network.loads, network.shunts, network.generation


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("revision", [23, 24, 26])
def test_an_old_file_is_the_same_network(read, revision, named):
    assert elements(read(old(revision, named=named))) == elements(read(raw(33, records(33))))


def test_a_file_without_its_revision_is_known_by_its_buses(read):
    found = read(old(23))
    assert "read as revision 23" in " ".join(map(str, found.changes))
    assert found.tables.titles[5] == "BUS 5"


def test_ratio_and_charging_of_a_transformer_are_kept(read):
    """The ratio is at the first bus, and half of the charging behind it: B/2/t² and B/2 to earth."""
    found = read(old(23, ratio=1.05, charging=-0.2))
    lines, _, shunts, _ = elements(found)
    line = next(x for x in lines if x.name == "line_4_1")
    assert (line.tap, line.X) == (pytest.approx(1.05), pytest.approx(0.0576))
    at = {x.bus: x.b_mvar for x in shunts}
    assert at["bus_4"] == pytest.approx(-10 / 1.05**2)
    assert at["bus_1"] == pytest.approx(-10)


def test_the_control_of_a_transformer_is_held_and_told(read):
    adjustment = "4,1,'1 ',4,1.1,0.9,1.02,0.98,0.0125,0,1,0,0"
    found = read(old(23, adjustments=[adjustment]))
    assert {str(x.use) for x in found.records if x.kind == "transformer adjustment"} == {"held"}
    (tap,) = found.taps.values()
    assert tap.bus == 4


def test_a_switched_shunt_has_its_susceptance(read):
    _, _, shunts, _ = elements(read(old(26, shunts=["5,0,1.1,0.9,0,30.0,1,30.0"])))
    assert {x.bus: x.b_mvar for x in shunts} == {"bus_5": pytest.approx(30)}


def test_a_shift_makes_a_transformer_too(read):
    text = old(23).replace("0.0625,0.0,0,0,0,1.0,0,", "0.0625,0.0,0,0,0,0,30,")
    line = next(x for x in elements(read(text))[0] if x.name == "line_7_2")
    assert (line.tap, line.shift) == (1, pytest.approx(math.radians(30)))


def test_what_a_program_says_behind_the_last_section_is_no_record(read):
    text = old(26).rstrip() + "\nStop - Program terminated.\n"
    assert elements(read(text)) == elements(read(old(26)))


def test_an_unnamed_order_that_is_not_known_is_refused(read):
    with pytest.raises(InputError, match="their order is not known for this file"):
        read(old(27, named=False))
