"""The POD controller's transfer function, sign, limit and switch, against the block diagram's formula."""

import numpy as np
import pytest

from fmus.toolchain.model_builder import ModelBuilder
from gfor_fmu.pod import pod
from tests.support.jacobians import jacobians


def controller(sign):
    """A model that is one controller between an input and an output."""
    m = ModelBuilder("alone", "One POD controller")
    u = m.input("u", "pu", "Frequency deviation", base="f_n")
    m.output(
        "y",
        pod(m, "pod", u, sign=sign, T_S1=0.2, T_S2=0.37),
        "pu",
        "Supplementary reference",
        base="S_n",
    )
    return m.build()


def vector(model, **values):
    values = {f"pod.{name}": value for name, value in values.items()}
    return np.array([values.get(v.name, v.start) for v in model.parameters])


@pytest.mark.parametrize("sign", [-1, +1])
@pytest.mark.parametrize("N_S", [0, 1, 2, 3])
@pytest.mark.parametrize(("T_S1", "T_S2"), [(0.2, 0.37), (0.31, 0.08), (0.0, 0.0)])
def test_transfer_function_is_the_block_diagrams(sign, N_S, T_S1, T_S2):
    model = controller(sign)
    p = vector(model, enabled=1, N_S=N_S, T_S1=T_S1, T_S2=T_S2, K=150)
    c, x = model.initialise(p)
    A, B, C, D = (np.array(block) for block in jacobians(model)(x, [0.0], p, c))
    for frequency in (0.05, 0.58, 2.0, 30.0):
        s = 2j * np.pi * frequency
        found = (C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)[0, 0]
        stage = (1 + s * T_S1) / (1 + s * T_S2)
        wanted = sign * 150 * s * 5.0 / (1 + s * 5.0) / (1 + s * 0.1) * stage**N_S
        assert found == pytest.approx(wanted, rel=1e-10)
    assert D[0, 0] == 0  # T_f keeps the controller out of any algebraic loop


@pytest.mark.parametrize(("state", "wanted"), [(1.0, -0.2), (-1.0, 0.2), (1e-4, -0.02)])
def test_output_is_clamped(state, wanted):
    model = controller(-1)
    p = vector(model, enabled=1, N_S=0)
    names = [s.name for s in model.states]
    x = np.zeros(len(names))
    x[names.index("pod.low_pass")] = state
    assert model.outputs_function(x, [0.0], p, [])[0][0] == pytest.approx(wanted)
    assert model.outputs_function(x, [0.0], vector(model, enabled=0, N_S=0), [])[0][0] == 0.0


@pytest.mark.parametrize(
    ("T_S1", "T_S2", "kept"),
    [(0.0, 0.0, True), (0.2, 0.0, False), (0.2, 0.05, True), (0.2, 1e-6, False)],
)
def test_a_stage_without_a_lag_has_no_lead(T_S1, T_S2, kept):
    model = controller(1)
    p = vector(model, T_S1=T_S1, T_S2=T_S2)
    assert bool((np.array(model.requirements(p, model.initialise(p)[0])) > 0).all()) is kept
