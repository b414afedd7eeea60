"""Induction machines of a PSS/E file: the power that they draw at a voltage."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.cases.form.remedies import without_kinds
from orchestrator.cases.networks.psse.devices import DeviceEnd, HeldDevice, Voltages
from orchestrator.core.errors import InputError

ABSENT = 999.0  # value of a resistance or a reactance that is not given
# of machines whose record names a standard design instead of a circuit; the four machines of design B in the solved
# sample case of PSS/E 34 have 0.945, and 0.52 to 0.59
_EFFICIENCY = 0.945
_REACTIVE = 0.55  # Q by P

_SLIPS = np.geomspace(1e-6, 1.0, 400)  # at which the torque is looked for


@dataclass(frozen=True, slots=True)
class Circuit:
    """Stator, magnetising branch and one or two cages [pu of the machine]."""

    stator: complex
    magnetising: float  # reactance
    cages: tuple[complex, ...]
    common: float  # reactance X3 before both cages

    def powers(self, v_pu: float, slip: float) -> tuple[complex, float]:
        """Return P + jQ that the machine draws and the mechanical power that it gives [pu]."""
        admittance = sum(1 / complex(cage.real / slip, cage.imag) for cage in self.cages)
        rotor = complex(0.0, self.common) + 1 / admittance
        magnetising = complex(0.0, self.magnetising)
        inner = rotor * magnetising / (rotor + magnetising)
        current = v_pu / (self.stator + inner)
        airgap = abs(current * inner) ** 2 * (1 / rotor).real
        return v_pu * current.conjugate(), airgap * (1 - slip)


@dataclass(frozen=True)
class InductionMachine(HeldDevice):
    place: str
    bus: int
    is_mechanical: bool  # whether PSET is the power at the shaft
    power_mw: float  # PSET; below zero for a generator
    base_mva: float
    voltage_ratio: float  # the bus' nominal voltage by the machine's
    circuit: Circuit | None
    is_saturated: bool

    @property
    def places(self) -> tuple[int, ...]:
        return (self.bus,)

    def endings(self, voltages: Voltages) -> tuple[DeviceEnd, ...]:
        drawn = self._drawn(abs(voltages[self.bus]))
        return (DeviceEnd(self.ending_name("induction", self.bus), self.bus, -drawn),)

    def doubts(self, voltages: Voltages) -> tuple[str, ...]:
        found = []
        if self.circuit is None:
            found.append(
                "the record names a standard design, whose circuit the file does not hold: its reactive power is "
                f"taken as {_REACTIVE:g} of its active power, and the power at the shaft as {_EFFICIENCY:g} of it"
            )
        if self.is_saturated:
            found.append("its saturation (SE1, SE2) is left out")
        return tuple(found)

    def _drawn(self, v_pu: float) -> complex:
        """Return P + jQ that the machine draws [MW, Mvar]."""
        if self.circuit is None:
            losses = _EFFICIENCY if self.power_mw < 0 else 1 / _EFFICIENCY
            p = self.power_mw * (losses if self.is_mechanical else 1.0)
            return complex(p, _REACTIVE * abs(p))
        v = v_pu * self.voltage_ratio
        return self.base_mva * self.circuit.powers(v, self._slip(self.circuit, v))[0]

    def _slip(self, circuit: Circuit, v: float) -> float:
        """Return the smallest slip at which the machine gives or draws PSET.

        Raises an `InputError` where no slip does."""
        wanted = self.power_mw / self.base_mva
        direction = math.copysign(1.0, wanted)

        def excess(slip: float) -> float:
            electrical, mechanical = circuit.powers(v, slip)
            return direction * ((mechanical if self.is_mechanical else electrical.real) - wanted)

        signs = [excess(direction * slip) for slip in _SLIPS]
        above = next((k for k, value in enumerate(signs) if value >= 0), None)
        if above is None:
            raise InputError.at(
                f"{self.place}, line {self.line}",
                f"the induction machine at bus {self.bus} cannot give PSET = {self.power_mw:g}"
                f" MW at {v:.3g} pu: its circuit allows less; mend the record, or write "
                f"{without_kinds([self.section])}",
            )
        if above == 0:
            return direction * float(_SLIPS[0])
        low, high = direction * _SLIPS[above - 1], direction * _SLIPS[above]
        from scipy.optimize import brentq  # noqa: PLC0415 - what only reads files starts without it

        return float(brentq(excess, low, high, xtol=1e-15))
