"""The classical machine, of second order: a constant emf behind X'_d, turning with the rotor.

          X'_d
    E' ──⏦⏦⏦⏦──●── v        2H·ẇ = P_m/w − T_e − D·(w − 1),  δ̇ = ω_b·(w − 1)

The emf's angle is the rotor's. There is no field winding, so no exciter can act. With H = 0 the speed stays at 1: an
infinite bus behind R_s + jX'_d, as PSS/E's GENCLS is then."""

from fmus.synchronous_generator.axis import Axis
from fmus.synchronous_generator.machine import FluxDeclaration, Machine, Start
from fmus.synchronous_generator.machines.base import (
    LEAST_INERTIA,
    declare_common,
    reactance,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, if_else

LEAST_REACTANCE = 1e-6
"""Smallest X'_d [pu]: infinite buses in public files have 1e-5."""


def classical(
    m: ModelBuilder, port: DevicePort, S_n: Expr, stator_flux: FluxDeclaration
) -> Machine:
    """Declare the machine."""
    common = declare_common(m, S_n, least_H=0)
    is_infinite = common.H <= 0
    inertia = if_else(is_infinite, LEAST_INERTIA, common.H)
    with m.scope("machine"):
        X_1 = common.scale * reactance(
            m, "X_d1", 0.3, "Transient reactance X'_d", least=LEAST_REACTANCE
        )
        R, X = common.R_s + common.R_t, X_1 + common.X_t
        E = port.v_0 + Phasor(R, X) * port.i_0
        emf = m.calculated("E", E.magnitude(), "pu", "Emf behind X'_d", "S_n")
        delta_0 = E.angle()
        i, v = port.i_0.rotated(-delta_0), port.v_0.rotated(-delta_0)
        psi_d, psi_q = emf + X * i.im, -X * i.re
        d_flux = stator_flux(m, "psi_d", psi_d, "Flux of stator and transformer, d axis")
        q_flux = stator_flux(m, "psi_q", psi_q, "Flux of stator and transformer, q axis")
        d = Axis(X_1, (), d_flux, X_1, X, fixed_emf=emf)
        q = Axis(X_1, (), q_flux, X_1, X, fixed_emf=Expr(0))
        w = m.state("omega", 1.0, "pu", "Rotor speed", base="f_n")
        delta = m.state("delta", delta_0, "rad", "Angle of the emf in the network frame")
    v_t = port.v_0 + Phasor(common.R_t, common.X_t) * port.i_0
    start = Start(v_t.magnitude(), emf, psi_d * i.re + psi_q * i.im, v, i)
    return Machine(
        R=R,
        R_t=common.R_t,
        X_t=common.X_t,
        H=inertia,
        D=common.D,
        d=d,
        q=q,
        w=w,
        delta=delta,
        start=start,
        salient=False,
        is_infinite=is_infinite,
    )
