"""Units of a case: from a file, from the network's source or both, with shares and parameters of their own."""

from dataclasses import replace

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.parameter_files import read_parameter_file
from orchestrator.cases.scenario import unit_tables
from orchestrator.core.errors import CaseError
from orchestrator.studies.sweep.axes import parse_vary
from orchestrator.studies.sweep.request import SweepRequest
from orchestrator.studies.sweep.sweep import plan_sweep
from tests.cases.networks.test_network_sources import SMALL

CASE = """\
name = "small"
[power_flow]
grid = "grid"
[components.grid]
model = "grid"
[network]
matpower = "small.m"
frequency = "60 Hz"
stray_B = 0.05
[units]
file = "units.csv"
alpha = 0.25
generator = "synchronous_generator_st1"
converter = "gfor"
converter_parameters = { droop.R_f = 0.04 }
[scenarios.plain]
[scenarios.shares]
set = { "units.alpha" = 0.4, "units.alpha.20" = 0.5 }
"""
UNITS = "bus,rating_mva,p_mw,alpha,sg.machine.H,gfor.droop.R_f,gfor.pod_p.enabled,sg.governor.T_5\n"
ROWS = "7,300,,0.1,4.5,,true,\n20,150,45,,,0.03,,8 s\n"


@pytest.fixture
def case(tmp_path):
    def write(text=CASE, units=UNITS + ROWS, network=SMALL):
        (tmp_path / "case.toml").write_text(text, encoding="utf-8")
        (tmp_path / "units.csv").write_text(units, encoding="utf-8")
        (tmp_path / "small.m").write_text(network, encoding="utf-8")
        return load_case(tmp_path / "case.toml")

    return write


def problems(case, *arguments):
    with pytest.raises(CaseError) as caught:
        case.prepare(*arguments)
    return [str(problem) for problem in caught.value.problems]


def test_figures_come_from_the_file_and_otherwise_from_the_networks_source(case):
    (ready,) = case().prepare(["plain"])
    v = ready.values
    assert (v["sg7.S_n"], v["gfor7.S_n"]) == pytest.approx((270, 30))
    assert (v["sg20.S_n"], v["gfor20.S_n"]) == pytest.approx((112.5, 37.5))
    assert v["sg20.P_0"] == v["gfor20.P_0"] == 0.3  # 45 MW of the file, not 60 MW of the source
    assert v["sg7.v_0"] == pytest.approx(1.02)
    assert v["sg20.v_0"] == pytest.approx(1.01)
    assert ready.power_flow.residual <= 1e-9
    fed = sum(
        ready.power_flow.powers[f"{kind}7"].real * v[f"{kind}7.S_n"] for kind in ("sg", "gfor")
    )
    # with losses; the slack is the source's reference bus
    assert fed == pytest.approx(90 + 50 - 45, abs=12)


def test_parameters_of_one_unit(case):
    (ready,) = case().prepare(["plain"])
    v = ready.values
    assert v["sg7.machine.H"] == 4.5
    assert "sg20.machine.H" not in v
    assert (v["gfor7.droop.R_f"], v["gfor20.droop.R_f"]) == (0.04, 0.03)
    assert v["gfor7.pod_p.enabled"] is True
    assert "gfor20.pod_p.enabled" not in v
    assert v["sg20.governor.T_5"] == 8


def test_the_frequency_goes_to_everything_that_has_one_and_no_other_may_be_set(case):
    (ready,) = case().prepare(["plain"])
    assert [ready.values[f"{n}.f_n"] for n in ("grid", "sg7", "sg20", "gfor7")] == [60, 60, 60, 60]
    text = CASE.replace("converter_parameters = {", "converter_parameters = { f_n = 50,")
    with pytest.raises(CaseError, match="gfor7 is rated at 50 Hz and grid at 60 Hz"):
        case(text).prepare(["plain"])
    (ready,) = case(CASE.replace('frequency = "60 Hz"\n', "")).prepare(["plain"])
    # MATPOWER's files do not know theirs: every model keeps its own, 50 Hz
    assert "grid.f_n" not in ready.values


@pytest.mark.parametrize(
    ("scenario", "overrides", "shares"),
    [
        ("plain", {}, (0.1, 0.25)),  # the row's own, else the table's
        ("shares", {}, (0.4, 0.5)),  # the scenario goes before both
        ("shares", {"units.alpha": 0.2}, (0.2, 0.2)),  # the command line before the scenario
        ("shares", {"units.alpha.7": 0.3}, (0.3, 0.5)),
        ("plain", {"units.alpha": 0.2, "units.alpha.20": 0.6}, (0.2, 0.6)),
        ("plain", {"units.alpha.20": 0.6, "units.alpha": 0.2}, (0.2, 0.6)),
    ],
)
def test_whose_share_counts(case, scenario, overrides, shares):
    (ready,) = case().prepare([scenario], overrides)
    v = ready.values
    found = tuple(v[f"gfor{n}.S_n"] / (v[f"gfor{n}.S_n"] + v[f"sg{n}.S_n"]) for n in (7, 20))
    assert found == pytest.approx(shares)


@pytest.mark.parametrize(
    ("vary", "fixed", "shares"),
    [
        # before the file's share of one unit
        ("gfor7.droop.R_f=0.03,0.04", {"units.alpha": 0.2}, (0.2, 0.2)),
        # what is varied before all
        ("units.alpha=0.3,0.6", {"units.alpha": 0.2, "units.alpha.20": 0.4}, (0.3, 0.3)),
    ],
)
def test_whose_share_counts_in_a_sweep(case, tmp_path, vary, fixed, shares):
    (tmp_path / "pf.toml").write_text('[set]\n"units.alpha.20" = 0.5\n', encoding="utf-8")
    file = read_parameter_file(tmp_path / "pf.toml")
    planned = plan_sweep(
        case(), SweepRequest([parse_vary(vary)], ["plain"], fixed, parameters=[file])
    )
    task = planned.task(planned.scenarios[0], (0,))
    (ready,) = planned.case.prepare([task.scenario], task.overrides, None, None, task.study.layers)
    v = ready.values
    found = tuple(v[f"gfor{n}.S_n"] / (v[f"gfor{n}.S_n"] + v[f"sg{n}.S_n"]) for n in (7, 20))
    assert found == pytest.approx(shares)


def test_a_share_of_nothing_or_everything_leaves_one_component(case):
    (ready,) = case().prepare(["plain"], {"units.alpha.7": 0.0, "units.alpha.20": 1.0})
    assert set(ready.system.components) == {"grid", "sg7", "gfor20"}


def test_without_a_file_every_generator_bus_is_a_unit(case):
    (ready,) = case(CASE.replace('file = "units.csv"\n', "")).prepare(["plain"])
    assert set(ready.system.components) == {"grid", "sg7", "gfor7", "sg20", "gfor20"}
    v = ready.values
    # (80 + 40) MW at a power factor of 0.9
    assert v["sg20.S_n"] + v["gfor20.S_n"] == pytest.approx(133.3)
    assert v["sg20.P_0"] == pytest.approx(60 / 133.3)


TWO = "bus,unit,rating_mva,p_mw,v_pu,alpha,q_min_mvar,q_max_mvar,sg.machine.H\n"
AT_ONE_BUS = "7,a,300,60,1.02,0,-50,80,4.5\n7,b,100,30,1.02,1,-10,20,\n20,,150,45,1.01,,,,\n"


def test_several_units_at_a_bus(case):
    ready, scaled = case(units=TWO + AT_ONE_BUS).prepare(
        ["plain", "shares"], {"units.alpha.7_a": 0.5}
    )
    assert set(ready.system.components) == {"grid", "sg7_a", "gfor7_a", "gfor7_b", "sg20", "gfor20"}
    v = ready.values
    assert (v["sg7_a.S_n"], v["gfor7_b.S_n"], v["sg7_a.machine.H"]) == (150, 100, 4.5)
    powers = ready.power_flow.powers
    assert powers["sg7_a"].imag == pytest.approx(powers["gfor7_b"].imag)  # pu of their ratings
    assert scaled.values["gfor20.S_n"] == pytest.approx(75)


def test_limits_of_reactive_power_of_several_units_hold_for_their_bus_together(case):
    text = CASE.replace(
        'grid = "grid"', 'grid = "grid"\nslack = "bus_20"\nreactive_limits = true', 1
    )
    (ready,) = case(text, TWO + AT_ONE_BUS.replace("80", "1").replace("20,\n", "2,\n")).prepare(
        ["plain"]
    )
    fed = sum(
        ready.power_flow.powers[n].imag * ready.values[f"{n}.S_n"] for n in ("sg7_a", "gfor7_b")
    )
    assert fed == pytest.approx(3)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (
            AT_ONE_BUS.replace("7,b", "7,a"),
            "units.csv: the bus of unit 7_a has more than one row; give each row of",
        ),
        (
            AT_ONE_BUS.replace("7,b", "7,"),
            "units.csv: the bus of unit 7 has more than one row; give each row of this",
        ),
        (
            AT_ONE_BUS.replace("7,b", "7,b 2"),
            "line 3: unit = 'b 2'; it becomes part of a name: use letters, digits",
        ),
        (
            AT_ONE_BUS.replace("b,100,30", "b,100,"),
            "units.csv, line 3: the unit at bus 7 has no p_mw; add the column",
        ),
    ],
)
def test_a_mistake_in_the_names_of_units(case, rows, words):
    assert any(words in problem for problem in problems(case(units=TWO + rows), ["plain"]))


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"units.alpha": 1.5}, "--set units.alpha: alpha = 1.5; it must be a number from 0 to 1"),
        (
            {"units.alpha.7": "half"},
            "--set units.alpha.7: alpha = 'half'; it must be a number from 0 to 1",
        ),
        ({"units.alpha.2": 0.5}, "--set units.alpha.2: there is no unit '2'; did you mean 20?"),
        (
            {"units.alpha.north": 0.5},
            "--set units.alpha.north: there is no unit 'north'; there are: 7, 20",
        ),
    ],
)
def test_a_share_that_cannot_be(case, overrides, words):
    assert problems(case(), ["plain"], overrides) == [words]


def test_a_line_named_from_its_other_end_is_recognised(case):
    words = "has no variable 'line_20_12.connected'; did you mean line_12_20.connected?"
    (problem,) = problems(case(), ["plain"], {"grid.line_20_12.connected": False})
    assert words in problem


@pytest.mark.parametrize(
    ("units", "words"),
    [
        (
            UNITS + "7,300,,1.4,,,,\n20,150,,,,,,\n",
            "units.csv, line 2: alpha = 1.4; it must be a number from 0 to 1",
        ),
        (
            UNITS + "7,300,,,,,,\n",
            "the source has generators at bus_20, where the case has no unit and no",
        ),
        (
            UNITS + ROWS + "12,100,,,,,,\n",
            "units.csv, line 4: the unit at bus 12 has no p_mw, v_pu; add the column",
        ),
        (
            UNITS + ROWS + "20,100,,,,,,\n",
            "the bus of unit 20 has more than one row; give each row of this bus a name",
        ),
        (
            UNITS + "7,300,,,,,,\n20,30,,,,,,\n",
            "line 3: the unit at bus 20 feeds 60 MW, more than its rating of 30",
        ),
        (
            UNITS + "7,0,,,,,,\n20,150,,,,,,\n",
            "line 2: the unit at bus 7 has a rating of 0 MVA; it must exceed 0",
        ),
        (UNITS + "7,many,,,,,,\n20,150,,,,,,\n", "line 2: rating_mva = 'many' is not a number"),
        (
            UNITS.replace("machine.H", "machine.J") + ROWS,
            "'sg7' has no variable 'machine.J'; did you mean machine.",
        ),
        (UNITS + ROWS.replace("4.5", "4.5 MW"), "machine.H: '4.5 MW' is in MW, but s is needed"),
    ],
)
def test_a_mistake_in_the_file(case, units, words):
    assert any(words in problem for problem in problems(case(units=units), ["plain"]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            ("matpower =", 'pandapower = "case9"\nmatpower ='),
            "give either 'matpower' or 'pandapower', not both",
        ),
        (
            ("small.m", "large.m"),
            "large.m: there is no such file; give the path of a MATPOWER case",
        ),
        (("stray_B = 0.05", "stray_B = -1"), "stray_B = -1 pu; it must not be negative"),
        (("frequency = ", "frequency = 0 # "), "network.frequency: it must be greater than 0"),
    ],
)
def test_a_mistake_in_the_network_table(case, change, words):
    text = CASE.replace(*change)
    assert text != CASE
    assert any(words in problem for problem in problems(case(text), ["plain"]))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "12  20  0.005  0.06",
            "12  20  0.005  0.0",
            "'line_12_20' has the reactance 0 pu between buses 'bus_12' and",
        ),
        ("99  4   0 ", "99  1   9 ", "no way leads"),
        ("7   3   0", "7   2   0", "the key 'slack' is missing; name a unit or a bus with one"),
    ],
)
def test_a_mistake_in_the_source(case, old, new, words):
    network = SMALL.replace(old, new)
    assert network != SMALL
    if new.startswith("99"):
        network = network.replace(
            "7   99  0.01   0.10  0.04  0 0 0  0      0    1",
            "7   99  0.01  0.10  0.04  0 0 0  0  0  0",
        )
    assert any(words in problem for problem in problems(case(network=network), ["plain"]))


def test_units_without_a_file_need_a_source(case):
    text = CASE.replace('file = "units.csv"\n', "").replace(
        'matpower = "small.m"', 'lines.l = { from = "a", to = "b", X = 1 }'
    )
    assert any(
        "the key 'file' is missing; without it the units" in problem
        for problem in problems(case(text), ["plain"])
    )


def test_a_share_of_a_unit_has_its_share_of_the_limits_of_power(case, monkeypatch):
    rows = unit_tables.unit_rows
    limits = {"p_min_mw": 40.0, "p_max_mw": 280.0}
    monkeypatch.setattr(
        unit_tables, "unit_rows", lambda *a: [replace(row, **limits) for row in rows(*a)]
    )
    found = case()._preparer("plain", None, ()).draft.active_limits
    assert (found["sg7"], found["gfor7"]) == (pytest.approx((36, 252)), pytest.approx((4, 28)))
