"""The control part of a converter, and the circuit that it must be given."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Literal

from fmus.toolchain.model import Model

# entry points: name of a converter → a function that returns its `ControlPart`
GROUP = "gfor_cosim.controls"


@dataclass(frozen=True)
class CircuitElement:
    """One element of the circuit between bridge and bus, the same in each phase.

    ``symbol``, ``place``: its name, and where it lies; ``parameter``: of the control, per unit: the control's gains
    follow from it, so circuit and control must agree; ``kind``: what the parameter becomes: ``damping`` is the
    resistance 1/(30·B_c) in series with the capacitor."""

    symbol: str
    place: str
    parameter: str
    kind: Literal["inductance", "resistance", "capacitance", "damping"]

    def value(self, parameters: Mapping[str, float]) -> tuple[float, str]:
        """Its value and unit, at the voltage V_n, from the control's parameters by name."""
        per_unit = parameters[self.parameter]
        ohm = parameters["V_n"] ** 2 / parameters["S_n"]
        omega = 2 * pi * parameters["f_n"]
        match self.kind:
            case "inductance":
                return per_unit * ohm / omega * 1e3, "mH"
            case "resistance":
                return per_unit * ohm, "ohm"
            case "capacitance":
                return per_unit / ohm / omega * 1e6, "uF"
            case "damping":
                return ohm / (30 * per_unit), "ohm"


@dataclass(frozen=True)
class ControlPart:
    """A converter cut in two: its control as a model, and the rest as a circuit of the host.

    ``model``: measurements in, bridge voltage out; ``lead``: parameter with which the bridge voltage makes up for the
    host's hold [s]; ``circuit``: from the bridge to the bus."""

    model: Model
    lead: str
    circuit: tuple[CircuitElement, ...]
