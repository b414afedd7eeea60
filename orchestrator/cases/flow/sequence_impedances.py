"""One sequence network of a system, and its impedance at a bus or between two buses.

The networks of the negative and of the zero sequence are passive: admittances between buses and to earth. A bus from
which no admittance leads to earth has no impedance to it, and no current of that sequence flows in a fault there.

Source: symmetrical components (C. L. Fortescue, AIEE Transactions 37, 1918)."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from orchestrator.cases.flow.connected import connected_parts
from orchestrator.core.errors import InputError

NO_PATH = complex(math.inf, 0.0)
"""Impedance of a bus from which nothing leads to earth, or between buses that nothing joins."""


@dataclass
class SequenceNetwork:
    """Admittances [pu, 100 MVA] of one sequence, element by element."""

    buses: list[str]
    _entries: dict[tuple[str, str], complex] = field(default_factory=dict)
    _earthed: set[str] = field(default_factory=set)
    _led: set[str] = field(default_factory=set)  # earthed by more than a capacitance
    _ends: list[tuple[str, str]] = field(default_factory=list)
    _solved: dict[frozenset[str], tuple[dict[str, int], SuperLU]] = field(default_factory=dict)

    def add_bus(self, bus: str) -> None:
        """Add a bus of this network alone, such as a fault's place along a line."""
        self.buses.append(bus)

    def add_to_earth(self, bus: str, y: complex) -> None:
        """Add an admittance to earth [pu, 100 MVA]; 0 is none."""
        if y:
            self._add(bus, bus, y)
            self._earthed.add(bus)
            self._led.add(bus)

    def add_shunt(self, bus: str, y: complex) -> None:
        """Add a line's charging or a shunt [pu, 100 MVA], which may be a capacitance; 0 is none."""
        if y.imag <= abs(y.real):
            self.add_to_earth(bus, y)
            return
        self._add(bus, bus, y)
        self._earthed.add(bus)

    def add_series(self, one: str, other: str, z: complex, ratio: complex = 1.0) -> None:
        """Add an impedance [pu, 100 MVA] between two buses, behind an ideal ratio at the first."""
        y = 1 / z
        self._add(one, one, y / abs(ratio) ** 2)
        self._add(other, other, y)
        self._add(one, other, -y / ratio.conjugate())
        self._add(other, one, -y / ratio)
        self._ends.append((one, other))

    def couple(
        self,
        ends: Mapping[str, tuple[str, str]],
        own: Mapping[str, complex],
        mutual: Mapping[tuple[str, str], complex],
    ) -> None:
        """Couple branches that are there already.

        ``ends``, ``own``: buses and impedance of each branch [pu, 100 MVA]; ``mutual``: impedance between two, of which
        both count from their first end."""
        place = {name: k for k, name in enumerate(ends)}
        Z = np.diag(np.array([own[name] for name in place], dtype=complex))
        for (one, other), z in mutual.items():
            Z[place[one], place[other]] += z
            Z[place[other], place[one]] += z
        change = np.linalg.inv(Z) - np.diag(1 / np.diag(Z)) if place else Z
        for one, k in place.items():
            for other, j in place.items():
                if change[k, j]:
                    self._ends.append((ends[one][0], ends[other][0]))
                for bus, sign in zip(ends[one], (1, -1), strict=True):
                    for far, turn in zip(ends[other], (1, -1), strict=True):
                        self._add(bus, far, complex(sign * turn * change[k, j]))

    def impedance(self, bus: str) -> complex:
        """Return the impedance from a bus to earth [pu, 100 MVA]; `NO_PATH` where none leads there."""
        part = self.part_of(bus)
        if not self._earthed & set(part):
            return NO_PATH
        place, factors = self._factors(part)
        return complex(self._column(factors, place, {bus: 1.0})[place[bus]])

    def is_capacitive(self, bus: str) -> bool:
        """Return whether capacitances are all that leads from a bus to earth."""
        part = {*self.part_of(bus)}
        return bool(self._earthed & part) and not self._led & part

    def between(self, one: str, other: str) -> complex:
        """Return the impedance between two buses [pu, 100 MVA]; `NO_PATH` where nothing joins them, earth included."""
        part = self.part_of(one)
        if other not in part:
            return self.impedance(one) + self.impedance(other)
        held = () if self._earthed & set(part) else (other,)
        place, factors = self._factors([bus for bus in part if bus not in held])
        driven = {bus: y for bus, y in ((one, 1.0), (other, -1.0)) if bus not in held}
        v = self._column(factors, place, driven)
        return complex(sum(v[place[bus]] * y for bus, y in driven.items()))

    def _add(self, row: str, column: str, y: complex) -> None:
        self._entries[row, column] = self._entries.get((row, column), 0j) + y
        self._solved.clear()

    def part_of(self, bus: str) -> list[str]:
        """Return the buses that branches join with one."""
        parts = connected_parts(self.buses, self._ends)
        return [other for other in self.buses if parts[other] == parts[bus]]

    def _factors(self, buses: Iterable[str]) -> tuple[dict[str, int], SuperLU]:
        """Return the places of some buses, and their factorised matrix."""
        place = {bus: k for k, bus in enumerate(buses)}
        key = frozenset(place)
        if key not in self._solved:
            known = {
                pair: y
                for pair, y in self._entries.items()
                if pair[0] in place and pair[1] in place
            }
            rows = [place[row] for row, _ in known]
            columns = [place[column] for _, column in known]
            values = np.array([*known.values()], dtype=complex)
            matrix = csc_array((values, (rows, columns)), shape=(len(place), len(place)))
            try:
                self._solved[key] = place, splu(matrix)
            except RuntimeError as error:  # exactly singular
                raise InputError(
                    f"a sequence network with {len(place)} buses has no solution: capacitances and inductances to "
                    "earth cancel; check charging, shunts and earthing"
                ) from error
        return self._solved[key]

    @staticmethod
    def _column(factors: SuperLU, place: dict[str, int], currents: dict[str, float]) -> np.ndarray:
        """Return the voltages [pu] that currents [pu] into buses give."""
        driven = np.zeros(len(place), dtype=complex)
        for bus, current in currents.items():
            driven[place[bus]] = current
        return np.asarray(factors.solve(driven))
