"""States of DC lines and converters beside those that PSS/E itself stored in solved files of others.

Sources: the IEEE 300-bus case (University of Illinois), whose DC line joins buses 119 and 120; PSS/E's sample case of
revision 34; and an IEEE 14-bus case with DC lines in VeraGrid's repository.  What converters feed there is the rest of
the power at their buses by the voltages and the network in the file."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest

from orchestrator.cases.networks.psse.bridges import Bridges
from orchestrator.cases.networks.psse.multi_terminal import MultiTerminal, Terminal
from orchestrator.cases.networks.psse.two_terminal import TwoTerminal
from orchestrator.cases.networks.psse.vsc_lines import Converter, VscLine


def bridges(count, x, base, ratio, tap, least, most, capacitor=0.0):
    angles = math.radians(least), math.radians(most)
    return Bridges(count, x, capacitor, base, ratio / tap, *angles)


def line(setting, r, scheduled, compounding, ends, least=0.0):
    return TwoTerminal(
        "two-terminal dc",
        1,
        "DC",
        place="solved.raw",
        mode=1,
        r_ohm=r,
        setting=setting,
        scheduled_kv=scheduled,
        least_kv=least,
        compounding_ohm=compounding,
        margin=0.1,
        buses=(1, 2),
        bridges=ends,
    )


IEEE_300 = line(
    -100.0,
    6.2,
    460.0,
    0.0,
    (
        bridges(4, 6.8, 115.0, 0.7478, 0.99365, 15, 20),
        bridges(4, 6.8, 115.0, 0.7478, 0.935, 20, 18),
    ),
)
AT_LEAST_ANGLE = line(
    30.0,
    6.44,
    250.0,
    0.0,
    (
        bridges(1, 1.0, 138.0, 0.525, 0.47775, 10, 40),
        bridges(1, 1.0, 138.0, 0.9384, 0.85394, 10, 40),
    ),
)
WITH_CAPACITORS = line(
    1490.65,
    7.8543,
    525.0,
    3.942,
    (
        bridges(2, 3.88, 500.0, 0.44, 1.06275, 7.5, 13, 2.0034),
        bridges(2, 3.047, 230.0, 0.95652, 1.075, 18.5, 21, 2.0),
    ),
    400.0,
)
COMPOUNDED = line(
    1500.0,
    8.2,
    525.0,
    4.1,
    (
        bridges(2, 3.88, 500.0, 0.44, 1.0545, 8, 12, 0.0098),
        bridges(2, 3.047, 230.0, 0.95652, 1.0625, 18, 20, 0.0074),
    ),
    400.0,
)


def fed(device, voltages):
    return [ending.fed for ending in device.endings(voltages)]


def test_the_dc_line_of_the_ieee_300_bus_case():
    """The file's voltages have five digits, which leave 0.05 MW at these buses."""
    one, other = fed(IEEE_300, {1: 1.0435, 2: 0.99819})
    assert one == pytest.approx(-100.285 - 34.374j, abs=0.05)
    assert other == pytest.approx(99.995 - 40.247j, abs=0.05)


def test_a_rectifier_at_its_least_angle_carries_the_power_at_a_lower_voltage():
    """250 kV are scheduled, and the transformers give 174: PSS/E lets the current rise (its margin is 0 there)."""
    one, other = fed(replace(AT_LEAST_ANGLE, margin=0.0), {1: 0.86305, 2: 0.93574})
    assert one == pytest.approx(-30.0 - 5.453j, abs=0.005)
    assert other == pytest.approx(29.809 - 14.2955j, abs=0.005)


def test_a_line_at_its_least_angle_gives_way_by_its_margin():
    (one, _) = fed(AT_LEAST_ANGLE, {1: 0.86305, 2: 0.93574})
    assert one.real == pytest.approx(-27.0, abs=1e-6)


SHANDONG = replace(
    line(
        4000.0,
        3.51,
        800.0,
        0.0,
        (
            bridges(2, 3.8579, 525.0, 0.5714, 0.925, 15, 90),
            bridges(2, 3.8579, 1050.0, 0.2857, 0.95, 15, 90),
        ),
        least=500.0,
    ),
    margin=0.15,
)
"""A line of the 133-bus system of Shandong University, at its buses' voltages."""


def test_both_angles_at_their_least_settle_between_the_order_and_its_margin():
    """With bridges alike the overlaps cancel: R·I is the difference of both ends' voltages at no load."""
    device, voltages = SHANDONG, {1: 0.99509, 2: 1.00171}
    no_load = 2 * 3 * math.sqrt(2) / math.pi * math.cos(math.radians(15))
    ends = (
        no_load * 0.99509 * 525.0 * 0.5714 / 0.925,
        no_load * 1.00171 * 1050.0 * 0.2857 / 0.95,
    )
    pole = device.pole(voltages)
    assert pole.current == pytest.approx((ends[0] - ends[1]) / 3.51, rel=1e-9)
    assert 0.85 < pole.current * pole.rectifier_kv / 4000.0 < 1.0
    (said,) = device.doubts(voltages)
    assert said.startswith("it carries 38")
    assert "its taps are held, where PSS/E moves them" in said


def test_a_line_gives_way_without_a_jump():
    """From the whole order to that without its margin, as the rectifier's voltage falls."""
    falling = [SHANDONG.pole({1: 0.996 - 1e-4 * k, 2: 1.00171}).current for k in range(60)]
    assert falling[0] * 806 == pytest.approx(4000.0, rel=0.01)
    assert falling[-1] < 0.88 * falling[0]
    assert max(abs(a - b) for a, b in pairwise(falling)) < 0.03


def test_converters_with_commutating_capacitors_draw_what_psse_says():
    """Both lines of the sample case begin at one bus, which lacks 898.629 Mvar in its solution."""
    v = {1: 1.0, 2: 1.0}
    (first, far), (second, last) = fed(WITH_CAPACITORS, v), fed(COMPOUNDED, v)
    assert first + second == pytest.approx(-2990.652 - 898.629j, abs=0.01)
    assert last == pytest.approx(1435.891 - 615.643j, abs=0.05)
    assert far.real == pytest.approx(1429.876, abs=0.01)


@pytest.mark.parametrize("angle", [8.0, 15.0, 25.0])
def test_a_small_capacitor_changes_little(angle):
    plain = bridges(2, 4.0, 230.0, 0.9, 1.0, 10, 20)
    small = bridges(2, 4.0, 230.0, 0.9, 1.0, 10, 20, 1e-6)
    kilovolts = plain.voltage(1.0, 2.0, math.radians(angle))
    assert small.voltage(1.0, 2.0, math.radians(angle)) == pytest.approx(kilovolts, rel=1e-5)
    assert small.reactive(1.0, 2.0, kilovolts) == pytest.approx(
        plain.reactive(1.0, 2.0, kilovolts), rel=1e-5
    )


def test_four_terminals_of_the_sample_case():
    rectifier = bridges(4, 19.0, 500.0, 0.22, 1.01, 8, 10)
    terminals = (
        Terminal(402, 3, rectifier, 321.0),
        Terminal(401, 1, rectifier, 321.0),
        Terminal(212, 2, bridges(4, 10.0, 230.0, 0.452, 1.04, 18, 20), 500.0),
        Terminal(213, 4, bridges(4, 10.0, 230.0, 0.452, 1.1, 18, 20), -303.8),
    )
    links = tuple((k, 5, 29.0) for k in (1, 2, 3, 4))
    network = MultiTerminal(
        "multi-terminal dc",
        1,
        "M",
        place="solved.raw",
        mode=1,
        terminals=terminals,
        holding=2,
        links=links,
        earths=(),
    )
    found = fed(network, {402: 1.0, 401: 1.0, 212: 1.02695, 213: 1.10677})
    wanted = [-321 - 142.325j, -321 - 142.325j, 296.38 - 140.965j, 303.80 - 159.656j]
    assert found == [pytest.approx(value, abs=0.06) for value in wanted]


def converter(bus, kind, mode, dc, ac, losses):
    limits = (0.0, 0.0, 100.0, -100.0, False, 230.0)
    a, b, least = losses
    return Converter(bus, kind, mode, dc, ac, a / 1000, b, least / 1000, *limits)


@pytest.mark.parametrize(
    ("r", "power", "volts", "losses", "wanted"),
    [
        # the third figure of each with what the bus beside it lacks, behind an almost ideal switch
        (0.71, -209.0, 100.0, ((100.0, 0.1, 50.0), (90.0, 0.15, 40.0)), 205.296),
        (0.35, -100.0, 100.0, ((100.0, 0.15, 123.0), (93.0, 0.12, 98.0)), 99.185),
        (5.32, -100.0, 640.0, ((1161.0, 3.08, 0.0), (1161.0, 3.08, 0.0)), 96.607),
    ],
)
def test_voltage_source_converters_lose_what_psse_says(r, power, volts, losses, wanted):
    ends = (
        converter(1, 2, 2, power, 0.95, losses[0]),
        converter(2, 1, 1, volts, 1.0, losses[1]),
    )
    vsc = VscLine("vsc dc line", 1, "V", place="solved.raw", r_ohm=r, converters=ends)
    assert vsc.powers()[0] == power
    assert vsc.powers()[1] == pytest.approx(wanted, abs=0.01)
    assert fed(vsc, {1: 1.0, 2: 1.0})[0].imag == pytest.approx(power * 0.328684, rel=1e-5)


def test_one_bridge_is_known_where_the_record_has_its_transformer():
    assert bridges(1, 0.1, 0.69, 0.5, 1.0, 10, 40).is_known
    assert not any(
        bridges(count, 0.1, base, ratio, 1.0, 10, 40).is_known
        for count, base, ratio in ((0, 0.69, 0.5), (1, 0.0, 0.5), (1, 0.69, 0.0))
    )
