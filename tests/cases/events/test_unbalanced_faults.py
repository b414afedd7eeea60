"""Faults of fewer than three phases and open poles, against the same network solved in phases a, b and c.

The reference knows no sequence networks: each element is a matrix of three phases, the fault an admittance between
phases or to earth, an open pole a phase without a conductor."""

import re

import numpy as np
import pytest

import orchestrator as gfor
from fmus.grid.network import OPEN_CHARGING
from orchestrator.cases.case import load_case
from orchestrator.cases.forcing import event_of, with_events
from orchestrator.core.errors import CaseError, InputError, QuestionTopic
from orchestrator.core.options import Option
from orchestrator.studies.runs.after_events import modes_after
from orchestrator.systems.coupling.events import (
    LineEndSwitching,
    LineFault,
    LineSwitching,
    PoleEndSwitching,
    PoleSwitching,
)
from orchestrator.systems.coupling.master import Master
from tests.support.late import LateLibrary

pp, sc = LateLibrary("pandapower"), LateLibrary("pandapower.shortcircuit")

RING = """\
name = "ring"
models = "phasor"
[solver]
stop_time = "0.5 s"
step_size = "1 ms"
[power_flow]
grid = "grid"
slack = "sg"
[network]
lines.l12 = { from = "b1", to = "b2", X = 0.02, R = 0.002, B = 0.04 }
lines.l23 = { from = "b2", to = "b3", X = 0.02, R = 0.002, B = 0.04 }
lines.l31 = { from = "b3", to = "b1", X = 0.03, R = 0.003, B = 0.04 }
loads.town = { bus = "b3", p = "500 MW", q = "80 Mvar" }
loads.works = { bus = "b2", p = "200 MW", q = "40 Mvar" }
[network.sequences]
line_z0 = 2.5
line_b0 = 0.5
machine_x2 = 1.2
machine_x0 = 0.08
converter_x2 = 0.3
[components.sg]
model = "synchronous_generator_st1"
bus = "b1"
parameters.S_n = "1000 MVA"
parameters.transformer.X_t = 0.0
parameters.transformer.R_t = 0.0
[components.vsc]
model = "gfor"
bus = "b2"
parameters = { S_n = "500 MVA", P_0 = 0.6, v_0 = 1.01 }
[components.grid]
model = "grid"
"""
RADIAL = """\
name = "radial"
models = "phasor"
[solver]
stop_time = "0.5 s"
step_size = "1 ms"
[power_flow]
grid = "grid"
slack = "source"
[network]
lines.step_up = { from = "b2", to = "b1", X = 0.02 }
lines.l23 = { from = "b2", to = "b3", X = 0.1, R = 0.01 }
[network.sequences]
line_z0 = 3.0
groups.step_up = "YNd"
external_z0 = 1.0
[components.source]
model = "external_grid"
bus = "b1"
parameters = { S_n = "1000 MVA", R_X = 0.1 }
[components.grid]
model = "grid"
"""
LINES = {"l12": (0, 1, 0.002 + 0.02j), "l23": (1, 2, 0.002 + 0.02j), "l31": (2, 0, 0.003 + 0.03j)}
BUSES = ("b1", "b2", "b3")
B1, Z0_Z1, B0_B1 = 0.04, 2.5, 0.5
A = np.exp(2j * np.pi / 3)
LINE_Y = 1 / (0.002 + 0.02j)  # of l12
BOLTED = 1e8  # admittance between phases that touch


def of_sequences(zero, positive, negative):
    """A matrix of three phases of an element with these admittances."""
    T = np.array([[1, 1, 1], [1, A**2, A], [1, A, A**2]])
    return T @ np.diag([zero, positive, negative]) @ np.linalg.inv(T)


class Phases:
    """The ring in phases; the fourth node is the place of a fault along a line, the fifth the line's open end.

    ``B1``: charging of each line."""

    def __init__(self, emfs, machine, converter, loads, B1=B1):
        self.Y, self.driven = np.zeros((15, 15), dtype=complex), np.zeros(15, dtype=complex)
        self.B1 = B1
        for bus, (e, y1), (y2, y0) in (
            (0, machine, (1 / (1.2j * emfs["X_d2"] / 10 + emfs["R_s"] / 10), 1 / (0.08j / 10))),
            (1, converter, (5 / 0.3j, 0.0)),
        ):
            own = of_sequences(y0, y1, y2)
            self.at(bus, bus, own)
            self.driven[3 * bus : 3 * bus + 3] += own @ (e * np.array([1, A**2, A]))
        for bus, y in loads.items():
            self.at(bus, bus, of_sequences(0.0, y, y))

    def at(self, row, column, block):
        self.Y[3 * row : 3 * row + 3, 3 * column : 3 * column + 3] += block

    def series(self, one, other, z, open_phase=False):
        Z = np.linalg.inv(of_sequences(1 / (Z0_Z1 * z), 1 / z, 1 / z))
        y = np.linalg.inv(Z)
        if open_phase:  # the conductors of b and c alone
            y = np.zeros((3, 3), dtype=complex)
            y[1:, 1:] = np.linalg.inv(Z[1:, 1:])
        for row, column, sign in (
            (one, one, 1),
            (other, other, 1),
            (one, other, -1),
            (other, one, -1),
        ):
            self.at(row, column, sign * y)

    def add_lines(
        self, split=None, open_phase=None, *, open_at_from=False, pole_at=None, without=None
    ):
        for name, (first, last, z) in LINES.items():
            if name == without:
                continue
            one, other = first, last
            if pole_at is not None and pole_at[0] == name:
                one, other = self.with_open_pole(first, last, pole_at[1])
            if split is not None and split[0] == name:
                start = 4 if open_at_from else one
                self.section(start, 3, z, split[1])
                self.section(3, other, z, 1 - split[1])
            else:
                self.section(one, other, z, open_phase=name == open_phase)

    def section(self, one, other, z, part=1.0, *, open_phase=False):
        """A part of a line of series impedance z, with its own part of the charging, half at each of its ends."""
        for node in (one, other):
            y = 0.5j * part * self.B1
            self.at(node, node, of_sequences(B0_B1 * y, y, y))
        self.series(one, other, part * z, open_phase)

    def with_open_pole(self, one, other, end):
        """Phase a of a line ends before its bus, phases b and c touch it; return the nodes of the line's ends."""
        bus = one if end == "from" else other
        touching = np.diag([0.0, BOLTED, BOLTED])
        for row, column, sign in ((bus, bus, 1), (3, 3, 1), (bus, 3, -1), (3, bus, -1)):
            self.at(row, column, sign * touching)
        return (3, other) if end == "from" else (one, 3)

    def fault(self, node, kind, z):
        y, k = 1 / z, 3 * node
        if kind == "1-phase":
            self.Y[k, k] += y
            return
        b, c = k + 1, k + 2
        if kind == "2-phase":
            pair = np.array([[y, -y], [-y, y]])
        else:  # bolted together, and by z to earth
            pair = np.array([[BOLTED + y, -BOLTED], [-BOLTED, BOLTED]])
        self.Y[np.ix_([b, c], [b, c])] += pair

    def sequences(self, node):
        """The impedances to earth of a node in the zero, the positive and the negative sequence."""
        used = [k for k in range(15) if self.Y[k].any()]
        place = [used.index(3 * node + phase) for phase in range(3)]
        Z = np.linalg.inv(self.Y[np.ix_(used, used)])[np.ix_(place, place)]
        T = np.array([[1, 1, 1], [1, A**2, A], [1, A, A**2]])
        return np.diag(np.linalg.inv(T) @ Z @ T)

    def positive(self):
        """The positive sequence of all voltages."""
        used = [k for k in range(15) if self.Y[k].any()]
        v = np.zeros(15, dtype=complex)
        v[used] = np.linalg.solve(self.Y[np.ix_(used, used)], self.driven[used])
        return np.array([v[3 * k : 3 * k + 3] @ [1, A, A**2] / 3 for k in range(4)])


def prepared(folder, text, base=RING):
    (folder / "case.toml").write_text(base + text, encoding="utf-8")
    return load_case(folder / "case.toml").prepare()[0]


def compared(ready, time, B1=B1):
    """Voltages of the coupled system a step after a time, and what the reference needs to solve the same."""
    with Master(ready.system, ready.schedule, ready.step_size) as master:
        master.run(time, ready.events)
        names = [f"{u}.{q}_{p}" for u in ("sg", "vsc") for q in "ey" for p in ("re", "im")]
        names += [f"{bus}.{v}" for bus in BUSES for v in ("v_re", "v_im")]
        got = master.components["grid"].get(names)
    sources = [
        (complex(got[f"{u}.e_re"], got[f"{u}.e_im"]), complex(got[f"{u}.y_re"], got[f"{u}.y_im"]))
        for u in ("sg", "vsc")
    ]
    plan = ready.system.components["sg"]
    data = {"X_d2": plan.number("machine.X_d2"), "R_s": plan.number("machine.R_s")}
    v_0 = ready.power_flow.voltages
    loads = {2: (5 - 0.8j) / abs(v_0["b3"]) ** 2, 1: (2 - 0.4j) / abs(v_0["b2"]) ** 2}
    v = np.array([complex(got[f"{bus}.v_re"], got[f"{bus}.v_im"]) for bus in BUSES])
    return v, Phases(data, *sources, loads, B1)


@pytest.mark.parametrize("z", [1e-5j, 0.01 + 0.02j])
@pytest.mark.parametrize("kind", ["1-phase", "2-phase", "2-phase-earth"])
def test_a_fault_at_a_bus_is_that_of_three_phases(kind, z, tmp_path):
    text = f'[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "b3"\nkind = "{kind}"\n'
    ready = prepared(tmp_path, text + f"R = {z.real}\nX = {z.imag}\n")
    v, reference = compared(ready, 0.102)
    reference.add_lines()
    reference.fault(2, kind, z)
    assert v == pytest.approx(reference.positive()[:3], rel=2e-5 if abs(z) > 1e-4 else 2e-4)
    (found,) = ready.faults
    assert found.kind == kind
    assert found.seen == pytest.approx(complex(ready.events[0].R, ready.events[0].X))


@pytest.mark.parametrize("at", [0.1, 0.7])
@pytest.mark.parametrize("kind", ["1-phase", "2-phase-earth"])
def test_a_fault_along_a_line_is_that_of_three_phases(kind, at, tmp_path):
    text = f'[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l23"\nat = {at}\nkind = "{kind}"\nR = 0.01\n'
    ready = prepared(tmp_path, text)
    v, reference = compared(ready, 0.102)
    reference.add_lines(split=("l23", at))
    reference.fault(3, kind, 0.01)
    assert v == pytest.approx(reference.positive()[:3], rel=1e-4)


@pytest.mark.parametrize("at", [0.1, 0.6])
@pytest.mark.parametrize("is_open", [False, True])
@pytest.mark.parametrize("kind", ["1-phase", "2-phase-earth", "3-phase"])
def test_each_part_of_a_line_with_a_fault_has_its_own_charging(kind, is_open, at, tmp_path):
    """Of long lines: the parts are π sections of their own, also that which the fault alone feeds."""
    B = 0.8
    trip = '[[events]]\ntype = "line_trip"\ntime = "50 ms"\nline = "l31"\nat = "b3"\n'
    fault = f'[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l31"\nat = {at}\nR = 0.01\nX = 0.01\n'
    text = f'{trip if is_open else ""}{fault}kind = "{kind}"\n'
    ready = prepared(tmp_path, text, RING.replace("B = 0.04", f"B = {B}"))
    v, reference = compared(ready, 0.102, B)
    reference.add_lines(split=("l31", at), open_at_from=is_open)
    for found in ready.faults:
        zero, _, negative = reference.sequences(3)
        assert (found.zero, found.negative) == pytest.approx((zero, negative), rel=1e-9)
    assert len(ready.faults) == (kind != "3-phase")
    if kind == "3-phase":
        reference.at(3, 3, np.eye(3) / (0.01 + 0.01j))
    else:
        reference.fault(3, kind, 0.01 + 0.01j)
    # a thousandth of a line's charging (OPEN_CHARGING) stays at its buses, whatever its state
    assert v == pytest.approx(reference.positive()[:3], rel=2e-5)


def test_an_open_pole_is_that_of_three_phases(tmp_path):
    text = '[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l31"\nat = "40 %"\nkind = "1-phase"\n'
    ready = prepared(
        tmp_path, text + 'duration = "50 ms"\nopens = "pole"\nreclose_after = "100 ms"\n'
    )
    fault, cleared, opened, closed = ready.events
    assert isinstance(fault, LineFault)
    assert isinstance(opened, PoleSwitching)
    assert (cleared.time, opened.time, closed.time) == pytest.approx((0.15, 0.15, 0.25))
    assert (closed.X, closed.R) == (0.03, 0.003)
    v, reference = compared(ready, 0.2)
    reference.add_lines(open_phase="l31")
    assert v == pytest.approx(reference.positive()[:3], rel=1e-6)
    v, reference = compared(ready, 0.3)
    reference.add_lines()
    assert v == pytest.approx(reference.positive()[:3], rel=1e-6)


@pytest.mark.parametrize(("bus", "end"), [("b3", "from"), ("b1", "to")])
def test_a_pole_that_opens_at_one_end_is_that_of_three_phases(bus, end, tmp_path):
    """The other conductors go on, and the open one stays charged from its other end."""
    prepared(tmp_path, "")
    fault = (
        f"l31 at 40 %, 50 ms, 1-phase, opens one pole at {bus}, recloses after 100 ms, from 0.1 s"
    )
    (ready,) = with_events(load_case(tmp_path / "case.toml"), [], [fault]).prepare()
    *_, opened, closed = ready.events
    assert isinstance(opened, PoleEndSwitching)
    assert (opened.end, closed.open, closed.R, closed.X) == (end, False, 0.0, 0.0)
    assert (opened.time, closed.time) == pytest.approx((0.15, 0.25))
    v, reference = compared(ready, 0.2)
    reference.add_lines(pole_at=("l31", end))
    assert v == pytest.approx(reference.positive()[:3], rel=1e-5)
    _, at_both = compared(ready, 0.2)
    at_both.add_lines(open_phase="l31")
    assert np.abs(v - at_both.positive()[:3]).max() > 1e-4  # what the open conductor draws counts
    v, reference = compared(ready, 0.3)
    reference.add_lines()
    assert v == pytest.approx(reference.positive()[:3], rel=1e-6)


@pytest.mark.parametrize(("stated", "is_earthed"), [("", True), ("YNd", True), ("Dyn", False)])
def test_a_transformer_of_a_machines_own_leads_to_earth_by_its_vector_group(
    stated, is_earthed, tmp_path
):
    """Its network side is named first; without it only charging leads the zero sequence to earth."""
    base = RING.replace("transformer.X_t = 0.0", "transformer.X_t = 0.12")
    if stated:
        base = base.replace("line_b0", f'step_up = "{stated}"\nline_b0')
    fault = '[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "b1"\nkind = "1-phase"\n'
    ready = prepared(tmp_path, fault, base)
    (found,) = ready.faults
    if is_earthed:
        assert found.zero == pytest.approx(0.12j * 100 / 1000, rel=2e-3)  # charging is beside it
    else:
        assert found.zero.imag < -10


def test_a_pole_that_is_left_open_at_one_end_is_said_to_leave_no_modes(tmp_path):
    prepared(tmp_path, "")
    fault = "l31 at 40 %, 50 ms, 1-phase, opens one pole at b3, recloses after 5 s, from 0.1 s"
    (ready,) = with_events(load_case(tmp_path / "case.toml"), [], [fault]).prepare()
    assert "one phase of grid.l31 is open at an end" in str(modes_after(ready, (0.1, 2.0)))


def test_a_line_opens_at_one_end_and_its_modes_are_of_that_network(tmp_path):
    """The power flow with the line open at one end is the voltages at which the run arrives."""
    trip = '[[events]]\ntype = "line_trip"\ntime = "0.1 s"\nline = "l31"\nat = "b3"\n'
    ready = prepared(tmp_path, trip.replace("\nat", '\nreclose_after = "200 ms"\nat'))
    opened, closed = ready.events
    assert opened == LineEndSwitching(0.1, "grid", "l31", "from", False)
    assert (closed.time, closed.connected) == (pytest.approx(0.3), True)
    after = load_case(tmp_path / "case.toml").prepare([], {"grid.l31.from_connected": False})[0]
    v = after.power_flow.voltages
    y, b = 1 / (0.003 + 0.03j), 0.02j * (1 - OPEN_CHARGING)
    charged = y + b - y**2 / (y + b) + 0.02j * OPEN_CHARGING
    drawn = sum((v["b1"] - v[bus]) * LINE_Y + v["b1"] * 0.02j for bus in ("b2",))
    fed = after.power_flow.powers["sg"] * 10
    assert fed == pytest.approx(v["b1"] * np.conj(drawn + v["b1"] * charged), rel=1e-8)


@pytest.mark.parametrize(
    ("opens", "asked"),
    [
        ("opens it at b3", True),
        ("1-phase, opens one pole at b3, recloses after 0.5 s", True),
        ("opens it", False),
    ],
)
def test_a_fault_along_a_line_that_ends_as_one_end_opens_is_asked_about(opens, asked, tmp_path):
    prepared(tmp_path, "")
    fault = f"l31 at 40 %, 50 ms, {opens}, from 0.1 s"
    (ready,) = with_events(load_case(tmp_path / "case.toml"), [], [fault]).prepare(stop_time=2.0)
    said = "l31 opens at b3 alone: the fault along it ends with that, where a real one lasts until "
    said += "its end at b1 opens too"
    assert any(said in str(q) for q in ready.questions) == asked


@pytest.mark.parametrize("kind", ["1-phase", "2-phase-earth"])
def test_the_other_end_feeds_a_fault_until_it_opens_too(kind, tmp_path):
    """Against three phases: with one end open and the fault, with the line gone, and with it closed again."""
    prepared(tmp_path, "")
    fault = f"l31 at 40 %, 50 ms, {kind}, opens it at b3, other end after 200 ms, recloses after 100 ms, from 0.1 s"
    (ready,) = with_events(load_case(tmp_path / "case.toml"), [], [fault]).prepare()
    assert not [q for q in ready.questions if "where a real one lasts" in str(q)]
    v, reference = compared(ready, 0.2)
    reference.add_lines(split=("l31", 0.4), open_at_from=True)
    reference.fault(3, kind, 1e-6j)
    assert v == pytest.approx(reference.positive()[:3], rel=1e-3)
    assert min(np.abs(v)) < 0.9
    v, reference = compared(ready, 0.35)
    reference.add_lines(without="l31")
    assert v == pytest.approx(reference.positive()[:3], rel=1e-5)
    v, reference = compared(ready, 0.45)
    reference.add_lines()
    assert v == pytest.approx(reference.positive()[:3], rel=1e-6)


def test_a_balanced_fault_is_fed_by_the_end_that_opens_later(tmp_path):
    """The same as two events that a planner types by hand: the end's trip, and a longer fault that opens the line."""
    prepared(tmp_path, "")
    case = load_case(tmp_path / "case.toml")
    fault = "l31 at 40 %, 50 ms, opens it at b3, other end after 200 ms, from 0.1 s"
    (ready,) = with_events(case, [], [fault]).prepare()
    trip = '[[events]]\ntype = "line_trip"\ntime = "0.15 s"\nline = "l31"\nat = "b3"\n'
    along = '[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l31"\nat = 0.4\n'
    by_hand = prepared(tmp_path, f'{trip}{along}duration = "200 ms"\nopens = "line"\n')
    for time in (0.12, 0.2, 0.4):
        assert compared(ready, time)[0] == pytest.approx(compared(by_hand, time)[0], rel=1e-9)


@pytest.mark.parametrize(
    "fault",
    ["l31 at 40 %, 50 ms, opens it at b3", "b3, 50 ms, opens l31 at b3, from 0.2 s"],
    ids=["along the line", "at the bus"],
)
def test_a_fault_that_ends_as_one_end_opens_leaves_the_modes_of_that_outage(fault, tmp_path):
    """By hand the line is the admittance that b1 sees: its π section with nothing at its other end."""
    prepared(tmp_path, "")
    case = load_case(tmp_path / "case.toml")
    (ready,) = with_events(case, [], [fault]).prepare(stop_time=2.0)
    *_, opened = ready.events
    assert isinstance(opened, LineEndSwitching)
    assert (opened.line, opened.end, opened.connected) == ("l31", "from", False)
    after = modes_after(ready, (0.05, 5.0))
    z, half = 0.003 + 0.03j, 0.02j
    y = 100 * (half + 1 / (z + 1 / half))
    line = next(row for row in RING.splitlines() if row.startswith("lines.l31"))
    stub = f'shunts.stub = {{ bus = "b1", g = "{y.real} MW", b = "{y.imag} Mvar" }}'
    (tmp_path / "by_hand.toml").write_text(RING.replace(line, stub))
    by_hand = gfor.load(tmp_path / "by_hand.toml").scenario().modes((0.05, 5.0))
    assert [mode.eigenvalue for mode in after.modes] == pytest.approx(
        [mode.eigenvalue for mode in by_hand], rel=1e-5
    )
    assert [mode for mode in after.modes if mode.is_oscillation]


def test_a_fault_whose_bus_stays_joined_to_the_line_that_opens_is_asked_about(tmp_path):
    prepared(tmp_path, "")
    case = load_case(tmp_path / "case.toml")
    asked = {}
    for bus in ("b3", "b1"):
        (ready,) = with_events(case, [], [f"b3, 50 ms, opens l31 at {bus}, from 0.2 s"]).prepare()
        asked[bus] = [str(q) for q in ready.questions if "stays joined to b3" in str(q)]
    assert (len(asked["b3"]), len(asked["b1"])) == (0, 1)


def test_what_cannot_be_is_refused_by_name(tmp_path):
    trip = '[[events]]\ntype = "line_trip"\ntime = "0.1 s"\nline = "l31"\nat = "b2"\n'
    with pytest.raises(CaseError, match="l31 joins b3 and b1, and has no end at 'b2'"):
        prepared(tmp_path, trip)
    emt = RING.replace('models = "phasor"', 'models = "emt"').replace("1 ms", "100 us")
    fault = '[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "b3"\nkind = "1-phase"\n'
    along = '[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l23"\nat = 0.3\n'
    for text, what in (
        (fault, "a fault of kind '1-phase'"),
        (along, "a fault along a line"),
        (trip.replace("b2", "b3"), "a line that opens at one end"),
    ):
        with pytest.raises(CaseError, match=f"{what} needs a network of phasors") as caught:
            prepared(tmp_path, text, emt)
        assert "--set models=phasor" in str(caught.value)
        ready = load_case(tmp_path / "case.toml").prepare([], {"models": "phasor"})[0]
        assert ready.events  # the remedy works


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("at = 0.3\nopens = 'line'", "'opens' needs 'duration'"),
        ("at = 0.3\nreclose_after = '1 s'", "'reclose_after' needs 'opens'"),
        ("at = 0.3\nopens_at = 'b2'", "'opens_at' needs 'opens'"),
        (
            "at = 0.3\nduration = '0.1 s'\nopens = 'line'\nopens_at = 'b1'",
            "l23 joins b2 and b3, and has no end at 'b1'",
        ),
        (
            "at = 0.3\nduration = '0.1 s'\nopens = 'line'\nother_end_after = '0.4 s'",
            "'other_end_after' needs opens = 'line' and 'opens_at'",
        ),
        (
            "at = 0.3\nduration = '0.1 s'\nopens = 'line'\nopens_at = 'b2'\nother_end_after = '0.1 s'",
            "other_end_after = 0.1 s is not after the first end",
        ),
        (
            "at = 0.3\nduration = '0.1 s'\nopens = 'line'\nopens_at = 'b1'\nother_end_after = '0.2 s'",
            "l23 joins b2 and b3, and has no end at 'b1'",
        ),
        ("at = 0.3\nduration = '0.1 s'\nopens = 'pole'", "opens = 'pole' is for a fault of kind"),
        ("at = 1.3", "at"),
        (
            "at = '0.01 %'",
            "at = 0.01 %: along l23 it is from 0.1 to 99.9 % of the way from b2; a fault at this end is one at "
            "b2: type = 'bus_fault', bus = 'b2'",
        ),
        ("at = 0.9995", "at = 99.95 %: .* type = 'bus_fault', bus = 'b3'"),
        ("at = 0.3\nkind = '4-phase'", "kind"),
    ],
)
def test_keys_of_a_fault_along_a_line_that_do_not_fit(keys, words, tmp_path):
    with pytest.raises(CaseError, match=words):
        prepared(
            tmp_path, f'[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l23"\n{keys}\n'
        )


@pytest.mark.parametrize(
    ("case", "name", "kind"), [("ieee39", "line_2_30", "two"), ("three", "t", "three")]
)
def test_a_fault_along_a_transformer_is_refused_and_the_remedy_works(case, name, kind, tmp_path):
    if case == "three":
        table = "buses = ['b1', 'b2', 'b3'], X_12 = 0.2, X_13 = 0.2, X_23 = 0.2"
        windings = f"[network]\nthree_winding_transformers.t = {{ {table} }}"
        (tmp_path / "case.toml").write_text(RING.replace("[network]", windings))
        case = tmp_path / "case.toml"
    read, phasor = load_case(case), {"models": "phasor"}
    first = next(iter(read.scenarios))
    within = with_events(read, [], [f"{name} at 50 %, 100 ms, opens it, from 0.2 s"])
    with pytest.raises(CaseError, match=f"{name} is a transformer of {kind} windings") as refused:
        within.prepare([first], phasor)
    (remedy,) = re.findall(r"as --fault '([^']*)' does", str(refused.value))
    (ready,) = with_events(read, [], [remedy]).prepare([first], phasor)
    assert [type(event).__name__ for event in ready.events] == [
        "BusFault",
        "BusFault",
        "LineSwitching",
    ]


def test_data_that_are_assumed_are_asked_about_at_the_event_with_what_states_them(tmp_path):
    fault = '[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "b3"\nkind = "1-phase"\n'
    ready = prepared(tmp_path, fault, RADIAL.replace("line_z0 = 3.0\n", ""))
    topic = QuestionTopic("sequence data: line_z0")
    (asked,) = (one for one in ready.questions if one.topic == topic)
    assert asked.place.endswith("events.0")
    assert "1 element: l23" in asked.text
    assert "line_z0 = " in asked.text


def test_a_fault_along_what_is_taken_for_a_transformer_is_asked_about(tmp_path):
    def asked(line, base):
        fault = f'[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "{line}"\nat = "50 %"\n'
        ready = prepared(tmp_path, fault, base)
        return [one.text for one in ready.questions if f"{line} has no charging" in one.text]

    bare = RADIAL.replace('groups.step_up = "YNd"\n', "")
    (text,) = asked("step_up", bare)
    assert "alone leads to the units at b2" in text or "alone leads to the units at b1" in text
    assert "put the fault at b2 or b1, or give the line its charging B" in text
    assert asked("step_up", bare.replace("X = 0.02 }", "X = 0.02, B = 0.001 }")) == []
    assert asked("l23", bare) == []


def test_a_short_circuit_of_one_phase_has_pandapowers_current(tmp_path):
    """Source, step-up transformer and line without loads; pandapower's c and K_T are those of IEC 60909."""
    text = RADIAL + '[[events]]\ntype = "bus_fault"\ntime = "0.1 s"\nbus = "b3"\nkind = "1-phase"\n'
    (found,) = prepared(tmp_path, text, "").faults
    net = pp.create_empty_network(sn_mva=100, f_hz=50)
    buses = [pp.create_bus(net, kv) for kv in (20.0, 110.0, 110.0)]
    pp.create_ext_grid(
        net, buses[0], s_sc_max_mva=1.1 * 1000, rx_max=0.1, x0x_max=1.0, r0x0_max=0.1
    )
    trafo = {"vk_percent": 10.0, "vkr_percent": 0.0, "vk0_percent": 10.0, "vkr0_percent": 0.0}
    pp.create_transformer_from_parameters(
        net,
        buses[1],
        buses[0],
        500.0,
        110.0,
        20.0,
        pfe_kw=0,
        i0_percent=0,
        vector_group="YNd",
        shift_degree=0,
        mag0_percent=1e9,
        mag0_rx=0,
        si0_hv_partial=0.9,
        **trafo,
    )
    base = 110.0**2 / 100
    pp.create_line_from_parameters(
        net,
        buses[1],
        buses[2],
        1.0,
        0.01 * base,
        0.1 * base,
        0.0,
        10.0,
        r0_ohm_per_km=0.03 * base,
        x0_ohm_per_km=0.3 * base,
        c0_nf_per_km=0.0,
    )
    sc.calc_sc(net, fault="1ph", case="max")
    k_t = 0.95 * 1.1 / (1 + 0.6 * 0.1)
    change = 0.02j * (k_t - 1)  # of the transformer's X on 100 MVA, in all three sequences
    z = 2 * found.negative + found.zero + 3 * change
    ikss = np.sqrt(3) * 1.1 * 100 / 110 / abs(z)
    assert net.res_bus_sc.ikss_ka.iloc[2] == pytest.approx(ikss, rel=1e-3)


def test_a_pole_of_a_line_that_feeds_nothing_opens_the_line(tmp_path):
    base = RING.replace(
        "lines.l12", 'lines.l34 = { from = "b3", to = "b4", X = 0.02 }\nlines.l12', 1
    )
    text = '[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l34"\nat = 0.5\nkind = "1-phase"\n'
    ready = prepared(
        tmp_path, text + 'duration = "50 ms"\nopens = "pole"\nreclose_after = "100 ms"\n', base
    )
    *_, opened, closed = ready.events
    assert (opened.line, opened.connected, closed.connected) == ("l34", False, True)
    assert isinstance(opened, LineSwitching)
    assert isinstance(closed, LineSwitching)
    assert [q for q in ready.questions if "the whole line opens" in str(q)]


def test_a_fault_on_a_line_that_is_open_at_one_end_is_that_of_three_phases(tmp_path):
    trip = '[[events]]\ntype = "line_trip"\ntime = "50 ms"\nline = "l31"\nat = "b3"\n'
    fault = '[[events]]\ntype = "line_fault"\ntime = "0.1 s"\nline = "l31"\nat = 0.4\nR = 0.01\n'
    ready = prepared(tmp_path, trip + fault + 'kind = "1-phase"\n')
    v, reference = compared(ready, 0.102)
    reference.add_lines(split=("l31", 0.4), open_at_from=True)
    reference.fault(3, "1-phase", 0.01)
    assert v == pytest.approx(reference.positive()[:3], rel=1e-3)


@pytest.mark.parametrize(
    ("groups", "words"),
    [
        ('groups.l13 = "YNd"', "there is no branch 'l13'; did you mean"),
        ('groups.l12 = "YNynd"', "'YNynd' has 3 windings, and l12 2"),
        ('groups.l12 = "YX"', "pattern"),
    ],
)
def test_a_vector_group_of_nothing_is_refused(groups, words, tmp_path):
    base = RING.replace("line_z0 = 2.5", f"line_z0 = 2.5\n{groups}")
    with pytest.raises(CaseError, match=words):
        prepared(tmp_path, "", base)


def test_a_screening_takes_an_open_end_as_a_value_of_a_point(tmp_path):
    trip = '[[events]]\ntype = "line_trip"\ntime = "0.1 s"\nline = "l31"\nat = "b3"\n'
    prepared(tmp_path, trip)
    points = {"open": {"grid.l31.from_connected": False}}
    found = gfor.load(tmp_path / "case.toml").screen(points, outages="l23")
    items = found.items().set_index("outage")
    assert items.loc["intact", "status"] == "computed"
    assert items.loc["l23", "status"] == "computed"  # b3 and its load are lost, not an island


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("bus_9, 150 ms, 1-phase", {"bus": "bus_9", "kind": "1-phase", "duration": 0.15}),
        (
            "bus 9, 150 ms, 2-phase-earth, opens line_7_9, recloses after 1 s from 2 s",
            {"kind": "2-phase-earth", "cleared_by": "line_7_9", "reclose_after": 1.0, "time": 2.0},
        ),
        ("line_7_9 at 30 %, 100 ms, opens it", {"line": "line_7_9", "at": 0.3, "opens": "line"}),
        (
            "line_7_9 at 30 %, 100 ms, opens it at 7, recloses after 1 s",
            {"at": 0.3, "opens": "line", "opens_at": "bus_7", "reclose_after": 1.0},
        ),
        (
            "line_7_9 at 30 %, 100 ms, opens it at 7, other end after 400 ms from 2 s",
            {"opens_at": "bus_7", "other_end_after": 0.4, "duration": 0.1, "time": 2.0},
        ),
        (
            "bus_7, 100 ms, opens line_7_9 at bus_7 from 2 s",
            {"bus": "bus_7", "cleared_by": "line_7_9", "opens_at": "bus_7", "time": 2.0},
        ),
        (
            "A - B at 0.3, 100 ms, 1-phase, opens one pole, recloses after 500 ms",
            {"line": "A - B", "opens": "pole", "reclose_after": 0.5},
        ),
    ],
)
def test_faults_in_words(text, keys):
    table = event_of(Option.FAULT, text)
    assert {key: getattr(table, key) for key in keys} == keys


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("bus_9, 150 ms, recloses after 1 s", "'reclose_after' needs 'cleared_by'"),
        ("bus_9, 150 ms, 3-phase-earth", "kind = '3-phase-earth'; it must be '3-phase'"),
        ("line_7_9 at 130 %, 100 ms", "at '130 %': along a line it is the share of the way"),
        ("line_7_9 at 30, 100 ms", "at '30': along a line it is the share of the way"),
        ("line_7_9 at 0 %, 100 ms", "a fault at an end of it is one at that bus"),
        (
            "line_7_9 at 0.01 %, 100 ms",
            "at '0.01 %': .* 'at 30 %', from 0.1 to 99.9 %; a fault at an end of it is one at that bus, as in 'bus_9",
        ),
        ("line_7_9 at 99.95 %, 100 ms", "at '99.95 %': .* as in 'bus_9, 150 ms'"),
        ("line_7_9 at bus_7, 100 ms", "at 'bus_7': along a line it is the share of the way"),
        ("line_7_9 at 30 %, 100 ms, opens line_8", "'opens it' or 'opens one pole'"),
        ("line_7_9 at 30 %, 100 ms, opens one pole", "opens = 'pole' is for a fault of kind"),
        ("bus_9, 150 ms, opens it at bus_9", "opens 'it': at a bus it names the line"),
        (
            "bus_7, 100 ms, opens line_7_9 at bus_7, other end after 400 ms",
            "'other end after' is of a fault along a line",
        ),
        ("line_7_9 at 30 %, 100 ms, opens line_8 at bus_8", "'opens it' or 'opens one pole'"),
    ],
)
def test_faults_in_words_that_are_none(text, words):
    with pytest.raises(InputError, match=words):
        event_of(Option.FAULT, text)
