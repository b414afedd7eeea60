"""RAW files of revisions 23 to 28, in which loads are in buses and transformers among branches."""

import math
from functools import partial

import pytest

from orchestrator.cases.networks.conversion import import_network
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import raw, read_text, records
from tests.cases.networks.psse.older_texts import early


@pytest.fixture
def read(tmp_path):
    return partial(read_text, tmp_path)


def elements(found):
    network = import_network(found.tables, joined=False)
    return network.lines, network.loads, network.shunts, network.generation


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("revision", [23, 24, 26])
def test_an_old_file_is_the_same_network(read, revision, named):
    assert elements(read(early(revision, named=named))) == elements(read(raw(33, records(33))))


def test_a_file_without_its_revision_is_known_by_its_buses(read):
    found = read(early(23))
    assert "read as revision 23" in " ".join(map(str, found.changes))
    assert found.tables.titles[5] == "BUS 5"


def test_ratio_and_charging_of_a_transformer_are_kept(read):
    """The ratio is at the first bus, and half of the charging behind it: B/2/t² and B/2 to earth."""
    found = read(early(23, ratio=1.05, charging=-0.2))
    lines, _, shunts, _ = elements(found)
    line = next(x for x in lines if x.name == "line_4_1")
    assert (line.tap, line.X) == (pytest.approx(1.05), pytest.approx(0.0576))
    at = {x.bus: x.b_mvar for x in shunts}
    assert at["bus_4"] == pytest.approx(-10 / 1.05**2)
    assert at["bus_1"] == pytest.approx(-10)


def test_the_control_of_a_transformer_is_held_and_told(read):
    adjustment = "4,1,'1 ',4,1.1,0.9,1.02,0.98,0.0125,0,1,0,0"
    found = read(early(23, adjustments=[adjustment]))
    assert {str(x.use) for x in found.records if x.kind == "transformer adjustment"} == {"held"}
    (tap,) = found.taps.values()
    assert tap.bus == 4


def test_a_switched_shunt_has_its_susceptance(read):
    _, _, shunts, _ = elements(read(early(26, shunts=["5,0,1.1,0.9,0,30.0,1,30.0"])))
    assert {x.bus: x.b_mvar for x in shunts} == {"bus_5": pytest.approx(30)}


def test_a_shift_makes_a_transformer_too(read):
    text = early(23).replace("0.0625,0.0,0,0,0,1.0,0,", "0.0625,0.0,0,0,0,0,30,")
    line = next(x for x in elements(read(text))[0] if x.name == "line_7_2")
    assert (line.tap, line.shift) == (1, pytest.approx(math.radians(30)))


def test_what_a_program_says_behind_the_last_section_is_no_record(read):
    text = early(26).rstrip() + "\nStop - Program terminated.\n"
    assert elements(read(text)) == elements(read(early(26)))


def test_an_unnamed_order_that_is_not_known_is_refused(read):
    with pytest.raises(InputError, match="their order is not known for this file"):
        read(early(27, named=False))
