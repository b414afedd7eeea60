"""The two-area system: both machines, the converter, line and loads, its power flow and its modes."""

from dataclasses import dataclass, field
from math import cos, sin
from typing import Literal

import numpy as np

from tests.reference.descriptor import Linearised, Unknowns, linearise, steady_state
from tests.reference.grid_forming import GFOR, Converter
from tests.reference.synchronous_machine import PSS2A, SG1, SG2, W_B, Data, Machine

TRANSFER = 1.0
"""Power from bus 2 to bus 3 [pu on 100 MVA]."""

LOAD_3 = 40.0
"""Active power at |v| = 1 [pu on 100 MVA]; load 2 takes what the units at its bus feed, less the transfer."""

LoadKind = Literal["impedance", "current", "current at once"]


@dataclass(frozen=True)
class TwoAreas:
    """What is connected, and how.

    Attributes
    ----------
    X_L
        Reactance of the line [pu on 100 MVA].
    converter
        Data of the converter, or None for the base system.
    loads
        Constant impedance; constant current that follows with a lag; constant current at every instant, which makes
        the voltage's magnitude a Lagrange multiplier (index 2).
    lag
        Of a load of constant current [s].
    """

    X_L: float
    converter: Data | None = None
    sg1: Data = field(default_factory=lambda: SG1)
    sg2: Data = field(default_factory=lambda: SG2)
    loads: LoadKind = "impedance"
    lag: float = 1e-3
    P_1: float = 0.9
    P_converter: float = 0.9

    def load_2(self) -> float:
        """Its active power at |v| = 1 [pu on 100 MVA]."""
        fed = self.P_1 * self.sg1["S_n"] / 100
        if self.converter is not None:
            fed += self.P_converter * self.converter["S_n"] / 100
        return fed - TRANSFER

    def linearised(self) -> Linearised:
        """E and A at the steady state."""
        units: list[Machine | Converter] = [
            Machine("sg1", self.sg1, "bus_2"),
            Machine("sg2", self.sg2, "bus_3"),
        ]
        if self.converter is not None:
            units.append(Converter("gfor", self.converter, "bus_2"))

        def equations(s: Unknowns) -> None:
            for unit in units:
                unit.equations(s)
            self._network(s, units)

        def conditions(s: Unknowns) -> None:
            self._power_flow(s, units)

        start = self._start(units)
        values = steady_state(equations, conditions, start)
        references = tuple(name for unit in units for name in unit.references)
        return linearise(equations, references, values)

    def _start(self, units: list[Machine | Converter]) -> dict[str, float]:
        """First guess: the line's phasor diagram, reactive power shared by rating."""
        angle = float(np.arcsin(TRANSFER * self.X_L))
        v_2, v_3 = complex(cos(angle), sin(angle)), 1.0 + 0.0j
        line = (v_2 - v_3) / (1j * self.X_L)
        values = {"bus_2.re": v_2.real, "bus_2.im": v_2.imag, "bus_3.re": 1.0, "bus_3.im": 0.0}
        values |= {"line.re": line.real, "line.im": line.imag}
        at_2 = sum(unit.data["S_n"] for unit in units if unit.bus == "bus_2") / 100
        q_2 = (v_2 * line.conjugate()).imag / at_2
        for unit in units:
            if unit.bus == "bus_3":
                power = (LOAD_3 - v_3 * line.conjugate()) / (unit.data["S_n"] / 100)
                values |= unit.start(v_3, power)
            else:
                p = self.P_1 if isinstance(unit, Machine) else self.P_converter
                values |= unit.start(v_2, complex(p, q_2))
        if self.loads == "current":
            values |= dict.fromkeys(("load_2.re", "load_2.im", "load_3.re", "load_3.im"), 0.0)
        return values

    def _network(self, s: Unknowns, units: list[Machine | Converter]) -> None:
        """Line, loads and the balance of currents at both buses; v = 1 + 0j is 1 pu."""
        line = s["line.re"], s["line.im"]
        ends = [(s["bus_2.re"], s["bus_2.im"]), (s["bus_3.re"], s["bus_3.im"])]
        s.equate(self.X_L / W_B * s.dot("line.re"), ends[0][0] - ends[1][0] + self.X_L * line[1])
        s.equate(self.X_L / W_B * s.dot("line.im"), ends[0][1] - ends[1][1] - self.X_L * line[0])
        for bus, sign, power in (("bus_2", -1, self.load_2()), ("bus_3", 1, LOAD_3)):
            v = s[f"{bus}.re"], s[f"{bus}.im"]
            drawn = self._load(s, f"load_{bus[-1]}", v, power)
            fed = [unit.current(s) for unit in units if unit.bus == bus]
            for k in range(2):
                s.equate(sum(current[k] for current in fed) + sign * line[k], drawn[k])

    def _load(
        self, s: Unknowns, name: str, v: tuple[complex, complex], power: float
    ) -> tuple[complex, complex]:
        """Current into a load that draws ``power`` at |v| = 1."""
        if self.loads == "impedance":
            return power * v[0], power * v[1]
        size = np.sqrt(v[0] ** 2 + v[1] ** 2)
        if self.loads == "current at once":
            return power * v[0] / size, power * v[1] / size
        drawn = []
        for part, voltage in zip(("re", "im"), v, strict=True):
            c = s[f"{name}.{part}"]
            s.equate(
                self.lag * s.dot(f"{name}.{part}"), power * voltage / size - power * voltage - c
            )
            drawn.append(power * voltage + c)
        return drawn[0], drawn[1]

    def _power_flow(self, s: Unknowns, units: list[Machine | Converter]) -> None:
        """What replaces the references: |v| = 1 at both buses, the angle of bus 3, powers, shares."""
        s.equate(s["bus_3.im"], 0.0)
        for bus in ("bus_2", "bus_3"):
            s.equate(s[f"{bus}.re"] ** 2 + s[f"{bus}.im"] ** 2, 1.0)
        by_name = {unit.name: unit for unit in units}
        for name in ("sg1", "sg2"):
            by_name[name].conditions(s)
        p_1, q_1 = by_name["sg1"].power(s)
        s.equate(p_1, self.P_1)
        if "gfor" in by_name:
            p, q = by_name["gfor"].power(s)
            s.equate(p, self.P_converter)
            s.equate(q, q_1)  # reactive power at bus 2 in proportion to the ratings
            s.equate(s["gfor.Q_f"], s["gfor.Q_ref"])


_P, _Q = {"pod_p.enabled": True}, {"pod_q.enabled": True}
SCENARIOS: dict[str, Data | None] = {
    "base": None,
    "gfor": GFOR,
    "pod_p": GFOR | _P,
    "pod_q": GFOR | _Q,
    "pod_pq": GFOR | _P | _Q,
}
DETUNED: dict[str, Data | None] = {
    "pod_p, sign turned, K × 10": GFOR | _P | {"pod_p.K": -2000.0},
    "pod_p, sign turned": GFOR | _P | {"pod_p.K": -200.0},
    "pod_q, sign turned, K × 10": GFOR | _Q | {"pod_q.K": -2000.0},
    "pod_q, K × 10": GFOR | _Q | {"pod_q.K": 2000.0},
    "pod_q, sign turned": GFOR | _Q | {"pod_q.K": -200.0},
}
"""Rows of the grid code's table; a turned sign is a negative gain."""


def paper_system(
    scenario: str, X_L: float, governor_on_sg1: bool = True, saturation: bool = False
) -> TwoAreas:
    """Case study 1 of the paper: constant-impedance loads, no stabiliser."""
    saturated = {"machine.saturation": saturation}
    sg1 = SG1 | {"governor.enabled": governor_on_sg1} | saturated
    return TwoAreas(X_L, SCENARIOS[scenario], sg1, SG2 | saturated)


def grid_code_system(
    scenario: str, X_L: float, loads: LoadKind = "current", stabiliser: bool = True
) -> TwoAreas:
    """The grid code's damping test: SG1 with PSS2A and without governor, loads of constant active current."""
    sg1 = SG1 | {"governor.enabled": False} | (PSS2A if stabiliser else {})
    return TwoAreas(X_L, (SCENARIOS | DETUNED)[scenario], sg1, loads=loads)
