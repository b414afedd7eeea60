"""The limits of ESAC6A, AC7B, DC4B and EXPIC1, one at a time: where E_fd ends while the error stays large.

Without saturation and rectifier's loading, and with K_E = 1, E_fd is what drives the exciter."""

import numpy as np
import pytest

from fmus.toolchain.blocks import RETURN_TIME, limited_low_pass
from fmus.toolchain.model_builder import ModelBuilder
from tests.models.parts import E_FD, V_T, exciter, integrated, refused
from tests.support.evaluated import Evaluated

LINEAR = {"S_E1": 0.0, "S_E2": 0.0, "K_E": 1.0, "T_E": 0.1}
ALTERNATOR = LINEAR | {"K_C": 0.0, "K_D": 0.0}
LIMITER_OFF = {"V_FELIM": 99.0}
LOW_VOLTAGE = 0.6  # of the terminal [pu]
SETTLED = 2.0  # [s]: 20 time constants of the exciter


def end(name, values, v_t, signal):
    alone = exciter(name, values)
    assert not refused(alone)
    found, _ = integrated(alone, lambda t: [v_t, E_FD, signal], SETTLED)
    return found[-1]["E_fd"]


@pytest.mark.parametrize(
    ("values", "v_t", "upper"),
    [
        ({"V_AMAX": 4.0}, V_T, 4.0),
        ({"V_RMAX": 4.0}, V_T, 4.0 * V_T),
        ({"V_RMAX": 4.0}, LOW_VOLTAGE, 4.0 * LOW_VOLTAGE),
        # the field current's limiter: E = V_AMAX − K_H·(E − V_FELIM), and V_AMAX − V_HMAX
        ({"V_AMAX": 6.0, "V_FELIM": 3.0, "K_H": 2.0, "V_HMAX": 99.0}, V_T, 4.0),
        ({"V_AMAX": 6.0, "V_FELIM": 3.0, "K_H": 2.0, "V_HMAX": 1.5}, V_T, 4.5),
    ],
)
def test_esac6a_stops_at_each_of_its_limits(values, v_t, upper):
    given = ALTERNATOR | LIMITER_OFF | {"V_AMAX": 50.0, "V_RMAX": 50.0} | values
    assert end("esac6a", given, v_t, 0.5) == pytest.approx(upper, rel=1e-6)
    assert end("esac6a", given, v_t, -0.9) == pytest.approx(0.0, abs=1e-6)  # the alternator's V_E


@pytest.mark.parametrize(
    ("values", "upper"),
    [
        ({"V_AMAX": 0.8}, 0.8 * 5.0 * V_T),
        (
            {"V_RMAX": 0.7, "V_AMAX": 50.0, "K_PA": 2.0, "K_F1": 0.25},
            2.8,
        ),  # K_F1·E_fd takes all of it
        ({"V_FEMAX": 3.4}, 3.4),
    ],
)
def test_ac7b_stops_at_each_of_its_limits(values, upper):
    given = ALTERNATOR | {"K_P": 5.0, "K_F1": 0.2, "K_F2": 0.0, "V_AMAX": 2.0} | values
    assert end("ac7b", given, V_T, 0.5) == pytest.approx(upper, rel=1e-5)


def test_ac7b_falls_to_its_lowest_voltage():
    assert end("ac7b", ALTERNATOR | {"V_EMIN": 0.4}, V_T, -0.5) == pytest.approx(0.4, rel=1e-6)


@pytest.mark.parametrize(
    ("values", "v_t", "signal", "wanted"),
    [
        ({"V_RMAX": 4.0}, V_T, 0.5, 4.0),  # above 1 pu the controller's limit is nearer
        ({"V_RMAX": 4.0}, LOW_VOLTAGE, 0.5, 4.0 * LOW_VOLTAGE),
        ({"V_RMIN": -1.0, "V_EMIN": -9.0}, 0.9, -0.5, -1.0 * 0.9),
        ({"V_RMIN": -1.0, "V_EMIN": 0.5}, V_T, -0.5, 0.5),
    ],
)
def test_dc4b_stops_at_each_of_its_limits(values, v_t, signal, wanted):
    assert end("dc4b", LINEAR | values, v_t, signal) == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize(
    ("high", "low"), [("V_R1", "V_R2"), ("V_RMAX", "V_RMIN"), ("E_FDMAX", "E_FDMIN")]
)
def test_expic1_stops_at_each_of_its_limits(high, low):
    given = LINEAR | {high: 4.0, low: -1.0}
    assert end("expic1", given, V_T, 0.5) == pytest.approx(4.0, rel=1e-6)
    assert end("expic1", given, V_T, -0.5) == pytest.approx(-1.0, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("dc4b", LINEAR | {"V_RMAX": 4.0, "V_RMIN": -1.0, "K_PR": 2.0, "K_IR": 20.0}),
        ("expic1", LINEAR | {"V_R1": 4.0, "K_A": 20.0, "T_A1": 0.1}),
        ("ac7b", ALTERNATOR | {"V_AMAX": 0.8, "K_P": 5.0}),
    ],
)
def test_an_integrator_does_not_wind_up_at_its_limit(name, values):
    """2 s at the limit: 0.1 s after the error has turned, E_fd is on its way down; wound up, it would wait seconds."""
    alone = exciter(name, values)
    found, x = integrated(alone, lambda t: [V_T, E_FD, 0.5], SETTLED)
    back, _ = integrated(alone, lambda t: [V_T, E_FD, -0.2], 0.1, x=x)
    assert back[-1]["E_fd"] < 0.95 * found[-1]["E_fd"]


LAG = 0.5  # [s]


def limited_lag(at_start):
    """A lag whose input and limits are inputs."""
    m = ModelBuilder("alone", "A lag within limits")
    u, low, high = (m.input(name, "pu", name, base="S_n") for name in ("u", "low", "high"))
    y = limited_low_pass(m, "x", u, LAG, low, high, initial=at_start)
    m.output("y", y, "pu", "y", base="S_n")
    return Evaluated(m.build())


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("u", [0.2, 0.55, 0.9], ids=["inward", "slowly inward", "outward"])
def test_a_lag_starts_from_the_limit_that_has_moved_past_it(u, side):
    """From 1, a limit moves to 0.6: a lag starts there, as IEEE 421.5 has it, and not from where it was.

    Its return to the limit takes r·t·log(1 + 0.4/(r·t)) from what it has moved by its own rate r meanwhile, t being
    `RETURN_TIME`; when the limit opens again the lag goes on from there."""
    own = limited_lag(side * 1.0)
    limits = (-9.0, side * 0.6) if side > 0 else (side * 0.6, 9.0)
    found, x = integrated(own, lambda t: [side * u, *limits], 0.3)
    t = np.arange(1, len(found) + 1) * 1e-3
    wanted = side * np.minimum(u + (0.6 - u) * np.exp(-t / LAG), 0.6)
    moved = max((0.6 - u) / LAG, 1e-9) * RETURN_TIME
    most = moved * np.log1p(0.4 / moved)
    off = side * (np.array([each["y"] for each in found]) - wanted)
    assert off.min() > -1e-9
    assert off.max() < most + 1e-9
    opened, _ = integrated(own, lambda t: [side * u, -9.0, 9.0], 0.2, x=x)
    ideal = side * u + (wanted[-1] - side * u) * np.exp(-0.2 / LAG)
    assert opened[-1]["y"] == pytest.approx(ideal, abs=most + 1e-9)


def test_a_lag_at_rest_at_its_limit_is_linearised_as_within_it():
    """A power flow puts it there to its accuracy."""
    for start in (0.6, 0.6 - 1e-10, 0.6 + 1e-10):
        own = limited_lag(start)
        assert own.blocks([start, -9.0, 0.6])[0] == -1 / LAG
