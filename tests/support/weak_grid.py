"""Modes of one device behind a bus with capacitance and a line to a stiff source, from exact Jacobians."""

from functools import cache

import numpy as np

from fmus.toolchain.catalogue import build_model
from tests.support.evaluated import Evaluated

RATING, P, B = 1500.0, 0.9, 0.02
"""Rating of the device [MVA], its power and the bus's capacitance [pu of the rating]."""


def coupled_modes(model, scr, **values):
    """Eigenvalues [1/s] at a short-circuit ratio; the source's own angle is left out."""
    (A, B_v, C_i), states = _device(model, tuple(values.items()))
    (A_g, B_i, C_v), states_of_grid = _grid(scr)
    whole = np.block([[A, B_v @ C_v], [B_i @ C_i, A_g]])
    kept = [
        k
        for k, name in enumerate([*states, *states_of_grid])
        if name not in ("source.theta", "clock.t")
    ]
    return np.linalg.eigvals(whole[np.ix_(kept, kept)])


@cache
def _device(model, values):
    """Its matrices from voltages to currents, and the names of its states: the same at every grid."""
    device = Evaluated(build_model(model), {"P_0": P, **dict(values)})
    A, B_v, C, D = device.blocks([1.0, 0.0])
    assert not D[:2].any()
    outputs = [v.name for v in device.model.outputs]
    C_i = C[[outputs.index("i_re"), outputs.index("i_im")]]
    return (A, B_v, C_i), [v.name for v in device.model.states]


@cache
def _grid(scr):
    """The same of the source behind its line, from currents to voltages: the same for every device."""
    in_pu = RATING / 100
    line = {"X": 1 / scr / in_pu, "R": 0.0, "B": B * in_pu, "load.P": 0.0, "P_0": P * in_pu}
    grid = Evaluated(build_model("infinite_bus"), line)
    A, B_i, C_v, _ = grid.blocks([P * in_pu, 0.0])
    return (A, B_i, C_v[:2]), [v.name for v in grid.model.states]


def least_stable(model, scr, **values):
    """The eigenvalue with the largest real part."""
    modes = coupled_modes(model, scr, **values)
    return modes[np.argmax(modes.real)]
