"""Multi-terminal DC networks of a PSS/E file: one converter holds a voltage, the others a power or a current."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.psse.bridges import Bridges
from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Voltages
from orchestrator.cases.networks.source_changes import Remark
from orchestrator.core.errors import InputError

CURRENT = 2  # MDC
_ROUNDS = 500
_ACCURATE = 1e-12  # change of a voltage in a round, by the held one


@dataclass(frozen=True, slots=True)
class Terminal:
    """A converter: its bus in both networks, and SETVL: voltage [kV], power [MW] or current [A] from the AC side."""

    bus: int
    dc_bus: int
    bridges: Bridges
    setting: float


@dataclass(frozen=True)
class MultiTerminal(HeldDevice):
    place: str
    mode: int
    terminals: tuple[Terminal, ...]
    holding: int  # place of the terminal that holds its voltage
    links: tuple[tuple[int, int, float], ...]  # DC buses and resistance [ohm]
    earths: tuple[tuple[int, float], ...]  # DC bus and resistance to earth [ohm]

    @property
    def places(self) -> tuple[int, ...]:
        return tuple(terminal.bus for terminal in self.terminals)

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        found = []
        for terminal, kilovolts, current in self.state():
            q = terminal.bridges.reactive(abs(voltages[terminal.bus]), abs(current), abs(kilovolts))
            name = self.ending_name("dc", terminal.bus)
            found.append(DeviceEnd(name, terminal.bus, complex(-kilovolts * current, -q)))
        return tuple(found)

    def doubts(self, voltages: Voltages) -> tuple[str, ...]:
        found = []
        for terminal, kilovolts, current in self.state():
            if terminal.bridges.is_known and terminal.bridges.capacitor_ohm == 0:
                most = terminal.bridges.most_voltage(abs(voltages[terminal.bus]), abs(current))
                if abs(kilovolts) > most:
                    text = f"the converter at bus {terminal.bus} needs {abs(kilovolts):.4g} kV"
                    text += f", and its least angle allows {most:.4g}: its tap is held, where PSS/E moves it"
                    found.append(
                        Remark(text, "a converter that needs more than its least angle allows")
                    )
        return tuple(found)

    def state(self) -> list[tuple[Terminal, float, float]]:
        """Return the voltage [kV] and the current from the AC side [kA] of each terminal.

        Raises an `InputError` where the DC network has no solution."""
        buses = sorted(
            {terminal.dc_bus for terminal in self.terminals}
            | {bus for start, end, _ in self.links for bus in (start, end)}
        )
        place = {bus: k for k, bus in enumerate(buses)}
        matrix = np.zeros((len(buses), len(buses)))
        for start, end, ohm in self.links:
            i, j = place[start], place[end]
            for row, column, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                matrix[row, column] += sign / ohm
        for bus, ohm in self.earths:
            matrix[place[bus], place[bus]] += 1 / ohm
        slack = place[self.terminals[self.holding].dc_bus]
        others = [k for k in range(len(buses)) if k != slack]
        held = self.terminals[self.holding].setting
        at = [place[terminal.dc_bus] for terminal in self.terminals]
        kilovolts = np.full(len(buses), held)
        for _ in range(_ROUNDS):
            fed = self._currents(kilovolts[at])
            into = np.zeros(len(buses))
            np.add.at(into, at, fed)
            into[slack] = 0.0
            right = into[others] - matrix[others, slack] * held
            moved = kilovolts.copy()
            moved[others] = _solution(matrix[np.ix_(others, others)], right)
            change = float(np.abs(moved - kilovolts).max())
            kilovolts = moved
            if not math.isfinite(change) or min(kilovolts[at]) <= 0:
                break
            if change <= _ACCURATE * abs(held):
                fed[self.holding] += float(matrix[slack] @ kilovolts) - float(
                    sum(x for x, k in zip(fed, at, strict=True) if k == slack)
                )
                rows = zip(self.terminals, kilovolts[at], fed, strict=True)
                return [(terminal, float(v), float(i)) for terminal, v, i in rows]
        raise InputError.at(
            f"{self.place}, line {self.line}",
            f"the DC network {self.name!r} has no solution with these settings (SETVL) "
            f"and resistances; mend the record, or write {without_kinds([self.section])}",
        )

    def _currents(self, kilovolts: np.ndarray) -> np.ndarray:
        """Return what the terminals feed into the DC network [kA]; 0 for the one that holds its voltage."""
        settings = np.array([terminal.setting for terminal in self.terminals])
        fed = settings / 1000 if self.mode == CURRENT else settings / kilovolts
        fed[self.holding] = 0.0
        return np.asarray(fed)


def _solution(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return the solution, or not-a-numbers where the network is not connected."""
    try:
        return np.asarray(np.linalg.solve(matrix, right))
    except np.linalg.LinAlgError:
        return np.full(len(right), np.nan)
