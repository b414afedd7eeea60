"""The circuit of an induction machine by its reactances and the time constants of an open stator.

    X = Xl + X_M,  Xp = Xl + X_M ∥ X_1,  Xpp = Xl + X_M ∥ X_1 ∥ X_2
    Tp = (X_M + X_1)/(ω_b·R_1),  Tpp = (X_2 + X_M ∥ X_1)/(ω_b·R_2)

Source: F. Milano, "Power System Modelling and Scripting" (2010), section 15.2, for both cages beside each other."""

from fmus.induction_machine.circuit import Circuit, cages_of
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and

GENERATOR = "usual values of a wind turbine's induction generator"


def declare_by_reactances(m: ModelBuilder, omega_b: Expr) -> Circuit:
    """Declare reactances [pu, S_n] and time constants [s]; return the circuit with these."""

    def reactance(name: str, start: float, text: str, least: float) -> Expr:
        return m.parameter(
            name, start, "pu", text, base="S_n", minimum=least, maximum=100.0, source=GENERATOR
        )

    R_A = reactance("RA", 0.0, "Resistance of the stator", 0.0)
    X = reactance("X", 3.9, "Synchronous reactance", 1e-3)
    X_1p = reactance("Xp", 0.18, "Transient reactance", 1e-3)
    X_2p = reactance("Xpp", 0.0, "Subtransient reactance; 0, or Tpp = 0: there is one cage", 0.0)
    X_l = reactance("Xl", 0.1, "Leakage reactance of the stator", 0.0)
    T_1, T_2 = (
        m.parameter(name, start, "s", text, minimum=least, source=GENERATOR)
        for name, start, text, least in (
            ("Tp", 1.1, "Transient time constant, open circuit", 1e-3),
            ("Tpp", 0.0, "Subtransient time constant, open circuit; 0: there is one cage", 0.0),
        )
    )
    two = logic_and(T_2 > 0, X_2p > 0)
    m.require(X - X_1p, "X must exceed Xp")
    m.require(X_1p - X_l, "Xp must exceed Xl")
    m.require(if_else(two, X_1p - X_2p, 1), "Xp must exceed Xpp, or write Tpp = 0 for one cage")
    m.require(if_else(two, X_2p - X_l, 1), "Xpp must exceed Xl, or write Tpp = 0 for one cage")
    X_M, first = X - X_l, X_1p - X_l
    X_1 = 1 / (1 / first - 1 / X_M)
    X_2 = 1 / (1 / if_else(two, X_2p - X_l, first / 2) - 1 / first)
    R_1 = (X_1 + X_M) / (omega_b * T_1)
    R_2 = (X_2 + first) / (omega_b * if_else(two, T_2, 1))
    second = if_else(two, R_2, 0), if_else(two, X_2, 0)
    return Circuit(Phasor(R_A, X_l), X_M, cages_of(X_M, (R_1, X_1), second, 0))
