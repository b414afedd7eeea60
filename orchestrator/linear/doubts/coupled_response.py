"""Comparison of a coupled system's linear model with the response of its FMUs. It is made for systems with a foreign
FMU.

A step map is found from single communication steps and from the states that the FMUs declare. It is wrong without any
sign if an FMU has undeclared states, or if a controller is sampled and a step contains no sample. Therefore all states
are disturbed a little, the FMUs run for a while, and their states must follow z⁺ = A·z."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import ComponentError
from orchestrator.core.options import Option
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.delays import links_of, values_on_the_way
from orchestrator.linear.models.linear_model import HELD, IDENTIFIED, LinearModel
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.remembered import is_ours_in
from orchestrator.linear.spectra.stability import Stability
from orchestrator.systems.coupling.master import Master

SIZES = (1e-4, 1e-5, 1e-6)
"""Disturbances of the states, relative to max(1, |value|); a smaller one is tried where the larger does not agree. The
last is that of the perturbation: a controller with dead bands or limits close by is linear for nothing larger."""

LARGEST_ERROR = 0.05
"""Accepted error, as a part of the response's size in the same window. Our own converter in the two-area system stays
at 0.25 %. The error of a model that lacks a growing mode exceeds every limit."""

_FLOOR = 0.01
"""Least size to which errors are related, as a part of the state's largest response and of the disturbance. Smaller
responses lie within the integrators' tolerances."""

_CURVATURE = 0.05
"""Difference between the departures at the two larger sizes, each divided by the cube of its size, up to which they
are smooth curvature. A limit or a dead band has no such law."""

_SECONDS = 5.0  # longest simulated time for which a response is followed [s]
_WALL = 8.0  # longest computing time for it [s]
_LEAST = 0.1  # least simulated time, however long it takes [s]
_SHORT = 1.0  # simulated time below which the verdict states how short it was [s]

_SAMPLE = 5e-3  # between compared points [s]
_WINDOWS = 10  # windows of the response, each with an error relative to its own size
_DENSE = 500  # up to this number of states, a power of the step map costs less than single steps
# a state stands still if its elements of the step map differ from a constant's by less: rounding
_STANDS = 1e-10
# a state should move if its declared derivatives, times the step, exceed this
_MOVES = 1e-7


@dataclass(frozen=True)
class Disagreement:
    state: str  # name ``component.state``
    time: float  # after the disturbance [s]
    error: float  # relative to the response's size at that time
    seconds: float  # how long the response was followed [s]
    size: float  # of the disturbance, one of `SIZES`
    # whether the disagreement at the size before is that of a curve, and of no edge
    smooth: bool = True


def foreign_components(master: Master) -> list[str]:
    """Components whose FMU this machine's own toolchain did not build."""
    return [name for name in master.system.components if not is_ours_in(master, name)]


def confirmed(
    master: Master, blocks: Blocks, model: LinearModel, stability: Stability
) -> Stability:
    """The verdict on a system, or "not known" if the linear model calls it stable and the response of a foreign FMU
    differs."""
    if not stability.stable:
        return stability
    foreign = [name for name in foreign_components(master) if blocks.how[name] != IDENTIFIED]
    if not foreign:
        return stability
    reason = _standstill(blocks, foreign)
    if not reason and IDENTIFIED not in blocks.how.values() and not master.schedule.wire_by_wire:
        # The states of an identified model cannot be set in its FMU; wire by wire, a second exchange changes values.
        reason, remark = _departure(master, model, foreign)
        stability = replace(stability, reason="; ".join(t for t in (stability.reason, remark) if t))
    return replace(stability, stable=None, reason=reason) if reason else stability


def _standstill(blocks: Blocks, foreign: Sequence[str]) -> str:
    """The reason why a component has no usable step map: its states stand still in a step although their derivatives
    are not zero."""
    for name in foreign:
        c = blocks.components[name]
        rows = np.abs(np.hstack([c.A - np.eye(len(c.A)), c.B])).max(axis=1, initial=0.0) <= _STANDS
        if c.A_c is not None and c.B_c is not None:
            rows &= (
                np.abs(np.hstack([c.A_c, c.B_c])).max(axis=1, initial=0.0) * blocks.step_size
                > _MOVES
            )
        elif not rows.all():
            continue
        if rows.any():
            states = ", ".join(s for s, still in zip(c.states, rows, strict=True) if still)
            return (
                f"component {name!r} stands still over a communication step of "
                f"{blocks.step_size:g} s ({states}), whatever its states and inputs are, so "
                "its linear model is none. Is its control sampled? Take a step that contains "
                "a sample, or identify it with " + Option.BLACK_BOX
            )
    return ""


def _departure(master: Master, model: LinearModel, foreign: Sequence[str]) -> tuple[str, str]:
    """Sentences on the difference between the FMUs' response and the model's, or on limits of the comparison; empty
    without either."""
    try:
        found = worst_disagreement(master, model)
    except ComponentError as error:
        return (
            f"after a small disturbance the FMUs cannot be run to confirm the linear model: {error}",
            "",
        )
    of = found.state.partition(".")[0]
    whose = (
        f"component {of!r}"
        if of in foreign
        else f"the system with the foreign FMU of {', '.join(foreign)}"
    )
    if not found.error > LARGEST_ERROR:
        if found.size == SIZES[-1] and not found.smooth:
            return (
                f"the system with the foreign FMU of {', '.join(foreign)} answers as its linear model does after a "
                f"disturbance of {found.size:g} of each state, and not after one of {SIZES[-2]:g}: a limit or a dead "
                "band is near, and the modes hold for nothing larger. Simulate it with `gfor run`"
            ), ""
        short = f"the FMU of {', '.join(foreign)} was followed for {found.seconds:.2g} s only"
        return "", short if found.seconds < _SHORT else ""
    return (
        f"{whose} does not answer as its linear model does: {found.time:.3g} s after a small disturbance {found.state} "
        f"differs by {100 * found.error:.3g} % of the response, where {100 * LARGEST_ERROR:g} % is allowed. "
        f"{_likely_reason(master, [of] if of in foreign else foreign)} Simulate it with `gfor run`"
    ), ""


def _likely_reason(master: Master, foreign: Sequence[str]) -> str:
    """Return what may explain a departure; a control that is declared as sampled declares what it keeps as well."""
    if all(master.components[name].description.sample_time is not None for name in foreign):
        return "It declares its samples and its states: does it reach a limit, a dead band or another mode so soon?"
    return (
        "Does the FMU keep states that it does not declare, or is its control sampled? Ask for an export that declares "
        "all its states."
    )


def worst_disagreement(master: Master, model: LinearModel) -> Disagreement:
    """Disturb all states, run the FMUs, and compare with z⁺ = A·z; the smallest disagreement of all `SIZES`."""
    state = CoupledState(master)
    x_0 = state.read()
    settable = np.concatenate(
        [
            np.full(len(c.description.states), c.description.states_are_settable)
            for c in master.components.values()
        ]
    )
    # Random signs excite every mode. They are the same in every call.
    shape = (
        np.random.default_rng(1).choice([-1.0, 1.0], len(x_0))
        * np.maximum(1.0, np.abs(x_0))
        * settable
    )
    every = model.period * max(1, round(_SAMPLE / (model.period * master.clock.step_size)))

    def departure(size: float, times: int | None = None) -> _Departure:
        measured, start = _response(
            master, state, model=model, x_0=x_0, disturbance=size * shape, every=every, times=times
        )
        expected = _predicted(model, start, every, len(measured))[:, : len(x_0)]
        return _compare(measured, expected, size, np.maximum(1.0, np.abs(x_0)))

    tried: list[_Departure] = []
    for size in SIZES:
        tried.append(departure(size))
        if tried[-1].relative.max() <= LARGEST_ERROR:
            break
    best = min(tried, key=lambda departure: float(departure.relative.max()))
    k, i = np.unravel_index(np.argmax(best.relative), best.relative.shape)
    interval, error = every * (model.step_size or 0.0), float(best.relative[k, i])
    smooth = True
    if best.size == SIZES[-1] and error <= LARGEST_ERROR:
        larger, smaller = tried[:2]
        if len(larger.difference) < len(
            smaller.difference
        ):  # the computing time ended it, and not the model
            larger = departure(larger.size, len(smaller.difference))
        smooth = _is_curvature(larger, smaller)
    return Disagreement(
        model.names[i],
        float(k + 1) * interval,
        error,
        len(best.relative) * interval,
        best.size,
        smooth,
    )


def _response(
    master: Master,
    state: CoupledState,
    model: LinearModel,
    x_0: Matrix,
    disturbance: Matrix,
    every: int,
    times: int | None,
) -> tuple[Matrix, Matrix]:
    """Odd part of the response to a disturbance up and down, shape (times, states), and the z that it begins with."""
    up, z_up = _run(master, state, model, x_0 + disturbance, every, times)
    down, z_down = _run(master, state, model, x_0 - disturbance, every, len(up))
    return (up - down) / 2, (z_up - z_down) / 2


def _run(
    master: Master,
    state: CoupledState,
    model: LinearModel,
    x: Matrix,
    every: int,
    times: int | None,
) -> tuple[Matrix, Matrix]:
    """States from x on at regular numbers of steps, until the wanted number of times or the computing time is reached;
    and z at the start."""
    held = [
        master.output_names.index(name.removesuffix(HELD))
        for name in model.names
        if name.endswith(HELD)
    ]
    interval = every * master.clock.step_size
    rows: list[Matrix] = []
    with state.put_back():
        state.write(x)
        on_the_way = values_on_the_way(master, model.names, links_of(master))
        z = np.concatenate([state.read(), master.y[held], on_the_way])
        began = perf_counter()
        while len(rows) < (times or round(_SECONDS / interval)):
            late = times is None and perf_counter() - began > _WALL
            if late and len(rows) * interval >= _LEAST:
                break
            master.advance(every)
            rows.append(state.read())
    return np.array(rows), z


def _predicted(model: LinearModel, z: Matrix, every: int, times: int) -> Matrix:
    power = np.linalg.matrix_power(model.A, every) if len(z) <= _DENSE else None
    rows = []
    for _ in range(times):
        if power is not None:
            z = power @ z
        else:
            for _ in range(every):
                z = model.apply(z)
        rows.append(z)
    return np.array(rows)


@dataclass(frozen=True)
class _Departure:
    """Difference between the response and the model's, shape (times, states)."""

    size: float
    difference: Matrix
    relative: Matrix  # to the response's size in the same window


def _compare(measured: Matrix, expected: Matrix, size: float, scale: Matrix) -> _Departure:
    floor = _FLOOR * np.maximum(np.abs(expected).max(axis=0), size * scale)
    difference = measured - expected
    relative = np.empty_like(difference)
    for window in np.array_split(np.arange(len(measured)), min(_WINDOWS, len(measured))):
        response = np.maximum(np.abs(expected[window]).max(axis=0), floor)
        relative[window] = np.nan_to_num(np.abs(difference[window]) / response, nan=np.inf)
    return _Departure(size, difference, relative)


def _is_curvature(larger: _Departure, smaller: _Departure) -> bool:
    """Return whether all that is too large at the smaller size grows with the disturbance's cube.

    The odd part of a smooth system's response has no other terms that small. Such a system is stable as its modes are,
    however little a state moves in them: it may answer with nothing but its curvature."""
    beyond = smaller.relative > LARGEST_ERROR
    coarse, fine = (d.difference[: len(beyond)][beyond] / d.size**3 for d in (larger, smaller))
    return bool(np.all(np.abs(coarse - fine) <= _CURVATURE * np.abs(fine)))
