"""The operating point: the fixed point of the coupled step map. It is verified, and solved for if the system moves.

A simulation never settles at an unstable equilibrium, but an equation can be solved for it. Only single communication
steps are simulated here."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError, ErrorKind
from orchestrator.core.options import Option, command
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.device_start import misfits_of, sentences
from orchestrator.linear.models.drifting_states import (
    HeldState,
    examine_held,
    held_names,
    hold,
    release,
)
from orchestrator.linear.models.linear_model import HELD
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.periodic import find_periodic_point
from orchestrator.linear.models.sampled import steps_of_period
from orchestrator.linear.models.waiting_relays import hold_waiting_relays
from orchestrator.systems.coupling.imperfections import described
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.schedule import gauss_seidel

# far above the rounding in a computed eigenvalue 1, and far below 1 − |μ| of the slowest mode
_SHIFT = 1e-7
_STORES = 20  # states that go on at rest, above which they are not taken for stores
_SHORT = 1e-4  # for steps shorter than this [s], the accepted change is a rate per second


@dataclass(frozen=True)
class OperatingPoint:
    # largest change of any state over one communication step [the state's unit, mostly pu]
    residual: float
    drift: float  # largest rate of change of any state [the state's unit per second]
    initial_residual: float  # residual at the power flow's operating point, before any correction
    # number of Newton iterations; 0 if the power flow's point is a steady state already
    iterations: int
    states: dict[str, float]  # values of the states by ``component.state``
    # those that go on at rest and move no port: they are held, and no part of the linear model
    held: tuple[HeldState, ...] = ()


def find_operating_point(
    master: Master, tolerance: float = 1e-9, accept: float = 1e-12, max_iterations: int = 20
) -> OperatingPoint:
    """Verify that the initialised system stands still, or move it to a steady state.

    ``tolerance``: largest accepted change of a state over one communication step of 100 µs or more; proportionally less
    over a shorter step.
    ``accept``: below this change, the power flow's point is taken as it is. Between ``accept`` and ``tolerance`` a
    better point is searched for, and kept if it is better."""
    waiting = hold_waiting_relays(master)
    steps = steps_of_period(master, master.clock.step_size)
    if steps > 1:
        return _periodic_point(master, steps, tolerance, accept, max_iterations)
    # the same drift is accepted however short the step is
    tolerance *= min(1.0, master.clock.step_size / _SHORT)
    start = CoupledState(master).read()
    found = _search(master, accept, max_iterations)
    held = examine_held(master, [name for name in held_names(master) if name not in waiting])
    if not found.residual <= tolerance:
        found, held = _beside_stores(master, start, found, tolerance, accept, max_iterations)
    values = dict(zip(found.names, found.x.tolist(), strict=True))
    drift = found.residual / master.clock.step_size
    return OperatingPoint(found.residual, drift, found.first, found.iterations, values, held)


def begin_at(master: Master, states: Mapping[str, float]) -> None:
    """Begin where a system much like this one stands still, if this one moves less there than at its own start.

    ``states``: values by ``component.state``; a state that is not among them keeps its own."""
    state = CoupledState(master)
    own = state.read()
    names = _state_names(master)
    known = np.array([states.get(name, x) for name, x in zip(names, own.tolist(), strict=True)])
    if _largest(state.step_from(known) - known) < _largest(state.step_from(own) - own):
        state.write(known)


def _state_names(master: Master) -> tuple[str, ...]:
    components = master.components.items()
    return tuple(f"{name}.{state}" for name, c in components for state in c.description.states)


@dataclass(frozen=True)
class _Search:
    """Where Newton's method came: the states and their change over a communication step."""

    names: tuple[str, ...]
    x: Matrix
    change: Matrix
    first: float  # largest change at the start
    iterations: int

    @property
    def residual(self) -> float:
        return _largest(self.change)


def _search(master: Master, accept: float, max_iterations: int) -> _Search:
    state = CoupledState(master)
    x = state.read()
    change = state.step_from(x) - x
    first = residual = _largest(change)
    # one size of perturbation, unless its direction is worth little: a limit is close
    once = True
    iterations = 0
    while residual > accept and iterations < max_iterations:
        candidate = x + _newton_correction(master, len(x), change, once=once)
        state.write(candidate)
        new_change = state.step_from(candidate) - candidate
        if not _largest(new_change) < residual:
            state.write(x)
            if not once:
                break
            once = False
            continue
        once = once and _largest(new_change) < residual / 10
        x, change, residual = candidate, new_change, _largest(new_change)
        iterations += 1
    return _Search(_state_names(master), x, change, first, iterations)


def _beside_stores(
    master: Master,
    start: Matrix,
    found: _Search,
    tolerance: float,
    accept: float,
    max_iterations: int,
) -> tuple[_Search, tuple[HeldState, ...]]:
    """Search again with the states held that go on; raise if they are no stores, or the others do not rest either."""
    going = [
        name
        for name, change in zip(found.names, found.change.tolist(), strict=True)
        if abs(change) > tolerance and _may_be_store(master, name)
    ]
    reason = ""
    if going and len(going) <= _STORES:
        state = CoupledState(master)
        state.write(start)
        hold(master, going)
        again = _search(master, accept, max_iterations)
        if again.residual <= tolerance:
            held = examine_held(master, going)
            reasons = [one.reason for one in held if one.reason]
            if not reasons:
                return again, held
            reason = reasons[0] if all(one.looks_silent for one in held) else ""
        release(master, going)
        state.write(found.x)
    worst = ", ".join(
        f"{found.names[i]} ({found.change[i]:+.3g})" for i in np.argsort(-np.abs(found.change))[:3]
    )
    changes = f"{_newton_in_words(found.iterations)} a communication step changes {worst}, more than {tolerance:g}"
    if reason:
        raise AnalysisError(
            f"no steady state found: {reason}, so that it is no store which could be held; `gfor run` simulates it, "
            "and " + command("modes CASE", Option.BLACK_BOX) + " measures its component as it is",
            kind=ErrorKind.STEADY_STATE,
        )
    present = described(master.system.wires)
    if present:
        raise AnalysisError(
            f"no steady state found with {'; '.join(present)}: leave it out, or let it begin later, as an event "
            f"([[events]] with a time); {changes}",
            kind=ErrorKind.STEADY_STATE,
        )
    raise AnalysisError(
        f"no steady state found: {changes}; " + what_to_check(master),
        kind=ErrorKind.STEADY_STATE,
    )


def _may_be_store(master: Master, state: str) -> bool:
    """Return whether a state can be held beside a port; without a port that it could move, it is all there is."""
    component = state.partition(".")[0]
    coupled = master.exchanges[component].outputs.names
    return bool(coupled) and master.components[component].description.states_are_settable


def _periodic_point(
    master: Master, steps: int, tolerance: float, accept: float, most: int
) -> OperatingPoint:
    """The same with sampled controllers: all must repeat after a period, and the limits are those of all its steps."""
    found = find_periodic_point(master, accept * steps, most)
    period = steps * master.clock.step_size
    tolerance *= steps * min(1.0, master.clock.step_size / _SHORT)
    if not found.residual <= tolerance:
        worst = ", ".join(
            f"{found.names[i]} ({found.change[i]:+.3g})"
            for i in np.argsort(-np.abs(found.change))[:3]
        )
        raise AnalysisError(
            f"no steady state found: {_newton_in_words(found.iterations)} a period of {period:g} s, after which "
            f"sampled controllers repeat, changes {worst}, more than {tolerance:g}; "
            + what_to_check(master),
            kind=ErrorKind.STEADY_STATE,
        )
    values = {
        name: x
        for name, x in zip(found.names, found.x.tolist(), strict=True)
        if not name.endswith(HELD)
    }
    return OperatingPoint(
        found.residual, found.residual / period, found.first, found.iterations, values
    )


def what_to_check(master: Master) -> str:
    """Where to look for the reason why an initialised system does not stand still."""
    if master.late_starts:
        late = "; ".join(late.text for late in master.late_starts.values())
        return (
            f"{late}. Its partners started from the first value: have the FMU compute its "
            "outputs in initialisation mode ("
            + command("fmu check", (Option.ONLY, "initial_outputs"))
            + " shows it alone)"
        )
    misfits = sentences(misfits_of(master))
    if misfits:
        return "; ".join(misfits)
    return (
        "check the start values of the component of these states, which for a model of yours are the arguments of its "
        "blocks at the operating point; then whether generation and load balance at rated frequency"
    )


def _newton_in_words(iterations: int) -> str:
    """How far Newton's method came; it ends where a further iteration makes nothing better."""
    if not iterations:
        return "Newton's method finds nothing better than the start that the power flow gives, and from there"
    return f"after {iterations} Newton iteration{'s' * (iterations > 1)}"


def _largest(change: Matrix) -> float:
    return float(np.abs(change).max(initial=0.0))


def _newton_correction(master: Master, n: int, change: Matrix, *, once: bool) -> Matrix:
    """Solve (I − A)·dx = change. Outputs that the exchange holds follow from the states."""
    schedule = gauss_seidel(master.schedule.groups)
    model = compose(Blocks(master, schedule=schedule, once=once), schedule)
    right = np.zeros(len(model.names))
    right[:n] = change
    # A turn of all angles changes nothing, so I − A is singular. The shift keeps the solution from moving along it.
    solved = model.shifted(1 + _SHIFT).solve_exactly(right)
    solution: Matrix = -np.real(solved)[:n]  # a divided hub solves in complex numbers
    return solution
