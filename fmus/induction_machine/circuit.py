"""The circuit of an induction machine: stator, magnetising branch, and one or two cages.

    stator R_A + jX_A, then jX_M to earth beside the rotor, at a slip s
    one cage:              R_1/s + jX_1
    two cages, IT = 1:     (R_1/s + jX_1) beside (R_2/s + jX_2)
    two cages, IT = 2:     jX_1, then R_1/s beside (R_2/s + jX_2)

With the cages' flux linkages ψ and currents i, and the stator's current i_s into the machine,

    ψ = X_M·i_s − L·i,      dψ/dt = ω_b·(R·i − j·s·ψ)
    v = (R_A + jX'')·i_s + e'',      e'' = j·X_M·Σ(L⁻¹·ψ),      X'' = X_A + X_M − X_M²·Σ(L⁻¹)

Source: P. C. Krause, "Analysis of Electric Machinery" (1986), chapter 4, stator transients left out as in P. Kundur,
"Power System Stability and Control" (1994), section 7.2. The two arrangements are those of PSS/E's CIM5, as
PowerWorld's guide tells of them."""

from dataclasses import dataclass

from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, if_else, logic_and

SOURCE = "P. Kundur, Power System Stability and Control (1994), example 7.1"
"""Where the defaults are from: a motor of one cage, its rating taken as 1 pu."""


@dataclass(frozen=True)
class Cages:
    """Inverse inductances of the rotor and its resistances [pu]; without a second cage its entries are 0.

    ``own``: L⁻¹ of cage 1, between both, and of cage 2; ``polynomial``: of the rotor's admittance at s, as
    `Circuit.impedance` takes it."""

    own: tuple[Expr, Expr, Expr]
    resistances: tuple[Expr, Expr]
    polynomial: tuple[tuple[Expr, Expr], tuple[Expr, Expr, Expr]]
    has_second: Expr

    @property
    def sums(self) -> tuple[Expr, Expr]:
        """Sums of the rows of L⁻¹."""
        first, between, second = self.own
        return first + between, between + second


@dataclass(frozen=True)
class Circuit:
    """Impedances of the machine [pu, S_n]."""

    stator: Phasor
    magnetising: Expr
    cages: Cages

    @property
    def subtransient(self) -> Phasor:
        """The impedance between the bus and e''."""
        both = sum(self.cages.sums[1:], self.cages.sums[0])
        X = self.stator.im + self.magnetising - self.magnetising**2 * both
        return Phasor(self.stator.re, X)

    def emf(self, psi: tuple[Phasor, Phasor]) -> Phasor:
        """Return e'' of the cages' flux linkages [pu]."""
        linked = psi[0] * self.cages.sums[0] + psi[1] * self.cages.sums[1]
        return (linked * self.magnetising).times_j()

    def cage_currents(self, psi: tuple[Phasor, Phasor], stator: Phasor) -> tuple[Phasor, Phasor]:
        """Return the cages' currents [pu] at a stator's current into the machine."""
        first, between, second = self.cages.own
        linked = psi[0] * first + psi[1] * between, psi[0] * between + psi[1] * second
        main = stator * self.magnetising
        return (
            main * self.cages.sums[0] - linked[0],
            main * self.cages.sums[1] - linked[1],
        )

    def impedance(self, slip: Expr) -> tuple[Phasor, Phasor]:
        """Return the impedance at a slip, and its derivative by the slip [pu].

        Between the ends of X_M the rotor leaves X_M·(1 − w·X_M·N(w)/D(w)), w = j·s, with polynomials N and D."""
        (n_0, n_1), (d_0, d_1, d_2) = self.cages.polynomial
        w = Phasor(0.0, slip)
        top = w * (Phasor(n_0, 0.0) + w * n_1)
        below = Phasor(d_0, 0.0) + w * (Phasor(d_1, 0.0) + w * d_2)
        top_rate = (Phasor(n_0, 0.0) + w * (2 * n_1)).times_j()
        below_rate = (Phasor(d_1, 0.0) + w * (2 * d_2)).times_j()
        square = self.magnetising**2
        of_rotor = (top / below * square).times_j()
        rate = ((top_rate * below - top * below_rate) / (below * below) * square).times_j()
        return self.stator + Phasor(0.0, self.magnetising) - of_rotor, -rate


def declare_circuit(m: ModelBuilder) -> Circuit:
    """Declare resistances and reactances [pu, S_n], and how the cages are arranged."""

    def part(name: str, start: float, text: str, least: float) -> Expr:
        return m.parameter(
            name, start, "pu", text, base="S_n", minimum=least, maximum=100.0, source=SOURCE
        )

    text = (
        "Arrangement of two cages: 1 beside each other, 2 the second behind the first's reactance"
    )
    kind = m.parameter("IT", 1, "1", text, minimum=1, maximum=2, type="Integer")
    R_A = part("RA", 0.0425, "Resistance of the stator", 0.0)
    X_A = part("XA", 0.0678, "Leakage reactance of the stator", 0.0)
    X_M = part("XM", 2.7, "Magnetising reactance", 1e-3)
    R_1 = part("R1", 0.0249, "Resistance of the first cage", 1e-6)
    X_1 = part("X1", 0.0678, "Reactance of the first cage", 0.0)
    R_2 = part("R2", 0.0, "Resistance of the second cage; 0, or X2 = 0: there is none", 0.0)
    X_2 = part("X2", 0.0, "Reactance of the second cage", 0.0)
    circuit = Circuit(Phasor(R_A, X_A), X_M, cages_of(X_M, (R_1, X_1), (R_2, X_2), kind > 1))
    m.require(circuit.subtransient.im, "XA, X1 and X2 leave no subtransient reactance: raise one")
    return circuit


def cages_of(
    X_M: Expr, first: tuple[Expr, Expr], second: tuple[Expr, Expr], nested: Scalar
) -> Cages:
    """Return the cages of their resistances and reactances; the second is there where both of its exceed 0.

    ``nested``: whether the second stands behind the first's reactance."""
    (R_1, X_1), (R_2, X_2) = first, second
    has_second = logic_and(R_2 > 0, X_2 > 0)
    common = X_M + if_else(nested, X_1, 0)
    L_1, L_2 = X_M + X_1, common + X_2
    determinant = L_1 * L_2 - common**2
    safe = if_else(has_second, determinant, 1)
    return Cages(
        (
            if_else(has_second, L_2 / safe, 1 / L_1),
            if_else(has_second, -common / safe, 0),
            if_else(has_second, L_1 / safe, 0),
        ),
        (R_1, R_2),
        (
            (if_else(has_second, R_1 + R_2, 1), if_else(has_second, L_1 + L_2 - 2 * common, 0)),
            (
                if_else(has_second, R_1 * R_2, R_1),
                if_else(has_second, R_1 * L_2 + R_2 * L_1, L_1),
                if_else(has_second, determinant, 0),
            ),
        ),
        has_second,
    )
