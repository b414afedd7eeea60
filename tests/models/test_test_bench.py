"""The test bench against its equations by hand, and its programme against what it is to do."""

from cmath import exp

import numpy as np
import pytest

from fmus.toolchain.catalogue import build_model
from tests.support.evaluated import Evaluated

VALUES = {
    "P_0": 0.7,
    "Q_0": 0.1,
    "X_0": 0.3,
    "R_0": 0.05,
    "B": 0.05,
    "load.P": 50.0,
    "load.Q": 20.0,
    "f_n": 60.0,
}
OMEGA = 120 * np.pi


def injected(current):
    return [current.real, current.imag, 0.0, 0.0]


def bench(**changed):
    return Evaluated(build_model("test_bench"), VALUES | changed)


def test_it_starts_at_rest_with_its_plant():
    assert max(map(abs, bench().rates(injected(0.7 - 0.1j)).values())) < 1e-7


@pytest.mark.parametrize("jump", [0.0, 0.4])
def test_the_source_behind_its_impedance_written_by_hand(jump):
    i_0 = (0.5 - 0.2j) + 0.05j - (0.7 - 0.1j)
    start = 1 + (0.05 + 0.3j) * i_0
    e = 0.8 * abs(start) * exp(1j * (np.angle(start) + jump))
    device = bench(**{"source.jump": jump, "source.factor": 0.8, "X_factor": 2.0, "R_factor": 3.0})
    i, v = 0.3 + 0.2j, 0.9 + 0.1j
    state = device.vector(
        device.states
        | {"line.i_re": i.real, "line.i_im": i.imag, "bus.v_re": v.real, "bus.v_im": v.imag}
    )
    found = device.rates(injected(0j), state)
    rate = OMEGA / 0.6 * (e - v - (0.15 + 0.6j) * i)
    assert complex(found["line.i_re"], found["line.i_im"]) == pytest.approx(rate, rel=1e-9)


def test_a_fault_and_the_duplicate_act_at_the_bus():
    quiet, faulted = bench(), bench(**{"fault.G": 10.0})
    key = "bus.v_re"
    change = faulted.rates(injected(0.7 - 0.1j))[key] - quiet.rates(injected(0.7 - 0.1j))[key]
    assert change == pytest.approx(-10 * OMEGA / 0.05, rel=1e-9)
    both = quiet.rates([0.7, -0.1, 0.2, 0.0])[key] - quiet.rates(injected(0.7 - 0.1j))[key]
    assert both == pytest.approx(0.2 * OMEGA / 0.05, rel=1e-9)


def test_the_current_fades_behind_an_open_breaker():
    device = bench(**{"source.connected": 0.0})
    found = device.rates(
        injected(0j), device.vector(device.states | {"line.i_re": 0.4, "line.i_im": -0.3})
    )
    assert (found["line.i_re"], found["line.i_im"]) == pytest.approx((-400.0, 300.0), rel=1e-9)


def test_the_frequency_rises_at_the_rate_that_is_set():
    found = bench(**{"source.rise": 4 / 60}).rates(injected(0.7 - 0.1j))
    assert found["source.delta_omega"] == pytest.approx(4 / 60)


def test_it_bears_the_name_by_which_it_is_asked_for():
    """Its FMU's file and the identifier within are called so: letters, digits and underscores."""
    assert build_model("test_bench").name == "test_bench"
