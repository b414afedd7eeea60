"""What governors and turbines have in common: their parameters, the reference and the check of their start."""

import casadi as ca

from fmus.toolchain.model_builder import ModelBuilder, Scalar

SOURCE = "typical data, IEEE PES-TR1"


def power(m: ModelBuilder, name: str, value: float, text: str, minimum: float | None = None) -> ca.SX:
    """Declare a gain or limit per unit of the rating."""
    return m.parameter(name, value, "pu", text, base="S_n", minimum=minimum, source=SOURCE)


def time(m: ModelBuilder, name: str, value: float, text: str, minimum: float = 0.0) -> ca.SX:
    """Declare a time constant [s]; where it may be 0, 0 leaves its block out."""
    T = m.parameter(name, value, "s", text, minimum=minimum, source=SOURCE)
    if minimum == 0:
        m.require(
            ca.if_else(T <= 0, 1, T - m.internal_step / 2),
            f"governor.{name} must be 0 or longer than half of internal_step",
        )
    return T


def power_reference(m: ModelBuilder, P_ref_0: Scalar) -> ca.SX:
    """Declare the power reference of the operating point and its change; return their sum [pu, S_n]."""
    P_ref = m.calculated("P_ref", P_ref_0, "pu", "Power reference of the operating point", base="S_n")
    return P_ref + m.parameter("delta_P_ref", 0.0, "pu", "Change of the power reference", base="S_n", tunable=True)


def require_within(m: ModelBuilder, value: Scalar, low: Scalar, high: Scalar, names: tuple[str, str]) -> None:
    """Refuse an operating point at or beyond a limit.

    ``value``: of the limited signal in steady state.
    """
    for margin, name, side in ((value - low, names[0], "below"), (high - value, names[1], "above")):
        m.require(
            margin,
            f"{name}: the operating point of the power flow lies at or {side} this limit, so the turbine cannot give "
            "its power; change the limit, the rating S_n, or the generator's active power",
        )
