"""LCFB1: the loop around a governor beside a plain integration of its diagram, its limits, its start, and its modes."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from fmus.synchronous_generator import dyr_records
from fmus.synchronous_generator.composed import synchronous_generator_phasor
from fmus.synchronous_generator.parts import GOVERNORS, WITHOUT_REFERENCE
from fmus.synchronous_generator.turbines.load_control import with_load_control
from tests.models.parts import P_M, governor, integrated

STEP = 1e-3
QUICK = {
    "F_b": 4.0,
    "T_pelec": 0.08,
    "db": 0.01,
    "E_max": 0.15,
    "K_P": 0.4,
    "K_I": 1.5,
    "Ir_max": 0.2,
    "frequency_bias": True,
}
"""Every block takes part."""


def alone(values):
    """The loop at a governor that passes its reference on, behind speed and electrical power."""
    full = {f"governor.lcfb1.{name}": value for name, value in values.items()}
    return governor("ggov1", made=with_load_control(GOVERNORS["constant_power"]), full=full)


def added(values, end, inputs, x=None):
    """Return what the loop adds to the reference at every step, and the states at the end."""
    found, x = integrated(alone(values), inputs, end, STEP, x)
    return np.array([row["P_m"] for row in found]) - P_M, x


@dataclass
class Diagram:
    """The diagram as STEPS has it, integrated by Euler in steps of a tenth of a millisecond."""

    p: dict
    x: dict = field(default_factory=lambda: {"measured": P_M, "integral": 0.0})

    def error(self, w):
        p = self.p
        error = P_M - self.x["measured"] if p.get("power_control", True) else 0.0
        error -= p["F_b"] * (w - 1) if p.get("frequency_bias") else 0.0
        if abs(error) <= p["db"]:
            return 0.0
        beyond = error - np.copysign(p["db"], error)
        return min(max(beyond, -p["E_max"]), p["E_max"])

    def step(self, w, P_e, h):
        p, x = self.p, self.x
        moved = x["integral"] + h * p["K_I"] * self.error(w)
        x["integral"] = min(max(moved, -p["Ir_max"]), p["Ir_max"])
        x["measured"] += h * (P_e - x["measured"]) / p["T_pelec"]

    def signal(self, w):
        p = self.p
        return min(max(p["K_P"] * self.error(w) + self.x["integral"], -p["Ir_max"]), p["Ir_max"])


def swings(t):
    """Speed and electrical power that reach deadband, largest error and largest change, and come back."""
    return [1 - 0.03 * np.sin(2.1 * t), P_M - 0.12 * np.sin(0.9 * t) - 0.05 * (t > 2)]


@pytest.mark.parametrize(
    "changed",
    [{}, {"frequency_bias": False}, {"power_control": False}, {"db": 0.0, "K_P": 1.2}],
)
def test_it_follows_its_diagram(changed):
    values = QUICK | changed
    diagram, wanted = Diagram(values), []
    fine = 10
    for k in range(4000):
        w, P_e = swings(k * STEP)
        for _ in range(fine):
            diagram.step(w, P_e, STEP / fine)
        wanted.append(diagram.signal(w))
    got, _ = added(values, 4.0, swings)
    assert np.abs(got - wanted).max() < 2e-3
    assert np.ptp(wanted) > 0.1


def test_it_gives_back_the_power_of_the_start_at_its_rate():
    """Power 0.1 too high lowers the reference by K_I·0.1 per second; by 0.02 alone where E_max is that."""
    high = [1.0, P_M + 0.1]
    values = {"K_I": 0.05, "E_max": 1.0}
    got, _ = added(values, 2.0, lambda t: high)
    assert got[-1] == pytest.approx(-0.05 * 0.1 * 2.0, rel=1e-3)
    got, _ = added(values | {"E_max": 0.02}, 2.0, lambda t: high)
    assert got[-1] == pytest.approx(-0.05 * 0.02 * 2.0, rel=1e-3)


def test_its_change_is_limited_and_leaves_the_limit_at_once():
    values = {"K_I": 2.0, "E_max": 1.0, "Ir_max": 0.05}
    held, x = added(values, 1.0, lambda t: [1.0, P_M + 0.5])
    assert held[-1] == pytest.approx(-0.05, abs=1e-6)
    back, _ = added(values, 0.05, lambda t: [1.0, P_M - 0.5], x=x)
    assert back[-1] == pytest.approx(-0.05 + 2.0 * 0.5 * 0.05, abs=3e-3)


def test_errors_within_the_deadband_move_nothing():
    got, _ = added(QUICK | {"frequency_bias": False}, 1.0, lambda t: [1.0, P_M + 0.009])
    assert np.abs(got).max() < 1e-12


def test_without_flags_it_adds_nothing_and_its_integral_does_not_wait_at_0():
    off = QUICK | {"power_control": False, "frequency_bias": False}
    assert np.abs(added(off, 1.0, swings)[0]).max() < 1e-12
    for values in (off, {"K_I": 0.0}):
        A = np.array(alone(values).blocks([1.0, P_M])[0], dtype=float)
        assert np.linalg.eigvals(A).real.max() < -0.1


def test_it_starts_in_steady_state():
    part = alone(QUICK)
    assert max(map(abs, part.rates([1.0, P_M]).values())) < 1e-12


def test_its_linear_model_is_its_transfer_function():
    """From P_e to the reference −(K_P + K_I/s)/(1+sT); from the speed the same without the lag, by F_b."""
    values = QUICK | {"db": 0.0}
    A, B, C, D = (np.array(x, dtype=float) for x in alone(values).blocks([1.0, P_M]))
    s = 0.7j
    got = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
    control = values["K_P"] + values["K_I"] / s
    assert got[0] == pytest.approx(
        [-values["F_b"] * control, -control / (1 + s * values["T_pelec"])]
    )


@pytest.mark.parametrize("name", ["tgov1_lcfb1", "ggov1_lcfb1", "ieeeg1_lcfb1_pod"])
def test_a_governor_has_it_by_the_end_of_its_name(name):
    model = synchronous_generator_phasor(governor=name, exciter="sexs")
    assert "governor.lcfb1.K_I" in {v.name for v in model.parameters}


def test_a_governor_without_a_reference_has_none():
    with pytest.raises(ValueError, match="degov has no power reference that a load controller"):
        synchronous_generator_phasor(governor="degov_lcfb1")
    assert dyr_records.WITHOUT_REFERENCE == WITHOUT_REFERENCE
