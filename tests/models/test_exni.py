"""EXNI is its block diagram."""

import numpy as np
import pytest

from fmus.synchronous_generator.dyr_records import DYR_RECORDS
from tests.models.parts import AT_REST, E_FD, V_T, exciter, integrated, refused

REST = AT_REST["exciter"]
P = {"K_A": 120.0, "T_R": 0.02, "K_F": 0.03, "T_F1": 0.5, "T_F2": 0.2}


@pytest.mark.parametrize("hertz", [0.05, 0.7, 7.0])
@pytest.mark.parametrize("T_A", [0.0, 0.04])
@pytest.mark.parametrize("own_supply", [False, True])
def test_it_is_its_transfer_function_at_rest(hertz, T_A, own_supply):
    alone, s = exciter("exni", P | {"T_A": T_A, "own_supply": own_supply}), 2j * np.pi * hertz
    assert not refused(alone)
    assert max(map(abs, alone.rates(REST).values())) < 1e-9
    forward = P["K_A"] / (1 + T_A * s)
    back = P["K_F"] * s / (1 + P["T_F1"] * s) / (1 + P["T_F2"] * s)
    V_R = forward / (1 + forward * back)
    v_t, E_fd = REST[0], REST[1]
    supply = 1.0 if own_supply else v_t
    response = alone.response(s, REST)
    assert response["E_fd", "v_s"] == pytest.approx(V_R * supply, rel=1e-6)
    through_the_bridge = 0.0 if own_supply else E_fd / v_t
    wanted = -V_R * supply / (1 + P["T_R"] * s) + through_the_bridge
    assert response["E_fd", "v_t"] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(("side", "wanted"), [(1, 4.0), (-1, -1.0)])
def test_it_stops_at_its_limits_and_leaves_them_at_once(side, wanted):
    alone = exciter("exni", P | {"V_RMAX": 4.0, "V_RMIN": -1.0, "T_A": 0.04})
    found, _ = integrated(alone, lambda t: [V_T, E_FD, 0.5 * side if t < 2 else -0.5 * side], 2.05)
    at = len(found) * 200 // 205 - 1
    assert found[at]["E_fd"] == pytest.approx(wanted * V_T, rel=1e-9)
    assert abs(found[-1]["E_fd"] - wanted * V_T) > 0.5  # non-windup


def test_its_record_has_ten_fields():
    assert len(DYR_RECORDS["EXNI"].fields) == 10
