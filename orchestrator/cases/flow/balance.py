"""The elements of a power flow, and the balance of every bus, element by element: it checks a solution."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.grid.element_data import LAWS, ThreeWinding, Zip
from fmus.grid.network import OPEN_CHARGING
from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.errors import InputError


@dataclass(frozen=True, slots=True)
class FlowLine:
    """A π section [pu, 100 MVA] behind an ideal ratio tap·e^{j·shift} [rad] at its from side."""

    name: str
    from_bus: str
    to_bus: str
    R: float
    X: float
    B: float
    tap: float = 1.0
    shift: float = 0.0
    closed: bool = True

    @property
    def has_ratio(self) -> bool:
        return self.tap != 1.0 or self.shift != 0.0

    @property
    def charging(self) -> tuple[float, float]:
        """Susceptance to earth at both ends; for an open line the part that the grid model keeps."""
        b = self.B / 2 * (1.0 if self.closed else OPEN_CHARGING)
        return b / self.tap**2, b

    def powers(self, v_from: complex, v_to: complex) -> tuple[complex, complex]:
        """P + jQ [pu, 100 MVA] that flow into it at both ends; into an open line only that of its charging."""
        b_from, b_to = self.charging
        into, out = -1j * b_from * abs(v_from) ** 2, -1j * b_to * abs(v_to) ** 2
        if self.closed:
            behind = v_from / (self.tap * np.exp(1j * self.shift))
            current = (behind - v_to) / complex(self.R, self.X)
            into += complex(behind * current.conjugate())
            out -= complex(v_to * current.conjugate())
        return into, out


@dataclass(frozen=True, slots=True)
class FlowLoad:
    """A load that draws P + jQ [MW, Mvar] at the voltage ``reference`` [pu], and follows the voltage by its laws."""

    bus: str
    p_mw: float
    q_mvar: float
    active: Zip = LAWS["power"]
    reactive: Zip = LAWS["power"]
    reference: float = 1.0

    @property
    def follows(self) -> bool:
        """Return whether the load draws another power at another voltage."""
        return self.active != LAWS["power"] or self.reactive != LAWS["power"]

    def parts(self) -> tuple[complex, complex, complex]:
        """P + jQ [MW, Mvar] at 1 pu of the constant impedance, the constant current and the constant power in it."""

        def part(share: str, power: int) -> complex:
            p = getattr(self.active, share) * self.p_mw
            q = getattr(self.reactive, share) * self.q_mvar
            return complex(p, q) / self.reference**power

        return part("z", 2), part("i", 1), part("p", 0)

    def drawn(self, magnitude: float) -> complex:
        """P + jQ [MW, Mvar] at a voltage [pu]."""
        if not self.follows:
            return complex(self.p_mw, self.q_mvar)
        impedance, current, power = self.parts()
        return impedance * magnitude**2 + current * magnitude + power


@dataclass(frozen=True, slots=True)
class FlowShunt:
    """An admittance to earth g + jb [pu, 100 MVA]; ``stray`` where it is the network's stray capacitance."""

    bus: str
    g: float
    b: float
    stray: bool = False


def nodal_powers(
    voltages: Mapping[str, complex],
    lines: Sequence[FlowLine],
    loads: Sequence[FlowLoad],
    shunts: Sequence[FlowShunt],
) -> dict[str, complex]:
    """P + jQ [pu, 100 MVA] that units must feed into every bus to give these voltages."""
    needed = dict.fromkeys(voltages, 0j)
    for line in lines:
        into, out = line.powers(voltages[line.from_bus], voltages[line.to_bus])
        needed[line.from_bus] += into
        needed[line.to_bus] += out
    for load in loads:
        needed[load.bus] += load.drawn(abs(voltages[load.bus])) / SYSTEM_BASE_MVA
    for shunt in shunts:
        needed[shunt.bus] += complex(shunt.g, -shunt.b) * abs(voltages[shunt.bus]) ** 2
    return needed


def check_connected(buses: Sequence[str], lines: Sequence[FlowLine], slack_bus: str) -> None:
    neighbours: dict[str, set[str]] = {bus: set() for bus in buses}
    for line in lines:
        if line.closed:
            neighbours[line.from_bus].add(line.to_bus)
            neighbours[line.to_bus].add(line.from_bus)
    reached, waiting = {slack_bus}, [slack_bus]
    while waiting:
        found = neighbours[waiting.pop()] - reached
        waiting += found
        reached |= found
    islands = [bus for bus in buses if bus not in reached]
    if islands:
        opened = [
            line.name
            for line in lines
            if not line.closed and {line.from_bus, line.to_bus} & set(islands)
        ]
        remedy = f"close {', '.join(opened[:5])}, " if opened else ""
        raise InputError(
            f"power flow: no way leads to the slack bus {slack_bus!r} from: {', '.join(map(repr, islands[:10]))}; "
            f"{remedy}connect them with a line, or remove them (in a RAW file by IDE = 4 at these buses)"
        )


_PART = 0.01
"""Reactance [pu, 100 MVA] of the part of a leg of negative reactance that carries its ratio: the power flow's
transformers have positive reactances only."""


def inner_buses(transformer: ThreeWinding) -> list[str]:
    """Buses that a transformer has in the power flow alone: its star point, and those inside of split legs."""
    split = [f"{transformer.name}.inner_{k + 1}" for k in range(3) if _is_split(transformer, k)]
    return [f"{transformer.name}.star", *split]


def legs_of(transformer: ThreeWinding, *, closed: bool = True) -> list[FlowLine]:
    """The legs from the buses to the star point.

    A leg with both a ratio and a negative reactance is two in series. An open transformer keeps its star point with the
    first bus, without a current."""
    legs, star = [], f"{transformer.name}.star"
    for k, bus in enumerate(transformer.buses):
        name, X, R = f"{transformer.name}.leg_{k + 1}", transformer.X[k], transformer.R[k]
        ratio = {"tap": transformer.tap[k], "shift": transformer.shift[k]}
        is_closed = closed or k == 0
        if _is_split(transformer, k):
            inner = f"{transformer.name}.inner_{k + 1}"
            legs.append(
                FlowLine(f"{name}_ratio", bus, inner, 0.0, _PART, 0.0, closed=is_closed, **ratio)
            )
            legs.append(FlowLine(name, inner, star, R, X - _PART, 0.0))
        else:
            legs.append(FlowLine(name, bus, star, R, X, 0.0, closed=is_closed, **ratio))
    return legs


def _is_split(transformer: ThreeWinding, k: int) -> bool:
    return transformer.X[k] < 0 and transformer.has_ratio(k)
