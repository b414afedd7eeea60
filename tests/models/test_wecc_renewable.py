"""REGCA1 with REECA1 or REECB1 and REPCA1: against PSS/E's recordings, the equations by hand, and their diagrams."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import fsolve

from fmus.wecc_renewable.dyr_records import PLANT_RECORDS
from fmus.wecc_renewable.model import (
    regca1_phasor,
    regca1_repca1_phasor,
    regca1_repca1_remote_phasor,
)
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from tests.models.closed import AtSource
from tests.models.parts import integrated, refused
from tests.models.renewable_by_hand import Plant, fields
from tests.support.evaluated import Evaluated

_FILE = Path(__file__).parents[1] / "reference" / "psse_traces.json"
TRACES = json.loads(_FILE.read_text(encoding="utf-8"))["traces"]
EVENT = 20  # samples of the recordings before the trip

# -- plants as their records have them, at the three buses of ThreeBusRenewable.raw -----------------

REGCA1 = "103 REGCA1 1 0 0.02 10 0.9 0.4 1.22 1.2 0.9 0.5 -1.3 0.2 0.0 100 -100 0 /\n"
REECB1 = (
    "103 REECB1 1 0 {pf} {v} {q} {pq} -99 99 {trv} -0.01 0.01 1 1.1 -1.1 0 {tp} 0.44 -0.44 1.05 0.9 0 0.01 10 60 "
    "0.02 99 -99 1.2 0 1.11 0.02 /\n"
)
REPCA1 = (
    "103 REPCA1 1 0 0 0 '0 ' {vc} {ref} {f} 0.02 {kp} {ki} 0 0.05 0 0 0 {kc} {e} -{e} -{d} {d} {most} {least} 1 0.05 "
    "0.25 -0.01 0.01 99 -99 1.2 0 0.1 0 0 /\n"
)
USUAL = {"pf": 0, "v": 0, "q": 0, "pq": 0, "trv": 0.02, "tp": 0.04, "vc": 0, "ref": 0, "f": 0}
USUAL |= {"kp": 18, "ki": 5, "kc": 0, "e": 0.1, "d": 0.01, "most": 0.43, "least": -0.43}
OF_VOLTAGE = {"ref": 1, "v": 1, "kp": 25, "ki": 15, "e": 0.4, "d": 0}
VOLTAGE = {"q": 1, "v": 0, "ref": 1, "kp": 0.5, "ki": 2, "most": 1.1, "least": 0.9}
Z_LINE = 0.01 + 0.12j
DRAWN = 0.3 + 0.1j  # at buses 101 and 102, constant impedances [pu]
P_0, V_0 = 0.4, 1.015


def written(**changed):
    values = USUAL | changed
    return REGCA1 + (REECB1 + REPCA1).format(**values)


def network():
    """Reactive power of the plant; open voltage and impedance at its bus once the line 101-103 is open [pu]."""
    Y = (3 * np.eye(3) - np.ones((3, 3))) / Z_LINE

    def at(x):
        return np.array([x[0] * np.exp(1j * x[1]), 1.01, V_0 * np.exp(1j * x[2])])

    def misfit(x):
        S = at(x) * np.conj(Y @ at(x))
        return [S[0].real + DRAWN.real, S[0].imag + DRAWN.imag, S[2].real - P_0]

    v = at(fsolve(misfit, [1.0, 0.0, 0.0], xtol=1e-13))
    behind = 1e-4j
    given = (Y @ v)[1] + np.conj(DRAWN) / abs(v[1]) ** 2 * v[1]
    left = np.array([[1, -1, 0], [-1, 2, -1], [0, -1, 1]]) / Z_LINE
    left[[0, 1], [0, 1]] += np.conj(DRAWN) / abs(v[:2]) ** 2
    left[1, 1] += 1 / behind
    source, unit = np.array([0, v[1] / behind + given, 0]), np.array([0, 0, 1.0])
    Q = (v * np.conj(Y @ v))[2].imag
    return Q, np.linalg.solve(left, source)[2], np.linalg.solve(left, unit)[2], v[2]


Q_0, SOURCE, Z, V_START = network()


def modelled(text, folder, **values):
    """Our model of the records, at the power flow."""
    (folder / "plant.dyr").write_text(text, encoding="utf-8")
    machine = Machine(103, "1", 1, 100 * P_0, V_0, 100.0, 0.0, -99, 99)
    found = machine_models(read_dyr(folder / "plant.dyr"), [machine])[103, "1"]
    build = {"regca1_phasor": regca1_phasor, "regca1_repca1_phasor": regca1_repca1_phasor}
    given = {"P_0": P_0, "Q_0": Q_0, "v_0": V_0, "theta_0": np.angle(V_START), "f_n": 60.0}
    return Evaluated(build[found.converter or ""](), {**found.parameters, **given, **values})


RECORDED = [
    ("rena", {}, 4e-6),
    ("rena_voltage", OF_VOLTAGE, 3e-4),
    ("rena_voltage_of_q", OF_VOLTAGE | {"q": 1}, 1e-5),
]
"""Recordings of PSS/E, the plant's settings, and the largest deviation of its voltage 50 ms after the trip [pu]. In the
second the voltage swings at 9 Hz, where PSS/E's step of 5 ms counts."""


@pytest.mark.parametrize(("key", "changed", "most"), RECORDED)
def test_the_equations_by_hand_are_those_of_psse(key, changed, most, tmp_path):
    trace = TRACES[key]
    (tmp_path / "plant.dyr").write_text(written(**changed), encoding="utf-8")
    hand = Plant(fields(tmp_path / "plant.dyr"), P_0, Q_0, V_0)
    at_rest = hand.rates(hand.x, V_0, 0.0)
    assert max(abs(at_rest[name]) for name in ("Ip", "Iq", "Pord", "PI", "Pref")) < 1e-12
    found = hand.run(SOURCE, Z, 2.0, 5e-3)[::10]
    wanted = np.array(trace["values"][EVENT:])
    assert trace["values"][0] == pytest.approx(V_0, abs=1e-6)
    assert np.abs(found - wanted)[1:].max() < most


@pytest.mark.parametrize(
    ("changed", "most"),
    [
        ({}, 2e-7),
        ({"f": 1}, 2e-7),
        (OF_VOLTAGE, 2e-5),
        (OF_VOLTAGE | {"q": 1}, 2e-5),
        (VOLTAGE | {"kc": 0.02}, 2e-5),
        (VOLTAGE | {"vc": 1, "pq": 1}, 2e-5),
        ({"pf": 1, "pq": 1}, 2e-7),
        (OF_VOLTAGE | {"pf": 1, "q": 1}, 2e-5),
    ],
)
def test_the_model_is_the_equations_by_hand(changed, most, tmp_path):
    """With every flag, from 15 ms after the trip on, when the extrapolated voltage has settled; the voltage moves by
    1.2e-4 or by 0.01 pu."""
    text = written(**changed)
    device = modelled(text, tmp_path, **{"bus_voltage.tau": 1e-3})
    assert not refused(device)
    at_rest = [V_START.real, V_START.imag]
    assert max(map(abs, device.rates(at_rest).values())) < 1e-9
    hand = Plant(fields(tmp_path / "plant.dyr"), P_0, Q_0, V_0)
    wanted = hand.run(SOURCE, Z, 0.3, 1e-3)
    assert np.ptp(wanted) > 300 * most
    assert np.abs(AtSource(device, Z).run(SOURCE, 0.3, 1e-3) - wanted)[15:].max() < most


# -- dips and limits, at an imposed voltage ---------------------------------------------------------

AT = {"P_0": 0.6, "Q_0": 0.1, "f_n": 60.0, "electrical.VFLAG": False}
FIRM = AT | {"electrical.only_in_dips": True, "electrical.Kqv": 2.0, "electrical.dbd2": 0.1}


def driven(values, voltage, until, model=regca1_phasor):
    """Outputs at every millisecond, under a voltage [pu] by time [s]; None at refusal."""
    device = Evaluated(model(), values)
    assert not refused(device)
    start = values.get("v_0", 1.0)

    def inputs(t):
        v = complex(start if t < 0.02 else voltage(t))
        return [v.real, v.imag]

    return integrated(device, inputs, until)[0]


def dip(to, end=0.22):
    return lambda t: to if t < end else 1.0


def test_a_dip_gives_reactive_current_first_and_leaves_the_rest_to_active():
    found = driven(FIRM | {"electrical.Imax": 1.0}, dip(0.6), 0.2)[-1]
    wanted = 0.1 + 2.0 * (1 - 0.6 - 0.1)  # the reference waits in the dip
    assert found["I_q_command"] == pytest.approx(wanted, rel=1e-3)
    assert found["I_p_command"] == pytest.approx(np.sqrt(1 - wanted**2), rel=1e-3)
    active_first = driven(
        FIRM | {"electrical.Imax": 1.0, "electrical.PQFLAG": True, "electrical.Tpord": 0.02},
        dip(0.8),
        0.2,
    )[-1]
    assert active_first["I_p_command"] == pytest.approx(0.6 / 0.8, rel=1e-3)
    assert active_first["I_q_command"] == pytest.approx(0.1 + 2 * 0.1, rel=1e-3)


@pytest.mark.parametrize(
    ("more", "at_400", "at_700"),
    [
        ({}, 0.1, 0.1),
        ({"electrical.Thld": 0.3, "electrical.Iqfrz": 0.25}, 0.35, 0.1),
        ({"electrical.Thld": -0.3, "electrical.Vref0": 1.08, "electrical.dbd2": 0.0}, 0.26, 0.1),
        (
            {"electrical.only_in_dips": False, "electrical.Vref0": 1.05, "electrical.dbd2": 0.0},
            0.1,
            0.1,
        ),
    ],
)
def test_what_lasts_after_a_dip(more, at_400, at_700):
    """The dip ends at 220 ms; Thld counts from there. Without dips alone, Kqv is part of the operating point."""
    found = driven(FIRM | more, dip(0.7), 0.72)
    values = [found[k]["I_q_command"] for k in (400, 700)]
    assert values == pytest.approx([at_400, at_700], abs=2e-3)


def test_the_limit_of_active_current_stays_after_a_dip():
    values = FIRM | {"electrical.Imax": 1.0, "electrical.Kqv": 2.5, "electrical.Iqh1": 0.9}
    free, held = (
        driven(values | {"electrical.Thld2": time}, dip(0.5), 0.6) for time in (0.0, 0.25)
    )
    rest = np.sqrt(1 - (0.1 + 0.9) ** 2 + 1e-12)
    assert held[200]["I_p_command"] == pytest.approx(rest, abs=1e-3)
    assert free[400]["I_p_command"] == pytest.approx(0.6, rel=1e-3)
    assert held[400]["I_p_command"] == pytest.approx(rest, abs=2e-3)
    assert held[560]["I_p_command"] == pytest.approx(0.6, rel=1e-3)


def test_tables_limit_each_current_by_the_voltage():
    points = {"Vq1": 0.0, "Iq1": 0.7, "Vq2": 0.5, "Iq2": 0.7, "Vq3": 0.9, "Iq3": 0.3, "Vq4": 1.0}
    points |= {"Iq4": 0.3, "Vp1": 0.2, "Ip1": 0.0, "Vp2": 0.8, "Ip2": 0.6, "Vp3": 0.9, "Ip3": 1.0}
    points |= {"Vp4": 1.1, "Ip4": 1.0}
    values = FIRM | {f"electrical.{name}": value for name, value in points.items()}
    found = driven(values | {"electrical.Kqv": 9.0}, dip(0.7), 0.2)[-1]
    assert found["I_q_command"] == pytest.approx(0.5, rel=1e-3)  # halfway from 0.5 to 0.9 pu
    assert found["I_p_command"] == pytest.approx(0.5, rel=1e-3)


def test_low_voltage_takes_active_current_and_its_return_is_a_ramp():
    values = AT | {
        "Rrpwr": 2.0,
        "Zerox": 0.2,
        "Brkpt": 0.8,
        "Lvpl1": 0.9,
        "Lvpnt0": 0.1,
        "Lvpnt1": 0.5,
    }
    found = driven(values, dip(0.4), 0.5)
    assert found[210]["I_p_fed"] == pytest.approx(0.9 * (0.2 / 0.6) * (0.3 / 0.4), rel=1e-3)
    first, later = found[300]["I_p_fed"], found[350]["I_p_fed"]
    assert later - first == pytest.approx(2.0 * 0.05, rel=1e-3)
    assert found[-1]["I_p_fed"] == pytest.approx(0.6, rel=1e-3)


def test_high_voltage_takes_reactive_current_down_to_a_limit():
    values = AT | {"Khv": 4.0, "Volim": 1.1, "Iolim": -0.6, "electrical.Vup": 1.05}
    assert driven(values, lambda t: 1.15, 0.1)[-1]["I_q_fed"] == pytest.approx(0.1 - 0.2, rel=1e-4)
    assert driven(values, lambda t: 1.4, 0.1)[-1]["I_q_fed"] == pytest.approx(-0.6, rel=1e-4)
    beyond = values | {"v_0": 1.12, "electrical.Vup": 1.2, "electrical.VMAX": 1.2}
    device = Evaluated(regca1_phasor(), beyond)  # part of the operating point
    assert device.outputs([1.12, 0.0])["q"] == pytest.approx(0.1, rel=1e-9)


def test_the_plant_answers_to_frequency_by_its_droops():
    values = {
        "P_0": 0.6,
        "f_n": 60.0,
        "plant.Fflag": True,
        "plant.Kpg": 0.2,
        "plant.Kig": 4.0,
        "plant.Tp": 0.05,
    }
    values |= {"plant.fdbd1": -0.002, "plant.fdbd2": 0.001, "plant.Ddn": 20.0, "plant.Dup": 10.0}
    values["electrical.dPmax"] = 99.0
    for frequency, wanted in ((59.7, 0.6 + 10 * 0.004), (60.3, 0.6 - 20 * 0.003)):
        turning = 2 * np.pi * (frequency - 60.0)
        found = driven(
            values, lambda t, w=turning: np.exp(1j * w * (t - 0.02)), 2.0, regca1_repca1_phasor
        )[-1]
        assert found["V"] * found["I_p_fed"] == pytest.approx(wanted, abs=2e-4)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"P_0": 1.05}, "more active power than PMAX"),
        ({"P_0": -0.1}, "P_0 is at least 0"),
        ({"Q_0": 0.5}, "more reactive power than QMax"),
        ({"v_0": 1.06}, "above VMAX"),
        ({"v_0": 0.85}, "v_0 lies in a dip"),
        ({"P_0": 0.9, "electrical.Imax": 0.8}, "more active current than Imax"),
        ({"Zerox": 0.95}, "Brkpt must not lie below Zerox"),
    ],
)
def test_an_operating_point_beyond_a_limit_is_refused(values, words):
    own = {"electrical.QFLAG": True, "electrical.VFLAG": True}
    assert any(words in text for text in refused(Evaluated(regca1_phasor(), own | values)))


def test_a_record_has_the_fields_of_the_program():
    """ICONs and CONs of PSS/E's model library."""
    first = {"REGCA1": 1 + 14, "REECA1": 6 + 45, "REECB1": 5 + 25, "REPCA1": 7 + 27}
    first |= {"REPCTA1": first["REPCA1"]}
    others = {"REECC1": 5 + 45, "REECD1": 83, "REGCB1": 9, "REGCC1": 15}
    turbine = {"WTDTA1": 5, "WTARA1": 2, "WTPTA1": 10, "WTTQA1": 1 + 15}
    at_a_unit = {"REAX3BU1": 1 + 7, "REAX4BU1": 1 + 7}
    of_type_3 = {"WT3G1": 1 + 5, "WT3E1": 6 + 31, "WT3T1": 8, "WT3P1": 9}
    of_type_4 = {"WT4G1": 9, "WT4E1": 4 + 23}
    numbers = first | others | turbine | at_a_unit | of_type_3 | of_type_4
    assert {name: len(record.fields) for name, record in PLANT_RECORDS.items()} == numbers
    known = {v.name for v in regca1_repca1_phasor().parameters}
    elsewhere = {v.name for v in regca1_repca1_remote_phasor().parameters}
    assert elsewhere - known == {f"plant.{name}" for name in ("v_0", "p_0", "q_0", "reversed")}
    for record in (PLANT_RECORDS[name] for name in first):
        taken = {p for field in record.fields for p in field.parameters}
        assert taken - {"electrical.PFLAG"} <= known  # PFLAG acts with the shaft of a turbine
        assert {*record.without} <= known
