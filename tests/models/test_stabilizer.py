"""The stabiliser PSS2A inside the generator, against its transfer functions as the standard draws them."""

import numpy as np
import pytest

from fmus.synchronous_generator.stabilization.norm631 import pss2a
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr
from tests.support.jacobians import jacobians


def response(frequency):
    """Gains from speed and from power to the signal, from the model's own linear equations."""
    m = ModelBuilder("alone", "The stabiliser alone")
    speed, power = (
        m.input("speed", "pu", "w − 1", base="f_n"),
        m.input("power", "pu", "P_e", base="S_n", start=0.9),
    )
    m.output("v_s", pss2a(m, speed, power, Expr(0.9)), "pu", "Signal", base="S_n")
    model = m.build()
    p = np.array([float(v.start) for v in model.parameters])
    c, x = model.initialise(p)
    u = np.array([0.0, 0.9])
    assert np.abs(np.array(model.derivatives(x, u, p, c))).max() < 1e-12
    A, B, C, D = (np.array(block) for block in jacobians(model)(x, u, p, c))
    s = 2j * np.pi * frequency
    return (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[0]


@pytest.mark.parametrize("frequency", [0.05, 0.2, 0.6, 1.0, 1.5, 5.0])
def test_it_is_the_standards_block_diagram(frequency):
    s = 2j * np.pi * frequency
    T_w, T_7, T_9, K_s1, K_s2, K_s3 = 2.0, 2.0, 0.1, 17.069, 0.158, 1.0
    washout, ramp = s * T_w / (1 + s * T_w), 1 / (1 + s * T_9) ** 5
    leads = (1 + 0.28 * s) / (1 + 0.04 * s) * (1 + 0.28 * s) / (1 + 0.12 * s)
    of_power = washout * K_s2 / (1 + s * T_7)
    found = response(frequency)
    assert found[0] == pytest.approx(K_s1 * leads * ramp * washout**2, rel=1e-9)
    assert found[1] == pytest.approx(K_s1 * leads * (ramp * K_s3 - 1) * of_power, rel=1e-9)


def test_the_generator_stands_still_with_it_and_it_can_be_switched_off():
    model = build_model("synchronous_generator_st4b_pss2a")
    names = [v.name for v in model.parameters]
    p = np.array([float(v.start) for v in model.parameters])
    p[names.index("transformer.R_t")] = 0.002  # losses count as power at the terminal
    c, x = model.initialise(p)
    assert np.abs(np.array(model.derivatives(x, np.array([1.0, 0.0]), p, c))).max() < 1e-11
    plain = build_model("synchronous_generator_st4b")
    p[names.index("pss.enabled")] = 0.0
    x_moved = np.array(x).ravel()
    x_moved[[s.name for s in model.states].index("machine.omega")] += 1e-3
    own = dict(
        zip(
            (s.name for s in model.states),
            np.array(model.derivatives(x_moved, np.array([1.0, 0.0]), p, c)).ravel(),
            strict=True,
        )
    )
    p_plain = np.array([p[names.index(v.name)] for v in plain.parameters])
    c_plain, _ = plain.initialise(p_plain)
    x_plain = np.array(
        [x_moved[[s.name for s in model.states].index(s.name)] for s in plain.states]
    )
    rates = np.array(plain.derivatives(x_plain, np.array([1.0, 0.0]), p_plain, c_plain)).ravel()
    for state, rate in zip(plain.states, rates, strict=True):
        assert own[state.name] == pytest.approx(rate, rel=1e-12, abs=1e-12)
