"""Loads that are no constant impedance: constant current, constant power, mixtures, and frequency dependence.

    P = P_0·(z·(v/v_0)² + i·v/v_0 + p)·(1 + k_pf·Δf), Q alike; v² alone holds below v_min

At a bus without capacitance v = Σ i / G, and a load that consists of a current only would leave |v| without an
equation. It is therefore the admittance Y of its operating point, and a correction that follows with a lag:

    i = Y·v + c,    τ·dc/dt = (Y'(|v|, f)·v − Y·v) − c

In steady state, and for everything slow against τ, the load follows its law exactly; within τ it is an impedance, as
real ones are. With the inductances L that feed the bus, a constant current G obeys G·L·s² + s + 1/τ = 0, damped at any
τ > 0. Static generation (P < 0) has Y = 0: within τ it is a source of constant current, not a negative conductance.

Of the longer τ of phasor networks a swing would see too much: 6 % of the change lies in quadrature at 1 Hz, 0.8 points
of damping in a network of twelve buses. There the load draws Y·v + 3·c − 2·d, with (τ/2)·dd/dt = c − d, whose error is
of second order in ω·τ.

Only Y'(|v|, f)·v is no linear function of the states. An implicit step takes it at the stages of the step, and all else
implicitly."""

from dataclasses import dataclass

from fmus.grid.element_data import LEAST_LOW_VOLTAGE, Load, Zip
from fmus.grid.elements import Bus, DeclaredLoad
from fmus.toolchain.frames import ZERO, Phasor, phasor_derivative, phasor_state, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr, Scalar, fmax

# default of τ [s]: far above electromechanical modes, well below the communication rate
RECOVERY_TIME = 1e-3

POWER_RECOVERY_TIME = 2e-3
"""The same with a share of constant power, whose negative resistance feeds resonances of the network below 1/τ: in
ieee39 with such loads alone, 0.5 ms leaves one at 151 Hz growing, 1 ms none."""

# least τ [s]: the law is taken at the stages of an implicit step of up to 0.2 ms
SHORTEST_RECOVERY = 5e-4

# the same [s] for phasor networks; a step takes the law explicitly, so two internal steps at least go into τ
PHASOR_RECOVERY_TIME = 1e-2
SHORTEST_PHASOR_RECOVERY = 1e-3
STEPS_IN_RECOVERY = 2

LONGEST_RECOVERY = 1.0  # largest τ [s]
_ROUNDING = 1e-9  # of a lag that is exactly two steps, in parts of it
# default time constant [s] of the frequency that a load feels: one period at 50 Hz
FREQUENCY_TIME = 0.02


@dataclass(frozen=True)
class FollowingLoad:
    """A declared load with its correction c at scale 1.

    ``data``: the load's laws; ``load``: its admittance at scale 1; ``correction``, ``held``: the states c and d, the
    second of phasor networks; ``followed``: what is drawn beside the admittance; ``tau``: the lag [s]; ``v_min``:
    voltage below which it is an impedance [pu]; None for never; ``delayed``: the bus voltage behind a lag, and that
    lag [s], for the frequency; None for a load that does not depend on it."""

    data: Load
    bus: Bus
    load: DeclaredLoad
    correction: Phasor
    held: Phasor | None
    followed: Phasor
    tau: Expr
    v_min: Expr | None
    delayed: tuple[Phasor, Expr] | None
    omega_b: Scalar | None


def declare_following_load(
    m: ModelBuilder,
    load: Load,
    declared: DeclaredLoad,
    buses: dict[str, Bus],
    omega_b: Scalar | None,
    *,
    phasors: bool = False,
) -> FollowingLoad:
    """Make a declared load follow its laws.

    ``load``: the load's bus, name and laws; ``declared``: the same load as a constant impedance, as `declare_load`
    returns it; ``buses``: by name; the correction is added to what is injected at the load's bus; ``omega_b``: base
    angular frequency [rad/s]; None where no load depends on the frequency; ``phasors``: whether the network is one of
    phasors, with longer steps."""
    bus = buses[load.bus]
    only_current = load.active.i == 1 and not (load.reactive_follows or load.k_pf)
    law = "a constant current" if only_current else "what its law says"
    before = "a constant current" if load.p_mw < 0 else "an impedance"
    shortest = SHORTEST_PHASOR_RECOVERY if phasors else SHORTEST_RECOVERY
    if load.tau is not None and not shortest <= load.tau <= LONGEST_RECOVERY:
        raise ValueError(
            f"load {load.name!r} has the lag tau = {load.tau:g} s; in this network it must be from {shortest:g} to "
            f"{LONGEST_RECOVERY:g} s, because a step takes the load's law explicitly"
        )
    with m.scope(load.name):
        tau = m.parameter(
            "tau",
            load.tau or _recovery_time(load, phasors),
            "s",
            f"Time after which the load is {law}; before, {before}",
            minimum=shortest,
            maximum=LONGEST_RECOVERY,
        )
        if phasors:
            rule = f"{load.name}.tau must be at least {STEPS_IN_RECOVERY} times internal_step; raise it, or lower that"
            m.require(tau - (1 - _ROUNDING) * STEPS_IN_RECOVERY * m.internal_step, rule)
        v_min = None
        if load.low_voltage:
            text = "Voltage below which the load is an impedance"
            v_min = m.parameter(
                "v_min",
                load.low_voltage,
                "pu",
                text,
                base="bus",
                minimum=LEAST_LOW_VOLTAGE,
                maximum=1.0,
            )
            rule = f"{load.name}: its voltage in the power flow must exceed v_min, where the load becomes an impedance"
            m.require(bus.v_0.magnitude() - v_min, f"{rule}; lower {load.name}.v_min")
        start = _missing(load, declared, bus.v_0)
        text = "Correction of the load's current at scale 1"
        correction = phasor_state(m, "c", start, text, SYSTEM_BASE)
        held = (
            phasor_state(m, "d", start, f"{text}, behind its lag", SYSTEM_BASE) if phasors else None
        )
        delayed = _delayed_voltage(m, bus) if load.k_pf or load.k_qf else None
    followed = correction if held is None else correction * 3.0 - held * 2.0
    bus.injected -= followed * declared.scale
    return FollowingLoad(
        data=load,
        bus=bus,
        load=declared,
        correction=correction,
        held=held,
        followed=followed,
        tau=tau,
        v_min=v_min,
        delayed=delayed,
        omega_b=omega_b,
    )


def following_load_equations(m: ModelBuilder, load: FollowingLoad) -> None:
    """Give the equation τ·dc/dt = (Y' − Y)·v − c, and declare the load's power."""
    v, declared = load.bus.v, load.load
    rate = (_current_beyond_admittance(m, load) - load.correction) * (1 / load.tau)
    implicit = load.correction * (-1 / load.tau)
    phasor_derivative(m, load.correction, rate, implicit)
    if load.held is not None:
        phasor_derivative(
            m,
            load.held,
            (load.correction - load.held) * (2 / load.tau),
            load.held * (-2 / load.tau),
        )
    if load.delayed is not None:
        delayed, lag = load.delayed
        moved = (v - delayed) * (1 / lag)
        phasor_derivative(m, delayed, moved)
    own = v * declared.G
    if load.data.reactive_follows:
        own = v * Phasor(
            declared.G,
            declared.B_0 if load.data.susceptance_mvar and not declared.branches else 0.0,
        )
        for branch in declared.branches:
            own += branch.current
    drawn = power(v, (own + load.followed) * declared.scale)
    with m.scope(load.data.name):
        if load.data.active_follows:
            m.output("p", drawn.re, "pu", "Active power drawn", base=SYSTEM_BASE)
        if load.data.reactive_follows:
            m.output("q", drawn.im, "pu", "Reactive power drawn", base=SYSTEM_BASE)


def _current_beyond_admittance(m: ModelBuilder, load: FollowingLoad) -> Phasor:
    """(Y' − Y)·v: what the law draws more than the admittance."""
    v, data = load.bus.v, load.data
    w = v.magnitude() if load.v_min is None else fmax(v.magnitude(), load.v_min)
    ratio = load.bus.v_0.magnitude() / w
    deviation = _frequency_deviation(load)
    G: Scalar = 0.0
    B: Scalar = 0.0
    if data.active_follows:
        G = load.load.G_0 * (
            _of_law(data.active, ratio, data.k_pf, deviation) - (1 if data.conductance_mw else 0)
        )
    if data.reactive_follows:
        B = load.load.B_0 * (
            _of_law(data.reactive, ratio, data.k_qf, deviation)
            - (1 if data.susceptance_mvar else 0)
        )
    return v * G if not data.reactive_follows else v * Phasor(G, B)


def _of_law(law: Zip, ratio: Expr, k: float, deviation: Scalar) -> Scalar:
    """Admittance by a law, relative to that at v_0; ``ratio`` is v_0/v."""
    terms = [
        term if share == 1 else share * term
        for share, term in ((law.z, Expr(1)), (law.i, ratio), (law.p, ratio**2))
        if share
    ]
    total = terms[0] if len(terms) == 1 else sum(terms[1:], terms[0])
    return total * (1 + k * deviation) if k else total


def _missing(load: Load, declared: DeclaredLoad, v_0: Phasor) -> Phasor:
    """The power at the operating point less the admittance's: all of it for static generation."""
    G = declared.G_0 if load.conductance_mw == 0 and load.p_mw else 0.0
    B = declared.B_0 if load.susceptance_mvar == 0 and load.q_mvar else 0.0
    return v_0 * Phasor(G, B) if load.p_mw < 0 else ZERO


def _recovery_time(load: Load, phasors: bool) -> float:
    if phasors:
        return PHASOR_RECOVERY_TIME
    return POWER_RECOVERY_TIME if load.active.p or load.reactive.p else RECOVERY_TIME


def _delayed_voltage(m: ModelBuilder, bus: Bus) -> tuple[Phasor, Expr]:
    lag = m.parameter(
        "T_f",
        FREQUENCY_TIME,
        "s",
        "Time constant of the frequency that the load feels",
        minimum=5e-3,
        maximum=10.0,
    )
    text = "Bus voltage behind the lag of the frequency"
    return phasor_state(m, "z", bus.v_0, text, "bus"), lag


def _frequency_deviation(load: FollowingLoad) -> Scalar:
    """Δω = Im(v/z)/(T_f·ω_b) [pu], with T_f·dz/dt = v − z: exact where v turns steadily."""
    if load.delayed is None or load.omega_b is None:
        return 0.0
    z, lag = load.delayed
    v = load.bus.v
    return (v.im * z.re - v.re * z.im) / (z.re**2 + z.im**2) / (lag * load.omega_b)
