"""Transfer-function blocks as implicit equations, each with one unknown; a time constant may be 0."""

from tests.reference.descriptor import Unknowns


def lag(s: Unknowns, name: str, u: complex, T: float, gain: float = 1.0) -> complex:
    """y = gain/(1 + sT)·u; with T = 0 the equation is algebraic, and y = gain·u."""
    s.equate(T * s.dot(name) + s[name], gain * u)
    return s[name]


def lead_lag(s: Unknowns, name: str, u: complex, T_lead: float, T_lag: float) -> complex:
    """y = (1 + s·T_lead)·x with x = u/(1 + s·T_lag)."""
    slow = lag(s, name, u, T_lag)
    return slow + T_lead * s.dot(name)


def washout(s: Unknowns, name: str, u: complex, T: float) -> complex:
    """y = sT/(1 + sT)·u, what a lag leaves of u; T = 0 leaves the block out."""
    slow = lag(s, name, u, T)
    return u - slow if T else u
