"""Limits of the current reference: the paper's, and three that keep the converter a voltage source.

Each of the three acts like an impedance Z between the voltage reference and the capacitor, which grows with the demand.
The voltage control turns a voltage into a demand by its gain k_p: a demand i* gives the reference i = i*/(1 + k_p·Z).
What the limit takes from the voltage is Z·i = (i* − i)/k_p. It is exactly 0 while the limit does not act."""

from dataclasses import dataclass, replace

from fmus.converter_parts.filter import SteadyState
from fmus.toolchain.frames import ZERO, Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, cos, fabs, fmax, if_else, logic_and, logic_not, sin, sqrt

PAPER = "Mateu-Barriendos et al. 2024, appendix, current saturation"

# values of ``current_limit.kind``
BOX, CIRCULAR, THRESHOLD_IMPEDANCE, SATURATION_INFORMED = range(4)
# Newton's steps for the current behind a threshold impedance: to rounding for demands up to 100 pu
_NEWTON = 8
# least value under a root; it keeps derivatives finite where the limit does not act
_SMALLEST = 1e-12


@dataclass(frozen=True)
class BoxLimits:
    """Limits of i_q,ref and i_d,ref in the paper's saturation [pu, S_n]."""

    i_q_max: Expr
    i_d_max: Expr


@dataclass(frozen=True)
class CurrentLimit:
    """Parameters of the limit.

    Attributes
    ----------
    kind
        Which limit acts: a number of 0 to 3.
    box
        Limits of the paper's saturation [pu, S_n].
    I_max, threshold
        Largest current, and the current from which a threshold impedance acts [pu, S_n].
    angle
        Angle of the impedance that the circular limit acts like [rad].
    X_R, slope
        X/R of a threshold impedance [1], and its resistance for 1 pu beyond the threshold [pu, S_n].
    """

    kind: Expr
    box: BoxLimits
    I_max: Expr
    threshold: Expr
    angle: Expr
    X_R: Expr
    slope: Expr

    def is_kind(self, *kinds: int) -> Expr:
        """Return whether the limit is one of these kinds."""
        return logic_and(self.kind > min(kinds) - 0.5, self.kind < max(kinds) + 0.5)

    @property
    def largest(self) -> Expr:
        """Largest current that passes [pu, S_n]: the box's corner, or I_max."""
        corner = sqrt(self.box.i_q_max**2 + self.box.i_d_max**2)
        return if_else(self.is_kind(BOX), corner, self.I_max)

    def lowered(self, cut: Expr) -> "CurrentLimit":
        """Return the limit without a part of it, 0 to 1."""
        left = 1 - cut
        box = BoxLimits(self.box.i_q_max * left, self.box.i_d_max * left)
        return replace(self, box=box, I_max=self.I_max * left, threshold=self.threshold * left)


@dataclass(frozen=True)
class LimitedCurrent:
    """A current reference within its limit.

    Attributes
    ----------
    demanded, allowed
        The reference before and behind the limit [pu, S_n].
    missing
        Voltage Z·i that the limit takes away [pu, S_n]; 0 of the paper's saturation, which stops integrators instead.
    informed
        The part of it that the power measurement is told [pu, S_n]: all of it, or 0.
    share
        The demand in parts of the largest that passes unchanged; the limit acts above 1.
    """

    demanded: Phasor
    allowed: Phasor
    missing: Phasor
    informed: Phasor
    share: Expr


def declare_box_limits(
    m: ModelBuilder, start: SteadyState, kind: Expr | float = float(BOX)
) -> BoxLimits:
    """Declare the limits of i_q,ref and i_d,ref; a dispatch beyond them is refused if that kind of limit acts."""
    i_q_max = m.parameter(
        "i_q_max", 1.1, "pu", "Limit of i_q,ref", base="S_n", minimum=0.1, source=PAPER
    )
    i_d_max = m.parameter(
        "i_d_max", 1.1, "pu", "Limit of i_d,ref", base="S_n", minimum=0.1, source=PAPER
    )
    acts = Expr(kind) < BOX + 0.5
    m.require(
        if_else(acts, i_q_max - fabs(start.i_s.re), 1),
        "the power flow asks for more active current than voltage_control.i_q_max: lower P_0 or raise S_n",
    )
    m.require(
        if_else(acts, i_d_max - fabs(start.i_s.im), 1),
        "the power flow asks for more reactive current than voltage_control.i_d_max: lower Q_0 or raise S_n",
    )
    return BoxLimits(i_q_max, i_d_max)


def declare_current_limit(m: ModelBuilder, start: SteadyState) -> CurrentLimit:
    """Declare the limit; a dispatch that it would change is refused."""
    with m.scope("current_limit"):
        kind = m.parameter(
            "kind",
            BOX,
            "1",
            "0: box in q and d; 1: circular; 2: threshold virtual impedance; 3: saturation-informed",
            minimum=0,
            maximum=3,
            type="Integer",
            source=PAPER,
        )
        I_max = m.parameter(
            "I_max",
            1.1,
            "pu",
            "Largest current of kinds 1 to 3",
            base="S_n",
            minimum=0.1,
            source=PAPER,
        )
        threshold = m.parameter(
            "threshold", 1.0, "pu", "Current from which kind 2 acts", base="S_n", minimum=0.05
        )
        angle = m.parameter(
            "angle",
            0.7854,
            "rad",
            "Angle of the impedance that kinds 1 and 3 act like; 0: the demand's angle is kept",
            minimum=0,
            maximum=1.5708,
        )
        X_R = m.parameter("X_R", 5.0, "1", "X/R of the impedance of kind 2", minimum=0, maximum=100)
        slope = m.calculated(
            "slope",
            start.u.re / (I_max * fmax(I_max - threshold, 1e-6) * sqrt(1 + X_R**2)),
            "pu",
            "Resistance of kind 2 for 1 pu beyond the threshold: a short circuit at the capacitor gives I_max",
            "S_n",
        )
    with m.scope("voltage_control"):
        limit = CurrentLimit(
            kind=kind,
            box=declare_box_limits(m, start, kind),
            I_max=I_max,
            threshold=threshold,
            angle=angle,
            X_R=X_R,
            slope=slope,
        )
    m.require(
        if_else(limit.is_kind(THRESHOLD_IMPEDANCE), I_max - threshold, 1),
        "current_limit.threshold must be below current_limit.I_max",
    )
    m.require(
        if_else(limit.is_kind(CIRCULAR, SATURATION_INFORMED), I_max - start.i_s.magnitude(), 1),
        "the power flow asks for more current than current_limit.I_max: lower P_0 or Q_0, or raise S_n",
    )
    m.require(
        if_else(limit.is_kind(THRESHOLD_IMPEDANCE), threshold - start.i_s.magnitude(), 1),
        "the power flow asks for more current than current_limit.threshold: lower P_0 or Q_0, or raise S_n",
    )
    return limit


def limited_current(limit: CurrentLimit, demanded: Phasor, k_p: Expr) -> LimitedCurrent:
    """Apply the limit.

    Parameters
    ----------
    limit
        Its parameters.
    demanded
        Current reference without a limit, converter's frame [pu, S_n].
    k_p
        Proportional gain of the voltage control [pu, S_n].
    """
    size = sqrt(fmax(demanded.re**2 + demanded.im**2, _SMALLEST))
    box, threshold = limit.is_kind(BOX), limit.is_kind(THRESHOLD_IMPEDANCE)
    free = if_else(threshold, limit.threshold, limit.I_max)
    acts = logic_and(size > free, logic_not(box))
    drop = _where(threshold, _threshold_drop(limit, size, k_p), _circular_drop(limit, size))
    passed = demanded / (Phasor(1.0, 0.0) + _where(acts, drop, ZERO))
    missing = (demanded - passed) / k_p
    clamped = demanded.clamped(limit.box.i_q_max, limit.box.i_d_max)
    of_box = fmax(fabs(demanded.re) / limit.box.i_q_max, fabs(demanded.im) / limit.box.i_d_max)
    return LimitedCurrent(
        demanded,
        _where(box, clamped, passed),
        missing,
        _where(limit.is_kind(SATURATION_INFORMED), missing, ZERO),
        if_else(box, of_box, size / free),
    )


def _where(condition: Expr, then: Phasor, otherwise: Phasor) -> Phasor:
    return Phasor(
        if_else(condition, then.re, otherwise.re), if_else(condition, then.im, otherwise.im)
    )


def _circular_drop(limit: CurrentLimit, size: Expr) -> Phasor:
    """k_p·Z of the impedance with the chosen angle φ that leaves exactly I_max: |1 + k_p·Z| = m = |i*|/I_max."""
    cosine, sine = cos(limit.angle), sin(limit.angle)
    m = fmax(size / limit.I_max, 1)
    drop = sqrt(fmax(m**2 - sine**2, _SMALLEST)) - cosine
    return Phasor(drop * cosine, drop * sine)


def _threshold_drop(limit: CurrentLimit, size: Expr, k_p: Expr) -> Phasor:
    """k_p·Z of Z = slope·(|i| − threshold)·(1 + j·X_R), at the current that solves |i|·|1 + k_p·Z| = |i*|.

    The square of the left-hand side is convex in |i|: Newton's method converges from any value above the solution."""
    a, I_th = k_p * limit.slope, limit.threshold
    demand = fmax(size, I_th)
    over = (demand - I_th) / (1 + a * I_th)
    for _ in range(_NEWTON):
        i, r, x = I_th + over, 1 + a * over, a * limit.X_R * over
        square = r**2 + x**2
        slope = 2 * i * square + 2 * i**2 * a * (r + limit.X_R * x)
        over = over - (i**2 * square - demand**2) / slope
    return Phasor(a * over, a * over * limit.X_R)
