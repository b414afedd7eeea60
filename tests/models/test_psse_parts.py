"""Parts of stability programs without a standard of their own: transfer functions by hand, limits, special readings."""

import numpy as np
import pytest

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from orchestrator.core.errors import InputError
from tests.models.parts import (
    AT_REST,
    E_FD,
    P_M,
    V_T,
    exciter,
    governor,
    integrated,
    refused,
    stabilizer,
)
from tests.models.test_part_exciters import saturated, slope

REST = AT_REST["exciter"]
HERTZ = pytest.mark.parametrize("hertz", [0.05, 0.4, 1.3, 7.0])


def lead(p, s, T_lead, T_lag):
    return (1 + p.get(T_lead, 0.0) * s) / (1 + p.get(T_lag, 0.0) * s)


def rate(p, s):
    return s * p["K_F"] / (1 + s * p["T_F"])


# -- exciters -----------------------------------------------------------------------------------

EXCITERS = {
    "scrx": {"K": 90.0, "T_A": 0.9, "T_B": 8.0, "T_E": 0.06, "T_R": 0.012},
    "dc2a": {
        "K_A": 40.0,
        "T_A": 0.06,
        "T_C": 0.2,
        "T_B": 0.7,
        "K_E": 1.0,
        "T_E": 0.46,
        "K_F": 0.1,
        "T_F": 0.9,
        "T_R": 0.01,
    },
    "ieeet2": {
        "K_A": 60.0,
        "T_A": 0.05,
        "K_E": 0.9,
        "T_E": 0.4,
        "K_F": 0.05,
        "T_F": 0.5,
        "T_F2": 0.9,
        "T_R": 0.02,
    },
    "ieeex2": {
        "K_A": 60.0,
        "T_A": 0.05,
        "K_E": 0.9,
        "T_E": 0.4,
        "K_F": 0.05,
        "T_F": 0.5,
        "T_F2": 0.9,
        "T_R": 0.02,
        "T_C": 0.3,
        "T_B": 1.1,
    },
    "exac2": {
        "K_A": 300.0,
        "T_A": 0.02,
        "T_B": 2.0,
        "T_C": 0.5,
        "K_B": 5.0,
        "K_H": 0.4,
        "T_E": 0.7,
        "K_F": 0.03,
        "T_F": 1.1,
        "K_C": 0.1,
        "K_D": 0.3,
        "K_E": 1.0,
        "T_R": 0.01,
    },
    "esac6a": {
        "K_A": 500.0,
        "T_A": 0.09,
        "T_K": 0.2,
        "T_B": 9.0,
        "T_C": 3.0,
        "T_E": 0.9,
        "V_FELIM": 2.0,
        "K_H": 2.0,
        "T_H": 0.1,
        "T_J": 0.03,
        "K_C": 0.1,
        "K_D": 0.3,
        "K_E": 1.5,
        "T_R": 0.02,
    },
    "ac8b": {
        "K_PR": 80.0,
        "K_IR": 5.0,
        "K_DR": 10.0,
        "T_DR": 0.1,
        "K_A": 1.3,
        "T_A": 0.02,
        "T_E": 1.2,
        "K_C": 0.1,
        "K_D": 0.3,
        "K_E": 1.0,
        "T_R": 0.01,
    },
}

EXCITERS |= {
    "bbsex1": {"K": 80.0, "T_1": 5.0, "T_2": 0.9, "T_3": 0.06, "T_4": 0.02, "T_R": 0.03},
    "expic1": {
        "K_A": 30.0,
        "T_A1": 0.2,
        "T_A2": 0.03,
        "T_A3": 0.2,
        "T_A4": 0.08,
        "K_F": 0.04,
        "T_F1": 0.9,
        "T_F2": 0.3,
        "K_E": 1.0,
        "T_E": 0.6,
        "T_R": 0.02,
    },
    "dc4b": {
        "K_PR": 20.0,
        "K_IR": 15.0,
        "K_DR": 3.0,
        "T_DR": 0.1,
        "K_A": 1.4,
        "T_A": 0.03,
        "K_E": 1.0,
        "T_E": 0.7,
        "K_F": 0.1,
        "T_F": 1.2,
        "T_R": 0.01,
    },
    "ac7b": {
        "K_PR": 4.0,
        "K_IR": 3.0,
        "K_DR": 0.5,
        "T_DR": 0.1,
        "K_PA": 6.0,
        "K_IA": 5.0,
        "K_P": 5.0,
        "K_F1": 0.2,
        "K_F2": 0.1,
        "K_F3": 0.15,
        "T_F3": 1.1,
        "K_C": 0.1,
        "K_D": 0.3,
        "K_E": 1.0,
        "T_E": 1.1,
        "T_R": 0.02,
    },
}


def behind_the_rectifier(p):
    """K_E and the slope of saturation at the operating point."""
    V_E = E_FD + 0.577 * p["K_C"] * E_FD
    return p["K_E"] + slope(lambda E: saturated(E, ((3.14, 0.03), (4.18, 0.1))), V_E)


def exciter_by_hand(name, p, s):
    """E_fd over the stabiliser's signal."""
    if name == "scrx":
        return V_T * p["K"] * lead(p, s, "T_A", "T_B") / (1 + p["T_E"] * s)
    if name == "bbsex1":
        return p["K"] * lead(p, s, "T_2", "T_1") * lead(p, s, "T_3", "T_4")
    if name in ("dc2a", "ieeet2", "ieeex2"):
        points = ((3.0, 0.41), (4.0, 1.96)) if name == "dc2a" else ((2.85, 0.3), (3.8, 0.6))
        field = p["K_E"] + slope(lambda E: saturated(E, points), E_FD) + s * p["T_E"]
        forward = lead(p, s, "T_C", "T_B") * p["K_A"] / (1 + p["T_A"] * s)
        if name == "dc2a":
            return forward / (field + forward * rate(p, s))
        return forward / (1 + forward * rate(p, s) / (1 + s * p["T_F2"])) / field
    if name in ("expic1", "dc4b"):
        points = {"expic1": ((2.85, 0.3), (3.8, 0.6)), "dc4b": ((2.4, 0.03), (5.0, 0.5))}[name]
        field = p["K_E"] + slope(lambda E: saturated(E, points), E_FD) + s * p["T_E"]
        if name == "dc4b":
            forward = control(p, s) * p["K_A"] / (1 + s * p["T_A"])
            return forward / (field + forward * rate(p, s))
        forward = p["K_A"] * (1 + s * p["T_A1"]) / s * lead(p, s, "T_A3", "T_A2")
        forward /= (1 + s * p["T_A4"]) * field
        back = s * p["K_F"] / (1 + s * p["T_F1"]) / (1 + s * p["T_F2"])
        return forward / (1 + forward * back)
    field = behind_the_rectifier(p)
    if name == "exac2":
        forward = lead(p, s, "T_C", "T_B") * p["K_A"] / (1 + p["T_A"] * s) * p["K_B"]
        back = p["K_B"] * p["K_H"] + forward * rate(p, s)
        return forward / (field + s * p["T_E"] + back * field)
    if name == "esac6a":
        forward = p["K_A"] * lead(p, s, "T_K", "T_A") * lead(p, s, "T_C", "T_B")
        limiter = p["K_H"] * lead(p, s, "T_J", "T_H")
        return forward / (field + s * p["T_E"] + limiter * field)
    if name == "ac7b":
        second = (p["K_PA"] + p["K_IA"] / s) * p["K_P"] * V_T / (field + s * p["T_E"])
        slow = s * p["K_F3"] / (1 + s * p["T_F3"])
        inner = p["K_F1"] + (p["K_F2"] + control(p, s) * slow) * field
        return control(p, s) * second / (1 + second * inner)
    return control(p, s) * p["K_A"] / (1 + s * p["T_A"]) / (field + s * p["T_E"])


def control(p, s):
    return p["K_PR"] + p["K_IR"] / s + s * p["K_DR"] / (1 + s * p["T_DR"])


@HERTZ
@pytest.mark.parametrize("name", EXCITERS)
def test_an_exciter_is_its_block_diagram(name, hertz):
    p, s = EXCITERS[name], 2j * np.pi * hertz
    alone = exciter(name, p)
    assert not refused(alone)
    assert alone.outputs(REST)["E_fd"] == pytest.approx(E_FD, rel=1e-12)
    assert max(map(abs, alone.rates(REST).values())) < 1e-9
    response, wanted = alone.response(s, REST), exciter_by_hand(name, p, s)
    assert response["E_fd", "v_s"] == pytest.approx(wanted, rel=1e-6)
    direct = E_FD / V_T if name == "scrx" else 0.0  # fed from the terminal
    if name == "ac7b":  # its source is the terminal
        to_V_R = wanted / control(p, s) / (p["K_PA"] + p["K_IA"] / s) / (p["K_P"] * V_T)
        direct = to_V_R * V_R_of_ac7b(p) / V_T
    assert response["E_fd", "v_t"] == pytest.approx(direct - wanted / (1 + p["T_R"] * s), rel=1e-6)


def V_R_of_ac7b(p):
    V_E = E_FD + 0.577 * p["K_C"] * E_FD
    return p["K_E"] * V_E + saturated(V_E, ((3.14, 0.03), (4.18, 0.1))) + p["K_D"] * E_FD


def test_expic1_without_an_exciter_is_a_rectifier_at_its_source():
    """T_E = 0 and K_P > 0: E_fd follows the terminal's voltage at once, and stops at its limits."""
    alone = exciter("expic1", {"T_E": 0.0, "K_P": 5.0, "K_C": 0.1, "E_FDMAX": 4.0, "T_A2": 0.05})
    assert not refused(alone)
    direct = alone.response(2e4j * np.pi, REST)["E_fd", "v_t"]
    bridge = 5.0 * V_T - 0.577 * 0.1 * E_FD
    assert direct.real == pytest.approx(5.0 * E_FD / bridge, rel=1e-2)
    found, _ = integrated(alone, lambda t: [V_T, E_FD, 0.5], 3.0)
    assert found[-1]["E_fd"] == pytest.approx(4.0, rel=1e-9)


@pytest.mark.parametrize(
    ("name", "values", "upper", "lower"),
    [
        ("scrx", {"E_MAX": 4.0, "E_MIN": -1.0}, 4.0 * V_T, -1.0 * V_T),
        ("scrx", {"E_MAX": 4.0, "E_MIN": -1.0, "own_supply": 1}, 4.0, -1.0),
    ],
)
def test_scrx_stops_at_ceilings_times_the_voltage_that_feeds_it(name, values, upper, lower):
    alone = exciter(name, values)
    for side, wanted in ((1, upper), (-1, lower)):
        found, _ = integrated(alone, lambda t, side=side: [V_T, E_FD, 0.5 * side], 2.0)
        assert found[-1]["E_fd"] == pytest.approx(wanted, rel=1e-9)


def test_scrx_sends_a_negative_field_current_through_a_resistance_where_there_is_one():
    alone = exciter("scrx", {"r_C_over_r_FD": 10.0})
    assert alone.outputs([V_T, -0.2, 0.0])["E_fd"] == pytest.approx(2.0)
    assert exciter("scrx").outputs([V_T, -0.2, 0.0])["E_fd"] == pytest.approx(E_FD)


@pytest.mark.parametrize(
    ("values", "upper", "lower"),
    [
        ({"V_RMAX": 4.0, "V_RMIN": -1.0}, 4.0, -1.0),
        ({"E_FDMAX": 4.0, "E_FDMIN": -1.0}, 4.0 * V_T, -1.0 * V_T),
    ],
)
def test_bbsex1_stops_at_its_regulators_limits_and_at_the_terminals(values, upper, lower):
    alone = exciter("bbsex1", values)
    for side, wanted in ((1, upper), (-1, lower)):
        found, _ = integrated(alone, lambda t, side=side: [V_T, E_FD, 0.5 * side], 2.0)
        assert found[-1]["E_fd"] == pytest.approx(wanted, rel=1e-9)


def test_the_regulator_of_bbsex1_does_not_wind_up_at_its_limit():
    """After 10 s at V_RMAX its slow state is V_RMAX: E_fd is T_2/T_1 of the way down at once as the error goes."""
    p = {"V_RMAX": 4.0, "T_1": 5.0, "T_2": 0.9, "T_3": 0.0, "T_4": 0.0, "K": 80.0}
    alone = exciter("bbsex1", p)
    found, x = integrated(alone, lambda t: [V_T, E_FD, 0.5], 10.0)
    assert found[-1]["E_fd"] == pytest.approx(4.0, rel=1e-9)
    back, _ = integrated(alone, lambda t: REST, 1e-3, x=x)
    assert back[0]["E_fd"] == pytest.approx(4.0 + 0.9 / 5.0 * (E_FD - 4.0), rel=1e-3)


def test_the_stabilisers_signal_of_bbsex1_may_go_behind_the_regulator():
    """With SWITCH = 1 it passes as it is, at every frequency; the voltage's way stays the same."""
    p, s = EXCITERS["bbsex1"], 2j * np.pi * 0.7
    response = exciter("bbsex1", p | {"signal_at_output": 1}).response(s, REST)
    assert response["E_fd", "v_s"] == pytest.approx(1.0, rel=1e-6)
    voltage = -exciter_by_hand("bbsex1", p, s) / (1 + p["T_R"] * s)
    assert response["E_fd", "v_t"] == pytest.approx(voltage, rel=1e-6)


@pytest.mark.parametrize(("v_t", "factor"), [(V_T, V_T), (0.6, 0.6)])
def test_the_limits_of_dc2a_follow_the_voltage(v_t, factor):
    """Its regulator stands at v_t·V_RMAX, and E_fd + S_E(E_fd)·E_fd there."""
    alone = exciter("dc2a", {"V_RMAX": 4.0, "K_F": 0.0, "S_E1": 0.0, "S_E2": 0.0, "T_E": 0.2})
    found, _ = integrated(alone, lambda t: [v_t, E_FD, 0.9], 3.0)
    assert found[-1]["E_fd"] == pytest.approx(4.0 * factor, rel=1e-6)


def test_the_limiter_of_exac2_holds_the_field_current():
    """V_FE goes to where K_B·K_L·(V_LR − V_FE) = V_FE."""
    values = {
        "K_L": 20.0,
        "V_LR": 4.0,
        "K_B": 2.0,
        "K_C": 0.0,
        "K_D": 0.0,
        "S_E1": 0.0,
        "S_E2": 0.0,
    }
    alone = exciter("exac2", values | {"K_F": 0.0, "V_RMAX": 99.0, "V_AMAX": 99.0})
    found, _ = integrated(alone, lambda t: [V_T, E_FD, 0.5], 8.0, step=1e-3)
    assert found[-1]["E_fd"] == pytest.approx(40.0 * 4.0 / 41.0, rel=1e-6)


def test_the_limiter_of_ac8b_holds_the_field_current():
    values = {"V_FEMAX": 4.0, "K_C": 0.0, "K_D": 0.0, "S_E1": 0.0, "S_E2": 0.0, "T_E": 0.3}
    alone = exciter("ac8b", values)
    found, x = integrated(alone, lambda t: [V_T, E_FD, 0.5], 4.0)
    assert found[-1]["E_fd"] == pytest.approx(4.0, rel=1e-6)
    found, _ = integrated(alone, lambda t: [V_T, E_FD, -0.5], 2.0, x=x)
    assert found[-1]["E_fd"] < 2.0


# -- governors ----------------------------------------------------------------------------------

IEESGO = {"T_1": 0.2, "T_2": 0.3, "T_3": 0.5, "T_4": 0.12, "T_5": 5.0, "T_6": 0.5, "K_1": 20.0}
GGOV1 = {
    "R": 0.04,
    "T_pelec": 0.9,
    "K_pgov": 8.0,
    "K_igov": 2.0,
    "K_dgov": 0.4,
    "T_dgov": 0.8,
    "T_act": 0.5,
    "K_turb": 1.5,
    "T_b": 0.6,
    "T_c": 0.1,
    "T_eng": 0.05,
    "D_m": 0.3,
}


@HERTZ
def test_ieesgo_is_its_block_diagram(hertz):
    p, s = IEESGO | {"K_2": 0.6, "K_3": 0.4}, 2j * np.pi * hertz
    alone = governor("ieesgo", p)
    assert not refused(alone)
    valve = -p["K_1"] / (1 + s * p["T_1"]) * lead(p, s, "T_2", "T_3") / (1 + s * p["T_4"])
    reheated = 1 / (1 + s * p["T_5"])
    stages = 1 - p["K_2"] + p["K_2"] * reheated * (1 - p["K_3"] + p["K_3"] / (1 + s * p["T_6"]))
    assert alone.response(s, [1.0])["P_m", "w"] == pytest.approx(valve * stages, rel=1e-9)


DEGOV = {"T_1": 0.2, "T_2": 0.05, "T_3": 0.1, "K": 8.0, "T_4": 0.9, "T_5": 0.15, "T_6": 0.2}


@HERTZ
@pytest.mark.parametrize(("name", "by_power"), [("degov", 0), ("degov1", 0), ("degov1", 1)])
def test_degov_and_degov1_are_their_block_diagrams(hertz, name, by_power):
    own = {"R": 0.05, "T_E": 0.2, "power_droop": by_power} if name == "degov1" else {}
    p, s, T = DEGOV | {"T_D": 0.02} | own, 2j * np.pi * hertz, 0.02
    alone = governor(name, p)
    at_rest = [1.0, P_M] if name == "degov1" else [1.0]
    assert not refused(alone)
    box = (1 + s * p["T_3"]) / (1 + s * p["T_1"] + s**2 * p["T_1"] * p["T_2"])
    forward = box * p["K"] / s * lead(p, s, "T_4", "T_5") / (1 + s * p["T_6"])
    delay = (1 - s * T / 2 + s**2 * T**2 / 12) / (1 + s * T / 2 + s**2 * T**2 / 12)
    closed = forward / (1 + (forward * p["R"] if own and not by_power else 0))
    response = alone.response(s, at_rest)
    assert response["P_m", "w"] == pytest.approx(P_M - closed * delay, rel=1e-6)
    if by_power:
        wanted = -p["R"] / (1 + s * p["T_E"]) * closed * delay
        assert response["P_m", "P_e"] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(("name", "delay"), [("degov", "T_D"), ("ggov1", "T_eng")])
def test_a_delay_that_the_fraction_cannot_stand_for_is_refused(name, delay):
    assert any(
        f"governor.{delay} must be" in text for text in refused(governor(name, {delay: 1.0}))
    )


@HERTZ
@pytest.mark.parametrize("feedback", [1, -1, 0])
def test_ggov1_is_its_block_diagram(hertz, feedback):
    p, s = GGOV1, 2j * np.pi * hertz
    alone = governor("ggov1", p | {"R_select": feedback, "T_rate": 80.0})
    assert not refused(alone)
    assert alone.outputs([1.0, P_M])["P_m"] == pytest.approx(P_M, rel=1e-12)
    assert max(map(abs, alone.rates([1.0, P_M]).values())) < 1e-12
    regulator = p["K_pgov"] + p["K_igov"] / s + s * p["K_dgov"] / (1 + s * p["T_dgov"])
    valve = regulator / (1 + s * p["T_act"])
    valve /= 1 + valve * (p["R"] if feedback == -1 else 0)
    T = p["T_eng"]
    delay = (1 - s * T / 2 + s**2 * T**2 / 12) / (1 + s * T / 2 + s**2 * T**2 / 12)
    turbine = delay * p["K_turb"] * lead(p, s, "T_c", "T_b")
    response = alone.response(s, [1.0, P_M])
    share = 0.8  # T_rate over S_n
    wanted = -share * (valve * turbine + p["D_m"])
    assert response["P_m", "w"] == pytest.approx(wanted, rel=1e-6)
    droop = p["R"] / (1 + s * p["T_pelec"]) if feedback == 1 else 0.0
    assert response["P_m", "P_e"] == pytest.approx(-droop * valve * turbine, rel=1e-6, abs=1e-12)


def test_ggov1_without_an_integral_has_no_slow_mode_of_it():
    """A state that nothing moves would stand in a table of modes as if the turbine were slow."""
    without = governor("ggov1", GGOV1 | {"K_igov": 0.0})
    poles = np.linalg.eigvals(without.blocks([1.0, P_M])[0])
    assert max(poles.real) < -0.1


def test_the_load_limiter_of_ggov1_holds_the_load_and_lets_go():
    """At 5 % too little speed an isochronous governor asks for all; the limiter stops at ld_ref."""
    values = {"R_select": 0, "K_pgov": 4.0, "R_open": 9.0, "R_close": -9.0, "ld_ref": 0.9}
    alone = governor("ggov1", values | {"V_MAX": 1.5, "T_sa": 0.0, "T_sb": 0.0, "T_fload": 0.5})
    found, x = integrated(alone, lambda t: [0.95, P_M], 40.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(0.9, rel=1e-3)
    found, _ = integrated(alone, lambda t: [1.05, P_M], 4.0, step=2e-3, x=x)
    assert found[-1]["P_m"] < 0.5


def test_ggov1_starts_above_the_load_of_its_limiter_and_gives_no_more():
    """The turbine is at rest there, without a mode of the limiter near 0; at too little speed it stays."""
    values = {"R_select": 0, "K_pgov": 4.0, "ld_ref": P_M - 0.05}
    alone = governor("ggov1", values)
    assert not refused(alone)
    assert max(map(abs, alone.rates([1.0, P_M]).values())) < 1e-12
    usual = governor("ggov1", values | {"ld_ref": P_M + 0.05})
    poles = [np.sort_complex(np.linalg.eigvals(g.blocks([1.0, P_M])[0])) for g in (alone, usual)]
    assert poles[0] == pytest.approx(poles[1], abs=1e-9)
    found, _ = integrated(alone, lambda t: [0.95, P_M], 40.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(P_M + 1.5e-3, abs=1e-3)


def test_ggov1_starts_at_a_fuel_beyond_1_and_gives_no_more():
    """With a valve that opens beyond 1, as where its limit is widened to the operating point."""
    values = {"R_select": 0, "K_pgov": 4.0, "K_turb": 0.75, "V_MAX": 1.5}  # fuel P_M/0.75 + 0.2
    alone = governor("ggov1", values | {"ld_ref": 2.0})
    assert not refused(alone)
    assert P_M / 0.75 + 0.2 > 1
    assert max(map(abs, alone.rates([1.0, P_M]).values())) < 1e-12
    found, _ = integrated(alone, lambda t: [0.95, P_M], 40.0, step=2e-3)
    assert found[-1]["P_m"] == pytest.approx(P_M + 0.75e-3, abs=1e-6)


def test_the_valve_of_ggov1_moves_no_faster_than_its_rates():
    alone = governor("ggov1", {"T_act": 0.01, "R_open": 0.1, "R_close": -0.2, "T_b": 0.0})
    for w, fastest in ((0.95, 0.1), (1.05, -0.2)):
        found, _ = integrated(alone, lambda t, w=w: [w, P_M], 1.0, step=1e-3)
        P = np.array([y["P_m"] for y in found])
        assert 1.5 * fastest * 0.5 == pytest.approx(P[799] - P[299], rel=1e-3)


@pytest.mark.parametrize(("moved", "fastest"), [(0.1, 0.02), (-0.1, -0.04)])
def test_a_moved_reference_of_ggov1_arrives_at_its_rates(moved, fastest):
    values = {"R_up": 0.02, "R_down": -0.04, "R": 1.0, "K_pgov": 1.0, "K_igov": 0.0, "R_select": 0}
    alone = governor("ggov1", values | {"max_err": 1.0, "min_err": -1.0, "delta_P_ref": moved})
    at = [s.name for s in alone.model.states].index("governor.reference")
    found = [integrated(alone, lambda t: [1.0, P_M], T)[1][at] for T in (1.0, 6.0)]
    assert found == pytest.approx([fastest, moved], rel=1e-6)


# -- stabilisers --------------------------------------------------------------------------------

AT = AT_REST["pss"]
FILTERS = [
    {},
    {"A_1": 0.06, "A_5": 0.1},
    {"A_1": 0.061, "A_2": 0.0017, "A_5": 0.03, "A_6": 0.001},
    {"A_1": 0.06, "A_3": 0.03, "A_5": 0.1, "A_6": 0.002},
    {"A_1": 0.06, "A_3": 0.09, "A_4": 0.002, "A_5": 0.1, "A_6": 0.003},
    {"A_1": 1.013, "A_2": 0.013, "A_3": 0.05, "A_4": 0.001, "A_5": 1.013, "A_6": 0.113},
]


@HERTZ
@pytest.mark.parametrize("filtered", FILTERS)
def test_ieeest_is_its_block_diagram(hertz, filtered):
    p = {"K_S": 9.5, "T_5": 1.4, "T_6": 1.1, "T_1": 0.15, "T_2": 0.03, "T_3": 0.2, "T_4": 0.05}
    s = 2j * np.pi * hertz
    alone = stabilizer("ieeest", p | filtered)
    assert not refused(alone)
    a = {f"A_{k}": filtered.get(f"A_{k}", 0.0) for k in range(1, 7)}
    wanted = 1 + a["A_5"] * s + a["A_6"] * s**2
    wanted /= (1 + a["A_1"] * s + a["A_2"] * s**2) * (1 + a["A_3"] * s + a["A_4"] * s**2)
    wanted *= lead(p, s, "T_1", "T_2") * lead(p, s, "T_3", "T_4")
    wanted *= p["K_S"] * s * p["T_5"] / (1 + s * p["T_6"])
    assert alone.response(s, [*AT, V_T])["v_s", "speed"] == pytest.approx(wanted, rel=1e-9)
    of_power = stabilizer("ieeest", p | filtered | {"signal": 3})
    assert of_power.response(s, [*AT, V_T])["v_s", "power"] == pytest.approx(wanted, rel=1e-9)


def test_ieeest_takes_no_lead_without_a_lag():
    assert any(
        "A_5 > 0 needs a lag" in text for text in refused(stabilizer("ieeest", {"A_5": 0.1}))
    )
    texts = refused(stabilizer("ieeest", {"A_1": 0.1, "A_6": 0.1}))
    assert any("A_6 > 0 needs two lags" in text for text in texts)


@pytest.mark.parametrize(
    ("name", "band"), [("ieeest", (0.9, 1.1)), ("st2cut", (0.9 - V_T, 1.1 - V_T))]
)
def test_a_stabilizer_is_cut_off_outside_of_a_band_of_voltages(name, band):
    alone = stabilizer(name, {"V_CL": band[0], "V_CU": band[1]})
    x = alone.x - 0.001
    signals = [alone.outputs([0.0, 0.8, v], x)["v_s"] for v in (0.89, 0.91, 1.09, 1.11)]
    assert [signal != 0 for signal in signals] == [False, True, True, False]


@HERTZ
def test_st2cut_is_its_block_diagram(hertz):
    p = {
        "K_1": 8.0,
        "K_2": 0.4,
        "T_1": 0.02,
        "T_2": 0.03,
        "T_3": 2.0,
        "T_4": 1.5,
        "T_lead_1": 0.2,
        "T_lag_1": 0.03,
        "T_lead_2": 0.1,
        "T_lag_2": 0.02,
        "T_lead_3": 0.3,
        "T_lag_3": 0.5,
    }
    s = 2j * np.pi * hertz
    alone = stabilizer("st2cut", p | {"signal_2": 3})
    common = s * p["T_3"] / (1 + s * p["T_4"])
    for stage in (1, 2, 3):
        common *= lead(p, s, f"T_lead_{stage}", f"T_lag_{stage}")
    response = alone.response(s, [*AT, V_T])
    wanted = {
        ("v_s", "speed"): common * p["K_1"] / (1 + s * p["T_1"]),
        ("v_s", "power"): common * p["K_2"] / (1 + s * p["T_2"]),
    }
    assert {key: response[key] for key in wanted} == pytest.approx(wanted, rel=1e-9)


@HERTZ
def test_stab2a_is_its_block_diagram(hertz):
    p = {"K_2": 0.9, "T_2": 4.0, "K_3": 0.7, "T_3": 2.0, "K_4": 0.55, "K_5": 1.1, "T_5": 0.03}
    s = 2j * np.pi * hertz
    wanted = -((p["K_2"] * s * p["T_2"] / (1 + s * p["T_2"])) ** 3)
    wanted *= p["K_4"] + p["K_3"] / (1 + s * p["T_3"])
    wanted *= (p["K_5"] / (1 + s * p["T_5"])) ** 2
    alone = stabilizer("stab2a", p)
    assert alone.response(s, AT)["v_s", "power"] == pytest.approx(wanted, rel=1e-9)


# -- values that PSS/E reads as something else -----------------------------------------------------


def parameters(dyr, folder):
    place = folder / "one.dyr"
    place.write_text(dyr, encoding="utf-8")
    machine = Machine(1, "1", 1, 80.0, 1.0, 100.0, 0.25j, -9e3, 9e3)
    return machine_models(read_dyr(place), [machine])[1, "1"].parameters


GENROU = "1 GENROU 1 8 0.03 0.4 0.05 6 0 1.8 1.7 0.3 0.55 0.25 0.2 0 0 /\n"


@pytest.mark.parametrize("machine", ["GENROU", "GENROE", "GENSAL", "GENSAE"])
def test_a_machine_without_saturation_at_1_pu_has_none(machine, tmp_path):
    common = "8 0.03 0.4 0.05 6 0 1.8 1.7 0.3 0.55 0.25 0.2"
    data = common if machine.startswith("GENRO") else "8 0.03 0.05 6 0 1.8 1.7 0.3 0.25 0.2"
    found = parameters(f"1 {machine} 1 {data} 0.0 1.0 /", tmp_path)
    assert (found["machine.s_10"], found["machine.s_12"]) == (0.0, 0.0)
    found = parameters(f"1 {machine} 1 {data} 0.1 0.4 /", tmp_path)
    assert (found["machine.s_10"], found["machine.s_12"]) == (0.1, 0.4)


@pytest.mark.parametrize(("K_E", "of_start"), [(0.0, True), (1.0, False)])
def test_a_commutator_exciter_without_k_e_starts_at_a_tenth_of_its_limit(K_E, of_start, tmp_path):
    record = f"1 IEEET1 1 0 50 0.02 4 -4 {K_E} 0.5 0.05 1 0 3 0.1 4 0.3 /"
    found = parameters(GENROU + record, tmp_path)
    assert found["exciter.K_E_of_start"] == of_start
    own = {
        name.removeprefix("exciter."): value
        for name, value in found.items()
        if name.startswith("exciter.")
    }
    alone = exciter("ieeet1", own)
    V_R0 = alone.states["exciter.amplifier"]
    assert not refused(alone)
    assert (abs(V_R0 - 0.4) < 1e-9) == of_start
    assert max(map(abs, alone.rates(REST).values())) < 1e-9


def test_every_second_point_of_saturation_is_nothing_without_the_first():
    """So are the leads of steam turbines' governors and of some exciters without their lags."""
    leads = {("T2", "T1"), ("TC", "TB"), ("TC1", "TB1"), ("TC2", "TB2"), ("TF1", "TF2")}
    for name, record in DYR_RECORDS.items():
        for field in record.fields:
            if field.name in ("S(1.2)", "SE(E2)"):
                assert field.nothing_without, name
            elif field.nothing_without:
                assert (field.name, field.nothing_without) in leads, name
    for name in ("IEEEG1", "WSIEG1"):
        assert any(field.nothing_without == "T1" for field in DYR_RECORDS[name].fields), name


def with_ieeest(signal, bus):
    filters = "0 0 0 0 0 0 0.1 0.02 0.1 0.02 10 10 20 0.1 -0.1 0 0 /"
    return GENROU + f"1 SEXS 1 0.1 10 100 0.1 -9 9 /\n1 IEEEST 1 {signal} {bus} {filters}"


@pytest.mark.parametrize(("signal", "bus"), [(2, 0), (6, 1), (4, 0), (1, 7)])
def test_a_stabiliser_takes_its_signal_at_its_machines_bus(signal, bus, tmp_path):
    """0 is the machine's own bus; of the speed another bus means nothing."""
    assert parameters(with_ieeest(signal, bus), tmp_path)["pss.signal"] == signal


@pytest.mark.parametrize("signal", [2, 5, 6])
def test_a_signal_of_another_bus_is_refused(signal, tmp_path):
    said = rf"line 3: IEEEST has IB = 7: its signal, IM = {signal}, .*write IB = 0 for the own bus"
    with pytest.raises(InputError, match=said):
        parameters(with_ieeest(signal, 7), tmp_path)


def test_a_number_that_is_no_signal_of_pss_e_is_refused(tmp_path):
    with pytest.raises(InputError, match="IEEEST has IM = 7; only 1 or 2 or"):
        parameters(with_ieeest(7, 0), tmp_path)
