"""CSVGN3, CSVGN5, CSTATT and SVSMO1 against their equations by hand: at rest, in frequency, and into their limits."""

import numpy as np
import pytest

from fmus.static_var.cstatt import cstatt_phasor
from fmus.static_var.csvgn1 import csvgn1_phasor
from fmus.static_var.csvgn3 import csvgn3_phasor
from fmus.static_var.csvgn5 import csvgn5_phasor
from fmus.static_var.svsmo1 import svsmo1_phasor
from tests.models.compensators_by_hand import cstatt, csvgn5, svsmo1, swell
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

MODELS = {
    "csvgn3": csvgn3_phasor,
    "csvgn5": csvgn5_phasor,
    "cstatt": cstatt_phasor,
    "svsmo1": svsmo1_phasor,
}
POINT = {"S_n": 80.0, "Q_0": 0.25, "v_0": 1.02}
BUS = [POINT["v_0"], 0.0]
FLEXIBLE = {"Vdbd1": 0.01, "Vdbd2": 0.004, "Tdbd": 0.05}


def compensator(name, **values):
    own = {"CBASE": 60.0} if name == "csvgn3" else {}
    return Evaluated(MODELS[name](), POINT | own | values)


def measured_lag(s):
    """By which the extrapolated voltage errs, as a factor beside 1."""
    return 1 - (s * 0.002 / (1 + s * 0.002)) ** 2


@pytest.mark.parametrize("name", MODELS)
def test_it_starts_at_rest_with_the_power_flows_reactive_power(name):
    device = compensator(name)
    assert max(map(abs, device.rates(BUS).values())) < 1e-10
    found = device.outputs(BUS)
    assert found["q"] == pytest.approx(POINT["Q_0"])
    assert found["p"] == pytest.approx(0, abs=1e-12)


OF_OTHER_BUSES = {
    "csvgn3": ("CSVGN4 elsewhere", "B"),
    "csvgn5": ("CSVGN5 elsewhere", "B"),
    "cstatt": ("CSTCNT elsewhere", "I"),
    "svsmo1": ("SVSMO1T2 elsewhere", "B"),
}
"""Models that can hold another bus' voltage: what they are built of, and the output that follows it."""


@pytest.mark.parametrize("name", OF_OTHER_BUSES)
def test_at_another_bus_it_starts_at_rest_whatever_that_voltage_is(name):
    records, _ = OF_OTHER_BUSES[name]
    own = {"CBASE": 60.0} if name == "csvgn3" else {}
    device = Evaluated(MODELS[name](records), POINT | own | {"held.v_0": 0.97})
    held = 0.97
    assert max(map(abs, device.rates([*BUS, held]).values())) < 1e-10
    assert device.outputs([*BUS, held])["q"] == pytest.approx(POINT["Q_0"])


@pytest.mark.parametrize("frequency", [0.05, 0.5, 2.0])
@pytest.mark.parametrize("name", OF_OTHER_BUSES)
def test_both_buses_together_move_it_as_its_own_bus_does(name, frequency):
    """The control hears the other bus, the reactance and the slope the own one: their responses add up."""
    s, (records, output) = 2j * np.pi * frequency, OF_OTHER_BUSES[name]
    own = {"CBASE": 60.0} if name == "csvgn3" else {}
    at = {"held.v_0": POINT["v_0"]}
    other = Evaluated(MODELS[name](records), POINT | own | at).response(s, [*BUS, POINT["v_0"]])
    alone = compensator(name).response(s, BUS)[output, "v_re"]
    both = other[output, "held.v"] + other[output, "v_re"]
    assert both == pytest.approx(alone, rel=1e-9)
    assert abs(other[output, "held.v"]) > 10 * abs(other[output, "v_re"]) or name == "cstatt"
    if name in ("csvgn3", "csvgn5"):  # nothing of the own bus is in their susceptance
        assert other[output, "v_re"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("records", ["CSVGN1 elsewhere", "CSVGN5 else", "elsewhere", ""])
def test_what_it_is_built_of_is_one_of_its_records(records):
    with pytest.raises(ValueError, match="write CSVGN5, or that with 'elsewhere'"):
        csvgn5_phasor(records)


@pytest.mark.parametrize("frequency", [0.05, 0.5, 2.0])
def test_csvgn5_follows_the_voltage_by_its_transfer_function(frequency):
    s, device = 2j * np.pi * frequency, compensator("csvgn5")
    p = device.parameters
    stages = (1 + s * p["Ts2"]) * (1 + s * p["Ts4"]) / ((1 + s * p["Ts3"]) * (1 + s * p["Ts5"]))
    wanted = -p["Ksvs"] * stages / ((1 + s * p["Ts1"]) * (1 + s * p["Ts6"])) * measured_lag(s)
    assert device.response(s, BUS)["B", "v_re"] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("frequency", [0.05, 0.5, 2.0])
def test_the_static_condensers_current_follows_the_voltage_by_its_closed_loop(frequency):
    """E = −G·(v + D·(E − v)/X) with G = K/s times the stages, and I = (E − v)/X."""
    s, device = 2j * np.pi * frequency, compensator("cstatt")
    p = device.parameters
    stages = (1 + s * p["T1"]) * (1 + s * p["T2"]) / ((1 + s * p["T3"]) * (1 + s * p["T4"]))
    gain = p["K"] / s * stages
    per_emf = (1 - p["DROOP"] / p["Xt"]) / (1 + gain * p["DROOP"] / p["Xt"])
    wanted = (-gain * per_emf - 1) / p["Xt"] * measured_lag(s)
    assert device.response(s, BUS)["I", "v_re"] == pytest.approx(wanted, rel=1e-9)


def test_the_static_condensers_droop_is_what_its_current_costs_in_voltage():
    """At rest ΔI = −ΔV/DROOP: the integrator leaves no error but the droop's."""
    slope = compensator("cstatt").response(1e-6j, BUS)["I", "v_re"]
    assert slope.real == pytest.approx(-1 / 0.025, rel=1e-4)


@pytest.mark.parametrize("frequency", [0.05, 0.5, 2.0])
def test_svsmo1_follows_the_voltage_by_its_closed_loop(frequency):
    s, device = 2j * np.pi * frequency, compensator("svsmo1", Tb2=0.8, Tc2=0.1)
    p = device.parameters
    gain = (p["Kpv"] + p["Kiv"] / s) * (1 + s * p["Tc2"]) / (1 + s * p["Tb2"]) / (1 + s * p["T2"])
    B_0 = POINT["Q_0"] / POINT["v_0"] ** 2
    seen = 1 / (1 + s * p["Tb1"]) + p["Xc1"] * B_0
    wanted = -gain * seen / (1 + gain * p["Xc1"] * POINT["v_0"]) * measured_lag(s)
    assert device.response(s, BUS)["B", "v_re"] == pytest.approx(wanted, rel=1e-9)


def test_svsmo1_holds_its_slope_at_rest():
    """V + Xc·B·V stays what it was, so that B falls by (1 + Xc·B)/(Xc·V) per voltage."""
    slope = compensator("svsmo1").response(1e-6j, BUS)["B", "v_re"].real
    B_0 = POINT["Q_0"] / POINT["v_0"] ** 2
    assert slope == pytest.approx(-(1 + 0.023 * B_0) / (0.023 * POINT["v_0"]), rel=1e-4)


VOLTAGES = {
    "a small rise": (1.035, 2.0),
    "a small fall": (1.0, 2.0),
    "a deep fall": (0.8, 5.0),
    "a high rise": (1.2, 5.0),
}
AT = (0.1, 0.3, 0.6)


@pytest.mark.parametrize("kind", VOLTAGES)
@pytest.mark.parametrize(
    ("name", "values", "by_hand", "output"),
    [
        ("csvgn5", {}, csvgn5, "B"),
        ("cstatt", {"VCUTOFF": 0.9}, cstatt, "I"),
        ("svsmo1", {}, svsmo1, "B"),
        ("svsmo1", FLEXIBLE, svsmo1, "B"),
    ],
    ids=["csvgn5", "cstatt", "svsmo1", "svsmo1 with a deadband"],
)
def test_it_moves_as_its_equations_by_hand(name, values, by_hand, output, kind):
    device = compensator(name, **values)
    size, rate = VOLTAGES[kind]
    voltage = swell(size, POINT["v_0"], rate, 0.02)
    found, _ = integrated(device, lambda t: [voltage(t + 5e-4), 0.0], max(AT))
    wanted = by_hand(device.parameters, voltage, AT)
    assert [found[round(time / 1e-3) - 1][output] for time in AT] == pytest.approx(wanted, abs=3e-3)
    moved = max(abs(value - POINT["Q_0"]) for value in wanted)
    assert moved > 0.1, "a trajectory that does not leave its start shows nothing"


def test_the_deadband_holds_it_until_the_error_leaves_it_and_it_rests_again():
    """An error of 8 mpu within 10 mpu moves nothing, and modes see no regulator; one of 12 mpu does."""
    device = compensator("svsmo1", **FLEXIBLE)
    resting = device.response(2j * np.pi * 0.5, BUS)["B", "v_re"]
    assert abs(resting) < 1e-9
    for size, moves in ((POINT["v_0"] - 0.008, False), (POINT["v_0"] - 0.012, True)):
        voltage = swell(size, POINT["v_0"], 1.0, 0.02)
        found, _ = integrated(device, lambda t, at=voltage: [at(t), 0.0], 0.3)
        assert bool(abs(found[-1]["B"] - found[0]["B"]) > 0.01) == moves


def test_the_short_rating_ends_after_its_time():
    device = compensator("svsmo1")
    voltage = swell(0.8, POINT["v_0"], 10.0, 0.02)
    found, _ = integrated(device, lambda t: [voltage(t), 0.0], 0.9)
    assert found[299]["B"] == pytest.approx(1.1, abs=1e-3)
    assert found[-1]["B"] == pytest.approx(0.95, abs=1e-3)


def test_the_slow_control_brings_the_susceptance_back_into_its_band():
    """Behind 0.03 pu a source falls by 0.02 pu, which takes B above Bscs; the reference falls until B is below."""
    band = {"Bscs": 24.0, "Bsis": -24.0, "Eps": 1.0, "Kis": 0.3, "Vrmax": 0.2, "Vrmin": -0.2}
    device = compensator("svsmo1", **band)
    B = device.outputs(BUS)["B"]
    source, state, highest = POINT["v_0"] * (1 - 0.03 * B) - 0.02, None, B
    for _ in range(1500):
        v = source / (1 - 0.03 * B)
        found, state = integrated(device, lambda t, v=v: [v, 0.0], 1e-3, x=state)
        B = found[-1]["B"]
        highest = max(highest, B)
    band_end = 24.0 / POINT["S_n"]
    assert highest > 0.4
    assert band_end - 0.02 < B < band_end
    rates = device.rates([v, 0.0], state)
    assert rates["slow.integrator"] == 0


def test_the_slope_changes_with_the_voltage_by_flag2():
    slopes = {"Flag2": 1.0, "Xc1": 0.05, "Xc2": 0.02, "Xc3": 0.04, "Vup": 1.05, "Vlow": 0.97}
    for v, slope in ((1.08, 0.05), (1.02, 0.02), (0.95, 0.04)):
        device = compensator("svsmo1", v_0=v, **slopes)
        B_0 = POINT["Q_0"] / v**2
        assert device.parameters["Vref"] == pytest.approx(v + slope * B_0 * v)


def test_the_override_of_csvgn3_asks_for_all_or_for_no_reactor():
    """Beyond VOV the reactor goes to its end, where VMIN and VMAX alone would hold it; CSVGN1 stays there."""
    held = {"VMIN": 0.2, "VMAX": 0.8, "CBASE": 60.0, "RMIN": 8.0, "VOV": 0.08, "T2": 0.0, "T4": 0.0}
    overridden = compensator("csvgn3", **held)
    held.pop("VOV")
    plain = Evaluated(csvgn1_phasor(), POINT | held)
    for v, reactor, without in ((0.9, 0.1, 0.2), (1.15, 1.0, 0.8)):
        for device, wanted in ((overridden, reactor), (plain, without)):
            found, _ = integrated(device, lambda t, v=v: [v, 0.0], 0.5, 2e-3)
            assert found[-1]["B"] == pytest.approx(60 / 80 - wanted, abs=1e-4), (v, wanted)


@pytest.mark.parametrize("frequency", [0.5, 2.0])
def test_csvgn3_is_csvgn1_while_its_override_rests(frequency):
    s, plain = 2j * np.pi * frequency, Evaluated(csvgn1_phasor(), POINT | {"CBASE": 60.0})
    wanted = plain.response(s, BUS)["B", "v_re"]
    assert compensator("csvgn3").response(s, BUS)["B", "v_re"] == pytest.approx(wanted)


@pytest.mark.parametrize(
    ("name", "values", "rule"),
    [
        ("csvgn3", {"VOV": 0.01}, "raise VOV, or K"),
        ("csvgn5", {"Q_0": 1.9}, "lower Q_0, or raise Bmax"),
        ("csvgn5", {"Vemax": 0.001}, "raise Vemax, or Ksvs"),
        ("csvgn5", {"DV": 0.001}, "raise DV, or Ksvs"),
        ("csvgn5", {"DV": 0.0, "Bpmax": 0.0}, "with DV = 0 at Bpmax: lower Q_0, or raise Bpmax"),
        ("csvgn5", {"P_0": 0.1}, "feeds no active power"),
        ("cstatt", {"Q_0": 1.4}, "ICMAX: lower Q_0"),
        ("cstatt", {"Q_0": -1.4}, "ILMAX: raise Q_0"),
        ("cstatt", {"ELIMIT": 1.03}, "ELIMIT: lower Q_0"),
        ("cstatt", {"VMAX": 1.2, "VMIN": 0.8}, "raise VMAX above 0, or lower VMIN below it"),
        ("cstatt", {"VMAX": 0.0}, "raise VMAX above 0"),
        ("svsmo1", {"Q_0": 1.2}, "lower Q_0, or raise Bmax"),
        ("svsmo1", {"Q_0": -0.4}, "raise Q_0, or lower Bmin"),
    ],
)
def test_what_it_cannot_start_from_is_refused(name, values, rule):
    broken = refused(compensator(name, **values))
    assert any(rule in text for text in broken), broken
    assert not refused(compensator(name))
