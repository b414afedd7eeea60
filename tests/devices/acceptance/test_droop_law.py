"""The droop of the voltage that check derives, on answers made from the law itself."""

import numpy as np
import pytest
from scipy.optimize import brentq

from orchestrator.devices.acceptance.checks import droop as law
from orchestrator.devices.acceptance.checks import signs
from orchestrator.devices.acceptance.checks.droop import FREQUENCY, VOLTAGE, DroopAnswer, Way

R, X, SLOPE = 0.01, 0.3, 0.06
EFFECT = 0.05
"""Active power that the lower frequency brings [pu]."""


def answer(point, fall, slower, slope=SLOPE, inside=False):
    """The device's settled answer to a change of the voltage and of the frequency, by bisection for its power."""
    i_0 = complex(point.P, -point.Q)
    e_0 = 1 + complex(R, X) * i_0
    v, active = 1 - fall, point.P + (EFFECT if slower else 0.0)

    def current(q):
        return complex(active, -q) / v

    def away(q):
        i = current(q)
        e = v + complex(R, X * (1 - slower)) * i
        at, before = (e, e_0) if inside else (v, 1.0)
        return (
            abs(e)
            - abs(e_0)
            + slope * ((at * i.conjugate()).imag - (before * i_0.conjugate()).imag)
        )

    q = brentq(away, point.Q - 1.0, point.Q + 1.0)
    i = current(q)
    power = v * i.conjugate() - i_0.conjugate()
    return DroopAnswer(i - i_0, power, power, 0.0, abs(power), ())


def lagging(point):
    """The settled answer of a phasor model to less frequency."""
    i_0 = complex(point.P, -point.Q)
    e_0 = abs(1 + complex(R, X) * i_0)
    active = point.P + EFFECT

    def away(q):
        e = 1 + complex(R, X) * (1 - 1j * LAG * FREQUENCY) * complex(active, -q)
        return abs(e) - e_0 + SLOPE * (q - point.Q)

    i = complex(active, -brentq(away, point.Q - 1.0, point.Q + 1.0))
    power = i.conjugate() - i_0.conjugate()
    return DroopAnswer(i - i_0, power, power, 0.0, abs(power), ())


@pytest.mark.parametrize("slope", [0.06, -0.06])
@pytest.mark.parametrize("inside", [False, True])
def test_the_slope_of_the_law_comes_out(slope, inside):
    points = [law.OperatingAt(1.0, 0.0, P, Q) for P, Q in ((0.5, 0.0), (0.2, 0.1), (0.7, -0.1))]
    found = [
        (p, answer(p, VOLTAGE, 0.0, slope, inside), answer(p, 0.0, FREQUENCY, slope, inside))
        for p in points
    ]
    assert law.droop(found) == pytest.approx(slope, abs=1e-5)


LAG = 1.2
"""Angle [rad] by which a phasor model's current lags with 1 pu of frequency: 4 ms."""


def test_a_phasor_model_whose_current_lags_has_no_droop_of_the_wrong_sign():
    """Its reactance does not follow the frequency, and its current lags: both look like a voltage that rises."""
    points = [law.OperatingAt(1.0, 0.0, P, Q) for P, Q in ((0.7, 0.1), (0.2, 0.02), (-0.5, 0.1))]
    found = [(p, answer(p, VOLTAGE, 0.0), lagging(p)) for p in points]
    assert law.droop(found) is None or law.droop(found) > 0
    assert np.abs(law._errors(np.array([R, X, SLOPE, LAG]), found, False)).max() < 1e-9


def test_the_reactance_falls_with_the_frequency():
    """The law holds to rounding for its own answers; the reactance of the rated frequency leaves 1e-5 pu."""
    point = law.OperatingAt(1.0, 0.0, 0.5, 0.1)
    found = [(point, answer(point, VOLTAGE, 0.0), answer(point, 0.0, FREQUENCY))]
    assert np.abs(law._errors(np.array([R, X, SLOPE]), found, False)).max() < 1e-12


@pytest.mark.parametrize(
    ("moving", "said"), [((0.0, 0.0), "wrong sign"), ((0.5, 0.0), ""), ((0.0, 0.5), "wrong sign")]
)
def test_only_an_answer_that_has_settled_has_a_sign(moving, said):
    """Reactive power that falls with the voltage is wrong where it rests; the frequency's answer does not matter."""
    falls, rises = (
        DroopAnswer(
            power, power, power, moves, 0.05, (Way(0j, moves, 0.05, None, 0.0, (0.0, 0.0, 0)),) * 2
        )
        for power, moves in zip((-0.05j, 0.05), moving, strict=True)
    )
    found = signs._wrong(law.POINT, falls, rises)
    assert (found[0] if found else "") == said


@pytest.mark.parametrize(
    ("P", "falls", "said"), [(0.6, 2e-3, ""), (0.6, 4e-3, "wrong sign"), (0.0, 2e-3, "wrong sign")]
)
def test_a_constant_torque_gives_less_power_at_less_frequency(P, falls, said):
    rest = (Way(0j, 0.0, 0.05, None, 0.0, (0.0, 0.0, 0)),) * 2
    answers = [DroopAnswer(power, power, power, 0.0, 0.05, rest) for power in (0.05j, -falls)]
    found = signs._wrong(law.OperatingAt(1.0, 0.0, P, 0.1), *answers)
    assert (found[0] if found else "") == said


@pytest.mark.parametrize(
    ("part", "said"),
    [
        (1.0, ""),
        (1.2, "wrong rated frequency"),
        (50 / 60, "wrong rated frequency"),
        (1.4, "wrong frequency"),
        (0.0, "wrong frequency"),
        (-1.0, "wrong frequency"),
    ],
)
def test_an_omega_of_another_rated_frequency_is_told_as_such(part, said):
    ways = tuple(
        Way(0j, 0.0, 0.05, 1 - sign * part * FREQUENCY, 0.0, (0.0, 0.0, 0)) for sign in (1, -1)
    )
    found = signs._wrong_omega(DroopAnswer(0.05, 0.05, 0.05, 0.0, 0.05, ways), 50.0)
    assert (found.fault if found else "") == said
