"""Standard machine data (X, X', X'', T'_0, T''_0) to the branches of the equivalent circuit, two ways.

Each axis is a magnetising reactance with two rotor branches beside it: branch 1 slow (field, or first
q damper), branch 2 fast (damper). Reactances and resistances are per unit on the stator base.

X' = X means that the slow branch is missing, X'' = X' that the fast one is missing. A missing branch has 1/`_NOTHING`
times the reactance X_m: its state exists but has no effect. Data in another order, X'' > X' or X_l > X'', give the
textbook formulas a branch with a negative reactance, which is defined too, as stability programs have it."""

from dataclasses import dataclass

from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else, sqrt

_NOTHING = 1e-9  # admittance of a missing branch, as a part of 1/X_m
LEAST_LEAKAGE = 1e-6
"""Part of X' or X'' by which X_l differs from it at least; a branch without leakage is the limit of one with a small
leakage, and this near to it no figure differs by more."""


@dataclass(frozen=True)
class AxisData:
    """Standard data of one axis; X [pu], T [s], rotor at standstill seen from an open stator."""

    X: Expr
    X1: Expr
    X2: Expr
    X_l: Expr
    T10: Expr
    T20: Expr


@dataclass(frozen=True)
class RotorBranches:
    """Leakage reactance and resistance [pu] of the slow (1) and the fast (2) branch."""

    X_1: Expr
    R_1: Expr
    X_2: Expr
    R_2: Expr


def classical(a: AxisData, omega_b: Expr) -> RotorBranches:
    """Textbook formulas, which assume that the branches act one after the other.

    They hold for X_m > X' − X_l. Of two branches, X' − X_l must not be 0."""
    X_m = a.X - a.X_l
    beside_1 = _apart(a.X1 - a.X_l, LEAST_LEAKAGE * a.X1)
    beside_2 = _apart(a.X2 - a.X_l, LEAST_LEAKAGE * a.X2)
    X_1 = X_m * beside_1 / fmax(X_m - a.X1 + a.X_l, _NOTHING * fabs(beside_1))
    R_1 = (X_m + X_1) / (omega_b * a.T10)
    left = X_m * X_1 - (X_m + X_1) * beside_2
    X_2 = beside_2 * X_m * X_1 / _apart(left, fabs(_NOTHING * beside_2 * X_1))
    R_2 = (X_2 + X_m * X_1 / (X_m + X_1)) / (omega_b * a.T20)
    return RotorBranches(X_1, R_1, X_2, R_2)


def _apart(x: Expr, least: Expr) -> Expr:
    """x, not nearer to 0 than ``least``."""
    return if_else(x < -least, x, fmax(x, least))


def exact(a: AxisData, omega_b: Expr) -> RotorBranches:
    """Branches whose operational reactance is exactly X(1+sT')(1+sT'')/((1+sT'_0)(1+sT''_0)).

    With T' = T'_0·X'/X and T'' = T''_0·X''/X'. Taking X_l off and inverting leaves the admittance of
    X_m and of both branches; its partial fractions are the branches: s/(ω_b·R + s·X) each."""
    X_m = a.X - a.X_l
    # The time constant of a missing fast branch has no meaning, and must not be taken for that of the slow branch.
    T20 = if_else(
        a.X1 - a.X2 <= _NOTHING * a.X, fmin(a.T20, 0.1 * a.T10 * (a.X1 - a.X_l) / X_m), a.T20
    )
    T1, T2 = a.T10 * a.X1 / a.X, T20 * a.X2 / a.X1
    # X(s) − X_l = (X_m + n1·s + n2·s²) / ((1 + s·T'_0)(1 + s·T''_0))
    n1 = a.X * (T1 + T2) - a.X_l * (a.T10 + T20)
    n2 = a.X * T1 * T2 - a.X_l * a.T10 * T20
    root = sqrt(fmax(n1**2 - 4 * n2 * X_m, 1e-12))
    slow, fast = (-n1 + root) / (2 * n2), (-n1 - root) / (2 * n2)
    b1 = a.X * (a.T10 + T20 - T1 - T2)
    b2 = a.X * (a.T10 * T20 - T1 * T2)

    def branch(pole: Expr, other: Expr, sign: int) -> tuple[Expr, Expr]:
        residue, least = b1 + b2 * pole, _NOTHING * a.X * a.T10
        residue = if_else(fabs(residue) <= least, sign * least, residue)
        X = X_m * n2 * (pole - other) / residue
        return X, -pole * X / omega_b

    return RotorBranches(*branch(slow, fast, 1), *branch(fast, slow, -1))


def convert(a: AxisData, omega_b: Expr, use_exact: Expr) -> RotorBranches:
    """The branches by one of the two ways, chosen when the FMU is initialised."""
    e, c = exact(a, omega_b), classical(a, omega_b)
    pairs = zip((e.X_1, e.R_1, e.X_2, e.R_2), (c.X_1, c.R_1, c.X_2, c.R_2), strict=True)
    return RotorBranches(*(if_else(use_exact, one, other) for one, other in pairs))
