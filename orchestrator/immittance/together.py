"""Sides of many devices: side by side at their buses, or behind the network that they share with the cut."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.arrays import Complex, Vector
from orchestrator.immittance.sides import Exact, Known

_AT_ONCE = 250  # points for which the matrices of a large network are held at a time

_FEW = 4  # devices that are named one by one

Rows = NDArray[np.int64]


@dataclass(frozen=True)
class Unit:
    """Devices that are connected otherwise than by the network, mostly one: their admittance at rows of the ports."""

    devices: tuple[str, ...]
    rows: Rows
    side: Exact


@dataclass(frozen=True)
class SideBySide(Known):
    """The admittances of units at ``size`` rows; those at one bus add up."""

    name: str
    units: tuple[Unit, ...]
    size: int

    @cached_property
    def poles(self) -> Complex:  # type: ignore[override]
        return np.concatenate([unit.side.poles for unit in self.units])

    def at(self, s: Vector) -> Complex:
        found = np.zeros((len(s), self.size, self.size), dtype=complex)
        for unit in self.units:
            found[:, unit.rows[:, None], unit.rows] += unit.side.at(s)
        return found


@dataclass(frozen=True)
class Behind(Known):
    """The impedance at some rows of a network with the other devices connected; ``poles`` are of both together."""

    name: str
    alone: Exact
    others: SideBySide
    rows: Rows
    poles: Complex

    def at(self, s: Vector) -> Complex:
        return np.concatenate([self._at(s[k : k + _AT_ONCE]) for k in range(0, max(len(s), 1), _AT_ONCE)])

    def _at(self, s: Vector) -> Complex:
        Z = self.alone.at(s)
        closed = np.linalg.solve(np.eye(Z.shape[-1]) + Z @ self.others.at(s), Z[:, :, self.rows])
        return np.asarray(closed[:, self.rows])


def named(devices: str) -> str:
    """A side's name for a line: many devices are counted."""
    count = devices.count(",") + 1
    return devices if count <= _FEW else f"{devices.partition(',')[0]} and {count - 1} more"
