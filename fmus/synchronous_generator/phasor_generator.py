"""Generators without stator transients, for RMS tools with steps of milliseconds: an emf behind X''_d.

Rotor, exciters, governors and data are those of `generator`. With dψ̃/dt and the transformer's di/dt left out, and the
voltage drops taken at rated frequency as in the network,

    v = w·(e''_d + j·e''_q) − R·i − X_d·i_d − j·X_q·i_q        (rotor frame, f = f_q − j·f_d; X with the transformer)

The emf keeps the rotor's speed w: it stands for the first-order part of the transients that are left out, and without
it electromechanical modes are up to 0.4 points of damping off.

Where X''_q ≠ X''_d a constant admittance needs an emf of its own for the difference, −j·(X''_q − X''_d)·i_q. It is
taken from i_q through a short lag, so that the emf follows from states alone; in steady state it is exact."""

from functools import partial

from fmus.synchronous_generator.declarations import MACHINE
from fmus.synchronous_generator.excitation.common import Exciter, Regulated
from fmus.synchronous_generator.limiters.common import WITHOUT, Limiters
from fmus.synchronous_generator.machine import (
    Machine,
    declare_machine,
    rotor_equations,
)
from fmus.synchronous_generator.turbines.without_limits import ieeeg1
from fmus.synchronous_generator.variants import (
    AC4A,
    ST1,
    ST4B,
    Governor,
    Stabilizer,
    Variant,
    declare_machine_outputs,
    of_speed,
    seen_by_controls,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import DevicePort, device_port


def synchronous_generator_ac4a_phasor() -> Model:
    """`synchronous_generator_ac4a` without stator transients."""
    return _generator(AC4A)


def synchronous_generator_st1_phasor() -> Model:
    """`synchronous_generator_st1` without stator transients."""
    return _generator(ST1)


def synchronous_generator_st4b_phasor() -> Model:
    """`synchronous_generator_st4b` without stator transients."""
    return _generator(ST4B)


def _generator(variant: Variant) -> Model:
    m = phasor_builder(
        variant.model_name("phasor"), variant.title("phasor type"), kind="machine", usual=MACHINE
    )
    port = device_port(m, variant.data.S_n, variant.data.P_0)
    g = declare_machine(
        m, port, variant.data, stator_flux=lambda m, name, start, text: m.algebraic(name)
    )
    governor = of_speed(partial(ieeeg1, data=variant.governor))
    return with_controls(m, port, g, variant.exciter, governor, None)


def with_controls(
    m: ModelBuilder,
    port: DevicePort,
    g: Machine,
    exciter: Exciter,
    governor: Governor,
    stabilizer: Stabilizer | None,
    limiters: Limiters = WITHOUT,
) -> Model:
    """A machine without stator transients, its stator's fluxes as open signals, and its controls."""
    emf = Phasor(g.d.emf, g.q.emf) * (g.w if g.emf_speed is None else g.emf_speed)
    close_stator(m, g, port, emf)
    at_port = port.through_breaker(port.v.rotated(-g.delta), emf)  # the emf behind an open breaker
    terminal = at_port + Phasor(g.R_t, g.X_t) * g.current
    shaft = seen_by_controls(m, g, port, terminal)
    v_s = 0.0 if stabilizer is None else stabilizer(m, shaft)
    seen = Regulated(
        g.start,
        lambda E: terminal,
        g.field_current,
        v_s,
        i=g.current,
        v_0=g.start.terminal(g.R_t, g.X_t),
    )
    E_fd, _ = limiters.regulate(m, seen, exciter)
    P_m = governor(m, shaft)
    m.close(shaft.P_m, P_m)
    rotor_equations(m, g, port, E_fd, P_m)
    declare_phasor_port(m, g, port, emf)
    declare_machine_outputs(m, g, shaft.v_t, E_fd, P_m)
    return m.build()


def declare_phasor_port(m: ModelBuilder, g: Machine, port: DevicePort, emf: Phasor) -> None:
    """Declare emf and admittance, and the lag for what saliency the admittance cannot show.

    ``emf``: behind the subtransient reactance, rotor frame [pu]."""
    impedance = Phasor(g.R, g.d.X_between if g.X_port is None else g.X_port)
    start = g.start.v + impedance * g.start.i
    source = source_emf(
        m, emf - _saliency(m, g) if g.salient else emf, start, g.delta, port.omega_b * (g.w - 1)
    )
    declare_phasor_outputs(m, port, source, impedance)


def close_stator(m: ModelBuilder, g: Machine, port: DevicePort, emf: Phasor) -> None:
    """Stator currents from emf and bus voltage, two real equations; then the fluxes ψ̃ = e'' − X·i.

    ``g``: the machine, its stator's fluxes as open signals; ``port``: gives the bus voltage; ``emf``: behind the
    subtransient reactance, rotor frame [pu]."""
    over = (emf - port.v.rotated(-g.delta)) * port.connected
    R, X_d, X_q = g.R, g.d.X_between, g.q.X_between
    determinant = R**2 + X_d * X_q
    i_q = (R * over.re + X_d * over.im) / determinant
    i_d = (X_q * over.re - R * over.im) / determinant
    m.close(g.d.psi, g.d.emf - X_d * i_d)
    m.close(g.q.psi, g.q.emf - X_q * i_q)


def _saliency(m: ModelBuilder, g: Machine) -> Phasor:
    """j·(X''_q − X)·i_q + (X''_d − X)·i_d with lagged currents, rotor frame; X is what the network sees."""
    with m.scope("machine"):
        T = m.parameter(
            "T_saliency",
            0.005,
            "s",
            "Lag of i_q in the emf's part for X''_q − X''_d; no effect where they are equal",
            minimum=1e-3,
        )
        lagged = m.state(
            "i_q_lagged", g.start.i.re, "pu", "Stator current through a lag, q axis", base="S_n"
        )
        m.derivative(lagged, (g.q.i - lagged) / T)
        if g.X_port is None:
            return Phasor(0.0, (g.q.X_between - g.d.X_between) * lagged)
        of_d = m.state(
            "i_d_lagged", -g.start.i.im, "pu", "Stator current through a lag, d axis", base="S_n"
        )
        m.derivative(of_d, (g.d.i - of_d) / T)
    return Phasor((g.d.X_between - g.X_port) * of_d, (g.q.X_between - g.X_port) * lagged)
