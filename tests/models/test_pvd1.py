"""PVD1 beside ANDES, its equations by hand at a source, and the branches of its specification."""

import json

import numpy as np
import pytest

from fmus.distributed_generation.dyr_records import DISTRIBUTED_RECORDS
from fmus.distributed_generation.pvd1 import pvd1_phasor
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from tests.benchmarks import andes_pvd1 as andes
from tests.models.closed import AtSource
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

MODEL = pvd1_phasor()
PEER = json.loads(andes.PLACE.read_text("utf-8"))
BEGIN = 0.48  # of the comparison [s]: the peer has come to rest
SETTLED = 3e-3  # deviation in parts of the swing, 250 ms after a jump

# -- beside ANDES: the currents at its own bus voltage ----------------------------------------------


def beside_andes(**changed):
    """Times, and our currents there by name, at the voltage that ANDES found."""
    given = andes.PLANT
    names = {"qmx": "Qmx", "qmn": "Qmn", "v0": "V0", "v1": "V1", "dqdv": "Dqdv", "ialim": "Imax"}
    names |= {f"{axis}t{k}": f"{axis.upper()}t{k}" for axis in "vf" for k in range(4)}
    values = {ours: given[theirs] for theirs, ours in names.items()}
    values |= {"fdbd": given["fdbd"] / andes.FREQUENCY, "Ddn": given["ddn"] * andes.FREQUENCY}
    values |= {"Vrflag": 1.0, "Frflag": 1.0, "Tg": given["tip"], "Tf": andes.FILTER}
    t, v, a = (np.array(PEER[name]) for name in ("t", "v", "a"))
    first = np.searchsorted(t, BEGIN)
    base = andes.RATING / 100
    at = {"S_n": andes.RATING, "P_0": andes.POWER / base, "Q_0": PEER["q"] / base, "v_0": v[first]}
    at |= {"theta_0": a[first], "f_n": andes.FREQUENCY, "bus_voltage.tau": 1e-3}
    device = Evaluated(MODEL, values | at | changed)
    assert not refused(device)

    def bus(time):
        z = np.interp(t[first] + time, t, v) * np.exp(1j * np.interp(t[first] + time, t, a))
        return [z.real, z.imag]

    step = 5e-4
    rows = integrated(device, bus, t[-1] - t[first], step)[0]
    times = t[first] + step * np.arange(1, len(rows) + 1)
    return times, {name: base * np.array([row[name] for row in rows]) for name in rows[0]}


@pytest.fixture(scope="module")
def ours():
    return beside_andes()


def deviation(found, name, theirs, since):
    """Largest deviation from ANDES in parts of the swing, ``since`` a jump or later [s]."""
    times, currents = found
    wanted = np.interp(times, PEER["t"], PEER[theirs])
    jumps = np.array(andes.JUMPS)
    ages = times[:, None] - jumps
    settled = np.where(ages >= 0, ages, np.inf).min(axis=1) > since
    return np.abs(currents[name] - wanted)[settled].max() / np.ptp(wanted)


@pytest.mark.parametrize(("name", "theirs"), [("I_p_fed", "i_p"), ("I_q_fed", "i_q")])
def test_its_currents_are_those_of_andes(ours, name, theirs):
    """At a jump of the angle ANDES takes the frequency through two lags, and trips another share for a moment."""
    assert deviation(ours, name, theirs, 0.0) < 0.035
    assert deviation(ours, name, theirs, 0.25) < SETTLED


@pytest.mark.parametrize(
    "changed", [{"Vt3": 1.205}, {"Ddn": 37.0}, {"Tg": 0.11}, {"Imax": 0.84}, {"Ft3": 60.83}]
)
def test_another_value_would_be_seen(changed):
    found = beside_andes(**changed)
    pairs = (("I_p_fed", "i_p"), ("I_q_fed", "i_q"))
    assert max(deviation(found, *pair, 0.25) for pair in pairs) > SETTLED


# -- by hand, behind an impedance, whose voltage is of the same instant ------------------------------

Z = 0.03 + 0.3j
SUPPORT = {"V0": 0.99, "V1": 1.0, "Dqdv": -1.5, "Xc": 0.05, "Tg": 0.05, "Imax": 1.2}
NEAR_RATED = {"Ft0": 58.0, "Ft1": 59.0, "Ft2": 61.0, "Ft3": 62.0}
FLOW = 0.7, 0.1, 1.02  # P, Q and |v| [pu]


def by_hand(source, until, step):
    """Size of the terminal voltage, by Runge-Kutta of order 4: both currents, with support by voltage."""
    P, Q, v_0 = FLOW

    def terminal(x):
        i, v = complex(x[0], -x[1]), source
        for _ in range(60):
            v = source + Z * i * v / abs(v)
        return abs(v)

    def support(v, x):
        away = abs(v - 1j * SUPPORT["Xc"] * complex(x[0], -x[1]))
        return 1.5 * (max(SUPPORT["V0"] - away, 0) + min(SUPPORT["V1"] - away, 0))

    x = np.array([P, Q]) / v_0
    at_start = support(v_0, x)

    def rate(x):
        v = terminal(x)
        wanted = np.array([P, Q + support(v, x) - at_start]) / v
        return (wanted - x) / SUPPORT["Tg"]

    found = []
    for _ in range(round(until / step) + 1):
        found.append(terminal(x))
        k1 = rate(x)
        k2 = rate(x + step / 2 * k1)
        k3 = rate(x + step / 2 * k2)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + rate(x + step * k3))
    return np.array(found)


def test_the_model_is_the_equations_by_hand():
    P, Q, v_0 = FLOW
    at_rest = v_0 - Z * (P - 1j * Q) / v_0
    at = {"P_0": P, "Q_0": Q, "v_0": v_0, "theta_0": -np.angle(at_rest), "f_n": 60.0}
    wide = {"Vt0": 0.5, "Vt1": 0.6, "Vt2": 1.4, "Vt3": 1.5, "bus_voltage.tau": 1e-3}
    device = Evaluated(MODEL, SUPPORT | at | wide | NEAR_RATED)
    assert not refused(device)
    source = 0.96 * abs(at_rest)
    found = AtSource(device, Z).run(source, 0.4, 2.5e-4)
    wanted = by_hand(source, 0.4, 2.5e-4)
    assert np.ptp(wanted) > 5e-3
    assert np.abs(found - wanted)[round(0.02 / 2.5e-4) :].max() < 5e-4
    assert found[-1] == pytest.approx(wanted[-1], abs=1e-6)


# -- single branches at an imposed voltage ----------------------------------------------------------

AT = {"P_0": 0.6, "Q_0": 0.1, "f_n": 60.0}


def driven(values, voltage, until):
    """Outputs at every millisecond, under a voltage [pu] by time [s]."""
    device = Evaluated(MODEL, AT | NEAR_RATED | values)
    assert not refused(device), refused(device)

    def inputs(t):
        v = complex(voltage(t))
        return [v.real, v.imag]

    return integrated(device, inputs, until)[0]


def dip(to, end=9.0):
    return lambda t: to if 0.02 <= t < end else 1.0


@pytest.mark.parametrize("flags", [{}, {"Pqflag": True}, {"V0": 1.04, "Dqdv": 3.0, "Khv": 1.0}])
def test_it_starts_at_rest_and_feeds_the_power_flows_powers(flags):
    at = {"v_0": 1.03, "theta_0": 0.2, "Vtmax": 1.01}
    device = Evaluated(MODEL, AT | NEAR_RATED | flags | at)
    bus = [1.03 * np.cos(0.2), 1.03 * np.sin(0.2)]
    assert not refused(device)
    assert max(map(abs, device.rates(bus).values())) < 1e-9
    found = device.outputs(bus)
    assert (found["p"], found["q"], found["share"]) == pytest.approx((0.6, 0.1, 1.0))


@pytest.mark.parametrize(
    ("to", "change"), [(0.95, 2 * 0.03), (0.91, 0.1), (1.05, -2 * 0.03), (1.08, -0.08), (0.99, 0)]
)
def test_reactive_power_answers_to_voltage_within_its_limits(to, change):
    values = {"V0": 0.98, "V1": 1.02, "Dqdv": -2.0, "Qmx": 0.1, "Qmn": -0.08}
    found = driven(values, dip(to), 0.4)[-1]
    assert found["I_q_fed"] * to == pytest.approx(0.1 + change, abs=1e-4)
    assert found["I_p_fed"] * to == pytest.approx(0.6, abs=1e-4)


def test_the_voltage_behind_a_reactance_is_supported():
    found = driven({"V0": 0.98, "V1": 1.02, "Dqdv": 2.0, "Xc": 0.2, "Qmx": 0.9}, dip(0.93), 0.6)[-1]
    i = complex(found["I_p_fed"], -found["I_q_fed"])
    away, away_0 = abs(0.93 - 0.2j * i), abs(1 - 0.2j * (0.6 - 0.1j))
    wanted = 0.1 + 2 * (0.98 - away) - 2 * max(0.98 - away_0, 0)
    assert 0.93 * found["I_q_fed"] == pytest.approx(wanted, abs=1e-4)
    assert wanted > 0.2


@pytest.mark.parametrize("active_first", [False, True])
def test_the_limit_of_current_leaves_the_rest_to_the_other(active_first):
    values = {"V0": 0.99, "Dqdv": 9.0, "Qmx": 0.9, "Imax": 0.8, "Pqflag": active_first}
    found = driven(values, dip(0.91), 0.4)[-1]
    p, q = found["I_p_command"], found["I_q_command"]
    assert p**2 + q**2 == pytest.approx(0.64, rel=1e-6)
    if active_first:
        assert p == pytest.approx(0.6 / 0.91, rel=1e-4)
    else:
        assert q == pytest.approx(0.8, rel=1e-6)


@pytest.mark.parametrize(("hertz", "wanted"), [(60.3, 0.6 - 20 * 0.0044), (59.7, 0.6)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_the_power_falls_with_the_frequency_above_rated(hertz, wanted, sign):
    values = {"Ddn": 20.0, "fdbd": sign * 0.0006}
    turned = driven(values, lambda t: np.exp(2j * np.pi * (hertz - 60) * t), 1.5)[-1]
    assert turned["f"] == pytest.approx(hertz / 60, abs=1e-5)
    assert turned["p"] == pytest.approx(wanted, abs=1e-3)


CURVE = {"Vt0": 0.6, "Vt1": 0.9, "Vt2": 1.1, "Vt3": 1.3}


@pytest.mark.parametrize(("to", "left"), [(0.75, 0.5), (0.5, 0.0), (1.15, 0.75), (0.95, 1.0)])
@pytest.mark.parametrize("returning", [0.0, 0.4, 1.0])
def test_of_what_voltage_trips_a_part_comes_back(to, left, returning):
    found = driven(CURVE | {"Vrflag": returning}, dip(to, 0.2), 0.6)
    assert found[190]["share"] == pytest.approx(left, abs=1e-3)
    assert found[-1]["share"] == pytest.approx(1 - (1 - returning) * (1 - left), abs=2e-3)
    assert found[-1]["p"] == pytest.approx(0.6 * found[-1]["share"], abs=1e-3)


@pytest.mark.parametrize(("hertz", "left"), [(58.5, 0.5), (61.25, 0.75), (57.0, 0.0)])
@pytest.mark.parametrize("returning", [0.0, 1.0])
def test_of_what_frequency_trips_a_part_comes_back(hertz, left, returning):
    def turning(t):
        return np.exp(2j * np.pi * (hertz - 60) * min(t, 0.8))  # then back at rated frequency

    found = driven({"Frflag": returning}, turning, 1.2)
    assert found[790]["share"] == pytest.approx(left, abs=3e-3)
    assert found[-1]["share"] == pytest.approx(1 - (1 - returning) * (1 - left), abs=3e-3)


def test_frequencies_of_trips_below_two_are_per_unit():
    def turning(t):
        return np.exp(2j * np.pi * (58.5 - 60) * t)

    found = driven({"Ft0": 58 / 60, "Ft1": 59 / 60, "Ft2": 999.0, "Ft3": 999.0}, turning, 0.5)
    assert found[-1]["share"] == pytest.approx(0.5, abs=3e-3)


def test_low_voltage_lowers_the_active_current_and_high_voltage_the_reactive_one():
    low = driven(CURVE | {"Vt0": 0.1, "Vt1": 0.2, "lvpnt0": 0.4, "lvpnt1": 0.8}, dip(0.6), 0.4)[-1]
    assert low["I_p_fed"] == pytest.approx(0.5 * low["I_p_command"], abs=1e-4)
    high = {"Vt2": 1.4, "Vt3": 1.5, "V1": 1.5, "Vtmax": 1.1, "Khv": 2.0}
    found = driven(high, dip(1.2), 0.4)[-1]
    assert found["I_q_fed"] == pytest.approx(0.1 / 1.2 - 2.0 * 0.1, abs=1e-4)
    assert driven(high | {"Qmin": -0.05}, dip(1.2), 0.4)[-1]["I_q_fed"] == pytest.approx(-0.05)


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"P_0": -0.1}, "draws power"),
        ({"Imax": 0.5}, "more current than Imax"),
        ({"Vt1": 1.01, "Vt0": 0.9}, "a voltage below Vt1"),
        ({"Vt2": 0.99, "Vt1": 0.9}, "a voltage above Vt2"),
        ({"lvpnt1": 1.02}, "a voltage below lvpnt1"),
        (
            {"Ft0": 47.0, "Ft1": 47.5, "Ft2": 51.5, "Ft3": 52.0},
            "above Ft2, where a share is off: give Ft0 to Ft3 in Hz, or per unit",
        ),
        ({"Vt0": 0.95, "Vt1": 0.9}, "Vt1 must not lie below Vt0"),
        ({"Qmn": 0.4}, "Qmx must not lie below Qmn"),
    ],
)
def test_a_start_beyond_a_limit_is_refused(values, rule):
    broken = refused(Evaluated(MODEL, AT | NEAR_RATED | values))
    assert any(rule in text for text in broken), broken


# -- the record ---------------------------------------------------------------------------------------

RECORD = (
    "7, 'PVD1', 1, 1, 0.05, 0.3, -0.2, 0.98, 1.02, -1.4, 0.001, 20, 1.1, 0.88, 0.9, 1.1, 1.2, 0.5, "
    "59.5, 59.7, 60.3, 60.5, 0.25, 0.03, 0.04, 1.15, 0.8, 0.4, -1.25, 0.7 /\n"
)


def test_the_record_sets_each_parameter(tmp_path):
    (tmp_path / "plant.dyr").write_text(RECORD)
    machine = Machine(7, "1", 1, 40.0, 5.0, 50.0, 0.25j, -10.0, 10.0)
    (model,) = machine_models(read_dyr(tmp_path / "plant.dyr"), [machine]).values()
    assert model.converter == "pvd1_phasor"
    fields = DISTRIBUTED_RECORDS["PVD1"].fields
    assert len(fields) == 27
    found = [model.parameters[field.parameters[0]] for field in fields]
    wanted = [float(word) for word in RECORD.replace("/", "").split(",")[3:]]
    assert found == pytest.approx(wanted)
    device = Evaluated(MODEL, AT | dict(model.parameters))
    assert not refused(device)
