"""OEL2C: times by hand, and the whole limiter beside a plain integration of its diagram with switches as events."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from fmus.synchronous_generator.composed import synchronous_generator_phasor
from fmus.synchronous_generator.parts import OELS
from tests.models.one_machine import OneMachine, three_buses
from tests.models.parts import AT_BUS, BUS, E_FD, integrated, limiter, refused
from tests.support.evaluated import Evaluated

REST = [E_FD, E_FD, 0.7, -0.1]
STEP = 1e-3

QUICK = {
    "input": 2.0,
    "SW": 1.0,
    "T_C1": 0.015,
    "T_B1": 0.08,
    "T_C2": 0.02,
    "T_B2": 0.1,
    "K_P": 0.35,
    "K_I": 0.8,
    "K_D": 0.01,
    "T_D": 0.08,
    "V_OELMIN3": -1.0,
    "V_OELMIN2": -1.0,
    "V_OELMIN1": -1.0,
    "I_reset": 0.4,
    "T_en": 0.12,
    "T_off": 0.4,
    "I_THoff": 0.04,
    "K_scale": 0.4,
    "T_R": 0.02,
    "K_act": 1.02,
    "I_TFpu": 0.95,
    "I_inst": 1.45,
    "I_lim": 1.1,
    "T_A": 0.05,
    "c_1": 1.8,
    "K_1": -0.9,
    "c_2": 2.0,
    "K_2": 0.9,
    "V_INVMAX": 0.5,
    "V_INVMIN": -0.5,
    "FIXED_ru": -0.2,
    "FIXED_rd": 0.1,
    "T_FCL": 0.5,
    "T_max": 0.6,
    "T_min": 0.0,
    "K_FB": 0.0,
    "K_rd": -2.0,
    "K_ru": 2.0,
    "K_ZRU": 0.9,
    "V_OELMAX3": 0.0,
    "V_OELMAX2": 0.0,
    "V_OELMAX1": 0.0,
}
"""Every block takes part; at rest the current is 0.88 pu of the input."""


def within(x, low, high):
    return min(max(x, low), high)


@dataclass
class Diagram:
    """The diagram with its switches as events, integrated by Euler in steps of a tenth of a millisecond."""

    p: dict
    x: dict = field(init=False)
    is_set: bool = False
    over_for: float = 0.0
    below_for: float = 0.0

    def __post_init__(self):
        sensed, top = self.p["K_scale"] * E_FD, self.p["I_inst"]
        self.is_set = self.p["T_en"] == 0
        error = top + self.bias() - self.p["K_act"] * sensed
        self.x = {"sensed": sensed, "reference": top, "lagged": top, "slow": error}
        self.x |= dict.fromkeys(("timer", "integral", "stage_2", "stage_1"), 0.0)

    def bias(self):
        return 0.0 if self.is_set else self.p["I_reset"]

    def activate(self, act, left, h):
        reference = self.x["reference"]
        self.over_for = self.over_for + h if act > reference else 0.0
        if left <= 0 or self.over_for >= self.p["T_en"]:
            self.is_set = True
        far = reference >= self.p["I_inst"] and reference - act > self.p["I_THoff"]
        self.below_for = self.below_for + h if self.is_set and left > 0 and far else 0.0
        if self.below_for >= self.p["T_off"] and self.p["T_en"] > 0:
            self.is_set = False

    def reference_rate(self, ratio, left):
        p = self.p
        up, down = p["K_ru"], p["K_rd"]
        if p["SW"] == 2:
            up = down = p["K_1"] * (ratio ** p["c_1"] - 1)
        if left >= p["K_ZRU"] * p["T_FCL"]:
            return up
        return down if left <= 0 else 0.0

    def step(self, I_fd, h):
        p, x = self.p, self.x
        ratio, act = x["sensed"] / p["I_TFpu"], p["K_act"] * x["sensed"]
        left = p["T_FCL"] - x["timer"]
        self.activate(act, left, h)
        inverse = within(p["K_2"] * (ratio ** p["c_2"] - 1), p["V_INVMIN"], p["V_INVMAX"])
        runs = inverse + (p["FIXED_ru"] if ratio <= 1 else p["FIXED_rd"]) - p["K_FB"] * x["timer"]
        error = self.bias() + x["lagged"] - act
        slope = p["K_D"] / p["T_D"] * (error - x["slow"])
        wanted = p["K_P"] * error + x["integral"] + slope
        pid = within(wanted, p["V_OELMIN3"], p["V_OELMAX3"])
        lead = p["T_C2"] / p["T_B2"]
        first = within(lead * pid + (1 - lead) * x["stage_2"], p["V_OELMIN2"], p["V_OELMAX2"])
        lead = p["T_C1"] / p["T_B1"]
        out = within(lead * first + (1 - lead) * x["stage_1"], p["V_OELMIN1"], p["V_OELMAX1"])
        above = wanted >= p["V_OELMAX3"] and error > 0
        waits = above or (wanted <= p["V_OELMIN3"] and error < 0)
        rise = self.reference_rate(ratio, left)
        x["sensed"] += h * (p["K_scale"] * I_fd - x["sensed"]) / p["T_R"]
        x["slow"] += h * (error - x["slow"]) / p["T_D"]
        x["integral"] += 0.0 if waits else h * p["K_I"] * error
        x["stage_2"] += h * (pid - x["stage_2"]) / p["T_B2"]
        x["stage_1"] += h * (first - x["stage_1"]) / p["T_B1"]
        x["lagged"] += h * (x["reference"] - x["lagged"]) / p["T_A"]
        x["timer"] = within(x["timer"] + h * runs, p["T_min"], p["T_max"])
        x["reference"] = within(x["reference"] + h * rise, p["I_lim"], p["I_inst"])
        return out


def field_current(t):
    """Above the pickup until the timer has run out, far above both limits, back until it is released, and far above."""
    if t < 0.2:
        return E_FD
    if t < 1.5:
        return 3.2
    return 4.2 if t < 2.0 or t > 3.4 else 1.9


END = 3.9  # s


def signal_of_diagram(p):
    diagram, h = Diagram(p), STEP / 10
    fine = [diagram.step(field_current(STEP * (k // 10)), h) for k in range(round(END / h))]
    return np.array(fine[::10])


def limited(values, end, current=field_current, E_fd=E_FD, x=None):
    alone = limiter(values, oel=OELS["oel2c"])
    assert not refused(alone)
    found, x = integrated(alone, lambda t: [current(t), E_fd, 0.7, -0.1], end, STEP, x=x)
    return np.array([each["v_s"] for each in found]), x


@pytest.mark.parametrize(
    "changed",
    [{}, {"SW": 2.0}, {"K_FB": 0.4}, {"T_en": 0.0}, {"T_off": 0.05}],
    ids=["fixed rates", "rates by current", "timer with feedback", "always set", "released"],
)
def test_the_limiter_follows_its_diagram_step_by_step(changed):
    """Switches are events there, and latches of 2 ms here."""
    p = QUICK | changed
    wanted, (found, _) = signal_of_diagram(p), limited(p, END)
    assert wanted.min() < -0.3
    assert np.abs(found - wanted).max() < 0.01 * np.abs(wanted).max()


def test_after_its_release_it_waits_again_before_it_limits():
    """Released it adds I_reset to the reference until the current has been above the reference during T_en."""
    (released, _), (kept, _) = (
        limited(QUICK | {"I_reset": 2.0, "T_off": x}, 3.6) for x in (0.05, 99.0)
    )
    waits = slice(3400, 3500)
    assert kept[waits].min() < -0.05
    assert released[waits].min() > -1e-4
    assert released[-1] < -0.02


@pytest.mark.parametrize(("off", "released"), [(0.01, True), (0.05, False)])
def test_it_is_released_further_below_its_reference_than_its_threshold(off, released):
    """Set at 3.2 pu, then 0.03 pu below the reference of 3 pu for longer than T_off, and at 3.2 pu again."""
    values = {"I_inst": 3.0, "I_lim": 3.0, "T_en": 0.1, "T_off": 0.2, "K_I": 0.0, "I_THoff": off}
    signal, _ = limited(values, 1.05, lambda t: 2.97 if 0.4 <= t < 1.0 else 3.2)
    assert signal[390] < -0.05
    assert (signal[-1] > -1e-3) == released


SAMPLE = {"T_FCL": 1.0, "T_max": 1.0, "T_A": 0.0, "T_R": 0.0}
"""Sample data of the standard, with a tenth of its time without lags."""


@pytest.mark.parametrize("I_fd", [3.6, 4.5])
def test_it_waits_for_its_inverse_time(I_fd):
    """T_FCL/(K_2·(r² − 1) + FIXED_rd), and then it limits at once: the reference falls at 1000 pu/s."""
    time = 1.0 / (0.296 * ((I_fd / 3.0) ** 2 - 1) - 0.001)
    signal, _ = limited(SAMPLE, time + 0.1, lambda t: I_fd)
    moved = np.flatnonzero(signal < -1e-6)
    assert moved[0] * STEP == pytest.approx(time, abs=0.012)


def test_above_its_instantaneous_limit_it_acts_after_its_delay():
    signal, _ = limited({}, 0.6, lambda t: 6.5)
    assert np.flatnonzero(signal < -1e-6)[0] * STEP == pytest.approx(0.2 + 0.01, abs=0.03)
    assert np.allclose(limited({}, 0.6, lambda t: 5.9)[0], 0.0)


def test_its_input_says_if_it_limits_the_field_voltage_or_the_current():
    low, high = lambda t: E_FD, lambda t: 6.5
    for kind, acts in ((1.0, (False, True)), (2.0, (True, False))):
        by_current, _ = limited({"input": kind}, 0.6, high)
        by_voltage, _ = limited({"input": kind}, 0.6, low, E_fd=6.5)
        assert (by_current[-1] < -0.01, by_voltage[-1] < -0.01) == acts


def test_a_start_beyond_its_limits_rests_and_1_percent_above_it_acts():
    scaled = {"I_inst": 2.3, "I_lim": 2.0, "K_act": 1.1, "I_reset": 0.0}
    late = {"K_FB": 0.1, "FIXED_ru": 9.0}
    for values in ({"I_TFpu": 2.0}, {"I_inst": 2.1, "I_lim": 2.0}, late, scaled):
        alone = limiter(values, oel=OELS["oel2c"])
        assert not refused(alone)
        assert max(map(abs, alone.rates(REST).values())) < 1e-9
        assert alone.outputs(REST)["oel.acts"] == 0
    beyond = {"I_inst": 2.1, "I_lim": 2.0}
    assert np.allclose(limited(beyond, 0.6, lambda t: 1.005 * E_FD)[0], 0.0)
    assert limited(beyond, 0.6, lambda t: 1.02 * E_FD)[0][-1] < -1e-3


@pytest.mark.parametrize("values", [{}, QUICK, QUICK | {"SW": 2.0}, {"T_R": 0.0}])
def test_at_rest_no_state_is_undecided(values):
    """States that wait have an eigenvalue far from 0, as each state of the limiter."""
    alone = limiter(values, oel=OELS["oel2c"])
    A = np.array(alone.blocks(REST)[0], dtype=float)
    assert np.linalg.eigvals(A).real.max() < -0.1


MACHINE = """102 'GENROU' 1 7.4 0.03 0.5 0.05 3.1 0.0 1.25 1.2 0.35 0.5 0.25 0.06 0.0 0.0 /
102 'EXST1' 1 0.01 99 -99 0 0 100 0.02 9 -9 0 0 1 /
102 'OEL2C' 1 2 1 0.1 0.1 0.1 0.1 0.01 0.4 0 0.1 0 -1 0 -1 0 -1 9 0.2 5 0.05
 0.5 0.01 1 1.05 2.2 0.95 0.04 0 0 2 0.9 9 0 0 -0.001 0.3 0.3 0 0 -9 9 0.99 2 /
"""


def test_a_machine_that_is_asked_for_too_much_ends_at_its_thermal_limit(tmp_path):
    """A step of the reference lifts the field current above ITFPU/KSCALE; in time it comes down to ILIM/KSCALE."""
    network, _ = three_buses()
    one = OneMachine(MACHINE, tmp_path, network, torque=True)
    rows = one.run(network.lines, 10.0, every=0.5, changed={"exciter.delta_V_ref": 0.08})
    field = {time: out["E_fd"] for time, out, _ in rows}
    assert field[0.0] < 2.1 < field[2.0]
    assert rows[-1][1]["E_fd"] == pytest.approx(0.95 / 0.5, rel=2e-3)
    assert [rows[k][1]["oel.acts"] for k in (0, 4, -1)] == [0, 0, 1]


@pytest.mark.parametrize("oel", ["oel2c", "oel3c"])
@pytest.mark.parametrize("name", ["sexs", "st1a", "ac1a"])
def test_a_generator_with_it_starts_in_steady_state(name, oel):
    machine = Evaluated(synchronous_generator_phasor(exciter=name, oel=oel), AT_BUS)
    assert not refused(machine)
    at = [BUS.real, BUS.imag]
    assert max(map(abs, machine.rates(at).values())) < 1e-8
    assert machine.outputs(at)["oel.acts"] == 0
