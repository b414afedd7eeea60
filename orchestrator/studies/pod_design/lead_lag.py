"""Equations of the POD design by eigenvalue sensitivity (the paper's section on the design of POD controllers).

Pure functions on complex numbers; their arguments come from linearisations of the coupled system. Eigenvalues are in
rad/s with a positive imaginary part, gains in pu of the converter's rating."""

import cmath
import math
from dataclasses import dataclass

from orchestrator.core.errors import AnalysisError
from orchestrator.core.options import Option

LARGEST_STAGE_ANGLE = 60.0
"""Usual limit for the angle of one lead/lag stage [°]; beyond this angle a_j grows out of proportion."""

LARGEST_TURN = 85.0  # absolute limit for the angle of one lead/lag stage, to either side [°]


@dataclass(frozen=True)
class LeadLag:
    """N_S equal stages (1 + s·T_S1)/(1 + s·T_S2)."""

    # T_S1, T_S2: lead and lag time constants [s]; both 0 for no compensation
    T_S1: float
    T_S2: float
    N_S: int

    @property
    def filtering_ratio(self) -> float:
        """Ratio a = T_S2/T_S1; 1 where there is no compensation."""
        return self.T_S2 / self.T_S1 if self.T_S1 else 1.0

    @property
    def stage_angle_deg(self) -> float:
        """Largest angle of one stage, at ω = 1/√(T_S1·T_S2) [°]; negative for lag."""
        return math.degrees(math.asin((1 - self.filtering_ratio) / (1 + self.filtering_ratio)))

    def response(self, s: complex) -> complex:
        return ((1 + s * self.T_S1) / (1 + s * self.T_S2)) ** self.N_S


NO_COMPENSATION = LeadLag(0.0, 0.0, 0)


def predicted_mode(required_damping: float, initial: complex) -> complex:
    """λ_d = −ζ_d·ω_0 + jω_0: the mode that the design aims at, with unchanged frequency."""
    return complex(-required_damping * initial.imag, initial.imag)


def sensitivity(with_gain: complex, without: complex, gain: float) -> complex:
    """Ŝ = (λ(ΔK) − λ_0)/ΔK, the eigenvalue sensitivity by finite difference [rad/s per pu]."""
    moved = with_gain - without
    if abs(moved) <= 1e-9 * max(1.0, abs(without)):
        raise AnalysisError(
            f"a gain of {gain:g} pu moves the mode {without:.4g} rad/s by only "
            f"{abs(moved):.1e} rad/s, so it has no sensitivity to design with; choose "
            "another mode, another controller, or a larger " + Option.DELTA_GAIN
        )
    return moved / gain


def angle_deg(value: complex) -> float:
    degrees = math.degrees(cmath.phase(value))
    return 180.0 if degrees == -180.0 else degrees


def compensation_deg(phase_deg: float) -> float:
    """Return what all stages together must add to turn a sensitivity's angle to 180° [°]: lead if φ ≥ 0, else lag."""
    return 180.0 - phase_deg if phase_deg >= 0 else -180.0 - phase_deg


def lead_lag(phase_deg: float, centre: float, stages: int) -> LeadLag:
    """Lead/lag that turns a non-compensated sensitivity to 180°, centred on the mode's frequency.

    φ = (π ∓ φ_NC)/N_S; a = (1 − sin φ)/(1 + sin φ) for lead, its inverse for lag;
    T_S1 = 1/(ω_0·√a), T_S2 = a·T_S1.

    ``phase_deg``: angle of the non-compensated sensitivity [°], in (−180, 180].
    ``centre``: ω_0 [rad/s].
    ``stages``: N_S; with 0 there is no compensation.
    Raises an `AnalysisError` if a stage would have to turn by 90° or more, which is impossible."""
    if stages == 0:
        return NO_COMPENSATION
    each = compensation_deg(phase_deg) / stages
    if abs(each) >= 90:
        enough = math.ceil(abs(compensation_deg(phase_deg)) / LARGEST_STAGE_ANGLE)
        raise AnalysisError(
            f"the sensitivity's angle is {phase_deg:.1f}°, so each of {stages} lead/lag "
            f"stages would have to turn it by {abs(each):.1f}°; one stage turns by less "
            f"than 90°, sensibly by {LARGEST_STAGE_ANGLE:g}°; ask for {enough} stages "
            "with " + Option.STAGES
        )
    sine = math.sin(math.radians(each))
    a = (1 - sine) / (1 + sine)
    T_S1 = 1 / (centre * math.sqrt(a))
    return LeadLag(T_S1, a * T_S1, stages)


def lead_lag_turning(angle: float, centre: float, stages: int) -> LeadLag:
    """Lead/lag whose stages turn by an angle [°] together, lead where it is positive; otherwise as `lead_lag`."""
    return lead_lag(180 - angle if angle >= 0 else -180 - angle, centre, stages)


def required_gain(target: complex, initial: complex, magnitude: float) -> float:
    """K = |λ_d − λ_0|/|∂λ/∂K| [pu]."""
    return abs(target - initial) / magnitude


def bounded(gain: float, bounds: tuple[float, float]) -> float:
    return min(max(gain, bounds[0]), bounds[1])


def local_non_compensated(compensated: complex, mode: complex, filters: LeadLag) -> complex:
    """The sensitivity without the lead/lag, computed from the sensitivity with it.

    At a mode s = λ the residue is multiplied by the compensation's transfer function at λ; dividing by it is exact for
    a gain of 0, and at a present gain tells by how much the compensation is to be turned."""
    return compensated / filters.response(mode)
