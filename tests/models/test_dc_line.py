"""A DC line's stations against equations by hand: at rest, in frequency, into their limits, blocked and bypassed."""

import math
from itertools import pairwise

import numpy as np
import pytest

from fmus.dc_line.inverter import lcc_inverter_phasor
from fmus.dc_line.rectifier import lcc_rectifier_phasor
from tests.models.dc_line_by_hand import STEP, DelayedLine, Line, drop, no_load, reactive
from tests.models.parts import integrated, refused
from tests.support.evaluated import Evaluated

POINT = {"S_n": 1200.0, "P_0": -0.75, "Q_0": 0.02, "v_0": 1.02}
FAR = {"v": 0.99, "N": 2.0, "X_c": 13.315, "E_n": 209.229}
DRIVE = no_load(FAR, FAR["v"]) * math.cos(math.radians(15))
"""The inverter's voltage at its least angle without a current [kV]."""


def rectifier(**values):
    return Evaluated(lcc_rectifier_phasor(), POINT | values)


def delayed(**values):
    return Evaluated(lcc_rectifier_phasor("CDC6T"), POINT | values)


def inverter(**values):
    return Evaluated(lcc_inverter_phasor(), {"S_n": 1200.0, "v_0": 0.99} | values)


def at_rectifier(v=POINT["v_0"], drive=DRIVE, far_v=FAR["v"], holds=1.0):
    return [v, 0.0, drive, drop(FAR), far_v, 0.0 if holds else 1e4]


def test_both_start_at_rest_with_the_power_flows_powers_and_the_lines_loss_between_them():
    one = rectifier()
    assert max(map(abs, one.rates(at_rectifier()).values())) < 1e-10
    found, p = one.outputs(at_rectifier()), one.parameters
    assert found["p"] == pytest.approx(-0.75)
    assert found["q"] == pytest.approx(0.02)
    brought = 0.75 * 1200 - p["R_dc"] * found["I_dc"] ** 2
    assert found["V_inverter"] * found["inverter_I"] == pytest.approx(brought)
    two = inverter(P_0=brought / 1200, Q_0=-0.3)
    bus = [0.99, 0.0, found["inverter_I"], found["inverter_V"]]
    assert max(map(abs, two.rates(bus).values())) < 1e-10
    fed = two.outputs(bus)
    assert fed["p"] * 1200 == pytest.approx(brought)
    assert fed["q"] == pytest.approx(-0.3)
    for angle, at, v, kilovolts in (
        (found["alpha"], p, 1.02, found["V_dc"]),
        (fed["gamma"], two.parameters, 0.99, found["V_inverter"]),
    ):
        cosine = (kilovolts + drop(at) * found["I_dc"]) / no_load(at, v)
        assert angle == pytest.approx(math.degrees(math.acos(cosine)))


@pytest.mark.parametrize("v", [0.97, 1.02, 1.1])
def test_reactive_power_is_that_of_the_bridges_waveform(v):
    """With the susceptance that the power flow asks for; the current's order stays while V_measured does."""
    one = rectifier()
    current = one.parameters["I_dc_0"]
    V = one.parameters["V_dc_0"] + one.parameters["R_dc"] * current
    begin, now = (reactive(one.parameters, at, current, V) for at in (POINT["v_0"], v))
    beside = (0.02 * 1200 + begin) * (v / POINT["v_0"]) ** 2
    x = one.vector(one.states | {"bus_voltage.once_re": v, "bus_voltage.twice_re": v})
    found = one.outputs(at_rectifier(v), x)
    assert found["q"] * 1200 == pytest.approx(beside - now)
    assert found["p"] * 1200 == pytest.approx(-V * current)


@pytest.mark.parametrize("frequency", [0.05, 0.5, 3.0])
@pytest.mark.parametrize("mode", [1, 2])
def test_a_held_power_follows_the_inverters_angle_by_its_transfer_function(frequency, mode):
    """dI·V = −I·dV_measured, with dV = dE − drop·dI at a held angle, and R·dI_measured at the rectifier."""
    one, s = rectifier(mode=mode, TVDC=0.08, TIDC=0.03), 2j * math.pi * frequency
    p, current = one.parameters, one.parameters["I_dc_0"]
    drive = p["V_dc_0"] + drop(FAR) * current  # which the angle of the start gives
    u = at_rectifier(drive=drive, holds=0.0)
    R = p["R_dc"] if mode == 1 else 0.0
    by_voltage, by_current = 1 / (1 + 0.08 * s), R / (1 + 0.03 * s)
    gain = current / (p["V_dc_0"] + R * current)
    wanted = -gain * by_voltage / (1 - gain * (drop(FAR) * by_voltage - by_current))
    found = one.response(s, u)
    assert found["I_dc", "inverter.V_most"] == pytest.approx(wanted, rel=1e-9)
    assert found["V_inverter", "inverter.V_most"] == pytest.approx(1 - drop(FAR) * wanted, rel=1e-6)


def test_a_held_current_does_not_follow():
    found = rectifier(mode=0).response(2j, at_rectifier(holds=0.0, drive=DRIVE - 20))
    assert found["I_dc", "inverter.V_most"] == pytest.approx(0, abs=1e-12)


QUIET = {"VBLOCK": 0.0, "VBYPAS": -1.0}
EVENTS = {
    "the inverter's angle": (QUIET, {"drive": 0.9}),
    "the inverter's angle, deep": (QUIET, {"drive": 0.45}),
    "the inverter's bus is gone": (QUIET, {"drive": 0.0}),
    "the rectifier's angle": (QUIET, {"v": 0.92}),
    "the rectifier's angle, between": (QUIET | {"DELTI": 0.5}, {"v": 0.92}),
    "the rectifier's angle and its margin": (QUIET, {"v": 0.7}),
    "the rectifier's bus nearly gone": (QUIET, {"v": 0.1}),
    "a higher voltage": (QUIET, {"v": 1.1, "drive": 1.05, "holds": 0.0}),
    "a current is held": (QUIET | {"mode": 0}, {"drive": 0.6}),
    "the inverter's power is held": (QUIET | {"mode": 2}, {"drive": 0.8}),
    "compounding": (QUIET | {"RCOMP": 8.0}, {"drive": 0.85, "v": 0.95}),
    "a current in the place of a power": (QUIET | {"VCMOD": 470.0}, {"drive": 0.85}),
    "a held angle": (QUIET, {"drive": 0.95, "holds": 0.0}),
    "blocked": ({}, {"v": 0.3}),
    "blocked for longer": ({"TBLOCK": 0.3}, {"v": 0.3}),
    "bypassed": ({}, {"drive": 0.2, "far_v": 0.2}),
    "bypassed for longer": ({"TBYPAS": 0.25}, {"drive": 0.2, "far_v": 0.2}),
    "no ramp": ({"VRAMP": 0.0, "CRAMP": 0.0}, {"v": 0.3}),
}
AT = (0.08, 0.12, 0.19, 0.3, 0.45, 0.6)
SLOW = 1e-3
"""Step of the model's integration [s]."""

DIP = (0.05, 0.2)
"""Begin and end of what happens [s]."""

CLOSE = 2e-3
"""Difference of both integrations, of the values at the start: an order moves by 1/TVDC in a second, and a step of
Euler's method is 0.1 ms."""

LATE = 6e-3
"""Delay by which a ramp may begin later [s]: three latches of the model in its steps of 1 ms."""

LATE_BY_MESSAGE = 8e-3
"""The same with a message, which is a latch as well [s]."""


DELAYED = {
    "blocked at once": ({}, {"v": 0.3}),
    "blocked in time": ({}, {"v": 0.68}),
    "not for long enough": ({"TRB": 0.2}, {"v": 0.68}),
    "asked by the inverter": ({"TCOM": 0.04}, {"far_v": 0.1}),
    "asked for a moment": ({"TCOM": 0.2, "VIY": 0.0, "VBYPAS": -1.0}, {"far_v": 0.1}),
    "back behind the rectifier's time": ({"TRUB": 0.12}, {"v": 0.3}),
    "back behind the inverter's time": ({"TIUB": 0.1, "TCOM": 0.05}, {"v": 0.3, "far_v": 0.7}),
    "bypassed at once": ({}, {"drive": 0.2, "far_v": 0.3}),
    "bypassed in time": ({"VBYPAS": -1.0}, {"drive": 0.6, "far_v": 0.4}),
    "not bypassed": ({"VBYPAS": -1.0, "TIY": 0.2}, {"drive": 0.6, "far_v": 0.4}),
    "a bypass that ends late": ({"TIUY": 0.1}, {"drive": 0.2, "far_v": 0.3}),
    "blocked while bypassed": ({"VBYPAS": -1.0, "TRB": 0.1}, {"far_v": 0.4, "v": 0.68}),
}
"""What CDC6T does behind its times, and at once."""


@pytest.mark.parametrize("kind", EVENTS)
def test_it_moves_as_its_equations_by_hand(kind):
    own, change = EVENTS[kind]
    one = rectifier(**own)
    _compare(one, Line(one.parameters, POINT["v_0"]), change, LATE if "VBLOCK" not in own else 0)


@pytest.mark.parametrize("kind", DELAYED)
def test_with_delays_it_moves_as_its_equations_by_hand(kind):
    own, change = DELAYED[kind]
    one = delayed(**own)
    line = DelayedLine(one.parameters, POINT["v_0"])
    found = _compare(one, line, change, LATE_BY_MESSAGE)
    changes = [
        (name, SLOW * k)
        for name in ("blocked", "bypassed")
        for k, (first, then) in enumerate(pairwise(row[name] for row in found), 2)
        if first != then
    ]
    wanted = sorted(line.changes)
    assert bool(wanted) == (not kind.startswith("not "))
    assert [name for name, _ in changes] == [name for name, _ in wanted]
    late = np.array([t for _, t in changes]) - [t for _, t in wanted]
    assert np.all((late >= -SLOW) & (late <= LATE_BY_MESSAGE)), (changes, wanted)


def _compare(one, line, change, late):
    """Integrate a model and a line by hand through a change, and return the model's outputs."""
    rest = {"v": POINT["v_0"], "drive": 1.0, "far_v": FAR["v"], "holds": change.get("holds", 1.0)}
    if not rest["holds"]:  # at the angle of the start
        p = one.parameters
        rest["drive"] = (p["V_dc_0"] + drop(FAR) * p["I_dc_0"]) / DRIVE

    def now(t):
        return rest | (change if DIP[0] <= t < DIP[1] else {})

    def inputs(t):
        at = now(t + 1e-9)
        return at_rectifier(at["v"], at["drive"] * DRIVE, at["far_v"], at["holds"])

    found, _ = integrated(one, inputs, max(AT), step=SLOW)
    wanted = []
    for k in range(round(max(AT) / STEP)):
        t = k * STEP
        at = now(t)
        far = (at["drive"] * DRIVE, drop(FAR))
        wanted.append(line.step(t, at["v"], far, at["far_v"], holds=at["holds"] > 0))
    I_0, V_0 = one.parameters["I_dc_0"], one.parameters["V_dc_0"]
    for time in AT:
        row = found[round(time / SLOW) - 1]
        first = time - late
        here = np.array(wanted[round(first / STEP) - 1 : round(time / STEP)])
        low, high = here.min(axis=0), here.max(axis=0)
        for name, k, size in (("I_dc", 0, I_0), ("V_inverter", 1, V_0)):
            assert low[k] - CLOSE * size <= row[name] <= high[k] + CLOSE * size, (time, name)
        if low[0] > 0:
            least, most = (math.degrees(x) for x in (low[2], high[2]))
            assert least - 2.0 <= row["alpha"] <= most + 2.0, time
    moved = max(abs(row["V_inverter"] / V_0 - 1) + abs(row["I_dc"] / I_0 - 1) for row in found)
    assert moved > 0.02, "a trajectory that does not leave its start shows nothing"
    return found


def test_the_margin_keeps_the_current_the_inverter_then_holds():
    """At rest behind a low bus of the rectifier: (1 − Δ) of the order, and the voltage that α_min leaves."""
    one = rectifier(mode=0, DELTI=0.15, **QUIET)
    found, _ = integrated(one, lambda t: at_rectifier(v=0.8), 1.0)
    p, last = one.parameters, found[-1]
    assert last["I_dc"] == pytest.approx(0.85 * p["I_dc_0"])
    most = no_load(p, 0.8) * math.cos(math.radians(p["ALFDY"]))
    left = most - (drop(p) + p["R_dc"]) * last["I_dc"]
    assert last["V_inverter"] == pytest.approx(left)
    assert last["alpha"] == pytest.approx(p["ALFDY"])


@pytest.mark.parametrize(("dip", "blocks"), [(0.65, False), (0.601, False), (0.59, True)])
def test_a_dip_blocks_the_line_where_it_goes_below_vblock(dip, blocks):
    """The voltage that the control sees goes 13.5 % of the dip beyond it: 0.60 pu in one to 0.65 pu."""
    one = rectifier(VBLOCK=0.6, VUNBL=0.7, VBYPAS=-1.0)
    found, _ = integrated(one, lambda t: at_rectifier(dip if t >= 0.01 else POINT["v_0"]), 0.06)
    assert any(row["blocked"] for row in found) == blocks


@pytest.mark.parametrize(("rise", "back"), [(0.69, False), (0.71, True)])
def test_a_blocked_line_comes_back_where_its_bus_rises_above_vunbl(rise, back):
    one = rectifier(VBLOCK=0.6, VUNBL=0.7, VBYPAS=-1.0, TBLOCK=0.02)

    def at(t):
        return at_rectifier(POINT["v_0"] if t < 0.01 else 0.4 if t < 0.05 else rise)

    found, _ = integrated(one, at, 0.1)
    assert found[45]["blocked"] == 1
    assert (found[-1]["blocked"] == 0) == back


def test_a_breaker_that_opens_blocks_the_line():
    one = rectifier(connected=False)
    found = one.outputs(at_rectifier())
    assert found["inverter_I"] == found["I_dc"] == found["p"] == 0
    assert found["blocked"] == 1


def test_behind_an_open_breaker_an_inverter_tells_of_no_voltage():
    found = inverter(connected=False).outputs([0.99, 0.0, 2.0, 490.0])
    assert found["V_most"] == found["v"] == found["p"] == 0


def test_a_bypassed_inverter_draws_nothing():
    """The line's current flows past its bridges."""
    one = rectifier()
    found, _ = integrated(one, lambda t: at_rectifier(drive=0.1 * DRIVE, far_v=0.1), 0.1)
    last = found[-1]
    assert last["bypassed"] == 1
    assert last["I_dc"] > 1
    assert last["inverter_I"] == 0
    quiet = inverter(Q_0=-0.3).outputs([0.99, 0.0, last["inverter_I"], last["inverter_V"]])
    assert quiet["p"] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("holds", [False, True])
def test_an_inverter_gives_at_most_the_voltage_of_its_least_angle(holds):
    two = inverter(holds_angle=holds, P_0=0.9 * 490 * 2 / 1200, V_dc_0=441.0)
    p, V = two.parameters, 480.0
    current = p["P_0"] * 1200 / 441.0
    found = two.outputs([0.99, 0.0, current, V])
    least = math.degrees(math.acos((441 + drop(p) * current) / no_load(p, 0.99)))
    angle = least if holds else p["GAMDY"]
    most = no_load(p, 0.99) * math.cos(math.radians(angle)) - drop(p) * current
    assert found["p"] * 1200 == pytest.approx(min(V, most) * current)
    assert found["V_most"] == pytest.approx(most + drop(p) * current)
    assert found["beyond"] == (1e4 if holds else 0)


@pytest.mark.parametrize(("own", "rate"), [({"CRAMP": 0.0}, 250.0), ({"CRAMP": 4.0}, 4.0)])
def test_a_current_comes_back_by_its_ramp_or_within_the_time_of_a_switch(own, rate):
    """From the half of its order: 0.5 / 2 ms without a ramp."""
    one = rectifier(**own)
    (ramp,) = (name for name in one.states if name.endswith("of_current"))
    half = one.vector(one.states | {ramp: 0.5})
    assert one.rates(at_rectifier(), half)[ramp] == pytest.approx(rate)


def test_limits_let_the_operating_point_pass():
    """Less than the start's angle, and a limit of the current below the start's, do not move it."""
    one = rectifier(ALFDY=40.0, C3=900.0, C2=800.0, C1=700.0)
    rates = one.rates(at_rectifier())
    assert max(map(abs, rates.values())) < 1e-10
    assert one.outputs(at_rectifier())["p"] == pytest.approx(-0.75)


@pytest.mark.parametrize(
    ("make", "values", "text"),
    [
        (lcc_rectifier_phasor, {"P_0": 0.5}, "a rectifier draws power"),
        (lcc_rectifier_phasor, {"v_0": 0.8}, "the rectifier cannot drive its current"),
        (lcc_rectifier_phasor, {"V2": 150.0}, "V2 must exceed"),
        (lcc_inverter_phasor, {"P_0": -0.5}, "an inverter feeds power"),
        (lcc_inverter_phasor, {"v_0": 0.8}, "the inverter cannot give its voltage"),
    ],
)
def test_what_cannot_start_is_refused(make, values, text):
    assert any(text in found for found in refused(Evaluated(make(), values)))


def test_a_rectifier_of_another_record_is_refused():
    with pytest.raises(ValueError, match="records = 'CDC1T': write CDC4T or CDC6T"):
        lcc_rectifier_phasor("CDC1T")


def test_delays_rest_at_the_start_and_move_nothing_in_service():
    """Its modes are CDC4T's: the same rates of what both have, and no state of a delay that moves."""
    plain, waiting = rectifier(), delayed()
    for v in (1.02, 0.97):
        own, more = plain.rates(at_rectifier(v)), waiting.rates(at_rectifier(v))
        assert own == {name: more[name] for name in own}
        assert not any(value for name, value in more.items() if name not in own)
    assert plain.outputs(at_rectifier()) == waiting.outputs(at_rectifier())


def test_nothing_of_the_output_follows_the_bus_voltage_at_once():
    """The emf is of states alone, so that a network has no algebraic loop."""
    for one, bus in ((rectifier(), at_rectifier()), (inverter(), [0.99, 0.0, 2.0, 490.0])):
        D = one.blocks(bus)[3]
        outputs = [v.name for v in one.model.outputs]
        assert not np.any(D[[outputs.index("e_re"), outputs.index("e_im")], :2])
