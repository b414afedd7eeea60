"""Stabilisers of `synchronous_generator`: transfer functions by hand, and their limits."""

import numpy as np
import pytest

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from tests.models.parts import AT_BUS, AT_REST, BUS, refused, stabilizer
from tests.support.evaluated import Evaluated

REST = AT_REST["pss"]
ONE = {"K_S": 9.5, "T_5": 1.41, "T_6": 0.02, "T_1": 0.154, "T_2": 0.033, "T_3": 0.2, "T_4": 0.05}
TWO = {
    "T_w1": 2.5,
    "T_w2": 3.0,
    "T_w3": 3.5,
    "T_w4": 4.0,
    "T_6": 0.03,
    "T_7": 2.2,
    "T_8": 0.5,
    "T_9": 0.11,
    "K_s1": 13.0,
    "K_s2": 0.2,
    "K_s3": 0.9,
    "T_1": 0.22,
    "T_2": 0.05,
    "T_3": 0.31,
    "T_4": 0.14,
}


@pytest.mark.parametrize("filtered", [{}, {"A_1": 0.06}, {"A_1": 0.061, "A_2": 0.0017}])
@pytest.mark.parametrize("hertz", [0.08, 0.5, 1.2, 6.0])
def test_pss1a_is_the_standards_diagram(hertz, filtered):
    s, p = 2j * np.pi * hertz, ONE
    wanted = p["K_S"] * s * p["T_5"] / (1 + s * p["T_5"]) / (1 + s * p["T_6"])
    wanted *= (1 + s * p["T_1"]) / (1 + s * p["T_2"]) * (1 + s * p["T_3"]) / (1 + s * p["T_4"])
    wanted /= 1 + filtered.get("A_1", 0.0) * s + filtered.get("A_2", 0.0) * s**2
    alone = stabilizer("pss1a", p | filtered)
    assert not refused(alone)
    assert alone.response(s, REST)["v_s", "speed"] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize(
    "left_out", [(), ("T_w2", "T_w4", "T_6"), ("T_w1", "T_w2", "T_w3", "T_w4", "T_7")]
)
@pytest.mark.parametrize("hertz", [0.08, 0.5, 4.0])
@pytest.mark.parametrize("name", ["pss2a", "pss2b"])
def test_pss2a_and_pss2b_are_the_standards_diagram(name, hertz, left_out):
    third = {"T_10": 0.25, "T_11": 0.04} if name == "pss2b" else {}
    p = TWO | third | dict.fromkeys(left_out, 0.0)
    s = 2j * np.pi * hertz

    def washout(T):
        return s * T / (1 + s * T) if T else 1.0

    speed = washout(p["T_w1"]) * washout(p["T_w2"]) / (1 + s * p["T_6"])
    power = washout(p["T_w3"]) * washout(p["T_w4"]) * p["K_s2"] / (1 + s * p["T_7"])
    ramp = (1 + s * p["T_8"]) / (1 + s * p["T_9"]) ** 5
    leads = (1 + s * p["T_1"]) / (1 + s * p["T_2"]) * (1 + s * p["T_3"]) / (1 + s * p["T_4"])
    leads *= (1 + s * p.get("T_10", 0.0)) / (1 + s * p.get("T_11", 0.0))
    wanted = {
        ("v_s", "speed"): p["K_s1"] * leads * ramp * speed,
        ("v_s", "power"): p["K_s1"] * leads * (ramp * p["K_s3"] - 1) * power,
    }
    assert stabilizer(name, p).response(s, REST) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("name", ["pss1a", "pss2a", "pss2b"])
def test_the_signal_stays_within_two_limits_of_its_own(name):
    free = stabilizer(name, {"V_STMAX": 99.0, "V_STMIN": -99.0})
    limited = stabilizer(name, {"V_STMAX": 0.08, "V_STMIN": -0.05})
    off = stabilizer(name, {"enabled": 0})
    for speed in (-0.5, -1e-4, 0.0, 1e-4, 0.5):
        x = free.x + speed * 0.1
        wanted = free.outputs([speed, 0.8], x)["v_s"]
        assert limited.outputs([speed, 0.8], x)["v_s"] == pytest.approx(
            np.clip(wanted, -0.05, 0.08), rel=1e-12
        )
        assert off.outputs([speed, 0.8], x)["v_s"] == 0.0


def test_the_inputs_of_pss2b_are_limited():
    alone = stabilizer(
        "pss2b", {"V_SI1MAX": 0.01, "V_SI1MIN": -0.02, "V_SI2MAX": 0.9, "V_SI2MIN": 0.5}
    )
    rates = alone.rates
    assert rates([0.5, 0.8]) == rates([0.01, 0.8])
    assert rates([-0.5, 0.8]) == rates([-0.02, 0.8])
    assert rates([0.0, 1.5]) == pytest.approx(rates([0.0, 0.9]), abs=1e-12)
    assert rates([0.0, 0.1]) == pytest.approx(rates([0.0, 0.5]), abs=1e-12)
    assert rates([0.0, 0.85]) != rates([0.0, 0.9])


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
@pytest.mark.parametrize("name", ["pss1a", "pss2a", "pss2b"])
def test_a_generator_with_it_starts_in_steady_state_and_its_swing_is_damped(name, factory):
    swings = []
    for values in ({"pss.enabled": 0}, {}):
        device = Evaluated(
            factory(exciter="st1a", stabilizer=name), AT_BUS | {"machine.R_s": 0.003} | values
        )
        assert not refused(device)
        assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-8
        poles = np.linalg.eigvals(device.blocks([BUS.real, BUS.imag])[0])
        swings.append(min((z for z in poles if 6 < z.imag < 14), key=lambda z: abs(z - 9j)))
    assert swings[1].real < swings[0].real
