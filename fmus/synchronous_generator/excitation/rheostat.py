"""IEEET4 and IEEET5: commutator exciters whose regulator moves a rheostat, and goes to a ceiling at large errors.

With e = V_ref + V_S − v_t, and the rheostat's voltage V_RH held within V_RMIN and V_RMAX:

    T_RH·dV_RH/dt = e;  IEEET4 with a dead band K_R: 1 where e > K_R, −1 where e < −K_R, else 0
    V_R = V_RMAX where e ≥ K_V, V_RMIN where e ≤ −K_V, else V_RH
    T_E·dE_fd/dt = V_R − K_E·E_fd − S_E(E_fd)·E_fd

Sources: OPAL-RT's ephasorsim-modelica-library at cba975b8 (IEEET5), PowerWorld's help (the dead band of IEEET4),
InterPSS' `Ieeet4Exciter` (the same contacts; it takes K_R as a gain of the rheostat's speed)."""

from functools import partial

from fmus.synchronous_generator.excitation.common import (
    Measurement,
    Regulated,
    constant_of_field,
    exciter_saturation,
    gain,
    require_within,
    time,
)
from fmus.toolchain.blocks import clamp, held_at_limits
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else


def ieeet5(m: ModelBuilder, seen: Regulated, *, by_contacts: bool = False) -> tuple[Expr, Expr]:
    """Declare the exciter and return (E_fd, |v_t|) [pu].

    ``by_contacts``: whether it is IEEET4, whose rheostat has one speed, beyond a dead band."""
    with m.scope("exciter"):
        T_RH = time(m, "T_RH", 20.0, "Rheostat", 1e-3)
        K_V = gain(m, "K_V", 0.05, "Error from which on V_R is at a ceiling", 1e-3)
        high = gain(m, "V_RMAX", 5.0, "Upper limit of V_R")
        low = gain(m, "V_RMIN", -2.0, "Lower limit of V_R")
        given_K_E = gain(m, "K_E", 1.0, "Field resistance, separately excited")
        T_E = time(m, "T_E", 0.5, "Exciter's field", 1e-3)
        curve, E_0 = exciter_saturation(m, 3.0, 0.41, 4.0, 1.96), seen.start.E_fd
        K_E = constant_of_field(m, given_K_E, high, curve, E_0)
        V_R0 = K_E * E_0 + curve.part(E_0)
        require_within(m, V_R0, low, high, ("exciter.V_RMIN", "exciter.V_RMAX"))
        rheostat = m.state("rheostat", V_R0, "pu", "Voltage of the rheostat", base="E_fd")
        E_fd = m.state("E", E_0, "pu", "Field voltage", base="E_fd")
        measured = Measurement(m, seen)
        error = measured.error(0.0)
        speed = error
        if by_contacts:
            text = "Error from which on the rheostat moves, at one speed; 0: at that of the error"
            K_R = gain(m, "K_R", 0.01, text, 0)
            one = if_else(error > K_R, 1, if_else(error < -K_R, -1, 0))
            speed = if_else(K_R > 0, one, error)
        m.derivative(rheostat, held_at_limits(rheostat, speed / T_RH, low, high))
        held = clamp(rheostat, low, high)
        V_R = if_else(error >= K_V, high, if_else(error <= -K_V, low, held))
        m.derivative(E_fd, (V_R - K_E * E_fd - curve.part(E_fd)) / T_E)
        return measured.close(E_fd)


ieeet4 = partial(ieeet5, by_contacts=True)
