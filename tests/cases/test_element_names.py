"""Names that a network's file gives to buses and branches: shown beside identifiers, and taken by options."""

import shutil
from pathlib import Path

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.element_names import BranchName, ElementNames, element_names
from orchestrator.cases.forcing import with_events
from orchestrator.core.errors import CosimError, InputError
from orchestrator.studies.operating_points.columns import Elements
from orchestrator.studies.operating_points.outages import read_outages
from orchestrator.studies.siting.candidates import candidates

_CASE = (
    'name = "areas"\n[solver]\nstep_size = "5 ms"\n[power_flow]\ngrid = "grid"\n[components.grid]\n'
    'model = "phasor_grid"\n[network]\nraw = "areas.raw"\n[units]\ndyr = "areas.dyr"\n'
    'generator = "synchronous_generator_phasor"\nconverter = "gfor_phasor"\n'
)


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    folder = tmp_path_factory.mktemp("named")
    files = Path(__file__).parents[2] / ".docs" / "tutorials" / "psse"
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


def test_a_case_without_names_is_shown_as_it_is():
    (first, *_) = load_case("kundur").prepare()
    text = "sg1 at bus_1"
    assert first.names.in_text(text) == text
    assert first.names.as_json() == {}
