"""The equations of a power flow in matrices: admittances, mismatch, derivatives and the DC solution."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.linalg import spsolve

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine, FlowLoad, FlowShunt

_SMALLEST_TURN = 1e-9  # smallest reactance [pu, 100 MVA] that counts in the DC solution


@dataclass(frozen=True)
class FlowEquations:
    """Y·v = i with given powers, on 100 MVA."""

    buses: tuple[str, ...]  # names, in the order of all arrays
    # rows, columns, admittances: the admittance matrix [pu] as triplets; several for one place add up
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    admittances: NDArray[np.complex128]
    # P + jQ that is fed into every bus [pu]: what units feed, less the loads
    fed: NDArray[np.complex128]
    slack: int  # the bus with a given voltage and angle zero
    held: NDArray[np.bool_]  # whether a bus has a voltage of given magnitude
    magnitudes: NDArray[np.float64]  # the given magnitudes [pu]; 1 elsewhere
    lines: tuple[FlowLine, ...]
    # P + jQ that loads draw from every bus at 1 pu as constant currents and as constant impedances [pu]
    drawn_as_current: NDArray[np.complex128]
    drawn_as_impedance: NDArray[np.complex128]

    @classmethod
    def of(
        cls,
        buses: Sequence[str],
        lines: Sequence[FlowLine],
        loads: Sequence[FlowLoad],
        shunts: Sequence[FlowShunt],
        active: Mapping[str, float],
        held: Mapping[str, float],
        slack_bus: str,
    ) -> "FlowEquations":
        """The equations of a network.

        ``active``: active power that units feed, by bus [pu, 100 MVA].
        ``held``: magnitudes of held voltages, by bus [pu].
        ``slack_bus``: the bus that balances the power."""
        position = {bus: k for k, bus in enumerate(buses)}
        triplets: list[tuple[int, int, complex]] = []
        for line in lines:
            i, j = position[line.from_bus], position[line.to_bus]
            b_from, b_to = line.charging
            triplets += [(i, i, 1j * b_from), (j, j, 1j * b_to)]
            if line.closed:
                y = 1 / complex(line.R, line.X)
                turn = complex(math.cos(line.shift), math.sin(line.shift))
                triplets += [
                    (i, i, y / line.tap**2),
                    (j, j, y),
                    (i, j, -y * turn / line.tap),
                    (j, i, -y / turn / line.tap),
                ]
        triplets += [(position[s.bus], position[s.bus], complex(s.g, s.b)) for s in shunts]
        fed = np.zeros(len(buses), dtype=complex)
        current = np.zeros(len(buses), dtype=complex)
        impedance = np.zeros(len(buses), dtype=complex)
        for load in loads:
            of_impedance, of_current, of_power = load.parts()
            fed[position[load.bus]] -= of_power / SYSTEM_BASE_MVA
            current[position[load.bus]] += of_current / SYSTEM_BASE_MVA
            impedance[position[load.bus]] += of_impedance / SYSTEM_BASE_MVA
        for bus, power in active.items():
            fed[position[bus]] += power
        rows, columns, admittances = zip(*triplets, strict=True) if triplets else ((), (), ())
        return cls(
            buses=tuple(buses),
            rows=np.array(rows, dtype=np.int64),
            columns=np.array(columns, dtype=np.int64),
            admittances=np.array(admittances, dtype=np.complex128),
            fed=fed,
            slack=position[slack_bus],
            held=np.array([bus in held for bus in buses]),
            magnitudes=np.array([held.get(bus, 1.0) for bus in buses]),
            lines=tuple(lines),
            drawn_as_current=current,
            drawn_as_impedance=impedance,
        )

    def with_shunts(self, shunts: Sequence[FlowShunt]) -> "FlowEquations":
        """The same equations with further admittances to earth."""
        at = [self.buses.index(one.bus) for one in shunts]
        added = [complex(one.g, one.b) for one in shunts]
        return replace(
            self,
            rows=np.append(self.rows, at),
            columns=np.append(self.columns, at),
            admittances=np.append(self.admittances, added),
        )

    @cached_property
    def angle_buses(self) -> NDArray[np.int64]:
        return np.flatnonzero(np.arange(len(self.buses)) != self.slack)

    @cached_property
    def free_buses(self) -> NDArray[np.int64]:
        """Buses whose voltage's magnitude is unknown."""
        return np.flatnonzero(~self.held)

    @cached_property
    def matrix(self) -> csr_array:
        return coo_array(
            (self.admittances, (self.rows, self.columns)), shape=(len(self.buses),) * 2
        ).tocsr()

    def powers(self, voltages: np.ndarray) -> np.ndarray:
        """P + jQ that flows from every bus into the network [pu], in the precision of the voltages."""
        currents = np.zeros(len(self.buses), dtype=voltages.dtype)
        np.add.at(currents, self.rows, self.admittances * voltages[self.columns])
        product: np.ndarray = voltages * currents.conj()
        return product

    @cached_property
    def loads_follow(self) -> bool:
        """Return whether some load draws another power at another voltage."""
        return bool(self.drawn_as_current.any() or self.drawn_as_impedance.any())

    def missing(self, voltages: np.ndarray) -> np.ndarray:
        """P + jQ that every bus lacks to give these voltages [pu]."""
        left = self.powers(voltages) - self.fed
        if self.loads_follow:
            magnitude = np.abs(voltages)
            left += self.drawn_as_current * magnitude + self.drawn_as_impedance * magnitude**2
        product: np.ndarray = left
        return product

    def mismatch(self, voltages: np.ndarray) -> np.ndarray:
        """Return what is left of the unknowns' equations [pu]: active powers, then reactive powers."""
        left = self.missing(voltages)
        return np.concatenate([left.real[self.angle_buses], left.imag[self.free_buses]])

    def worst(self, mismatch: np.ndarray) -> tuple[str, float]:
        k = int(np.argmax(np.abs(mismatch)))
        bus = np.concatenate([self.angle_buses, self.free_buses])[k]
        return self.buses[bus], float(abs(mismatch[k]))

    def jacobian(self, voltages: NDArray[np.complex128]) -> csc_array:
        """Derivatives of the mismatch by the unknown angles [rad] and by the unknown magnitudes [pu]."""
        places, n = self._places, len(self.buses)
        i, j, unit = places.rows, places.columns, voltages / np.abs(voltages)
        currents = self.matrix @ voltages
        leaving = -places.admittances * voltages[j]
        leaving[-n:] += currents
        by_angle = 1j * (voltages[i] * leaving.conj())
        by_magnitude = voltages[i] * (places.admittances * unit[j]).conj()
        by_magnitude[-n:] += currents.conj() * unit
        if self.loads_follow:
            by_magnitude[-n:] += self.drawn_as_current + 2 * self.drawn_as_impedance * np.abs(
                voltages
            )
        parts = by_angle.real, by_magnitude.real, by_angle.imag, by_magnitude.imag
        return csc_array(
            (np.concatenate(parts)[places.sources], places.indices, places.starts),
            shape=(len(places.starts) - 1,) * 2,
        )

    @cached_property
    def _places(self) -> "_Places":
        return _Places.of(self.matrix, self.angle_buses, self.free_buses)

    def dc_angles(self) -> NDArray[np.float64]:
        """Angles [rad] of the linear power flow: voltages of 1 pu, no losses, small angles."""
        position = {bus: k for k, bus in enumerate(self.buses)}
        closed = [line for line in self.lines if line.closed and abs(line.X) > _SMALLEST_TURN]
        i = np.array([position[line.from_bus] for line in closed], dtype=np.int64)
        j = np.array([position[line.to_bus] for line in closed], dtype=np.int64)
        b = np.array([1 / (line.X * line.tap) for line in closed])
        turned = b * np.array([line.shift for line in closed])
        power = (self.fed - self.drawn_as_current - self.drawn_as_impedance).real.copy()
        np.add.at(power, i, turned)
        np.add.at(power, j, -turned)
        where = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
        matrix = coo_array(
            (np.concatenate([b, b, -b, -b]), where), shape=(len(self.buses),) * 2
        ).tocsc()
        angles, known = np.zeros(len(self.buses)), self.angle_buses
        if len(known):
            angles[known] = spsolve(matrix[known][:, known], power[known])
        return angles


@dataclass(frozen=True)
class _Places:
    """Where the entries of a network's Jacobian stand, for all voltages: to put sparse blocks together costs more."""

    # the admittance matrix's entries, the whole diagonal last
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    admittances: NDArray[np.complex128]
    # the Jacobian by columns: starts of the columns, rows, and which of P by angle, P by magnitude, Q by angle and Q by
    # magnitude of these entries, one behind the other, each is
    starts: NDArray[np.int64]
    indices: NDArray[np.int64]
    sources: NDArray[np.int64]

    @classmethod
    def of(
        cls, matrix: csr_array, angle_buses: NDArray[np.int64], free_buses: NDArray[np.int64]
    ) -> "_Places":
        n, entries, every = matrix.shape[0], matrix.tocoo(), np.arange(matrix.shape[0])
        beside = entries.row != entries.col
        rows = np.concatenate([entries.row[beside], every])
        columns = np.concatenate([entries.col[beside], every])
        of_angle, of_magnitude = np.full(n, -1), np.full(n, -1)
        of_angle[angle_buses] = np.arange(len(angle_buses))
        of_magnitude[free_buses] = len(angle_buses) + np.arange(len(free_buses))
        equations, unknowns = (of_angle, of_magnitude), (of_angle, of_magnitude)
        row = np.concatenate([equation[rows] for equation in equations for _ in unknowns])
        column = np.concatenate([unknown[columns] for _ in equations for unknown in unknowns])
        sources = np.flatnonzero((row >= 0) & (column >= 0))
        sources = sources[np.lexsort((row[sources], column[sources]))]
        count = len(angle_buses) + len(free_buses)
        starts = np.concatenate([[0], np.cumsum(np.bincount(column[sources], minlength=count))])
        admittances = np.concatenate([entries.data[beside], matrix.diagonal()])
        return cls(rows, columns, admittances, starts, row[sources], sources)
