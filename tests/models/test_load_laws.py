"""Loads that are no constant impedance: their laws in steady state, their steps, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fmus.grid.element_data import LAWS, Load, Zip
from fmus.grid.grid import grid
from fmus.grid.network import Line, Network, Port
from fmus.grid.phasor_grid import phasor_grid
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.kernel import c_source
from tests.models.networks import are_the_same, phasors, stepped
from tests.support.evaluated import Evaluated

CURRENT, POWER, MIX = LAWS["current"], LAWS["power"], Zip(z=0.2, i=0.3, p=0.5)
OMEGA_B = 2 * np.pi * 50


def network(load, *others, **more):
    """A load at bus a, behind a line from bus b with a large resistive load, where a current is fed."""
    loads = (load, *others, Load("far", "b", 2000.0))
    return Network(
        "one_load", ("a", "b"), (Line("ab", "a", "b", X=0.05, **more),), loads, (Port("unit", "b"),)
    )


def standing(model, u, values=None):
    """The steady state for inputs, by Newton's method."""
    at = Evaluated(model, values)
    for _ in range(60):
        moved = np.linalg.solve(at.blocks(u)[0], list(at.rates(u).values()))
        at.x = at.x - moved
        if np.abs(moved).max() < 1e-14:  # the last bits of states of about 1
            break
    assert max(abs(r) for r in at.rates(u).values()) < 1e-6
    return at


def drawn(at, u):
    """P + jQ [pu] that flows over the line into bus a, its charging left out, and |v| of a."""
    y = at.outputs(u)
    return -complex(y["ab.p"], y["ab.q"]), y["a.v"]


LAWS_TRIED = [
    (CURRENT, CURRENT, 0.0),
    (POWER, POWER, 0.0),
    (MIX, POWER, 0.0),
    (POWER, LAWS["impedance"], 0.0),
    (CURRENT, MIX, 0.02),
    (MIX, CURRENT, 0.3),
]


def law_of(law, v):
    return law.z * v**2 + law.i * v + law.p


@pytest.mark.parametrize("p", [400.0, -400.0])
@pytest.mark.parametrize(("active", "reactive", "charging"), LAWS_TRIED)
def test_powers_follow_their_laws_in_steady_state(active, reactive, charging, p):
    more = {"B": charging} if charging else {}
    # generation alone leaves a's voltage undefined
    extra = () if p > 0 or charging else (Load("weak", "a", 50.0),)
    model = grid(
        network(Load("load", "a", p, 100.0, active=active, reactive=reactive), *extra, **more)
    )
    for current in (25.0, 26.5, 28.0):
        u = np.array([current, -1.0])
        power, v = drawn(standing(model, u), u)
        power -= 0.5 * v**2 if extra else 0.0
        power += 0.5j * charging * v**2
        assert v > 0.7
        assert power.real == pytest.approx(p / 100 * law_of(active, v), rel=1e-9)
        assert power.imag == pytest.approx(law_of(reactive, v), rel=1e-9)


def test_below_its_low_voltage_a_constant_power_is_an_impedance():
    load = Load("load", "a", 400.0, 100.0, active=POWER, reactive=POWER, v_min=0.8)
    model = grid(network(load, B=0.02))
    u = np.array([12.0, 0.0])
    power, v = drawn(standing(model, u), u)
    assert v < 0.75
    assert power + 0.01j * v**2 == pytest.approx((4 + 1j) * (v / 0.8) ** 2, rel=1e-9)


@pytest.mark.parametrize("make", [grid, phasor_grid])
def test_it_starts_in_steady_state(make):
    load = Load("load", "a", -300.0, 80.0, active=MIX, reactive=POWER, k_pf=2.0)
    at = Evaluated(make(network(load, B=0.02)), {"a.v_0": 1.02, "a.theta_0": 0.3})
    u = np.zeros(len(at.model.inputs))
    if (
        make is phasor_grid
    ):  # an emf behind a vanishing impedance, chosen so that a has its voltage of the power flow
        Y = 1 / 0.05j
        v_a, load_current = 1.02 * np.exp(0.3j), np.conj((-3 + 0.8j) / (1.02 * np.exp(0.3j)))
        v_b = v_a + (load_current + 0.01j * v_a) / Y
        u = np.array([v_b.real, v_b.imag, 1e9, 0.0])
    for name, rate in at.rates(u).items():
        if name.startswith(("load.c", "load.z")) and make is grid:
            assert abs(rate) < 1e-9
        elif name.startswith("load"):
            assert abs(rate) < 1e-4


def test_the_lag_is_the_only_difference_to_an_impedance():
    """At the first instant after a step of the injected current the load is still the conductance."""
    at = Evaluated(
        grid(
            Network(
                "n", ("a",), (), (Load("load", "a", 800.0, active=CURRENT),), (Port("unit", "a"),)
            )
        )
    )
    y = at.outputs([8.8, 0.0])
    assert y["load.p"] == pytest.approx(8.0 * y["a.v"] ** 2, rel=1e-12)


# -- along time, against equations written by hand ------------------------------------------------


def by_hand(t_end, times, current, *, p, q, laws, k, tau, T_f, B, v_min):
    """Line from b (resistive load 20 pu) to a, charging B at both ends, the load at a; all as complex numbers."""

    def share(law, v):
        w = max(v, v_min)
        return (law.z + law.i / w + law.p / w**2), w

    def rates(t, parts):
        v_a, v_b, i, i_load, c, z = np.ascontiguousarray(parts).view(complex)
        turning = (v_a * np.conj(z)).imag / abs(z) ** 2 / T_f / OMEGA_B
        a = p * share(laws[0], abs(v_a))[0] * (1 + k[0] * turning)
        b = q * share(laws[1], abs(v_a))[0] * (1 + k[1] * turning)
        wanted = (a - 1j * b) * v_a - (p - 1j * q) * v_a
        return np.array(
            [
                OMEGA_B / (B / 2) * (-i - p * v_a - i_load - c - 0.5j * B * v_a),
                OMEGA_B / (B / 2) * (current(t) + i - 20 * v_b - 0.5j * B * v_b),
                OMEGA_B / 0.05 * (v_a - v_b - 0.05j * i),
                OMEGA_B * q * (v_a - 1j / q * i_load),
                (wanted - c) / tau,
                (v_a - z) / T_f,
            ],
            complex,
        ).view(float)

    start = np.array([1, 1, 0, -1j * q, 0, 1], complex)
    found = solve_ivp(rates, (0, t_end), start.view(float), "Radau", times, rtol=1e-8, atol=1e-10)
    assert found.success
    return found.y[0] + 1j * found.y[1]


@pytest.mark.parametrize(("laws", "k"), [((POWER, POWER), (0, 0)), ((MIX, CURRENT), (1.5, -2.0))])
def test_a_network_with_charging_follows_the_equations(laws, k):
    """The implicit step takes the law explicitly; the error of 100 µs steps falls with them."""
    load = Load(
        "load", "a", 400.0, 100.0, active=laws[0], reactive=laws[1], k_pf=k[0], k_qf=k[1], tau=2e-3
    )
    model = grid(network(load, B=0.4))
    assert model.integrator == "sdirk"

    def current(t):
        return 20.0 * np.exp(2j * np.pi * 2.0 * t)  # 2 Hz above the rated frequency

    names = ("a.v_re", "a.v_im", "load.p", "load.q")
    errors = []
    times = np.arange(0.02, 0.2, 0.004)
    exact = by_hand(
        0.2, times, current, p=4.0, q=1.0, laws=laws, k=k, tau=2e-3, T_f=0.02, B=0.4, v_min=0.7
    )
    for step in (1e-4, 2.5e-5):

        def held(t, step=step):
            mid = current(t + step / 2)  # what a step of this length sees of a turning current
            return {"unit.i_re": mid.real, "unit.i_im": mid.imag}

        rows = stepped(model, held, 0.2, names, step=step)
        (v,) = phasors(rows, names, "a.v")
        errors.append(np.abs(v[np.round(times / step).astype(int)] - exact).max())
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 3


def test_the_frequency_that_a_load_feels_is_that_of_its_bus():
    """1 Hz above the rated frequency, 2 % of it, k_pf = 3 draws 6 % more; as exactly as v turns steadily."""
    load = Load("load", "a", 400.0, k_pf=3.0)
    model = phasor_grid(Network("n", ("a",), (), (load,), (Port("unit", "a"),)))

    def held(t):
        e = np.exp(2j * np.pi * t)
        return {"unit.e_re": e.real, "unit.e_im": e.imag, "unit.y_re": 0.0, "unit.y_im": -1e3}

    rows = stepped(model, held, 0.5, ("a.v", "load.p"), step=1e-3)
    assert rows[-1, 1] / rows[-1, 0] ** 2 == pytest.approx(4.0 * 1.06, rel=1e-3)


# -- both kinds of network and of FMU -------------------------------------------------------------


def test_the_phasor_network_has_the_same_steady_state():
    load = Load("load", "a", 400.0, 100.0, active=POWER, reactive=MIX)
    emf, y = 1.03 + 0.05j, -200j
    found = standing(
        phasor_grid(network(load, B=0.4)), np.array([emf.real, emf.imag, y.real, y.imag])
    )
    u = found.outputs([emf.real, emf.imag, y.real, y.imag])
    current = (emf - complex(u["b.v_re"], u["b.v_im"])) * y
    emt = standing(grid(network(load, B=0.4)), np.array([current.real, current.imag]))
    other = emt.outputs([current.real, current.imag])
    for name in ("a.v_re", "a.v_im", "load.p", "load.q"):
        assert other[name] == pytest.approx(u[name], abs=1e-9)


def test_in_a_phasor_network_a_swing_meets_the_law_and_not_its_lag():
    """A constant power draws no more at 1 Hz; a lag of first order lets 8 % of an impedance's swing through."""
    u = np.array([1.03, 0.05, 0.0, -200.0])
    at = standing(
        phasor_grid(network(Load("load", "a", 400.0, 100.0, active=POWER, reactive=POWER))), u
    )
    slow, fast = at.response(2j * np.pi, u), at.response(1e6j, u)
    for power in ("load.p", "load.q"):
        assert abs(fast[power, "unit.e_re"]) > 0.5
        assert abs(slow[power, "unit.e_re"]) < 0.005 * abs(fast[power, "unit.e_re"])


@pytest.mark.parametrize("make", [grid, phasor_grid])
def test_native_and_python_backed_fmus_give_the_same_bits(make):
    load = Load("load", "a", 400.0, 100.0, active=MIX, reactive=POWER, k_pf=1.0)
    model = make(network(load, B=0.4))

    def held(t):
        if make is grid:
            return {"unit.i_re": 20 + np.sin(50 * t), "unit.i_im": -1.0}
        return {"unit.e_re": 1.0, "unit.e_im": np.sin(5 * t), "unit.y_re": 0.0, "unit.y_im": -20.0}

    names = [v.name for v in (*model.states, *model.outputs)]
    one, other = (stepped(model, held, 0.02, names, native=native) for native in (True, False))
    assert np.ptp(one, axis=0).max() > 1e-3
    assert are_the_same(one, other, model)


# -- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (
            Load("odd", "a", 10.0, active=Zip(z=0.5, p=0.4)),
            "shares of its active power are z = 0.5.*must sum to 1",
        ),
        (
            Load("odd", "a", 10.0, active=POWER, v_min=0.1),
            "constant power down to v_min = 0.1 pu.*at least 0.3",
        ),
        (
            Load("odd", "a", 10.0, active=CURRENT, v_min=1.2),
            "has v_min = 1.2 pu; it must be from 0 to below 1",
        ),
        (Load("odd", "a", -10.0, active=POWER), "bus 'a' has neither a load with P > 0"),
    ],
)
def test_what_a_network_cannot_be(load, words):
    with pytest.raises(ValueError, match=words):
        network(load)


def test_a_lag_shorter_than_a_step_can_follow_is_refused():
    load = Load("quick", "a", 10.0, active=POWER, tau=5e-4)
    assert grid(network(load)).states
    with pytest.raises(
        ValueError,
        match=r"'quick' has the lag tau = 0.0005 s; in this network .* from 0.001 to 1 s",
    ):
        phasor_grid(network(load))


@pytest.mark.parametrize(("step", "taken"), [(5e-4, True), (6e-4, False), (1e-3, False)])
def test_a_phasor_networks_lag_has_two_internal_steps(step, taken):
    model = phasor_grid(network(Load("quick", "a", 10.0, active=POWER, tau=1e-3)))
    values = [{"internal_step": step}.get(v.name, v.start) for v in model.parameters]
    margins = np.array(model.requirements(values, Evaluated(model).c)).ravel()
    (margin,) = [
        margin
        for text, margin in zip(model.requirement_texts, margins, strict=True)
        if text.startswith("quick.tau must be at least 2 times internal_step")
    ]
    assert (margin > 0) == taken


def test_a_voltage_below_that_of_the_impedance_is_refused():
    model = grid(network(Load("low", "a", 10.0, active=POWER)))
    margins = dict(
        zip(
            model.requirement_texts,
            np.array(
                model.requirements(
                    [{"a.v_0": 0.6}.get(v.name, v.start) for v in model.parameters], []
                )
            ).ravel(),
            strict=True,
        )
    )
    (text,) = [text for text, margin in margins.items() if margin <= 0]
    assert "lower low.v_min" in text


def test_the_implicit_integrator_still_refuses_what_it_cannot_take():
    """A law that is not left out of the implicit part."""
    model = replace(grid(network(Load("load", "a", 10.0, active=POWER), B=0.1)), implicit=None)
    with pytest.raises(ValueError, match="not linear in its states"):
        c_source(model)


def test_a_constant_impedance_knows_nothing_of_laws():
    assert not [s.name for s in build_model("two_area_grid").states if ".c_" in s.name]
    assert build_model("two_area_grid").implicit is None
