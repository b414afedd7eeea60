"""Switching in a case file: what trips and comes back, in the right components, and names that do not exist."""

from zipfile import ZipFile

import pytest

from fmus.toolchain.exporter import cached
from fmus.toolchain.frames import current_of_power, polar
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.cases.case import load_case
from orchestrator.core.errors import CaseError, ComponentError
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.systems.coupling.events import LineSwitching, LoadSwitching, UnitSwitching
from orchestrator.systems.coupling.master import Master

RING = """\
name = "ring"
[solver]
stop_time = "0.4 s"
[power_flow]
grid = "grid"
slack = "sg"
[network]
lines.l12 = { from = "b1", to = "b2", X = 0.02, R = 0.002, B = 0.04 }
lines.l23 = { from = "b2", to = "b3", X = 0.02, R = 0.002, B = 0.04 }
lines.l31 = { from = "b3", to = "b1", X = 0.03, R = 0.003, B = 0.04, tap = 1.02, shift = "2 deg" }
loads.town = { bus = "b3", p = "500 MW", q = "80 Mvar" }
loads.works = { bus = "b2", p = "200 MW", q = "40 Mvar" }
shunts.bank = { bus = "b3", b = "30 Mvar" }
[components.sg]
model = "synchronous_generator_st1"
bus = "b1"
parameters.S_n = "1000 MVA"
[components.vsc]
model = "gfor"
bus = "b2"
parameters = { S_n = "500 MVA", P_0 = 0.6, v_0 = 1.01 }
[components.grid]
model = "grid"
"""
EVENT = '[[events]]\ntime = "0.1 s"\n'


@pytest.fixture
def prepared(tmp_path):
    def prepare(text="", overrides=None, base=RING):
        (tmp_path / "case.toml").write_text(base + text, encoding="utf-8")
        return load_case(tmp_path / "case.toml").prepare((), overrides)[0]

    return prepare


def watch(ready, names, times):
    """Values of ``component.variable`` at some times."""
    rows = []
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        for time in times:
            master.run(time, [e for e in ready.events if e.time >= master.time])
            rows.append(
                {
                    n: master.components[n.split(".")[0]].get([n.partition(".")[2]]).popitem()[1]
                    for n in names
                }
            )
    return rows


def the_problem(prepare, *arguments):
    with pytest.raises(CaseError) as caught:
        prepare(*arguments)
    (problem,) = caught.value.problems
    return str(problem)


def test_a_line_trips_and_recloses(prepared):
    ready = prepared(EVENT + 'type = "line_trip"\nline = "l23"\nreclose_after = "50 ms"\n')
    assert ready.events == (
        LineSwitching(0.1, "grid", "l23", False),
        LineSwitching(0.15000000000000002, "grid", "l23", True),
    )
    before, opened, closed = watch(ready, ["grid.l23.p", "grid.l31.p"], [0.1, 0.149, 0.39])
    assert abs(opened["grid.l23.p"]) < 1e-6
    assert abs(opened["grid.l31.p"]) > abs(before["grid.l31.p"]) + 1
    assert closed["grid.l23.p"] == pytest.approx(before["grid.l23.p"], rel=0.3)


def test_the_same_with_an_event_of_its_own(prepared):
    text = (
        EVENT
        + 'type = "line_trip"\nline = "l23"\n[[events]]\ntype = "line_reclosing"\ntime = 0.2\nline = "l23"\n'
    )
    assert prepared(text).events == (
        LineSwitching(0.1, "grid", "l23", False),
        LineSwitching(0.2, "grid", "l23", True),
    )


def test_a_load_trips_and_returns(prepared):
    text = EVENT + 'type = "load_trip"\nload = "works"\n'
    text += '[[events]]\ntype = "load_reconnection"\ntime = "0.2 s"\ncomponent = "grid"\nload = "works"\n'
    ready = prepared(text)
    assert ready.events == (
        LoadSwitching(0.1, "grid", "works", 0.0),
        LoadSwitching(0.2, "grid", "works", 1.0),
    )
    before, off, on = watch(ready, ["sg.p", "vsc.p"], [0.1, 0.199, 0.39])
    total = [row["sg.p"] * 10 + row["vsc.p"] * 5 for row in (before, off, on)]
    # 200 MW, less what a higher voltage draws
    assert total[0] - total[1] == pytest.approx(2, abs=0.4)
    assert total[2] == pytest.approx(total[0], abs=0.2)


def test_a_unit_trips_on_both_sides_and_returns(prepared):
    text = EVENT + 'type = "unit_trip"\nunit = "vsc"\n'
    ready = prepared(
        text + '[[events]]\ntype = "unit_reconnection"\ntime = "0.11 s"\nunit = "vsc"\n'
    )
    assert ready.events[0] == UnitSwitching(0.1, "grid", "vsc", False)
    assert ready.events[0].changes() == {
        "vsc": {"connected": False},
        "grid": {"vsc.connected": False},
    }
    assert str(ready.events[0]) == "t = 0.1 s: vsc.connected = 0, grid.vsc.connected = 0"
    assert ready.events[1].changes() == {
        "vsc": {"connected": True},
        "grid": {"vsc.connected": True},
    }
    alone = prepared(text)
    before, _, off = watch(alone, ["grid.vsc.p", "vsc.omega", "vsc.p"], [0.1, 0.102, 0.39])
    assert before["grid.vsc.p"] == pytest.approx(3, abs=1e-6)
    assert off["grid.vsc.p"] == 0
    assert abs(off["vsc.p"]) < 1e-6
    assert off["vsc.omega"] == pytest.approx(1.03, abs=2e-3)  # droop at no load


def vendor_fmu(breaker=None):
    """A current source with the power flow's start values; its breaker, if any, starts closed or open."""
    m = ModelBuilder("vendor", "Constant current, as another tool might export it")
    S_n = m.parameter("S_n", 100.0, "MVA", "Rating")
    values = {"P_0": ("pu", 0.5), "Q_0": ("pu", 0.0), "v_0": ("pu", 1.01), "theta_0": ("rad", 0.0)}
    p, q, v, theta = (
        m.parameter(n, x, unit, n, base="S_n" * (unit == "pu")) for n, (unit, x) in values.items()
    )
    for part in ("re", "im"):
        m.input(f"v_{part}", "pu", "Bus voltage", base="bus")
    i = current_of_power(p, q, polar(v, theta)) * (S_n / 100)
    m.output("i_re", i.re, "pu", "Current", base="100 MVA")
    m.output("i_im", i.im, "pu", "Current", base="100 MVA")
    if breaker is not None:
        m.switch("connected", breaker, "The breaker is closed")
    return cached(PythonFmu(m.build()))


OTHER_BASE = (
    "S_base = 90 MVA; currents at the port and all networks are in pu of the system base, which is 100 MVA: leave "
    "S_base away, and give the device's own rating with S_n"
)


def test_another_system_base_is_refused_where_it_is_set(prepared):
    base = RING.replace("P_0 = 0.6,", "P_0 = 0.6, S_base = 90,")
    line = 1 + next(k for k, text in enumerate(base.splitlines()) if "S_base" in text)
    with pytest.raises(CaseError, match="S_base") as caught:
        prepared("", None, base)
    assert f"line {line}, components.vsc.parameters.S_base: component 'vsc': {OTHER_BASE}" in str(
        caught.value
    )
    assert (
        the_problem(prepared, "", {"sg.S_base": "90 MVA"})
        == f"--set sg.S_base: component 'sg': {OTHER_BASE}"
    )


def test_the_system_base_itself_may_be_set(prepared):
    plain, given = prepared(), prepared("", {"vsc.S_base": "100 MVA"})
    assert given.power_flow.powers == plain.power_flow.powers


@pytest.mark.parametrize("closed", [True, False])
def test_a_breaker_that_another_tool_declares_as_1_or_0(prepared, tmp_path, closed):
    path = tmp_path / "vendor.fmu"
    with ZipFile(vendor_fmu(closed)) as good, ZipFile(path, "w") as written:
        for name in good.namelist():
            content = good.read(name)
            if name == "modelDescription.xml":
                old = f'<Boolean start="{str(closed).lower()}"'.encode()
                assert content.count(old) == 1
                content = content.replace(old, f'<Boolean start="{int(closed)}"'.encode())
            written.writestr(name, content)
    ready = prepared("", None, RING.replace('model = "gfor"', f"fmu = '{path}'"))
    assert ready.power_flow.powers["vsc"].real == pytest.approx(0.6 * closed)


def test_a_foreign_unit_without_a_breaker_of_its_own_is_opened_on_the_grids_side(prepared):
    base = RING.replace('model = "gfor"', f"fmu = '{vendor_fmu()}'")
    ready = prepared(EVENT + 'type = "unit_trip"\nunit = "vsc"\n', None, base)
    (event,) = ready.events
    assert event.changes() == {"grid": {"vsc.connected": False}}
    before, after = watch(ready, ["grid.vsc.p", "vsc.i_re"], [0.1, 0.102])
    assert before["grid.vsc.p"] == pytest.approx(3, abs=1e-6)
    assert after["grid.vsc.p"] == 0
    assert after["vsc.i_re"] == before["vsc.i_re"]  # it does not know


@pytest.mark.parametrize(
    "opened", ["grid.l23.connected", "grid.l31.connected", "grid.vsc.connected", "vsc.connected"]
)
def test_an_outage_from_the_start_has_its_own_operating_point(prepared, opened):
    ready = prepared(overrides={opened: False})
    whole = prepared()
    assert ready.power_flow.residual <= 1e-9
    assert abs(ready.power_flow.powers["sg"] - whole.power_flow.powers["sg"]) > 1e-4
    if "vsc" in opened:
        assert ready.power_flow.powers["vsc"] == 0
        assert ready.power_flow.powers["sg"].real > 0.7
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        point = find_operating_point(master)
        assert point.initial_residual <= 1e-9
        assert point.residual <= 1e-9


@pytest.mark.parametrize(
    ("event", "words"),
    [
        ('type = "line_trip"\nline = "l32"', "component 'grid' has no line 'l32'; did you mean l3"),
        (
            'type = "line_trip"\nline = "wire"',
            "component 'grid' has no line 'wire'; it has: l12, l23, l31",
        ),
        (
            'type = "load_trip"\nload = "twon"',
            "component 'grid' has no load 'twon'; did you mean town?",
        ),
        (
            'type = "load_change"\nscale = 2\nload = "twon"',
            "component 'grid' has no load 'twon'; did you mean town?",
        ),
        ('type = "branch_change"\nX = 1\nline = "l99"', "component 'grid' has no line 'l99'"),
        (
            'type = "unit_trip"\nunit = "vcs"',
            "component 'grid' has no unit 'vcs'; did you mean vsc?",
        ),
        (
            'type = "line_trip"\nline = "l12"\ncomponent = "net"',
            "there is no component 'net'; the case has: sg, vsc",
        ),
        (
            'type = "line_trip"\nline = "l12"\nreclose_after = 0',
            "reclose_after: it must be greater than 0",
        ),
        (
            'type = "line_trip"\nline = "l12"\nreclose_after = 0.00015',
            "the event at 0.10015 s is not a communication",
        ),
    ],
)
def test_a_mistake_in_a_switching(prepared, event, words):
    assert words in the_problem(prepared, EVENT + event + "\n")


# No bus has capacitance: loads alone determine the voltages.
BARE = (
    RING.replace(", B = 0.04", "")
    .replace("shunts.bank", "# ")
    .replace("[components.sg]", 'loads.own = { bus = "b1", p = "400 MW" }\n[components.sg]', 1)
)


def test_a_load_that_alone_holds_its_bus_cannot_be_switched_off(prepared):
    problem = the_problem(prepared, EVENT + 'type = "load_trip"\nload = "works"\n', None, BARE)
    assert (
        "load 'works' cannot be switched off, because nothing else determines the voltage of its bus"
        in problem
    )


def test_without_a_grid_the_component_must_be_named(tmp_path):
    (tmp_path / "case.toml").write_text(
        'name = "x"\n[components.g]\nmodel = "two_area_grid"\n'
        + EVENT
        + 'type = "line_trip"\nline = "L"\n'
    )
    with pytest.raises(CaseError, match="the key 'component' is missing; name the grid here"):
        load_case(tmp_path / "case.toml").prepare()


def test_opening_the_only_way_to_a_bus_is_an_island(prepared):
    problem = the_problem(prepared, "", {"grid.l23.connected": False, "grid.l31.connected": False})
    assert "no way leads to the slack bus 'b1' from: 'b3'; close l23, l31, connect them" in problem


def test_what_the_slack_feeds_is_shared_when_it_is_open(prepared):
    """Here it is too much for the other unit, unless the case leaves it to whoever is the slack then."""
    off, text = (
        {"sg.connected": False},
        RING.replace("[power_flow]\n", '[power_flow]\nsharing = "slack"\n'),
    )
    assert "vsc would need 127 % of its 555 MW" in the_problem(prepared, "", off)
    alone = prepared("", off, text).power_flow.powers["vsc"] * 500
    assert 700 < alone.real < 720  # the loads, and what the lines lose


def test_a_power_flow_without_solution_names_the_branch(prepared):
    problem = the_problem(prepared, "", {"grid.X_l23": 0.4, "grid.X_l31": 0.5})
    assert "no solution found" in problem
    assert "In the DC solution the largest angle, " in problem
    assert "across 'l31' between 'b3' (" in problem


def test_all_loads_of_a_bus_without_capacitance_switched_off_is_refused_with_the_rule(prepared):
    text = BARE.replace(
        "[components.sg]", 'loads.mill = { bus = "b2", p = "50 MW" }\n[components.sg]', 1
    )
    events = "".join(f'{EVENT}type = "load_trip"\nload = "{name}"\n' for name in ("works", "mill"))
    ready = prepared(events, None, text)
    rule = "the voltage of b2 hangs on its loads; leave one of them switched on"
    with (
        Master(ready.system, ready.schedule, ready.step_size) as master,
        pytest.raises(ComponentError, match=rule),
    ):
        master.run(0.2, ready.events)


def trip(kind, element, time="0.1 s"):
    return f'[[events]]\ntime = "{time}"\ntype = "{kind}_trip"\n{kind} = "{element}"\n'


@pytest.mark.parametrize(
    ("events", "asked"),
    [
        (trip("line", "l23") + trip("line", "l31"), "from t = 0.1 s on no unit is connected to b3"),
        (
            trip("line", "l23") + trip("line", "l31", "0.2 s"),
            "from t = 0.2 s on no unit is connected to b3",
        ),
        (
            trip("line", "l12") + trip("line", "l23") + trip("unit", "vsc"),
            "no unit is connected to b2",
        ),
        (trip("line", "l23") + trip("line", "l31") + trip("load", "town"), ""),
        (trip("line", "l12") + trip("line", "l23"), ""),
        (trip("line", "l31"), ""),
    ],
)
def test_loads_without_any_unit_are_asked_about(prepared, events, asked):
    texts = [q.text for q in prepared(events).questions if "no unit is connected" in q.text]
    assert (len(texts) == 1 and asked in texts[0]) if asked else not texts


def test_a_load_that_is_lost_with_a_unit_is_not_shared_by_the_others(tmp_path):
    """Of 500 MW of town three fifths are lost."""
    (tmp_path / "case.toml").write_text(RING, encoding="utf-8")
    case, shared = load_case(tmp_path / "case.toml"), {}
    for scale in (1.0, 0.4):
        name = next(iter(case.scenarios))
        values = {"vsc.connected": False, "grid.town.scale": scale}
        before = case._before_outage(name, values, ())
        lost, dispatch = case._switched_off(name, before, values, ())
        assert lost == ["vsc"]
        shared[scale] = dispatch.change
    assert shared[1.0] == pytest.approx(300, abs=1e-6)
    assert shared[0.4] == pytest.approx(300 - 0.6 * 500, abs=1e-6)
