"""DERA1 against PSS/E's recording, its equations by hand, and the branches of its specification."""

import json
from pathlib import Path

import numpy as np
import pytest

from fmus.distributed_generation.dyr_records import DISTRIBUTED_RECORDS
from fmus.distributed_generation.model import dera1_phasor
from orchestrator.cases.networks.psse.dyr import machine_models
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_network import Machine
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

MODEL = dera1_phasor()
_FILE = Path(__file__).parents[1] / "reference" / "psse_traces.json"
TRACES = json.loads(_FILE.read_text(encoding="utf-8"))["traces"]
RECORD = (
    "102 DERA1 1 {pf} {f} 0 1 1 1 0.02 0.02 -99 99 5.0 0 0.02 0.02 20 0 -0.0006 0.0006 99 -99 1.1 0 0.5 -0.5 0.02 0.1 "
    "10 1.2 0.44 0.49 1.2 1.15 0.16 0.16 0.16 0.16 0.7 0 120 99 99 0.02 99 0.02 0.8 1 -1 /\n"
)
"""The plant of the recording, by its source's tests."""

# -- ThreeBusMulti.raw: a stiff bus, the plant's bus and one with a load, a line between each two ----

Z_LINE = 0.01 + 0.12j
P, Q, V_3 = 1.0, 0.36989255, 0.95589117  # of the plant, and the load's voltage, solved [pu]
ANGLE = np.radians(-1.25325818)  # of the plant's voltage, which is 1 pu
LOAD = 2.5 + 0.3j  # P constant current, Q constant impedance, as PSS/E converts loads
OPENED = np.array([[1, -1, 0], [-1, 1, 0], [0, 0, 0]]) / Z_LINE  # the line that trips


def voltages(current, at):
    """Plant's and load's voltages after the trip, at a current that may follow the plant's voltage [pu]."""
    Y = (3 * np.eye(3) - np.ones((3, 3))) / Z_LINE - OPENED
    Y[2, 2] += -1j * LOAD.imag / V_3**2
    inverse = np.linalg.inv(Y[1:, 1:])
    for _ in range(100):
        drawn = -LOAD.real / V_3 * at[1] / abs(at[1])
        new = inverse @ (np.array([current(at[0]), drawn]) - Y[1:, 0])
        if max(abs(new - at)) < 1e-14:
            break
        at = new
    return at


def by_hand(step, until):
    """The plant's voltage by Heun's method: reactive power and active power stay as they are."""
    x, at, found = np.array([1.0, Q, P, Q]), np.array([1.0, V_3], complex), []

    def rates(x, at):
        at = voltages(lambda v: complex(x[2], -x[3]) * v / abs(v), at)
        v = x[0]
        return np.array([abs(at[0]) - v, Q / v - x[1], P / v - x[2], x[1] - x[3]]) / 0.02, at

    for _ in range(round(until / step) + 1):
        first, at = rates(x, at)
        found.append(at[0])
        then, _ = rates(x + step * first, at)
        x = x + step / 2 * (first + then)
    return np.array(found)


def test_the_equations_by_hand_are_those_of_psse():
    found = by_hand(5e-3, 0.25)
    wanted = TRACES["dera"]["values"], TRACES["dera_angle"]["values"]
    assert wanted[0][0] == pytest.approx(1.0, abs=1e-6)
    size, angle = (np.array(values[1 : len(found) + 1]) for values in wanted)
    assert np.ptp(TRACES["dera"]["values"]) > 5e-3
    assert np.abs(np.abs(found) - size)[2:].max() < 2.1e-5
    assert np.abs(np.degrees(np.angle(found)) - angle)[2:].max() < 7e-3


def plant(tmp_path, pf=0, f=0):
    """Parameters of the plant by its record, as a DYR file has it."""
    (tmp_path / "plant.dyr").write_text(RECORD.format(pf=pf, f=f))
    machine = Machine(102, "1", 1, 100.0, 1.0, 100.0, 0.25j, -100.0, 100.0)
    (model,) = machine_models(read_dyr(tmp_path / "plant.dyr"), [machine]).values()
    assert model.converter == "dera1_phasor"
    return dict(model.parameters)


def at_network(device, until, step=5e-4):
    """The plant's voltage in the network after the trip, by Runge-Kutta's method of order 4."""
    names = [v.name for v in device.model.outputs]
    rows = [names.index(name) for name in ("e_re", "e_im", "y_re", "y_im")]
    x, at, found = np.array(device.x), np.array([np.exp(1j * ANGLE), V_3]), []

    def rate(x, at):
        # emf and admittance are functions of states alone
        out = device.model.outputs_function(x, [1.0, 0.0], device.p, device.c)[0]
        e_re, e_im, y_re, y_im = np.array(out).ravel()[rows]
        e, y = complex(e_re, e_im), complex(y_re, y_im)
        at = voltages(lambda v: y * (e - v), at)
        u = [at[0].real, at[0].imag]
        return np.array(device.model.derivatives(x, u, device.p, device.c)[0]).ravel(), at

    for _ in range(round(until / step) + 1):
        k1, at = rate(x, at)
        found.append(at[0])
        k2, _ = rate(x + step * k1 / 2, at)
        k3, _ = rate(x + step * k2 / 2, at)
        k4, _ = rate(x + step * k3, at)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.array(found)[:: round(5e-3 / step)]


def test_the_model_is_the_equations_by_hand(tmp_path):
    """From 15 ms on, when the extrapolated voltage has settled."""
    start = {"P_0": P, "Q_0": Q, "v_0": 1.0, "theta_0": ANGLE, "f_n": 60.0}
    device = Evaluated(MODEL, plant(tmp_path) | start | {"bus_voltage.tau": 1e-3})
    assert not refused(device)
    rest = [np.cos(ANGLE), np.sin(ANGLE)]
    assert max(map(abs, device.rates(rest).values())) < 1e-9
    found, wanted = at_network(device, 0.2), by_hand(1e-4, 0.2)[::50]
    assert np.abs(np.abs(found) - np.abs(wanted))[3:].max() < 1e-5


def test_the_record_has_47_fields_and_each_sets_one_parameter():
    fields = DISTRIBUTED_RECORDS["DERA1"].fields
    assert len(fields) == 47
    assert all(field.parameters == (field.name,) for field in fields)


# -- single branches at an imposed voltage ----------------------------------------------------------

AT = {"P_0": 0.6, "Q_0": 0.1, "f_n": 60.0}


def driven(values, voltage, until):
    """Outputs at every millisecond, under a voltage [pu] by time [s]."""
    device = Evaluated(MODEL, AT | values)
    assert not refused(device)

    def inputs(t):
        v = complex(voltage(t))
        return [v.real, v.imag]

    return integrated(device, inputs, until)[0]


def dip(to, end, back=1.0):
    return lambda t: to if 0.02 <= t < end else (1.0 if t < 0.02 else back)


@pytest.mark.parametrize("flags", [{}, {"PfFlag": False}, {"FreqFlag": True, "PQFlag": True}])
def test_it_starts_at_rest_and_feeds_the_power_flows_powers(flags):
    device = Evaluated(MODEL, AT | flags | {"v_0": 1.03, "theta_0": 0.2, "Vref0": 1.05, "Kqv": 2.0})
    bus = [1.03 * np.cos(0.2), 1.03 * np.sin(0.2)]
    assert not refused(device)
    assert max(map(abs, device.rates(bus).values())) < 1e-9
    found = device.outputs(bus)
    assert (found["p"], found["q"], found["share"]) == pytest.approx((0.6, 0.1, 1.0))


def test_low_voltage_asks_for_reactive_current_beyond_the_dead_band():
    found = driven({"Kqv": 4.0, "dbd1": -0.05, "dbd2": 0.05}, dip(0.8, 9.0), 0.5)[-1]
    assert found["I_q_command"] == pytest.approx(0.1 / 0.8 + 4.0 * 0.15, rel=1e-3)
    limited = driven({"Kqv": 4.0, "dbd1": -0.05, "dbd2": 0.05, "Iqh1": 0.2}, dip(0.8, 9.0), 0.5)
    assert limited[-1]["I_q_command"] == pytest.approx(0.1 / 0.8 + 0.2, rel=1e-3)


@pytest.mark.parametrize("active_first", [False, True])
def test_the_limit_of_current_leaves_the_rest_to_the_other(active_first):
    values = {"Kqv": 8.0, "dbd1": -0.01, "dbd2": 0.01, "Imax": 1.0, "PQFlag": active_first}
    found = driven(values, dip(0.8, 9.0), 0.5)[-1]
    p, q = found["I_p_command"], found["I_q_command"]
    assert p**2 + q**2 == pytest.approx(1.0, rel=1e-6)
    if active_first:
        assert p == pytest.approx(0.6 / 0.8, rel=1e-3)
    else:
        assert q == pytest.approx(1.0, rel=1e-6)


def test_a_storage_draws_power_and_a_generator_is_refused_there():
    storage = Evaluated(MODEL, AT | {"P_0": -0.5, "GenFlag": False, "Pmin": -1.0})
    assert not refused(storage)
    assert storage.outputs([1.0, 0.0])["p"] == pytest.approx(-0.5)
    generator = Evaluated(MODEL, AT | {"P_0": -0.5, "Pmin": -1.0})
    assert any("draws power" in text for text in refused(generator))


@pytest.mark.parametrize(("hertz", "wanted"), [(60.3, 0.6 - 20 * (0.005 - 0.0006)), (59.7, 0.6)])
def test_the_power_falls_with_the_frequency_above_rated(hertz, wanted):
    values = {"FreqFlag": True, "Ddn": 20.0, "fdbd1": -0.0006, "fdbd2": 0.0006}
    turned = driven(values, lambda t: np.exp(2j * np.pi * (hertz - 60) * t), 3.0)[-1]
    assert turned["f"] == pytest.approx(hertz / 60, abs=1e-5)
    assert turned["p"] == pytest.approx(wanted, abs=2e-3)


def shares(voltage, until=1.0, **values):
    times = {"tvl0": 0.1, "tvl1": 0.2, "tvh0": 0.1, "tvh1": 0.2, "Vrfrac": 0.7}
    levels = {"vl0": 0.4, "vl1": 0.8, "vh1": 1.1, "vh0": 1.2}
    found = driven(times | levels | values, voltage, until)
    return np.array([out["share"] for out in found])


def test_a_short_dip_takes_a_share_away_that_comes_back():
    found = shares(dip(0.7, 0.2))
    assert found[190] == pytest.approx(1 - 0.1 / 0.4, abs=5e-3)
    assert found[-1] == pytest.approx(1.0, abs=1e-6)


def test_of_what_a_long_dip_takes_away_a_part_stays_lost():
    found = shares(dip(0.7, 0.5))
    assert found[400] == pytest.approx(0.75, abs=1e-3)
    assert found[-1] == pytest.approx(1 - 0.25 * (1 - 0.7), abs=1e-3)


def test_a_deep_dip_leaves_vrfrac_of_all():
    found = shares(dip(0.3, 0.25), tvl1=0.9)
    assert found[240] == pytest.approx(0, abs=2e-2)
    assert found[-1] == pytest.approx(0.7, abs=1e-3)


def test_high_voltage_trips_as_low_voltage_does():
    assert shares(dip(1.15, 0.15))[-1] == pytest.approx(1.0, abs=1e-6)
    assert shares(dip(1.15, 0.5))[-1] == pytest.approx(1 - 0.5 * 0.3, abs=1e-3)
    assert shares(dip(1.25, 0.25), tvh1=0.9)[-1] == pytest.approx(0.7, abs=1e-3)


def test_without_the_flag_voltage_trips_nothing():
    found = shares(dip(0.3, 0.5), VtripFlag=False)
    assert found.min() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("hertz", "size", "left"),
    [(58.9, 1.0, 0.0), (59.2, 1.0, 1.0), (61.2, 1.0, 0.0), (58.9, 0.7, 1.0)],
)
def test_frequency_trips_all_for_good_unless_the_voltage_is_low(hertz, size, left):
    values = {"FtripFlag": True, "VtripFlag": False, "fltrp": 59.0, "fhtrp": 61.0}
    values |= {"tfl": 0.3, "tfh": 0.3, "Vpr": 0.8}

    def turning(t):
        angle = 2 * np.pi * (hertz - 60) * min(t, 1.0)  # back at rated frequency after a second
        return size * np.exp(1j * angle)

    found = driven(values, turning, 1.5)
    assert found[250]["share"] == pytest.approx(1.0, abs=1e-6)
    assert found[-1]["share"] == pytest.approx(left, abs=1e-6)


def test_the_active_current_comes_back_by_its_ramp():
    found = driven({"rrpwr": 0.5, "VtripFlag": True, "tvl1": 9.0}, dip(0.44, 0.3), 0.6)
    lost = found[299]["I_p_fed"]
    assert lost == pytest.approx(0, abs=1e-2)
    assert found[599]["I_p_fed"] - found[499]["I_p_fed"] == pytest.approx(0.05, rel=1e-2)


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"P_0": 1.1, "Imax": 2.0}, "more active power than Pmax"),
        ({"Pmin": 0.7}, "less active power than Pmin"),
        ({"Imax": 0.5}, "more than Imax"),
        ({"vl1": 1.01, "vl0": 0.9}, "v_0 lies below vl1"),
        ({"vh1": 0.99}, "v_0 lies above vh1"),
    ],
)
def test_a_start_beyond_a_limit_is_refused(values, rule):
    broken = refused(Evaluated(MODEL, AT | values))
    assert any(rule in text for text in broken), broken


@pytest.mark.parametrize(("generates", "least"), [(True, 0.0), (False, -0.3)])
def test_only_a_storage_draws_power_while_the_frequency_is_high(generates, least):
    """The order is held at Pmin; what generates alone feeds nothing there."""
    values = {"FreqFlag": True, "GenFlag": generates, "Pmin": -0.3, "Ddn": 50.0}
    values |= {"fdbd1": 0.0, "fdbd2": 0.0}
    turning = 2 * np.pi * 2.0  # 2 Hz above rated
    found = driven(values, lambda t: np.exp(1j * turning * t), 0.8)[-1]
    assert found["I_p_command"] == pytest.approx(least, abs=1e-3)
