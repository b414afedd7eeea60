"""Complex quantities in rotating frames, written as pairs of expressions.

The network frame turns at ω_b; a device's own frame leads it by an angle θ. A quantity is
f = f_re + j·f_im in the network frame and f = f_q − j·f_d in a device's frame."""

from __future__ import annotations

from dataclasses import dataclass

from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, atan2, cos, fmax, fmin, sin, sqrt


@dataclass(frozen=True)
class Phasor:
    """A complex number re + j·im of expressions."""

    re: Scalar
    im: Scalar

    def __add__(self, other: Phasor) -> Phasor:
        return Phasor(self.re + other.re, self.im + other.im)

    def __sub__(self, other: Phasor) -> Phasor:
        return Phasor(self.re - other.re, self.im - other.im)

    def __neg__(self) -> Phasor:
        return Phasor(-self.re, -self.im)

    def __mul__(self, other: Phasor | Scalar) -> Phasor:
        if isinstance(other, Phasor):
            return Phasor(
                self.re * other.re - self.im * other.im, self.re * other.im + self.im * other.re
            )
        return Phasor(self.re * other, self.im * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Phasor | Scalar) -> Phasor:
        if isinstance(other, Phasor):
            return self * other.conjugate() * (1 / (other.re**2 + other.im**2))
        return Phasor(self.re / other, self.im / other)

    def conjugate(self) -> Phasor:
        return Phasor(self.re, -self.im)

    def times_j(self) -> Phasor:
        """The phasor, turned ahead by 90°."""
        return Phasor(-self.im, self.re)

    def magnitude(self) -> Expr:
        return sqrt(self.re**2 + self.im**2)

    def angle(self) -> Expr:
        """Its angle [rad]."""
        return atan2(self.im, self.re)

    def rotated(self, angle: Scalar) -> Phasor:
        """The quantity times e^{j·angle}."""
        return self * polar(1.0, angle)

    def clamped(self, limit_re: Scalar, limit_im: Scalar) -> Phasor:
        return Phasor(
            fmin(fmax(self.re, -limit_re), limit_re), fmin(fmax(self.im, -limit_im), limit_im)
        )


Phases = tuple[Scalar, Scalar, Scalar]  # instantaneous values of phases a, b and c

ZERO = Phasor(0.0, 0.0)


def polar(magnitude: Scalar, angle: Scalar) -> Phasor:
    """Magnitude and angle [rad] as a complex quantity."""
    return Phasor(magnitude * cos(angle), magnitude * sin(angle))


def of_phases(values: Phases, angle: Scalar) -> Phasor:
    """Instantaneous values of three phases as one complex quantity in a frame at ``angle`` [rad].

    (2/3)·(a + b·e^{j2π/3} + c·e^{−j2π/3})·e^{−j·angle}: a balanced cosine keeps its amplitude. The common part of the
    phases, the zero sequence, is removed."""
    a, b, c = values
    return Phasor((2 * a - b - c) / 3, (b - c) / sqrt(3)).rotated(-angle)


def phases(value: Phasor, angle: Scalar) -> Phases:
    """The other way: Re f·e^{j·angle}, and the same 120° and 240° later; without a zero sequence."""
    fixed = value.rotated(angle)
    half, swing = fixed.re / 2, sqrt(3) / 2 * fixed.im
    return fixed.re, swing - half, -swing - half


def power(voltage: Phasor, current: Phasor) -> Phasor:
    """P + jQ = v·conj(i), per unit."""
    return voltage * current.conjugate()


def current_of_power(p: Scalar, q: Scalar, voltage: Phasor) -> Phasor:
    """Current i = conj((P + jQ)/v), per unit."""
    return (Phasor(p, q) / voltage).conjugate()


@dataclass(frozen=True)
class QdState:
    """A complex state of a rotating frame, kept as its q and d components: f = f_q − j·f_d."""

    q: Expr
    d: Expr

    @property
    def value(self) -> Phasor:
        return Phasor(self.q, -self.d)

    def set_derivative(self, m: ModelBuilder, rate: Phasor) -> None:
        m.derivative(self.q, rate.re)
        m.derivative(self.d, -rate.im)


def qd_state(m: ModelBuilder, name: str, initial: Phasor, description: str) -> QdState:
    """Declare ``name_q`` and ``name_d`` [pu, S_n].

    ``name``: Of both states, before ``_q`` and ``_d``.
    ``initial``: An expression of parameters [pu, S_n].
    ``description``: Of both states; each adds which component it is."""
    q = m.state(f"{name}_q", initial.re, "pu", f"{description}, q component", base="S_n")
    d = m.state(f"{name}_d", -initial.im, "pu", f"{description}, d component", base="S_n")
    return QdState(q, d)


def phasor_state(m: ModelBuilder, name: str, initial: Phasor, text: str, base: str) -> Phasor:
    """Declare ``name_re`` and ``name_im`` [pu] of the network frame."""
    return Phasor(
        m.state(f"{name}_re", initial.re, "pu", f"{text}, real part", base),
        m.state(f"{name}_im", initial.im, "pu", f"{text}, imaginary part", base),
    )


def phasor_derivative(
    m: ModelBuilder, state: Phasor, rate: Phasor, implicit: Phasor | None = None
) -> None:
    """Give a rate; ``implicit`` is its part that is linear in the states, where that is not all of it."""
    m.derivative(Expr(state.re), rate.re, None if implicit is None else implicit.re)
    m.derivative(Expr(state.im), rate.im, None if implicit is None else implicit.im)
