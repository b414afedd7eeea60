"""Governors and turbines of `synchronous_generator`: transfer functions by hand, starts, limits on both sides."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from fmus.synchronous_generator.parts import GOVERNORS
from tests.models.parts import AT_BUS, BUS, P_M, governor, integrated, refused
from tests.support.evaluated import Evaluated

LINEAR = {
    "tgov1": {"R": 0.04, "T_1": 0.4, "T_2": 2.1, "T_3": 7.0, "D_t": 0.2},
    "hygov": {
        "R": 0.05,
        "r": 0.4,
        "T_r": 6.0,
        "T_f": 0.06,
        "T_g": 0.4,
        "T_W": 1.3,
        "A_t": 1.1,
        "D_turb": 0.4,
        "q_NL": 0.07,
    },
    "gast": {"R": 0.05, "T_1": 0.4, "T_2": 0.15, "T_3": 3.0, "D_turb": 0.1, "A_T": 1.0, "K_T": 2.0},
    "ieeeg1": {
        "K": 18.0,
        "T_1": 7.0,
        "T_2": 2.5,
        "T_3": 0.12,
        "T_4": 0.25,
        "T_5": 6.0,
        "T_6": 0.5,
        "T_7": 0.4,
        "K_1": 0.2,
        "K_2": 0.1,
        "K_3": 0.2,
        "K_4": 0.1,
        "K_5": 0.15,
        "K_6": 0.05,
        "K_7": 0.1,
        "K_8": 0.1,
    },
}


def by_hand(name, p, s):
    """P_m over the speed."""
    if name == "tgov1":
        return -1 / p["R"] / (1 + s * p["T_1"]) * (1 + s * p["T_2"]) / (1 + s * p["T_3"]) - p["D_t"]
    if name == "gast":
        return -1 / p["R"] / (1 + s * p["T_1"]) / (1 + s * p["T_2"]) - p["D_turb"]
    if name == "hygov":
        g = P_M / p["A_t"] + p["q_NL"]
        regulator = (1 + s * p["T_r"]) / (p["r"] * p["T_r"] * s) / (1 + s * p["T_f"])
        gate = -regulator / (1 + p["R"] * regulator) / (1 + s * p["T_g"])
        water = p["A_t"] * (1 - s * p["T_W"] * (g - p["q_NL"])) / (1 + s * p["T_W"] * g / 2)
        return gate * water - p["D_turb"] * g
    valve = -p["K"] * (1 + s * p["T_2"]) / (1 + s * p["T_1"]) / (1 + s * p["T_3"])
    total, stage = 0.0, 1.0
    for k in range(4):
        stage /= 1 + s * p[f"T_{4 + k}"]
        total += (p[f"K_{2 * k + 1}"] + p[f"K_{2 * k + 2}"]) * stage
    return valve * total


@pytest.mark.parametrize("hertz", [0.01, 0.1, 0.6, 2.0])
@pytest.mark.parametrize("name", LINEAR)
def test_a_governor_is_its_block_diagram(name, hertz):
    alone = governor(name, LINEAR[name])
    assert not refused(alone)
    assert alone.outputs([1.0])["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates([1.0]).values())) < 1e-12
    s = 2j * np.pi * hertz
    assert alone.response(s, [1.0])["P_m", "w"] == pytest.approx(
        by_hand(name, LINEAR[name], s), rel=1e-6
    )


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
@pytest.mark.parametrize("name", GOVERNORS)
def test_a_generator_with_it_starts_in_steady_state(name, factory):
    device = Evaluated(factory(governor=name), AT_BUS)
    assert not refused(device)
    assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-10
    assert device.outputs([BUS.real, BUS.imag])["p"] == pytest.approx(0.7, abs=1e-12)


# -- limits -------------------------------------------------------------------------------------

SETTLED = {
    # name: (values, P_m with the valve fully open, closed, change of the speed that drives it there)
    "tgov1": ({"V_MAX": 0.95, "V_MIN": 0.1, "T_3": 1.0, "T_2": 0.3}, 0.95, 0.1, 0.1),
    "gast": ({"V_MAX": 0.9, "V_MIN": 0.2, "K_T": 0.0, "A_T": 9.0}, 0.9, 0.2, 0.1),
    "ieeeg1": ({"P_MAX": 0.9, "P_MIN": 0.2, "T_5": 1.0, "U_o": 0.4, "U_c": -0.4}, 0.9, 0.2, 0.1),
    "hygov": (
        {"G_MAX": 0.9, "G_MIN": 0.3, "D_turb": 0.0},
        1.2 * (0.9 - 0.08),
        1.2 * (0.3 - 0.08),
        0.1,
    ),
}


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", SETTLED)
def test_the_valve_stops_at_its_limits(name, side):
    values, high, low, change = SETTLED[name]
    found, _ = integrated(governor(name, values), lambda t: [1 - side * change], 30.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(high if side > 0 else low, rel=1e-6)
    if name != "hygov":  # its water swings beyond
        assert max(y["P_m"] for y in found) <= high + 1e-9
        assert min(y["P_m"] for y in found) >= low - 1e-9


@pytest.mark.parametrize(("side", "fastest"), [(1, 0.15), (-1, 0.4)])
def test_the_valve_of_ieeeg1_moves_no_faster_than_its_rates(side, fastest):
    values = {
        "U_o": 0.15,
        "U_c": -0.4,
        **{f"T_{k}": 0.0 for k in (4, 5, 6, 7)},
        "K_1": 1.0,
        "K_3": 0.0,
        "K_5": 0.0,
    }
    found, _ = integrated(governor("ieeeg1", values), lambda t: [1 - side * 0.05], 0.6, step=1e-3)
    power = np.array([y["P_m"] for y in found])
    speed = np.diff(power) / 1e-3
    assert side * speed[100] == pytest.approx(fastest, rel=1e-6)
    assert max(side * speed) == pytest.approx(fastest, rel=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_the_gate_of_hygov_moves_no_faster_than_velm(side):
    alone = governor("hygov", {"VELM": 0.1, "T_g": 0.001})
    k = [s.name for s in alone.model.states].index("governor.gate")
    _, later = integrated(alone, lambda t: [1 - side * 0.05], 0.5, step=1e-3)
    assert later[k] - alone.x[k] == pytest.approx(side * 0.1 * 0.5, rel=0.02)


def test_hygov_is_the_integral_of_its_equations():
    """A fall of the speed by 0.4 %: flow, head and gate by SciPy, from the diagram written a second time."""
    p = {
        "R": 0.05,
        "r": 0.3,
        "T_r": 5.0,
        "T_f": 0.05,
        "T_g": 0.5,
        "T_W": 1.0,
        "A_t": 1.2,
        "D_turb": 0.5,
        "q_NL": 0.08,
    }
    g_0 = P_M / 1.2 + 0.08

    def rates(t, x):
        filtered, integral, gate, q = x
        c = integral + filtered / p["r"]
        error = p["R"] * (g_0 - c) + 0.004
        return [
            (error - filtered) / p["T_f"],
            filtered / (p["r"] * p["T_r"]),
            (c - gate) / p["T_g"],
            (1 - (q / gate) ** 2) / p["T_W"],
        ]

    solution = solve_ivp(rates, (0, 10), [0.0, g_0, g_0, g_0], rtol=1e-9, atol=1e-11)
    _, _, gate, q = solution.y[:, -1]
    wanted = 1.2 * (q / gate) ** 2 * (q - 0.08) + 0.5 * gate * 0.004
    found, _ = integrated(governor("hygov"), lambda t: [0.996], 10.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(wanted, rel=1e-7)


def test_a_hot_gas_turbine_falls_to_its_load_limit():
    """At the speed's wish for more than A_T the temperature's limiter takes over: fuel = A_T in the end."""
    alone = governor("gast", {"V_MAX": 1.5, "A_T": 0.8, "K_T": 2.0, "T_3": 1.0})
    found, _ = integrated(alone, lambda t: [0.95], 40.0, step=4e-3)
    assert max(y["P_m"] for y in found) > 0.81
    assert found[-1]["P_m"] == pytest.approx(0.8, abs=1e-3)


@pytest.mark.parametrize("limit", [P_M - 0.05, P_M])
def test_gast_starts_at_or_above_its_load_limit_and_gives_no_more(limit):
    """The turbine is at rest there, and moves as below the limit; at too little speed it stays."""
    alone, usual = (governor("gast", {"A_T": held}) for held in (limit, P_M + 0.05))
    assert not refused(alone)
    assert max(map(abs, alone.rates([1.0]).values())) < 1e-12
    poles = [np.sort_complex(np.linalg.eigvals(g.blocks([1.0])[0])) for g in (alone, usual)]
    assert poles[0] == pytest.approx(poles[1], abs=1e-9)
    found, _ = integrated(alone, lambda t: [0.95], 40.0, step=4e-3)
    assert found[-1]["P_m"] == pytest.approx(P_M + 1e-3, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "values", "limit"),
    [
        ("tgov1", {"V_MAX": 0.69}, "governor.V_MAX"),
        ("tgov1", {"V_MIN": 0.75}, "governor.V_MIN"),
        ("gast", {"V_MAX": 0.5}, "governor.V_MAX"),
        ("hygov", {"G_MAX": 0.6}, "governor.G_MAX"),
        ("ieeeg1", {"P_MAX": 0.65}, "governor.P_MAX"),
        ("ieeeg1", {"K_1": 0.0, "K_3": 0.0, "K_5": 0.0}, "governor: at least one turbine fraction"),
    ],
)
def test_a_start_at_a_limit_is_refused_by_the_limits_name(name, values, limit):
    texts = refused(governor(name, values))
    assert texts
    assert texts[0].startswith(limit)


def test_a_start_at_the_limit_itself_is_none_beyond_it():
    assert refused(governor("tgov1", {"V_MAX": 0.7})) == []
