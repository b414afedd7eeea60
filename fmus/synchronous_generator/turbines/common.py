"""Parts that governors and turbines share: parameters, reference and the check of their start; and no governor.

Without one, mechanical power or mechanical torque is constant:

    constant_power   P_m = P_ref, so the torque falls with speed, T_m = P_m/w
    constant_torque  T_m = P_ref, so P_m = T_m·w

Between them lies a damping of P_0 per unit of speed: 1/(4H)·P_0 of the swing's decay."""

from collections.abc import Callable
from functools import partial

from fmus.synchronous_generator.declarations import require_between, time_constant
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, Scalar, if_else

SOURCE = "typical data, IEEE PES-TR1"


def power(m: ModelBuilder, name: str, value: float, text: str, minimum: float | None = None) -> Expr:
    """Declare a gain or limit per unit of the rating."""
    return m.parameter(name, value, "pu", text, base="S_n", minimum=minimum, source=SOURCE)


time = partial(time_constant, source=SOURCE)


def power_reference(m: ModelBuilder, P_ref_0: Scalar) -> Expr:
    """Declare the power reference of the operating point and its change; return their sum [pu, S_n]."""
    P_ref = m.calculated("P_ref", P_ref_0, "pu", "Power reference of the operating point", base="S_n")
    return P_ref + m.parameter("delta_P_ref", 0.0, "pu", "Change of the power reference", base="S_n", tunable=True)


def read_either_way(governor: Callable[[ModelBuilder, Expr, Expr], Expr]) -> Callable[..., Expr]:
    """The same governor whose output is the mechanical power, or, by a parameter, the mechanical torque."""

    def declare(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
        output = governor(m, w, P_m_0)
        with m.scope("governor"):
            is_torque = m.switch("output_is_torque", False, "The output is the mechanical torque, not the power")
        return output * if_else(is_torque, w, 1)

    return declare


require_within = partial(
    require_between,
    rule="so the turbine cannot give its power; change the limit, the rating S_n, or the generator's active power",
)


def constant_power(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare it and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        return power_reference(m, P_m_0)


def constant_torque(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare it and return the mechanical power [pu, S_n]."""
    with m.scope("governor"):
        return power_reference(m, P_m_0) * w
