"""Limits, holds, blocking, charge and priorities of WECC's generic plants: single values at a given voltage."""

import numpy as np
import pytest

from fmus.wecc_renewable.composed import wecc_plant_phasor
from fmus.wecc_renewable.dyr_records import PLANT_RECORDS
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

AT = {"P_0": 0.6, "Q_0": 0.1, "f_n": 60.0, "electrical.VFLAG": False, "electrical.Kqv": 0.0}


def driven(records, values, voltage, until):
    """Outputs at every millisecond, under a voltage [pu] by time [s]."""
    device = Evaluated(wecc_plant_phasor(records), AT | values)
    assert not refused(device)
    start = values.get("v_0", 1.0)

    def inputs(t):
        v = complex(start if t < 0.02 else voltage(t))
        return [v.real, v.imag]

    return integrated(device, inputs, until)[0]


def dip(to, end=0.22):
    return lambda t: to if t < end else 1.0


BATTERY = "REGCA1 REECC1"


@pytest.mark.parametrize(("P_0", "charge", "wanted"), [(0.5, 0.0104, 0.0), (-0.5, 0.9896, 0.0)])
def test_an_empty_battery_feeds_nothing_and_a_full_one_draws_nothing(P_0, charge, wanted):
    """At a tenth of a second the charge has moved by 0.5·0.1/5 = 0.01; the limits are 0 and 1."""
    values = {"P_0": P_0, "electrical.T": 5.0, "electrical.SOCini": charge, "electrical.PMIN": -1.0}
    found = driven(BATTERY, values | {"electrical.counts_P_0": True}, lambda t: 1.0, 0.25)
    assert found[95]["I_p_command"] == pytest.approx(P_0, rel=1e-6)
    assert found[-1]["I_p_command"] == wanted
    resting = driven(BATTERY, values, lambda t: 1.0, 0.25)
    assert resting[-1]["I_p_command"] == pytest.approx(P_0, rel=1e-6)


def test_a_battery_draws_within_its_current():
    values = {"P_0": -0.9, "electrical.PMIN": -1.0, "electrical.Imax": 1.0}
    values |= {"Lvpnt1": 0.5, "Lvpnt0": 0.3}
    found = driven(BATTERY, values, dip(0.7), 0.2)[-1]
    rest = np.sqrt(1 - found["I_q_command"] ** 2)
    assert found["I_p_command"] == pytest.approx(-rest, rel=1e-3)
    assert found["I_p_fed"] == pytest.approx(-rest, rel=1e-2)


@pytest.mark.parametrize(
    ("records", "values", "words"),
    [
        (BATTERY, {"electrical.SOCini": 0.0}, "the battery is empty"),
        (
            BATTERY,
            {"P_0": -0.4, "electrical.SOCini": 1.0, "electrical.PMIN": -1.0},
            "the battery is full",
        ),
        ("REGCA1 REECD1", {"P_0": -0.4, "electrical.PMIN": -1.0}, "REECD1 draws Ke·Imax at most"),
        ("REGCA1 REECD1", {"electrical.Vblkh": 1.0}, "lies where the converter is blocked"),
        ("REGCB1 REECD1", {"Imax": 0.5}, "more current than Imax: raise it or S_n"),
        (
            "REGCA1 REECA1 WTDTA1 WTTQA1",
            {"torque.Temax": 0.5},
            "the power flow asks for a torque beyond Temax",
        ),
        (
            "REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1",
            {"aerodynamics.Theta0": -1.0},
            "Theta0 lies beyond TetaMin",
        ),
        ("REGCA1 REECA1 WTDTA1", {"shaft.Htfrac": 1.0}, "lies below 1"),
        ("REGCA1 REECA1 WTDTA1", {"shaft.Freq1": 0.0}, "shaft.Freq1 lies above 0"),
    ],
)
def test_an_operating_point_that_cannot_be_is_refused(records, values, words):
    assert any(words in t for t in refused(Evaluated(wecc_plant_phasor(records), AT | values)))


D = "REGCA1 REECD1"
HOLDING = {"electrical.Kqv": 2.0, "electrical.dbd2": 0.1, "electrical.Imax": 1.0}


@pytest.mark.parametrize(("Thld", "wanted"), [(0.3, 0.1 + 2.0 * 0.2), (-0.3, 0.25), (0.0, 0.1)])
def test_what_the_reactive_current_does_after_a_dip(Thld, wanted):
    """The dip to 0.7 pu ends at 220 ms; the reference waits in it."""
    values = HOLDING | {"electrical.Thld": Thld, "electrical.Iqfrz": 0.25}
    found = driven(D, values, dip(0.7), 0.72)
    assert found[400]["I_q_command"] == pytest.approx(wanted, abs=2e-3)
    assert found[-1]["I_q_command"] == pytest.approx(0.1, abs=2e-3)


def test_the_active_current_stays_after_a_dip():
    values = HOLDING | {"electrical.Kqv": 2.5, "electrical.Iqh1": 0.95}
    free, held = (
        driven(D, values | {"electrical.Thld2": time}, dip(0.5), 0.6) for time in (0.0, 0.25)
    )
    rest = np.sqrt(1 - 1.0 + 1e-12)  # of 0.1 + 0.95
    assert held[200]["I_p_command"] == pytest.approx(rest, abs=1e-3)
    assert free[400]["I_p_command"] == pytest.approx(0.6, rel=1e-3)
    assert held[400]["I_p_command"] == pytest.approx(rest, abs=2e-3)
    assert held[-1]["I_p_command"] == pytest.approx(0.6, rel=1e-3)


@pytest.mark.parametrize(("to", "current"), [(0.55, 0.0), (0.75, 0.6 / 0.75), (1.35, 0.0)])
def test_a_converter_blocks_and_comes_back_after_its_delay(to, current):
    values = {"electrical.Vblkl": 0.6, "electrical.Vblkh": 1.3, "electrical.Tblk": 0.1}
    found = driven(D, values, dip(to), 0.5)
    assert found[200]["I_p_command"] == pytest.approx(current, rel=2e-3)
    if not current:
        assert found[310]["I_p_command"] == found[310]["I_q_command"] == 0
    assert found[-1]["I_p_command"] == pytest.approx(0.6, rel=1e-3)


def test_a_table_counts_its_points_as_far_as_their_voltages_rise():
    points = {"Vp1": 0.2, "Ip1": 0.4, "Vp2": 0.8, "Ip2": 0.7, "Vq1": 0.1, "Iq1": 0.3}
    values = {f"electrical.{name}": value for name, value in points.items()}
    for records in (D, BATTERY, "REGCA1 REECA1"):
        found = driven(records, values | {"P_0": 0.5}, dip(0.5), 0.2)[-1]
        assert found["I_p_command"] == pytest.approx(0.55, rel=1e-3)
        still = Evaluated(wecc_plant_phasor(records), AT | values | {"P_0": 0.5})
        assert not refused(still)  # above the last point its limit holds


@pytest.mark.parametrize("first", [False, True])
def test_the_flowing_current_stays_within_its_limit_by_priority(first):
    """The emf waits behind Te while the terminal voltage falls; what flows is limited at once."""
    values = {"Te": 1e5, "PQFLAG": first, "Imax": 1.2, "Xe": 0.15, "electrical.Imax": 1.2}
    found = driven("REGCB1 REECB1", values, dip(0.5), 0.15)[-1]
    p, q = found["I_p_fed"], found["I_q_fed"]
    assert np.hypot(p, q) == pytest.approx(1.2, rel=1e-6)
    emf = 1.0 + 0.15j * (0.6 - 0.1j)
    free = (emf - 0.5) / 0.15j
    assert (q if not first else p) == pytest.approx(
        min(1.2, -free.imag) if not first else min(1.2, free.real), rel=1e-6
    )


@pytest.mark.parametrize(("P_0", "sign"), [(0.5, 1), (-0.5, -1)])
def test_the_active_current_returns_at_its_rate(P_0, sign):
    values = {"P_0": P_0, "rrpwr": 2.0, "electrical.PMIN": -1.0, "Te": 0.005}
    values |= {"electrical.Imax": 0.7, "electrical.Kqv": 3.0, "Imax": 2.0}
    found = driven("REGCB1 REECC1", values, dip(0.78), 0.6)
    first, later = found[240]["I_p_fed"], found[290]["I_p_fed"]
    assert sign * (later - first) == pytest.approx(2.0 * 0.05, rel=2e-2)


def test_a_pll_stays_within_its_speed():
    turning = np.exp(0.6j)
    device = Evaluated(
        wecc_plant_phasor("REGCC1 REECC1"), AT | {"wmax": 3.0, "wmin": -3.0, "Kppll": 40.0}
    )

    def inputs(t):
        v = turning if t >= 0.02 else 1.0
        return [np.real(v), np.imag(v)]

    _, early = integrated(device, inputs, 0.06)
    _, late = integrated(device, inputs, 0.16)
    angles = [dict(zip(device.states, x, strict=True))["pll.angle"] for x in (early, late)]
    assert angles[1] - angles[0] == pytest.approx(3.0 * 0.1, rel=1e-3)


WIND = "REGCA1 REECA1 WTDTA1 WTARA1 WTPTA1 WTTQA1"


def test_the_shaft_swings_at_its_frequency():
    """Between the power of the wind and one that is constant."""
    values = {"shaft.Freq1": 1.7, "shaft.Dshaft": 0.0, "shaft.Htfrac": 0.8, "P_0": 0.2}
    device = Evaluated(wecc_plant_phasor("REGCA1 REECA1 WTDTA1"), AT | values)
    (swing,) = [z for z in np.linalg.eigvals(device.blocks([1.0, 0.0])[0]) if z.imag > 1]
    assert swing.imag == pytest.approx(2 * np.pi * 1.7, rel=1e-4)


def test_one_mass_has_the_whole_inertia():
    """Constant power of the wind against 0.1 pu more: 2·H·ω' = −ΔP/ω, at the speed 0.86 of 0.6 pu."""
    values = {
        "shaft.Htfrac": 0.0,
        "shaft.Freq1": 0.0,
        "shaft.H": 4.0,
        "torque.Twref": 1e4,
        "torque.Kip": 0.0,
    }
    device = Evaluated(wecc_plant_phasor(WIND), AT | values | {"torque.Kpp": 0.0})
    x = device.vector(device.states | {"I_p": 0.7})
    rate = device.rates([1.0, 0.0], x)["shaft.speed_of_generator"]
    assert rate == pytest.approx(-0.1 / 0.86 / 8.0, rel=1e-6)


def test_the_pitch_rests_at_its_least_angle_and_rises_by_its_rate_at_most():
    values = {"pitch.RTetaMax": 4.0, "pitch.Kpw": 500.0, "pitch.Tp": 0.05}
    device = Evaluated(wecc_plant_phasor(WIND), AT | values)
    A = device.blocks([1.0, 0.0])[0]
    row = [s.name for s in device.model.states].index("pitch.angle")
    held = [s.name for s in device.model.states].index("shaft.speed_of_turbine")
    assert A[row, held] == 0.0  # below rated wind a linear model keeps it there
    fast = device.vector(device.states | {"shaft.speed_of_turbine": 0.95})
    found, _ = integrated(device, lambda t: [1.0, 0.0], 0.3, x=fast)
    steps = np.diff([y["pitch_angle"] for y in found])
    assert max(steps) == pytest.approx(4.0e-3, rel=1e-6)


def test_a_turbine_rated_otherwise_has_its_line_on_its_own_rating():
    values = {"torque.TRATE": 80.0, "P_0": 0.6}
    device = Evaluated(wecc_plant_phasor(WIND), AT | values)
    speed = np.interp(0.6 * 100 / 80, [0.2, 0.4, 0.6, 0.8], [0.58, 0.72, 0.86, 1.0])
    assert device.states["shaft.speed_of_generator"] == pytest.approx(speed, rel=1e-12)
    assert max(map(abs, device.rates([1.0, 0.0]).values())) < 1e-9


@pytest.mark.parametrize("with_torque", [False, True])
def test_the_power_asked_for_follows_the_speed_where_pflag_says_so(with_torque):
    """3 % less speed is 3 % less power, within the lag of the power."""
    records = WIND if with_torque else "REGCA1 REECA1 WTDTA1"
    device = Evaluated(wecc_plant_phasor(records), AT | {"electrical.PFLAG": True})
    assert not refused(device)
    assert max(map(abs, device.rates([1.0, 0.0]).values())) < 1e-9
    if with_torque:
        return
    slow = device.vector(device.states | {"shaft.speed_of_generator": 0.97})
    rate = device.rates([1.0, 0.0], slow)["electrical.P_ord"]
    assert rate == pytest.approx(-0.03 * 0.6 / 0.02, rel=1e-9)


@pytest.mark.parametrize(
    ("records", "words"),
    [
        ("REECC1", "no converter; name one of REGCA1, REGCB1, REGCC1"),
        ("REGCA1 REGCB1 REECC1", "more than one converter"),
        ("REGCA1 REECC1 REPCX1", "'REPCX1' is none of"),
        ("REGCA1 REECC1 REPCA1 REPCA1", "'REPCA1' stands twice"),
        ("REGCA1 REECC1 elsewhere", "'elsewhere' needs 'REPCA1' beside it"),
        ("REGCA1 REECA1 WTTQA1", "'WTTQA1' needs 'WTDTA1' beside it"),
    ],
)
def test_records_that_make_no_plant_are_refused(records, words):
    with pytest.raises(ValueError, match="records = ") as caught:
        wecc_plant_phasor(records)
    assert words in str(caught.value)


def test_a_record_has_the_fields_of_its_readers():
    numbers = {"REECC1": 5 + 45, "REECD1": 6 + 77, "REGCB1": 2 + 7, "REGCC1": 2 + 13}
    numbers |= {"WTDTA1": 5, "WTARA1": 2, "WTPTA1": 10, "WTTQA1": 1 + 15}
    assert {name: len(PLANT_RECORDS[name].fields) for name in numbers} == numbers
    made = {
        "REECC1": BATTERY,
        "REECD1": f"{D} WTDTA1",
        "REGCB1": "REGCB1 REECC1",
        "REGCC1": "REGCC1 REECC1",
    }
    for name in numbers:
        known = {v.name for v in wecc_plant_phasor(made.get(name, WIND)).parameters}
        assert {p for field in PLANT_RECORDS[name].fields for p in field.parameters} <= known
