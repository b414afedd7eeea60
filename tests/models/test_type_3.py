"""WT3G1, WT3E1, WT3T1 and WT3P1: their equations a second time, beside a trace of PSS/E; pitch and limits."""

import numpy as np
import pytest

from fmus.wecc_renewable import type_3
from fmus.wecc_renewable.composed import wecc_plant_phasor
from tests.models import by_hand
from tests.models.closed import AtSource
from tests.models.parts import refused
from tests.models.test_wecc_plant_parts import FAST, SLOW, Z_NETWORK
from tests.models.two_buses import TwoBuses
from tests.support.evaluated import Evaluated

RECORDS = "WT3G1 WT3E1 WT3T1 WT3P1"
FLOW = 0.5, 0.1, 1.02  # P, Q [pu, S_n] and |v| [pu]
S_N = 100.0
MACHINE = {"Xeq": 0.4, "Kpll": 24.0, "Kipll": 0.6, "Pllmax": 0.12, "turbines": 40, "Prated": 1.63}
CONTROL = {"VARFLG": 1, "VLTFLG": 1, "Tfv": 0.15, "KPV": 1.8, "KIV": 5.0, "Xc": 0.04, "TFP": 0.05}
CONTROL |= {"Kpp": 3.0, "KIP": 0.6, "TRV": 0.02, "T_POWER": 5.0, "KQi": 0.1, "KQV": 40.0}
CONTROL |= {"Tv": 0.05, "Tp": 0.07, "QMX": 0.5, "PMX": 1.2, "IPMAX": 1.3}
SPEEDS = {"PMN": 0.1, "wPmin": 0.69, "wP20": 0.78, "wP40": 0.98, "wP60": 1.12, "Pmin": 0.9}
SPEEDS |= {"wP100": 1.2}
SHAFT = {"H": 4.8, "DAMP": 0.15, "Kaero": 0.009, "Htfrac": 0.72, "Freq1": 1.9, "Dshaft": 1.3}
PITCH = {"Tp": 0.27, "Kpp": 135.0, "Kip": 23.0, "Kpc": 2.7, "Kic": 27.0, "PMX": 0.92}


def turbine(records=RECORDS, flow=FLOW, **more):
    """Our turbine at an operating point; ``more``: values by the parameters' names, __ for a dot."""
    scopes = {"": MACHINE, "electrical.": CONTROL | SPEEDS, "shaft.": SHAFT}
    if "WT3P1" in records:
        scopes["pitch."] = PITCH
    values = {f"{scope}{k}": v for scope, own in scopes.items() for k, v in own.items()}
    values |= dict(zip(("P_0", "Q_0", "v_0"), flow, strict=True))
    values |= {"theta_0": 0.3, "S_n": S_N, "f_n": 60.0, "bus_voltage.tau": 1e-3}
    more = {name.replace("__", "."): value for name, value in more.items()}
    return Evaluated(wecc_plant_phasor(records), values | more)


class Hand:
    """The same as plain numbers; the terminal voltage is that of the same instant, and no limit acts."""

    def __init__(self, flag, one_mass):
        self.flag, self.one_mass = flag, one_mass
        P, Q, v = FLOW
        self.per = S_N / 65.2
        bus = v * np.exp(0.3j)
        self.source = bus - Z_NETWORK * np.conj((P + 1j * Q) / bus)
        w = self.w_0 = self.speed_of(P * self.per)
        X, p = MACHINE["Xeq"], P * self.per
        self.seen_0 = v - CONTROL["Xc"] * abs(P + 1j * Q) / v
        self.x = {"Ip": P / v, "Eq": v + X * Q / v, "pll": 0.0, "delta": 0.3, "v": self.seen_0}
        self.x |= {"slow": Q, "fast": 0.0, "order": Q, "P_f": P, "V": v, "E": v + X * Q / v}
        self.x |= {"w_ref": w, "torque": p / w, "Pord": p, "w_t": w, "w_g": w}
        self.twist_0 = P / w + SHAFT["DAMP"] * (w - 1)
        self.x |= {"twist": self.twist_0}
        self.P_m = self.twist_0 * w

    def speed_of(self, P):
        at = [SPEEDS["PMN"], 0.2, 0.4, 0.6, SPEEDS["Pmin"]]
        return np.interp(P, at, [SPEEDS[k] for k in ("wPmin", "wP20", "wP40", "wP60", "wP100")])

    def voltage(self, x, source):
        emf = (x["Eq"] + 1j * MACHINE["Xeq"] * x["Ip"]) * np.exp(1j * x["delta"])
        inner = 1j * MACHINE["Xeq"]
        v = (source / Z_NETWORK + emf / inner) / (1 / Z_NETWORK + 1 / inner)
        return v, v * np.conj((emf - v) / inner)

    def rates(self, x, source=None):
        g, e, d = MACHINE, CONTROL, SHAFT
        bus, s = self.voltage(x, self.source if source is None else source)
        v, P, Q, p = abs(bus), s.real, s.imag, s.real * self.per
        straight = g["Kpll"] * (bus * np.exp(-1j * x["delta"])).imag / (120 * np.pi)
        error = self.seen_0 - x["v"] if self.flag == 1 else 0.0
        asked = {1: x["order"], 0: FLOW[1], -1: x["P_f"] * FLOW[1] / FLOW[0]}[self.flag]
        slip, between = x["w_g"] - x["w_ref"], x["w_t"] - x["w_g"]
        through = x["twist"] + d["Dshaft"] * between
        braking = P / x["w_g"] + d["DAMP"] * (x["w_g"] - 1)
        Ht = d["Htfrac"] * d["H"]
        Hg = d["H"] - Ht
        r = {
            "Ip": (x["Pord"] / v / self.per - x["Ip"]) / 0.02,
            "Eq": (x["E"] - x["Eq"]) / 0.02,
            "pll": g["Kipll"] * straight,
            "delta": 120 * np.pi * (straight + x["pll"]),
            "v": (v - e["Xc"] * abs(s) / v - x["v"]) / e["TRV"],
            "slow": e["KIV"] * error,
            "fast": (e["KPV"] * error - x["fast"]) / e["Tv"],
            "order": (x["slow"] + x["fast"] - x["order"]) / e["Tfv"],
            "P_f": (P - x["P_f"]) / e["Tp"],
            "V": e["KQi"] * (asked - Q),
            "E": e["KQV"] * (x["V"] - v),
            "w_ref": (self.speed_of(p) - x["w_ref"]) / e["T_POWER"],
            "torque": e["KIP"] * slip,
            "Pord": ((x["torque"] + e["Kpp"] * slip) * x["w_g"] - x["Pord"]) / e["TFP"],
            "w_t": (self.P_m / x["w_t"] - through) / (2 * Ht),
            "w_g": (through - braking) / (2 * Hg),
            "twist": 2 * Ht * Hg / d["H"] * (2 * np.pi * d["Freq1"]) ** 2 * between,
        }
        if self.one_mass:
            alone = (self.P_m / x["w_g"] - braking) / (2 * d["H"])
            r |= {"w_g": alone, "w_t": alone, "twist": 0.0}
        return r

    def run(self, source, until, step):
        x, found = dict(self.x), []
        for _ in range(round(until / step) + 1):
            found.append(abs(self.voltage(x, source)[0]))
            x = by_hand.stepped(lambda at: self.rates(at, source), x, step)
        return np.array(found)


CASES = {"voltage": (1, False), "power factor": (-1, False), "reactive power": (0, True)}


def both(case):
    flag, one_mass = CASES[case]
    more = {"electrical__VARFLG": flag} | ({"shaft__Htfrac": 0.0} if one_mass else {})
    return turbine(**more), Hand(flag, one_mass)


@pytest.mark.parametrize("case", CASES)
def test_it_is_its_equations_by_hand(case):
    """At rest, and by its eigenvalues, while the pitch rests."""
    ours, hand = both(case)
    assert not refused(ours)
    bus = FLOW[2] * np.exp(0.3j)
    outputs = ours.outputs([bus.real, bus.imag])
    assert (outputs["p"], outputs["q"]) == pytest.approx(FLOW[:2], abs=1e-12)
    assert max(map(abs, ours.rates([bus.real, bus.imag]).values())) < 1e-9
    assert max(map(abs, hand.rates(hand.x).values())) < 1e-9
    found = AtSource(ours, Z_NETWORK).eigenvalues(hand.source)
    wanted = [z for z in by_hand.eigenvalues(hand.rates, hand.x) if SLOW < abs(z) < FAST]
    assert len(wanted) >= 8
    for z in wanted:
        assert min(abs(found - z)) < 0.02 * abs(z), z


def test_it_answers_small_changes_alike_up_and_down():
    """The pitch at its stop and the integrals at their limits leave the operating point linear."""
    ours, size = turbine(), 3e-5
    bus = FLOW[2] * np.exp(0.3j)
    source = [bus.real, bus.imag]
    for name, value in ours.states.items():
        up, down = (
            ours.rates(source, ours.vector(ours.states | {name: value + side * size}))
            for side in (1, -1)
        )
        for state, rate in up.items():
            assert rate == pytest.approx(-down[state], rel=1e-3, abs=1e-6), (name, state)


def test_its_voltage_after_a_jump_is_that_of_the_equations_by_hand():
    ours, hand = both("voltage")
    source = 0.99 * hand.source
    voltages, by_it = AtSource(ours, Z_NETWORK).run(source, 0.2, 1e-3), hand.run(source, 0.2, 1e-3)
    assert np.ptp(by_it) > 2e-3
    assert np.abs(voltages - by_it)[20:].max() < 0.02 * np.ptp(by_it)


AT_BUS = 0.998746097088, np.radians(-0.160413935781)  # of the trace's start
RECORD = """0.12 15 4 0 0.04 2.5 0.5 1.1 0.05 0.45 -0.45 1.1 0.02 0.4 -0.4 4 0.1 0.88 1.12 35 -0.5 1.45 0.05 0.05
0.3 0.69 0.78 0.98 0.74 1.2"""
STATES = ("order", "P_ord", "torque", "voltage", "speed_asked", "voltage_asked", "emf")
TRACE = {
    0.075: (0.05937, 0.768702, 0.639074, 0.644435, 1.197700, 0.996688, 1.435141, 0.517389, 0.3829),
    0.125: (0.19248, 0.775610, 0.639165, 1.022187, 1.195937, 0.990054, 1.650631, 1.208235, 0.1314),
    0.250: (-0.08236, 0.77898, 0.639418, 1.056912, 1.196062, 0.980480, 1.064780, 1.035997, -0.3089),
    0.500: (-0.04047, 0.778996, 0.639896, 0.978764, 1.1963, 0.976520, 0.930997, 0.978022, -0.0297),
}
"""PSS/E's states of WT3E1, and magnitude [pu] and angle [deg] of the voltage at the bus in and after a fault behind
j0.1 pu, by the time [s]; from InterPSS' `Wt3e1PsseSmibConformanceTest` and its SMIB_v33_wt3e1.dyr."""
SWING = (0.27, 0.0121, 0.00084, 0.41, 0.0041, 0.022, 0.72, 0.69, 0.69)
WITHIN = 0.015
"""The trace's swings, and the share of each by which ours may differ."""


def test_it_is_the_trace_of_pss_e():
    """The speed is constant there: the record has no WT3T1."""
    names = [line.name for line in type_3.CONTROL[2:]]
    own = dict(zip(names, map(float, RECORD.split()), strict=True))
    values = {f"electrical.{name}": value for name, value in own.items()}
    values |= {"Xeq": 0.33403, "Kpll": 24.0, "Kipll": 0.6, "Pllmax": 0.12, "turbines": 40}
    values |= {"Prated": 1.63, "P_0": 0.5, "Q_0": 2.7e-7, "v_0": AT_BUS[0], "theta_0": AT_BUS[1]}
    values |= {"shaft.H": 1e6, "shaft.Htfrac": 0.0, "S_n": 100.0, "bus_voltage.tau": 1e-3}
    ours = Evaluated(wecc_plant_phasor("WT3G1 WT3E1 WT3T1"), values)
    start = AT_BUS[0] * np.exp(1j * AT_BUS[1])
    network = TwoBuses(ours, start, 0.5)
    assert abs(network.voltage(ours.x) - start) < 1e-6
    found = network.through_fault(0.1j, 1e-3, TRACE)
    assert {*found} == {*TRACE}
    for t, (at, v) in found.items():
        own = [*(at[f"electrical.{state}"] for state in STATES), abs(v), np.degrees(np.angle(v))]
        assert (np.abs(np.subtract(own, TRACE[t])) < WITHIN * np.array(SWING)).all(), t


def pitching(**moved):
    """Rate of the pitch angle [deg/s] and of both integrals with states elsewhere than at rest."""
    ours = turbine()
    x = ours.vector(ours.states | {name.replace("__", "."): v for name, v in moved.items()})
    bus = FLOW[2] * np.exp(0.3j)
    rates = ours.rates([bus.real, bus.imag], x)
    return ours.states, [rates[f"pitch.{name}"] for name in ("angle", "of_speed", "of_power")]


def test_the_pitch_follows_speed_and_power_within_its_rate():
    """The integral of the speed starts at Kpc·(PMX − P_ord), so that the blades move with the speed at once."""
    start, rest = pitching()
    p, order = PITCH, FLOW[0] * S_N / 65.2
    assert start["pitch.of_speed"] == pytest.approx(p["Kpc"] * (p["PMX"] - order))
    assert rest == pytest.approx([0.0, 0.0, 0.0])
    w = start["shaft.speed_of_generator"]
    _, (angle, integral, _) = pitching(shaft__speed_of_generator=w + 0.01)
    assert (angle, integral) == pytest.approx((p["Kpp"] * 0.01 / p["Tp"], p["Kip"] * 0.01))
    _, (angle, _, power) = pitching(electrical__P_ord=1.0)
    rise = p["Kpc"] * (1.0 - order)
    assert (angle, power) == pytest.approx((rise / p["Tp"], p["Kic"] * (1.0 - p["PMX"])))
    assert pitching(shaft__speed_of_generator=w + 0.2)[1][0] == pytest.approx(10.0)  # RTetaMax
    assert pitching(shaft__speed_of_generator=w - 0.2)[1][0] == pytest.approx(0.0)  # TetaMin


def test_blades_take_power_off_the_wind():
    ours = turbine()
    x = ours.vector(ours.states | {"pitch.angle": 5.0})
    bus = FLOW[2] * np.exp(0.3j)
    start, now = (ours.outputs([bus.real, bus.imag], at)["P_mechanical"] for at in (ours.x, x))
    assert now - start == pytest.approx(-5.0 * SHAFT["Kaero"])


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"electrical__QMX": 0.05}, "electrical.QMX: the power flow asks for more"),
        ({"electrical__VMAXCL": 1.0}, "electrical.VMAXCL"),
        ({"electrical__PMX": 0.7}, "electrical.PMX"),
        ({"electrical__XIQmax": 0.01}, "electrical.XIQmax"),
        ({"electrical__VLTFLG": 2}, "electrical.XIQmax"),
        ({"electrical__IPMAX": 0.6}, "than electrical.IPMAX"),
        ({"pitch__PMX": 0.7}, "pitch.PMX must exceed"),
        ({"shaft__Freq1": 0.0}, "shaft.Freq1 lies above 0"),
    ],
)
def test_an_operating_point_beyond_a_limit_is_refused(more, said):
    assert any(said in text for text in refused(turbine(**more)))


@pytest.mark.parametrize(
    "records", ["WT3G1 WT3E1", "WT3G1 REECA1 WT3T1", "WT3G1 WT3E1 WT3T1 WT3T1", RECORDS + " REPCA1"]
)
def test_records_of_the_first_generation_go_together(records):
    with pytest.raises(ValueError, match="WT3G1 WT3E1 WT3T1 go together"):
        wecc_plant_phasor(records)
