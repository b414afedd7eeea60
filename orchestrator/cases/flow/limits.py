"""Limits of reactive power in a power flow: a bus whose units reach one feeds it, and its voltage follows."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.equations import FlowEquations
from orchestrator.cases.flow.newton import NewtonResult, solve
from orchestrator.core.errors import PowerFlowError

Limits = Mapping[str, tuple[float, float]]
"""Least and most reactive power of the units at a bus together [pu, 100 MVA], by bus."""

_TOUCHED = 1e-6  # reactive power [pu, 100 MVA] beyond a limit that does not count

_ROUNDED = 1e-3
"""Reactive power [pu, 100 MVA] beyond a limit that is not told: a program solves to 0.1 Mvar, and a file rounds."""

_ROUNDS = 40
_RETURNS = 2  # so many times a bus may get its voltage back; then it stays at its limit


@dataclass(frozen=True, slots=True)
class Excess:
    bus: str
    # reactive power that holding the voltage takes [pu, 100 MVA]; the limit itself where it is kept
    q: float
    limit: float  # the limit [pu, 100 MVA]
    # wanted, voltage: magnitude that the units would hold, and the one that it has [pu]
    wanted: float
    voltage: float

    @property
    def beyond(self) -> float:
        """How far the reactive power is beyond the limit [pu, 100 MVA]."""
        return abs(self.q - self.limit)

    def text(self, *, kept: bool) -> str:
        kind = "most" if self.q > self.limit else "least"
        limit = f"{self.limit * SYSTEM_BASE_MVA:.4g} Mvar"
        if kept:
            return f"{self.bus!r} at its limit of {limit}, voltage {self.voltage:.4f} instead of {self.wanted:.4f} pu"
        return f"{self.bus!r} feeds {self.q * SYSTEM_BASE_MVA:.4g} Mvar, its {kind} being {limit}"


def exceeded(equations: FlowEquations, voltages: np.ndarray, limits: Limits) -> list[Excess]:
    """The buses that hold their voltage with more or less reactive power than their units have."""
    q = equations.missing(voltages).imag
    found = []
    for k, bus in enumerate(equations.buses):
        if equations.held[k] and bus in limits:
            least, most = limits[bus]
            if q[k] > most + _TOUCHED or q[k] < least - _TOUCHED:
                limit = most if q[k] > most + _TOUCHED else least
                magnitude = float(abs(voltages[k]))
                found.append(
                    Excess(bus, float(q[k]), limit, float(equations.magnitudes[k]), magnitude)
                )
    return found


def worth_telling(found: Iterable[Excess]) -> tuple[Excess, ...]:
    """Return those further beyond their limit than a file's rounding, the furthest first."""
    told = (excess for excess in found if excess.beyond > _ROUNDED)
    return tuple(sorted(told, key=lambda excess: -excess.beyond))


def solve_with_limits(
    equations: FlowEquations, limits: Limits
) -> tuple[FlowEquations, NewtonResult, list[Excess]]:
    """Solve, and let every bus that exceeds a limit feed that limit instead of holding its voltage; the slack bus
    holds its own whatever it takes.

    Returns the equations that were solved at last, their result, and the buses at their limit."""
    position = {bus: k for k, bus in enumerate(equations.buses)}
    at_limit: dict[str, float] = {}
    returns = dict.fromkeys(limits, 0)
    current, result = equations, solve(equations)
    for _ in range(_ROUNDS):
        if not result.converged:
            return current, result, []
        new = [
            e
            for e in exceeded(current, result.voltages, limits)
            if position[e.bus] != equations.slack
        ]
        back = [
            bus
            for bus, limit in at_limit.items()
            if _can_hold(
                bus,
                limit,
                limits,
                abs(result.voltages[position[bus]]),
                equations.magnitudes[position[bus]],
            )
            and returns[bus] < _RETURNS
        ]
        if not new and not back:
            return current, result, _at_limits(equations, result, at_limit)
        at_limit |= {e.bus: e.limit for e in new}
        for bus in back:
            del at_limit[bus]
            returns[bus] += 1
        current = _with_fixed(equations, at_limit, position)
        result = solve(current)
    raise PowerFlowError(
        f"power flow: the buses at a limit of reactive power do not settle in {_ROUNDS} rounds: "
        f"{', '.join(map(repr, list(at_limit)[:5]))}; widen their limits, or write "
        "reactive_limits = false in [power_flow]"
    )


def _can_hold(bus: str, limit: float, limits: Limits, magnitude: float, wanted: float) -> bool:
    """Return whether a bus at a limit would hold its voltage with less: it is too high at most, or too low at least."""
    least, most = limits[bus]
    return least < most and (magnitude > wanted if limit == most else magnitude < wanted)


def _with_fixed(
    equations: FlowEquations, at_limit: Mapping[str, float], position: Mapping[str, int]
) -> FlowEquations:
    held, fed = equations.held.copy(), equations.fed.copy()
    for bus, limit in at_limit.items():
        held[position[bus]] = False
        fed[position[bus]] += 1j * limit
    return replace(equations, held=held, fed=fed)


def _at_limits(
    equations: FlowEquations, result: NewtonResult, at_limit: Mapping[str, float]
) -> list[Excess]:
    found = []
    for k, bus in enumerate(equations.buses):
        if bus in at_limit:
            voltage = float(abs(result.voltages[k]))
            found.append(
                Excess(bus, at_limit[bus], at_limit[bus], float(equations.magnitudes[k]), voltage)
            )
    return found
