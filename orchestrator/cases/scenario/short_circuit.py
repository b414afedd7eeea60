"""Short-circuit power of every bus, and the short-circuit ratio of the converters there.

The convention: an initial three-phase short circuit from 1 pu everywhere (c = 1). Machines are R_s + jX''_d (jX'_d of
the classical one) with their own transformer, external grids their impedance, lines and transformers have their ratio.
Induction generators are their circuit at standstill, as in IEC 60909-0:2016. Loads, motors among them, shunts and
charging are left out. A converter feeds a declared current, by default none, which adds to the others' without regard
to its angle, as converters do in that standard."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.flow.balance import FlowLine
from orchestrator.cases.flow.induction_impedances import locked_impedance
from orchestrator.cases.flow.source_impedances import source_impedance
from orchestrator.cases.form.names import close_names
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.start_values import is_connected
from orchestrator.core.errors import InputError, few

CONVENTION = (
    "initial three-phase short circuit from 1 pu (c = 1); machines as R_s + jX''d with their transformer, external "
    "grids as their impedance; loads with motors, shunts and charging left out; converters feed {:g} pu of their rating"
)
_FARTHEST = 1e5  # largest factor on the impedances at a bus, and the inverse of the smallest


@dataclass(frozen=True)
class BusStrength:
    """How strong the grid is at a bus. `Scenario.strengths` makes it.

    Attributes
    ----------
    bus
        Its name.
    s_sc_mva
        Short-circuit power [MVA].
    x_r
        X/R of the impedance; None where that has no resistance.
    converters
        Names of the converters there.
    rating_mva
        Of the converters, or the one that was asked for [MVA]; None without either.
    """

    bus: str
    s_sc_mva: float
    x_r: float | None
    converters: tuple[str, ...]
    rating_mva: float | None

    @property
    def scr(self) -> float | None:
        """Short-circuit power over the converters' rating."""
        return self.s_sc_mva / self.rating_mva if self.rating_mva else None

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor scr --json`` prints of a bus, as JSON's types."""
        return {**asdict(self), "scr": self.scr}


@dataclass(frozen=True)
class ShortCircuit:
    """A network as a short circuit sees it: ``sources`` are admittances [pu, 100 MVA] at buses, ``converters`` buses
    and ratings [MVA]."""

    buses: tuple[str, ...]
    lines: tuple[FlowLine, ...]
    sources: Mapping[str, complex]
    converters: Mapping[str, tuple[str, float]]

    @classmethod
    def of(cls, prepared: PreparedScenario) -> "ShortCircuit":
        network, flow = prepared.network, prepared.power_flow
        if network is None or flow is None:
            raise InputError(
                f"{prepared.case.name}: short-circuit power needs a network with a power flow; the case has no "
                "[power_flow]"
            )
        plans = prepared.system.components
        sources: dict[str, complex] = {}
        converters: dict[str, tuple[str, float]] = {}
        for port in (port for port in network.ports if port.name in plans):
            plan = plans[port.name]
            if not (
                is_connected(plan, "connected")
                and is_connected(plans[prepared.grid], f"{port.name}.connected")
            ):
                continue
            if plan.description.kind == "load":
                continue
            z = source_impedance(plan) or locked_impedance(plan)
            if z is None:
                converters[port.name] = port.bus, plan.number("S_n")
            else:
                sources[port.bus] = sources.get(port.bus, 0j) + 1 / z
        if not sources:
            raise InputError(
                f"{prepared.case.name}, scenario {prepared.name!r}: no machine and no external grid is connected, so "
                "nothing feeds a short circuit; converters count with a declared current only beside them"
            )
        return cls(tuple(flow.voltages), flow.lines, sources, converters)

    def strengths(self, current: float = 0.0, rating_mva: float | None = None) -> list[BusStrength]:
        """All buses.

        ``current``: That a converter feeds into a short circuit [pu of its rating].
        ``rating_mva``: Of a converter that every bus is to be judged for [MVA]; the converters' own ratings where None.
        """
        Z = np.linalg.inv(self._admittances())
        at = {bus: k for k, bus in enumerate(self.buses)}
        found = []
        for bus, k in at.items():
            here = [name for name, (place, _) in self.converters.items() if place == bus]
            own = sum(self.converters[name][1] for name in here) or None
            fed = sum(
                abs(Z[k, at[place]]) * current * S_n for place, S_n in self.converters.values()
            )
            power = (SYSTEM_BASE_MVA + fed) / abs(Z[k, k])
            x_r = (
                float(Z[k, k].imag / Z[k, k].real)
                if abs(Z[k, k].real) > 1e-9 * abs(Z[k, k])
                else None
            )
            found.append(BusStrength(bus, float(power), x_r, tuple(here), rating_mva or own))
        return found

    def gscr(self) -> float | None:
        """Generalised short-circuit ratio of all converters together; that of the only one is its SCR. None without."""
        if not self.converters:
            return None
        k = [self.buses.index(place) for place, _ in self.converters.values()]
        shares = np.array([S_n for _, S_n in self.converters.values()]) / SYSTEM_BASE_MVA
        Z = np.linalg.inv(self._admittances())[np.ix_(k, k)]
        return float(1 / np.abs(np.linalg.eigvals(Z * shares)).max())

    def power_at(self, bus: str, factor: float = 1.0) -> float:
        """Short-circuit power of a bus [MVA] with the impedances of all branches that end there times a factor."""
        lines = [
            replace(x, R=x.R * factor, X=x.X * factor) if bus in (x.from_bus, x.to_bus) else x
            for x in self.lines
        ]
        return replace(self, lines=tuple(lines)).strengths()[self.buses.index(bus)].s_sc_mva

    def factor_for(self, bus: str, power: float) -> float:
        """The factor on the impedances of the branches at a bus that gives it a short-circuit power [MVA]."""
        from scipy.optimize import brentq  # noqa: PLC0415 - half a second to import

        ends = -math.log(_FARTHEST), math.log(_FARTHEST)
        most, least = (self.power_at(bus, math.exp(end)) for end in ends)
        if not least < power < most:
            raise InputError(
                f"{bus}: a short-circuit power of {power:.5g} MVA cannot be had by the impedances of the branches "
                f"there, which give {least:.4g} to {most:.4g} MVA"
            )
        return math.exp(
            brentq(lambda x: math.log(self.power_at(bus, math.exp(x)) / power), *ends, xtol=1e-12)
        )

    def known(self, bus: str) -> str:
        if bus in self.buses:
            return bus
        hint = close_names(bus, self.buses, f"there are: {few(self.buses, 8)}")
        raise InputError(f"the network has no bus {bus!r}; {hint}")

    def _admittances(self) -> np.ndarray:
        at = {bus: k for k, bus in enumerate(self.buses)}
        Y = np.zeros((len(at), len(at)), dtype=complex)
        for line in (line for line in self.lines if line.closed):
            y, ratio = 1 / complex(line.R, line.X), line.tap * np.exp(1j * line.shift)
            a, b = at[line.from_bus], at[line.to_bus]
            Y[a, a] += y / abs(ratio) ** 2
            Y[b, b] += y
            Y[a, b] -= y / ratio.conjugate()
            Y[b, a] -= y / ratio
        for bus, source in self.sources.items():
            Y[at[bus], at[bus]] += source
        return Y


def weakest_first(found: Sequence[BusStrength]) -> list[BusStrength]:
    return sorted(found, key=lambda x: (x.scr is None, x.scr or 0.0, x.s_sc_mva))
