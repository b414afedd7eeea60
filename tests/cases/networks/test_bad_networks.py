"""What people mistype in networks and units: one problem each, with its place, the value seen, the rule and the remedy,
and nothing that only follows from it.
"""

import os
import re

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.catalogue_fmus import plan_fmu
from orchestrator.core.errors import CaseError
from orchestrator.studies.modes.modes import compute_modes
from tests.support.scenarios import prepare_one

CASE = """\
name = "three"
[solver]
step_size = "100 us"
stop_time = "2 s"
[power_flow]
grid = "grid"
slack = "bus_1"
[components.grid]
model = "grid"
[network]
frequency = "60 Hz"
buses = ["bus_1", "bus_2", "town"]
[network.lines]
east = { from = "bus_1", to = "town", X = 0.1, R = 0.01, B = 0.1 }
west = { from = "bus_2", to = "town", X = 0.1, R = 0.01, B = 0.1 }
[network.loads]
city = { bus = "town", p = "200 MW", q = "50 Mvar" }
[network.shunts]
bank = { bus = "town", b = "20 Mvar" }
[units]
file = "units.csv"
alpha = 0.25
generator = "synchronous_generator_st1"
converter = "gfor"
generator_parameters = { exciter.K_A = 150.0 }
[[events]]
type = "load_change"
time = "1 s"
load = "city"
scale = 1.05
[scenarios.base]
set = { "sg1.machine.H" = 5.0 }
"""
UNITS = """\
bus,rating_mva,p_mw,v_pu,q_min_mvar,q_max_mvar,sg.machine.H
1,250,100,1.02,-100,150,5
2,250,100,1.01,-100,150,4
"""

BAD = [
    pytest.param(
        UNITS,
        "1,250,100",
        "1,90,100",
        "line 21, units.file: units.csv, line 2: the unit at bus 1 feeds 100 MW, more than its rating of 90 M",
        id="rating",
    ),
    pytest.param(
        UNITS,
        "bus,rating",
        "node,rating",
        "line 21, units.file: units.csv: column bus is missing; it should hold bus",
        id="no_bus_column",
    ),
    pytest.param(
        UNITS,
        "rating_mva",
        "ratings_mva",
        "line 21, units.file: units.csv, line 1: nothing reads the column 'ratings_mva'; did you mean rating_",
        id="misspelt column",
    ),
    pytest.param(
        UNITS,
        "sg.machine.H",
        "gen.machine.H",
        "line 21, units.file: units.csv, line 1: nothing reads the column 'gen.machine.H'; there are bus, unit",
        id="unknown parameter prefix",
    ),
    pytest.param(
        UNITS,
        "sg.machine.H",
        "sg.machine.HH",
        "units.csv, line 2, sg1.machine.HH: component 'sg1' has no variable 'machine.HH'; did you mean machin",
        id="unknown parameter column",
    ),
    pytest.param(
        UNITS,
        "1,250,100",
        "1,250,nan",
        "line 21, units.file: units.csv, line 2: p_mw = 'nan' is not a number",
        id="nan power",
    ),
    pytest.param(
        UNITS,
        "1,250,100",
        "1,250 MVA,100",
        "line 21, units.file: units.csv, line 2: rating_mva = '250 MVA' is not a number",
        id="text rating",
    ),
    pytest.param(
        UNITS,
        "-100,150,5",
        "150,-100,5",
        "line 21, units.file: units.csv, line 2: the unit at bus 1 has q_min_mvar = 150, more than its q_max_",
        id="limits swapped",
    ),
    pytest.param(
        UNITS,
        "2,250,100,1.01",
        "1,250,100,1.02",
        "line 21, units.file: units.csv: the bus of unit 1 has more than one row; give each row of this bus a name of "
        "its own in the column 'unit', or merge the rows",
        id="two rows",
    ),
    pytest.param(
        UNITS,
        "2,250,100",
        "7,250,100",
        "units.csv, line 3: the unit at bus 7: the network has no bus 'bus_7'; did you mean bus_2 or bus_1?",
        id="unit at no bus",
    ),
    pytest.param(
        UNITS,
        "1.02,",
        "0,",
        "line 21, units.file: units.csv, line 2: the unit at bus 1 has v_pu = 0; it is in pu of the nominal v",
        id="zero voltage",
    ),
    pytest.param(
        UNITS,
        "1,250",
        "1,-250",
        "line 21, units.file: units.csv, line 2: the unit at bus 1 has a rating of -250 MVA; it must exceed 0",
        id="negative rating",
    ),
    pytest.param(
        UNITS,
        "150,5",
        "150,-5",
        "units.csv, line 2, sg1.machine.H: machine.H = -5 s; it must be at least 0.01 s",
        id="H negative",
    ),
    pytest.param(
        UNITS,
        "1,250,100",
        "1,250,",
        "line 21, units.file: units.csv, line 2: the unit at bus 1 has no p_mw; add the column, or take the n",
        id="power missing",
    ),
    pytest.param(
        UNITS,
        "1.02",
        "230",
        "line 21, units.file: units.csv, line 2: the unit at bus 1 has v_pu = 230; it is in pu of the nominal",
        id="voltage in kV",
    ),
    pytest.param(
        CASE,
        'p = "200 MW"',
        'p = "900 MW"',
        "line 5, power_flow: scenario 'base': power flow: no solution found. The iterations end with 149 MW o",
        id="slack overloaded",
    ),
    pytest.param(
        CASE,
        '"units.csv"',
        '"unit.csv"',
        "line 21, units.file: unit.csv: there is no such file; it should hold the columns bus",
        id="units file missing",
    ),
    pytest.param(
        CASE,
        "alpha = 0.25",
        "alpha = 2",
        "line 22, units.alpha: it must be less than or equal to 1 (value seen: 2)",
        id="alpha 2",
    ),
    pytest.param(
        CASE,
        "generator_st1",
        "generator_st2",
        "line 23, units.generator: there is no model 'synchronous_generator_st2'; did you mean synchronous_ge",
        id="generator misspelt",
    ),
    pytest.param(
        CASE,
        "exciter.K_A",
        "exciter.KA",
        "line 25, units.generator_parameters.exciter.KA: component 'sg1' has no variable 'exciter.KA'; did yo",
        id="parameter of nobody",
    ),
    pytest.param(
        CASE,
        "K_A = 150.0",
        "K_A = 0.0",
        "line 25, units.generator_parameters.exciter.K_A: exciter.K_A = 0 pu; it must be at least 1 pu",
        id="gain below least",
    ),
    pytest.param(
        CASE,
        "exciter.K_A = 150.0",
        "f_n = 50.0",
        "line 25, units.generator_parameters.f_n: sg1 is rated at 50 Hz and grid at 60 Hz; what is coupled ha",
        id="frequency of one machine",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"sg1.Q_0" = 0.1',
        'line 32, scenarios.base.set."sg1.Q_0": sg1: Q_0 = 0.1 pu and v_0 = 1.02 pu are both set, and the ',
        id="Q_0 set",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"gfor2.theta_0" = 0.1',
        'line 32, scenarios.base.set."gfor2.theta_0": gfor2: theta_0 cannot be set, because the power flow co',
        id="theta_0 set",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H"',
        '"gen*.machine.H"',
        "line 32, scenarios.base.set.\"gen*.machine.H\": there is no component 'gen*'; the case has: grid, sg1,",
        id="pattern fits nothing",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H"',
        '"g*.machine.HH"',
        "line 32, scenarios.base.set.\"g*.machine.HH\": no component that fits 'g*' has a variable 'machine.HH'",
        id="pattern without variable",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"units.alpha.9" = 0.1',
        "line 32, scenarios.base.set.\"units.alpha.9\": there is no unit '9'; there are: 1, 2",
        id="alpha of no unit",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"units.alpha" = "half"',
        "line 32, scenarios.base.set.\"units.alpha\": alpha = 'half'; it must be a number from 0 to 1",
        id="alpha as text",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"sg1.S_n" = -5',
        'line 32, scenarios.base.set."sg1.S_n": S_n = -5 MVA; it must be at least 0.001 MVA',
        id="rating by set negative",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"sg2.P_0" = 5',
        'line 32, scenarios.base.set."sg2.P_0": P_0 = 5 pu; it must be at most 2 pu',
        id="power by set too large",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"sg1.S_n" = "5 kV"',
        "line 32, scenarios.base.set.\"sg1.S_n\": S_n: '5 kV' is in kV, but MVA is needed",
        id="unit of voltage",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"sg1.v_0" = 1.1',
        "line 5, power_flow: scenario 'base': power flow: bus 'bus_1' cannot have two voltages (sg1 wants 1.1",
        id="two voltages",
    ),
    pytest.param(
        CASE,
        '"sg1.machine.H" = 5.0',
        '"grid.west.connected" = false',
        "line 5, power_flow: scenario 'base': power flow: no way leads to the slack bus 'bus_1' from: 'bus_2'",
        id="line opened to an island",
    ),
    pytest.param(
        CASE,
        'to = "town", X = 0.1, R = 0.01, B = 0.1 }\nwest',
        'to = "town", X = 0.0, R = 0.01, B = 0.1 }\nwest',
        "line 10, network: network 'three_grid': line 'east' has the reactance 0 pu between buses 'bus_1' and",
        id="reactance zero",
    ),
    pytest.param(
        CASE,
        "R = 0.01, B = 0.1 }\nwest",
        "R = -0.01, B = 0.1 }\nwest",
        "line 10, network: network 'three_grid': line 'east' has the resistance -0.01 pu between buses 'bus_1",
        id="resistance negative",
    ),
    pytest.param(
        CASE,
        "B = 0.1 }\nwest",
        "B = 0.1, tap = 0 }\nwest",
        "line 10, network: network 'three_grid': line 'east' has the ratio 0 between buses 'bus_1' and 'town'",
        id="ratio zero",
    ),
    pytest.param(
        CASE,
        'city = { bus = "town"',
        'city = { bus = "village"',
        "line 10, network: network 'three_grid': load 'city' is at bus 'village', which does not exist",
        id="load at no bus",
    ),
    pytest.param(
        CASE,
        '"200 MW"',
        '"200 kV"',
        "line 17, network.loads.city.p: '200 kV' is in kV, but MW is needed (value seen: '200 kV')",
        id="load in kV",
    ),
    pytest.param(
        CASE,
        'bank = { bus = "town"',
        'bank = { bus = "twn"',
        "line 10, network: network 'three_grid': shunt 'bank' is at bus 'twn', which does not exist",
        id="shunt at no bus",
    ),
    pytest.param(
        CASE,
        "bank =",
        "city =",
        "line 10, network: network 'three_grid': the name 'city' is used twice",
        id="names twice",
    ),
    pytest.param(
        CASE,
        '"60 Hz"',
        '"60 kV"',
        "line 11, network.frequency: '60 kV' is in kV, but Hz is needed (value seen: '60 kV')",
        id="frequency in kV",
    ),
    pytest.param(
        CASE,
        '"60 Hz"',
        '"-60 Hz"',
        "line 11, network.frequency: it must be greater than 0 (value seen: '-60 Hz')",
        id="frequency negative",
    ),
    pytest.param(
        CASE,
        '"town"]',
        '"town", "lost"]',
        "line 10, network: network 'three_grid': bus 'lost' has neither a load with P > 0 nor line charging,",
        id="unconnected bus",
    ),
    pytest.param(
        CASE,
        'frequency = "60 Hz"',
        'matpower = "net.m"',
        "line 11, network.matpower: net.m: there is no such file; give the path of a MATPOWER case (.m or .ma",
        id="source missing",
    ),
    pytest.param(
        CASE,
        'slack = "bus_1"',
        'slack = "bus_12"',
        "line 7, power_flow.slack: 'bus_12' is neither a unit of this scenario nor a bus with one; did you mean",
        id="slack unknown",
    ),
    pytest.param(
        CASE,
        'slack = "bus_1"\n',
        "",
        "line 5, power_flow: the key 'slack' is missing; name a unit or a bus with one that feeds what is lef",
        id="slack missing",
    ),
    pytest.param(
        CASE,
        'slack = "bus_1"',
        'slack = "town"',
        "line 7, power_flow.slack: 'town' is neither a unit of this scenario nor a bus with one; units: sg1,",
        id="slack without unit",
    ),
    pytest.param(
        CASE,
        '[power_flow]\ngrid = "grid"',
        '[power_flow]\ngrid = "net"',
        "line 6, power_flow.grid: there is no component 'net'; the case has: grid, sg1, sg2, gfor1, gfor2",
        id="grid unknown",
    ),
    pytest.param(
        CASE,
        'slack = "bus_1"',
        'slack = "bus_1"\nreactive_limits = "yes"',
        "line 8, power_flow.reactive_limits: it must be a valid boolean (value seen: 'yes')",
        id="limits as text",
    ),
    pytest.param(
        CASE,
        '[power_flow]\ngrid = "grid"\nslack = "bus_1"\n',
        "",
        "line 17, units: a bus needs a [power_flow] table whose grid is a model with a network; or use [[conn",
        id="no power flow",
    ),
    pytest.param(
        CASE,
        'load = "city"',
        'load = "cty"',
        "line 26, events.0: component 'grid' has no load 'cty'; did you mean city?",
        id="event on no load",
    ),
    pytest.param(
        CASE,
        'time = "1 s"',
        'time = "-1 s"',
        "line 28, events.0.time: it must be greater than or equal to 0 s (value seen: -1.0 s)",
        id="event before the start",
    ),
    pytest.param(
        CASE,
        "scale = 1.05\n",
        "",
        "line 26, events.0.scale: this key is missing; add it",
        id="event without scale",
    ),
    pytest.param(
        CASE,
        '"100 us"',
        '"0 us"',
        "line 3, solver.step_size: it must be greater than 0 s (value seen: 0.0 s)",
        id="step of zero",
    ),
    pytest.param(
        CASE,
        '"load_change"',
        '"load_chnge"',
        "line 26, events.0: type 'load_chnge' is unknown; did you mean load_change or ",
        id="kind of event",
    ),
]


@pytest.fixture
def problems(tmp_path):
    """The problems of the case with one text replaced by another."""

    def found(where, old, new):
        assert old in where
        for name, text in (("case.toml", CASE), ("units.csv", UNITS)):
            (tmp_path / name).write_text(
                text.replace(old, new, 1) if text is where else text, encoding="utf-8"
            )
        with pytest.raises(CaseError) as caught:
            load_case(tmp_path / "case.toml").prepare()
        return [
            str(problem).replace(f"{tmp_path}{os.sep}", "") for problem in caught.value.problems
        ]

    return found


@pytest.mark.parametrize(("where", "old", "new", "said"), BAD)
def test_one_mistake_gives_one_problem(problems, where, old, new, said):
    (problem,) = problems(where, old, new)
    assert problem.startswith(said)


@pytest.mark.parametrize(
    ("where", "old", "new", "said"),
    [
        pytest.param(
            CASE,
            "slack =",
            "slak =",
            ["slak: this key is unknown", "'slack' is missing"],
            id="slack",
        ),
        pytest.param(
            CASE,
            "generator =",
            "generater =",
            ["generator: this key is missing", "generater: this key is unknown"],
            id="generator",
        ),
        pytest.param(
            CASE,
            "X = 0.1, R = 0.01, B = 0.1 }\nwest",
            "x = 0.1, R = 0.01, B = 0.1 }\nwest",
            ["lines.east.X: this key is missing", "lines.east.x: this key is unknown"],
            id="reactance",
        ),
    ],
)
def test_a_misspelt_key_is_unknown_and_missing(problems, where, old, new, said):
    found = problems(where, old, new)
    assert len(found) == 2
    assert all(any(text in problem for problem in found) for text in said)


@pytest.mark.parametrize(
    ("where", "old", "new", "said"),
    [
        pytest.param(
            UNITS,
            "150,4",
            "150,6500",
            "units.csv, line 3, sg2.machine.H: sg2: machine.H = 6500 s is",
            id="inertia in MWs",
        ),
        pytest.param(
            CASE,
            "B = 0.1 }\nwest",
            "B = 0.1, shift = 30 }\nwest",
            "line 14, network.lines.east.shift: grid: shift_east = 30 rad is",
            id="degrees",
        ),
        pytest.param(
            UNITS,
            "1.02,-100,150",
            "1.02,-100,3",
            "line 5, power_flow: limits of reactive",
            id="Qmax",
        ),
    ],
)
def test_what_can_be_meant_is_asked(tmp_path, where, old, new, said):
    for name, text in (("case.toml", CASE), ("units.csv", UNITS)):
        (tmp_path / name).write_text(
            text.replace(old, new, 1) if text is where else text, encoding="utf-8"
        )
    ready = prepare_one(tmp_path / "case.toml")
    asked = [str(question).replace(f"{tmp_path}{os.sep}", "") for question in ready.questions]
    assert any(question.startswith(said) for question in asked), asked


def test_a_pattern_fits_what_has_the_variable(tmp_path):
    """`g*` fits the grid and the converters; only the converters have a droop."""
    text = CASE.replace('"sg1.machine.H" = 5.0', '"g*.droop.R_f" = 0.04')
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    (tmp_path / "units.csv").write_text(UNITS, encoding="utf-8")
    ready = prepare_one(tmp_path / "case.toml")
    assert {n: x for n, x in ready.values.items() if n.endswith("R_f")} == {
        "gfor1.droop.R_f": 0.04,
        "gfor2.droop.R_f": 0.04,
    }


def test_nothing_is_compiled_where_the_power_flow_fails(tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    text = CASE.replace('"200 MW"', '"1200 MW"').replace('"three"', '"fails"')
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    (tmp_path / "units.csv").write_text(UNITS, encoding="utf-8")
    plan_fmu.cache_clear()
    try:
        with pytest.raises(CaseError, match="no solution found"):
            load_case(tmp_path / "case.toml").prepare()
    finally:
        plan_fmu.cache_clear()
    assert not list((tmp_path / "cache").rglob("*.fmu"))


def test_a_component_that_cannot_start_is_named_with_its_row(tmp_path):
    """The converter's share of the reactive power at its bus exceeds its current limit."""
    text = CASE.replace('q = "50 Mvar"', 'q = "330 Mvar"').replace('"200 MW"', '"120 MW"')
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    (tmp_path / "units.csv").write_text(UNITS.replace("1,250,100", "1,140,100"), encoding="utf-8")
    ready = prepare_one(tmp_path / "case.toml")
    with pytest.raises(CaseError) as caught:
        compute_modes(ready)
    (problem,) = caught.value.problems
    assert re.search(r"units\.csv, line 2$", problem.place)
    assert re.match(
        r"scenario 'base': gfor1 cannot start: the power flow asks for more reactive current than .*; the power flow "
        r"asks it for P_0 = [\d.]+ and Q_0 = [\d.]+ pu of S_n = 35 MVA at v = 1\.02 pu",
        problem.text,
    )
    assert "fmi2" not in str(caught.value)
    assert "rating_mva" not in problem.text  # a rating is data, and no remedy
