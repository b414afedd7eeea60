"""REGFM_C1 at a source behind an impedance: its equations by hand, both branches, its limits."""

import numpy as np
import pytest

from fmus.regfm_c1.model import regfm_c1_phasor
from orchestrator.cases.networks.psse.missing_models import kind_of
from tests.models import by_hand
from tests.models.closed import AtSource
from tests.models.parts import refused
from tests.models.test_regfm_b1 import Z
from tests.support.evaluated import Evaluated

FLOW = 0.5, 0.1, 1.01  # P, Q, |v| [pu]
W_B = 2 * np.pi * 60.0
GIVEN = {"mq": 0.3, "KpE": 0.2, "KiE": 2.5, "TVr": 0.03, "TVSM": 0.2, "Twm": 0.25, "mp": 0.04}
GIVEN |= {"H": 1.2, "D1": 4.0, "D2": 60.0, "wD": 5.0, "TVf": 0.025, "TPf": 0.015, "TIf": 0.035}
GIVEN |= {"dbVL1": 0.0, "dbVH1": 0.0, "Kqv": 1.5, "Re": 0.02, "Xe": 0.18, "Vmin": 0.7}
GIVEN |= {"T_seen": 0.002}
KINDS = [{}, {"FFlag": 0}, {"VFlag": 0}, {"PQFlag": 0, "Kqv": 0.0}]


class Hand:
    """The equations of the docstring as plain numbers, within all limits; the terminal voltage is the network's.

    ``lagged``: whether the following branch's angle is that of a voltage behind T_seen, as ours; else at once."""

    def __init__(self, flags, *, lagged=True):
        self.g, self.lagged = GIVEN | {"FFlag": 1, "VFlag": 1} | flags, lagged
        P, Q, V = FLOW
        self.inner = complex(self.g["Re"], self.g["Xe"])
        at_rest = V - Z * (P - 1j * Q) / V
        self.source, self.angle = abs(at_rest), -np.angle(at_rest)
        self.x = {"delta": self.angle, "w": 0.0, "steady": 0.0, "droop": 0.0, "P": 0.0}
        self.x |= {"Vr": V, "Iq": 0.0, "x": 0.0, "E": V, "Vf": V}
        self.x |= {"seen_re": V, "seen_im": 0.0} if lagged else {}

    def flow(self, x, source):
        """Terminal voltage, and the following branch's current in the network frame."""
        P, Q, V = FLOW
        frame = np.exp(1j * x["delta"])
        i = complex(P / x["Vf"], -(Q / x["Vf"] + self.g["Kqv"] * (V - x["Vf"])))
        E = x["E"] * frame

        def terminal(angle):
            inside = E + self.inner * i * angle
            return (source / Z + inside / self.inner) / (1 / Z + 1 / self.inner)

        if self.lagged:
            seen = complex(x["seen_re"], x["seen_im"]) * frame
            return terminal(seen / abs(seen)), i * seen / abs(seen)
        v = E
        for _ in range(60):
            v = terminal(v / abs(v))
        return v, i * v / abs(v)

    def rates(self, x, source=None):
        g = self.g
        v, _ = self.flow(x, self.source if source is None else source)
        E = x["E"] * np.exp(1j * x["delta"])
        s = v * np.conj((E - v) / self.inner)
        error = g["VFlag"] * (FLOW[2] - x["Vr"]) / g["mq"] - x["Iq"]
        damping = g["D1"] * x["w"] + g["D2"] * (x["w"] - x["steady"])
        found = {
            "delta": W_B * x["w"],
            "w": (-g["FFlag"] * x["droop"] / g["mp"] - x["P"] - damping) / (2 * g["H"]),
            "steady": g["wD"] * (x["w"] - x["steady"]),
            "droop": (x["w"] - x["droop"]) / g["Twm"],
            "P": (s.real - x["P"]) / g["TPf"],
            "Vr": (abs(v) - x["Vr"]) / g["TVr"],
            "Iq": (s.imag / abs(v) - x["Iq"]) / g["TIf"],
            "x": g["KiE"] * error,
            "E": (FLOW[2] + g["KpE"] * error + x["x"] - x["E"]) / g["TVSM"],
            "Vf": (abs(v) - x["Vf"]) / g["TVf"],
        }
        if self.lagged:
            seen = v * np.exp(-1j * x["delta"])
            found["seen_re"] = (seen.real - x["seen_re"]) / g["T_seen"]
            found["seen_im"] = (seen.imag - x["seen_im"]) / g["T_seen"]
        return found

    def power(self, x, source):
        v, i = self.flow(x, source)
        E = x["E"] * np.exp(1j * x["delta"])
        return (v * np.conj((E - v) / self.inner + i)).real

    def run(self, source, until, step):
        x, found = dict(self.x), []
        for _ in range(round(until / step) + 1):
            found.append(self.power(x, source))
            x = by_hand.stepped(lambda at: self.rates(at, source), x, step)
        return np.array(found)


def modelled(flags, **more):
    hand = Hand(flags)
    P, Q, V = FLOW
    at = {"P_0": P, "Q_0": Q, "v_0": V, "theta_0": hand.angle, "f_n": 60.0}
    return Evaluated(regfm_c1_phasor(), GIVEN | at | flags | more), hand


@pytest.mark.parametrize("flags", KINDS, ids=str)
def test_it_rests_and_its_eigenvalues_are_those_of_the_equations_by_hand(flags):
    device, hand = modelled(flags)
    assert not refused(device)
    at_source = AtSource(device, Z)
    bus = at_source.voltage(device.x, hand.source)
    assert abs(bus - FLOW[2] * np.exp(1j * hand.angle)) < 1e-12
    assert max(map(abs, device.rates([bus.real, bus.imag]).values())) < 1e-9
    assert max(map(abs, hand.rates(hand.x).values())) < 1e-9
    ours = at_source.eigenvalues(hand.source)
    wanted = by_hand.eigenvalues(hand.rates, hand.x)
    assert len(wanted) == 12
    for z in wanted:
        assert min(abs(ours - z)) < 1e-4 * (1 + abs(z)), z


def test_a_voltage_that_is_seen_at_once_changes_its_slow_eigenvalues_by_little():
    """The lag of 2 ms is ours: below 60 1/s it moves them by less than 2 %."""
    device, hand = modelled({})
    at_once = Hand({}, lagged=False)
    ours = AtSource(device, Z).eigenvalues(hand.source)
    slow = [z for z in by_hand.eigenvalues(at_once.rates, at_once.x) if abs(z) < 60]
    assert len(slow) >= 8
    for z in slow:
        assert min(abs(ours - z)) < 0.02 * (0.1 + abs(z)), z


@pytest.mark.parametrize("flags", KINDS, ids=str)
def test_its_power_after_a_jump_is_that_of_the_equations_by_hand(flags):
    device, hand = modelled(flags)
    source = hand.source * np.exp(-0.05j)
    ours = AtSource(device, Z).run(source, 0.5, 5e-4, "p")
    wanted = hand.run(source, 0.5, 5e-4)
    assert np.ptp(wanted) > 0.1
    assert np.abs(ours - wanted).max() < 2e-3 * np.ptp(wanted)


def test_the_forming_branch_feeds_nothing_in_steady_state_without_a_droop():
    """The angle of the network falls away; both branches together feed the reference again."""
    device, hand = modelled({"FFlag": 0, "VFlag": 0}, Kqv=0.0)
    at_source = AtSource(device, Z)
    source = 0.97 * hand.source * np.exp(-0.1j)
    first = at_source.run(source, 0.02, 1e-3, "P_forming")
    forming, p = at_source.run(source, 12.0, 4e-3, "P_forming", "p")[-1]
    assert max(first) > 0.2
    assert forming == pytest.approx(0.0, abs=2e-3)
    assert p == pytest.approx(FLOW[0], abs=2e-3)


def test_its_droop_feeds_power_at_another_speed():
    """The network turns slower by 0.1 %: in steady state 0.001/mp and the damping D1 feed more."""
    device, _ = modelled({"VFlag": 0}, Kqv=0.0, H=0.3)
    slip, x, step = -0.001, np.array(device.x), 1e-3
    for k in range(6000):

        def rate(x, t=k * step):
            bus = FLOW[2] * np.exp(1j * slip * W_B * t)
            found = device.model.derivatives(x, [bus.real, bus.imag], device.p, device.c)
            return np.array(found).ravel()

        x = x + step * rate(x + step / 2 * rate(x))
    t = 5999.5 * step  # the middle of the last step, in which the voltage was held
    bus = FLOW[2] * np.exp(1j * slip * W_B * t)
    found = device.outputs([bus.real, bus.imag], x)
    assert found["omega"] == pytest.approx(1 + slip, abs=1e-5)
    assert found["P_forming"] == pytest.approx(0.001 / 0.04 + 4.0 * 0.001, rel=0.02)


def test_both_branches_together_stay_within_the_most_current():
    device, hand = modelled({}, Imax=1.0)
    at_source = AtSource(device, Z)
    source = 0.3 * hand.source
    found, free = at_source.run(source, 0.05, 5e-4, "I", "fault_current").T
    assert max(free) > 1.5
    assert (free[48:] > 1.0).all()
    assert found[48:] == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize(("active_first", "P", "Q"), [(1, 0.9, 0.3), (0, 0.3, 0.9)])
def test_the_current_that_comes_first_leaves_the_rest_to_the_other(active_first, P, Q):
    """At 0.8 of its voltage the following branch asks for more than Imax."""
    values = {"P_0": P, "Q_0": Q, "Imax": 1.0, "Kf": 0.95, "Vmin": 0.5, "PQFlag": active_first}
    values |= {"Kqv": 0.0, "QcmdGFLmax": 1.0}
    device = Evaluated(regfm_c1_phasor(), values)
    assert not refused(device)
    x = device.vector(device.states | {"Vf": 0.8})
    found = device.outputs([0.8, 0.0], x)
    first, rest = ("p", "q") if active_first else ("q", "p")
    assert found[f"I_{first}_following"] == pytest.approx(0.95)
    assert found[f"I_{rest}_following"] == pytest.approx(np.sqrt(1 - 0.95**2))


def test_low_voltage_asks_for_reactive_current_beyond_the_dead_band():
    values = {"P_0": 0.3, "Kqv": 2.0, "dbVL1": -0.1, "dbVH1": 0.1, "Vmin": 0.9}
    device = Evaluated(regfm_c1_phasor(), values)
    found = device.outputs([0.8, 0.0], device.vector(device.states | {"Vf": 0.8}))
    assert found["I_q_following"] == pytest.approx(2.0 * 0.1)
    assert found["I_p_following"] == pytest.approx(0.3 / 0.9)
    inside = device.outputs([0.95, 0.0], device.vector(device.states | {"Vf": 0.95}))
    assert inside["I_q_following"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"P_0": 1.1, "Imax": 1.0}, "more current than Imax and Kf leave"),
        ({"P_0": 0.95, "Kf": 0.7}, "more current than Imax and Kf leave"),
        ({"P_0": 0.9, "PcmdGFLmax": 0.8}, "more active power than PcmdGFLmax"),
        ({"P_0": -0.6, "PcmdGFLmin": -0.5}, "less active power than PcmdGFLmin"),
        ({"Q_0": 0.7}, "more reactive power than QcmdGFLmax"),
        ({"Q_0": -0.7}, "less reactive power than QcmdGFLmin"),
    ],
)
def test_an_operating_point_beyond_a_limit_is_refused(values, words):
    device = Evaluated(regfm_c1_phasor(), {"P_0": 0.5} | values)
    assert any(words in text for text in refused(device))


def test_its_record_is_known_for_that_of_a_converter():
    """The order of its fields is not public, so that no part is made of it."""
    assert kind_of("REGFMC1U") == kind_of("REGFMC1") == "converter"
