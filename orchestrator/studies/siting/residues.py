"""Modes as the buses see them: how a current at each bus drives a mode, and how the mode shows in the voltage there."""

import cmath
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

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
from orchestrator.linear.models.state_space import StateSpace, state_space
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.critical_modes import DENSE
from orchestrator.linear.spectra.modes import Mode
from orchestrator.studies.modes.modes import ModesResult, modes_from, running
from orchestrator.studies.operating_points.widening import Widening
from orchestrator.studies.points.under_way import tell_doing

# Parts of the time that a situation takes, for its progress: measured in 240 buses and 103 machines
_LINEAR = 0.02  # to the linear model
_SPECTRUM = 0.15  # its eigenvalues
_RESIDUES = 0.58  # all modes seen from all buses

_ROUNDS = 12  # substitutions of the eigenvalue into the device's answer, each of which brings the shift nearer


@dataclass(frozen=True)
class SeenMode:
    """A mode, and by bus: what a current into it does to the eigenvalue [rad/s per pu], the voltage in the mode's shape
    [pu], both by real and imaginary part, and how a current there moves the voltage through all other modes [pu]."""

    label: str
    mode: Mode
    drive: Mapping[str, Vector]
    shown: Mapping[str, Vector]
    impedance: Mapping[str, Vector]

    def shift(self, bus: str, response: Vector) -> complex:
        """Return Δλ [rad/s] by a device that moves the mode little.

        ``response``: current [pu, 100 MVA] by bus voltage [pu] at the mode's eigenvalue, both as real and imaginary
        part; what the device does to the voltage of its own bus is taken in."""
        at_mode = np.linalg.solve(np.eye(2) - response @ self.impedance[bus], response)
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


@dataclass(frozen=True)
class Situation:
    """The network as it is, or after an outage: its poorly damped modes, least damped first."""

    name: str
    found: ModesResult
    modes: tuple[SeenMode, ...]
    voltages: Mapping[str, complex]
    widenings: tuple[Widening, ...] = ()  # limits that were widened so that it starts


def situation_of(
    prepared: PreparedScenario, name: str, frequency_range: tuple[float, float], below: float
) -> Situation:
    """The modes with less damping than ``below`` [%], or the least damped one, of a case with `injections`."""
    network, table = prepared.network, prepared.case.table.power_flow
    if network is None or table is None or prepared.schedule.is_second_order:
        raise InputError(
            f"{prepared.case.source}: a place is looked for among the buses of a grid component, with the schedule "
            "gauss-seidel or jacobi; give the case a [power_flow] table whose grid is a model with a network"
        )
    outputs = [f"{table.grid}.{bus}.v_{part}" for bus in network.buses for part in ("re", "im")]
    inputs = [f"{table.grid}.{part}" for bus in network.buses for part in injection_names(bus)]
    tell_doing(f"{name}: steady state and linear model")
    with running(prepared) as master:
        point = find_operating_point(master)
        blocks = Blocks(master, inputs=inputs, outputs=outputs, derivatives=True)
        tell_doing(f"{name}: eigenvalues", _LINEAR)
        found = modes_from(prepared, master, point, blocks, frequency_range)
        tell_doing(f"{name}: what each bus does", _LINEAR + _SPECTRUM)
        space = state_space(blocks, master.schedule)
        early = _early(blocks, found.model)
        values = master.components[table.grid].get([name.partition(".")[2] for name in outputs])
    parts = list(values.values())
    oscillating = [mode for mode in found.modes if mode.is_oscillation]
    poor = [mode for mode in oscillating if mode.damping_percent < below] or oscillating[:1]
    labels = [found.name_of(mode) or f"{mode.frequency_hz:.3f} Hz" for mode in poor]
    labels = [
        text if text not in labels[:k] else f"{text} ({k + 1})" for k, text in enumerate(labels)
    ]
    seen = []
    for k, (label, mode) in enumerate(zip(labels, poor, strict=True)):
        tell_doing(
            f"{name}: buses by mode {k + 1} of {len(poor)}", 1 - _RESIDUES * (1 - k / len(poor))
        )
        seen.append(_seen(label, mode, space, found.model, early, network.buses))
    tell_doing()
    voltages = {bus: complex(*parts[2 * k : 2 * k + 2]) for k, bus in enumerate(network.buses)}
    return Situation(name, found, tuple(seen), voltages)


def _early(blocks: Blocks, model: LinearModel) -> Matrix:
    """Return the part of B by which an input acts on what the grid gives directly, at a step's beginning."""
    m, outputs, inputs = model.G.shape[1], len(blocks.output_names), len(blocks.inputs)
    direct = np.zeros((m, inputs))
    direct[:outputs] = model.K[:outputs][:, m - inputs :].toarray()
    return np.asarray(model.G @ model.settle(direct))


def _seen(
    label: str,
    mode: Mode,
    space: StateSpace,
    model: LinearModel,
    early: Matrix,
    buses: Sequence[str],
) -> SeenMode:
    """The residues of one mode between the current and the voltage of each bus, and what is left without it.

    A device's current at a step's beginning is that of the step before, which an input's is not."""
    assert space.step_size is not None
    z = cmath.exp(mode.eigenvalue * space.step_size)
    left, right = (
        np.array([vector[name] for name in space.states]) for vector in (mode.left, mode.shape)
    )
    B = space.B - (1 - 1 / z) * early
    drive, shown = left.conj() @ B / (z * space.step_size), space.C @ right
    others = _through_others(model, z, left, right, B)
    at = {bus: slice(2 * k, 2 * k + 2) for k, bus in enumerate(buses)}
    impedance = {bus: space.C[i] @ others[:, i] + space.D[i, i] / z for bus, i in at.items()}
    return SeenMode(
        label,
        mode,
        {b: drive[i] for b, i in at.items()},
        {b: shown[i] for b, i in at.items()},
        impedance,
    )


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
