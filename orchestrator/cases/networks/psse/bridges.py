"""Line-commutated bridges: the voltage on their DC side and the reactive power that they draw.

Sources: E. W. Kimbark, "Direct Current Transmission" (1971), chapter 3: the bridge with overlap.  With commutating
capacitors: J. Reeve et al., "Proposed HVDC transmission with capacitor commutated converters" (1968), whose waveforms
are integrated here."""

import math
from dataclasses import dataclass

import numpy as np

_NO_LOAD = (
    3 * math.sqrt(2) / math.pi
)  # DC voltage of a bridge at no load by its line-to-line voltage
_ROUNDS = 100  # of the overlap with capacitors
_SMALL = 1e-12
_LARGEST_OVERLAP = 1.5  # [rad]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True, slots=True)
class Bridges:
    """Bridges in series at one bus.

    Resistances of the transformers (RC) are not counted: in PSS/E's own solutions the powers of both sides are equal.
    """

    count: int
    x_ohm: float  # commutating reactance of a bridge
    capacitor_ohm: float  # reactance of its commutating capacitor
    base_kv: float  # of the transformer's primary side
    ratio: float  # of the secondary voltage by the primary one, at the tap
    least_angle: float  # least firing or extinction angle [rad]
    most_angle: float

    @property
    def is_known(self) -> bool:
        """Return whether the record tells of any bridge."""
        return self.count > 0 and self.base_kv > 0 and self.ratio > 0

    def valve_kv(self, v_pu: float) -> float:
        """Return the line-to-line voltage behind the transformer."""
        return v_pu * self.base_kv * self.ratio

    def voltage(self, v_pu: float, current: float, angle: float) -> float:
        """Return the voltage on the DC side [kV] at a current [kA] and an angle [rad]."""
        E = self.valve_kv(v_pu)
        if self.capacitor_ohm and current > _SMALL:
            return self.count * _power_with_capacitors(self, E, current, angle).real / current
        drop = 3 / math.pi * self.x_ohm * current
        return self.count * (_NO_LOAD * E * math.cos(angle) - drop)

    def most_voltage(self, v_pu: float, current: float) -> float:
        """Return the largest voltage [kV] that the least angle allows; no limit is known of what is no bridge.

        With commutating capacitors the valves' own angle is another than that to the bus, and is not limited here."""
        if not self.is_known or self.capacitor_ohm:
            return math.inf
        return self.voltage(v_pu, current, self.least_angle)

    def angle(self, v_pu: float, current: float, kilovolts: float) -> float:
        """Return the angle [rad] that gives a DC voltage [kV]; the nearest where none does."""
        if self.capacitor_ohm and current > _SMALL:
            return self._angle_with_capacitors(v_pu, current, kilovolts)
        drop = 3 / math.pi * self.x_ohm * current
        cosine = (kilovolts / self.count + drop) / (_NO_LOAD * self.valve_kv(v_pu))
        return math.acos(min(1.0, max(-1.0, cosine)))

    def _angle_with_capacitors(self, v_pu: float, current: float, kilovolts: float) -> float:
        from scipy.optimize import brentq  # noqa: PLC0415 - what only reads files starts without it

        def excess(angle: float) -> float:
            return self.voltage(v_pu, current, angle) - kilovolts

        least, most = math.radians(0.5), math.radians(89.5)
        if excess(least) <= 0:
            return least
        return most if excess(most) >= 0 else float(brentq(excess, least, most, xtol=1e-12))

    def reactive(self, v_pu: float, current: float, kilovolts: float) -> float:
        """Return the reactive power that the bridges draw [Mvar] at a DC current [kA] and voltage [kV]."""
        if not self.is_known or current < _SMALL:
            return 0.0
        E, angle = self.valve_kv(v_pu), self.angle(v_pu, current, kilovolts)
        if self.capacitor_ohm:
            power = _power_with_capacitors(self, E, current, angle)
            return kilovolts * current * power.imag / power.real
        end = math.acos(max(-1.0, math.cos(angle) - math.sqrt(2) * self.x_ohm * current / E))
        overlap = end - angle
        if overlap < _SMALL:
            return kilovolts * current * math.tan(angle)
        sines = 2 * overlap + math.sin(2 * angle) - math.sin(2 * end)
        return kilovolts * current * sines / (math.cos(2 * angle) - math.cos(2 * end))


def _power_with_capacitors(bridges: Bridges, E: float, current: float, angle: float) -> complex:
    """Return P + jQ that one bridge with commutating capacitors draws [MW, Mvar].

    Each capacitor's voltage swings by what a valve's current of 120 degrees brings.  While valves commutate, the
    transformers' reactances and the capacitors of two phases are one circuit of second order."""
    from scipy.optimize import brentq  # noqa: PLC0415 - what only reads files starts without it

    x, c = bridges.x_ohm, bridges.capacitor_ohm
    rate, forced = math.sqrt(c / x), math.sqrt(2) * E / (2 * (c - x))
    peak, moved, overlap = current * c * math.pi / 3, 0.0, 0.0
    cosine = -(current / 2 + forced * math.cos(angle))

    def rising(at: np.ndarray) -> np.ndarray:
        """Return the current of the valve that takes over, after so much of the overlap."""
        own = cosine * np.cos(rate * at) + sine * np.sin(rate * at)
        value: np.ndarray = current / 2 + own + forced * np.cos(angle + at)
        return value

    for _ in range(_ROUNDS):
        slope = (math.sqrt(2) * E * math.sin(angle) + 2 * peak - moved) / (2 * x)
        sine = (slope + forced * math.sin(angle)) / rate
        grid = np.linspace(0.0, _LARGEST_OVERLAP, 301)
        above = np.flatnonzero(rising(grid) > current)
        if not above.size:
            return complex(current * _NO_LOAD * E * math.cos(angle), 0.0)
        k = int(above[0])
        end = float(brentq(lambda at: float(rising(np.array(at))) - current, grid[k - 1], grid[k]))
        at, weight = end * (_NODES + 1) / 2, end * _WEIGHTS / 2
        moved = c * float(weight @ (current - rising(at)))
        if abs(end - overlap) < _SMALL:
            break
        overlap = end
    third = 2 * math.pi / 3
    phase = np.exp(-1j * (angle + at))
    wave = weight @ (rising(at) * phase)
    wave += weight @ ((current - rising(at)) * phase) * np.exp(-1j * third)
    wave += current * (np.exp(-1j * (angle + end)) - np.exp(-1j * (angle + third))) / 1j
    voltage = math.sqrt(2 / 3) * E * np.exp(-1j * math.pi / 3)
    return complex(1.5 * voltage * np.conj(2 * wave / math.pi))
