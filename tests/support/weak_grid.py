"""Modes of one device behind a bus with capacitance and a line to a stiff source, from exact Jacobians."""

import numpy as np

from fmus.toolchain.catalogue import build_model
from tests.support.evaluated import Evaluated

RATING, P, B = 1500.0, 0.9, 0.02
"""Rating of the device [MVA], its power and the bus's capacitance [pu of the rating]."""


def coupled_modes(model, scr, **values):
    """Eigenvalues [1/s] at a short-circuit ratio; the source's own angle is left out."""
    device = Evaluated(build_model(model), {"P_0": P, **values})
    in_pu = RATING / 100
    line = {"X": 1 / scr / in_pu, "R": 0.0, "B": B * in_pu, "load.P": 0.0, "P_0": P * in_pu}
    grid = Evaluated(build_model("infinite_bus"), line)
    A, B_v, C, D = device.blocks([1.0, 0.0])
    assert not D[:2].any()
    outputs = [v.name for v in device.model.outputs]
    C_i = C[[outputs.index("i_re"), outputs.index("i_im")]]
    A_g, B_i, C_v, _ = grid.blocks([P * in_pu, 0.0])
    whole = np.block([[A, B_v @ C_v[:2]], [B_i @ C_i, A_g]])
    kept = [
        k
        for k, v in enumerate([*device.model.states, *grid.model.states])
        if v.name not in ("source.theta", "clock.t")
    ]
    return np.linalg.eigvals(whole[np.ix_(kept, kept)])


def least_stable(model, scr, **values):
    """The eigenvalue with the largest real part."""
    modes = coupled_modes(model, scr, **values)
    return modes[np.argmax(modes.real)]
