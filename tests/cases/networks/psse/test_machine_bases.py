"""MBASE is the base of a machine's data: another one with the same machine in its figures changes nothing."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.cases.scenario.facts import facts_of
from orchestrator.cases.scenario.flow_figures import power_flow_json
from orchestrator.core.errors import CaseError
from orchestrator.output.report.power_flow import COLUMNS, flow_table
from orchestrator.studies.modes.modes import compute_modes
from tests.support.scenarios import prepare_one

RAW = """\
0, 100.0, 33, 0, 1, 60.0 / two machines, a tie
A NETWORK
OF TWO MACHINES
1, 'WEST GEN', 20.0, 3, 1, 1, 1, 1.02, 0.0
3, 'EAST GEN', 20.0, 2, 1, 1, 1, 1.02, 0.0
7, 'WEST', 345.0, 1, 1, 1, 1, 1.0, 0.0
0 / END OF BUS DATA, BEGIN LOAD DATA
7, '1', 1, 1, 1, 1150.0, 110.0
0 / END OF LOAD DATA, BEGIN FIXED SHUNT DATA
0 / END OF FIXED SHUNT DATA, BEGIN GENERATOR DATA
1, '1', {west_mw}, 0.0, 500.0, -300.0, 1.02, 0, {west}, 0.0, {zx_west}, 0.0, 0.0, 1.0, 1, 100.0, 900.0, 0.0
3, '1', 450.0, 0.0, 400.0, -200.0, 1.02, 0, {east}, 0.0, {zx_east}, 0.0, 0.0, 1.0, 1, 100.0, 600.0, 0.0
0 / END OF GENERATOR DATA, BEGIN BRANCH DATA
7, 1, '1', 0.0, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
7, 3, '1', 0.002, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1
0 / END OF BRANCH DATA, BEGIN TRANSFORMER DATA
0 / END OF TRANSFORMER DATA
Q
"""
RATINGS = {"west": 900.0, "east": 600.0}


def network(west=900.0, east=600.0, west_mw=700.0):
    sources = {
        f"zx_{name}": 0.25 * base / RATINGS[name] for name, base in (("west", west), ("east", east))
    }
    return RAW.format(west=west, east=east, west_mw=west_mw, **sources)


def dynamics(bus, H, base, rating):
    """The records of a machine of a rating [MVA], in pu of a base [MVA]."""
    part = base / rating
    reactances = " ".join(f"{x * part!r}" for x in (1.8, 1.7, 0.3, 0.55, 0.25, 0.2))
    return f"""\
{bus} 'GENROU' 1 8.0 0.03 0.4 0.05 {H / part!r} 0.0 {reactances} 0.04 0.22 /
{bus} 'EXST1' 1 0.01 0.2 -0.2 1.0 1.0 200.0 0.0 5.0 -5.0 0.0 0.0 1.0 /
{bus} 'TGOV1' 1 {0.05 * part!r} 0.5 {1.2 / part!r} 0.0 2.1 7.0 0.0 /
"""


@pytest.fixture
def prepared(tmp_path):
    """Bases of the two machines [MVA] → the scenario base of the case that gfor writes."""

    def scenario(west, east, *, west_mw=700.0, with_dynamics=True):
        folder = tmp_path / f"{west:g}_{east:g}"
        folder.mkdir()
        files = [folder / "grid.raw"]
        files[0].write_text(network(west, east, west_mw))
        if with_dynamics:
            files.append(folder / "grid.dyr")
            files[1].write_text(dynamics(1, 6.5, west, 900.0) + dynamics(3, 5.0, east, 600.0))
        out = folder / "case.toml"
        out.write_text(write_case(WantedCase(tuple(files), out)).text, encoding="utf-8")
        return prepare_one(out, "base")

    return scenario


@pytest.mark.parametrize("base", [100.0, 2.0])
def test_the_modes_do_not_depend_on_the_base_of_the_data(prepared, base):
    """With 2 MVA the machine in the west feeds 350 pu: equivalents of whole areas have such bases."""
    own, other = (compute_modes(prepared(*bases)) for bases in ((900.0, 600.0), (base, base)))
    found, wanted = (np.sort_complex([mode.eigenvalue for mode in x.modes]) for x in (other, own))
    assert found == pytest.approx(wanted, rel=1e-6, abs=1e-6)


def test_loading_and_usual_ranges_are_of_the_rating(prepared):
    scenario = prepared(100.0, 100.0)
    (west, _) = power_flow_json(scenario)["machines"]
    assert west["rating_mva"] == pytest.approx(900 / 0.9)
    assert west["loading_percent"] == pytest.approx(
        100 * abs(complex(west["p_mw"], west["q_mvar"])) / 1000
    )
    asked = " ".join(question.text for question in scenario.questions)
    assert "is the base of the machine's data" in asked
    assert "outside of" not in asked


def test_the_line_of_facts_says_of_what_the_slack_feeds_a_part(prepared):
    """The table tells the part of the rating, here 1000 MVA, and apparent power."""
    scenario = prepared(100.0, 100.0)
    (west, _) = power_flow_json(scenario)["machines"]
    part = f"sg1 at {west['p_mw']:.4g} MW ({west['p_mw']:.0f} % of S_n = 100 MVA)"
    assert part in facts_of(scenario).sentence()
    assert COLUMNS["machines"]["loading_percent"] == "Loading [% of rating]"


def test_typical_data_are_on_what_the_reference_feeds(prepared):
    """A file that is not solved says nothing of the reference's power, and MBASE is 100."""
    scenario = prepared(100.0, 600.0, west_mw=0.0, with_dynamics=False)
    west = scenario.system.components["sg1"]
    assert west.number("P_0") * west.number("S_n") == pytest.approx(706, abs=5)
    assert west.number("S_n") == pytest.approx(
        abs(complex(west.number("P_0"), west.number("Q_0"))) * west.number("S_n") / 0.9, abs=0.1
    )
    asked = " ".join(question.text for question in scenario.questions)
    assert "more than twice the rating of the units at bus_1" in asked


def test_a_rating_in_a_table_is_one(tmp_path):
    """Elsewhere S_n is the rating, and a power beyond twice of it a mistake."""
    (tmp_path / "grid.raw").write_text(network())
    out = tmp_path / "case.toml"
    text = write_case(WantedCase((tmp_path / "grid.raw",), out)).text
    out.write_text(text, encoding="utf-8")
    with pytest.raises(CaseError, match="more than 2"):
        load_case(out).prepare(["base"], {"sg3.S_n": 200.0, "sg3.P_0": 1.0, "sg1.S_n": 300.0})


def test_a_bus_has_its_name_in_the_file_beside_its_number(prepared):
    buses = power_flow_json(prepared(900.0, 600.0))["buses"]
    assert {bus["name"]: bus["title"] for bus in buses} == {
        "bus_1": "WEST GEN",
        "bus_3": "EAST GEN",
        "bus_7": "WEST",
    }
    assert flow_table("Buses", "buses", buses).rows[0][0] == "bus_1 WEST GEN"
