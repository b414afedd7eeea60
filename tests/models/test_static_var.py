"""CSVGN1 against its equations by hand, its steady state and its transfer function."""

import numpy as np
import pytest

from fmus.static_var.csvgn1 import csvgn1_phasor
from tests.models.parts import refused
from tests.support.evaluated import Evaluated

VALUES = {
    "S_n": 430.0,
    "Q_0": 68.3 / 430,
    "v_0": 1.055,
    "K": 15.0,
    "T1": 0.02,
    "T2": 0.9,
    "T3": 0.07,
    "T4": 1.1,
    "T5": 0.006,
    "CBASE": 400.0,
}
BUS = [VALUES["v_0"], 0.0]


def compensator(**values):
    return Evaluated(csvgn1_phasor(), VALUES | values)


def test_it_starts_at_rest_with_the_power_flows_reactive_power():
    device = compensator()
    assert max(map(abs, device.rates(BUS).values())) < 1e-10
    found = device.outputs(BUS)
    assert found["B"] == pytest.approx(VALUES["Q_0"] / VALUES["v_0"] ** 2)
    assert found["q"] == pytest.approx(VALUES["Q_0"])
    assert found["p"] == pytest.approx(0, abs=1e-12)
    reactor = 400 / 430 - found["B"]
    assert device.parameters["Vref"] == pytest.approx(VALUES["v_0"] - reactor / VALUES["K"])


@pytest.mark.parametrize("frequency", [0.05, 0.5, 2.0])
def test_its_susceptance_follows_the_voltage_by_the_diagrams_transfer_function(frequency):
    s, p = 2j * np.pi * frequency, VALUES
    stages = (1 + s * p["T1"]) * (1 + s * p["T2"]) / ((1 + s * p["T3"]) * (1 + s * p["T4"]))
    wanted = -p["K"] * stages / (1 + s * p["T5"])
    found = compensator().response(s, BUS)["B", "v_re"]
    lag = (s * 0.002) ** 2  # by which the extrapolated voltage errs
    assert found == pytest.approx(wanted, rel=2 * abs(lag) + 1e-9)


def test_a_susceptance_of_a_bus_takes_reactive_power_alone():
    """Current to voltage at rest: −jB, with B falling as the voltage rises, so that no active power comes of it."""
    device = compensator()
    B_0, slope = device.outputs(BUS)["B"], compensator().response(1e-9, BUS)["B", "v_re"].real
    of = device.response(1e-9, BUS)
    base = VALUES["S_n"] / 100
    wanted = {
        ("i_im", "v_re"): -(B_0 + slope * VALUES["v_0"]) * base,
        ("i_re", "v_im"): B_0 * base,
        ("i_re", "v_re"): 0.0,
        ("i_im", "v_im"): 0.0,
    }
    for key, value in wanted.items():
        assert of[key] == pytest.approx(value, abs=1e-6), key


def test_the_reactor_ends_at_its_limits():
    """Low voltage: no reactor, the whole capacitor; high voltage: all of it; RMIN leaves a part."""
    for v, rmin, reactor in ((0.7, 0.0, 0.0), (1.4, 0.0, 1.0), (0.7, 43.0, 0.1)):
        device = compensator(RMIN=rmin, VMAX=2.0, VMIN=-2.0)
        x = device.states
        x |= {"bus_voltage.once_re": v, "bus_voltage.twice_re": v}
        # the integrator beyond the limit, as the control drives it there
        x |= {"reactor": -0.2 if v < 1 else 1.3}
        found = device.outputs([v, 0.0], device.vector(x))["B"]
        assert found == pytest.approx(400 / 430 - reactor), (v, rmin)
        held = device.rates([v, 0.0], device.vector(x | {"reactor": reactor}))["reactor"]
        assert held == pytest.approx(0), (v, rmin)


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"P_0": 0.1}, "feeds no active power"),
        ({"Q_0": 1.2}, "outside of VMIN to VMAX: lower Q_0, or change CBASE"),
        ({"Q_0": -0.3}, "outside of VMIN to VMAX: raise Q_0, or change CBASE"),
        ({"Q_0": 0.9, "RMIN": 100.0}, "outside of RMIN to S_n: lower Q_0"),
    ],
)
def test_what_the_compensator_cannot_start_from_is_refused(values, rule):
    broken = refused(compensator(**values))
    assert any(rule in text for text in broken), broken
