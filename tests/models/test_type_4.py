"""WT4G1 and WT4E1: a trace of PSS/E, single values, and limits."""

import numpy as np
import pytest

from fmus.wecc_renewable import type_4
from fmus.wecc_renewable.composed import wecc_plant_phasor
from tests.models.parts import refused
from tests.models.two_buses import TwoBuses
from tests.support.evaluated import Evaluated

FLOW = 0.5, 0.1, 1.02  # P, Q [pu, S_n] and |v| [pu]
AT_BUS = 0.998746037483, np.radians(-0.160414204001)  # of the trace's start
CONVERTER = "0.027 0.019 0.37 0.93 1.07 1.23 1.80 1.70 0.031"
CONTROL = """0 1 0 0.12 15.0 4.0 0.08 0.30 0.02 0.07 0.45 -0.45 1.10 0.02 0.40 -0.40 0.05 0.10 0.88 1.12 30.0 0.05 0.05
1.25 1.12 1.08"""


def of_record(lines, fields):
    return dict(zip([line.name for line in lines], map(float, fields.split()), strict=True))


def turbine(flow=FLOW, angle=0.3, **more):
    """Our turbine at an operating point; ``more``: values by the parameters' names, __ for a dot."""
    values = of_record(type_4.CONVERTER, CONVERTER)
    own = of_record(type_4.CONTROL, CONTROL)
    values |= {f"electrical.{name}": value for name, value in own.items()}
    values |= dict(zip(("P_0", "Q_0", "v_0"), flow, strict=True))
    values |= {"theta_0": angle, "S_n": 100.0, "f_n": 60.0, "bus_voltage.tau": 1e-3}
    more = {name.replace("__", "."): value for name, value in more.items()}
    return Evaluated(wecc_plant_phasor("WT4G1 WT4E1"), values | more)


STATES = ("I_p", "I_q", "lvpl_voltage", "electrical.order", "electrical.integral")
STATES += ("electrical.power_integral", "electrical.power_fed_back", "electrical.voltage")
STATES += ("electrical.P_filtered", "electrical.voltage_asked", "electrical.I_q_asked")
STATES += ("electrical.straight",)
TRACE = {
    0.075: """0.542704 0.034075 0.926935 0.027068 0.005605 -8.281e-5 -8.215e-5 0.906303 0.482162 0.998738 0.097502
0.352735 0.871444""",
    0.125: """0.510746 0.151207 0.965426 0.170094 0.007235 -2.2358e-4 -1.5799e-4 0.980864 0.506547 0.998766 0.174903
0.824656 1.021554""",
    0.250: """0.491509 0.110190 1.016960 0.099537 -0.000983 -4.083e-5 2.332e-5 1.017106 0.500862 0.999428 0.095742
-0.190676 1.015517""",
    0.500: """0.498409 0.025877 1.003796 -0.128983 -0.011437 -5.778e-5 -2.095e-5 1.003376 0.499698 0.996060 0.020091
-0.099257 1.002686""",
    1.000: """0.502799 -0.027878 0.994645 0.024517 -0.009419 -7.579e-5 -2.195e-5 0.994585 0.500016 0.994042 -0.028448
0.057632 0.994504""",
}
"""PSS/E's states and voltage at the bus after a fault behind j1 pu from 50 to 100 ms, by the time [s]; from InterPSS'
`Wt4e1PsseSmibConformanceTest` and its SMIB_v33_wt4e1.dyr."""
FED_BACK = STATES.index("electrical.power_fed_back")
WITHIN = np.where([name.startswith("electrical.power_") for name in (*STATES, "v")], 0.03, 0.01)
"""Share of each swing by which ours may differ: the regulator of the power moves little, by 2·10⁻⁴ pu."""


def test_it_is_the_trace_of_pss_e():
    """PSS/E's state of the rate feedback is Kf/Tf times ours."""
    ours = turbine((0.5, 0.0, AT_BUS[0]), AT_BUS[1])
    start = AT_BUS[0] * np.exp(1j * AT_BUS[1])
    network = TwoBuses(ours, start, 0.5)
    assert abs(network.voltage(ours.x) - start) < 1e-6
    found = network.through_fault(1j, 5e-4, TRACE)
    wanted = {t: np.array(row.split(), float) for t, row in TRACE.items()}
    swing = np.ptp(list(wanted.values()), axis=0)
    assert {*found} == {*wanted}
    for t, (at, v) in found.items():
        own = np.array([*(at[name] for name in STATES), abs(v)])
        own[FED_BACK] *= 0.02 / 0.07
        assert (np.abs(own - wanted[t]) < WITHIN * swing).all(), t


def at_rest(ours, v=FLOW[2], **moved):
    """Outputs and rates with states elsewhere than at rest."""
    x = ours.vector(ours.states | {name.replace("__", "."): value for name, value in moved.items()})
    bus = v * np.exp(0.3j)
    return ours.outputs([bus.real, bus.imag], x), ours.rates([bus.real, bus.imag], x)


@pytest.mark.parametrize("flags", [(0, 1, 0), (0, 0, 0), (1, 0, 1)])
def test_it_rests_at_the_operating_point_and_is_linear_there(flags):
    names = ("electrical__PFAFLG", "electrical__VARFLG", "electrical__PQFLAG")
    ours = turbine(**dict(zip(names, flags, strict=True)))
    assert not refused(ours)
    outputs, rates = at_rest(ours)
    assert (outputs["p"], outputs["q"]) == pytest.approx(FLOW[:2], abs=1e-12)
    assert max(map(abs, rates.values())) < 1e-9
    for name, value in ours.states.items():
        up, down = (at_rest(ours, **{name: value + side * 3e-5})[1] for side in (1, -1))
        for state, rate in up.items():
            assert rate == pytest.approx(-down[state], rel=1e-3, abs=1e-6), (name, state)


def test_reactive_power_is_constant_or_follows_the_power_factor():
    for flag, rate in ((0, 0.0), (1, 0.1 * (0.6 * 0.2 - 0.1))):
        ours = turbine(electrical__VARFLG=0, electrical__PFAFLG=flag)
        _, rates = at_rest(ours, electrical__power=0.6)
        assert rates["electrical.voltage_asked"] == pytest.approx(rate, abs=1e-9)


def test_the_rate_feedback_slows_the_control_of_power():
    """With Kf = 0.7: Kf/Tf = 10, and Kpp = 0.08 becomes 0.08/1.8 at once."""
    ours = turbine(electrical__Kf=0.7)
    outputs, rates = at_rest(ours, electrical__P_filtered=0.6)
    taken = 0.08 * 0.1 / 1.8
    assert outputs["I_p_command"] == pytest.approx((0.5 - taken) / 1.02)
    assert rates["electrical.power_integral"] == pytest.approx(0.3 * (0.1 - 10 * taken))
    assert rates["electrical.power_fed_back"] == pytest.approx(taken / 0.07)
    outputs, _ = at_rest(turbine(), electrical__P_filtered=9.0)
    assert outputs["I_p_command"] == pytest.approx((0.5 - 0.4) / 1.02)  # dPMX


def test_the_limiter_gives_one_current_first():
    more = {"electrical__QMX": 1.1, "electrical__delta_Pref": 0.5}
    first, _ = at_rest(turbine(electrical__PQFLAG=0, **more), electrical__I_q_asked=1.2)
    assert first["I_q_command"] == pytest.approx(1.08)  # Iqhl
    assert first["I_p_command"] == pytest.approx(np.sqrt(1.25**2 - 1.08**2))
    then, _ = at_rest(turbine(electrical__PQFLAG=1, **more), electrical__I_q_asked=1.2)
    assert then["I_p_command"] > 0.9
    assert np.hypot(then["I_p_command"], then["I_q_command"]) == pytest.approx(1.25)
    held, _ = at_rest(turbine(), electrical__I_q_asked=1.2)
    assert held["I_q_command"] == pytest.approx(0.45)  # QMX at 1 pu and above
    low, _ = at_rest(turbine((0.3, 0.1, 0.9)), 0.9, electrical__I_q_asked=1.2)
    assert low["I_q_command"] == pytest.approx(0.45 + 0.1 * (1.6 - 0.45))


def test_low_and_high_voltage_take_current_off():
    low, _ = at_rest(turbine(), I_p=0.9, lvpl_voltage=0.65)
    assert low["I_p_fed"] == pytest.approx(1.07 * (0.65 - 0.37) / (0.93 - 0.37))
    ours = turbine((0.3, 0.1, 1.3))
    assert ours.states["I_q"] == pytest.approx((0.1 + 1.3 - 1.23) / 1.3)
    assert at_rest(ours, 1.3)[0]["q"] == pytest.approx(0.1)
    assert at_rest(ours, 1.3, I_q=-3.0)[0]["I_q_fed"] == pytest.approx(-1.8 / 1.3)  # CURHVRCR
    gained = turbine((0.3, 0.0, 0.6))
    assert gained.states["I_p"] == pytest.approx(0.3 / 0.6 / 0.5)  # half of it is fed at 0.6 pu


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"electrical__QMX": 0.05}, "electrical.QMX: the power flow asks for more"),
        ({"electrical__VMAXCL": 1.0}, "electrical.VMAXCL"),
        ({"electrical__IPMAX": 0.4}, "more current than electrical.IPMAX"),
        ({"electrical__Iqhl": 0.05}, "more current than electrical.IPMAX"),
        ({"VLVPL2": 0.3}, "VLVPL2 must not lie below VLVPL1"),
        ({"VLVPL2": 1.1, "GLVPL": 0.4}, "than LVPL allows"),
    ],
)
def test_an_operating_point_beyond_a_limit_is_refused(more, said):
    assert any(said in text for text in refused(turbine(**more)))


@pytest.mark.parametrize("records", ["WT4G1", "WT4G1 REECA1", "WT4G1 WT4E1 REPCA1"])
def test_its_records_go_together(records):
    with pytest.raises(ValueError, match="WT4G1 WT4E1 go together and nothing else"):
        wecc_plant_phasor(records)
