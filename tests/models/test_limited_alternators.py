"""ESAC2A is EXAC2 but for a limit, ESAC3A and EXAC3 are their block diagrams by hand; and the limits of all."""

import numpy as np
import pytest

from tests.models.parts import AT_REST, E_FD, V_T, exciter, integrated, refused
from tests.models.test_part_exciters import F_EX, saturated, slope

REST = AT_REST["exciter"]
HERTZ = (0.05, 0.7, 7.0)
POINTS = {"E_1": 3.0, "S_E1": 0.05, "E_2": 4.0, "S_E2": 0.3}
ALTERNATOR = POINTS | {"K_E": 0.9, "T_E": 0.6, "K_C": 0.15, "K_D": 0.4, "T_R": 0.015}
TWO = ALTERNATOR | {"K_A": 120.0, "T_A": 0.02, "T_C": 0.1, "T_B": 0.5, "K_B": 8.0, "K_H": 0.7}
TWO |= {"K_F": 0.04, "T_F": 0.9, "V_RMAX": 9.0, "V_RMIN": -2.0}
THREE = ALTERNATOR | {"K_A": 30.0, "T_A": 0.05, "T_C": 0.1, "T_B": 0.5, "K_R": 3.0, "V_AMAX": 2.0}
THREE |= {"K_F": 0.12, "T_F": 0.8, "K_N": 0.04, "E_FDN": 3.0}


def steps(t):
    """A dip of the voltage, and signals that drive V_R into both of its limits."""
    return [0.8 if t < 0.1 else V_T, E_FD + 0.2, 0.3 if t < 0.4 else -0.4]


def test_esac2a_is_exac2_without_its_limiter():
    """EXAC2's part is held against eigenvalues of ANDES."""
    own, other = exciter("esac2a", TWO | {"V_FEMAX": 99.0}), exciter("exac2", TWO | {"K_L": 1e6})
    assert not refused(own)
    assert max(map(abs, own.rates(REST).values())) < 1e-9
    for hertz in HERTZ:
        found, wanted = (x.response(2j * np.pi * hertz, REST) for x in (own, other))
        for u in ("v_t", "v_s", "I_fd"):
            assert found["E_fd", u] == pytest.approx(wanted["E_fd", u], rel=1e-6)
    both = [[y["E_fd"] for y in integrated(x, steps, 0.8, 1e-3)[0]] for x in (own, other)]
    assert np.ptp(both[1]) > 1.0
    assert np.abs(np.subtract(*both)).max() < 1e-6


@pytest.mark.parametrize("hertz", HERTZ)
@pytest.mark.parametrize("name", ["esac3a", "exac3"])
@pytest.mark.parametrize(("E_FDN", "K"), [(3.0, 0.12), (1.5, 0.04)], ids=["below", "beyond"])
def test_esac3a_and_exac3_are_their_transfer_functions_at_rest(hertz, E_FDN, K, name):
    p, s = THREE | {"E_FDN": E_FDN}, 2j * np.pi * hertz
    own = exciter(name, p)
    assert not refused(own)
    assert max(map(abs, own.rates(REST).values())) < 1e-9
    points = ((3.0, 0.05), (4.0, 0.3))
    V_E = own.states["exciter.V_E"]
    V_FE = p["K_E"] * V_E + saturated(V_E, points) + p["K_D"] * E_FD
    V_A = V_FE / (p["K_R"] * E_FD)
    field = s * p["T_E"] + p["K_E"] + slope(lambda V: saturated(V, points), V_E)
    gain = slope(lambda V: V * F_EX(p["K_C"] * E_FD / V), V_E)
    amplifier = p["K_A"] / (1 + p["T_A"] * s)
    before = (1 + p["T_C"] * s) / (1 + p["T_B"] * s)
    back = s * K / (1 + p["T_F"] * s)
    within = back if name == "esac3a" else before * back
    loop = field / gain - p["K_R"] * V_A + p["K_R"] * E_FD * amplifier * within
    wanted = p["K_R"] * E_FD * amplifier * before / loop
    response = own.response(s, REST)
    assert response["E_fd", "v_s"] == pytest.approx(wanted, rel=1e-5)
    assert response["E_fd", "v_t"] == pytest.approx(-wanted / (1 + p["T_R"] * s), rel=1e-5)


@pytest.mark.parametrize(("name", "values"), [("esac2a", TWO), ("esac3a", THREE)])
def test_the_field_current_ends_at_its_highest(name, values):
    """V_FE = K_E·V_E + K_D·I_FD without saturation and rectifier, where E_fd is V_E."""
    plain = {"S_E1": 0.0, "S_E2": 0.0, "K_C": 0.0, "V_FEMAX": 4.0, "T_E": 0.2}
    own = exciter(name, values | plain)
    found, _ = integrated(own, lambda t: [V_T, E_FD, 0.3], 1.5, 2e-3)
    assert found[-1]["E_fd"] == pytest.approx((4.0 - 0.4 * E_FD) / 0.9, rel=1e-4)


def test_esac3a_does_not_fall_below_its_lowest_voltage():
    own = exciter("esac3a", THREE | {"V_EMIN": 1.0, "K_C": 0.0, "T_E": 0.2})
    found, _ = integrated(own, lambda t: [V_T, E_FD, -0.5], 1.5, 2e-3)
    assert found[-1]["E_fd"] == pytest.approx(1.0, rel=1e-4)


def test_exac3_holds_its_lowest_field_voltage():
    """Without saturation and rectifier K_R·E_fd·K_A·K_LV·(V_LV − E_fd) = K_E·E_fd + K_D·I_FD."""
    plain = {"S_E1": 0.0, "S_E2": 0.0, "K_C": 0.0, "K_D": 0.0, "V_LV": 1.2, "K_LV": 0.3}
    own = exciter("exac3", THREE | plain | {"T_E": 0.1})
    found, _ = integrated(own, lambda t: [V_T, E_FD, -0.6], 2.0, 2e-3)
    assert found[-1]["E_fd"] == pytest.approx(1.2 - 0.9 / (3.0 * 30.0 * 0.3), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "values", "said"),
    [
        ("esac2a", {"V_FEMAX": 2.0}, "exciter.V_FEMAX must exceed"),
        ("esac3a", {"V_FEMAX": 2.0}, "exciter.V_FEMAX must exceed"),
        ("esac3a", {"V_AMAX": 0.1}, "exciter.V_AMAX"),
        ("esac3a", {"V_EMIN": 5.0}, "exciter.V_EMIN"),
        ("esac2a", {"V_RMAX": 1.0}, "exciter.V_RMAX"),
        ("exac3", {"V_LV": 9.0, "K_LV": 1.0}, "exciter.V_LV: the operating point lies"),
    ],
)
def test_a_start_at_a_limit_is_refused_by_its_name(name, values, said):
    base = TWO if name == "esac2a" else THREE
    assert any(text.startswith(said) for text in refused(exciter(name, base | values)))
