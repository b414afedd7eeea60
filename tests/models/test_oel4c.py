"""OEL4C: times by hand, Dynawo's diagram with its switch and timer step by step, and a machine that it brings down."""

from dataclasses import dataclass

import numpy as np
import pytest

from fmus.synchronous_generator.parts import OELS
from tests.models.one_machine import OneMachine, three_buses
from tests.models.parts import E_FD, V_T, integrated, limiter, refused

STEP = 1e-3
QUICK = {"Q_ref": 0.3, "T_delay": 0.2, "K_P": 0.4, "K_I": 1.5, "V_min": -0.15}
Q_START = 0.1 * V_T  # of the parts' operating point [pu]


def seen(Q):
    """Inputs of a machine that gives a reactive power [pu]."""
    return [E_FD, E_FD, 0.7, -Q / V_T]


REST = seen(Q_START)


def limited(values, power, end):
    alone = limiter(values, oel=OELS["oel4c"])
    assert not refused(alone)
    found, _ = integrated(alone, lambda t: seen(power(t)), end, STEP)
    return found


@dataclass
class Diagram:
    """Dynawo's Oel4c: a timer, a switch, and a PI whose integral waits beyond its limits; integrated by Euler."""

    p: dict
    since: float | None = None
    x: float = 0.0

    def step(self, t, Q, h):
        p, e = self.p, self.p["Q_ref"] - Q
        if e >= 0:
            self.since = None
        elif self.since is None:
            self.since = t
        lasted = 0.0 if self.since is None else t - self.since
        u = 0.0 if lasted < p["T_delay"] else e
        wanted = p["K_P"] * u + self.x
        if p["V_min"] <= wanted <= 0:
            self.x += h * p["K_I"] * u
        return min(max(p["K_P"] * u + self.x, p["V_min"]), 0.0)


def power(t):
    """Short of its delay, beyond it, below the limit, and far beyond it until the least signal holds."""
    if t < 0.15:
        return 0.5
    if t < 0.3:
        return 0.2
    if t < 0.6:
        return 0.45
    return 0.1 if t < 0.8 else 0.55


@pytest.mark.parametrize("changed", [{}, {"T_delay": 0.0}, {"K_I": 0.0}, {"K_P": 0.0}])
def test_the_limiter_follows_dynawo_s_diagram_step_by_step(changed):
    p, end, parts = QUICK | changed, 1.4, 5
    diagram, wanted = Diagram(p), []
    for k in range(round(end / STEP)):
        for n in range(parts):
            t = k * STEP + n * STEP / parts
            signal = diagram.step(t, power(t), STEP / parts)
        wanted.append(signal)
    found = np.array([each["oel.signal"] for each in limited(p, power, end)])
    apart = np.abs(found - wanted)
    assert min(wanted) < -0.05
    assert np.median(apart) < 1e-4
    assert np.sum(apart > 2e-3) <= 6  # steps at which the switch turns


def test_it_waits_for_its_delay_and_then_adds_both_parts():
    """At once K_P·e, and K_I·e a second more."""
    found = limited(QUICK, lambda t: 0.4, 0.6)
    signal = np.array([each["oel.signal"] for each in found])
    (first, *_) = np.flatnonzero(signal < -1e-6)
    assert first * STEP == pytest.approx(0.2, abs=2 * STEP)
    assert signal[first + 1] == pytest.approx(-0.4 * 0.1, abs=1e-3)
    assert signal[-1] == pytest.approx(-0.4 * 0.1 - 1.5 * 0.1 * 0.4, abs=1e-3)
    assert [found[k]["oel.acts"] for k in (0, first - 2, -1)] == [0, 0, 1]


@pytest.mark.parametrize(("delay", "kept"), [(0.2, True), (0.0, False)])
def test_below_its_limit_it_stays_unless_it_has_no_delay(delay, kept):
    found = limited(QUICK | {"T_delay": delay}, lambda t: 0.45 if t < 0.5 else 0.1, 1.2)
    assert found[499]["oel.signal"] < -0.08
    assert (found[-1]["oel.signal"] < -0.05) == kept


@pytest.mark.parametrize(("Q_ref", "moved"), [(0.3, 0.0), (0.05, Q_START - 0.05 + 1e-3)])
@pytest.mark.parametrize("delay", [0.0, 0.2])
def test_it_rests_at_the_start_and_beyond_its_limit_with_that_moved(Q_ref, moved, delay):
    alone = limiter(QUICK | {"Q_ref": Q_ref, "T_delay": delay}, oel=OELS["oel4c"])
    assert not refused(alone)
    assert alone.parameters["oel.moved"] == pytest.approx(moved, abs=1e-12)
    assert max(map(abs, alone.rates(REST).values())) < 1e-9
    assert alone.outputs(REST)["oel.acts"] == 0
    A = np.array(alone.blocks(REST)[0], dtype=float)
    assert np.linalg.eigvals(A).real.max() < -0.1


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"V_min": 0.1}, "oel.V_min must not exceed 0"),
        ({"K_P": 0.0, "K_I": 0.0}, "oel: one of K_P and K_I must exceed 0"),
    ],
)
def test_what_cannot_limit_is_refused(values, said):
    assert refused(limiter(values, oel=OELS["oel4c"])) == [said]


MACHINE = """102 'GENROU' 1 7.4 0.03 0.5 0.05 3.1 0.0 1.25 1.2 0.35 0.5 0.25 0.06 0.0 0.0 /
102 'EXST1' 1 0.01 99 -99 0 0 100 0.02 9 -9 0 0 1 /
102 'OEL4C' 1 {} 0.5 0 0.12 -0.2 /
"""


def test_a_machine_that_is_asked_for_too_much_ends_below_its_limit_and_stays_there(tmp_path):
    """The field's lag carries it a little too far, and the integral does not go back."""
    network, _ = three_buses()
    most = network.injected().imag + 0.2
    one = OneMachine(MACHINE.format(most), tmp_path, network, torque=True)
    rows = one.run(network.lines, 6.0, every=0.5, changed={"exciter.delta_V_ref": 0.06})
    given = {time: out["q"] for time, out, _ in rows}
    assert given[0.0] < most < given[1.5]
    assert most - 0.06 < given[6.0] < most
    assert given[6.0] == pytest.approx(given[5.5], abs=2e-3)
    assert [rows[k][1]["oel.acts"] for k in (0, 2, -1)] == [0, 0, 1]
