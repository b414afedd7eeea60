"""Induction machines in faults: in the negative sequence their circuit at the slip 2 − s, as the rotor turns against
that sequence's field, with the susceptance beside them; in a short circuit of three phases at standstill.

Source: P. C. Krause, "Analysis of Electric Machinery" (1986), chapter 4."""

import math
from dataclasses import dataclass

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.systems.coupling.system import ComponentPlan

_BY_CAGES = ("RA", "XA", "XM", "R1", "X1", "R2", "X2", "IT")
_BY_REACTANCES = ("RA", "X", "Xp", "Xpp", "Xl", "Tp", "Tpp", "f_n")
_NESTED = 2  # IT of a second cage behind the first's reactance
_AGAINST = 2.0  # slip of a rotor at synchronous speed against the field of the negative sequence
_STANDSTILL = 1.0  # slip
_ITERATIONS = 30  # of the slip; near the pull-out point each halves the distance
_STEP = 1e-6  # of the slip, for the slope of the power


@dataclass(frozen=True)
class _Circuit:
    """Stator, magnetising reactance, and resistance and reactance of one cage or two [pu, S_n]."""

    stator: complex
    magnetising: float
    cages: tuple[tuple[float, float], ...]
    is_nested: bool = False

    def admittance(self, slip: float) -> complex:
        """Return the current by the voltage at a slip other than 0 [pu, S_n]."""
        (R_1, X_1), *second = self.cages
        first = complex(R_1 / slip, 0.0 if self.is_nested else X_1)
        rotor = 1 / first + sum(1 / complex(R / slip, X) for R, X in second)
        behind = 1 / rotor + (1j * X_1 if self.is_nested else 0j)
        return 1 / (self.stator + 1 / (1 / behind + 1 / (1j * self.magnetising)))

    def slip_at(self, drawn: float, square: float) -> float:
        """Return the slip at which it draws a power [pu, S_n] at a voltage's square [pu²]."""
        slip = 0.0
        for _ in range(_ITERATIONS):
            at, beyond = (
                square * self.admittance(s).real for s in (slip or _STEP, slip + 2 * _STEP)
            )
            slope = (beyond - at) / (slip + 2 * _STEP - (slip or _STEP))
            slip -= (at - drawn) / slope if slope > 0 else 0.0
        return slip


def negative_admittance(plan: ComponentPlan, drawn: complex, voltage: float) -> complex | None:
    """Return an induction machine's admittance to the negative sequence [pu, 100 MVA]; None for anything else.

    ``drawn``: power that it draws with the susceptance beside it [pu, S_n]; ``voltage``: at its bus [pu]."""
    circuit = _circuit_of(plan)
    if circuit is None:
        return None
    square = voltage**2
    slip = circuit.slip_at(drawn.real, square)
    reactive = -circuit.admittance(slip).imag * square if slip else 0.0
    own = circuit.admittance(_AGAINST - slip)
    beside = 1j * (reactive - drawn.imag) / square
    return plan.number("S_n") / SYSTEM_BASE_MVA * (own + beside)


def locked_impedance(plan: ComponentPlan) -> complex | None:
    """Return the impedance of an induction machine at standstill [pu, 100 MVA]; None for anything else."""
    circuit = _circuit_of(plan)
    if circuit is None:
        return None
    return SYSTEM_BASE_MVA / plan.number("S_n") / circuit.admittance(_STANDSTILL)


def _circuit_of(plan: ComponentPlan) -> _Circuit | None:
    known = plan.description.variables
    if all(name in known for name in _BY_CAGES):
        cages = _cages(plan.number("R1"), plan.number("X1"), plan.number("R2"), plan.number("X2"))
        stator, nested = complex(plan.number("RA"), plan.number("XA")), plan.number("IT") == _NESTED
        return _Circuit(stator, plan.number("XM"), cages, nested and len(cages) > 1)
    if all(name in known for name in _BY_REACTANCES):
        return _by_reactances(plan)
    return None


def _by_reactances(plan: ComponentPlan) -> _Circuit:
    """Return the circuit of an induction generator's record: F. Milano (2010), section 15.2."""
    omega_b, X_l = 2 * math.pi * plan.number("f_n"), plan.number("Xl")
    X_M, first = plan.number("X") - X_l, plan.number("Xp") - X_l
    X_1 = 1 / (1 / first - 1 / X_M)
    R_1 = (X_1 + X_M) / (omega_b * plan.number("Tp"))
    R_2 = X_2 = 0.0
    if plan.number("Xpp") > 0 and plan.number("Tpp") > 0:
        X_2 = 1 / (1 / (plan.number("Xpp") - X_l) - 1 / first)
        R_2 = (X_2 + first) / (omega_b * plan.number("Tpp"))
    return _Circuit(complex(plan.number("RA"), X_l), X_M, _cages(R_1, X_1, R_2, X_2))


def _cages(R_1: float, X_1: float, R_2: float, X_2: float) -> tuple[tuple[float, float], ...]:
    """Return the cages; the second is there where both of its exceed 0."""
    return ((R_1, X_1), (R_2, X_2)) if R_2 > 0 and X_2 > 0 else ((R_1, X_1),)
