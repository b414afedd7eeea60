"""Doubts about modes that depend on the perturbation of the FMUs; the modes of a linear model must not.

Every component was perturbed with two sizes, and up as well as down. At the edge of a limit, inside a dead band that is
smaller than the perturbation, or in noise the results differ, and the linear model describes neither side. How far the
difference moves each mode follows from its eigenvectors, to first order."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from orchestrator.core.arrays import Vector
from orchestrator.core.errors import few
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.perturbation import PERTURBATIONS
from orchestrator.linear.spectra.modes import Mode
from orchestrator.linear.spectra.stability import SLOW
from orchestrator.systems.coupling.schedule import Schedule

LARGEST_SHIFT = 1e-3
"""Shift of a mode from which a doubt is reported, as a part of |λ|: a tenth of a point of damping. In smooth systems,
up to the IEEE 118-bus system, the shift is at most 1.5e-4."""

# the shift of a mode slower than this [rad/s] is divided by this figure instead of |λ|
_SLOWEST = 0.5
# most states of a model whose slowest eigenvalues are told apart from the free angle by a Schur
# form
_DENSE = 1000

_WHY = (
    "a perturbation of twice the size has another effect per unit: look for noise in it, a coarse tolerance of its "
    "integrator, or a limit or dead band close by",
    "it answers differently up and down: it stands at the edge of a limit or of a dead band",
    "it is linear for small changes only ({narrow}), beyond which a limit or a dead band acts",
)
"""The meaning of a difference in each of `ComponentLinearization.variants`, in their order."""

_NAMED = 3  # components that a sentence names
_EDGE = 1  # index of the variant at an edge, where there is no linear model at all
_SMALL_ONLY = 2  # index of the variant in which the model is right for small changes

_EDGE_SHIFT = 1e-2
"""Shift from which an edge leaves open whether the system is stable, as a part of |λ|. The shift belongs to a
perturbation of 1e-5; beyond the limit it is larger."""


@dataclass(frozen=True)
class Doubt:
    """A component for which the modes depend on how it was perturbed."""

    component: str
    mode: Mode
    shift: float  # the shift of this mode, relative to |λ|
    why: str
    # Whether the shift leaves open on which side of the stability limit a mode is. It does not if the model is right
    # for small changes.
    turns: bool = False
    kind: int = 0  # the row of `_WHY` that it belongs to

    def __str__(self) -> str:
        return f"component {self.component!r} is not linear at the operating point: {self.reason}"

    @property
    def reason(self) -> str:
        """Why, and how far that moves which mode."""
        m = self.mode
        if self.kind == _SMALL_ONLY:
            return (
                f"{self.why}. The modes are those of small changes; a perturbation of {2 * PERTURBATIONS[0]:g} would "
                f"move the mode at {m.frequency_hz:.3f} Hz with {m.damping_percent:.2f} % damping by "
                f"{100 * self.shift:.2g} % of its eigenvalue; {100 * LARGEST_SHIFT:g} % is normal"
            )
        return (
            f"{self.why}. That moves the mode at {m.frequency_hz:.3f} Hz with {m.damping_percent:.2f} % damping by "
            f"{100 * self.shift:.2g} % of its eigenvalue, and its damping by up to {100 * self.shift:.2g} points; "
            f"{100 * LARGEST_SHIFT:g} % is normal"
        )


def tell(found: Sequence[Doubt]) -> tuple[str, ...]:
    """Sentences about doubts, one for each kind of reason: several components are counted, and the worst is told."""
    said = []
    for kind in dict.fromkeys(doubt.kind for doubt in found):
        alike = [doubt for doubt in found if doubt.kind == kind]
        worst = max(alike, key=lambda doubt: doubt.shift)
        if len(alike) == 1:
            said.append(str(worst))
            continue
        named = few([repr(doubt.component) for doubt in alike], _NAMED)
        said.append(
            f"{len(alike)} components are not linear at the operating point ({named}); the worst, "
            f"{worst.component!r}: {worst.reason}"
        )
    return tuple(said)


def doubts(
    blocks: Blocks, schedule: Schedule, model: LinearModel, modes: Sequence[Mode]
) -> list[Doubt]:
    """Components whose perturbation leaves the modes in doubt; empty for a smooth system."""
    found = []
    comparison: _Comparison | None = None
    for kind, why in enumerate(_WHY):
        perturbed = [name for name, c in blocks.components.items() if len(c.variants) > kind]
        if not perturbed or not modes:
            continue
        comparison = comparison or _Comparison(model, modes)
        varied = _varied(blocks, schedule, perturbed, kind)
        together = comparison.shifts(varied)
        if together.max() <= LARGEST_SHIFT:
            continue
        turns = kind != _SMALL_ONLY and _may_turn(modes, together)
        turns = turns or (kind == _EDGE and bool(together.max() > _EDGE_SHIFT))
        if comparison.has_rows_of(varied):
            each = comparison.shifts_of_each(perturbed, varied)
        else:
            each = {
                name: comparison.shifts(_varied(blocks, schedule, [name], kind))
                for name in perturbed
            }
        most = max(each, key=lambda name: float(each[name].max()))
        # A single component may shift a mode less than all components together.
        guilty = [name for name, shifts in each.items() if shifts.max() > LARGEST_SHIFT] or [most]
        for name in guilty:
            narrow = blocks.components[name].narrow
            text = why.format(
                narrow=", ".join(f"{name}.{what} by {size:g}" for what, size in narrow.items())
            )
            # what no component shifts beyond the normal alone, all of them do together
            alone = each[name].max() > LARGEST_SHIFT
            shifts = each[name] if alone else together
            worst = int(shifts.argmax())
            found.append(Doubt(name, modes[worst], float(shifts[worst]), text, turns, kind))
    return found


def _varied(blocks: Blocks, schedule: Schedule, names: Sequence[str], kind: int) -> LinearModel:
    """The model in which some components are replaced by one of their variants."""
    other = copy.copy(blocks)
    other.components = dict(blocks.components)
    for name in names:
        component = blocks.components[name]
        other.components[name] = replace(component, **component.variants[kind]._asdict())
    return compose(other, schedule)


class _Comparison:
    """A model and its modes as arrays, with which each of its variants is compared.

    A large system has thousands of states and a dozen variants: what does not change is computed once."""

    def __init__(self, model: LinearModel, modes: Sequence[Mode]) -> None:
        self._model = model
        self._left = _columns([mode.left for mode in modes], model.names)
        self._right = _columns([mode.shape for mode in modes], model.names)
        self._values = np.array([mode.eigenvalue for mode in modes])
        self._slow = np.abs(self._values) <= SLOW
        self._image = _image(model, self._right)

    def shifts(self, varied: LinearModel) -> Vector:
        """Relative shift of every mode from the model to a variant of it."""
        model = self._model
        if varied.names != model.names:  # even the pattern of direct feed-through differs
            return np.full(len(self._values), np.inf)
        difference = _image(varied, self._right) - self._image
        shifts = self._relative(_along(self._left, difference))
        slow = self._slow
        if len(model.names) <= _DENSE and (shifts[slow] > LARGEST_SHIFT).any():
            shifts[slow] = np.minimum(
                shifts[slow], shift_of_slowest(model, varied, SLOW) / _SLOWEST
            )
        return shifts

    def has_rows_of(self, varied: LinearModel) -> bool:
        """Tell whether `shifts_of_each` holds for a variant; small models need each variant whole, for slow modes."""
        own = self._model
        return len(own.names) > _DENSE and (varied.names, varied.wires) == (own.names, own.wires)

    def shifts_of_each(self, names: Sequence[str], together: LinearModel) -> dict[str, Vector]:
        """The shifts by each component alone.

        ``together``: the model in which all of them are replaced."""
        changes = _RowChanges(self._model, together, self._left, self._right)
        return {name: self._relative(changes.moved_by(name)) for name in names}

    def _relative(self, moved: Vector) -> Vector:
        rates = _as_rates(moved, self._values, self._model.step_size)
        shifts: Vector = np.abs(rates) / np.maximum(np.abs(self._values), _SLOWEST)
        return shifts


def _columns(vectors: Sequence[Mapping[str, complex]], names: Sequence[str]) -> Vector:
    """Vectors as columns, with their states in the order of the names."""
    rows = [list(map(vector.__getitem__, names)) for vector in vectors]
    return np.ascontiguousarray(np.array(rows).T)


class _RowChanges:
    """Changes in the equations of a model where components are replaced by variants.

    With changes written as Δ, and w as the outputs in a mode, (I − K − ΔK)·Δw = ΔH·r + ΔK·w. A component's equations
    are rows of their own, so that a model in which all are replaced holds the rows of each, and Δw follows from its few
    own outputs."""

    def __init__(
        self, model: LinearModel, together: LinearModel, left: Vector, right: Vector
    ) -> None:
        columns, self._model, self._left = _parts(right), model, left
        outputs = model.settle(model.H @ columns)
        F, self._G, H, self._K = (
            sp.csr_array(getattr(together, name) - getattr(model, name)) for name in "FGHK"
        )
        self._of_states, self._of_outputs = (
            F @ columns + self._G @ outputs,
            H @ columns + self._K @ outputs,
        )
        self._from_outputs = model.G.T @ left
        self._owners_of_states, self._owners_of_outputs = (
            np.array([name.partition(".")[0] for name in names])
            for names in (model.names, model.wires)
        )

    def moved_by(self, component: str) -> Vector:
        """lᴴ·(A' − A)·r of each mode, where one component alone is replaced."""
        states = np.flatnonzero(self._owners_of_states == component)
        outputs = np.flatnonzero(self._owners_of_outputs == component)
        unit = np.zeros((len(self._model.wires), len(outputs)))
        unit[outputs, np.arange(len(outputs))] = 1.0
        reached = self._model.settle(unit)
        back = np.eye(len(outputs)) - self._K[outputs] @ reached
        moved_outputs = reached @ np.linalg.solve(back, self._of_outputs[outputs])
        moved_states = self._of_states[states] + self._G[states] @ moved_outputs
        return _along(self._left[states], moved_states) + _along(self._from_outputs, moved_outputs)


def _may_turn(modes: Sequence[Mode], shifts: Vector) -> bool:
    """Return whether a shift can carry a mode over the stability limit."""
    sizes = np.array([max(abs(mode.eigenvalue), _SLOWEST) for mode in modes])
    return bool(np.any(shifts * sizes >= np.abs([mode.eigenvalue.real for mode in modes])))


def eigenvalue_shifts(
    model: LinearModel, varied: LinearModel, eigenvalues: Vector, left: Vector, right: Vector
) -> Vector:
    """Δλ = lᴴ·(A' − A)·r [rad/s] of each mode, a column of ``left`` and ``right``; of a step map divided by μ·H, as
    λ = ln μ / H."""
    difference = _image(varied, right) - _image(model, right)
    return _as_rates(_along(left, difference), eigenvalues, model.step_size)


def _image(model: LinearModel, right: Vector) -> Vector:
    """A·r for columns r, the real parts and then the imaginary ones, as the factors inside are real."""
    return model.apply(_parts(right))


def _parts(columns: Vector) -> Vector:
    """The real parts of columns, and then the imaginary ones."""
    return np.hstack([columns.real, columns.imag])


def _along(left: Vector, difference: Vector) -> Vector:
    """lᴴ·d of each mode, where d are real parts and then imaginary ones."""
    n = left.shape[1]
    moved: Vector = (left.conj() * (difference[:, :n] + 1j * difference[:, n:])).sum(axis=0)
    return moved


def _as_rates(moved: Vector, eigenvalues: Vector, step_size: float | None) -> Vector:
    """Shifts of eigenvalues [rad/s] from those of the model's matrix."""
    if step_size is None:
        return moved
    return np.asarray(moved / (np.exp(eigenvalues * step_size) * step_size))


def shift_of_slowest(model: LinearModel, varied: LinearModel, radius: float) -> float:
    """|Δ| of the sum of all eigenvalues nearer to zero than a radius [rad/s], to first order.

    A slow eigenvalue beside the free angle's zero is nearly double: each one alone moves by the root of an error, in
    opposite directions, and their sum by the error itself."""
    step, A, changed = model.step_size, model.A, varied.A

    def is_near(real: float, imaginary: float = 0.0) -> bool:
        value = complex(real, imaginary)
        if step is None:
            return abs(value) <= radius
        return bool(value) and bool(abs(np.log(value) / step) <= radius)

    _, right, count = scipy.linalg.schur(A, sort=is_near)
    _, left, _ = scipy.linalg.schur(A.T, sort=is_near)
    left, right = left[:, :count], right[:, :count]
    moved = np.trace(np.linalg.solve(left.T @ right, left.T @ (changed - A) @ right))
    return float(abs(moved) / (step or 1.0))
