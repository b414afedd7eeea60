"""OEL3C: times by hand, and the whole limiter beside a plain integration of Dynawo's diagram with its switch."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from fmus.synchronous_generator.parts import OELS
from tests.models.one_machine import OneMachine, three_buses
from tests.models.parts import E_FD, integrated, limiter, refused

REST = [E_FD, E_FD, 0.7, -0.1]
STEP = 1e-3

QUICK = {
    "input": 0.0,
    "I_TFpu": 0.95,
    "K_scale": 0.4,
    "T_F": 0.02,
    "K_1": 2.0,
    "K_oel": 0.8,
    "T_oel": 1.5,
    "K_P": 0.6,
    "V_OELMAX1": 0.25,
    "V_OELMIN1": -0.4,
    "V_OELMAX2": 0.0,
    "V_OELMIN2": -0.7,
}
"""Every block takes part; at rest the current is 0.88 pu of the input."""


def within(x, low, high):
    return min(max(x, low), high)


@dataclass
class Diagram:
    """The diagram with its switch as an event, integrated by Euler in steps of a tenth of a millisecond."""

    p: dict
    x: dict = field(init=False)

    def __post_init__(self):
        self.x = {"sensed": self.p["K_scale"] * E_FD, "integral": self.p["V_OELMAX1"]}

    def step(self, I_fd, h):
        p, x = self.p, self.x
        moved = x["integral"] + h * self.error() / p["T_oel"]
        x["integral"] = within(moved, p["V_OELMIN1"], p["V_OELMAX1"])
        x["sensed"] += h * (p["K_scale"] * I_fd - x["sensed"]) / p["T_F"]

    def error(self):
        p = self.p
        return p["K_oel"] * (p["I_TFpu"] ** p["K_1"] - self.x["sensed"] ** p["K_1"])

    def signal(self):
        p, integral = self.p, self.x["integral"]
        beside = 0.0 if integral >= 0 else p["K_P"] * self.error()
        return within(integral + beside, p["V_OELMIN2"], p["V_OELMAX2"])


END = 3.0  # s


def field_current(t):
    """Above the pickup until it limits, far above until lower limits hold, back until it lets go, and above."""
    if t < 0.2:
        return E_FD
    if t < 0.9:
        return 3.2
    return 5.0 if t < 1.7 else 1.5


def signal_of_diagram(p):
    """Its signal at the end of each step of the limiter's integration."""
    diagram, parts, found = Diagram(p), 10, []
    for k in range(round(END / STEP)):
        for _ in range(parts):
            diagram.step(field_current(k * STEP), STEP / parts)
        found.append(diagram.signal())
    return np.array(found)


def limited(values, end, current=field_current, E_fd=E_FD, x=None):
    alone = limiter(values, oel=OELS["oel3c"])
    assert not refused(alone)
    found, x = integrated(alone, lambda t: [current(t), E_fd, 0.7, -0.1], end, STEP, x=x)
    return np.array([each["v_s"] for each in found]), x


@pytest.mark.parametrize(
    "changed",
    [{}, {"K_1": 1.0}, {"K_P": 0.0}, {"V_OELMIN1": -2.0}, {"V_OELMAX1": 0.0}],
    ids=["both lower limits", "exponent 1", "integral alone", "output's limit", "at once"],
)
def test_the_limiter_follows_its_diagram_step_by_step(changed):
    p = QUICK | changed
    wanted, (found, _) = signal_of_diagram(p), limited(p, END)
    assert wanted.min() < -0.3
    assert (found > -1e-4).any()
    assert np.abs(found - wanted).max() < 0.01 * np.abs(wanted).max()


def test_its_lower_limits_hold():
    """The integral's, seen where nothing is beside it, and the signal's."""
    alone, _ = limited(QUICK | {"K_P": 0.0}, 2.0, lambda t: 5.0)
    assert alone.min() == pytest.approx(-0.4, abs=1e-4)
    both, _ = limited(QUICK, 2.0, lambda t: 5.0)
    assert both.min() == pytest.approx(-0.7, abs=1e-9)


@pytest.mark.parametrize("K_1", [1.0, 2.0])
@pytest.mark.parametrize("I_fd", [4.1, 5.0])
def test_it_waits_for_its_inverse_time_and_then_adds_its_proportional_part(K_1, I_fd):
    """Sample data with a tenth of their time: T_oel·V_OELMAX1/(K_oel·(I^K_1 − I_TFpu^K_1))."""
    excess = I_fd**K_1 - 3.7**K_1
    time = 2.4 * 0.66 / excess
    values = {"T_oel": 2.4, "T_F": 0.0, "K_1": K_1, "K_P": 0.01}
    signal, _ = limited(values, time + 0.1, lambda t: I_fd)
    moved = np.flatnonzero(signal < -1e-6)
    assert moved[0] * STEP == pytest.approx(time, abs=2 * STEP)
    assert signal[moved[0] + 1] == pytest.approx(-0.01 * excess, abs=2.5 * STEP * excess / 2.4)


def test_below_its_pickup_it_forgets_as_it_counts():
    """0.5 s at 5 pu are made up for by as long at 2.4 pu, as far below the pickup."""
    values = {"T_oel": 1.2, "T_F": 0.0}
    _, x = limited(values, 0.5, lambda t: 5.0)
    assert x.min() == pytest.approx(0.66 - 0.5 * 1.3 / 1.2, abs=2e-3)
    _, x = limited(values, 0.3, lambda t: 2.4, x=x)
    assert x.min() == pytest.approx(0.66 - 0.2 * 1.3 / 1.2, abs=2e-3)


@pytest.mark.parametrize(("kind", "by_current"), [(0.0, True), (1.0, False), (2.0, True)])
def test_its_input_says_if_it_limits_the_field_voltage_or_the_current(kind, by_current):
    values = {"input": kind, "T_oel": 0.2}
    current, _ = limited(values, 0.6, lambda t: 6.5)
    voltage, _ = limited(values, 0.6, lambda t: E_FD, E_fd=6.5)
    assert (current[-1] < -0.01, voltage[-1] < -0.01) == (by_current, not by_current)


def test_a_start_beyond_its_pickup_rests_and_1_percent_above_it_counts():
    beyond = {"I_TFpu": 2.0, "T_oel": 0.02, "V_OELMAX1": 0.1}
    alone = limiter(beyond, oel=OELS["oel3c"])
    assert not refused(alone)
    assert max(map(abs, alone.rates(REST).values())) < 1e-9
    assert alone.outputs(REST)["oel.acts"] == 0
    assert np.allclose(limited(beyond, 0.6, lambda t: 1.005 * E_FD)[0], 0.0)
    assert limited(beyond, 0.6, lambda t: 1.02 * E_FD)[0][-1] < -1e-3


@pytest.mark.parametrize(
    "values", [{}, QUICK, {"T_F": 0.0}, {"V_OELMAX1": 0.0}, {"I_TFpu": E_FD}, {"input": 1.0}]
)
def test_at_rest_no_state_is_undecided(values):
    """States that wait have an eigenvalue far from 0, as each state of the limiter."""
    alone = limiter(values, oel=OELS["oel3c"])
    assert max(map(abs, alone.rates(REST).values())) < 1e-9
    A = np.array(alone.blocks(REST)[0], dtype=float)
    assert np.linalg.eigvals(A).real.max() < -0.1


@pytest.mark.parametrize("limit", ["V_OELMIN1", "V_OELMIN2"])
def test_lower_limits_above_0_are_refused(limit):
    assert refused(limiter({limit: 0.1}, oel=OELS["oel3c"])) == [f"oel.{limit} must not exceed 0"]


MACHINE = """102 'GENROU' 1 7.4 0.03 0.5 0.05 3.1 0.0 1.25 1.2 0.35 0.5 0.25 0.06 0.0 0.0 /
102 'EXST1' 1 0.01 99 -99 0 0 100 0.02 9 -9 0 0 1 /
102 'OEL3C' 1 2 1.05 0.5 0.01 1 1 0.7 0.3 0.2 -1 0 -1 /
"""


def test_a_machine_that_is_asked_for_too_much_ends_at_its_pickup(tmp_path):
    """A step of the reference lifts the field current above ITFPU/KSCALE; in time it comes down to just that."""
    network, _ = three_buses()
    one = OneMachine(MACHINE, tmp_path, network, torque=True)
    rows = one.run(network.lines, 15.0, every=0.5, changed={"exciter.delta_V_ref": 0.08})
    field = {time: out["E_fd"] for time, out, _ in rows}
    assert field[0.0] < 2.1 < field[1.5]
    assert rows[-1][1]["E_fd"] == pytest.approx(1.05 / 0.5, rel=2e-3)
    assert [rows[k][1]["oel.acts"] for k in (0, 2, -1)] == [0, 0, 1]
