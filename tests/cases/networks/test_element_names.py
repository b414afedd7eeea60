"""Names that a network's file gives to buses and branches: shown beside identifiers, and taken by options."""

import shutil
from pathlib import Path

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import with_events
from orchestrator.cases.networks.element_names import BranchName, ElementNames, element_names
from orchestrator.cases.networks.sources import read_matpower, read_pandapower
from orchestrator.core.errors import CosimError, InputError
from orchestrator.studies.operating_points.outages import read_outages
from orchestrator.studies.operating_points.point_columns import Elements
from orchestrator.studies.siting.candidates import candidates
from tests.support.scenarios import prepare_one

_CASE = (
    'name = "areas"\n[solver]\nstep_size = "5 ms"\n[power_flow]\ngrid = "grid"\n[components.grid]\n'
    'model = "phasor_grid"\n[network]\nraw = "areas.raw"\n[units]\ndyr = "areas.dyr"\n'
    'generator = "synchronous_generator_phasor"\nconverter = "gfor_phasor"\n'
)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    folder = tmp_path_factory.mktemp("named")
    files = Path(__file__).parents[3] / ".docs" / "tutorials" / "psse"
    for name in ("areas.raw", "areas.dyr"):
        shutil.copy(files / name, folder)
    (folder / "case.toml").write_text(_CASE)
    return load_case(folder / "case.toml")


@pytest.fixture(scope="module")
def prepared(case):
    return case.prepare()[0]


@pytest.mark.parametrize(
    ("identifier", "shown"),
    [
        ("bus_8", "bus_8 MIDDLE"),
        ("sg3", "sg3 (GEN 3)"),
        ("load_9", "load_9 (EAST 9)"),
        ("line_5_6", "line_5_6 (WEST 5 – WEST 6)"),
        ("line_7_8_2", "line_7_8_2 (WEST 7 – MIDDLE, circuit 2)"),
        ("grid", "grid"),
    ],
)
def test_an_identifier_has_the_names_of_its_file_beside_it(prepared, identifier, shown):
    assert prepared.names.of(identifier) == shown


@pytest.mark.parametrize(
    "left",
    [
        "sg3.machine.omega",
        "results/bus_8.csv",
        "type `--outages line_7_8_2`",
        "type --outages line_7_8_2 next",
        "bus_80",
        "bus_8 MIDDLE",
    ],
)
def test_variables_files_and_what_is_typed_stay(prepared, left):
    assert prepared.names.in_text(left) == left


def test_a_sentence_names_each_element_once(prepared):
    text = "sg3 against sg1; line_7_8_2+sg3 lost."
    named = "sg3 (GEN 3) against sg1 (GEN 1); line_7_8_2 (WEST 7 – MIDDLE, circuit 2)+sg3 lost."
    assert prepared.names.in_text(text) == named


def test_a_page_keeps_its_markup_and_scripts():
    names = ElementNames({"bus_1": "bus_1 A & B"})
    page = '<p id="bus_1">bus_1</p><script>bus_1</script><code>bus_1</code>'
    named = '<p id="bus_1">bus_1 A &amp; B</p><script>bus_1</script><code>bus_1</code>'
    assert names.in_page(page) == named


def test_outages_are_named_as_in_the_file(prepared):
    elements = Elements.of(prepared)
    text = "WEST 5 – WEST 6, middle - west 7 circuit 2, GEN 2, line_7_8_2 (circuit 2)+GEN 3"
    found = read_outages(text, elements)[1:]
    assert [one.elements for one in found] == [
        ("line_5_6",),
        ("line_7_8_2",),
        ("sg2",),
        ("line_7_8_2", "sg3"),
    ]


def test_two_circuits_of_one_name_are_asked_about(prepared):
    with pytest.raises(InputError, match=r"2 elements of this name: line_7_8, line_7_8_2"):
        read_outages("WEST 7 – MIDDLE", Elements.of(prepared))


def test_places_are_named_as_in_the_file(prepared):
    assert candidates(["EAST 9", "bus_8", "west 7"], prepared) == ["bus_9", "bus_8", "bus_7"]


def test_a_fault_is_at_a_bus_of_the_file(case):
    by_name, by_number = (
        with_events(case, (), [text]).prepare()[0].events
        for text in (
            "WEST 7, 100 ms, opens MIDDLE – WEST 7 circuit 2",
            "7, 100 ms, opens line_7_8_2",
        )
    )
    assert by_name == by_number
    with pytest.raises(CosimError, match="NORTH 7"):
        with_events(case, (), ["NORTH 7, 100 ms"]).prepare()


def test_a_transformer_has_its_name_and_windings():
    titles = {"bus_1": "HIGH", "bus_2": "LOW", "bus_3": "THIRD"}
    ends = {"line_1_2": ("bus_1", "bus_2"), "transformer_4": ("bus_1", "bus_2", "bus_3")}
    branches = {"line_1_2": BranchName("T7 STEP-UP", "2"), "transformer_4": BranchName("T9")}
    names = element_names(titles, branches, ends, {}, {})
    assert names.of("line_1_2") == "line_1_2 (T7 STEP-UP, HIGH – LOW, circuit 2)"
    assert names.of("transformer_4") == "transformer_4 (T9, HIGH – LOW – THIRD)"
    assert names.of("transformer_4.leg_3") == "transformer_4.leg_3 (winding at THIRD)"
    assert names.identifier("t7 step-up", ends) == "line_1_2"


MPC = """\
function mpc = town
mpc.version = '2';
mpc.baseMVA = 100;
mpc.bus = [7 3 0 0 0 0 1 1.02 0 20 1 1.1 0.9; 9 1 50 10 0 0 1 1.0 -2 20 1 1.1 0.9; 8 2 0 0 0 0 1 1.01 -1 20 1 1.1 0.9];
mpc.gen = [7 20 0 99 -99 1.02 100 1 99 0; 8 30 0 99 -99 1.01 100 1 99 0; 8 1 0 99 -99 1.01 100 1 99 0];
mpc.branch = [7 9 0.01 0.1 0 0 0 0 0 0 1 -360 360; 9 8 0.01 0.1 0 0 0 0 0 0 1 -360 360];
mpc.bus_name = {'WEST'; 'O''NEILL'; "EAST"};
mpc.branch_name = {'Tie 1'; ''};
mpc.gen_name = {'HYDRO A'; 'COAL 1'; 'COAL 2'};
"""


def test_a_matpower_case_has_its_names(tmp_path):
    (tmp_path / "town.m").write_text(MPC)
    case = _CASE.replace('raw = "areas.raw"', 'matpower = "town.m"').replace(
        'dyr = "areas.dyr"', ""
    )
    (tmp_path / "case.toml").write_text(case.replace('_phasor"\nconv', '_st1_phasor"\nconv'))
    ready = prepare_one(tmp_path / "case.toml")
    shown = {
        name: ready.names.of(name) for name in ("bus_9", "line_7_9", "line_9_8", "sg8", "load_9")
    }
    assert shown == {
        "bus_9": "bus_9 O'NEILL",
        "line_7_9": "line_7_9 (Tie 1, WEST – O'NEILL)",
        "line_9_8": "line_9_8 (O'NEILL – EAST)",
        "sg8": "sg8 (COAL 1, COAL 2, EAST)",
        "load_9": "load_9 (O'NEILL)",
    }
    assert ready.names.identifier("tie 1", ["line_7_9"]) == "line_7_9"
    assert ready.names.identifier("hydro a", ["sg7", "sg8"]) == "sg7"


@pytest.mark.parametrize("names", ["{'WEST'; 'EAST'}", "cellstr(x)"])
def test_names_that_do_not_fit_the_rows_are_none(names, tmp_path):
    (tmp_path / "town.m").write_text(MPC.replace("{'WEST'; 'O''NEILL'; \"EAST\"}", names))
    assert read_matpower(tmp_path / "town.m").titles == {}


def test_a_pandapower_network_has_its_names(tmp_path):
    pp = pytest.importorskip("pandapower")
    net = pp.create_empty_network()
    buses = [pp.create_bus(net, 110.0, name=name) for name in ("Nord/1", "Nord 1", "Süd")]
    low = pp.create_bus(net, 20.0, name="Süd 20")
    pp.create_ext_grid(net, buses[0])
    pp.create_load(net, low, 10.0, 2.0)
    kind = "149-AL1/24-ST1A 110.0"
    pp.create_line(net, buses[0], buses[1], 10.0, kind, name="Leitung A")
    pp.create_line(net, buses[1], buses[2], 10.0, kind)
    pp.create_transformer(net, buses[2], low, "25 MVA 110/20 kV", name="T 1")
    pp.to_json(net, str(tmp_path / "net.json"))
    tables = read_pandapower("net.json", tmp_path)
    assert [tables.titles[n] for n in (0, 2, 3)] == ["Nord/1", "Süd", "Süd 20"]
    assert [one.name for one in tables.branch_names] == ["Leitung A", "", "T 1"]


def test_a_name_that_an_identifier_says_is_not_repeated():
    ends = {"line_a": ("bus_North_1", "bus_3")}
    names = element_names(
        {"bus_North_1": "North 1", "bus_3": "EAST"}, {}, ends, {}, {"sg": "bus_North_1"}
    )
    assert [names.of(one) for one in ("bus_North_1", "sg", "bus_3")] == [
        "bus_North_1",
        "sg",
        "bus_3 EAST",
    ]
    assert names.identifier("north 1", ["bus_North_1"]) == "bus_North_1"
    numbered = element_names(
        {"bus_1": "1", "bus_2": "2"}, {}, {"line_1_2": ("bus_1", "bus_2")}, {}, {}
    )
    assert numbered.of("line_1_2") == "line_1_2"
    assert numbered.identifier("2 – 1", ["line_1_2"]) == "line_1_2"


def test_a_case_without_names_is_shown_as_it_is():
    (first, *_) = load_case("kundur").prepare()
    text = "sg1 at bus_1"
    assert first.names.in_text(text) == text
    assert first.names.as_json() == {}
