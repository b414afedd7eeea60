"""Exciters of `synchronous_generator`: transfer functions by hand, starts, ceilings on both sides."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from fmus.synchronous_generator.parts import EXCITERS
from fmus.synchronous_generator.saturation import require_rising
from fmus.toolchain.model_builder import ModelBuilder
from tests.models.parts import AT_BUS, AT_REST, BUS, E_FD, V_T, exciter, integrated, refused
from tests.support.evaluated import Evaluated

REST = AT_REST["exciter"]
LINEAR = {
    "sexs": {"K": 90.0, "T_A": 0.9, "T_B": 8.0, "T_E": 0.06, "T_R": 0.012},
    "ieeet1": {
        "K_A": 25.0,
        "T_A": 0.15,
        "K_E": 0.9,
        "T_E": 0.4,
        "K_F": 0.05,
        "T_F": 0.5,
        "T_R": 0.02,
    },
    "dc1a": {
        "K_A": 46.0,
        "T_A": 0.06,
        "T_C": 0.2,
        "T_B": 0.7,
        "K_E": 1.0,
        "T_E": 0.46,
        "K_F": 0.1,
        "T_F": 0.9,
        "T_R": 0.01,
    },
    "ac4a": {"K_A": 150.0, "T_A": 0.02, "T_B": 8.0, "T_C": 0.9, "T_R": 0.012},
    "st1a": {
        "K_A": 180.0,
        "T_A": 0.02,
        "T_B": 9.0,
        "T_C": 1.1,
        "T_B1": 0.3,
        "T_C1": 0.2,
        "K_F": 0.03,
        "T_F": 0.8,
        "T_R": 0.015,
    },
    "st4b": {
        "K_PR": 3.5,
        "K_IR": 2.9,
        "T_A": 0.03,
        "K_PM": 1.3,
        "K_IM": 0.7,
        "K_G": 0.2,
        "K_P": 6.1,
        "K_C": 0.11,
        "T_R": 0.025,
        "V_RMAX": 9.0,
    },
    "ac1a": {
        "K_A": 300.0,
        "T_A": 0.02,
        "T_B": 2.0,
        "T_C": 0.5,
        "T_E": 0.7,
        "K_F": 0.03,
        "T_F": 1.1,
        "K_C": 0.1,
        "K_D": 0.3,
        "K_E": 1.0,
        "T_R": 0.01,
    },
}


def saturated(E, points):
    """S_E(E)·E by B·(E − A)² through two points, the smaller first."""
    (E_1, S_1), (E_2, S_2) = points
    ratio = np.sqrt(E_1 * S_1 / (E_2 * S_2))
    A = (E_1 - ratio * E_2) / (1 - ratio)
    return E_2 * S_2 / (E_2 - A) ** 2 * max(E - A, 0.0) ** 2


def slope(function, x, step=1e-6):
    return (function(x + step) - function(x - step)) / (2 * step)


def by_hand(name, p, s):
    """E_fd over the stabiliser's signal."""

    def lead(mark=""):
        return (1 + p.get(f"T_C{mark}", 0.0) * s) / (1 + p.get(f"T_B{mark}", 0.0) * s)

    if name == "sexs":
        return p["K"] * (1 + p["T_A"] * s) / (1 + p["T_B"] * s) / (1 + p["T_E"] * s)
    if name == "ac4a":
        return lead() * p["K_A"] / (1 + p["T_A"] * s)
    if name == "st4b":
        outer = (p["K_PR"] + p["K_IR"] / s) / (1 + p["T_A"] * s)
        bridge = p["K_P"] * V_T - 0.577 * p["K_C"] * E_FD
        inner = (p["K_PM"] + p["K_IM"] / s) * bridge
        return outer * inner / (1 + inner * p["K_G"])
    feedback = s * p["K_F"] / (1 + s * p["T_F"])
    if name == "st1a":
        forward = lead() * lead("1") * p["K_A"] / (1 + p["T_A"] * s)
        return forward / (1 + forward * feedback)
    amplifier = lead() * p["K_A"] / (1 + p["T_A"] * s)
    if name in ("ieeet1", "dc1a"):
        curve = slope(lambda E: saturated(E, ((3.0, 0.41), (4.0, 1.96))), E_FD)
        forward = amplifier / (p["K_E"] + curve + s * p["T_E"])
        return forward / (1 + forward * feedback)
    V_E = E_FD + 0.577 * p["K_C"] * E_FD
    field = p["K_E"] + slope(lambda E: saturated(E, ((3.14, 0.03), (4.18, 0.1))), V_E)
    to_V_E = amplifier / (field + s * p["T_E"] + amplifier * feedback * field)
    return to_V_E  # E_fd = V_E − 0.577·K_C·I_FD here


@pytest.mark.parametrize("hertz", [0.1, 0.6, 1.4, 8.0])
@pytest.mark.parametrize("name", LINEAR)
def test_an_exciter_is_its_block_diagram(name, hertz):
    p = LINEAR[name]
    alone = exciter(name, p)
    assert not refused(alone)
    assert alone.outputs(REST)["E_fd"] == pytest.approx(E_FD, rel=1e-12)
    assert max(map(abs, alone.rates(REST).values())) < 1e-11
    s = 2j * np.pi * hertz
    response, wanted = alone.response(s, REST), by_hand(name, p, s)
    assert response["E_fd", "v_s"] == pytest.approx(wanted, rel=1e-6)
    direct = {"st4b": wanted_direct(p, s)}.get(name, 0.0)
    assert response["E_fd", "v_t"] == pytest.approx(direct - wanted / (1 + p["T_R"] * s), rel=1e-6)


def wanted_direct(p, s):
    """∂E_fd/∂v_t of ST4B through its source alone."""
    if "K_PM" not in p:
        return 0.0
    bridge = p["K_P"] * V_T - 0.577 * p["K_C"] * E_FD
    inner = (p["K_PM"] + p["K_IM"] / s) * bridge
    return E_FD / bridge * p["K_P"] / (1 + inner * p["K_G"])


def test_a_measurement_without_a_lag_and_an_amplifier_without_one_pass_directly():
    alone = exciter("st1a", {"T_R": 0.0, "K_A": 120.0})
    response = alone.response(2j * np.pi, REST)
    assert response["E_fd", "v_t"] == pytest.approx(-120.0, rel=1e-12)
    assert response["E_fd", "v_s"] == pytest.approx(120.0, rel=1e-12)


def F_EX(I_N):
    if I_N <= 0.433:
        return 1 - 0.577 * I_N
    return np.sqrt(0.75 - I_N**2) if I_N < 0.75 else 1.732 * (1 - I_N)


@pytest.mark.parametrize("K_C", [0.0, 0.2, 0.7, 1.4])
def test_an_exciter_follows_the_rectifiers_three_ranges(K_C):
    """AC1A's V_E, and with it E_fd, at light and at heavy loading of the rectifier: IEEE 421.5, annex D."""
    alone = exciter("ac1a", {"K_C": K_C, "V_RMAX": 60.0, "V_AMAX": 60.0})
    V_E = brentq(lambda V: V * F_EX(K_C * E_FD / V) - E_FD, max(1.0, 1.001 * K_C * E_FD), 50)
    assert alone.states["exciter.V_E"] == pytest.approx(V_E, rel=1e-3)
    assert alone.outputs(REST)["E_fd"] == pytest.approx(E_FD, rel=1e-3)


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
@pytest.mark.parametrize("name", EXCITERS)
def test_a_generator_with_it_starts_in_steady_state(name, factory):
    device = Evaluated(
        factory(exciter=name),
        AT_BUS | {"transformer.X_t": 0.12, "machine.s_10": 0.1, "machine.s_12": 0.4},
    )
    assert not refused(device)
    at_rest = [BUS.real, BUS.imag]
    if name == "external":
        at_rest.append(device.parameters["exciter.E_fd_0"])
        assert max(map(abs, device.rates([*at_rest[:2], 0.9 * at_rest[2]]).values())) > 1e-3
    assert max(map(abs, device.rates(at_rest).values())) < 1e-8
    assert device.outputs(at_rest)["q"] == pytest.approx(0.15, abs=1e-12)


WITHOUT_FEEDBACK = {
    # name: (gains, lags) of the rate feedback
    "ieeet1": (("K_F",), ("T_F",)),
    "rexsys": (("K_F",), ("T_F",)),
    "expic1": (("K_F",), ("T_F1",)),
    "ac7b": (("K_F3",), ("T_F3",)),
    "esac3a": (("K_F", "K_N"), ("T_F",)),
    "exni": (("K_F",), ("T_F1", "T_F2")),
}


@pytest.mark.parametrize("name", WITHOUT_FEEDBACK)
def test_data_without_a_rate_feedback_may_have_0_as_its_lag(name):
    gains, lags = WITHOUT_FEEDBACK[name]
    none = dict.fromkeys(gains, 0.0)
    found, wanted = (exciter(name, none | dict.fromkeys(lags, T)) for T in (0.0, 0.7))
    assert not refused(found)
    least = {v.name: v.minimum for v in found.model.parameters}
    assert {least[f"exciter.{lag}"] for lag in lags} == {0}
    s = 2j * np.pi
    own, other = found.response(s, REST), wanted.response(s, REST)
    assert own["E_fd", "v_t"] == pytest.approx(other["E_fd", "v_t"], rel=1e-9)
    acts = exciter(name, {gains[-1]: 0.1} | dict.fromkeys(lags, 0.0))
    assert any(text.startswith(f"exciter.{lags[0]} must be above 0") for text in refused(acts))


# -- ceilings -----------------------------------------------------------------------------------

CEILINGS = {
    # name: (values, upper and lower E_fd at rest of everything else)
    "sexs": ({"E_MIN": -1.0, "E_MAX": 4.0}, 4.0, -1.0),
    "ac4a": ({"V_RMAX": 5.0, "V_RMIN": -3.0, "K_C": 0.1}, 5.0 - 0.1 * E_FD, -3.0),
    "st1a": (
        {"V_RMAX": 5.0, "V_RMIN": -3.0, "K_C": 0.1, "T_A": 0.02},
        5.0 * V_T - 0.1 * E_FD,
        -3.0 * V_T,
    ),
    "st4b": (
        {"V_RMAX": 0.9, "V_RMIN": -0.5, "K_C": 0.0, "K_P": 6.0},
        0.9 * 6 * V_T,
        -0.5 * 6 * V_T,
    ),
}


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("name", CEILINGS)
def test_the_field_voltage_stops_at_its_ceiling(name, side):
    values, upper, lower = CEILINGS[name]
    alone = exciter(name, values)
    found, _ = integrated(alone, lambda t: [V_T, E_FD, 0.5 * side], 4.0, step=1e-3)
    voltages = [y["E_fd"] for y in found]
    assert voltages[-1] == pytest.approx(upper if side > 0 else lower, rel=1e-9)
    assert max(voltages) <= upper + 1e-9
    assert min(voltages) >= lower - 1e-9


@pytest.mark.parametrize(("side", "limit"), [(1, 2.6), (-1, 1.0)])
@pytest.mark.parametrize("name", ["ieeet1", "dc1a"])
def test_a_commutator_exciter_settles_where_its_regulators_limit_holds_it(name, side, limit):
    values = {"V_RMAX": 2.6, "V_RMIN": 1.0, "K_F": 0.0, "T_E": 0.2}
    alone = exciter(name, values)
    found, _ = integrated(alone, lambda t: [V_T, E_FD, 0.5 * side], 4.0, step=1e-3)
    curve = ((3.0, 0.41), (4.0, 1.96))
    wanted = brentq(lambda E: E + saturated(E, curve) - limit, 0, 5)
    assert found[-1]["E_fd"] == pytest.approx(wanted, rel=1e-6)


def test_a_voltage_behind_a_rectifier_does_not_turn_round():
    alone = exciter("ac1a", {"K_F": 0.0})
    found, x = integrated(alone, lambda t: [V_T, E_FD, -0.5], 3.0, step=1e-3)
    assert found[-1]["E_fd"] == 0.0
    found, _ = integrated(alone, lambda t: [V_T, E_FD, 0.5], 0.5, step=1e-3, x=x)
    assert found[-1]["E_fd"] > 1.0


def test_a_held_lag_leaves_its_limit_at_once():
    """SEXS without lead and lag, by the analytic answer: up to the limit, held, and back from it without delay."""
    K, T, high, u = 100.0, 0.2, 4.0, 0.05
    alone = exciter("sexs", {"K": K, "T_A": 0.0, "T_B": 0.0, "T_E": T, "E_MAX": high})
    found, _ = integrated(alone, lambda t: [V_T, E_FD, u if t < 0.4995 else 0.0], 1.0, step=1e-3)
    to_limit = T * np.log((K * u) / (E_FD + K * u - high))
    for k, y in enumerate(found):
        t = (k + 1) * 1e-3
        if t <= 0.5:
            wanted = min(high, E_FD + K * u * (1 - np.exp(-t / T))) if t < to_limit + 0.2 else high
        else:
            wanted = E_FD + (high - E_FD) * np.exp(-(t - 0.5) / T)
        assert y["E_fd"] == pytest.approx(wanted, abs=2e-3)


@pytest.mark.parametrize(
    ("name", "values", "limit"),
    [
        ("sexs", {"E_MAX": 2.1}, "exciter.E_MAX"),
        ("sexs", {"E_MIN": 2.3}, "exciter.E_MIN"),
        ("dc1a", {"V_RMAX": 2.0}, "exciter.V_RMAX"),
        ("ac1a", {"V_RMAX": 2.0}, "exciter.V_RMAX"),
        ("ac1a", {"V_AMIN": 5.0, "V_AMAX": 9.0}, "exciter.V_AMIN"),
        ("ac4a", {"V_RMAX": 2.3, "K_C": 0.1}, "exciter.V_RMAX"),
        ("st1a", {"V_RMAX": 2.0}, "exciter.V_RMAX"),
        ("st1a", {"V_IMAX": 0.01}, "exciter.V_IMAX"),
        ("st4b", {"V_MMAX": 0.3}, "exciter.V_MMAX"),
    ],
)
def test_a_start_at_a_limit_is_refused_by_the_limits_name(name, values, limit):
    texts = refused(exciter(name, values))
    assert texts
    assert texts[0].startswith(f"{limit}: the operating point of the power flow lies at or ")


def test_a_start_at_the_limit_itself_is_none_beyond_it():
    assert refused(exciter("sexs", {"E_MIN": 2.2})) == []


def test_the_field_currents_limiter_of_st1a_lowers_the_field_voltage():
    alone = exciter("st1a", {"K_LR": 4.0, "I_LR": 2.5})
    rest = alone.outputs(REST)["E_fd"]
    assert alone.outputs([V_T, 2.4, 0.0])["E_fd"] == rest
    assert alone.outputs([V_T, 2.7, 0.0])["E_fd"] == pytest.approx(rest - 4 * 0.2, rel=1e-12)


@pytest.mark.parametrize(
    ("points", "fine"),
    [
        ({"s_10": 0.03, "s_12": 0.2}, True),
        ({"s_10": 0.05, "s_12": 0.15}, True),
        ({"s_10": 0.0, "s_12": 0.0}, True),
        ({"s_10": 0.03, "s_12": 0.024}, False),  # 1.2 times it is less than the first
        ({"s_10": 0.1, "s_12": 0.05}, False),
    ],
)
def test_saturation_rises_between_its_two_points(points, fine):
    """Also where the second value is far below 1, as data sheets have it."""
    m = ModelBuilder("saturated", "Two points alone")
    m.derivative(m.state("x", 0, "1", "Some state"), 0)
    require_rising(m, (1.0, points["s_10"]), (1.2, points["s_12"]), "S")
    model = m.build()
    assert (model.requirements([1e-4], [])[0] > 0) == fine
