"""Ratings that a network's source does not have follow the apparent power of its power flow."""

import json

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.core.errors import CaseError

X = 0.05  # reactance of the line [pu, 100 MVA]
RAISED = 1.2  # voltage that the condenser at bus 2 holds [pu]; that at bus 1 holds 1 pu
FED_MVAR = 100 * RAISED * (RAISED - 1) / X  # by the condenser, without active power on the line
MOST_MVAR = 40.0  # limit of the condenser, from which the guess without a power flow is made

CONDENSER = f"""\
function mpc = condenser
mpc.version = '2';
mpc.baseMVA = 100;
mpc.bus = [
    1  3  50  0  0  0  1  1.0  0  345  1  1.1  0.9;
    2  2   0  0  0  0  1  1.0  0  345  1  1.1  0.9;
];
mpc.gen = [
    1  50  0  900  -900  1.0  100  1  600  0;
    2   0  0  {MOST_MVAR}  -{MOST_MVAR}  {RAISED}  100  1  0  0;
];
mpc.branch = [
    1  2  0  {X}  0  0  0  0  0  0  1  -360  360;
];
"""


@pytest.fixture
def network(tmp_path):
    path = tmp_path / "condenser.m"
    path.write_text(CONDENSER, encoding="utf-8")
    return path


def prepared(network, **wanted):
    out = network.with_name("case.toml")
    text = write_case(WantedCase((network,), out, **wanted)).text
    out.write_text(text, encoding="utf-8")
    (found,) = load_case(out).prepare(["base"])
    return found


def asked(scenario):
    return [one.text for one in scenario.questions if "the file has no ratings" in one.text]


def test_a_guess_follows_the_apparent_power_where_reactive_power_governs(network):
    """The case that is written can be run, and what is guessed is asked about, with figures."""
    scenario = prepared(network)
    condenser = scenario.system.components["sg2"]
    assert condenser.number("S_n") == pytest.approx(FED_MVAR / 0.9, abs=0.05)
    assert condenser.number("Q_0") * condenser.number("S_n") == pytest.approx(FED_MVAR, rel=1e-6)
    (question,) = asked(scenario)
    assert f"bus_2 0 MW +{FED_MVAR:.4g} Mvar" in question
    assert "bus_1 " not in question, "600 MW / 0.9 are more than it feeds"
    assert scenario.system.components["sg1"].number("S_n") == pytest.approx(600 / 0.9, abs=0.05)


def test_kept_limits_need_no_larger_rating(network):
    scenario = prepared(network, reactive_limits=True)
    condenser = scenario.system.components["sg2"]
    assert condenser.number("S_n") == pytest.approx(MOST_MVAR / 0.9, abs=0.05)
    assert asked(scenario) == []


@pytest.mark.parametrize("rating", [None, 150.0])
def test_a_rating_of_a_units_file_is_not_guessed(network, rating):
    prepared(network)
    case = network.with_name("case.toml")
    head = "bus,rating_mva\n1,700\n2,"
    network.with_name("units.csv").write_text(f"{head}{rating or ''}\n", encoding="utf-8")
    text = case.read_text(encoding="utf-8").replace("[units]\n", '[units]\nfile = "units.csv"\n')
    case.write_text(text, encoding="utf-8")
    if rating is None:
        (scenario,) = load_case(case).prepare(["base"])
        assert len(asked(scenario)) == 1
        assert scenario.system.components["sg2"].number("S_n") > FED_MVAR
        return
    with pytest.raises(CaseError, match=r"sg2 would have to feed Q_0 = 3\.2 pu") as caught:
        load_case(case).prepare(["base"])
    assert "raise its S_n" in str(caught.value)


def test_limits_that_are_kept_are_no_remedy(network):
    """The slack holds its voltage beyond its limit, though limits are kept."""
    text = CONDENSER.replace("1  3  50", "1  2  50").replace("2  2   0", "2  3   0")
    network.write_text(text, encoding="utf-8")
    prepared(network, reactive_limits=True)
    case = network.with_name("case.toml")
    for kept in (True, False):
        if not kept:
            written = case.read_text(encoding="utf-8")
            case.write_text(written.replace("reactive_limits = true\n", ""), encoding="utf-8")
        with pytest.raises(CaseError) as caught:
            load_case(case).prepare(["base"], {"sg2.S_n": 100.0})
        assert "sg2 would have to feed Q_0" in str(caught.value)
        assert ("or keep its limits" in str(caught.value)) is not kept


@pytest.mark.slow
def test_a_network_of_pandapower_with_condensers_becomes_a_case(gfor, tmp_path, monkeypatch):
    """The 300-bus system of IEEE as pandapower has it: with limits kept it has no power flow, in pandapower either."""
    networks = pytest.importorskip("pandapower.networks")
    pandapower = pytest.importorskip("pandapower")
    file = tmp_path / "case300.json"
    net = networks.case300()
    pandapower.to_json(net, str(file))
    case = tmp_path / "case.toml"
    code, out, err = gfor("new", str(file), "--out", str(case), "--json")
    assert code == 0, err
    told = [text for text in json.loads(out)["questions"] if "the file has no ratings" in text]
    assert len(told) == 1
    assert "bus_125 0 MW +315 Mvar" in told[0]
    with pytest.raises(pandapower.LoadflowNotConverged):
        pandapower.runpp(net, enforce_q_lims=True, max_iteration=50, numba=False)
    code, _, err = gfor("new", str(file), "--reactive-limits", "--out", str(tmp_path / "kept.toml"))
    assert code == 2
    assert "Without limits of reactive power it has a solution, so these are the cause" in err
    assert "the lines cannot carry" not in err
    monkeypatch.chdir(tmp_path)
    code, _, err = gfor("export", "linear", str(case), "--scenario", "base", "--out", "linear")
    loads = [line for line in err.splitlines() if "below zero: it feeds in" in line]
    assert len(loads) == 1
    assert "and 7 more of this kind" in loads[0]
