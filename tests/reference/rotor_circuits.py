"""Standard data of one axis of a machine, the branches of its circuit, and back: NumPy alone.

Each axis is X_l in series with X_m, and beside X_m two branches R + jX. Seen from the stator

    1/X(s) = 1/X + (1/X' − 1/X)·sT'/(1 + sT') + (1/X'' − 1/X')·sT''/(1 + sT'')        T' = T'_0·X'/X, T'' = T''_0·X''/X'

is the definition of short-circuit tests (IEEE 115); PowerFactory's machine takes its data so, as its speeds show. The
GENROU of stability programs takes the branches one after the other instead ("classical").
"""

from typing import NamedTuple

import numpy as np


class Axis(NamedTuple):
    """Standard data of an axis; X [pu], T [s] with an open stator."""

    X: float
    X1: float
    X2: float
    X_l: float
    T10: float
    T20: float


class Circuit(NamedTuple):
    """Magnetising reactance, and (X, R) of the slow and of the fast branch [pu]."""

    X_m: float
    slow: tuple[float, float]
    fast: tuple[float, float]


def one_after_the_other(a: Axis, omega_b: float) -> Circuit:
    """Classical."""
    X_m, seen = a.X - a.X_l, a.X1 - a.X_l
    X_s = X_m * seen / (X_m - seen)
    X_f = seen * (a.X2 - a.X_l) / (seen - a.X2 + a.X_l)
    return Circuit(
        X_m, (X_s, (X_m + X_s) / (omega_b * a.T10)), (X_f, (X_f + seen) / (omega_b * a.T20))
    )


def of_short_circuit_data(a: Axis, omega_b: float) -> Circuit:
    """The branches of the operational reactance above, by partial fractions of 1/(X(s) − X_l) − 1/X_m."""
    T1, T2 = a.T10 * a.X1 / a.X, a.T20 * a.X2 / a.X1
    top = np.poly1d([T1 * T2, T1 + T2, 1.0]) * float(a.X)
    first = a.X / a.X1 * T1 + (1 - a.X / a.X1 + a.X / a.X2) * T2
    bottom = np.poly1d([T1 * T2 * a.X / a.X2, first, 1.0])
    X_m = a.X - a.X_l
    gap = top - bottom * float(a.X_l)
    rest = bottom - gap / float(X_m)
    branches = []
    for pole in np.sort(gap.roots)[::-1]:  # the slow one first
        admittance = rest(pole) / (gap.deriv()(pole) * pole)  # of (1/X)·s/(s − p)
        branches.append((1 / admittance, -pole / (omega_b * admittance)))
    return Circuit(X_m, *branches)


def classical_data(c: Circuit, X_l: float, omega_b: float) -> tuple[float, float, float]:
    """X' [pu], T'_0 and T''_0 [s] that give this circuit classically; X'' stays what it is."""
    (X_s, R_s), (X_f, R_f) = c.slow, c.fast
    seen = c.X_m * X_s / (c.X_m + X_s)
    return X_l + seen, (c.X_m + X_s) / (omega_b * R_s), (X_f + seen) / (omega_b * R_f)
