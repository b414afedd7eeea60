"""Case files: all mistakes in one report with line and remedy, and what a good file comes down to."""

import cmath
import re
import shutil

import pytest

from orchestrator.cases.case import built_in_cases, load_case
from orchestrator.core.errors import CaseError, InputError
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.systems.coupling.events import LoadChange, ParameterChange
from orchestrator.systems.coupling.master import Master
from tests.support.scenarios import prepare_one
from tests.systems.coupling.small_fmus import small_fmu

LOOP = """\
name = "loop"
[solver]
step_size = "1 ms"
stop_time = "20 ms"
record_interval = "2 ms"
[components.x]
fmu = "fmus/x.fmu"
[components.k]
fmu = "fmus/k.fmu"
parameters = { K = -3.0 }
[[connections]]
from = "x.y"
to = "k.u"
[[connections]]
from = "k.y"
to = "x.u"
"""

THREE_BUSES = """\
name = "three"
[solver]
stop_time = "0.1 s"
[power_flow]
grid = "grid"
slack = "sg"
[network]
buses = ["b1", "b2", "b3"]
lines.l12 = { from = "b1", to = "b2", X = 0.02, B = 0.02 }
lines.l23 = { from = "b2", to = "b3", X = 0.02, R = 0.002, B = 0.02 }
loads.d3 = { bus = "b3", p = "0.9 GW", q = "100 Mvar" }
[components.sg]
model = "synchronous_generator_st1"
bus = "b1"
parameters.S_n = "1000 MVA"
[components.vsc]
model = "gfor"
bus = "b2"
parameters = { S_n = "500 MVA", P_0 = 0.8, v_0 = 1.01 }
[components.grid]
model = "grid"
"""


@pytest.fixture
def written(tmp_path):
    """Write a case file beside its FMUs, and read it."""
    (tmp_path / "fmus").mkdir()
    shutil.copy(small_fmu("integrator").path, tmp_path / "fmus" / "x.fmu")
    shutil.copy(small_fmu("gain").path, tmp_path / "fmus" / "k.fmu")

    def write(text):
        path = tmp_path / "case.toml"
        path.write_text(text, encoding="utf-8")
        return load_case(path)

    return write


def problems_of(prepare, *arguments, **keywords):
    with pytest.raises(CaseError) as caught:
        prepare(*arguments, **keywords)
    assert caught.value.exit_code == 2
    problems = [str(problem) for problem in caught.value.problems]
    assert len(set(problems)) == len(problems)
    for problem in problems:
        assert f"  - {problem}" in str(caught.value)
    return problems


def the_problem(prepare, *arguments, **keywords):
    (problem,) = problems_of(prepare, *arguments, **keywords)
    return problem


# -- files that cannot be used ---------------------------------------------------------------------

FAULTY = """\
name = "faulty"
[solver]
step_size = "1 ms"
stop_time = "20 MW"
colour = "red"
[components.x]
fmu = "fmus/x.fmu"
parameters = { gian = 2 }
[components.k]
fmu = "fmus/k.fmu"
[components.k.parameters]
K = 700
offset = "5 MW"
[components.lost]
fmu = "fmus/none.fmu"
[components.what]
model = "gfro"
[[connections]]
from = "x.y"
to = "k.u"
[[connections]]
from = "k.y"
to = "k.K"
[[connections]]
from = "lost.y"
to = "x.z"
[[events]]
type = "parameter_change"
time = 0.0025
component = "k"
parameter = "K"
value = 1
[[events]]
type = "parameter_change"
time = 0.003
component = "k"
parameter = "offset"
value = 1
[scenarios.first]
remove = ["nobody"]
[scenarios.second]
set = { "k.y" = 1, "z.y" = 2 }
"""


def test_all_mistakes_of_a_file_come_in_one_report_with_line_and_remedy(written, tmp_path):
    problems = problems_of(written(FAULTY).prepare)
    expected = [
        r"line 4, solver\.stop_time: '20 MW' is in MW, but s is needed",
        r"line 5, solver\.colour: this key is unknown; check its spelling, or remove it",
        r"line 8, components\.x\.parameters\.gian: component 'x' has no variable 'gian'; did you mean gain\?",
        r"line 12, components\.k\.parameters\.K: K = 700; it must be at most 100",
        r"line 13, components\.k\.parameters\.offset: offset: '5 MW' is in MW, but",
        rf"line 14, components\.lost: {re.escape(str(tmp_path))}.*none\.fmu: there is no such file; give the path",
        r"line 17, components\.what\.model: there is no model 'gfro'; did you mean gfor",
        r"line 21, connections\.1: connection k\.y → k\.K: k\.K is of causality parameter; .* ends at an input",
        r"line 6, components\.x: scenario 'first': nothing feeds the input x\.u; connect it, or give it a constant",
        r"line 27, events\.0: the event at 0\.0025 s is not a communication point; .* nearest is 0\.002 s",
        r"line 33, events\.1: k\.offset is a fixed parameter; only tunable parameters and open inputs can change",
        r"line 40, scenarios\.first\.remove: there is no component 'nobody' to remove",
        r"""line 42, scenarios\.second\.set\."k\.y": y is of causality output; only parameters and inputs can be set""",
        r"""line 42, scenarios\.second\.set\."z\.y": there is no component 'z'; the case has: x, k, lost, what""",
    ]
    for pattern in expected:
        assert [p for p in problems if re.match(pattern, p)], (pattern, problems)
    unnamed = [p for p in problems if not any(re.match(pattern, p) for pattern in expected)]
    assert unnamed == ["line 6, components.x: scenario 'second': " + text_of_open_input("x.u")]


def text_of_open_input(name):
    return f"nothing feeds the input {name}; connect it, or give it a constant under 'inputs'"


def test_the_report_opens_with_the_file_and_the_number_of_problems(written, tmp_path):
    case = written(LOOP.replace("K = -3.0", "K = -300, offset = 11"))
    with pytest.raises(CaseError) as caught:
        case.prepare()
    assert str(caught.value).splitlines() == [
        f"{tmp_path / 'case.toml'}: 2 problems",
        "  - line 10, components.k.parameters.K: K = -300; it must be at least -100",
        "  - line 10, components.k.parameters.offset: offset = 11; it must be at most 10",
    ]


def test_a_file_that_is_not_toml_is_refused_with_the_line(written):
    with pytest.raises(InputError, match=r"case\.toml: it is not a TOML file: .*line 2"):
        written('name = "x"\n[components\n')


def test_a_file_that_is_not_text(tmp_path):
    (tmp_path / "case.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="it is not a TOML file"):
        load_case(tmp_path / "case.toml")


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError) as caught:
        load_case(tmp_path / "none.toml")
    text = "there is no such file, nor a built-in case of that name; built-in: " + ", ".join(
        built_in_cases()
    )
    assert str(caught.value) == f"{tmp_path / 'none.toml'}: {text}"
    assert "two_area" in built_in_cases()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["name: this key is missing; add it", "components: this key is missing; add it"]),
        ('name = "x"\n', ["components: this key is missing; add it"]),
    ],
)
def test_a_file_without_what_nothing_can_be_checked_without(written, text, expected):
    assert problems_of(written, text) == expected


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"1 ms"', "0", "line 3, solver.step_size: it must be greater than 0 s (value seen: 0 s)"),
        (
            '"1 ms"',
            "1",
            "line 3, solver.step_size: it must be less than or equal to 0.1 s (value seen: 1 s)",
        ),
        (
            'to = "k.u"',
            'to = "k.u"\nvia = "z"',
            "line 14, connections.0.via: this key is unknown; check its spelling",
        ),
        ('fmu = "fmus/k.fmu"', "", "line 8, components.k: give either 'model'"),
        (
            "K = -3.0",
            'K = "minus"',
            "line 10, components.k.parameters.K: K: 'minus' is not a number with a unit",
        ),
        (
            "K = -3.0",
            "K = true",
            "line 10, components.k.parameters.K: K = true; it must be a number",
        ),
        (
            "K = -3.0",
            "K = nan",
            "line 10, components.k.parameters.K: K = nan; it must be a finite number",
        ),
        (
            "K = -3.0",
            "y = 1",
            "line 10, components.k.parameters.y: y is of causality output; only parameters and",
        ),
        (
            "K = -3.0 }",
            'K = -3.0 }\nbus = "b"',
            "line 11, components.k.bus: a bus needs a [power_flow] table",
        ),
        (
            '"20 ms"',
            '"20.5 ms"',
            "line 4, solver.stop_time: the stop at 0.0205 s is not a communication point",
        ),
    ],
)
def test_one_mistake(written, old, new, problem):
    text = LOOP.replace(old, new)
    assert text != LOOP
    case = written(text)
    found = problems_of(case.prepare)
    assert found[0].startswith(problem)
    # of a component that is not there
    consequences = [p for p in found[1:] if "nothing feeds" not in p]
    assert consequences == []


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('to = "k.u"', 'to = "k.uu"', "has no variable 'uu'"),
        ('to = "k.u"', 'to = "k.y"', "k.y is of causality output"),
        ('from = "x.y"', 'from = "x.yy"', "has no variable 'yy'"),
    ],
)
def test_a_refused_connection_is_one_problem(written, old, new, problem):
    text = LOOP.replace(old, new)
    assert text != LOOP
    assert problem in the_problem(written(text).prepare)


def test_a_refused_value_of_an_input_is_one_problem(written):
    text = LOOP.replace("K = -3.0 }", 'K = -3.0 }\ninputs = { u = "1 kV" }').replace(
        'to = "k.u"', 'to = "x.u"'
    )
    found = problems_of(written(text).prepare)
    assert "inputs.u: u: '1 kV' is in kV" in found[0]
    assert not [p for p in found if text_of_open_input("k.u") in p]


EVENT = '[[events]]\ntype = "parameter_change"\ntime = 0.01\ncomponent = "k"\nparameter = "K"\nvalue = 2\n'


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"k"', '"z"', "line 17, events.0: there is no component 'z'"),
        (
            '"K"',
            '"Q"',
            "line 17, events.0: component 'k' has no variable 'Q' for this event to set",
        ),
        ('"K"', '"y"', "line 17, events.0: k.y is "),
        ("value = 2", "value = 200", "line 17, events.0: K = 200; it must be at most 100"),
        (
            '"parameter_change"',
            '"explosion"',
            "line 17, events.0: type 'explosion' is unknown; did you mean line_reclosing? choose from",
        ),
        ("value = 2\n", "", "line 17, events.0.value: this key is missing; add it"),
    ],
)
def test_one_mistake_in_an_event(written, old, new, problem):
    text = EVENT.replace(old, new)
    assert text != EVENT
    assert the_problem(lambda: written(LOOP + text).prepare()).startswith(problem)


@pytest.mark.parametrize(
    "event", [EVENT.replace("value = 2", ""), EVENT.replace('"parameter_change"', '"explosion"')]
)
def test_a_wrong_event_does_not_hide_the_other_mistakes(written, event):
    problems = problems_of(lambda: written(LOOP.replace("K = -3.0", "K = -300") + event).prepare())
    assert [re.match(r"line \d+", problem).group() for problem in problems] == [
        "line 17",
        "line 10",
    ]


def test_a_wrong_value_of_a_key_that_must_be_there_is_one_problem(written):
    problem = the_problem(
        lambda: written(LOOP + EVENT.replace("time = 0.01", "time = -1")).prepare()
    )
    assert problem.startswith("line 19, events.0.time: it must be greater than or equal to 0")


def test_the_value_of_an_event_may_have_a_unit(written):
    (ready,) = written(LOOP + EVENT.replace("value = 2", 'value = "50 %"')).prepare()
    assert ready.events[0].settings() == {"K": 0.5}


def test_the_value_of_an_event_that_is_not_a_number(written):
    assert "line 17, events.0" in the_problem(
        written(LOOP + EVENT.replace("value = 2", 'value = "two"')).prepare
    )


def test_an_event_on_an_input_that_something_feeds(written):
    assert "x.y" in the_problem(written(LOOP + EVENT.replace('"K"', '"u"')).prepare)


@pytest.mark.parametrize(("old", "new"), [('"20 ms"', "inf"), ("time = 0.01", "time = inf")])
def test_an_infinite_time(written, old, new):
    problems_of(written((LOOP + EVENT).replace(old, new)).prepare)


def test_a_wrong_name_in_the_schedule_is_a_problem_of_the_file(written):
    case = written(LOOP.replace("[components.x]", 'groups = [["x"], ["kk"]]\n[components.x]', 1))
    assert the_problem(case.prepare).startswith("line 6, solver.groups")


def test_unknown_scenarios_and_overrides_are_reported(written):
    case = written(LOOP)
    assert (
        the_problem(case.prepare, ["z"])
        == "--scenario: there is no scenario 'z'; the case has: loop"
    )
    assert problems_of(case.prepare, (), {"k.G": 1.0, "z.K": 1.0, "k.K": "1 MW"}) == [
        "--set k.G: component 'k' has no variable 'G'; "
        f"`gfor fmu info {case.path.parent / 'fmus' / 'k.fmu'}` lists them",
        "--set z.K: there is no component 'z'; the case has: x, k",
        "--set k.K: K: '1 MW' is in MW, but a plain number is needed",
    ]


# -- files that can --------------------------------------------------------------------------------


def run(ready):
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        master.run(ready.stop_time, ready.events)
        return {name: component.get(["y"])["y"] for name, component in master.components.items()}


def test_fmus_of_ones_own_are_found_beside_the_case_file(written, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path.parent)
    (ready,) = written(LOOP.replace("fmus/x.fmu", "./fmus/x.fmu")).prepare()
    assert ready.system.components["x"].description.path == tmp_path / "fmus" / "x.fmu"
    assert [str(c.source) + " " + str(c.target) for c in ready.system.connections] == [
        "x.y k.u",
        "k.y x.u",
    ]
    assert (ready.name, ready.step_size, ready.stop_time, ready.record_every) == (
        "loop",
        0.001,
        0.02,
        2,
    )
    assert ready.record == ("x.y", "k.y")
    assert ready.power_flow is None
    assert ready.values == {"k.K": -3.0}
    assert ready.schedule.groups == (("x",), ("k",))


def test_an_absolute_path_is_taken_as_it_is(written):
    (ready,) = written(LOOP.replace("fmus/x.fmu", str(small_fmu("integrator").path))).prepare()
    assert ready.system.components["x"].description.path == small_fmu("integrator").path


@pytest.mark.parametrize(
    ("schedule", "powers"), [("gauss-seidel", (1 - 3e-3, 20)), ("jacobi", None)]
)
def test_the_schedule_of_the_file_is_the_one_that_runs(written, schedule, powers):
    text = LOOP.replace("[components.x]", f'schedule = "{schedule}"\n[components.x]', 1)
    (ready,) = written(text.replace("x.fmu", 'x.fmu"\nparameters.x_0 = 2 # ', 1)).prepare()
    assert ready.schedule.name == schedule
    x, y = 2.0, -6.0
    for _ in range(20):
        new = x + 1e-3 * y
        y = -3 * (x if schedule == "jacobi" else new)
        x = new
    if powers:
        assert x == pytest.approx(2 * powers[0] ** powers[1], abs=1e-12)
    assert ready.schedule.groups == ((("x", "k"),) if schedule == "jacobi" else (("x",), ("k",)))
    assert run(ready) == pytest.approx({"x": x, "k": y}, abs=1e-12)


def test_step_and_stop_go_before_the_files(written):
    (ready,) = written(LOOP).prepare(step_size=5e-4, stop_time=0.003)
    assert (ready.step_size, ready.stop_time, ready.record_every) == (5e-4, 0.003, 4)


def test_patterns_choose_what_is_recorded(written):
    (ready,) = written(
        LOOP.replace("[components.x]", 'record = ["k.*", "*.q"]\n[components.x]', 1)
    ).prepare()
    assert ready.record == ("k.y",)


SCENARIOS = """\
[scenarios.all]
[scenarios.alone]
title = "x alone"
remove = ["k"]
set = { "x.u" = 5, "x.gain" = 2 }
[scenarios.other]
set = { "k.K" = 4 }
events = [{ type = "parameter_change", time = "4 ms", component = "x", parameter = "gain", value = 9 }]
"""


def test_what_scenarios_change(written):
    ready = {r.name: r for r in written(LOOP + EVENT + SCENARIOS).prepare()}
    assert list(ready) == ["all", "alone", "other"]
    assert ready["all"].title == "all"
    assert ready["all"].events == (ParameterChange(0.01, "k", "K", 2.0),)
    alone = ready["alone"]
    assert alone.title == "x alone"
    assert list(alone.system.components) == ["x"]
    assert alone.system.components["x"].inputs == {"u": 5.0}
    assert alone.values == {"x.gain": 2.0}
    assert (alone.system.connections, alone.events) == ([], ())
    assert run(alone) == pytest.approx({"x": 5 * 2 * 0.02}, abs=1e-12)
    assert ready["other"].values == {"k.K": 4.0}
    assert ready["other"].events == (ParameterChange(0.004, "x", "gain", 9.0),)
    assert "k.K" in ready["all"].values


def test_scenarios_are_prepared_in_the_order_that_is_asked_for(written):
    case = written(LOOP + SCENARIOS)
    assert [r.name for r in case.prepare(["other", "all"])] == ["other", "all"]


def test_a_later_source_of_a_value_goes_before_an_earlier_one(written):
    (ready,) = written(LOOP + SCENARIOS).prepare(["other"], {"k.K": 8.0, "x.x_0": "1"})
    assert ready.values == {"k.K": 8.0, "x.x_0": 1.0}


def test_an_override_for_a_removed_component_is_left_out_of_that_scenario_only(written):
    ready = {r.name: r.values for r in written(LOOP + SCENARIOS).prepare(overrides={"k.K": 7.0})}
    assert ready == {"all": {"k.K": 7.0}, "alone": {"x.gain": 2.0}, "other": {"k.K": 7.0}}


def test_a_pattern_sets_every_component_that_fits(written):
    text = LOOP.replace(
        "components.x]", "components.k2]\nfmu = 'fmus/k.fmu'\ninputs.u = 1\n[components.x]", 1
    )
    (ready,) = written(text).prepare(overrides={"k*.K": 6.0})
    assert ready.values == {"k.K": 6.0, "k2.K": 6.0}


def test_events_after_the_stop_are_left_out(written):
    (ready,) = written(LOOP + EVENT).prepare(stop_time=0.01)
    assert ready.events == ()


# -- networks --------------------------------------------------------------------------------------


def test_a_network_of_ones_own_starts_in_steady_state(written):
    (ready,) = written(THREE_BUSES).prepare()
    assert ready.schedule.groups == (("sg", "vsc"), ("grid",))
    flow, plans = ready.power_flow, ready.system.components
    assert flow.residual <= 1e-9
    assert flow.powers["vsc"].real == 0.8
    assert abs(flow.voltages["b1"]) == pytest.approx(1.0, abs=1e-9)
    assert abs(flow.voltages["b2"]) == pytest.approx(1.01, abs=1e-9)
    losses = flow.powers["sg"].real * 10 + 4 - 9
    through = abs((flow.voltages["b2"] - flow.voltages["b3"]) / complex(0.002, 0.02))
    assert losses == pytest.approx(0.002 * through**2, abs=1e-9)
    for bus, voltage in flow.voltages.items():
        assert plans["grid"].parameters[f"{bus}.theta_0"] == pytest.approx(cmath.phase(voltage))
    assert plans["vsc"].parameters["Q_0"] == pytest.approx(flow.powers["vsc"].imag)
    assert {str(c.source) for c in ready.system.connections if c.target.component == "vsc"} == {
        "grid.b2.v_re",
        "grid.b2.v_im",
    }
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        point = find_operating_point(master)
        assert point.initial_residual <= 1e-9
        assert point.residual <= 1e-9
        assert master.components["vsc"].get(["p"])["p"] == pytest.approx(0.8, abs=1e-9)
        master.run(0.1)
        assert master.components["vsc"].get(["p"])["p"] == pytest.approx(0.8, abs=1e-7)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'slack = "sg"',
            'slack = "b3"',
            "line 6, power_flow.slack: 'b3' is neither a unit of this scenario nor a bus",
        ),
        ('grid = "grid"', 'grid = "net"', "line 5, power_flow.grid: there is no component 'net'"),
        (
            'bus = "b3"',
            'bus = "b4"',
            "line 7, network: network 'three_grid': load 'd3' is at bus 'b4', which does not",
        ),
        (
            "X = 0.02, B",
            "X = 0, B",
            "line 7, network: network 'three_grid': line 'l12' has the reactance 0 pu",
        ),
        (
            'bus = "b2"',
            'bus = "b9"',
            "line 7, network: network 'three_grid': port 'vsc' is at bus 'b9'",
        ),
        (
            '"0.9 GW"',
            '"9 GW"',
            "line 4, power_flow: scenario 'three': power flow: no solution found",
        ),
        (
            "P_0 = 0.8",
            "P_0 = 0.8, Q_0 = 0.1",
            "line 19, components.vsc.parameters.Q_0: vsc: Q_0 = 0.1 pu and v_0 = ",
        ),
        (
            'S_n = "1000 MVA"',
            'S_n = "100 MVA"',
            "line 4, power_flow: scenario 'three': sg would have to feed P_0 = ",
        ),
        (
            'p = "0.9 GW"',
            'p = "0.9 pu"',
            "line 11, network.loads.d3.p: '0.9 pu' is in pu, but MW is needed",
        ),
    ],
)
def test_one_mistake_in_a_network(written, old, new, words):
    text = THREE_BUSES.replace(old, new)
    assert text != THREE_BUSES
    assert problems_of(lambda: written(text).prepare())[0].startswith(words)


def test_all_units_beyond_what_they_can_be_asked_for_are_told(written):
    text = THREE_BUSES.replace('S_n = "1000 MVA"', 'S_n = "100 MVA"').replace(
        'S_n = "500 MVA"', 'S_n = "5 MVA"'
    )
    (told,) = problems_of(lambda: written(text).prepare())
    assert "sg would have to feed P_0 = " in told
    assert "; so would vsc (Q_0 = " in told


def test_a_line_to_a_bus_that_is_not_in_the_list(written):
    text = THREE_BUSES.replace('to = "b3"', 'to = "b4"')
    assert any("'b4'" in problem for problem in problems_of(written(text).prepare))


def test_units_at_one_bus_must_want_one_voltage(written):
    text = THREE_BUSES.replace('bus = "b2"', 'bus = "b1"')
    problem = the_problem(written(text).prepare)
    assert (
        "bus 'b1' cannot have two voltages (sg wants 1, vsc wants 1.01); give its units the same v_0"
        in problem
    )


# -- the built-in case -----------------------------------------------------------------------------


def angle(**overrides):
    ready = prepare_one(
        "two_area", "gfor", {k.replace("__", ".", 1): v for k, v in overrides.items()}
    )
    return ready.values["sg1.theta_0"] - ready.values["sg2.theta_0"], ready


def test_an_override_moves_the_power_flow():
    """1 pu crosses a lossless line between two buses at 1 pu: sin θ = X."""
    for X in (0.1, 0.3):
        theta, ready = angle(grid__X_L=X)
        assert cmath.sin(theta).real == pytest.approx(X, abs=1e-9)
        assert ready.values["grid.X_L"] == X
        assert (
            ready.values["gfor.theta_0"]
            == ready.values["sg1.theta_0"]
            == ready.values["grid.bus_2.theta_0"]
        )
    theta, _ = angle(**{"grid__load_2.P": "2550 MW"})  # 150 MW now
    assert cmath.sin(theta).real == pytest.approx(0.15, abs=1e-9)


def test_the_two_area_scenarios():
    ready = {r.name: r for r in load_case("two_area").prepare()}
    assert list(ready) == ["base", "gfor", "pod_p", "pod_q", "pod_pq"]
    assert list(ready["base"].system.components) == ["sg1", "sg2", "grid"]
    assert ready["base"].schedule.groups == (("sg1", "sg2"), ("grid",))
    assert ready["base"].values["grid.load_2.P"] == 1250.0
    assert ready["gfor"].values["grid.load_2.P"] == 2600.0
    assert ready["gfor"].schedule.groups == (("gfor", "sg1", "sg2"), ("grid",))
    assert all(r.events == (LoadChange(1.0, "grid", "load_2", 1.01),) for r in ready.values())
    switches = {
        n: (r.values.get("gfor.pod_p.enabled"), r.values.get("gfor.pod_q.enabled"))
        for n, r in ready.items()
    }
    assert switches == {
        "base": (None, None),
        "gfor": (None, None),
        "pod_p": (True, None),
        "pod_q": (None, True),
        "pod_pq": (True, True),
    }


def test_a_removed_components_override_leaves_the_base_scenario_as_it_is():
    case = load_case("two_area")
    plain, changed = (
        case.prepare(["base"], overrides)[0].values for overrides in ({}, {"gfor.droop.R_f": 0.02})
    )
    assert plain == changed
    assert case.prepare(["gfor"], {"gfor.droop.R_f": 0.02})[0].values["gfor.droop.R_f"] == 0.02
