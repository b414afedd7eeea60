"""How currents into buses enter a system's equations, and how the buses' voltages follow from its states.

Of one mode all buses are known by a solution for its left eigenvector and one for its right one. How a current moves
the voltage of its own bus takes a solution for each bus."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
import scipy.sparse as sp

from orchestrator.core.arrays import Matrix, Vector
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.divided_hub import times
from orchestrator.linear.models.linear_model import Indices, LinearModel
from orchestrator.linear.models.linearization import compose
from orchestrator.systems.coupling.schedule import Schedule


@dataclass(frozen=True)
class SomePorts:
    """Some currents and the voltages where they enter.

    Attributes
    ----------
    at_beginning, later
        Next states by the currents, through what the grid gives at a step's beginning, and otherwise; shape (n, c).
    rows
        C of the voltages, shape (c, n).
    direct
        D of the voltages, shape (c, c).
    """

    at_beginning: Matrix
    later: Matrix
    rows: Matrix
    direct: Matrix

    def drive(self, z: complex) -> Vector:
        """B of the currents, shape (n, c)."""
        return np.asarray(self.later + self.at_beginning / z)

    def impedance(self, states: Vector, z: complex) -> Vector:
        """How the currents move their own voltages, shape (c, c), with the states that they drive, shape (n, c)."""
        return np.asarray(times(self.rows, states) + self.direct / z)


@dataclass(frozen=True)
class BusPorts:
    """External currents into a grid, and the voltages where they enter, both by real and imaginary part.

    Attributes
    ----------
    model
        The step map without the currents, of n states and m wires.
    grid
        The grid's linear model, with the currents behind its connected inputs and the voltages as further outputs.
    into_states, into_wires
        What the currents move directly: next states and wires, shapes (n, e) and (m, e).
    at_beginning
        Number of the first wires: outputs as of a step's beginning.
    states
        Places of the grid's states among all.
    entries
        Place in w of each of the grid's inputs; from m on, of the currents.
    latest
        The ports that were solved for last, by their numbers.
    """

    model: LinearModel
    grid: ComponentLinearization
    into_states: sp.csr_array
    into_wires: sp.csr_array
    at_beginning: int
    states: slice
    entries: Indices
    latest: dict[tuple[int, ...], SomePorts] = field(default_factory=dict)

    @classmethod
    def of(cls, blocks: Blocks, schedule: Schedule, model: LinearModel, grid: str) -> Self:
        """Return the ports of blocks with external inputs and further outputs of the grid alone.

        ``model``: composed of the same blocks without these."""
        whole = compose(blocks, schedule)
        p, m = len(blocks.output_names), len(model.wires)
        assert whole.wires[:m] == model.wires
        newest = np.concatenate([np.arange(p), m + np.arange(len(blocks.inputs))])
        arrived = 2 * p + np.arange(len(blocks.links))
        return cls(
            model=model,
            grid=blocks.components[grid],
            into_states=whole.G[:, m:],
            into_wires=whole.K[:m, m:],
            at_beginning=p,
            states=blocks.state_windows()[grid],
            entries=blocks.entries(grid, newest, arrived),
        )

    def drives(self, left: Vector, z: complex) -> Vector:
        """lᴴ·B of all currents, shape (e,), by one solution for the left eigenvector.

        A device's current at a step's beginning is that of the step before, which an input's is not."""
        row = left.conj()
        by_wire = self._settle(self.model.G.T @ row, "T")
        early = self.into_wires[: self.at_beginning].T @ by_wire[: self.at_beginning]
        whole = self.into_states.T @ row + self.into_wires.T @ by_wire
        return np.asarray(whole - (1 - 1 / z) * early)

    def voltages(self, states: Vector) -> Vector:
        """C·x of all voltages, shape (e,), for states x of shape (n,)."""
        wires = self._settle(self.model.H @ states)[self.entries[self._inside]]
        of_wires = self.grid.D_o[:, self._inside] @ wires
        return np.asarray(self.grid.C_o @ states[self.states] + of_wires)

    def some(self, chosen: Indices) -> SomePorts:
        """Return some of the ports, solved for once while the same ones are asked for."""
        key = tuple(chosen.tolist())
        if key not in self.latest:
            self.latest.clear()
            self.latest[key] = self._solve(chosen)
        return self.latest[key]

    def _solve(self, chosen: Indices) -> SomePorts:
        inside, D = self._inside, self.grid.D_o[chosen]
        wires = self.into_wires[:, chosen].toarray()
        begin = wires.copy()
        begin[self.at_beginning :] = 0.0
        by_begin, by_rest = (self._settle(part) for part in (begin, wires - begin))
        taken = np.zeros((len(self.model.wires), len(chosen)))
        np.add.at(taken, self.entries[inside], D[:, inside].T)
        rows = np.ascontiguousarray((self.model.H.T @ self._settle(taken, "T")).T)
        rows[:, self.states] += self.grid.C_o[chosen]
        return SomePorts(
            at_beginning=np.asarray(self.model.G @ by_begin),
            later=np.asarray(self.into_states[:, chosen].toarray() + self.model.G @ by_rest),
            rows=rows,
            direct=taken.T @ (by_begin + by_rest) + D[:, self._place_of_currents[chosen]],
        )

    @property
    def _inside(self) -> Indices:
        """Places of the grid's inputs that are connected."""
        return np.flatnonzero(self.entries < len(self.model.wires))

    @property
    def _place_of_currents(self) -> Indices:
        """Places of the currents among the grid's inputs, in their own order."""
        behind = np.flatnonzero(self.entries >= len(self.model.wires))
        return behind[np.argsort(self.entries[behind])]

    def _settle(self, right: Vector, transposed: str = "N") -> Vector:
        """(I − K)⁻¹·b, or with its transpose; b of any kind and of shape (m,) or (m, c)."""
        settle = self.model.settle
        if not np.iscomplexobj(right):
            return np.asarray(settle(right, transposed))
        apart = (np.ascontiguousarray(part) for part in (right.real, right.imag))
        real, imaginary = (settle(part, transposed) for part in apart)
        return np.asarray(real + 1j * imaginary)
