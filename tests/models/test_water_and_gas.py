"""Governors of PSS/E with water, steam and gas turbines: transfer functions by hand, limits, curves, start values."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.synchronous_generator.turbines.curves import through_points
from fmus.toolchain.model_builder import ModelBuilder
from tests.models.one_machine import OneMachine, three_buses
from tests.models.parts import P_M, governor, integrated, refused
from tests.support.evaluated import Evaluated

HERTZ = pytest.mark.parametrize("hertz", [0.02, 0.3, 1.3, 6.0])

LINEAR = {
    "ieeeg2": {"K": 18.0, "T_1": 40.0, "T_2": 4.0, "T_3": 0.8, "T_4": 1.3},
    "ieeeg3": {
        "T_G": 0.5,
        "T_P": 0.04,
        "sigma": 0.05,
        "delta": 0.3,
        "T_R": 5.0,
        "T_W": 1.1,
        "a_11": 0.55,
        "a_13": 1.1,
        "a_21": 1.4,
        "a_23": 1.2,
    },
    "hygov2": {
        "K_P": 1.1,
        "K_I": 0.2,
        "K_A": 4.0,
        "T_1": 0.9,
        "T_2": 0.1,
        "T_3": 1.2,
        "T_4": 0.06,
        "T_5": 1.1,
        "T_6": 0.6,
        "T_R": 4.0,
        "r": 0.4,
        "R": 0.06,
        "P_MAX": 1.1,
    },
    "tgov3": {
        "K": 21.0,
        "T_1": 3.0,
        "T_2": 0.9,
        "T_3": 0.12,
        "T_4": 0.25,
        "K_1": 0.3,
        "T_5": 6.0,
        "K_2": 0.25,
        "T_6": 0.5,
        "K_3": 0.4,
    },
    "gast2a": {
        "W": 22.0,
        "X": 0.1,
        "Y": 0.3,
        "T_CD": 0.2,
        "T": 0.03,
        "E_CR": 0.02,
        "K_3": 0.77,
        "a": 1.1,
        "b": 0.06,
        "c": 1.2,
        "T_f": 0.4,
        "K_f": 0.1,
        "a_f2": -0.3,
        "b_f2": 1.3,
        "c_f2": 0.5,
        "K_6": 0.23,
        "T_rate": 80.0,
        "T_C": 1200.0,
    },
}
PID = {"R": 0.06, "K_P": 3.0, "K_I": 0.6, "K_D": 1.2}
WITH_CURVE = {"G_0": 0.1, "G_1": 0.4, "P_1": 0.3, "G_2": 0.8, "P_2": 0.75, "P_3": 0.95}
SLOPE = (0.75 - 0.3) / (0.8 - 0.4)  # of that curve at P_M


def delay(s, T):
    return (1 - s * T / 2 + (s * T) ** 2 / 12) / (1 + s * T / 2 + (s * T) ** 2 / 12)


def water(s, T):
    return (1 - s * T) / (1 + s * T / 2)


def by_hand(name, p, s):
    """P_m over the speed."""
    if name == "ieeeg2":
        control = p["K"] * (1 + s * p["T_2"]) / (1 + s * p["T_1"]) / (1 + s * p["T_3"])
        return -control * water(s, p["T_4"])
    if name == "ieeeg3":
        forward = 1 / (p["T_G"] * (1 + s * p["T_P"]) * s)
        droop = p["sigma"] + p["delta"] * s * p["T_R"] / (1 + s * p["T_R"])
        lead = p["a_11"] - p["a_13"] * p["a_21"] / p["a_23"]
        turbine = p["a_23"] * (1 + lead * s * p["T_W"]) / (1 + p["a_11"] * s * p["T_W"])
        return -forward / (1 + forward * droop) * turbine
    if name == "hygov2":
        forward = p["K_A"] * (1 + s * p["T_1"]) / (s * p["T_3"]) / s
        forward *= (1 + s * p["T_2"]) / (1 + s * p["T_4"])
        droop = p["R"] + p["r"] * s * p["T_R"] / (1 + s * p["T_R"])
        gate = -(p["K_P"] + p["K_I"] / s) * forward / (1 + forward * droop)
        return gate * p["P_MAX"] * (1 - s * p["T_5"]) / (1 + s * p["T_6"])
    if name == "tgov3":
        valve = -p["K"] * (1 + s * p["T_2"]) / (1 + s * p["T_1"]) / (1 + s * p["T_3"])
        chest = valve / (1 + s * p["T_4"])
        reheated = chest / (1 + s * p["T_5"])
        return p["K_1"] * chest + (p["K_2"] + p["K_3"] / (1 + s * p["T_6"])) * reheated
    return gast2a_by_hand(p, s)


def gast2a_by_hand(p, s):
    share = p["T_rate"] / 100.0
    power = P_M / share
    flow = (power - p["a_f2"]) / p["b_f2"]
    asked = ((p["c"] / p["a"] + p["K_f"]) * flow - p["K_6"]) / p["K_3"]
    by_speed = asked - p["W"] * (1 + s * p["X"]) / (1 + s * p["Y"])  # product with the speed
    forward = p["a"] / (p["c"] + s * p["b"]) / (1 + s * p["T_f"])
    fuel = p["K_3"] * delay(s, p["T"]) * by_speed * forward / (1 + p["K_f"] * forward)
    burnt = fuel * delay(s, p["E_CR"]) / (1 + s * p["T_CD"])
    return share * (power + p["b_f2"] * burnt - p["c_f2"])


@HERTZ
@pytest.mark.parametrize("name", LINEAR)
def test_a_governor_is_its_block_diagram(name, hertz):
    p, s = LINEAR[name], 2j * np.pi * hertz
    alone = governor(name, p)
    assert not refused(alone)
    assert alone.outputs([1.0])["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates([1.0]).values())) < 1e-11
    assert alone.response(s, [1.0])["P_m", "w"] == pytest.approx(by_hand(name, p, s), rel=1e-6)


@HERTZ
@pytest.mark.parametrize("gate_droop", [0, 1])
@pytest.mark.parametrize("name", ["pidgov", "wpidhy"])
def test_a_pid_governor_is_its_block_diagram(name, gate_droop, hertz):
    s = 2j * np.pi * hertz
    p = PID | {"T_reg": 0.03, "T_a": 0.05, "T_b": 0.4, "T_W": 1.2, "D_turb": 0.3} | WITH_CURVE
    switch = {"gate_droop": gate_droop, "A_TW": 1.1} if name == "pidgov" else {}
    alone = governor(name, p | switch)
    at_rest = [1.0, P_M]
    assert not refused(alone)
    assert alone.outputs(at_rest)["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates(at_rest).values())) < 1e-12
    control = (p["K_P"] + p["K_I"] / s + s * p["K_D"]) / (1 + s * p["T_a"]) ** 2
    gate = control / (1 + s * p["T_b"]) / (1 if name == "pidgov" else s)
    droop = p["R"] / (1 + s * p["T_reg"])
    closed = gate / (1 + droop * gate) if switch.get("gate_droop") else gate
    turbine = SLOPE * water(s, p["T_W"] * switch.get("A_TW", 1.0))
    response = alone.response(s, at_rest)
    assert response["P_m", "w"] == pytest.approx(-closed * turbine - p["D_turb"], rel=1e-6)
    of_power = 0.0 if switch.get("gate_droop") else -droop * gate * turbine
    assert response["P_m", "P_e"] == pytest.approx(of_power, rel=1e-6, abs=1e-12)


@HERTZ
@pytest.mark.parametrize("T_d", [0.0, 0.06])
@pytest.mark.parametrize("T_t", [0.0, 0.3])
@pytest.mark.parametrize("curve", [True, False])
def test_wshygp_is_its_block_diagram(curve, T_t, T_d, hertz):
    s = 2j * np.pi * hertz
    p = PID | {"T_f": 0.1, "K_G": 2.2, "T_P": 0.06, "A_turb": -1.0, "B_turb": 0.5, "T_turb": 0.9}
    x, y = (0.0, 0.3, 0.6, 0.8, 1.0), (0.0, 0.25, 0.55, 0.8, 1.0)
    names = [f"{kind}_{k}" for kind in ("GV", "PGV") for k in range(1, 6)]
    points = dict(zip(names, (*x, *y) if curve else [0.0] * 10, strict=True))
    alone = governor("wshygp", p | points | {"T_t": T_t, "T_d": T_d, "T_rate": 125.0})
    at_rest = [1.0, P_M]
    assert not refused(alone)
    assert alone.outputs(at_rest)["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates(at_rest).values())) < 1e-12
    control = p["K_P"] + p["K_I"] / s + s * p["K_D"] / (1 + s * p["T_f"])
    control /= 1 + s * T_d
    if not T_t:
        control /= 1 + p["R"] * control
    servo = p["K_G"] / (1 + s * p["T_P"]) / s
    slope = (0.8 - 0.55) / (0.8 - 0.6) if curve else 1.0
    lead, lag = -p["T_turb"], 0.5 * p["T_turb"]
    whole = 1.25 * control * servo / (1 + servo) * slope * (1 + s * lead) / (1 + s * lag)
    response = alone.response(s, at_rest)
    assert response["P_m", "w"] == pytest.approx(-whole, rel=1e-6)
    of_power = -p["R"] / (1 + s * T_t) * whole / 1.25 if T_t else 0.0
    assert response["P_m", "P_e"] == pytest.approx(of_power, rel=1e-6, abs=1e-12)


WEHGOV = {"R_gate": 0.05, "R_Pe": 0.03, "T_Pe": 0.4, "K_P": 3.0, "K_I": 0.6, "K_D": 1.2}
WEHGOV |= {"T_D": 0.1, "T_P": 0.06, "T_DV": 0.09, "T_g": 0.25, "T_W": 1.1, "D_turb": 0.3}


@HERTZ
@pytest.mark.parametrize("of_control", [True, False])
def test_wehgov_is_its_block_diagram(of_control, hertz):
    """At 0.7 pu between points 7 and 8 of the power by the flow, and 3 and 4 of the flow by the gate."""
    s, p = 2j * np.pi * hertz, WEHGOV
    curve = {"FlowG_4": 0.8}  # between 0.5 and 0.75 the flow rises by 0.3, from there by 0.2
    alone = governor("wehgov", p | curve | {"feedback_of_control": of_control})
    at_rest = [1.0, P_M]
    assert not refused(alone)
    assert alone.outputs(at_rest)["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates(at_rest).values())) < 1e-12
    q = 0.7 + 0.1 * (P_M - 0.64) / (0.77 - 0.64)
    gate = 0.5 + 0.25 * (q - 0.5) / 0.3
    assert alone.states["governor.gate"] == pytest.approx(gate, rel=1e-12)
    control = p["K_P"] + p["K_I"] / s + s * p["K_D"] / (1 + s * p["T_D"])
    servo = 1 / (1 + s * p["T_DV"]) / (s * p["T_g"])
    servo = servo / (1 + servo) / (1 + s * p["T_P"])
    loop = p["R_gate"] * control * (1 if of_control else servo)
    moved = control * servo / (1 + loop)  # of the gate, by the error without the gate's own droop
    water = p["T_W"] * q / 2 * s  # dq = dg'·flow/(1 + s·T_W·q/2), H = (q/flow)²
    flow = 0.3 / 0.25 / (1 + water)
    head = -2 / q * 0.3 / 0.25 * water / (1 + water)
    of_gate = (0.77 - 0.64) / 0.1 * flow + P_M * head
    response = alone.response(s, at_rest)
    wanted = -moved * of_gate - p["D_turb"] * gate
    assert response["P_m", "w"] == pytest.approx(wanted, rel=1e-6)
    of_power = 0 if of_control else -p["R_Pe"] / (1 + s * p["T_Pe"]) * moved * of_gate
    assert response["P_m", "P_e"] == pytest.approx(of_power, rel=1e-6, abs=1e-12)


def test_wehgov_rests_in_its_dead_band_and_acts_by_what_is_beyond():
    values = {"db": 0.002, "R_gate": 0.05, "feedback_of_control": 1}
    alone, free = governor("wehgov", values), governor("wehgov", values | {"db": 0.0})
    within = alone.rates([1.0019, P_M])
    assert max(map(abs, within.values())) < 1e-12
    beyond, wanted = alone.rates([1.0, P_M]), free.rates([1.0, P_M])
    assert beyond == pytest.approx(wanted, abs=1e-12)
    assert alone.rates([1.005, P_M]) == pytest.approx(free.rates([1.003, P_M]), rel=1e-9)


def test_wehgov_starts_where_its_curves_end_in_zeros():
    """Tables of fewer points; and a flow at no load, below which the power is 0."""
    short = {f"{name}_{k}": 0.0 for name in ("FlowP", "PMECH") for k in range(4, 11)}
    values = {"FlowP_3": 1.0, "PMECH_3": 0.9, "Gate_3": 1.0, "FlowG_3": 0.95, "FlowG_2": 0.4}
    values |= {f"{name}_{k}": 0.0 for name in ("Gate", "FlowG") for k in (4, 5)}
    alone = governor("wehgov", values | short)
    assert not refused(alone)
    q = 0.2 + 0.8 * P_M / 0.9
    assert alone.states["governor.q"] == pytest.approx(q, rel=1e-12)
    assert alone.states["governor.gate"] == pytest.approx(0.25 + 0.75 * (q - 0.4) / 0.55, rel=1e-12)
    assert max(map(abs, alone.rates([1.0, P_M]).values())) < 1e-12
    assert any(
        "PMECH_10" in text for text in refused(governor("wehgov", {**short, "PMECH_3": 0.6}))
    )


@pytest.mark.parametrize("name", ["pidgov", "wshygp"])
def test_a_controller_without_an_integral_holds_its_error(name):
    alone = governor(name, {"K_I": 0.0, "T_d": 0.0} if name == "wshygp" else {"K_I": 0.0})
    assert not refused(alone)
    assert alone.outputs([1.0, P_M])["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates([1.0, P_M]).values())) < 1e-12


# -- WSIEG1 -------------------------------------------------------------------------------------

WSIEG1 = {"K": 18.0, "T_1": 7.0, "T_2": 2.5, "T_3": 0.12, "U_o": 0.3, "U_c": -0.4}
WSIEG1 |= {"T_4": 0.25, "T_5": 6.0, "T_6": 0.5, "T_7": 0.4, "db_1": 6e-4}
WSIEG1 |= {f"K_{k}": part for k, part in enumerate((0.2, 0.1, 0.2, 0.1, 0.15, 0.05, 0.1, 0.1), 1)}
VALVES, STEAMS = (0.0, 0.3, 0.6, 0.8, 1.0), (0.0, 0.25, 0.55, 0.8, 1.0)
OF_VALVE = {f"GV_{k}": x for k, x in enumerate(VALVES, 1)}
OF_VALVE |= {f"PGV_{k}": y for k, y in enumerate(STEAMS, 1)}


def wsieg1_by_scipy(p, speed, end):
    """P_m at the end of a step of the speed, by another integration of the block diagram."""

    def rate(t, x):
        control, valve, *stages = x
        seen = np.sign(speed) * max(abs(speed) - p["db_1"], 0.0)
        asked = p["K"] * (p["T_2"] / p["T_1"] * (seen - control) + control)
        moved = np.clip((valve_0 - asked - valve) / p["T_3"], p["U_c"], p["U_o"])
        if valve >= p["P_MAX"]:
            moved = min(moved, 0.0)
        if valve <= p["P_MIN"]:
            moved = max(moved, 0.0)
        into = [np.interp(valve, VALVES, STEAMS), *stages[:-1]]
        lags = [p[f"T_{k}"] for k in (4, 5, 6, 7)]
        passed = [(a - b) / T for a, b, T in zip(into, stages, lags, strict=True)]
        return [(seen - control) / p["T_1"], moved, *passed]

    valve_0 = float(np.interp(P_M, STEAMS, VALVES))
    start = [0.0, valve_0, *[P_M] * 4]
    last = solve_ivp(rate, (0.0, end), start, rtol=1e-9, atol=1e-11, max_step=0.01).y[2:, -1]
    return sum((p[f"K_{2 * k + 1}"] + p[f"K_{2 * k + 2}"]) * x for k, x in enumerate(last))


@pytest.mark.parametrize("speed", [-0.02, -0.003, -5e-4, 0.0, 0.02])
def test_wsieg1_answers_a_step_of_the_speed_as_its_diagram_does(speed):
    """Within its dead band it rests; of a large step the valve moves at its rates, and stops at its limits."""
    p = WSIEG1 | {"P_MAX": 0.95, "P_MIN": 0.45}
    alone = governor("wsieg1", p | OF_VALVE)
    assert not refused(alone)
    assert max(map(abs, alone.rates([1.0]).values())) < 1e-12
    found, _ = integrated(alone, lambda t: [1.0 + speed], 4.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(wsieg1_by_scipy(p, speed, 4.0), abs=2e-6)
    if abs(speed) < p["db_1"]:
        assert found[-1]["P_m"] == pytest.approx(P_M, abs=1e-12)


@HERTZ
def test_wsieg1_without_dead_band_and_curve_is_ieeeg1(hertz):
    p = {name: value for name, value in WSIEG1.items() if name != "db_1"}
    s = 2j * np.pi * hertz
    both = [governor(name, p).response(s, [1.0])["P_m", "w"] for name in ("wsieg1", "ieeeg1")]
    assert both[0] == pytest.approx(both[1], rel=1e-12)


@pytest.mark.parametrize(
    ("block", "low", "high"), [(1, P_M, None), (2, None, P_M), (3, P_M, P_M), (0, None, None)]
)
def test_a_limit_of_zero_is_where_wsieg1_starts_if_its_block_says_so(block, low, high):
    """P_MIN = 0 with 1 and 3, P_MAX = 0 with 2 and 3; else the valve closes, and no valve opens beyond 0."""
    limits = {"P_MIN": 0.0, "P_MAX": 0.0 if high else 1.0}
    blocked = governor("wsieg1", limits | {"I_block": block, "T_5": 0.5})
    assert not refused(blocked)
    slow, fast = (integrated(blocked, lambda t, w=w: [w], 9.0, step=2e-3)[0] for w in (0.94, 1.06))
    assert fast[-1]["P_m"] == pytest.approx(0.0 if low is None else low, abs=1e-4)
    assert slow[-1]["P_m"] == pytest.approx(1.0 if high is None else high, abs=1e-4)
    if not high:
        at_zero = refused(governor("wsieg1", {"I_block": block, "P_MIN": 0.0, "P_MAX": 0.0}))
        assert any("governor.P_MAX" in text for text in at_zero)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ({"PGV_3": 0.4, "PGV_4": 0.5, "PGV_5": 0.6}, "governor.PGV_5"),
        ({"PGV_1": 0.75, "PGV_2": 0.8, "PGV_3": 0.85, "PGV_4": 0.9}, "governor.PGV_1"),
    ],
)
def test_wsieg1_refuses_a_power_that_its_curve_does_not_reach(points, said):
    assert any(said in text for text in refused(governor("wsieg1", OF_VALVE | points)))


# -- limits -------------------------------------------------------------------------------------

SETTLED = {
    # name: values, P_m with the gate or valve fully open, and closed
    "ieeeg2": ({"P_MAX": 0.9, "P_MIN": 0.2, "T_1": 0.0, "T_2": 0.0}, 0.9, 0.2),
    "ieeeg3": ({"P_MAX": 0.9, "P_MIN": 0.2}, 0.9, 0.2),
    "hygov2": ({"G_MAX": 0.9, "G_MIN": 0.2, "P_MAX": 1.1}, 0.99, 0.22),
    "tgov3": ({"P_MAX": 0.9, "P_MIN": 0.2, "T_5": 1.0}, 0.9, 0.2),
    "pidgov": ({"G_MAX": 0.8, "G_MIN": 0.4}, 0.8, 0.35),
    "wpidhy": ({"G_MAX": 0.8, "G_MIN": 0.4}, 0.8, 0.35),
    "wshygp": ({"P_MAX": 0.75, "P_MIN": 0.5}, 0.78, 0.48),
    "wehgov": ({"G_MAX": 0.8, "G_MIN": 0.5}, 0.77, 0.38),
    "wsieg1": ({"P_MAX": 0.9, "P_MIN": 0.2, "T_5": 1.0} | OF_VALVE, 0.9, 1 / 6),
}


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", SETTLED)
def test_the_gate_stops_at_its_limits(name, side):
    values, high, low = SETTLED[name]
    alone = governor(name, values)
    rest = [P_M] if len(alone.model.inputs) == 2 else []
    found, _ = integrated(alone, lambda t: [1 - side * 0.1, *rest], 40.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(high if side > 0 else low, rel=1e-5)


@pytest.mark.parametrize(
    ("name", "values", "fast"),
    [
        ("ieeeg3", {"U_o": 0.1, "U_c": -0.1}, 0.1),
        ("hygov2", {"V_GMAX": 0.1, "P_MAX": 1.0}, 0.1),
        ("tgov3", {"U_o": 0.1, "U_c": -0.1}, 0.1),
        ("wsieg1", {"U_o": 0.1, "U_c": -0.1}, 0.1),
        ("pidgov", {"V_MAX": 0.05, "V_MIN": -0.05}, 0.05),
        ("wpidhy", {"V_MAX": 0.05, "V_MIN": -0.05}, 0.05),
        ("wshygp", {"VEL_open": 0.05, "VEL_close": 0.05, "T_P": 0.0}, 0.05),
        ("wehgov", {"GTMX_OP": 0.05, "GTMX_CL": 0.05, "T_DV": 0.0}, 0.05),
    ],
)
@pytest.mark.parametrize("side", [1, -1])
def test_the_gate_moves_no_faster_than_its_rates(name, values, fast, side):
    alone = governor(name, values)
    at = [s.name for s in alone.model.states].index("governor.gate")
    rest = [P_M] if len(alone.model.inputs) == 2 else []
    steps = [integrated(alone, lambda t: [1 - side * 0.08, *rest], T)[1][at] for T in (0.2, 0.3)]
    assert steps[1] - steps[0] == pytest.approx(side * fast * 0.1, rel=1e-6)


def test_the_temperature_control_of_gast2a_takes_over_and_lets_go():
    """At 4 % too little speed its governor asks for all; the exhaust settles at T_C, and the fuel with it."""
    values = {"T_C": 850.0, "W": 25.0, "T_3": 1.0, "T_t": 450.0, "b_f1": 0.0, "c_f2": 0.0}
    alone = governor("gast2a", values)
    found, x = integrated(alone, lambda t: [0.96], 60.0, step=2e-3)
    flow = 1 - (950.0 - 850.0) / 700.0  # where K_4 + K_5 = 1 gives T_C
    assert found[-1]["P_m"] == pytest.approx(0.96 * (-0.3 + 1.3 * flow), rel=1e-4)
    found, _ = integrated(alone, lambda t: [1.01], 20.0, step=2e-3, x=x)
    asked = (P_M + 0.3) / 1.3 - 0.23
    asked = (asked / 0.77 - 25.0 * 0.01) * 0.77 * 1.01 + 0.23
    assert found[-1]["P_m"] == pytest.approx(1.01 * (-0.3 + 1.3 * asked), rel=1e-4)


def test_gast2a_refuses_an_exhaust_that_is_too_hot_at_the_start():
    assert any("governor.T_C" in text for text in refused(governor("gast2a", {"T_C": 700.0})))


def test_the_reheater_of_tgov3_stops_at_its_pressure():
    values = {"P_RMAX": 0.8, "T_5": 1.0, "U_o": 9.0, "K_1": 0.0, "K_2": 1.0, "K_3": 0.0}
    found, _ = integrated(governor("tgov3", values), lambda t: [0.95], 10.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(0.8, rel=1e-6)


# -- curves -------------------------------------------------------------------------------------


def test_a_curve_goes_through_its_points_and_ends_level():
    m = ModelBuilder("curve", "A curve")
    x = m.input("x", "1", "x")
    points = [(0.1, 0.0), (0.4, 0.3), (0.8, 0.75), (0.0, 0.0), (0.0, 0.0)]
    m.output("y", through_points(x, points), "1", "y")
    curve = Evaluated(m.build())
    found = [curve.outputs([at])["y"] for at in (0.0, 0.1, 0.25, 0.4, 0.6, 0.8, 1.2)]
    assert found == pytest.approx([0.0, 0.0, 0.15, 0.3, 0.525, 0.75, 0.75])


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("pidgov", {"G_1": 0.05}),
        ("wpidhy", {"P_2": 0.3}),
        ("wshygp", {"GV_3": 0.2}),
        ("wsieg1", OF_VALVE | {"GV_3": 0.2}),
        ("wehgov", {"FlowG_3": 0.2}),
    ],
)
def test_a_curve_that_falls_is_refused(name, values):
    assert any("must rise from point to point" in text for text in refused(governor(name, values)))


# -- another program ----------------------------------------------------------------------------

BEHIND = """
102 GENROU 1 8.0 0.03 0.4 0.05 6.175 0.05 1.8 1.7 0.3 0.55 0.25 0.2 0 1 /
102 SEXS 1 0.4 5.0 20.0 1.0 -50.0 50.0 /
"""
PIDGOV = "0.05 0.01 5 1 0.1 0.5 0.99 0.001 0.1 0.7 0.3 0.9 0.5 0.9 1 0.05 1 0.6 0.04 -0.04"
WPIDHY = (
    "0.01 -0.05 3 0.5 3 0.02 0.01 0.025 -0.025 1 0.2 3.25 52001 0 0 0.12 0.545 0.4 0.827 0.83 1"
)
OTHERS = {
    f"PIDGOV 1 0 {PIDGOV}": (-0.86866757 + 8.49611155j, -0.28282149 + 1.10977593j, -0.1169796),
    f"PIDGOV 1 1 {PIDGOV}": (-0.9001334 + 8.44783636j, -1.22285558 + 0.72000477j, -0.04238523),
    f"WPIDHY 1 {WPIDHY}": (-1.39512724 + 5.96660797j, -0.0305766 + 0.30118043j, -0.48179150),
}
"""Records, and eigenvalues of PowerSimulationsDynamics.jl at d94d74e, test/results/results_eigenvalues.jl, test58 and
test60."""


@pytest.mark.parametrize("record", OTHERS)
def test_a_pid_governor_has_the_eigenvalues_of_another_program(record, tmp_path):
    network, _ = three_buses(given=0.7, drawn=2.0)
    alone = OneMachine(f"{BEHIND}102 {record} /", tmp_path, network, source=0.25j)
    found = alone.eigenvalues()
    for wanted in OTHERS[record]:
        assert min(abs(found - wanted)) < 2e-5
