"""Faults of fewer than three phases and open poles, against the same network solved in phases a, b and c.

The reference knows no sequence networks: each element is a matrix of three phases, the fault an admittance between
phases or to earth, an open pole a phase without a conductor."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.systems.coupling.events import LineFault, PoleSwitching
from orchestrator.systems.coupling.master import Master

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
LINES = {"l12": (0, 1, 0.002 + 0.02j), "l23": (1, 2, 0.002 + 0.02j), "l31": (2, 0, 0.003 + 0.03j)}
BUSES = ("b1", "b2", "b3")
B1, Z0_Z1, B0_B1 = 0.04, 2.5, 0.5
A = np.exp(2j * np.pi / 3)
BOLTED = 1e8  # admittance between phases that touch


def of_sequences(zero, positive, negative):
    """A matrix of three phases of an element with these admittances."""
    T = np.array([[1, 1, 1], [1, A**2, A], [1, A, A**2]])
    return T @ np.diag([zero, positive, negative]) @ np.linalg.inv(T)


class Phases:
    """The ring in phases; a fourth node is the place of a fault along a line."""

    def __init__(self, emfs, machine, converter, loads):
        self.Y, self.driven = np.zeros((12, 12), dtype=complex), np.zeros(12, dtype=complex)
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

    def add_lines(self, split=None, open_phase=None):
        for name, (one, other, z) in LINES.items():
            for bus in (one, other):
                self.at(bus, bus, of_sequences(0.5j * B0_B1 * B1, 0.5j * B1, 0.5j * B1))
            if split is not None and split[0] == name:
                self.series(one, 3, split[1] * z)
                self.series(3, other, (1 - split[1]) * z)
            else:
                self.series(one, other, z, name == open_phase)

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

    def positive(self):
        """The positive sequence of all voltages."""
        used = [k for k in range(12) if self.Y[k].any()]
        v = np.zeros(12, dtype=complex)
        v[used] = np.linalg.solve(self.Y[np.ix_(used, used)], self.driven[used])
        return np.array([v[3 * k : 3 * k + 3] @ [1, A, A**2] / 3 for k in range(4)])


def prepared(folder, text, base=RING):
    (folder / "case.toml").write_text(base + text, encoding="utf-8")
    return load_case(folder / "case.toml").prepare()[0]


def compared(ready, time):
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
    return v, Phases(data, *sources, loads)


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
