"""Parameter conversion and governor of the synchronous generator, against their defining formulas."""

import numpy as np
import pytest

from fmus.synchronous_generator.conversion import AxisData, RotorBranches, classical, exact
from fmus.synchronous_generator.data import GovernorData
from fmus.synchronous_generator.turbines.without_limits import ieeeg1
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr
from tests.support.jacobians import jacobians

OMEGA_B = 2 * np.pi * 50
AXES = {
    "SG1 d": (2.135, 0.34, 0.269, 0.234, 6.47, 0.022),
    "SG2 q": (1.7, 0.55, 0.25, 0.2, 0.4, 0.05),
}


def operational_reactance(s, X, X_l, b):
    """X(s) of the circuit: leakage, then magnetising reactance and two rotor branches side by side."""
    branches = [float(v) for v in (b.X_1, b.R_1, b.X_2, b.R_2)]
    sn = s / OMEGA_B
    admittance = (
        1 / (X - X_l)
        + sn / (branches[1] + sn * branches[0])
        + sn / (branches[3] + sn * branches[2])
    )
    return X_l + 1 / admittance


@pytest.mark.parametrize("data", AXES.values(), ids=AXES)
def test_exact_conversion_gives_the_standard_operational_reactance(data):
    X, X1, X2, X_l, T10, T20 = data
    b = exact(AxisData(*map(Expr, (X, X1, X2, X_l, T10, T20))), Expr(OMEGA_B))
    T1, T2 = T10 * X1 / X, T20 * X2 / X1
    for s in (0.3j, 5j, 40 + 200j, 3000j):
        wanted = X * (1 + s * T1) * (1 + s * T2) / ((1 + s * T10) * (1 + s * T20))
        assert operational_reactance(s, X, X_l, b) == pytest.approx(wanted, rel=1e-10)


@pytest.mark.parametrize("conversion", [classical, exact])
@pytest.mark.parametrize("data", AXES.values(), ids=AXES)
@pytest.mark.parametrize("missing", ["slow", "fast", "both"])
def test_a_winding_that_the_data_leave_out_is_not_there(data, missing, conversion):
    """X' = X: no slow branch, X'' = X': no fast one. One branch alone has one X(s), whichever way it is found."""
    X, X1, X2, X_l, T10, T20 = data
    X1 = X if missing in ("slow", "both") else X1
    X2 = X1 if missing in ("fast", "both") else X2
    T1, T2 = T10 * X1 / X, T20 * X2 / X1
    b = conversion(AxisData(*map(Expr, (X, X1, X2, X_l, T10, T20))), Expr(OMEGA_B))
    for s in (0.3j, 5j, 40 + 200j, 3000j):
        wanted = X * (1 + s * T1) * (1 + s * T2) / ((1 + s * T10) * (1 + s * T20))
        assert operational_reactance(s, X, X_l, b) == pytest.approx(wanted, rel=1e-7)


def test_a_damper_that_is_not_there_never_passes_for_the_field():
    """T''_0 means nothing where X'' = X'; one near T'_0 must not change the order of the branches."""
    b = exact(AxisData(*map(Expr, (0.9, 0.3, 0.3, 0.1, 4.0, 3.9))), Expr(OMEGA_B))
    assert float(b.X_2) > 1e6
    assert float(b.X_1) == pytest.approx(0.8 * 0.2 / 0.6)


MACHINES = [
    f"synchronous_generator_{e}{v}" for e in ("ac4a", "st1", "st4b") for v in ("", "_phasor")
]


@pytest.mark.parametrize("name", [*MACHINES, "synchronous_generator_st4b_pss2a"])
def test_every_machine_converts_its_data_in_the_same_way_unless_it_is_told(name):
    (start,) = (
        v.start for v in build_model(name).parameters if v.name == "machine.exact_conversion"
    )
    assert start == 0.0


def refused_by(values):
    """The rules that a machine with these parameters breaks."""
    model = build_model("synchronous_generator_ac4a")
    p = np.array([values.get(v.name, v.start) for v in model.parameters])
    c, _ = model.initialise(p)
    margins = np.array(model.requirements(p, c)).ravel()
    return [
        text
        for text, margin in zip(model.requirement_texts, margins, strict=True)
        if not margin > 0
    ]


@pytest.mark.parametrize("exactly", [0.0, 1.0])
@pytest.mark.parametrize(
    "values",
    [{"X_q1": 1.7}, {"X_q2": 0.55}, {"X_d2": 0.3}, {"X_q1": 1.7, "X_q2": 1.7}],
    ids=["no slow q winding", "no q damper", "no d damper", "nothing on q"],
)
def test_equal_reactances_are_data(values, exactly):
    named = {f"machine.{name}": value for name, value in values.items()}
    assert refused_by(named | {"machine.exact_conversion": exactly}) == []


@pytest.mark.parametrize(
    ("values", "rule"),
    [
        ({"X_q1": 1.71}, "machine.X_q1 must not exceed machine.X_q"),
        ({"X_q2": 0.56}, "machine.X_q2 must not exceed machine.X_q1"),
        ({"X_d1": 1.8}, "machine.X_d must exceed machine.X_d1"),
        ({"X_d2": 0.31}, "machine.X_d2 must not exceed machine.X_d1"),
        ({"X_l": 0.25}, "machine.X_d2 must exceed machine.X_l"),
        ({"T_d20": 30.0}, "machine.T_d10 must exceed machine.T_d20"),
        ({"T_q20": 0.4}, "machine.T_q10 must exceed machine.T_q20"),
    ],
)
def test_what_the_circuit_cannot_hold_is_refused(values, rule):
    assert rule in refused_by({f"machine.{name}": value for name, value in values.items()})


@pytest.mark.parametrize("data", AXES.values(), ids=AXES)
def test_classical_conversion_gives_the_subtransient_reactance_at_high_frequency(data):
    X, X1, X2, X_l, T10, T20 = data
    b = classical(AxisData(*map(Expr, (X, X1, X2, X_l, T10, T20))), Expr(OMEGA_B))
    assert operational_reactance(1e9j, X, X_l, b) == pytest.approx(X2, rel=1e-4)
    assert operational_reactance(1e-9j, X, X_l, b) == pytest.approx(X, rel=1e-6)


@pytest.mark.parametrize("data", AXES.values(), ids=AXES)
def test_classical_conversion_takes_the_branches_one_after_the_other(data):
    """The slow one alone has X' and T'_0; the fast one beside a slow one without resistance has X'' and T''_0."""
    X, X1, X2, X_l, T10, T20 = data
    b = classical(AxisData(*map(Expr, (X, X1, X2, X_l, T10, T20))), Expr(OMEGA_B))
    slow_alone = RotorBranches(b.X_1, b.R_1, b.X_2, Expr(1e12))
    fast_alone = RotorBranches(b.X_1, Expr(0), b.X_2, b.R_2)
    for s in (0.3j, 5j, 40 + 200j, 3000j):
        wanted = X * (1 + s * T10 * X1 / X) / (1 + s * T10)
        assert operational_reactance(s, X, X_l, slow_alone) == pytest.approx(wanted, rel=1e-7)
        wanted = X1 * (1 + s * T20 * X2 / X1) / (1 + s * T20)
        assert operational_reactance(s, X, X_l, fast_alone) == pytest.approx(wanted, rel=1e-7)


@pytest.mark.parametrize(
    ("T", "K"),
    [
        ((0, 0, 0.1, 0.3, 7, 0.6, 0), (0.3, 0, 0.3, 0, 0.4, 0, 0, 0)),
        ((7.5, 2.8, 0.1, 0.25, 7.5, 7.5, 0.4), (0.22, 0, 0, 0.22, 0.14, 0.14, 0.14, 0.14)),
    ],
)
def test_governor_is_its_block_diagram(T, K):
    m = ModelBuilder("governor", "IEEEG1 alone")
    w = m.input("w", "pu", "Speed", base="f_n", start=1.0)
    m.output(
        "P_m",
        ieeeg1(m, w, Expr(0.7), GovernorData(20.0, T, K, "")),
        "pu",
        "Mechanical power",
        base="S_n",
    )
    model = m.build()
    p = np.array([v.start for v in model.parameters])
    c, x = model.initialise(p)
    assert model.outputs_function(x, [1.0], p, c)[0][0] == pytest.approx(0.7)
    A, B, C, D = (np.array(block) for block in jacobians(model)(x, [1.0], p, c))
    for s in (0.1j, 3.6j, 40j):
        found = (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[0, 0]
        signal, wanted = -20 * (1 + s * T[1]) / (1 + s * T[0]) / (1 + s * T[2]), 0
        for stage in range(4):
            signal /= 1 + s * T[3 + stage]
            wanted += (K[2 * stage] + K[2 * stage + 1]) * signal
        assert found == pytest.approx(wanted, rel=1e-10)


@pytest.mark.parametrize("variant", ["", "_phasor"])
@pytest.mark.parametrize(
    "name", ["gfor", *(f"synchronous_generator_{e}" for e in ("ac4a", "st1", "st4b"))]
)
def test_any_dispatch_starts_in_steady_state(name, variant):
    model = build_model(name + variant)
    rng = np.random.default_rng(7)
    for _ in range(20):
        start = {"P_0": rng.uniform(-0.3, 0.95), "Q_0": rng.uniform(-0.3, 0.3)}
        start |= {"v_0": rng.uniform(0.95, 1.05), "theta_0": rng.uniform(-3, 3)}
        p = np.array([start.get(v.name, v.start) for v in model.parameters])
        c, x = model.initialise(p)
        u = [start["v_0"] * np.cos(start["theta_0"]), start["v_0"] * np.sin(start["theta_0"])]
        rates = np.array(model.derivatives(x, u, p, c))
        # [1/s]; the network's own rates are near 1e4 times the rounding error
        assert np.abs(rates).max() < 1e-8
        y = dict(
            zip(
                (o.name for o in model.outputs),
                np.array(model.outputs_function(x, u, p, c)).ravel(),
                strict=True,
            )
        )
        assert (y["p"], y["q"]) == pytest.approx((start["P_0"], start["Q_0"]), abs=1e-12)


@pytest.mark.parametrize("q", [0.4, -0.3])
def test_saturation_is_that_of_the_flux_behind_the_leakage(q):
    """Which a machine that gives reactive power has above its port's voltage, and one that takes some below it."""
    model = build_model("synchronous_generator_st4b")
    start = {v.name: float(v.start) for v in model.parameters}
    values = start | {"v_0": 1.0, "theta_0": 0.0, "P_0": 0.6, "Q_0": q, "machine.saturation": 1.0}
    c, _ = model.initialise(np.array([values[v.name] for v in model.parameters]))
    factor = next(
        k for k, v in enumerate(model.calculated) if v.name == "machine.saturation_factor"
    )
    R = values["machine.R_s"] + values["transformer.R_t"]
    X = values["machine.X_l"] + values["transformer.X_t"]
    flux = abs(1.0 + complex(R, X) * complex(0.6, -q))
    s_10, s_12 = values["machine.s_10"], values["machine.s_12"]
    assert float(c[factor]) == pytest.approx(1 + s_10 * flux ** (np.log(s_12 / s_10) / np.log(1.2)))


def test_saturation_passes_through_its_two_points():
    model = build_model("synchronous_generator_st4b")
    factor = next(
        k for k, v in enumerate(model.calculated) if v.name == "machine.saturation_factor"
    )
    names = [v.name for v in model.parameters]
    for flux, s in ((1.0, 0.1275), (1.2, 0.2706)):
        values = {"v_0": flux, "P_0": 0.0, "Q_0": 0.0, "machine.saturation": 1.0}
        p = np.array([values.get(n, v.start) for n, v in zip(names, model.parameters, strict=True)])
        c, _ = model.initialise(p)
        assert float(c[factor]) == pytest.approx(1 + s)
