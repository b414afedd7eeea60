"""No governor: constant mechanical power, or constant mechanical torque.

    constant_power   P_m = P_ref, so the torque falls with speed, T_m = P_m/w
    constant_torque  T_m = P_ref, so P_m = T_m·w

Between them lies a damping of P_0 per unit of speed: 1/(4H)·P_0 of the swing's decay."""

from fmus.synchronous_generator.turbines.common import power_reference
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


def constant_power(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare it and return the mechanical power [pu, S_n]; parameters as `tgov1.tgov1`."""
    with m.scope("governor"):
        return power_reference(m, P_m_0)


def constant_torque(m: ModelBuilder, w: Expr, P_m_0: Expr) -> Expr:
    """Declare it and return the mechanical power [pu, S_n]; parameters as `tgov1.tgov1`."""
    with m.scope("governor"):
        return power_reference(m, P_m_0) * w
