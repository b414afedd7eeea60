"""REGFM_B1 at a source behind an impedance: its equations by hand, its limits, its frozen PLL, its record."""

import numpy as np
import pytest

from fmus.regfm_b1.dyr_records import REGFM_B1_RECORDS
from fmus.regfm_b1.model import regfm_b1_phasor
from tests.models import by_hand
from tests.models.closed import AtSource
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

Z = 0.02 + 0.2j  # of the network [pu]
FLOW = 0.5, 0.1, 1.01  # P, Q, |v| [pu]
W_B = 2 * np.pi * 60.0
GIVEN = {"mq": 0.06, "kpv": 0.1, "kiv": 6.0, "mp": 0.03, "kpPLL": 0.2, "kiPLL": 2.0, "Tp": 0.03}
GIVEN |= {"H": 0.7, "D1": 1.5, "D2": 60.0, "wD": 40.0, "TPf": 0.02, "TQf": 0.03, "TVf": 0.01}
GIVEN |= {"TIf": 0.015, "Re": 0.003, "XL": 0.14, "ImaxSS": 1.0, "kf": 0.9, "ImaxF": 1.6}
KINDS = [{}, {"wFlag": 1}, {"VdrpFlag": 1}, {"FFlag": 0}, {"PQFlag": 0, "ESFlag": 0}]
"""Flags that differ from those of the record's example."""


class Hand:
    """The equations of the docstring as plain numbers, within all limits; the terminal voltage is the network's."""

    def __init__(self, flags):
        self.g = GIVEN | {"wFlag": 0, "VdrpFlag": 0, "FFlag": 1} | flags
        P, Q, V = FLOW
        i = (P - 1j * Q) / V
        self.inner = complex(self.g["Re"], self.g["XL"])
        E = V + self.inner * i
        self.source = abs(V - Z * i)
        self.angle = -np.angle(V - Z * i)
        self.x = {"pll": self.angle, "it": np.angle(E), "x_pll": 0.0, "w": 0.0, "steady": 0.0}
        self.x |= {"droop": 0.0, "P": P, "Q": Q, "V": V, "Iq": Q / V, "E": abs(E)}

    def flow(self, x, source):
        """Terminal voltage, P, Q, and reactive current in the PLL's frame."""
        g = self.g
        error = FLOW[2] + g["mq"] * self.beyond(x) - x["V"]
        E = (g["kpv"] * error + x["E"]) * np.exp(1j * (x["pll"] + x["it"]))
        v = (source / Z + E / self.inner) / (1 / Z + 1 / self.inner)
        i = (E - v) / self.inner
        s = v * np.conj(i)
        return v, s.real, s.imag, -(i * np.exp(-1j * x["pll"])).imag, error

    def beyond(self, x):
        _, Q, V = FLOW
        return Q / V - x["Iq"] if self.g["VdrpFlag"] else Q - x["Q"]

    def rates(self, x, source=None):
        g = self.g
        v, P, Q, Iq, error = self.flow(x, self.source if source is None else source)
        across = (v * np.exp(-1j * x["pll"])).imag
        w_pll = g["kpPLL"] * across + x["x_pll"]
        asked = FLOW[0] - g["FFlag"] * x["droop"] / g["mp"]
        torque = asked - x["P"] - g["D1"] * x["w"] - g["D2"] * (x["w"] - x["steady"])
        return {
            "pll": W_B * w_pll,
            "it": W_B * (x["w"] - w_pll),
            "x_pll": g["kiPLL"] * across,
            "w": torque / (2 * g["H"]),
            "steady": g["wD"] * (x["w"] - x["steady"]),
            "droop": ((w_pll if g["wFlag"] else x["w"]) - x["droop"]) / g["Tp"],
            "P": (P - x["P"]) / g["TPf"],
            "Q": (Q - x["Q"]) / g["TQf"],
            "V": (abs(v) - x["V"]) / g["TVf"],
            "Iq": (Iq - x["Iq"]) / g["TIf"],
            "E": g["kiv"] * error,
        }

    def eigenvalues(self, h=1e-7):
        return by_hand.eigenvalues(self.rates, self.x, h)

    def run(self, source, until, step):
        x, found = dict(self.x), []
        for _ in range(round(until / step) + 1):
            found.append(self.flow(x, source)[1])
            x = by_hand.stepped(lambda at: self.rates(at, source), x, step)
        return np.array(found)


def modelled(flags, **more):
    hand = Hand(flags)
    P, Q, V = FLOW
    at = {"P_0": P, "Q_0": Q, "v_0": V, "theta_0": hand.angle, "f_n": 60.0}
    return Evaluated(regfm_b1_phasor(), GIVEN | at | flags | more), hand


@pytest.mark.parametrize("flags", KINDS, ids=str)
def test_it_rests_and_its_eigenvalues_are_those_of_the_equations_by_hand(flags):
    device, hand = modelled(flags)
    assert not refused(device)
    at_source = AtSource(device, Z)
    bus = at_source.voltage(device.x, hand.source)
    assert abs(bus - FLOW[2] * np.exp(1j * hand.angle)) < 1e-12
    assert max(map(abs, device.rates([bus.real, bus.imag]).values())) < 1e-9
    assert max(map(abs, hand.rates(hand.x).values())) < 1e-9
    ours, wanted = at_source.eigenvalues(hand.source), hand.eigenvalues()
    assert len(wanted) == 11
    for z in wanted:
        assert min(abs(ours - z)) < 1e-4 * (1 + abs(z)), z


@pytest.mark.parametrize("flags", KINDS, ids=str)
def test_its_power_after_a_jump_is_that_of_the_equations_by_hand(flags):
    device, hand = modelled(flags)
    source = hand.source * np.exp(-0.05j)
    ours = AtSource(device, Z).run(source, 0.5, 1e-3, "p")
    wanted = hand.run(source, 0.5, 1e-3)
    assert np.ptp(wanted) > 0.1
    assert np.abs(ours - wanted).max() < 1e-3 * np.ptp(wanted)


def test_its_current_in_steady_state_stays_within_its_limit():
    """The network's angle falls away by half a radian: without limits about 1.6 pu would flow."""
    device, hand = modelled({}, kI=20.0, FFlag=0.0, H=0.2)
    found = AtSource(device, Z).run(hand.source * np.exp(-0.6j), 1.0, 1e-3, "I")
    assert max(found[:40]) > 1.0
    assert found[-1] < 1.02


def test_its_current_in_a_fault_stays_within_its_limit():
    device, hand = modelled({}, T_seen=1e-3)
    outputs = AtSource(device, Z).run(0.3 * hand.source, 0.05, 1e-3, "I", "fault_current")
    found, free = outputs.T
    acting = [k for k in range(10, 51) if free[k] > 1.0]
    assert len(acting) > 3
    assert found[acting] == pytest.approx(1.6, rel=0.01)


def test_its_pll_waits_where_there_is_no_voltage():
    device, _ = modelled({}, VPLLfrz=0.08)
    _, x = integrated(device, lambda t: [0.03, 0.02], 0.05)
    states = dict(zip(device.states, x, strict=True))
    assert states["delta_PLL"] == device.states["delta_PLL"]
    _, x = integrated(device, lambda t: [0.3, 0.2], 0.05)
    assert dict(zip(device.states, x, strict=True))["delta_PLL"] != device.states["delta_PLL"]


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"P_0": 0.97}, "more active current than ImaxSS"),
        ({"P_0": -0.3, "ESFlag": False}, "draw more active current than ESFlag and Ke allow"),
        ({"P_0": -0.6, "Ke": 0.5}, "draw more active current than ESFlag and Ke allow"),
        ({"Q_0": 0.95, "P_0": 0.5}, "more reactive current than ImaxSS"),
        ({"ImaxF": 0.4}, "more current than ImaxF"),
        ({"XL": 0.5, "ImaxSS": 2.0}, "XL·ImaxSS must lie below 1"),
    ],
)
def test_an_operating_point_beyond_a_limit_is_refused(values, words):
    device = Evaluated(regfm_b1_phasor(), {"P_0": 0.5} | values)
    assert any(words in text for text in refused(device))


def test_its_record_has_the_fields_of_the_program():
    record = REGFM_B1_RECORDS["REGFMB1"]
    assert len(record.fields) == 6 + 25
    known = {v.name for v in regfm_b1_phasor().parameters}
    assert {p for field in record.fields for p in field.parameters} <= known
