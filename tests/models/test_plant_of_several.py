"""The controller of several units and its part at a unit: InterPSS' figures, two units by hand, flags and limits."""

import numpy as np
import pytest

from fmus.wecc_renewable.composed import wecc_plant_phasor
from fmus.wecc_renewable.dyr_records import CONTROLLER_RECORD
from fmus.wecc_renewable.several_units import plant_controller_phasor
from tests.models.parts import integrated, refused
from tests.models.renewable_by_hand import Plant, band, controller
from tests.support.evaluated import Evaluated

REST = {"v_0": 1.0, "p_0": 0.4, "q_0": 0.12}
INTERPSS = {"VCFlag": False, "RefFlag": 0, "Fflag": True, "Tfltr": 0.2, "Kp": 1.4, "Ki": 0.6}
INTERPSS |= {"Tft": 0.03, "Tfv": 0.12, "Vfrz": 0.55, "Rc": 0.02, "Xc": 0.08, "Kc": 0.04}
INTERPSS |= {"emax": 0.5, "emin": -0.4, "dbd1": -0.01, "dbd2": 0.015, "Qmax": 0.8, "Qmin": -0.7}
INTERPSS |= {"Kpg": 1.1, "Kig": 0.45, "Tp": 0.25, "fdbd1": -0.002, "fdbd2": 0.003, "femax": 0.6}
INTERPSS |= {"femin": -0.5, "Pmax": 0.9, "Pmin": -0.8, "Tg": 0.18, "Ddn": 12.0, "Dup": 14.0}
"""Values of InterPSS' test of its `Plntbu1Model`, of its own making."""

WANTED = {"V_filtered": 1.003747, "Q_filtered": 0.11805, "Q_control": 0.000036}
WANTED |= {"lead_lag": 0.0006769444444444445, "P_filtered": 0.39804, "P_control": 0.0001755}
WANTED |= {"P_reference": 0.002323577160493827}
OUTPUTS = {"delta_Q": 0.002949208333333333, "delta_P": 0.002323577160493827}
"""States and outputs after its step of 10 ms, which that test has to 1e-12."""


def test_one_step_is_that_of_interpss():
    """Heun's step of 10 ms under 0.98 pu, 0.35 + j·0.08 pu and a frequency that is 0.002 pu beyond its band."""
    values = REST | INTERPSS | {"delta_Qref": 0.02, "delta_Pref": 0.01, "T_f": 1e12}
    one = Evaluated(plant_controller_phasor(), values)
    u = [0.98, 0.0, 0.35, 0.08]
    start = one.vector(one.states | {"frequency": 1 - 0.005})

    def rate(x):
        return np.array([one.rates(u, x)[s.name] for s in one.model.states])

    first = rate(start)
    end = start + 0.005 * (first + rate(start + 0.01 * first))
    found = dict(zip((s.name for s in one.model.states), end, strict=True))
    assert {name: found[name] for name in WANTED} == pytest.approx(WANTED, abs=1e-12)
    assert one.outputs(u, end) == pytest.approx(OUTPUTS, abs=1e-12)


def test_a_record_has_the_fields_of_the_program():
    """Seven ICONs and 28 CONs, of which each sets a parameter but those of places."""
    assert len(CONTROLLER_RECORD.fields) == 7 + 28
    known = {v.name for v in plant_controller_phasor().parameters}
    taken = {p for field in CONTROLLER_RECORD.fields for p in field.parameters}
    assert taken <= known
    assert len(taken) == 35 - 4


# -- two units at one bus behind an impedance, a second time ----------------------------------------

G = {"Khv": 0.0, "Lvplsw": 0.0, "Tg": 0.02, "Rrpwr": 10.0}
E = {"PF": 0, "V": 1, "Q": 0, "PQ": 0, "Trv": 0.02, "dbd1": 0.0, "dbd2": 0.0, "Kqv": 0.0}
E |= {"Iqh1": 1.1, "Iql1": -1.1, "Vref0": 0.0, "Tp": 0.04, "QMax": 0.44, "QMin": -0.44}
E |= {"VMAX": 1.2, "VMIN": 0.8, "Kqp": 0.0, "Kqi": 0.01, "Kvp": 10.0, "Kvi": 60.0, "Tiq": 0.02}
E |= {"dPmax": 99.0, "dPmin": -99.0, "Imax": 1.3, "Tpord": 0.03}
OF_FLAGS = {"PF": "PFFLAG", "V": "VFLAG", "Q": "QFLAG", "PQ": "PQFLAG"}
P = {"Tfltr": 0.05, "Kp": 1.0, "Ki": 4.0, "Tft": 0.02, "Tfv": 0.08, "Kc": 0.05, "emax": 0.1}
P |= {"emin": -0.1, "dbd1": -0.001, "dbd2": 0.001, "Qmax": 0.4, "Qmin": -0.4, "Kpg": 0.8}
P |= {"Kig": 1.5, "Tp": 0.1, "femax": 1.0, "femin": -1.0, "Pmax": 0.3, "Pmin": -0.3, "Tg": 0.06}
AT_UNIT = {"Tw": 0.04, "Qmax": 0.3, "Qmin": -0.3, "Pmax": 0.3, "Pmin": -0.3}
UNITS = {"large": (80.0, 0.6), "small": (48.0, 0.4)}
"""Ratings [MVA] and shares."""

BASE = 150.0  # of the controller's data [MVA]
P_UNIT, Q_UNIT = 0.7, 0.1  # power of each unit [pu, its rating]
Z = 0.02 + 0.15j  # between bus and source [pu, 100 MVA]
S_0 = complex(P_UNIT, Q_UNIT) * sum(rating for rating, _ in UNITS.values()) / 100
SOURCE = 1.0 - Z * np.conj(S_0)  # voltage of the source where the bus has 1 pu
STEP = 0.985  # of the source's voltage
CHANGES = {"Q": 0.04, "V": 0.01, "P": 0.03}
"""Steps of the controller's references at the same time [pu, its base]."""


class UnitByHand(Plant):
    """A unit whose references a plant's controller changes."""

    def __init__(self, rating, share):
        idle = {"VC": 1, "Kc": 0, "Rc": 0, "Xc": 0, "Ddn": 0, "Dup": 0}
        super().__init__({"REGCA1": G, "REECB1": E, "REPCA1": idle}, P_UNIT, Q_UNIT, 1.0)
        self.weight = share * 100 / rating
        self.x = {k: x for k, x in self.x.items() if k not in ("V_plant", "Q_plant", "PI", "lead")}
        for name in ("P_plant", "PIP", "Pref"):
            del self.x[name]
        self.x |= {"of_P": 0.0, "of_Q": 0.0}
        self.rating = rating

    def of_unit(self, x, v, asked):
        r = {
            f"of_{name}": (self.weight * asked[name] - x[f"of_{name}"]) / AT_UNIT["Tw"]
            for name in "PQ"
        }
        seen = (v, v * x["Ip"], v * x["Iq"])
        return r | self.of_control(x, seen, P_UNIT + x["of_P"], Q_UNIT + x["of_Q"])


class TwoByHand:
    """Both units, the controller at their bus, and a stiff source behind an impedance."""

    def __init__(self, mode, changes):
        self.mode, self.changes = mode, changes
        self.units = {name: UnitByHand(*data) for name, data in UNITS.items()}
        s = S_0 * 100 / BASE
        self.held = s.real, s.imag, 1.0 + P["Kc"] * s.imag
        self.x = {f"{n}.{k}": x for n, one in self.units.items() for k, x in one.x.items()}
        start = {"V": self.held[2], "Q": s.imag, "P": s.real}
        self.x |= start | dict.fromkeys(("PI", "lead", "PIP", "Pref"), 0.0)

    def own(self, x, name):
        return {k: x[f"{name}.{k}"] for k in self.units[name].x}

    def voltage(self, x, source):
        current = sum(
            complex(x[f"{n}.Ip"], -x[f"{n}.Iq"]) * u.rating / 100 for n, u in self.units.items()
        )
        drop = Z * current
        return drop.real + np.sqrt(abs(source) ** 2 - drop.imag**2), current

    def rates(self, x, source):
        v, current = self.voltage(x, source)
        s = v * np.conj(current) * 100 / BASE
        (P_0, Q_0, V_0), changed = self.held, self.changes
        r = {"V": (v + P["Kc"] * s.imag - x["V"]) / P["Tfltr"]}
        r |= {"Q": (s.imag - x["Q"]) / P["Tfltr"], "P": (s.real - x["P"]) / P["Tp"]}
        wanted = (Q_0, V_0, Q_0 / P_0 * x["P"])[self.mode] + changed["QVQ"[self.mode]]
        error = wanted - x["QVQ"[self.mode]]
        error = np.clip(band(error, P["dbd1"], P["dbd2"]), P["emin"], P["emax"])
        y, r["PI"] = controller(x["PI"], error, (P["Kp"], P["Ki"]), (P["Qmin"], P["Qmax"]))
        r["lead"] = (y - x["lead"]) / P["Tfv"]
        limits = P["Pmin"], P["Pmax"]
        y, r["PIP"] = controller(
            x["PIP"], P_0 + changed["P"] - x["P"], (P["Kpg"], P["Kig"]), limits
        )
        r["Pref"] = (y - x["Pref"]) / P["Tg"]
        asked = {"P": x["Pref"], "Q": x["lead"] + P["Tft"] * r["lead"]}
        system = {name: change * BASE / 100 for name, change in asked.items()}
        for name, one in self.units.items():
            of_unit = one.of_unit(self.own(x, name), v, system)
            r |= {f"{name}.{k}": rate for k, rate in of_unit.items() if k in one.x}
        return r

    def run(self, source, until, step):
        """Voltage and powers of both units [pu, 100 MVA] at every step, by Heun's method."""
        x, found = dict(self.x), []
        for _ in range(round(until / step) + 1):
            v = self.voltage(x, source)[0]
            powers = [v * x[f"{n}.Ip"] * u.rating / 100 for n, u in self.units.items()]
            found.append([v, *powers])
            first = self.rates(x, source)
            then = self.rates({k: x[k] + step * first[k] for k in first}, source)
            x = {k: x[k] + step / 2 * (first[k] + then[k]) for k in first}
        return np.array(found)


class Two:
    """Our models of the same, coupled by the admittances of the network."""

    def __init__(self, mode, changes):
        at = {"P_0": P_UNIT, "Q_0": Q_UNIT, "bus_voltage.tau": 1e-3, "f_n": 60.0, "Lvplsw": False}
        at |= {f"electrical.{OF_FLAGS.get(k, k)}": v for k, v in E.items()}
        at |= {"electrical.only_in_dips": False, "electrical.PMAX": 1.2}
        at |= {k: v for k, v in G.items() if k != "Lvplsw"}
        at |= {f"plant.{k}": v for k, v in AT_UNIT.items()}
        model = wecc_plant_phasor("REGCA1 REECB1 REAX4BU1")
        self.units = [
            Evaluated(model, at | {"S_n": rating, "plant.Kw": share, "plant.Kz": share})
            for rating, share in UNITS.values()
        ]
        values = P | {"S_n": BASE, "RefFlag": mode, "Fflag": True, "VCFlag": False, "Vfrz": 0.0}
        values |= {f"delta_{name}ref": change for name, change in changes.items()}
        values |= {"p_0": S_0.real, "q_0": S_0.imag, "f_n": 60.0, "bus_voltage.tau": 1e-3}
        self.plant = Evaluated(plant_controller_phasor(), values)
        assert not any(map(refused, (*self.units, self.plant)))
        self.all = [*self.units, self.plant]
        self.x = np.concatenate([one.x for one in self.all])
        self.cuts = np.cumsum([len(one.x) for one in self.all])[:-1]

    def ends(self, x, source):
        """Bus voltage, power into the branch and what the controller asks for."""
        *units, plant = np.split(x, self.cuts)
        admittance, current = 1 / Z, source / Z
        for one, state in zip(self.units, units, strict=True):
            y = one.outputs([1.0, 0.0, 0.0, 0.0], state)
            Y = complex(y["y_re"], y["y_im"])
            admittance, current = admittance + Y, current + complex(y["e_re"], y["e_im"]) * Y
        v = current / admittance
        asked = self.plant.outputs([v.real, v.imag, 0.0, 0.0], plant)
        return v, v * np.conj((v - source) / Z), (asked["delta_P"], asked["delta_Q"])

    def rate(self, x, source):
        v, s, asked = self.ends(x, source)
        own = [[v.real, v.imag, *asked]] * len(self.units) + [[v.real, v.imag, s.real, s.imag]]
        return np.concatenate(
            [
                np.array(one.model.derivatives(state, u, one.p, one.c)[0]).ravel()
                for one, state, u in zip(self.all, np.split(x, self.cuts), own, strict=True)
            ]
        )

    def run(self, source, until, step):
        x, found = self.x.copy(), []
        for _ in range(round(until / step) + 1):
            v, _, asked = self.ends(x, source)
            states = np.split(x, self.cuts)[:-1]
            u = [v.real, v.imag, *asked]
            fed = [
                one.outputs(u, state)["I_p_fed"]
                for one, state in zip(self.units, states, strict=True)
            ]
            ratings = [rating for rating, _ in UNITS.values()]
            powers = [abs(v) * i * s / 100 for i, s in zip(fed, ratings, strict=True)]
            found.append([abs(v), *powers])
            k1 = self.rate(x, source)
            k2 = self.rate(x + step / 2 * k1, source)
            x = x + step * k2
        return np.array(found)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_two_units_under_one_controller_are_those_by_hand(mode):
    """Voltage and power of each unit after steps of the source and of references, from 15 ms on.

    To half a second, five times the longest lag of the controller."""
    at_rest = dict.fromkeys(CHANGES, 0.0)
    ours, hand = Two(mode, at_rest), TwoByHand(mode, at_rest)
    assert np.abs(ours.rate(ours.x, SOURCE)).max() < 1e-9
    assert max(map(abs, hand.rates(hand.x, SOURCE).values())) < 1e-12
    ours, hand = Two(mode, CHANGES), TwoByHand(mode, CHANGES)
    found = ours.run(STEP * SOURCE, 0.5, 1e-3)[15:]
    wanted = hand.run(STEP * SOURCE, 0.5, 1e-3)[15:]
    swings = np.ptp(wanted, axis=0)
    assert swings.min() > 2e-3
    assert (np.abs(found - wanted).max(axis=0) < 3e-4 * swings).all()


def eigenvalues(two):
    """Eigenvalues of both units and the controller at a stiff source, by central differences [1/s]."""
    steps = 1e-6 * np.eye(len(two.x))
    columns = [(two.rate(two.x + d, SOURCE) - two.rate(two.x - d, SOURCE)) / 2e-6 for d in steps]
    return np.linalg.eigvals(np.array(columns).T)


@pytest.mark.parametrize("mode", [0, 1, 2])
def test_no_eigenvalue_is_0(mode, monkeypatch):
    """At a stiff source not even the reference angle gives one; outside of the dead band."""
    for name in ("dbd1", "dbd2"):
        monkeypatch.setitem(P, name, 0.0)
    found = eigenvalues(Two(mode, dict.fromkeys(CHANGES, 0.0)))
    assert found.real.max() < -0.1


# -- flags, limits and the frequency ---------------------------------------------------------------

OPEN = REST | {"RefFlag": 1, "VCFlag": True, "dbd1": 0.0, "dbd2": 0.0, "Ki": 0.0, "Kp": 2.0}
OPEN |= {
    "Fflag": True,
    "Kpg": 1.0,
    "Kig": 0.0,
    "Pmax": 1.0,
    "Pmin": -1.0,
    "emax": 0.5,
    "emin": -0.5,
}
OPEN |= {"Tp": 0.02, "Tg": 0.02, "Tfltr": 0.02}
OPEN |= {"fdbd1": -0.001, "fdbd2": 0.002, "Ddn": 20.0, "Dup": 10.0, "Xc": 0.1, "Rc": 0.02}


def settled(values, u, until=1.5):
    """Outputs after a while with proportional gains alone."""
    one = Evaluated(plant_controller_phasor(), OPEN | values)
    assert not refused(one)
    return integrated(one, lambda t: u(t) if callable(u) else u, until)[0][-1]


def test_the_voltage_behind_an_impedance_is_held():
    held = abs(1.0 - (0.02 + 0.1j) * (0.4 - 0.12j))
    seen = abs(0.97 - (0.02 + 0.1j) * (0.3 - 0.2j) / 0.97)
    found = settled({}, [0.97, 0.0, 0.3, 0.2])
    assert found["delta_Q"] == pytest.approx(2.0 * (held - seen), rel=1e-6)
    assert found["delta_P"] == pytest.approx(0.4 - 0.3, rel=1e-6)


def test_per_unit_of_the_plant_becomes_per_unit_of_the_system():
    """On 200 MVA the power that lacks is half as many pu, and what is asked for as much of the system as it was."""
    given = settled({"S_n": 200.0}, [1.0, 0.0, 0.3, 0.12])
    assert given["delta_P"] == pytest.approx(0.1, rel=1e-6)
    limited = settled({"S_n": 200.0, "Pmax": 0.02}, [1.0, 0.0, 0.3, 0.12])
    assert limited["delta_P"] == pytest.approx(0.04, rel=1e-6)


def test_an_end_that_power_leaves_has_the_other_sign():
    found = settled({"reversed": True, "p_0": -0.4, "q_0": -0.12}, [1.0, 0.0, -0.3, -0.12])
    assert found["delta_P"] == pytest.approx(0.1, rel=1e-6)
    assert found["delta_Q"] < 0


@pytest.mark.parametrize(
    ("away", "wanted"),
    [(-0.004, 10.0 * 0.002), (-0.0015, 0.0), (0.0008, 0.0), (0.003, -20.0 * 0.002)],
)
def test_power_answers_to_the_frequency_of_the_bus_beyond_its_bands(away, wanted):
    def turning(t):
        v = np.exp(2j * np.pi * 50.0 * away * t)
        return [v.real, v.imag, 0.4, 0.12]

    assert settled({}, turning)["delta_P"] == pytest.approx(wanted, abs=2e-5)


def test_without_its_flag_active_power_stays():
    assert settled({"Fflag": False}, [1.0, 0.0, 0.3, 0.12])["delta_P"] == 0


@pytest.mark.parametrize(("frozen", "wanted"), [(0.6, 0.0), (0.4, 0.43)])
def test_the_integrator_waits_at_low_voltage_and_stops_at_its_limit(frozen, wanted):
    values = {"Vfrz": frozen, "Kp": 0.0, "Ki": 2.0, "Qmax": 0.43}
    found = settled(values, [0.5, 0.0, 0.4, 0.12])
    assert found["delta_Q"] == pytest.approx(wanted, abs=1e-9)


def test_limits_that_leave_out_0_are_widened_to_it():
    """As PowerWorld does: a change begins at 0."""
    values = {"Qmin": 0.1, "Qmax": 0.3, "Pmax": -0.1, "Pmin": -0.2}
    assert settled(values, [1.0, 0.0, 0.4, 0.12]) == pytest.approx({"delta_P": 0, "delta_Q": 0})
    raised = settled(values, [0.9, 0.0, 0.3, 0.12])
    assert (raised["delta_P"], raised["delta_Q"]) == (0, pytest.approx(2 * 0.1, rel=0.05))


def test_a_power_factor_without_power_is_refused():
    texts = refused(Evaluated(plant_controller_phasor(), REST | {"RefFlag": 2, "p_0": 0.0}))
    assert any("RefFlag = 2 holds a power factor" in text for text in texts)
    assert not refused(Evaluated(plant_controller_phasor(), REST | {"RefFlag": 1, "p_0": 0.0}))


@pytest.mark.parametrize(
    ("asked", "limit", "wanted"), [(0.1, 0.3, 0.1 * 0.6 / 0.8), (0.9, 0.3, 0.3), (-0.9, 0.3, -0.2)]
)
def test_a_unit_takes_its_share_within_its_limits(asked, limit, wanted):
    """A share of 0.6 of the change, on the unit's 80 MVA; behind one lag of 40 ms."""
    values = {"S_n": 80.0, "P_0": 0.5, "plant.Kz": 0.6, "plant.Pmax": limit, "plant.Pmin": -0.2}
    values |= {"plant.Tw": 0.04, "electrical.PMAX": 1.2, "electrical.Imax": 1.5}
    one = Evaluated(wecc_plant_phasor("REGCA1 REECB1 REAX3BU1"), values)
    assert not refused(one)
    u = [1.0, 0.0, asked, 0.0]
    rate = one.rates(u)["plant.of_plant_P"]
    assert rate == pytest.approx(asked * 0.6 / 0.8 / 0.04)
    found, x = integrated(one, lambda t: u, 1.0)
    assert found[-1]["I_p_fed"] == pytest.approx(0.5 + wanted, abs=2e-3)
    back = one.rates([1.0, 0.0, 0.0, 0.0], x)["plant.of_plant_P"]
    assert back * wanted < 0  # it leaves its limit at once


@pytest.mark.parametrize(
    ("records", "words"),
    [
        ("REGCA1 REECA1 REPCA1 REAX4BU1", "REPCA1 and REAX4BU1: a unit has one of them"),
        ("REGCA1 REECA1 REAX3BU1 REAX4BU1", "a unit has one of them"),
    ],
)
def test_a_unit_has_one_controller(records, words):
    with pytest.raises(ValueError, match=words):
        wecc_plant_phasor(records)
