"""Lines in networks of phasors that are more than a series impedance: ends that switch one by one, a fault on the way.

Behind the ratio t at the from side the line is a π section with its charging jb at both ends. A fault of admittance y_f
at the part d of the way makes two of it, each with its own charging, half of it at the fault. Once that inner point is
eliminated,

    A = y_a − y_a²/S + d·jb    B = −y_a·y_b/S    D = y_b − y_b²/S + (1 − d)·jb

with y_a = y/d, y_b = y/(1 − d) and S = y_a + y_b + y_f + jb,
and without one y + jb, −y, y + jb. An end that is open carries no current: it is eliminated as well, and the line stays
charged from the other end.

    i_from = c_f·((A − (1 − c_t)·B²/D)·v_f + c_t·B·v_t)    i_to = c_t·(c_f·B·v_f + (D − (1 − c_f)·B²/A)·v_t)

One phase that opens at an end is an impedance z in series there, which the positive sequence meets: of the from end

    A ← A/(1 + z·A)    B ← B/(1 + z·A)    D ← D − z·B²/(1 + z·A)

and of the to end with A and D exchanged. There is no fault along the line meanwhile."""

from dataclasses import dataclass

from fmus.grid.elements import LineValues
from fmus.grid.fault import switched_fault_admittance
from fmus.grid.network import OPEN_CHARGING, Line
from fmus.toolchain.frames import ZERO, Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Scalar

NEAREST = 1e-3
"""Least part of the way between a fault and an end of its line; nearer ones are faults at the bus."""

_LEAST = Phasor(1e-12, 0.0)
"""Conductance [pu, 100 MVA] beside an admittance that is divided by: of an open line without charging it is 0."""


@dataclass(frozen=True)
class LineParts:
    """Admittances of a line behind its ratio, each end's switch, and what a fault along it needs.

    ``charging``: that of its from end, which is in A."""

    A: Phasor
    B: Phasor
    D: Phasor
    charging: Phasor
    ends: tuple[Scalar, Scalar]
    way: tuple[Phasor, Phasor] = (ZERO, ZERO)  # y_a and y_b by S
    fault: Phasor | None = None

    def own(self) -> tuple[Phasor, Phasor]:
        """Return the admittances that the from and the to side see of the line alone."""
        c_f, c_t = self.ends
        square = self.B * self.B
        return (
            (self.A - square / (self.D + _LEAST) * (1 - c_t)) * c_f,
            (self.D - square / (self.A + _LEAST) * (1 - c_f)) * c_t,
        )

    def between(self) -> Phasor:
        """Return the admittance between both sides."""
        return self.B * (self.ends[0] * self.ends[1])

    def drawn(self, v_from: Phasor, v_to: Phasor) -> Phasor:
        """Return the current behind the ratio at the from side, without that of the charging at this end."""
        own = self.own()[0] - self.charging * self.ends[0]
        return own * v_from + self.between() * v_to

    def fault_current(self, v_from: Phasor, v_to: Phasor) -> Phasor:
        """Return the current into the fault, from the voltages behind the ratio and at the to bus."""
        assert self.fault is not None
        c_f, c_t = self.ends
        at_from = v_from * c_f - v_to * self.B / (self.A + _LEAST) * ((1 - c_f) * c_t)
        at_to = v_to * c_t - v_from * self.B / (self.D + _LEAST) * ((1 - c_t) * c_f)
        return (self.way[0] * at_from + self.way[1] * at_to) * self.fault


def declare_line_parts(m: ModelBuilder, line: Line, values: LineValues, y: Phasor) -> LineParts:
    """Declare the switches of the ends, the poles and the fault of a line; ``y``: its series admittance, 0 where it is
    open."""
    jb = Phasor(0.0, 0.0)
    if values.B is not None:
        jb = Phasor(0.0, values.B / 2 * (1 - OPEN_CHARGING) * values.connected)
    ends: tuple[Scalar, Scalar] = (1.0, 1.0)
    if line.has_ends:
        ends = _end(m, line, "from", line.from_bus), _end(m, line, "to", line.to_bus)
    poles = (ZERO, ZERO)
    if line.has_poles:
        poles = _pole(m, line, "from", line.from_bus), _pole(m, line, "to", line.to_bus)
    if not line.faulted:
        return LineParts(*_behind_poles(y + jb, -y, y + jb, poles), jb, ends)
    at = m.parameter(
        line.variable("fault.at"),
        0.5,
        "1",
        f"Part of the way from {line.from_bus} at which a fault is",
        minimum=NEAREST,
        maximum=1 - NEAREST,
        tunable=True,
    )
    y_f, on = switched_fault_admittance(m, line.name)
    # of S·d·(1 − d) = y + d·(1 − d)·(y_f + jb)
    share = y / (y + (y_f + jb * on) * (at * (1 - at)) + _LEAST)
    A = y / at - y * share * ((1 - at) / at)
    D = y / (1 - at) - y * share * (at / (1 - at))
    way = share * (1 - at), share * at
    jb_from, jb_to = jb * (1 - on * (1 - at)), jb * (1 - on * at)
    behind = _behind_poles(A + jb_from, -(y * share), D + jb_to, poles)
    return LineParts(*behind, jb_from, ends, way=way, fault=y_f)


def _behind_poles(
    A: Phasor, B: Phasor, D: Phasor, poles: tuple[Phasor, Phasor]
) -> tuple[Phasor, Phasor, Phasor]:
    """Return the admittances with an impedance in series at each end."""
    one = Phasor(1.0, 0.0)
    at_from, at_to = poles
    if at_from is not ZERO:
        part = one / (one + A * at_from)
        A, B, D = A * part, B * part, D - B * B * at_from * part
    if at_to is not ZERO:
        part = one / (one + D * at_to)
        A, B, D = A - B * B * at_to * part, B * part, D * part
    return A, B, D


def _end(m: ModelBuilder, line: Line, side: str, bus: str) -> Scalar:
    text = f"Line {line.name} is closed at {bus}"
    return m.switch(line.variable(f"{side}_connected"), True, text, tunable=True)


def _pole(m: ModelBuilder, line: Line, side: str, bus: str) -> Phasor:
    """Declare what the positive sequence meets in series at an end; 0 while all three phases are closed."""
    text = f"that the positive sequence meets at {bus} while one phase of line {line.name} is open there"
    R, X = (
        m.parameter(
            line.variable(f"{side}_pole.{part}"),
            0.0,
            "pu",
            f"{name} {text}",
            base=SYSTEM_BASE,
            tunable=True,
        )
        for part, name in (("R", "Resistance"), ("X", "Reactance"))
    )
    return Phasor(R, X)
