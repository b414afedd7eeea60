"""Why a power flow has no solution, in words: where its iterations ended, what helps, and the widest line."""

import math
from collections.abc import Callable

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow_equations import FlowEquations
from orchestrator.cases.flow_newton import CONVERGED, NewtonResult, grow, solve

_SHARES = (0.9, 0.75, 0.5, 0.25, 0.0)  # parts of the stray capacitance that are tried
_SHOWN = 6  # iterations whose mismatch is told


def explain(equations: FlowEquations, failed: NewtonResult, with_stray: Callable[[float], FlowEquations] | None) -> str:
    """Sentences about a power flow without a solution."""
    mismatch, bus = failed.history[-1]
    told = [f"{size * SYSTEM_BASE_MVA:.3g}" for size, _ in failed.history]
    left_out = [] if len(told) <= _SHOWN else ["…"]
    shown = ", ".join(told[: _SHOWN - 1] + left_out + told[-1:] if left_out else told)
    ends = f"{mismatch * SYSTEM_BASE_MVA:.3g} MW or Mvar unbalanced at bus {bus!r}"
    if mismatch <= CONVERGED:
        lowest = int(np.argmin(np.abs(failed.voltages)))
        ends = f"collapsed voltages, {abs(failed.voltages[lowest]):.3g} pu at bus {equations.buses[lowest]!r}"
    return (
        f"power flow: no solution found. The iterations end with {ends} "
        f"(largest mismatch by iteration: {shown}). {_helps(equations, with_stray)}"
        f"{widest_angle(equations)}"
    )


def _helps(equations: FlowEquations, with_stray: Callable[[float], FlowEquations] | None) -> str:
    """What makes it solvable: less stray capacitance, or less power."""
    share, _ = grow(equations)
    if with_stray is not None:
        for part in _SHARES:
            if solve(with_stray(part)).converged:
                return (
                    f"It has a solution with {part:.0%} of stray_B: stray capacitances raise the voltage behind large "
                    "reactances; lower stray_B. "
                )
    if share > 0:
        return (
            f"With all loads and all units' power at {share:.0%} it has a solution: the lines cannot carry the power "
            "asked of them. Lower P_0 or the loads, or the line reactances. "
        )
    return (
        "There is none without load and generation either: check line charging, shunts and reactances, which raise "
        "or lower voltages beyond what is possible. "
    )


def widest_angle(equations: FlowEquations) -> str:
    """A sentence that names the line with the largest angle in the DC solution."""
    closed = [line for line in equations.lines if line.closed]
    angles = equations.dc_angles()
    if not closed or not np.isfinite(angles).all():
        return ""
    position = {bus: k for k, bus in enumerate(equations.buses)}
    across = [angles[position[x.from_bus]] - angles[position[x.to_bus]] - x.shift for x in closed]
    worst = int(np.argmax(np.abs(across)))
    line, angle = closed[worst], across[worst]
    ends = (f"{bus!r} ({math.degrees(angles[position[bus]]):.1f} deg)" for bus in (line.from_bus, line.to_bus))
    carried = abs(angle) / abs(line.X * line.tap) * SYSTEM_BASE_MVA
    return (
        f"In the DC solution the largest angle, {abs(math.degrees(angle)):.1f} deg, is across {line.name!r} between "
        f"{' and '.join(ends)}, X = {line.X:g} pu, which would carry {carried:.0f} MW"
    )
