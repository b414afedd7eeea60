"""RAWX, PSS/E's data in JSON: the same network as the RAW file's, whatever the order of the fields."""

import numpy as np
import pytest

from fmus.grid.element_data import SMALLEST_REACTANCE
from orchestrator.core.errors import InputError
from tests.cases.networks.psse import BUSES, TRANSFORMERS, raw, read_text, records
from tests.cases.networks.psse.rawx_texts import network, rawx, table


@pytest.fixture
def read(tmp_path):
    def write(text, name="nine.rawx"):
        return read_text(tmp_path, text if isinstance(text, str) else rawx(text), name)

    return write


@pytest.mark.parametrize("name", ["nine.rawx", "nine.raw"])  # what it is, its content says
def test_the_network_is_that_of_the_raw_file(read, name):
    ours, theirs = read(network(), name), read(raw(35, records(35)), "lines.raw")
    for part in ("bus", "branch", "gen", "branch_to_earth"):
        assert np.array_equal(getattr(ours.tables, part), getattr(theirs.tables, part)), part
    assert ours.tables.labels == theirs.tables.labels
    assert (ours.tables.base_mva, ours.tables.frequency) == (100.0, 60.0)
    assert [m.source for m in ours.machines] == [m.source for m in theirs.machines]


def test_three_windings_are_five_lines(read):
    three = network()
    three["bus"]["data"].append(["BUS 10", 10, 1, 13.8, 1.0, 0.0])
    three["transformer"] = table(
        "ibus jbus kbus x1_2 x2_3 x3_1 windv3",
        [[i, j, 0, x, None, None, None] for i, j, x in TRANSFORMERS]
        + [[4, 5, 10, 0.1, 0.2, 0.3, 0.98]],
    )
    branch = read(three).tables.branch[-3:]
    least = 1.1 * SMALLEST_REACTANCE  # which the network takes for the leg without reactance
    assert branch[:, 3] == pytest.approx([0.1, least, 0.2], abs=1e-15)  # of the star
    assert branch[2, 8] == 0.98


def test_a_mistake_is_told_with_its_line(read):
    wrong = network()
    wrong["load"]["data"][1][2] = 77
    (told,) = [change for change in read(wrong).changes if "no bus 77" in change.text]
    lines = rawx(wrong).splitlines()
    number = int(told.place.partition("line ")[2])
    assert lines[number - 1].strip() == "["
    assert "77" in lines[number + 2]


def test_whole_numbers_with_a_decimal_point_are_whole(read):
    """InterPSS writes every number so, ``kbus`` of a transformer of two windings too."""
    pointed = network()
    pointed["transformer"] = table(
        "ibus jbus kbus x1_2", [[float(i), float(j), 0.0, x] for i, j, x in TRANSFORMERS]
    )
    assert (read(pointed).tables.branch == read(network()).tables.branch).all()


def test_tables_without_effect_are_passed_over(read):
    given = network()
    for name in ("swdratnam", "swdratset", "voltagedroop", "loadtype", "interface", "itfelmt"):
        given[name] = {"fields": ["name"], "data": [["A"]]}
    found = read(given)
    why = {record.why for record in found.records if "rating" in record.kind}
    assert why == {"no effect on the network"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "it is no JSON: Expecting property name"),
        ("{" * 100_000, "it is no JSON"),
        ('{"network": 3}', "it has no 'network'"),
        ('{"net": {}}', "it has no 'network'"),
        ('{"network": {"bus": {"data": []}}}', "line 1: network.bus lacks 'fields' or 'data'"),
        ('{"network": {"bus": {"fields": ["ibus"], "data": []}}}', "network.bus has no rows"),
        ('{"network": {"bus": {"fields": ["ibus"], "data": [[1, 2]]}}}', "2 values for 1 fields"),
        (
            '{"network": {"bus": {"fields": ["ibus"], "data": [[1], 3]}}}',
            "a row of network.bus is 3",
        ),
        ('{"network": {"caseid": {"fields": ["sbase"], "data": [-1]}}}', "sbase is -1 MVA"),
    ],
)
def test_what_is_no_rawx_is_refused_by_name(read, text, words):
    with pytest.raises(InputError, match=r"nine\.rawx") as caught:
        read(text)
    assert words in str(caught.value)


def test_fields_that_nothing_reads_do_not_count(read):
    assert len(read(network()).tables.bus) == len(BUSES)
