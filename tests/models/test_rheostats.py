"""IEEET4 and IEEET5: the rheostat's integral, its dead band and contacts; and IEEX2A, Dynawo's diagram by hand."""

import numpy as np
import pytest

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from tests.models.parts import AT_REST, E_FD, V_T, exciter, integrated, refused
from tests.models.test_part_exciters import saturated, slope

REST = AT_REST["exciter"]
PLAIN = {"T_RH": 2.0, "K_V": 0.05, "V_RMAX": 6.0, "V_RMIN": -1.0, "K_E": 1.0, "T_E": 0.4}
PLAIN |= {"S_E1": 0.0, "S_E2": 0.0, "T_R": 0.0}
POINTS = ((3.0, 0.05), (4.0, 0.3))


def fields_after(name, values, v_s, end=1.5):
    """E_fd at times after a step of the error, and the times."""
    found, _ = integrated(exciter(name, values), lambda t: [V_T, E_FD, v_s], end, 2e-3)
    return np.array([y["E_fd"] for y in found]), 2e-3 * np.arange(1, len(found) + 1)


@pytest.mark.parametrize(("name", "more"), [("ieeet5", {}), ("ieeet4", {"K_R": 0.0})])
def test_a_rheostat_integrates_the_error(name, more):
    p = PLAIN | {"E_1": 3.0, "S_E1": 0.05, "E_2": 4.0, "S_E2": 0.3, "K_E": 0.9} | more
    own = exciter(name, p)
    assert not refused(own)
    assert max(map(abs, own.rates(REST).values())) < 1e-12
    for hertz in (0.05, 0.7):
        s = 2j * np.pi * hertz
        field = s * p["T_E"] + p["K_E"] + slope(lambda E: saturated(E, POINTS), E_FD)
        wanted = 1 / (s * p["T_RH"]) / field
        response = own.response(s, REST)
        assert response["E_fd", "v_s"] == pytest.approx(wanted, rel=1e-6)
        assert response["E_fd", "v_t"] == pytest.approx(-wanted, rel=1e-6)


@pytest.mark.parametrize("error", [0.015, 0.03, -0.03, 0.06, -0.06])
def test_contacts_move_the_rheostat_at_one_speed_and_take_the_ceilings(error):
    """Nothing within K_R, a ramp beyond it, and beyond K_V the field's lag towards a ceiling."""
    found, t = fields_after("ieeet4", PLAIN | {"K_R": 0.02}, error)
    lag = np.exp(-t / PLAIN["T_E"])
    ramp = (t - PLAIN["T_E"] * (1 - lag)) / PLAIN["T_RH"]
    ceiling = PLAIN["V_RMAX"] if error > 0 else PLAIN["V_RMIN"]
    jump = (ceiling - E_FD) * (1 - lag)
    size = abs(error)
    wanted = np.sign(error) * ramp * (size > 0.02) if size < 0.05 else jump
    assert np.abs(found - E_FD - wanted).max() < 1e-6


def test_a_rheostat_stops_at_its_limit_and_leaves_it_at_once():
    narrow = PLAIN | {"V_RMAX": 2.5, "T_E": 0.02, "T_RH": 0.4}
    own = exciter("ieeet5", narrow)
    found, x = integrated(own, lambda t: [V_T, E_FD, 0.04], 4.0, 1e-3)
    assert found[-1]["E_fd"] == pytest.approx(2.5, abs=1e-6)
    back, _ = integrated(own, lambda t: [V_T, E_FD, -0.04], 1.0, 1e-3, x=x)
    assert back[-1]["E_fd"] == pytest.approx(2.5 - 0.1 * (1.0 - 0.02), abs=1e-5)


@pytest.mark.parametrize("name", ["ieeet4", "ieeet5"])
def test_a_start_beyond_the_rheostats_limit_is_refused(name):
    (said,) = refused(exciter(name, PLAIN | {"V_RMAX": 2.0}))
    assert "exciter.V_RMAX" in said


def test_ieex2a_is_ac1a_without_a_rectifier():
    """Dynawo's BaseIEEEX with the rate feedback of IEEX2A, through a dip and both of its limits."""
    record = DYR_RECORDS["IEEX2A"]
    p = {"T_R": 0.02, "K_A": 60.0, "T_A": 0.05, "T_B": 0.5, "T_C": 0.1, "K_E": 0.9, "T_E": 0.3}
    p |= {"K_F": 0.04, "T_F": 0.9, "E_1": 3.0, "S_E1": 0.05, "E_2": 4.0, "S_E2": 0.3}
    high, low = 4.0, -1.5
    limits = {"V_AMAX": high, "V_RMAX": high, "V_AMIN": low, "V_RMIN": low}
    lacks = {name.removeprefix("exciter."): 0.0 for name in record.lacks}
    own = exciter(record.part, p | limits | lacks)
    assert not refused(own)
    sets = {name for field in record.fields for name in field.parameters}
    assert sets == {f"exciter.{name}" for name in (*p, *limits)}

    def steps(t):
        return [0.8 if t < 0.1 else V_T, E_FD, 0.3 if t < 0.4 else -0.4]

    step, end = 2e-4, 1.0
    V_FE0 = p["K_E"] * E_FD + saturated(E_FD, POINTS)
    reference = V_T + V_FE0 / p["K_A"]
    v_m, slow, V_R, E, washed = V_T, V_FE0 / p["K_A"], V_FE0, E_FD, V_FE0
    wanted = []
    for k in range(round(end / step)):
        v_t, _, v_s = steps(k * step)
        V_FE = p["K_E"] * E + saturated(E, POINTS)
        V_F = p["K_F"] / p["T_F"] * (V_FE - washed)
        error = reference + v_s - v_m - V_F
        leading = slow + p["T_C"] / p["T_B"] * (error - slow)
        v_m += step * (v_t - v_m) / p["T_R"]
        slow += step * (error - slow) / p["T_B"]
        washed += step * (V_FE - washed) / p["T_F"]
        E = max(E + step * (V_R - V_FE) / p["T_E"], 0.0)
        V_R = min(max(V_R + step * (p["K_A"] * leading - V_R) / p["T_A"], low), high)
        wanted.append(E)
    found = [y["E_fd"] for y in integrated(own, steps, end, 1e-3)[0]]
    assert max(wanted) > 3.0
    assert min(wanted) == 0.0
    assert np.abs(np.subtract(found, wanted[4::5])).max() < 0.02
