"""Areas, zones, owners and stations of a network's file: shown where a planner looks for them."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.networks.conversion import import_network
from orchestrator.cases.networks.psse.raw import read_raw
from orchestrator.cases.networks.regions import Region, Regions
from orchestrator.cases.networks.sources import read_matpower
from orchestrator.cases.scenario.facts import facts_of
from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.cases.scenario.region_totals import region_totals
from orchestrator.face.api.case import load
from orchestrator.face.explore.diagram import diagram
from orchestrator.output.report import power_flow
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse import raw, records
from tests.cases.networks.psse.rawx_texts import network, rawx, table
from tests.cases.networks.test_element_names import _CASE, MPC

TUTORIAL = Path(__file__).parents[3] / ".docs" / "tutorials" / "psse"
EAST = Region("2 EAST", "3 COAST", "1 GRID CO", "HARBOUR")

STATIONS = """\
1, 'PLAIN', 52.1, 4.2, 0.1
/ BEGIN SUBSTATION NODE DATA
1, 'N1', 1, 1, 1.0, 0.0
0 / END OF SUBSTATION NODE DATA, BEGIN SUBSTATION SWITCHING DEVICE DATA
1, 2, '1 ', 'SW', 2, 1, 1, 0, 0, 0, 0
0 / END OF SUBSTATION SWITCHING DEVICE DATA, BEGIN SUBSTATION TERMINAL DATA
1, 1, '2', 9, '1 '
1, 1, '3', 9, 8, '1 '
0 / END OF SUBSTATION TERMINAL DATA
2, 'HARBOUR', 52, 4, 0.1
/ BEGIN SUBSTATION NODE DATA
1, '7', 8, 1, 1.0, 0.0
0 / END OF SUBSTATION NODE DATA"""


@pytest.fixture
def read(tmp_path):
    def of(text, name="nine.raw"):
        (tmp_path / name).write_text(text)
        return read_raw(tmp_path / name).tables.regions

    return of


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    """Kundur's two areas, which the tutorial's file numbers, with names."""
    folder = tmp_path_factory.mktemp("regions")
    shutil.copy(TUTORIAL / "areas.dyr", folder)
    text = (TUTORIAL / "areas.raw").read_text()
    begin = text.index("BEGIN AREA DATA") + len("BEGIN AREA DATA\n")
    end = text.index("0 / END OF AREA")
    named = f"{text[:begin]}1, 1, 0.0, 10.0, 'WEST'\n2, 3, 0.0, 10.0, 'EAST'\n{text[end:]}"
    (folder / "areas.raw").write_text(named)
    (folder / "case.toml").write_text(_CASE)
    return load_case(folder / "case.toml")


@pytest.fixture(scope="module")
def prepared(case):
    return case.prepare()[0]


def named(revision):
    """Lines of the WSCC system with bus 8 in regions of its own."""
    found = records(revision)
    found["BUS"] = [
        line.replace(",1,1,1,1,", ",1,2,3,1,") if line.startswith("8,") else line
        for line in found["BUS"]
    ]
    found["AREA"] = ["1,1,0,10,'WEST'", "2,2,0,10,'EAST'"]
    found["ZONE"] = ["3,'COAST'"]
    found["OWNER"] = ["1,'GRID CO'"]
    return found


@pytest.mark.parametrize("revision", [33, 34, 35])
def test_regions_are_read_from_every_revision(read, revision):
    found = named(revision)
    if revision > 33:
        found["SUBSTATION"] = STATIONS.splitlines()
    regions = read(raw(revision, found))
    assert regions[8] == (EAST if revision > 33 else replace(EAST, station=""))
    assert regions[1].station == ("PLAIN" if revision > 33 else "")
    assert regions[9] == Region("1 WEST", "1", "1 GRID CO")


def test_rawx_names_its_regions(read):
    tables = network()
    tables["bus"]["fields"] += ["area", "zone", "owner"]
    for row in tables["bus"]["data"]:
        row.extend([2, 3, 1] if row[1] == 8 else [1, 1, 1])
    tables["area"] = table("iarea isw pdes ptol arname", [[2, 2, 0, 10, "EAST"]])
    tables["zone"] = table("izone zoname", [[3, "COAST"]])
    tables["owner"] = table("iowner owname", [[1, "GRID CO"]])
    station = "isub name lati long srg"
    tables["sub"] = table(station, [[1, "PLAIN", 0, 0, 0.1], [2, "HARBOUR", 0, 0, 0.1]])
    node = "isub inode name ibus stat vm va"
    tables["subnode"] = table(node, [[2, 1, "N1", 8, 1, None, None]])
    end = "isub inode type eqid ibus jbus kbus"
    tables["subterm"] = table(end, [[1, 1, "M", "8", 8, None, None]])
    assert read(rawx(tables), "nine.rawx")[8] == EAST


def test_a_word_in_the_place_of_a_number_tells_no_region(read):
    found = records(33)
    found["BUS"][0] = found["BUS"][0].replace(",3,1,1,1,", ",3,north,1,1,")
    assert read(raw(33, found))[1] == Region("", "1", "1")


def test_matpower_numbers_areas_and_zones(tmp_path):
    (tmp_path / "town.m").write_text(MPC.replace("0 0 0 0 1 1.01", "0 0 0 0 2 1.01"))
    regions = import_network(read_matpower(tmp_path / "town.m")).regions
    assert regions["bus_8"] == Region("2", "1")


def test_numbers_that_tell_nothing_apart_are_not_shown():
    same = dict.fromkeys(("bus_1", "bus_2"), Region("1", "1", "1", "HILL"))
    found = Regions.telling(same, same)
    assert found.of("bus_1") == Region(station="HILL")
    assert not found.has_areas
    assert found.area_of("bus_1") == ""


def test_modes_tell_who_takes_part_by_the_areas_of_the_file(prepared):
    result = compute_modes(prepared)
    mode = min(result.modes, key=lambda mode: mode.frequency_hz)
    shares = result.by_area(mode)
    assert {*shares} == {"1 WEST", "2 EAST"}
    assert sum(shares.values()) == pytest.approx(1)
    of_west = sum(x for name, x in mode.by_component.items() if name in ("sg1", "sg2"))
    assert shares["1 WEST"] == pytest.approx(of_west)


def test_the_power_flow_names_areas_of_buses_units_and_ties(prepared):
    flow = power_flow_json(prepared)
    of = {kind: {row["name"]: row.get("area") for row in flow[kind]} for kind in power_flow.COLUMNS}
    assert of["buses"]["bus_7"] == "1 WEST"
    assert of["machines"]["sg3"] == "2 EAST"
    assert of["branches"]["line_7_8"] == "1 WEST – 2 EAST"
    assert of["branches"]["line_5_6"] == "1 WEST"
    assert [*power_flow.columns(flow["buses"], "buses").values()][-1] == "Area"
    assert power_flow.flow_table("Buses", "buses", flow["buses"]).rows[0][-1] == "1 WEST"


@pytest.mark.filterwarnings("ignore::orchestrator.UnusualDataWarning")
def test_the_diagram_says_what_an_element_belongs_to(case):
    shown = diagram(load(case.path).scenario())
    titles = {x["name"]: x["title"] for kind in ("buses", "lines", "units") for x in shown[kind]}
    assert titles["bus_8"] == "bus_8 MIDDLE, area 2 EAST"
    assert titles["sg1"] == "sg1 (GEN 1), area 1 WEST"
    assert titles["line_7_8_2"].endswith("circuit 2), area 1 WEST – 2 EAST")


def test_each_area_has_its_generation_and_load(prepared):
    west, east = region_totals(prepared)
    assert (west.kind, west.name, west.units) == ("area", "1 WEST", ("sg1", "sg2"))
    assert west.load_mw == pytest.approx(967)
    assert west.load_mw + east.load_mw == pytest.approx(facts_of(prepared).load_mw)
    flow = power_flow_json(prepared)
    assert west.generation_mw + east.generation_mw == pytest.approx(flow["generation_mw"])


def test_new_lists_the_regions_at_ones_word(gfor, case):
    folder = case.path.parent
    files = ("new", folder / "areas.raw", folder / "areas.dyr", "--out", folder / "new.toml")
    code, out, _ = gfor(*files, "--details", "--force")
    assert code == 0
    assert "area 1 WEST" in out
    code, out, _ = gfor(*files, "--json", "--force")
    assert [one["name"] for one in json.loads(out)["regions"]] == ["1 WEST", "2 EAST"]
