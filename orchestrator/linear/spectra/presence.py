"""A way from one system to another of the same operating point, with other devices at some places.

Both devices stand at the place and see the same voltage. The network takes (1 − α) times the current of the one, and α
times that of the other. At α = 0 the other device is driven and drives nothing, so the system's eigenvalues are those
of the system without it, and beside them those of the device at a stiff voltage; at α = 1 likewise. On the way every
eigenvalue moves continuously, so a mode keeps its name whatever share a device holds of it at either end."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.core.errors import AnalysisError
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.spectra import continuation
from orchestrator.linear.spectra.continuation import Eigenpair
from orchestrator.linear.spectra.critical_modes import DENSE

_ITS_OWN = 0.5
"""Share of a mode from which on it is of a device that drives nothing; at an end of the way it is 0 or 1."""


@dataclass(frozen=True)
class _Slots:
    """States or wires of both systems in one list: first those that both have, then each side's own.

    ``of``: places in the list, of the first system's and of the second's. ``both``: how many both have."""

    names: tuple[str, ...]
    of: tuple[NDArray[np.int64], NDArray[np.int64]]
    both: int

    @classmethod
    def joined(cls, one: Sequence[str], other: Sequence[str], apart: Collection[str]) -> "_Slots":
        first, second = _numbered(one), _numbered(other)
        known, apart = set(second), set(apart)
        common = [k for k in first if k in known and not _components(k[0]) & apart]
        place = {k: i for i, k in enumerate(common)}
        count, sides = len(common), []
        for keys in (first, second):
            where = []
            for key in keys:
                if key in place:
                    where.append(place[key])
                else:
                    where.append(count)
                    count += 1
            sides.append(np.array(where, dtype=np.int64))
        names = np.empty(count, dtype=object)
        names[sides[0]] = [f"{name} (before)" for name in one]
        names[sides[1]] = list(other)
        return cls(tuple(names), (sides[0], sides[1]), len(common))


def _numbered(names: Sequence[str]) -> list[tuple[str, int]]:
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        found.append((name, seen[name]))
        seen[name] += 1
    return found


def _components(name: str) -> set[str]:
    """The components of a state or wire: one, or both ends of a connection."""
    return {part.partition(".")[0] for part in name.split(" -> ")}


class PresenceWay:
    """The systems between one (0) and another (1), in which the components ``apart`` differ.

    Raises
    ------
    AnalysisError
        If a model was not composed from its components, or they are of other communication steps.
    """

    def __init__(self, one: LinearModel, other: LinearModel, apart: Collection[str]) -> None:
        if not (one.wires and other.wires):
            raise AnalysisError("its linear model is not kept by components")
        if (one.step_size, one.period) != (other.step_size, other.period):
            raise AnalysisError("the linear models are of other communication steps")
        self._models = (one, other)
        self._states = _Slots.joined(one.names, other.names, apart)
        self._wires = _Slots.joined(one.wires, other.wires, apart)
        self._kept: dict[float, LinearModel] = {}
        self._pairs: dict[int, list[Eigenpair]] = {}

    def model_at(self, part: float) -> LinearModel:
        if part not in self._kept:
            states, wires = self._states, self._wires
            kinds = {"F": (states, states), "G": (states, wires)}
            kinds |= {"H": (wires, states), "K": (wires, wires)}
            found = {name: self._mixed(name, *of, part) for name, of in kinds.items()}
            other = self._models[1]
            self._kept[part] = LinearModel(
                **found,
                names=states.names,
                step_size=other.step_size,
                disagreement=0.0,
                period=other.period,
                wires=wires.names,
            )
        return self._kept[part]

    def followed_back(self, eigenvalue: complex) -> complex | None:
        """A mode of the other system [rad/s] as it is in the one; None if it is the other device's own.

        Raises
        ------
        ModesMeetError
            If it cannot be told from another mode on the way.
        """
        start = min(
            self._near(self.model_at(1.0), eigenvalue),
            key=lambda pair: abs(pair.eigenvalue - eigenvalue),
        )
        end = continuation.follow_along(
            start, self.model_at, 1.0, 0.0, continuation.CAREFUL, near=self._near
        )
        return None if self._is_own(end) else end.eigenvalue

    def _is_own(self, pair: Eigenpair) -> bool:
        factors = np.abs(pair.left.conj() * pair.right)
        own = np.setdiff1d(self._states.of[1], self._states.of[0])
        return bool(factors[own].sum() > _ITS_OWN * factors.sum())

    def _near(self, model: LinearModel, wanted: complex) -> list[Eigenpair]:
        if len(model.names) > DENSE:
            return continuation.pairs_near(model, wanted)
        if id(model) not in self._pairs:  # all of these models are kept, so their ids stay theirs
            self._pairs[id(model)] = continuation.pairs_near(model, wanted)
        return self._pairs[id(model)]

    def _mixed(self, matrix: str, rows: _Slots, columns: _Slots, part: float) -> sp.csr_array:
        """Take in parts what both have, and each device's own equations whole."""
        found = []
        for side, weight in ((0, 1 - part), (1, part)):
            entries = sp.coo_array(getattr(self._models[side], matrix))
            row, column = rows.of[side][entries.row], columns.of[side][entries.col]
            weights = np.where(row < rows.both, weight, 1.0)
            shape = (len(rows.names), len(columns.names))
            found.append(sp.coo_array((weights * entries.data, (row, column)), shape=shape))
        return sp.csr_array(found[0] + found[1])
