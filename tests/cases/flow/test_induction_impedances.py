"""Induction machines in the negative sequence, against mesh equations of the same circuit.

A machine at the bus of a fault of two phases adds its admittance to that of the bus: the difference of two faults,
with the machine and without it, is the machine alone."""

import numpy as np
import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.scenario.short_circuit import ShortCircuit

GRID = """\
name = "one_line"
models = "phasor"
[solver]
stop_time = "0.5 s"
step_size = "1 ms"
[power_flow]
grid = "grid"
slack = "sg"
[network]
frequency = "60 Hz"
lines.l12 = {{ from = "b1", to = "b2", X = 0.02, R = 0.002, B = 0.04 }}
[components.sg]
model = "synchronous_generator_st1"
bus = "b1"
parameters.S_n = "1000 MVA"
[components.grid]
model = "grid"
{machine}
[[events]]
type = "bus_fault"
bus = "b2"
time = "0.1 s"
duration = "0.1 s"
kind = "2-phase"
"""
MACHINE = """\
[components.machine]
model = "{model}"
bus = "b2"
parameters = {{ {parameters} }}
"""
RATING, DRAWN = 400.0, 0.75 + 0.1j  # [MVA] and [pu, S_n]
OMEGA_B = 2 * np.pi * 60
STATOR, X_M, FIRST, SECOND = 0.02 + 0.1j, 3.0, (0.03, 0.12), (0.01, 0.3)


def _prepared(tmp_path, name, machine):
    path = tmp_path / f"{name}.toml"
    path.write_text(GRID.format(machine=machine), encoding="utf-8")
    return load_case(path).prepare()[0]


def _negative_impedance(tmp_path, name, machine):
    """Return Z2 at b2 [pu, 100 MVA], and the voltage there before the fault [pu]."""
    ready = _prepared(tmp_path, name, machine)
    return ready.faults[0].seen, abs(ready.power_flow.voltages["b2"])


def _admittance(slip, second, nested):
    """Solve the meshes of stator and cages at a slip, of 1 pu of voltage [pu, S_n]."""
    first = FIRST[0] / slip + 1j * FIRST[1]
    meshes = [[STATOR + 1j * X_M, -1j * X_M], [-1j * X_M, 1j * X_M + first]]
    if second:
        common = 1j * (X_M + (FIRST[1] if nested else 0))
        own = common + SECOND[0] / slip + 1j * SECOND[1]
        meshes = [
            [*meshes[0], -1j * X_M],
            [*meshes[1], common],
            [-1j * X_M, common, own],
        ]
    return np.linalg.solve(np.array(meshes), np.eye(len(meshes))[0])[0]


def _expected(voltage, second, nested):
    """Return the admittance at 2 − s with the susceptance that makes up the reactive power [pu, 100 MVA]."""
    slips = np.linspace(1e-4, 0.1, 2001)
    drawn = np.array([voltage**2 * _admittance(s, second, nested).real for s in slips])
    rising = slice(drawn.argmax())
    slip = float(np.interp(DRAWN.real, drawn[rising], slips[rising]))
    reactive = -(voltage**2) * _admittance(slip, second, nested).imag
    beside = 1j * (reactive - DRAWN.imag) / voltage**2
    return RATING / 100 * (_admittance(2 - slip, second, nested) + beside)


def _motor(second=False, nested=False):
    R_2, X_2 = SECOND if second else (0.0, 0.0)
    values = {"S_n": RATING, "P_0": -DRAWN.real, "Q_0": -DRAWN.imag, "IT": 2 if nested else 1}
    values |= {"RA": STATOR.real, "XA": STATOR.imag, "XM": X_M}
    values |= {"R1": FIRST[0], "X1": FIRST[1], "R2": R_2, "X2": X_2}
    text = ", ".join(f"{name} = {value}" for name, value in values.items())
    return MACHINE.format(model="induction_motor", parameters=text)


def _generator():
    """The circuit of the first cage by its reactances; it draws, as the motor does."""
    X_p = STATOR.imag + X_M * FIRST[1] / (X_M + FIRST[1])
    values = {"S_n": RATING, "P_0": -DRAWN.real, "Q_0": -DRAWN.imag, "RA": STATOR.real}
    values |= {"X": STATOR.imag + X_M, "Xp": X_p, "Xl": STATOR.imag}
    values |= {"Tp": (X_M + FIRST[1]) / (OMEGA_B * FIRST[0])}
    text = ", ".join(f"{name} = {value}" for name, value in values.items())
    return MACHINE.format(model="induction_generator", parameters=text)


@pytest.mark.parametrize(
    ("machine", "second", "nested"),
    [
        (_motor(), False, False),
        (_motor(second=True), True, False),
        (_motor(second=True, nested=True), True, True),
        (_generator(), False, False),
    ],
    ids=["one cage", "two cages", "nested cages", "generator"],
)
def test_a_machine_is_its_circuit_at_the_slip_two_less_its_own(machine, second, nested, tmp_path):
    alone, _ = _negative_impedance(tmp_path, "alone", "")
    with_it, voltage = _negative_impedance(tmp_path, "with_it", machine)
    assert 1 / with_it - 1 / alone == pytest.approx(_expected(voltage, second, nested), rel=2e-4)


def test_in_a_short_circuit_a_motor_is_a_load_and_a_generator_stands_still(tmp_path):
    """Neither is a converter, which would have a short-circuit ratio."""
    names = {"alone": "", "motor": _motor(), "generator": _generator()}
    circuits = {
        name: ShortCircuit.of(_prepared(tmp_path, name, text)) for name, text in names.items()
    }
    assert [circuit.gscr() for circuit in circuits.values()] == [None, None, None]
    at = {
        name: next(bus for bus in circuit.strengths() if bus.bus == "b2")
        for name, circuit in circuits.items()
    }
    assert at["motor"] == at["alone"]
    alone = at["alone"]
    y = alone.s_sc_mva / 100 / np.exp(1j * np.arctan(alone.x_r))
    expected = abs(y + RATING / 100 * _admittance(1.0, False, False)) * 100
    assert at["generator"].s_sc_mva == pytest.approx(expected, rel=1e-6)
