"""Modes as the buses see them: how a current at each bus drives a mode, and how the mode shows in the voltage there."""

import cmath
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from fmus.grid.names import injection_names
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Matrix, Vector
from orchestrator.core.errors import InputError
from orchestrator.linear.models.hub_elimination import hub_equations
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.critical_modes import DENSE
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.modes.modes import ModesResult, modes_from, running
from orchestrator.studies.operating_points.widening import Widening
from orchestrator.studies.points.under_way import tell_doing
from orchestrator.studies.siting.bus_ports import BusPorts
from orchestrator.studies.siting.placing import ACTIVE, REACTIVE, ideal_support

_ROUNDS = 12  # substitutions of the eigenvalue into the device's answer, each of which brings the shift nearer

MANY_BUSES = 500
"""Up to so many buses, each is looked into for each mode. In a larger network that takes longer than to find modes."""

_PLACES = 24
"""Buses of a large network that are looked into by kind of support: those that move the least damped mode most."""

_STRONGEST = 4
"""Buses that are looked into beside these for each mode, as one of them moves it farthest of all. Before that their
effect is known to 0.4 % (WECC's 240 buses, 1 MW/Hz)."""


@dataclass(frozen=True)
class BusesAsked:
    """Which buses may be the place of a device.

    Attributes
    ----------
    places
        The buses, by name.
    by_name
        Whether somebody named them. In a large network no other bus is linearised then.
    in_full
        Whether each is looked into: a device's whole answer, which moves its own voltage, is asked for.
    """

    places: Collection[str]
    by_name: bool = False
    in_full: bool = False

    def looked_at(self, buses: Sequence[str]) -> tuple[str, ...]:
        """The buses of a network from which modes are seen."""
        if not self.by_name or len(buses) <= MANY_BUSES:
            return tuple(buses)
        return tuple(bus for bus in buses if bus in self.places)

    def looked_into(self, buses: Sequence[str]) -> tuple[str, ...]:
        """Those of them that are looked into whatever they do."""
        if len(buses) <= MANY_BUSES and (self.in_full or not self.by_name):
            return tuple(buses)
        asked = tuple(bus for bus in buses if bus in self.places) if self.by_name else ()
        return asked if len(asked) <= MANY_BUSES else ()


@dataclass(frozen=True)
class SeenMode:
    """A mode, and by bus: what a current into it does to the eigenvalue [rad/s per pu], the voltage in the mode's shape
    [pu], both by real and imaginary part, and how a current there moves the voltage through all other modes [pu], which
    is known of the buses that were looked into."""

    label: str
    mode: Mode
    drive: Mapping[str, Vector]
    shown: Mapping[str, Vector]
    impedance: Mapping[str, Vector]

    def shift(self, bus: str, response: Vector) -> complex:
        """Return Δλ [rad/s] by a device that moves the mode little.

        ``response``: current [pu, 100 MVA] by bus voltage [pu] at the mode's eigenvalue, both as real and imaginary
        part; what the device does to the voltage of its own bus is taken in if the bus was looked into."""
        at_mode, around = response, self.impedance.get(bus)
        if around is not None:
            at_mode = np.linalg.solve(np.eye(2) - response @ around, response)
        return complex(self.drive[bus] @ at_mode @ self.shown[bus])

    def final_shift(self, bus: str, response: Callable[[complex], Vector]) -> complex:
        """The same of a device that moves the mode farther: it answers at the mode where that is then. Of one that
        moves it by more than the mode's own size, the shift by its answer at the mode as it was."""
        start = eigenvalue = self.mode.eigenvalue
        first = self.shift(bus, response(start))
        for _ in range(_ROUNDS):
            eigenvalue = start + self.shift(bus, response(eigenvalue))
            if not abs(eigenvalue - start) < abs(start):
                return first
        return eigenvalue - start

    def strongest(
        self, voltages: Mapping[str, complex], among: Collection[str], count: int
    ) -> list[str]:
        """The buses at which a small support moves the mode most, as many of each kind of support."""
        found: list[str] = []
        for kind in (ACTIVE, REACTIVE):
            sizes = {
                bus: abs(self.shift(bus, ideal_support(kind, v, self.mode.eigenvalue)))
                for bus, v in voltages.items()
                if bus in among
            }
            found += sorted(sizes, key=lambda bus: -sizes[bus])[:count]
        return found


@dataclass(frozen=True)
class Situation:
    """The network as it is, or after an outage: its poorly damped modes, least damped first, and the voltages [pu] of
    the buses that were looked at.

    ``knows_all``: whether these are all buses of the network."""

    name: str
    found: ModesResult
    modes: tuple[SeenMode, ...]
    voltages: Mapping[str, complex]
    widenings: tuple[Widening, ...] = ()  # limits that were widened so that it starts
    knows_all: bool = True

    @property
    def looked_into(self) -> frozenset[str]:
        """The buses that were looked into for all modes."""
        every = [frozenset(seen.impedance) for seen in self.modes]
        return frozenset.intersection(*every) if every else frozenset()


def situation_of(
    prepared: PreparedScenario,
    name: str,
    frequency_range: tuple[float, float],
    below: float,
    asked: BusesAsked,
) -> Situation:
    """The modes with less damping than ``below`` [%], or the least damped one, of a case with `injections`."""
    network, table = prepared.network, prepared.case.table.power_flow
    if network is None or table is None or prepared.schedule.is_second_order:
        raise InputError(
            f"{prepared.case.source}: a place is looked for among the buses of a grid component, with the schedule "
            "gauss-seidel or jacobi; give the case a [power_flow] table whose grid is a model with a network"
        )
    buses = asked.looked_at(network.buses)
    outputs = [f"{table.grid}.{bus}.v_{part}" for bus in buses for part in ("re", "im")]
    inputs = [f"{table.grid}.{part}" for bus in buses for part in injection_names(bus)]
    began = monotonic()
    tell_doing(f"{name}: steady state and linear model")
    with running(prepared) as master:
        point = find_operating_point(master)
        blocks = Blocks(master, inputs=inputs, outputs=outputs, derivatives=True)
        tell_doing(f"{name}: eigenvalues")
        found = modes_from(prepared, master, point, blocks.connected_alone(), frequency_range)
        tell_doing(f"{name}: what each bus does")
        ports = BusPorts.of(blocks, master.schedule, found.model, table.grid)
        values = master.components[table.grid].get([name.partition(".")[2] for name in outputs])
    parts = list(values.values())
    voltages = {bus: complex(*parts[2 * k : 2 * k + 2]) for k, bus in enumerate(buses)}
    oscillating = [mode for mode in found.modes if mode.is_oscillation]
    poor = [mode for mode in oscillating if mode.damping_percent < below] or oscillating[:1]
    labels = [found.name_of(mode) or f"{mode.frequency_hz:.3f} Hz" for mode in poor]
    labels = [
        text if text not in labels[:k] else f"{text} ({k + 1})" for k, text in enumerate(labels)
    ]
    seen: list[SeenMode] = []
    places, first = asked.looked_into(buses), monotonic()
    for k, (label, mode) in enumerate(zip(labels, poor, strict=True)):
        part = part_of_time(began, first, k, len(poor), monotonic())
        tell_doing(f"{name}: buses by mode {k + 1} of {len(poor)}", part)
        one = _seen(label, mode, ports, buses)
        if not places:
            places = tuple(one.strongest(voltages, asked.places, _PLACES))
        some = {*places, *one.strongest(voltages, voltages, _STRONGEST)}
        seen.append(_looked_into(one, ports, buses, some))
    tell_doing()
    knows_all = len(buses) == len(network.buses)
    return Situation(name, found, tuple(seen), voltages, knows_all=knows_all)


def part_of_time(began: float, first: float, done: int, count: int, now: float) -> float:
    """The part of a task's time that has passed, where modes alike are what is left of it; 0 before one is done.

    ``began``, ``first``, ``now``: when the task and its first mode began, and the present [s].
    ``done``, ``count``: modes that are done, and all of them."""
    if not done:
        return 0.0
    left = (now - first) / done * (count - done)
    return (now - began) / (now - began + left)


def _eigenvectors(mode: Mode, model: LinearModel) -> tuple[Vector, Vector]:
    """The left and right eigenvectors of a mode."""
    left, right = (
        np.array([vector[name] for name in model.names]) for vector in (mode.left, mode.shape)
    )
    return left, right


def _on_the_map(mode: Mode, model: LinearModel) -> complex:
    """The eigenvalue of the step map for a mode."""
    assert model.step_size is not None
    return cmath.exp(mode.eigenvalue * model.step_size)


def _seen(label: str, mode: Mode, ports: BusPorts, buses: Sequence[str]) -> SeenMode:
    """The residues of one mode between the current and the voltage of each bus."""
    z, step = _on_the_map(mode, ports.model), ports.model.step_size
    assert step is not None
    left, right = _eigenvectors(mode, ports.model)
    drive = (ports.drives(left, z) / (z * step)).reshape(len(buses), 2)
    shown = ports.voltages(right).reshape(len(buses), 2)
    driven, seen = (dict(zip(buses, of, strict=True)) for of in (drive, shown))
    return SeenMode(label, mode, driven, seen, impedance={})


def _looked_into(
    seen: SeenMode, ports: BusPorts, buses: Sequence[str], chosen: Collection[str]
) -> SeenMode:
    """The same with what is left without the mode between the current and the voltage of some buses."""
    z = _on_the_map(seen.mode, ports.model)
    left, right = _eigenvectors(seen.mode, ports.model)
    names = [bus for bus in buses if bus in chosen]
    if not names:  # an outage has cut them off
        return seen
    places = np.flatnonzero([bus in chosen for bus in buses])
    currents = np.stack([2 * places, 2 * places + 1], axis=1).ravel()
    some = ports.some(currents)
    others = _through_others(ports.model, z, left, right, some.drive(z))
    answers = some.impedance(others, z)
    at = {bus: slice(2 * k, 2 * k + 2) for k, bus in enumerate(names)}
    return replace(seen, impedance={bus: answers[i, i] for bus, i in at.items()})


def _through_others(
    model: LinearModel, z: complex, left: Vector, right: Vector, drive: Matrix
) -> Vector:
    """States that a drive B moves at z, without the mode at z itself: x with (z − A)·x + r·μ = B, lᴴ·x = 0.

    By the model's sparse equations where it is large: dense ones would take ten seconds a mode in 3,000 states."""
    n, m = model.G.shape
    if n <= DENSE:
        bordered = np.block(
            [[z * np.eye(n) - model.A, right[:, None]], [left.conj()[None], np.zeros((1, 1))]]
        )
        given = np.vstack([drive, np.zeros((1, drive.shape[1]))])
        return np.asarray(np.linalg.solve(bordered, given)[:n])
    found = _by_hub(model, z, left, right, drive)
    if found is not None:
        return found
    equations = [
        [z * sp.eye_array(n) - model.F, -model.G, sp.csc_array(right[:, None])],
        [-model.H, sp.eye_array(m) - model.K, None],
        [sp.csr_array(left.conj()[None]), None, None],
    ]
    given = np.zeros((n + m + 1, drive.shape[1]), dtype=complex)
    given[:n] = drive
    return np.asarray(spla.splu(sp.block_array(equations, format="csc")).solve(given)[:n])


def _by_hub(
    model: LinearModel, z: complex, left: Vector, right: Vector, drive: Matrix
) -> Vector | None:
    """The same by blocks and a hub; None where the model has no hub, a block has an eigenvalue at z, or nothing swings.

    The mode and its conjugate are held by two real wires each way, as the blocks are real: lᴴ·x = 0 and lᵀ·x = 0. What
    the conjugate mode gives is added behind."""
    rows, columns = (np.vstack([part.real, part.imag]) for part in (left, right))
    held = hub_equations(
        model.F,
        sp.csr_array(sp.hstack([model.G, columns.T])),
        H=sp.csr_array(sp.vstack([model.H, rows])),
        K=sp.csr_array(sp.block_diag([model.K, sp.eye_array(2)])),
    )
    factors = held.at(complex(z)) if held is not None and z.imag else None
    if factors is None:
        return None
    found = factors.solve(-drive.astype(complex))
    beside = (left @ drive) / ((z - z.conjugate()) * np.vdot(left, right).conjugate())
    return np.asarray(found + np.outer(right.conj(), beside))
