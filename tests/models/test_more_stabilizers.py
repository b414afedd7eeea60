"""PSS1A of all signals, PSS2C, PSS3B, PSS4B and IEE2ST: diagrams by hand, and what cuts them off."""

import numpy as np
import pytest

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from fmus.synchronous_generator.parts import GOVERNORS, chosen_parts
from tests.models.parts import (
    AT_BUS,
    AT_REST,
    BUS,
    OF_VOLTAGE,
    V_T,
    governor,
    integrated,
    refused,
    stabilizer,
)
from tests.models.test_part_stabilizers import ONE, TWO
from tests.models.test_psse_parts import HERTZ, lead
from tests.support.evaluated import Evaluated

AT = AT_REST["pss"]
ADDED = ("pss2c", "pss3b", "pss4b", "iee2st")


def washout(p, s, name):
    return s * p[name] / (1 + s * p[name])


ALL = ("speed", "power", "v_t", "phase", "P_m")
"""What a stabiliser sees: w − 1, P_e, |v|, the angle over ω_b, whose derivative is the frequency, and P_m."""


def of_signal(signal, s, T_f):
    """Transfer functions from what is seen to one of PSS/E's signals."""
    derivative = s / (1 + s * T_f)
    by_number = {
        0: {},
        1: {"speed": 1},
        2: {"phase": derivative},
        3: {"power": 1},
        4: {"P_m": 1, "power": -1},
        5: {"v_t": 1},
        6: {"v_t": derivative},
    }
    return {seen: by_number[signal].get(seen, 0) for seen in ALL}


def responses(name, values, s):
    alone = stabilizer(name, values, sees_all=True)
    assert not refused(alone)
    rest = [*AT, V_T, 0.0, 0.8]
    assert max(map(abs, alone.rates(rest).values())) < 1e-12
    return alone.response(s, rest)


@HERTZ
@pytest.mark.parametrize("signal", range(1, 7))
@pytest.mark.parametrize("name", ["pss1a", "ieeest"])
def test_a_stabiliser_of_one_signal_takes_each_of_six(name, signal, hertz):
    s, p = 2j * np.pi * hertz, ONE | {"signal": signal, "T_f": 0.025}
    p |= {"T_6": 1.3} if name == "ieeest" else {}
    wanted = lead(p, s, "T_1", "T_2") * lead(p, s, "T_3", "T_4") * p["K_S"] * s * p["T_5"]
    wanted /= 1 + s * p["T_6"]
    wanted /= 1 if name == "ieeest" else 1 + s * p["T_5"]
    response = responses(name, p, s)
    for seen, share in of_signal(signal, s, p["T_f"]).items():
        assert response["v_s", seen] == pytest.approx(wanted * share, rel=1e-9, abs=1e-12)


@HERTZ
@pytest.mark.parametrize(("first", "second"), [(2, 4), (6, 2), (4, 5), (0, 6), (3, 0)])
@pytest.mark.parametrize("name", ["st2cut", "iee2st", "pss3b", "pss2a", "pss2c"])
def test_a_stabiliser_of_two_signals_takes_each_of_six_or_none(name, first, second, hertz):
    """What it makes of its usual two signals, it makes of any others in their place."""
    s = 2j * np.pi * hertz
    p = {"T_1": 0.02, "T_2": 0.05}
    p |= {"K_1": 8.0, "K_2": 0.4, "T_3": 2.0} if name in ("st2cut", "iee2st") else {}
    p |= {"K_S1": 0.4, "K_S2": 4.0} if name == "pss3b" else {}
    usual = responses(name, p | {"signal_1": 1, "signal_2": 3}, s)
    found = responses(name, p | {"signal_1": first, "signal_2": second, "T_f": 0.03}, s)
    one, other = (of_signal(number, s, 0.03) for number in (first, second))
    for seen in ALL:
        wanted = usual["v_s", "speed"] * one[seen] + usual["v_s", "power"] * other[seen]
        assert found["v_s", seen] == pytest.approx(wanted, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("signal", [0, 1.4, 5.5])
def test_a_number_that_is_no_signal_is_refused(signal):
    alone = stabilizer("st2cut", {"signal_1": signal}, sees_all=True)
    assert [text for text in refused(alone) if "signal" in text] == (
        [] if signal == 0 else ["pss.signal_1 must be a whole number"]
    )


FACTORIES = pytest.mark.parametrize(
    "factory", [synchronous_generator, synchronous_generator_phasor]
)


@FACTORIES
@pytest.mark.parametrize("signal", [2, 4, 6])
def test_a_generator_with_a_derived_signal_starts_in_steady_state(factory, signal):
    """Behind a transformer and with the angle of its voltage near 180°, where an angle of a phasor jumps."""
    for angle in (-0.4, 3.1):
        at = AT_BUS | {"theta_0": angle, "transformer.X_t": 0.1, "pss.signal": signal}
        made = factory(exciter="st1a", governor="tgov1", stabilizer="ieeest")
        device, bus = Evaluated(made, at), 1.02 * np.exp(1j * angle)
        assert not refused(device)
        at_rest = max(map(abs, device.rates([bus.real, bus.imag]).values()))
        assert (
            at_rest < 1e-6
        )  # [1/s]: a derivative and the regulator's gain raise the rounding of a voltage


def test_the_signal_of_a_turning_voltage_is_its_frequency():
    """A voltage that turns 0.3 Hz faster than 50 Hz: 0.006 pu behind the filter and the washout."""
    p = {"signal": 2, "K_S": 1.0, "V_STMAX": 1.0} | dict.fromkeys(("T_1", "T_2", "T_3", "T_4"), 0.0)
    alone, end = stabilizer("ieeest", p, sees_all=True), 0.4
    outputs, _ = integrated(alone, lambda t: [0.0, 0.8, V_T, 0.006 * t, 0.8], end, step=2e-4)
    T_f, T_6 = 0.04, 10.0
    wanted = 0.006 * T_6 / (T_6 - T_f) * (np.exp(-end / T_6) - np.exp(-end / T_f))
    assert outputs[-1]["v_s"] == pytest.approx(wanted, rel=5e-3)


@HERTZ
def test_pss2c_is_pss2b_with_a_fourth_stage(hertz):
    s, p = 2j * np.pi * hertz, TWO | {"T_10": 0.25, "T_11": 0.04}
    before = stabilizer("pss2b", p).response(s, AT)
    after = stabilizer("pss2c", p | {"T_12": 0.3, "T_13": 0.06}).response(s, AT)
    stage = (1 + 0.3 * s) / (1 + 0.06 * s)
    assert after == pytest.approx({key: stage * value for key, value in before.items()}, rel=1e-9)


def test_pss2c_acts_between_two_thresholds_of_the_power():
    """At 0.8 pu it acts; below 0.2 no more; between 0.2 and 0.3 as before; from 0.3 on again."""
    alone = stabilizer("pss2c", {"P_on": 0.3, "P_off": 0.2, "V_STMAX": 9.0, "V_STMIN": -9.0})
    memory = [s.name for s in alone.model.states].index("pss.is_active")
    x, found = alone.x, []
    for P in (0.8, 0.25, 0.19, 0.25, 0.31, 0.25):
        _, x = integrated(alone, lambda t, P=P: [0.0, P], 0.05, x=x)
        found.append(round(x[memory]))
    assert found == [1, 1, 0, 0, 1, 1]
    x = x - 0.001
    x[memory] = 0.0
    assert alone.outputs([0.01, 0.25], x)["v_s"] == 0.0
    x[memory] = 1.0
    assert alone.outputs([0.01, 0.25], x)["v_s"] != 0.0
    assert stabilizer("pss2c").states["pss.is_active"] == 1.0


PSS3B = {"K_S1": 0.4, "T_1": 0.02, "T_w1": 1.5, "K_S2": 4.0, "T_2": 0.03, "T_w2": 2.0} | {
    "T_w3": 0.4,
    **{f"A_{k}": value for k, value in enumerate((0.1, 0.01, 0.2, 0.02, 0.3, 0.03, 0.4, 0.04), 1)},
}


@HERTZ
@pytest.mark.parametrize("left_out", [(), ("A_1", "A_2", "A_3", "A_4", "T_w1", "T_2")])
def test_pss3b_is_the_standards_diagram(hertz, left_out):
    s, p = 2j * np.pi * hertz, PSS3B | dict.fromkeys(left_out, 0.0)
    common = washout(p, s, "T_w3")
    for b1, b2, a1, a2 in ((1, 2, 3, 4), (5, 6, 7, 8)):
        common *= 1 + p[f"A_{b1}"] * s + p[f"A_{b2}"] * s**2
        common /= 1 + p[f"A_{a1}"] * s + p[f"A_{a2}"] * s**2
    first = washout(p, s, "T_w1") if p["T_w1"] else 1.0
    wanted = {
        ("v_s", "power"): common * p["K_S1"] / (1 + s * p["T_1"]) * first,
        ("v_s", "speed"): common * p["K_S2"] / (1 + s * p["T_2"]) * washout(p, s, "T_w2"),
    }
    alone = stabilizer("pss3b", p)
    assert not refused(alone)
    assert alone.response(s, AT) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("filters", [{"A_1": 0.1}, {"A_5": 0.1, "A_6": 0.1, "A_7": 0.1}])
def test_pss3b_takes_no_lead_without_a_lag(filters):
    assert any("needs a lag" in text for text in refused(stabilizer("pss3b", filters)))


def branch(band, first, s):
    """One branch of a band of PSS4B: constant and six time constants."""
    K, T = band[first][0], band[first][1:]
    found = (K + s * T[0]) / (1 + s * T[1])
    return found * (1 + s * T[2]) / (1 + s * T[3]) * (1 + s * T[4]) / (1 + s * T[5])


BANDS = {
    "L": (0.30, 0.20, (1.1, 0.02, 0.05, 0.03, 0.06, 0.04, 0.08), 0.10, 7.0),
    "I": (0.20, 0.10, (0.9, 0.03, 0.01, 0.02, 0.04, 0.03, 0.06), 0.05, 20.0),
    "H": (0.20, 0.30, (1.0, 0.005, 0.02, 0.01, 0.03, 0.02, 0.04), 0.05, 90.0),
}
"""K_1, K_2, the first branch (the second is it with other constants), a time constant for it, and the band's gain."""

TRANSDUCERS = {"a_LI1": 0.05, "a_LI2": 0.002, "b_LI1": 0.08, "b_LI2": 0.004, "B_LI1": 0.4}
TRANSDUCERS |= {"w_LI1": 8.0, "B_LI2": 0.5, "w_LI2": 12.0, "T_H": 0.04, "b_H1": 0.06, "b_H2": 0.003}
TRANSDUCERS |= {"M": 9.0, "B_H1": 0.4, "w_H1": 10.0, "B_H2": 0.5, "w_H2": 14.0}


def notch(s, B, w):
    return (s**2 + w**2) / (s**2 + B * s + w**2)


@HERTZ
@pytest.mark.parametrize("notched", [True, False])
def test_pss4b_is_the_standards_diagram(hertz, notched):
    s, p = 2j * np.pi * hertz, dict(TRANSDUCERS)
    if not notched:
        p |= {f"w_{which}{k}": 0.0 for which in ("LI", "H") for k in (1, 2)}
    of_band = {}
    for letter, (K_1, K_2, first, other, gain) in BANDS.items():
        second = (1.2, *(T + other for T in first[1:]))
        p |= {f"K_{letter}1": K_1, f"K_{letter}2": K_2, f"K_{letter}": gain}
        p |= {f"K_{letter}11": first[0], f"K_{letter}17": second[0]}
        p |= {f"T_{letter}{k}": T for k, T in enumerate((*first[1:], *second[1:]), 1)}
        p |= {f"V_{letter}MAX": 9.0, f"V_{letter}MIN": -9.0}
        pair = (first, second)
        of_band[letter] = gain * (K_1 * branch(pair, 0, s) - K_2 * branch(pair, 1, s))
    speed = (1 + p["a_LI1"] * s + p["a_LI2"] * s**2) / (1 + p["b_LI1"] * s + p["b_LI2"] * s**2)
    made = -s / p["M"] / (1 + s * p["T_H"]) / (1 + p["b_H1"] * s + p["b_H2"] * s**2)
    if notched:
        speed *= notch(s, p["B_LI1"], p["w_LI1"]) * notch(s, p["B_LI2"], p["w_LI2"])
        made *= notch(s, p["B_H1"], p["w_H1"]) * notch(s, p["B_H2"], p["w_H2"])
    alone = stabilizer("pss4b", p)
    assert not refused(alone)
    wanted = {
        ("v_s", "speed"): speed * (of_band["L"] + of_band["I"]),
        ("v_s", "power"): made * of_band["H"],
    }
    assert alone.response(s, AT) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("letter", ["L", "I", "H"])
def test_each_band_of_pss4b_has_its_own_limits(letter):
    """All bands driven hard one way give the sum of their limits, as long as the whole allows it."""
    wide = {f"V_{other}M{end}": 0.0 for other in "LIH" for end in ("AX", "IN")}
    own = {f"V_{letter}MAX": 0.03, f"V_{letter}MIN": -0.02}
    alone = stabilizer("pss4b", wide | own)
    signals = [
        alone.outputs([0.0, 0.8], alone.x + way * np.arange(len(alone.x)) * 0.01)["v_s"]
        for way in (1, -1)
    ]
    assert sorted(signals) == pytest.approx([-0.02, 0.03])


@HERTZ
def test_iee2st_is_st2cut_with_another_band_of_voltages(hertz):
    s, p = 2j * np.pi * hertz, {"K_1": 8.0, "K_2": 0.4, "signal_2": 3, "T_1": 0.02, "T_3": 2.0}
    both = [stabilizer(name, p).response(s, [*AT, V_T]) for name in ("st2cut", "iee2st")]
    assert both[0] == both[1]


def test_iee2st_is_cut_off_outside_of_a_band_of_voltages():
    alone = stabilizer("iee2st", {"V_CL": 0.9, "V_CU": 1.1})
    x = alone.x - 0.001
    signals = [alone.outputs([0.0, 0.8, v], x)["v_s"] for v in (0.89, 0.91, 1.09, 1.11)]
    assert [signal != 0 for signal in signals] == [False, True, True, False]


@pytest.mark.parametrize("name", ADDED)
def test_the_signal_stays_within_two_limits_of_its_own(name):
    last = [V_T] if name in OF_VOLTAGE else []
    free = stabilizer(name, {"V_STMAX": 99.0, "V_STMIN": -99.0})
    limited = stabilizer(name, {"V_STMAX": 0.008, "V_STMIN": -0.005})
    for way in (-1, 1):
        x = free.x + way * np.arange(len(free.x)) * 0.01
        wanted = free.outputs([0.0, 0.8, *last], x)["v_s"]
        found = limited.outputs([0.0, 0.8, *last], x)["v_s"]
        assert abs(wanted) > 0.008
        assert found == pytest.approx(np.clip(wanted, -0.005, 0.008), rel=1e-12)


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
@pytest.mark.parametrize("name", ADDED)
def test_a_generator_with_it_starts_in_steady_state(name, factory):
    device = Evaluated(factory(exciter="st1a", stabilizer=name), AT_BUS)
    assert not refused(device)
    assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-8


DAMPING = {"K": 12.0, "T_W": 4.0, "T_f": 0.03, "T_S1": 0.25, "T_S2": 0.06, "limit": 9.0}


@HERTZ
@pytest.mark.parametrize("stages", range(4))
@pytest.mark.parametrize("name", ["pod", "pod_input"])
def test_a_pod_at_a_machine_is_a_converters(name, stages, hertz):
    """Washout, low pass, as many leads and lags, and the gain; of the speed, or of the frequency at its input."""
    s, p = 2j * np.pi * hertz, DAMPING
    alone = stabilizer(name, p | {"enabled": 1, "N_S": stages}, sees_all=True, scope="pod_q")
    rest = [*AT, V_T, 0.0, 0.8, *([1.0] if name == "pod_input" else [])]
    assert not refused(alone)
    assert max(map(abs, alone.rates(rest).values())) < 1e-12
    wanted = p["K"] * washout(p, s, "T_W") / (1 + s * p["T_f"])
    wanted *= lead(p, s, "T_S1", "T_S2") ** stages
    response = alone.response(s, rest)
    taken = "omega_pod" if name == "pod_input" else "speed"
    assert response["v_s", taken] == pytest.approx(wanted, rel=1e-9)
    assert {key for key, value in response.items() if value} == {("v_s", taken)}


def test_a_pod_at_a_machine_is_off_until_it_is_enabled_and_stays_within_its_limit():
    values = {"limit": 0.04, "K": 100.0}
    for enabled, wanted in ((0, 0.0), (1, 0.04)):
        alone = stabilizer("pod", values | {"enabled": enabled}, scope="pod_q")
        assert alone.outputs([0.0, 0.8], alone.x + 0.1)["v_s"] == wanted


def test_a_pod_with_the_other_sign_does_the_opposite():
    values = {"limit": 0.04, "K": 100.0, "enabled": 1, "sign": -1}
    alone = stabilizer("pod", values, scope="pod_q")
    assert alone.outputs([0.0, 0.8], alone.x + 0.1)["v_s"] == -0.04
    (text,) = refused(stabilizer("pod", {"sign": 0}, scope="pod_q"))
    assert text == "pod_q.sign must be 1 or -1"


def with_a_pod(far, **values):
    """TGOV1 with a POD-P."""
    own = {f"pod_p.{key}": value for key, value in values.items()}
    made = chosen_parts(
        "genrou", "sexs", "tgov1_pod_input" if far else "tgov1_pod", "none"
    ).governor
    return governor("tgov1", made=made, full=own)


@HERTZ
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("far", [False, True])
def test_a_pod_p_moves_the_governors_power_reference(far, sign, hertz):
    """Less power while the frequency is high, through the turbine; of the speed, or of the frequency at its input."""
    s, p = 2j * np.pi * hertz, DAMPING
    rest = [1.0, 1.0] if far else [1.0]
    taken = "omega_pod_p" if far else "w"
    on, off = (
        with_a_pod(far, **p, N_S=2, sign=sign, enabled=enabled).response(s, rest)
        for enabled in (1, 0)
    )
    turbine = (1 + 3.0 * s) / (1 + 10.0 * s) / (1 + 0.5 * s)  # of TGOV1's defaults
    wanted = -sign * p["K"] * washout(p, s, "T_W") / (1 + s * p["T_f"])
    wanted *= lead(p, s, "T_S1", "T_S2") ** 2 * turbine
    assert on["P_m", taken] - off["P_m", taken] == pytest.approx(wanted, rel=1e-9)


REFERRED = [name for name in GOVERNORS if name != "degov"]


@pytest.mark.parametrize("name", REFERRED)
def test_every_governor_with_a_reference_takes_a_pod(name):
    """From rest, with the speed up, a POD that is on takes power away that the same one off leaves."""
    power = {}
    for enabled in (0, 1):
        device = Evaluated(
            synchronous_generator_phasor("genrou", "sexs", f"{name}_pod", "pss1a"),
            AT_BUS | {"pod_p.enabled": enabled, "pod_p.K": 50.0},
        )
        assert not refused(device)
        assert max(map(abs, device.rates([BUS.real, BUS.imag]).values())) < 1e-8
        states = list(device.model.states)
        x = device.x + 0.0
        x[[k for k, state in enumerate(states) if state.name.startswith("pod_p.")]] += 0.001
        power[enabled] = device.rates([BUS.real, BUS.imag], x)
    changed = {key for key in power[0] if abs(power[0][key] - power[1][key]) > 1e-9}
    assert {key for key in changed if not key.startswith("pod_p.")}


def test_a_governor_without_a_reference_has_no_pod():
    with pytest.raises(ValueError, match="degov has no power reference that a POD could move"):
        synchronous_generator_phasor(governor="degov_pod")
