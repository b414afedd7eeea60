"""Linear models of connections that delay, or cut, what they carry.

In a step map a short delay is a shift register, exact at every frequency. A register of thousands of places would make
the matrices large, so that a long delay is the transport line's projection on Legendre polynomials: with q of them its
transfer function is the Padé approximation [q−1/q] of e^{−sT}, in a basis whose numbers stay small."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.core.options import Option
from orchestrator.linear.models.held_inputs import over_held_inputs
from orchestrator.linear.models.linear_model import DELAYED
from orchestrator.systems.coupling.connections import Endpoint
from orchestrator.systems.coupling.imperfections import DropOut, Noise, Quantisation
from orchestrator.systems.coupling.master import Master

ORDER = 24
"""Polynomials of a long delay. In a continuous model the delay is right to 1e-9 of its value where ω·T is below 24 rad,
in a step map, where a delay is longer than `SHORT` steps, to 3e-4 below 12 rad and to 2e-3 below 24 rad."""

SHORT = 100  # up to so many communication steps a delay is a shift register in the step map
_FLAT = (-1 / 24, 13 / 12, -1 / 24)
"""Weights of three values that follow one another: they undo the loss of fast signals in values that are held over a
step, up to the fourth power of the frequency."""

# a mode for which a delay's approximation is off by more than this part is not the step map's
LARGEST_ERROR = 1e-3


@dataclass(frozen=True)
class WireLink:
    """A connection that does not simply carry its value, as the linear model has it."""

    name: str  # ``a.out -> b.in``
    delay: float  # [s]
    is_cut: bool  # whether nothing of the signal arrives


@dataclass(frozen=True)
class DelayLine:
    """s⁺ = A·s + B·u, and what arrives: C·s + d·u in this step, C_before·s in the one before.

    In a continuous model ṡ = A·s + B·u; nothing is asked of the step before there."""

    A: Matrix
    B: Matrix
    C: Matrix
    d: float
    C_before: Matrix
    at_rest: Vector  # the states while a constant 1 is carried


def links_of(master: Master) -> dict[Endpoint, WireLink]:
    """The connections of a system that matter to its linear model, by their target."""
    links = {
        target: WireLink(plan.name, plan.delay, plan.is_cut)
        for target, plan in master.system.wires.items()
    }
    return {target: link for target, link in links.items() if link.delay or link.is_cut}


def delay_line(delay: float, step_size: float) -> DelayLine:
    """The delay [s] in a step map of a communication step [s]; between two steps it is interpolated."""
    steps = delay / step_size
    if steps > SHORT:
        return _long(delay, step_size)
    whole = int(np.floor(steps + 1e-6))
    part = steps - whole if steps - whole > 1e-6 else 0.0
    n = whole + (part > 0) + 1  # one more place than arrives: what arrived in the step before
    A, B = np.eye(n, k=-1), np.zeros((n, 1))
    B[0] = 1.0
    weights = np.zeros(n + 2)  # of u, and of the places of the register
    weights[whole] += 1.0 - part
    weights[whole + 1] += part
    return DelayLine(
        A, B, weights[None, 1 : n + 1], float(weights[0]), weights[None, :n].copy(), np.ones(n)
    )


def _long(delay: float, step_size: float) -> DelayLine:
    """A long delay: two values sent before, the polynomials, and what arrived in the step before.

    Values are held over a step and three of them are weighted, which delays slow signals by a step and a half: the line
    is as much shorter, and a little for what is left of it."""
    shorter = 1.5 * step_size
    for _ in range(3):
        A_c, B_c, C_c = transport(delay - shorter)
        A_d, B_d = over_held_inputs(A_c, B_c, step_size)
        still = np.eye(len(A_d)) - A_d
        arrives = step_size * (
            1 + (C_c @ np.linalg.solve(still, np.linalg.solve(still, B_d)))[0, 0]
        )
        shorter += float(arrives) - delay
    q = len(A_d)
    line, last = slice(2, q + 2), q + 2
    A, B = np.zeros((q + 3, q + 3)), np.zeros((q + 3, 1))
    B[0] = A[1, 0] = 1.0
    B[line] = _FLAT[0] * B_d
    A[line, :2] = B_d * _FLAT[1:]
    A[line, line] = A_d
    A[last, line] = C_c
    C, before, at_rest = np.zeros((1, q + 3)), np.zeros((1, q + 3)), np.zeros(q + 3)
    C[0, line], before[0, last] = C_c, 1.0
    at_rest[[0, 1, 2, last]] = 1.0
    return DelayLine(A, B, C, 0.0, before, at_rest)


def continuous_line(delay: float) -> DelayLine:
    """The delay [s] in a continuous model: always the approximation."""
    A, B, C = transport(delay)
    return DelayLine(A, B, C, 0.0, np.zeros_like(C), np.eye(len(A))[0])


def transport(delay: float) -> tuple[Matrix, Matrix, Matrix]:
    """A, B and C of ṁ = A·m + B·u and y = C·m ≈ u(t − delay): m are coefficients of Legendre polynomials."""
    i = np.arange(ORDER)[:, None]
    k = np.arange(ORDER)[None, :]
    A = (2 * i + 1) / delay * np.where(i < k, -1.0, (-1.0) ** (i - k + 1))
    B = (2 * i + 1) / delay * (-1.0) ** i
    return A, B, np.ones((1, ORDER))


def representation_error(link: WireLink, eigenvalue: complex, step_size: float | None) -> float:
    """How far a model's delay is from the true one at an eigenvalue [rad/s], as a part of it; infinite where the
    true one is beyond any number."""
    if step_size is None:
        line, at = continuous_line(link.delay), eigenvalue
    else:
        line, at = delay_line(link.delay, step_size), np.exp(eigenvalue * step_size)
    n = len(line.A)
    given = (line.C @ np.linalg.solve(at * np.eye(n) - line.A, line.B))[0, 0] + line.d
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(abs(given * np.exp(eigenvalue * link.delay) - 1))
    return error if np.isfinite(error) else np.inf


def highest_hz(link: WireLink, step_size: float | None) -> float:
    """Frequency [Hz] up to which a linear model has the delay; infinite where it is exact."""
    exact = not link.delay or (step_size is not None and link.delay <= SHORT * step_size)
    return np.inf if exact else ORDER / (2 * np.pi * link.delay)


def too_long(links: Iterable[WireLink], top_hz: float, step_size: float | None) -> list[str]:
    """Delays that the linear model does not have up to the range's top [Hz], in words."""
    return [
        (
            f"connection {link.name}: the linear model has the delay of {link.delay:g} s "
            f"up to {bound:.3g} Hz; what it shows from there to {top_hz:g} Hz are not the "
            "system's modes, and others may be missing; simulate, or take a "
            + Option.RANGE
            + " that ends there"
        )
        for link in links
        if (bound := highest_hz(link, step_size)) < top_hz
    ]


def doubtful_delays(
    links: Iterable[WireLink], eigenvalues: Iterable[complex], step_size: float | None
) -> list[str]:
    """Delays that the linear model does not have right at one of the eigenvalues [rad/s], in words."""
    said = []
    values = list(eigenvalues)
    for link in links:
        errors = (
            [representation_error(link, value, step_size) for value in values] if link.delay else []
        )
        if errors and not max(errors) <= LARGEST_ERROR:
            value = values[int(np.argmax(errors))]
            size = f"wrong by {100 * max(errors):.2g} %" if max(errors) < 1 else "altogether wrong"
            said.append(
                f"connection {link.name}: the linear model has the delay of {link.delay:g} s {size} at the eigenvalue "
                f"{value:.4g} rad/s; look at that mode by simulation"
            )
    return said


def values_on_the_way(
    master: Master, names: tuple[str, ...], links: Mapping[Endpoint, WireLink]
) -> Vector:
    """The states of all delay lines among the names while everything that is carried is constant."""
    found = []
    for target, link in links.items():
        count = sum(name.startswith(f"{link.name}{DELAYED}") for name in names)
        line = delay_line(link.delay, master.clock.step_size) if count else None
        if line is not None:
            inputs = master.exchanges[target.component].inputs.names
            value = master.arriving(target.component)[inputs.index(target.variable)]
            found.append(value * line.at_rest)
    return np.concatenate(found) if found else np.zeros(0)


def warnings_of(master: Master) -> tuple[str, ...]:
    """Return what a linear model leaves out of the system's imperfections, or cannot know of its faults."""
    said = []
    for plan in master.system.wires.values():
        for imperfection in plan.permanent.values():
            if isinstance(imperfection, Noise | Quantisation):
                kind = "noise" if isinstance(imperfection, Noise) else "quantisation"
                said.append(
                    f"connection {plan.name} has {imperfection}: the modes are those of the system without {kind}"
                )
            if isinstance(imperfection, DropOut):
                said.append(
                    f"connection {plan.name} is {imperfection}: it is cut in the linear model"
                )
        if plan.later:
            faults = ", ".join(map(str, plan.later))
            said.append(
                f"connection {plan.name} has faults later ({faults}): the modes are those before them"
            )
    return tuple(said)
