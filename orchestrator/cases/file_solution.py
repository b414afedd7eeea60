"""Whether the voltages that a network's file holds as its solution fit the other data of the file.

Powers are balanced at every bus with the file's own voltages, so that a mistake is seen where it is: a load at another
bus, a shunt's sign, an impedance on another base, a branch that is open, a phase shift that is none."""

import cmath
from collections.abc import Mapping

import numpy as np
from scipy.sparse.linalg import spsolve

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.arrays import Matrix
from orchestrator.cases.flow_balance import FlowLine, FlowLoad, FlowShunt, inner_buses, legs_of
from orchestrator.cases.flow_equations import FlowEquations
from orchestrator.cases.network_import import ImportedNetwork, bus_of

_VM, _VA = 7, 8  # columns of MATPOWER's table
_SMALL = 1e-3  # part of the file's load that may be out of balance at a bus
_SHOWN = 3  # buses that are named; the others are counted

NOT_SOLVED = (
    "the file is not solved: every bus has VA = 0. The power flow is computed here, and what PSS/E takes from VM "
    "(parts of loads, some generators' voltages) is that of the file; export the solved case"
)


def misfit_of(network: ImportedNetwork, bus: Matrix, labels: Mapping[int, str], unsolved: str = "") -> str:
    """What does not fit; "" where all does, and ``unsolved`` where the file has no solution.

    ``bus``: MATPOWER's table with the voltages [pu, degrees]; ``labels``: names of its buses by number."""
    stated = {bus_of(labels[int(r[0])]): cmath.rect(r[_VM], np.radians(r[_VA])) for r in bus if r[_VM] > 0}
    if network.slack not in stated or not bus[:, _VA].any():
        return unsolved
    places = [place for place in network.buses if place in stated]
    stars = [place for place in network.buses if place not in stated]  # of transformers with an open winding
    buses = [*places, *stars, *(inner for x in network.transformers for inner in inner_buses(x))]
    lines = [FlowLine(x.name, x.from_bus, x.to_bus, x.R, x.X, x.B, x.tap, x.shift) for x in network.lines]
    equations = FlowEquations.of(
        buses, [*lines, *(leg for x in network.transformers for leg in legs_of(x))],
        [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in network.loads],
        [FlowShunt(x.bus, x.g_mw / SYSTEM_BASE_MVA, x.b_mvar / SYSTEM_BASE_MVA) for x in network.shunts],
        {place: g.p_mw / SYSTEM_BASE_MVA for place, g in network.generation.items()}, {}, network.slack,
    )  # fmt: skip
    known, matrix = len(places), equations.matrix
    voltages = np.array([*(stated[place] for place in places), *[1 + 0j] * (len(buses) - known)])
    if known < len(buses):
        inside = matrix[known:]
        voltages[known:] = np.atleast_1d(spsolve(inside[:, known:].tocsc(), -inside[:, :known] @ voltages[:known]))
    left = SYSTEM_BASE_MVA * (equations.fed - equations.powers(voltages))
    units = [k for k, place in enumerate(places) if place in network.generation]
    left[units], left[[equations.slack, *range(known, len(buses))]] = left[units].real, 0
    rounding = _rounding(bus[:, _VM]) + np.radians(_rounding(bus[:, _VA]))
    noise = SYSTEM_BASE_MVA * rounding * abs(voltages) * (abs(matrix) @ np.ones(len(buses)))
    load = sum(x.p_mw for x in network.loads if x.p_mw > 0)
    found = [int(k) for k in np.argsort(-abs(left)) if abs(left[k]) > noise[k] + _SMALL * load]
    return _sentence({buses[k]: left[k] for k in found}, known) if found else ""


def _sentence(left: Mapping[str, complex], buses: int) -> str:
    shown = [f"{p.real:+.4g} MW {p.imag:+.4g} Mvar at {place}" for place, p in [*left.items()][:_SHOWN]]
    more = f" and less at {len(left) - _SHOWN} more" if len(left) > _SHOWN else ""
    if len(left) == 1:
        likely = "its load, its shunt, its unit's power or a branch to a bus with a unit"
    elif 2 * len(left) > buses:
        likely = "voltages of another case, or angles that are not in degrees"
    else:
        likely = "a branch between these buses (its status, ratio, shift, impedance and base), or a load at the other"
    return (
        "the file's own solution (VM, VA) does not fit its data, so the power flow computed here is another: with "
        f"these voltages its data feed, beyond what the network takes away, {', '.join(shown)}{more}; look at {likely}"
    )


def _rounding(values: np.ndarray) -> float:
    """Half of the last digit to which numbers are given."""
    return next(0.5 * 10.0**-d for d in range(16) if d == 15 or not (np.round(values, d) - values).any())
