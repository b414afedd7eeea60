"""MAXEX1, MAXEX2 and MNLEX2: times and slopes by hand, the circle, and machines that end at their limits."""

import numpy as np
import pytest

from fmus.synchronous_generator.composed import synchronous_generator, synchronous_generator_phasor
from fmus.synchronous_generator.parts import EXCITERS, OELS, UELS
from tests.models.one_machine import OneMachine, three_buses
from tests.models.parts import AT_BUS, BUS, CURRENT, E_FD, V_T, integrated, limiter, refused
from tests.support.evaluated import Evaluated
from tests.support.late import LateLibrary

scipy_signal = LateLibrary("scipy.signal")
POINTS = {"EFDRATED": 2.0, "EFD1": 1.2, "TIME1": 3.0, "EFD2": 1.5, "TIME2": 1.0, "EFD3": 2.0}
TIMED = POINTS | {"TIME3": 0.5, "EFDDES": 1.0, "KMX": 0.1, "VLOW": -0.2}
"""At rest u = 1.1, below EFD1 = 1.2."""

CIRCLE = {"K_F2": 0.0, "T_F2": 1.0, "K_M": 2.0, "T_M": 0.1, "MELMAX": 9.0, "Q_0": 1.3, "R": 1.9}


@pytest.mark.parametrize("name", ["maxex1", "maxex2"])
def test_every_point_of_the_inverse_time_may_lie_as_low_as_the_first(name):
    model = limiter(TIMED, oel=OELS[name]).model
    least = {
        variable.name.rpartition(".")[2]: variable.minimum
        for variable in model.parameters
        if variable.name.rpartition(".")[2][:-1] in ("EFD", "TIME")
    }
    assert least == dict.fromkeys(("EFD1", "TIME1", "EFD2", "TIME2", "EFD3", "TIME3"), 0)


def overexcited(I_fd, E_fd=E_FD, end=1.0, values=TIMED, name="maxex2", x=None):
    alone = limiter(values, oel=OELS[name])
    assert not refused(alone)
    found, x = integrated(alone, lambda t: [I_fd, E_fd, 0.7, -0.1], end, x=x)
    return np.array([each["v_s"] for each in found]), x


@pytest.mark.parametrize(
    ("u", "time"),
    [(1.2001, 3.0), (1.35, 2.0), (1.5, 1.0), (1.6, 0.9), (1.75, 0.75), (2.0, 0.5), (3.0, 0.5)],
)
def test_the_limiter_waits_for_its_inverse_time_and_then_integrates(u, time):
    """KMX·EFDRATED·(EFDDES − u) from the time on, down to VLOW."""
    signal, _ = overexcited(2.0 * u, end=time + 0.3)
    moved = np.flatnonzero(signal < -1e-6)
    assert moved[0] * 1e-3 == pytest.approx(time, abs=6e-3)
    slope = 0.1 * 2.0 * (1.0 - u)
    since = len(signal) - 1 - moved[0]
    assert signal[-1] == pytest.approx(max(slope * since * 1e-3, -0.2), abs=2e-3 * abs(slope))


def test_below_its_first_point_it_never_acts():
    signal, _ = overexcited(2.0 * 1.19, values=TIMED | {"TIME1": 1.0}, end=2.0)
    assert not signal.any()


def test_the_time_is_forgotten_where_the_current_falls_below_the_first_point():
    _, x = overexcited(2.0 * 1.5, end=0.9)
    _, x = overexcited(2.0 * 1.1, end=0.05, x=x)
    signal, _ = overexcited(2.0 * 1.5, end=0.9, x=x)
    assert not (signal < -1e-6).any()
    signal, _ = overexcited(2.0 * 1.5, end=1.1, x=x)
    assert signal[-1] < -1e-3


def test_it_stops_at_vlow_and_lets_go_without_winding_up():
    """At VLOW for a second; below EFDDES it rises at once, to 0 and no further, and stays there."""
    fast = TIMED | {"KMX": 1.0}
    signal, x = overexcited(2.0 * 3.0, values=fast, end=1.6)
    assert signal[-1] == pytest.approx(-0.2, rel=1e-9)
    signal, x = overexcited(2.0 * 0.9, values=fast, end=0.4, x=x)  # 0.2 pu a second
    assert signal[-1] == pytest.approx(-0.2 + 0.2 * 0.4, abs=1e-3)
    signal, _ = overexcited(2.0 * 0.9, values=fast, end=0.8, x=x)
    assert signal[-1] == pytest.approx(0.0, abs=1e-12)
    assert signal.max() <= 0


def test_between_what_it_wants_and_its_first_point_it_goes_on_once_it_acts():
    _, x = overexcited(2.0 * 1.6, end=1.2)
    signal, _ = overexcited(2.0 * 1.1, end=0.5, x=x)
    assert np.diff(signal).max() < 0


@pytest.mark.parametrize(("name", "of_current"), [("maxex1", None), ("maxex2", 0), ("maxex2", 1)])
def test_maxex1_sees_the_field_voltage_and_maxex2_what_its_switch_says(name, of_current):
    values = TIMED | ({} if of_current is None else {"of_current": of_current})
    by_current, _ = overexcited(6.0, end=1.0, values=values, name=name)
    by_voltage, _ = overexcited(E_FD, E_fd=6.0, end=1.0, values=values, name=name)
    assert [s[-1] < -1e-3 for s in (by_current, by_voltage)] == [bool(of_current), not of_current]


def test_a_start_beyond_the_first_point_rests_and_the_time_runs_above_it():
    values = TIMED | {"EFDRATED": 1.0}  # u = 2.2 at the start
    alone = limiter(values, oel=OELS["maxex2"])
    assert max(map(abs, alone.rates([E_FD, E_FD, 0.7, -0.1]).values())) < 1e-12
    signal, _ = overexcited(1.005 * E_FD, end=2.0, values=values)
    assert not signal.any()
    signal, _ = overexcited(1.02 * E_FD, end=2.0, values=values)
    assert signal[-1] < -1e-3


def excess(i, values=CIRCLE):
    S, square = V_T * np.conj(i), V_T**2
    far = (S.imag - values["Q_0"] * square) ** 2 + S.real**2
    return far - (values["R"] * square) ** 2


@pytest.mark.parametrize("angle", [-1.9, -1.571, -1.2])
def test_mnlex2_acts_outside_of_its_circle_alone(angle):
    """On a ray from the circle's centre downwards, 1 % within and 1 % outside of the radius."""
    alone = limiter(CIRCLE, uel=UELS["mnlex2"])
    assert not refused(alone)
    for share in (0.99, 1.01):
        S = V_T**2 * (1.3j + 1.9 * share * np.exp(1j * angle))
        i = np.conj(S / V_T)
        found, _ = integrated(alone, lambda t, i=i: [E_FD, E_FD, i.real, i.imag], 2.0)
        assert found[-1]["v_s"] == pytest.approx(max(2.0 * excess(i), 0.0), rel=1e-6, abs=1e-9)
        assert found[-1]["uel.acts"] == (share > 1)


@pytest.mark.parametrize("K_F2", [0.0, 0.3])
def test_mnlex2_answers_as_its_diagram(K_F2):
    """Acting, K_M·(1+sT_F2)/((1+sT_M)·(1+sT_F2) + s·K_M·K_F2) of the excess."""
    values = CIRCLE | {"K_F2": K_F2, "T_F2": 0.4, "R": 1.2}
    alone = limiter(values, uel=UELS["mnlex2"])
    i = complex(CURRENT.re, CURRENT.im)
    assert excess(i, values) > 0
    rest = [E_FD, E_FD, 0.7, -0.1]
    assert max(map(abs, alone.rates(rest).values())) < 1e-9
    h = 1e-6
    slope = (excess(i + h * 1j, values) - excess(i - h * 1j, values)) / (2 * h)
    for hertz in (0.1, 1.0, 6.0):
        s = 2j * np.pi * hertz
        lag = 1 + 0.4 * s
        wanted = slope * 2.0 * lag / ((1 + 0.1 * s) * lag + s * 2.0 * K_F2)
        assert alone.response(s, rest)["v_s", "i_im"] == pytest.approx(wanted, rel=1e-5)


def test_mnlex2_stops_at_its_largest_signal_and_without_a_lag_it_is_at_once_there():
    for T_M in (0.1, 0.0):
        alone = limiter(CIRCLE | {"MELMAX": 0.1, "T_M": T_M}, uel=UELS["mnlex2"])
        found, x = integrated(alone, lambda t: [E_FD, E_FD, 0.1, 2.0], 3.0)
        assert found[-1]["v_s"] == pytest.approx(0.1, abs=1e-9)
        back, _ = integrated(alone, lambda t: [E_FD, E_FD, 0.7, -0.1], 0.1, x=x)
        assert back[-1]["v_s"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("factory", [synchronous_generator, synchronous_generator_phasor])
@pytest.mark.parametrize("name", [n for n in EXCITERS if n not in ("manual", "external")])
def test_a_generator_with_limiters_starts_in_steady_state(name, factory):
    """One that acts at the start has its signal in the voltage reference, which is lower by it."""
    acting = {"uel.R": 1.05, "uel.K_M": 0.1, "uel.MELMAX": 9.0}
    both = Evaluated(factory(exciter=name, oel="maxex1", uel="mnlex2"), AT_BUS | acting)
    assert not refused(both)
    at = [BUS.real, BUS.imag]
    assert max(map(abs, both.rates(at).values())) < 1e-8
    signal = both.outputs(at)["uel.signal"]
    assert (signal > 1e-3, both.outputs(at)["oel.acts"]) == (True, 0)
    alone = Evaluated(factory(exciter=name), AT_BUS)
    lowered = alone.parameters["exciter.V_ref"] - both.parameters["exciter.V_ref"]
    assert lowered == pytest.approx(signal, abs=1e-9)


GENERATOR = "102 'GENROU' 1 7.4 0.03 0.5 0.05 3.1 0.0 1.25 1.2 0.35 0.5 0.25 0.06 0.0 0.0 /\n"
EXST1 = "102 'EXST1' 1 0.01 99 -99 0 0 100 0.02 9 -9 0 0 1 /\n"


def ends(dyr, tmp_path, changed, until, exciter=EXST1):
    network, _ = three_buses()
    one = OneMachine(GENERATOR + exciter + dyr, tmp_path, network, torque=True)
    return one.run(network.lines, until, every=0.5, changed=changed)


def test_a_machine_that_is_asked_for_too_much_ends_at_its_desired_field(tmp_path):
    """A step of the reference lifts the field above EFD1; after its time it comes down to EFDDES·EFDRATED = 1.9."""
    record = "102 'MAXEX2' 1 1 2.0 1.1 4 1.2 3 1.3 2 0.95 0.1 -0.5 /\n"
    rows = ends(record, tmp_path, {"exciter.delta_V_ref": 0.08}, until=14.0)
    field = {time: out["E_fd"] for time, out, _ in rows}
    assert field[0.0] < 2.2 < field[2.0]
    assert rows[-1][1]["E_fd"] == pytest.approx(1.9, rel=2e-3)
    assert [rows[k][1]["oel.acts"] for k in (0, 4, -1)] == [0, 0, 1]


def test_a_machine_that_is_asked_for_too_little_ends_beside_its_circle(tmp_path):
    """Without the limiter the reactive power goes far below; with it the excess is V_UEL/K_M."""
    record = "102 'MNLEX2' 1 0 1 0.1 0.5 0.5 1.3 1.9 /\n"
    step = {"exciter.delta_V_ref": -0.05}
    free, rows = (ends(own, tmp_path, step, until=12.0) for own in ("", record))

    def beyond(row):
        v = row[2]
        S = v[102] * np.conj((2 * v[102] - v[101] - v[103]) / (0.01 + 0.12j))
        square = abs(v[102]) ** 2
        return (S.imag - 1.3 * square) ** 2 + S.real**2 - (1.9 * square) ** 2

    signal = rows[-1][1]["uel.signal"]
    assert beyond(rows[-1]) == pytest.approx(signal / 0.1, rel=0.02)
    assert 0.01 < signal < 0.05
    assert beyond(free[-1]) > 2 * beyond(rows[-1])


CIRCLE_UEL1 = {"K_UR": 1.95, "K_UC": 1.38, "T_U1": 0.1, "T_U2": 0.4, "T_U4": 0.05}


def excess_of_uel1(i):
    return abs(1.38 * V_T - 1j * i) - 1.95 * V_T


def test_uel1_has_its_edge_on_a_circle_above_zero():
    """(Q − K_UC·v²)² + P² = (K_UR·v²)²."""
    for angle in (-2.0, -1.5, -1.0):
        S = V_T**2 * (1.38j + 1.95 * np.exp(1j * angle))
        assert excess_of_uel1(np.conj(S / V_T)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("low", "Q"), [(-18.0, -0.1), (-18.0, -0.9), (0.0, -0.1), (0.0, -0.9)])
def test_uel1_without_an_integral_gives_its_gain_times_the_excess(low, Q):
    i = np.conj((0.7 + 1j * Q) / V_T)
    alone = limiter(CIRCLE_UEL1 | {"K_UL": 5.0, "V_ULMIN": low}, uel=UELS["uel1"])
    assert not refused(alone)
    assert max(map(abs, alone.rates([E_FD, E_FD, 0.7, -0.1]).values())) < 1e-12
    found, _ = integrated(alone, lambda t: [E_FD, E_FD, i.real, i.imag], 4.0)
    wanted = max(5.0 * excess_of_uel1(i), low)
    assert found[-1]["v_s"] == pytest.approx(wanted, abs=1e-3)
    assert found[-1]["uel.acts"] == (wanted > max(low, -18.0) + 1e-6)


def test_uel1_integrates_the_excess_and_stops_at_its_limits():
    values = CIRCLE_UEL1 | {"K_UL": 0.0, "K_UI": 2.0, "V_UIMIN": 0.0, "V_UIMAX": 0.5}
    alone = limiter(values, uel=UELS["uel1"])
    i = np.conj((0.7 - 0.9j) / V_T)
    found, x = integrated(alone, lambda t: [E_FD, E_FD, i.real, i.imag], 0.4)
    within = 2.0 * excess_of_uel1(i) * 0.4
    state = [s.name for s in alone.model.states].index("uel.integrator")
    assert x[state] == pytest.approx(within, rel=1e-6)
    found, x = integrated(alone, lambda t: [E_FD, E_FD, i.real, i.imag], 6.0, x=x)
    assert found[-1]["v_s"] == pytest.approx(0.5, abs=1e-6)
    found, _ = integrated(alone, lambda t: [E_FD, E_FD, 0.7, -0.1], 3.0, x=x)
    assert found[-1]["v_s"] == pytest.approx(0.0, abs=1e-3)


AT_GATES = [
    *(("dc1a", 1), ("dc2a", 1), ("ac4a", 1), ("st1a", 1), ("esst2a", 1)),
    *(("ac1a", 2), ("st1a", 2)),
]


@pytest.mark.parametrize(("name", "gate"), AT_GATES)
def test_at_a_gate_the_higher_signal_drives_the_exciter(name, gate):
    """Within the circle it is the exciter without one; a start outside rests, and beyond it the limiter drives."""
    on = {"uel.gate": gate, "uel.K_UL": 99.0, "uel.T_U2": 0.0}
    outside = {"uel.K_UR": 0.5, "uel.K_UC": 0.0, "uel.V_UIMAX": 999.0, "uel.V_ULMAX": 999.0}
    at = [BUS.real, BUS.imag]
    device = Evaluated(synchronous_generator_phasor(exciter=name, uel="uel1"), AT_BUS | on)
    assert not refused(device)
    assert max(map(abs, device.rates(at).values())) < 1e-8
    assert device.outputs(at)["uel.acts"] == 0
    free = Evaluated(synchronous_generator_phasor(exciter=name), AT_BUS)
    x = free.x + 0.001
    states = [s.name for s in device.model.states]
    moved = device.x + 0.0
    moved[[states.index(s.name) for s in free.model.states]] = x
    found, alone = device.rates(at, moved), free.rates(at, x)
    assert {key: found[key] for key in alone} == pytest.approx(alone, rel=1e-9, abs=1e-9)
    lifted = Evaluated(
        synchronous_generator_phasor(exciter=name, uel="uel1"), AT_BUS | on | outside
    )
    assert not refused(lifted)
    assert max(map(abs, lifted.rates(at).values())) < 1e-8
    assert lifted.outputs(at)["uel.acts"] == 0
    more = [0.99 * BUS.real, 0.99 * BUS.imag]  # the current rises with it
    assert lifted.outputs(more)["uel.acts"] == 1
    rises = lifted.outputs(more)["E_fd"] - free.outputs(more)["E_fd"]
    driven, own = lifted.rates(more), free.rates(more)
    assert max(rises, *(driven[name] - own[name] for name in own)) > 0.1


@pytest.mark.parametrize("name", ["uel1", "uel2", "uel2c"])
def test_a_start_beyond_the_edge_of_an_integral_rests_and_beyond_it_integrates(name):
    """|i| = 0.71 pu exceeds K_UR·v at the start, and Q = 0.1 pu is below the polygon at 0.3 pu."""
    values = {"K_UI": 1.0, "K_UL": 1.0, "V_UIMIN": 0.0, "T_U2": 0.0}
    circle = {"K_UR": 0.5, "K_UC": 0.0, "V_ULMIN": 0.0}
    values |= circle if name == "uel1" else {f"Q{k}": 0.3 for k in range(5)}
    alone = limiter(values, uel=UELS[name])
    assert not refused(alone)
    rest = [E_FD, E_FD, CURRENT.re, CURRENT.im]
    assert max(map(abs, alone.rates(rest).values())) < 1e-9
    assert alone.outputs(rest)["v_s"] == 0
    more = [E_FD, E_FD, 0.9, 0.2]  # a larger current, with less reactive power
    found, _ = integrated(alone, lambda t: more, 2.0)
    assert found[-1]["v_s"] > 0.1


def test_a_machine_that_is_asked_for_too_little_follows_its_limiter_at_a_gate(tmp_path):
    """Of K_UL = 0.05 before the amplifier of 100: the excess ends at E_fd/5, and not where the reference asks for."""
    exciter = "102 'ESST1A' 1 2 1 0.01 99 -99 0 0 0 0 100 0.02 9 -9 9 -9 0 0 1 0 0 /\n"
    record = "102 'UEL1' 1 1.9 1.3 0 5.8 5.8 0 0.05 18 -18 0 0.05 0 0 18 -18 /\n"
    changed = {"exciter.delta_V_ref": -0.05}
    rows = ends(record, tmp_path, changed, until=12.0, exciter=exciter)
    (_, first, _), (_, out, v) = rows[0], rows[-1]
    i = (2 * v[102] - v[101] - v[103]) / (0.01 + 0.12j)
    found = abs(1.3 * v[102] - 1j * i) - 1.9 * abs(v[102])
    assert (first["uel.acts"], out["uel.acts"]) == (0, 1)
    assert found == pytest.approx(out["E_fd"] / 5, rel=0.01)


@pytest.mark.parametrize("name", ["sexs", "st4b"])
def test_a_gate_that_an_exciter_lacks_is_refused(name):
    device = Evaluated(
        synchronous_generator_phasor(exciter=name, uel="uel1"), AT_BUS | {"uel.gate": 1}
    )
    text = "uel.gate = 1: this exciter has no gate there; take 0, or another exciter"
    assert refused(device) == [text]


def test_limiters_need_a_regulator():
    for named in ({"oel": "maxex1"}, {"uel": "mnlex2"}):
        with pytest.raises(ValueError, match="it acts on a voltage regulator"):
            synchronous_generator_phasor(exciter="manual", **named)
    with pytest.raises(ValueError, match="did you mean 'maxex2'"):
        synchronous_generator_phasor(exciter="sexs", oel="maxex3")


POLYGON = {"K_UL": 2.0, "K_UI": 0.0, "V_UIMIN": -9.0, "V_UIMAX": 9.0}
POLYGON |= {
    f"{name}{k}": 9.0 * sign for k in "12" for name, sign in (("V_UELMAX", 1), ("V_UELMIN", -1))
}
POLYGON |= {"V_ULMIN": -9.0, "V_ULMAX": 9.0}
POLYGON_OF = {
    "uel2c": POLYGON,
    "uel2": {name: value for name, value in POLYGON.items() if "UEL" not in name},
}


def signal_of_uel2c(P, Q, name="uel2c", **values):
    alone = limiter(POLYGON_OF[name] | values, uel=UELS[name])
    assert not refused(alone)
    i = np.conj((P + 1j * Q) / V_T)
    found, _ = integrated(alone, lambda t: [E_FD, E_FD, i.real, i.imag], 3.0)
    return found[-1]["v_s"]


@pytest.mark.parametrize("name", ["uel2c", "uel2"])
@pytest.mark.parametrize(
    ("P", "edge"),
    [(0.0, -0.31), (0.15, -0.31), (0.45, -0.295), (0.9, -0.21), (0.96, -0.105), (1.08, 0.105)],
)
def test_uel2c_and_uel2_lift_what_lies_below_their_polygon(P, edge, name):
    """K_UL·(Q_ref − Q)/K_fix, with points as far as P rises and straight on beyond the last one."""
    bare = {"k_1": 0.0, "k_2": 0.0} | ({"K_fix": 0.5} if name == "uel2c" else {"K_UL": 4.0})
    lifted = pytest.approx(2 * (edge + 0.5) / 0.5, abs=1e-4)
    assert signal_of_uel2c(P, -0.5, name, **bare) == lifted
    assert signal_of_uel2c(-P, -0.5, name, **bare) == lifted


@pytest.mark.parametrize(("k_1", "k_2"), [(2, 2), (1, 0), (0, 1)])
def test_uel2_scales_its_polygon_with_the_voltage(k_1, k_2):
    P = 0.45
    edge = np.interp(P / V_T**k_1, [0.3, 0.6], [-0.31, -0.28]) * V_T**k_2
    scaled = signal_of_uel2c(P, -0.4, "uel2", k_1=float(k_1), k_2=float(k_2))
    assert scaled == pytest.approx(2 * (edge + 0.4), abs=1e-4)


def test_uel2_follows_a_step_as_its_blocks_do():
    """Lag of the reactive power, K_UL, two leads and lags, the sum within V_UIMAX: SciPy's response of the same."""
    times = {"T_UQ": 0.1, "T_U1": 0.3, "T_U2": 0.5, "T_U3": 0.04, "T_U4": 0.2}
    plain = {"k_1": 0.0, "k_2": 0.0, "K_UL": 0.8, "V_UIMIN": 0.0, "V_ULMIN": 0.0}
    alone = limiter(POLYGON_OF["uel2"] | plain | times, uel=UELS["uel2"])
    inside, below = (np.conj((0.15 + 1j * Q) / V_T) for Q in (-0.31, -0.5))
    at_rest, x = integrated(alone, lambda t: [E_FD, E_FD, inside.real, inside.imag], 5.0)
    assert at_rest[-1]["v_s"] == pytest.approx(0.0, abs=1e-5)
    found, _ = integrated(alone, lambda t: [E_FD, E_FD, below.real, below.imag], 1.0, x=x)
    poles = [np.array([times[name], 1.0]) for name in ("T_UQ", "T_U2", "T_U4")]
    zeros = [np.array([times[name], 1.0]) for name in ("T_U1", "T_U3")]
    numerator, denominator = 0.8 * 0.19 * np.polymul(*zeros), np.polymul(*poles[:2])
    t = np.arange(len(found) + 1) * 1e-3
    _, wanted = scipy_signal.step((numerator, np.polymul(denominator, poles[2])), T=t)
    got = np.array([each["v_s"] for each in found])
    assert got == pytest.approx(wanted[1:], abs=1e-6)
    capped = limiter(
        POLYGON_OF["uel2"] | plain | times | {"V_UIMAX": 0.1, "V_ULMAX": 0.08}, uel=UELS["uel2"]
    )
    found, _ = integrated(capped, lambda t: [E_FD, E_FD, below.real, below.imag], 4.0)
    assert found[-1]["v_s"] == pytest.approx(0.08, abs=1e-6)


def test_uel2c_scales_its_polygon_with_the_voltage_and_its_gain_with_the_angle():
    u = V_T  # V_bias < 0: the voltage itself
    P = 0.45
    edge = np.interp(P / u**2, [0.3, 0.6], [-0.31, -0.28]) * u**2
    scaled = signal_of_uel2c(P, -0.4, V_bias=-1.0)
    assert scaled == pytest.approx(2 * (edge + 0.4), abs=1e-4)
    along = V_T**2 / 1.8 - 0.4
    gain = along / np.hypot(along, P)
    adjusted = signal_of_uel2c(P, -0.4, V_bias=-1.0, SW=2.0, T_adj=0.1)
    assert adjusted == pytest.approx(2 * (edge + 0.4) / gain, abs=1e-4)


def test_uel2c_rests_above_its_polygon_and_integrates_below_it():
    values = POLYGON | {
        "K_UL": 0.0,
        "K_UI": 1.0,
        "V_UIMIN": 0.0,
        "k_1": 0.0,
        "k_2": 0.0,
        "T_UQ": 0.0,
    }
    alone = limiter(values, uel=UELS["uel2c"])
    assert max(map(abs, alone.rates([E_FD, E_FD, 0.7, -0.1]).values())) < 1e-12
    below = np.conj((0.15 - 0.5j) / V_T)
    found, x = integrated(alone, lambda t: [E_FD, E_FD, below.real, below.imag], 1.0)
    assert found[-1]["v_s"] == pytest.approx(0.19, rel=0.05)
    found, _ = integrated(alone, lambda t: [E_FD, E_FD, 0.7, 0.1], 3.0, x=x)
    assert found[-1]["v_s"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("name", ["uel1", "uel2", "uel2c"])
@pytest.mark.parametrize(("lead", "is_linear"), [(0.0, True), (0.05, True), (0.3, False)])
def test_a_limiter_that_only_integrates_rests_where_a_linear_model_can_be_made(
    name, lead, is_linear
):
    """Its integral holds all limits behind it, unless a lead of more than its lag falls below them."""
    values = {"K_UL": 0.0, "K_UI": 0.5, "V_UIMIN": 0.0, "V_ULMIN": 0.0, "T_U1": lead, "T_U2": 0.1}
    values |= {"V_UELMIN1": 0.0, "V_UELMIN2": 0.0} if name == "uel2c" else {}
    alone = limiter(values, uel=UELS[name])
    assert not refused(alone)
    at = [E_FD, E_FD, 0.7, -0.1]
    rest = alone.model.states
    moved = [
        alone.x + sign * 1e-5 * np.array(["integrator" in s.name for s in rest]) for sign in (1, -1)
    ]
    up, down = (alone.outputs(at, x)["v_s"] for x in moved)
    assert up == pytest.approx(1e-5 * lead / 0.1)
    assert down == pytest.approx(-up if is_linear else 0.0, abs=1e-12)
    above, below = (alone.rates(at, x) for x in moved)
    for state in above if is_linear else ():
        assert above[state] == pytest.approx(-below[state], abs=1e-12)
    lifted, _ = integrated(alone, lambda t: [E_FD, E_FD, 0.7, 3.0], 1.0)
    assert lifted[-1]["v_s"] > 0.05
