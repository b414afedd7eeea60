"""The synchronous machine with its step-up transformer in series, in its own rotor's frame.

Generator signs, per unit on the stator base; f = f_q − j·f_d in the rotor's frame. States are flux
linkages. Stator and transformer are one inductance, so ψ̃ = ψ − X_t·i is the flux between rotor and
bus and no snubber is needed:

    ψ̃̇_q/ω_b = v_q + (R_s + R_t)·i_q − w·ψ̃_d        ψ̇_f/ω_b  = (R_f/X_md)·E_fd − R_f·i_f
    ψ̃̇_d/ω_b = v_d + (R_s + R_t)·i_d + w·ψ̃_q        ψ̇_kd/ω_b = −R_k·i_k for every damper
    2H·ẇ = P_m/w − (ψ_d·i_q − ψ_q·i_d) − D·(w − 1)     δ̇ = ω_b·(w − 1)"""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.synchronous_generator.axis import Axis, Winding
from fmus.synchronous_generator.conversion import AxisData, RotorBranches, convert
from fmus.synchronous_generator.data import STAMP, MachineData
from fmus.toolchain.blocks import BYPASS_TIME
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, Scalar, exp, fmin, if_else, log

FluxDeclaration = Callable[[ModelBuilder, str, Expr, str], Expr]
"""Declares a flux by its name, start value and description."""


@dataclass(frozen=True)
class Start:
    """Start values for exciter and governor: |v_t|, field voltage and current, torque; bus voltage and current in the
    rotor's frame."""

    v_t: Expr
    E_fd: Expr
    T_e: Expr
    v: Phasor
    i: Phasor

    def terminal(self, R_t: Scalar, X_t: Scalar) -> Phasor:
        """Terminal voltage behind a transformer's impedance, rotor frame [pu, S_n]."""
        return self.v + Phasor(R_t, X_t) * self.i


@dataclass(frozen=True)
class Machine:
    """Parameters, states and operating point of the machine.

    ``salient`` where its last reactances may differ; ``at_rated_speed`` where the emf is e'' instead of w·e'' unless
    a parameter says otherwise, which only a phasor model can have; ``emf_speed``: what e'' is multiplied by there, w
    where it is None; ``S_n``: the rating [MVA], which only parts that are chosen by name ask for;
    ``is_infinite``: whether its speed stays at 1; None of a machine whose speed cannot; ``X_port``: constant reactance
    that the network sees behind the port, where the axes' change; None where that is the d axis'."""

    R: Expr
    R_t: Expr
    X_t: Expr
    H: Expr
    D: Expr
    d: Axis
    q: Axis
    w: Expr
    delta: Expr
    start: Start
    salient: bool = True
    at_rated_speed: bool = False
    emf_speed: Expr | None = None
    S_n: Expr | None = None
    is_infinite: Expr | None = None
    X_port: Expr | None = None

    @property
    def current(self) -> Phasor:
        """Stator current, rotor frame."""
        return Phasor(self.q.i, -self.d.i)

    @property
    def torque(self) -> Expr:
        """Electrical torque [pu]."""
        return self.d.psi * self.q.i - self.q.psi * self.d.i

    @property
    def field_current(self) -> Expr:
        """X_md·i_f: 1 pu gives 1 pu open-circuit voltage; the constant emf where there is no field winding."""
        return self.d.fixed_emf if self.d.fixed_emf is not None else self.d.X_m * self.d.current(0)


def flux_state(m: ModelBuilder, name: str, start: Expr, text: str) -> Expr:
    """Declare a flux linkage as a state [pu, S_n].

    ``start``: its initial value [pu, S_n]."""
    return m.state(name, start, "pu", text, base="S_n")


def declare_machine(
    m: ModelBuilder, port: DevicePort, data: MachineData, stator_flux: FluxDeclaration = flux_state
) -> Machine:
    """Declare the machine's parameters and states; the power flow gives the operating point."""
    with m.scope("transformer"):
        R_t = m.parameter(
            "R_t", data.R_t, "pu", "Resistance", base="S_n", minimum=0, source=data.source
        )
        X_t = m.parameter(
            "X_t", data.X_t, "pu", "Reactance", base="S_n", minimum=0, source=data.source
        )
    with m.scope("machine"):
        R_s = m.parameter(
            "R_s", 0.0025, "pu", "Stator resistance", base="S_n", minimum=0, source=STAMP
        )
        H = m.parameter("H", data.H, "s", "Inertia constant", minimum=0.01, source=data.source)
        D = m.parameter(
            "D",
            0.0,
            "pu",
            "Damping torque per speed deviation",
            base="S_n",
            minimum=0,
            source=STAMP,
        )
        d_data, q_data = _axis_parameters(m, data)
        use_exact = m.switch(
            "exact_conversion", False, "Standard data to circuit: exact, not classical"
        )
        saturation = _saturation_factor(m, port, data, R_s=R_s, R_t=R_t, X_t=X_t, X_l=d_data.X_l)
        start, d, q, delta_0 = _operating_point(
            m,
            port,
            R_s,
            R_t=R_t,
            X_t=X_t,
            d_data=d_data,
            q_data=q_data,
            use_exact=use_exact,
            saturation=saturation,
            stator_flux=stator_flux,
        )
        w = m.state("omega", 1.0, "pu", "Rotor speed", base="f_n")
        delta = m.state("delta", delta_0, "rad", "Rotor angle in the network frame")
    return Machine(R=R_s + R_t, R_t=R_t, X_t=X_t, H=H, D=D, d=d, q=q, w=w, delta=delta, start=start)


def machine_equations(m: ModelBuilder, g: Machine, port: DevicePort, E_fd: Expr, P_m: Expr) -> None:
    """Give the derivatives of fluxes, speed and angle.

    ``port``: gives the bus voltage; ``E_fd``: field voltage; 1 pu gives 1 pu of voltage on open circuit; ``P_m``:
    mechanical power [pu, S_n]."""
    psi_q, psi_d = _flux_rates(g, port, E_fd)[:2]
    m.derivative(g.q.psi, psi_q)
    m.derivative(g.d.psi, psi_d)
    rotor_equations(m, g, port, E_fd, P_m)


def rotor_equations(m: ModelBuilder, g: Machine, port: DevicePort, E_fd: Expr, P_m: Expr) -> None:
    """Give the derivatives of the rotor's fluxes, speed and angle."""
    for axis, rates in zip((g.d, g.q), _rotor_flux_rates(g, port, E_fd), strict=True):
        for winding, rate in zip(axis.windings, rates, strict=True):
            m.derivative(winding.psi, rate)
    acceleration = (P_m / g.w - g.torque - g.D * (g.w - 1)) / (2 * g.H)
    if g.is_infinite is not None:
        acceleration = if_else(g.is_infinite, (1 - g.w) / BYPASS_TIME, acceleration)
    m.derivative(g.w, acceleration)
    m.derivative(g.delta, port.omega_b * (g.w - 1))


def terminal_voltage(g: Machine, port: DevicePort, E_fd: Expr) -> Phasor:
    """v_t at the machine's terminal, rotor frame: the bus voltage plus the transformer's drop, di/dt included."""
    psi_q, psi_d, d_rotor, q_rotor = _flux_rates(g, port, E_fd)
    rate = Phasor(g.q.current_rate(psi_q, q_rotor), -g.d.current_rate(psi_d, d_rotor))
    drop = Phasor(g.R_t, g.w * g.X_t) * g.current + rate * (g.X_t / port.omega_b)
    opened = (
        Phasor(psi_q, -psi_d) / port.omega_b
        - g.current * g.R
        + Phasor(g.w * g.d.psi, g.w * g.q.psi)
    )
    return port.through_breaker(port.v.rotated(-g.delta), opened) + drop


def terminal_power(g: Machine, port: DevicePort) -> tuple[Expr, Expr]:
    """Electrical power at the machine's terminal [pu, S_n], that at the bus and the transformer's losses; and the same
    at the operating point."""
    losses = g.R_t * g.current.magnitude() ** 2
    P_e = power(port.v.rotated(-g.delta), g.current).re + losses
    P_e_0 = power(port.v_0, port.i_0).re + g.R_t * port.i_0.magnitude() ** 2
    return Expr(P_e), Expr(P_e_0)


RotorRates = tuple[Expr, ...]  # rates of the fluxes of one axis' rotor windings


def _flux_rates(
    g: Machine, port: DevicePort, E_fd: Expr
) -> tuple[Expr, Expr, RotorRates, RotorRates]:
    """Rates of ψ_q, ψ_d and of the rotor's fluxes, d and q axis.

    Behind an open breaker the stator's flux follows the rotor's such that the current fades like that of every open
    breaker. The voltage at the breaker then follows from the stator's equation."""
    d_rotor, q_rotor = _rotor_flux_rates(g, port, E_fd)
    v = port.v.rotated(-g.delta)
    closed = (
        Phasor(v.re + g.R * g.q.i - g.w * g.d.psi, -v.im + g.R * g.d.i + g.w * g.q.psi)
        * port.omega_b
    )
    opened = Phasor(g.q.open_rate(q_rotor), g.d.open_rate(d_rotor))
    psi = port.through_breaker(closed, opened)  # a pair of q and d here, not a complex number
    return Expr(psi.re), Expr(psi.im), d_rotor, q_rotor


def _rotor_flux_rates(g: Machine, port: DevicePort, E_fd: Expr) -> tuple[RotorRates, RotorRates]:
    """Rates of the rotor's fluxes, d and q axis; the first winding of the d axis is the field."""
    d_rotor, q_rotor = (
        tuple(
            -port.omega_b * winding.R * axis.current(k) for k, winding in enumerate(axis.windings)
        )
        for axis in (g.d, g.q)
    )
    if d_rotor:
        field = port.omega_b * g.d.windings[0].R * (E_fd / g.d.X_m - g.d.current(0))
        d_rotor = (field, *d_rotor[1:])
    return d_rotor, q_rotor


def _axis_parameters(m: ModelBuilder, data: MachineData) -> tuple[AxisData, AxisData]:
    def reactance(name: str, value: float, text: str) -> Expr:
        return m.parameter(
            name, value, "pu", text, base="S_n", minimum=0.001, maximum=20, source=data.source
        )

    def time(name: str, value: float, text: str) -> Expr:
        return m.parameter(name, value, "s", text, minimum=1e-3, source=data.source)

    X_l = reactance("X_l", data.X_l, "Stator leakage reactance")
    axes = {}
    for axis, values in {
        "d": (data.X_d, data.X_d1, data.X_d2, data.T_d10, data.T_d20),
        "q": (data.X_q, data.X_q1, data.X_q2, data.T_q10, data.T_q20),
    }.items():
        X = reactance(f"X_{axis}", values[0], f"Synchronous reactance, {axis} axis")
        X1 = reactance(f"X_{axis}1", values[1], f"Transient reactance X'_{axis}")
        X2 = reactance(f"X_{axis}2", values[2], f"Subtransient reactance X''_{axis}")
        T10 = time(f"T_{axis}10", values[3], f"Open-circuit transient time constant T'_{axis}0")
        T20 = time(f"T_{axis}20", values[4], f"Open-circuit subtransient time constant T''_{axis}0")
        if axis == "d":  # without a field winding nothing could excite the machine
            m.require(X - X1, "machine.X_d must exceed machine.X_d1")
        else:
            m.require(if_else(X1 <= X, 1, -1), "machine.X_q1 must not exceed machine.X_q")
        m.require(if_else(X2 <= X1, 1, -1), f"machine.X_{axis}2 must not exceed machine.X_{axis}1")
        m.require(X2 - X_l, f"machine.X_{axis}2 must exceed machine.X_l")
        m.require(T10 - T20, f"machine.T_{axis}10 must exceed machine.T_{axis}20")
        axes[axis] = AxisData(X, X1, X2, X_l, T10, T20)
    return axes["d"], axes["q"]


def _saturation_factor(
    m: ModelBuilder, port: DevicePort, data: MachineData, R_s: Expr, R_t: Expr, X_t: Expr, X_l: Expr
) -> Expr:
    """1 + s(ψ) at the air-gap flux of the operating point, s(ψ) = s(1.0)·ψⁿ through s(1.2); 1 where switched off."""
    on = m.switch(
        "saturation", False, "Divide the magnetising reactances by 1 + s at the operating point"
    )
    s_10, s_12 = (
        m.parameter(
            name,
            s,
            "1",
            f"Saturation s({x}) of the open-circuit curve",
            minimum=1e-6,
            source=data.source,
        )
        for name, s, x in (("s_10", data.s_10, "1.0"), ("s_12", data.s_12, "1.2"))
    )
    psi = (port.v_0 + Phasor(R_s + R_t, X_t + X_l) * port.i_0).magnitude()
    s = s_10 * exp(log(s_12 / s_10) / log(1.2) * log(psi))
    return m.calculated("saturation_factor", 1 + on * s, "1", "1 + s(ψ) at the operating point")


def _operating_point(
    m: ModelBuilder,
    port: DevicePort,
    R_s: Expr,
    R_t: Expr,
    X_t: Expr,
    d_data: AxisData,
    q_data: AxisData,
    use_exact: Expr,
    saturation: Expr,
    stator_flux: FluxDeclaration,
) -> tuple[Start, Axis, Axis, Expr]:
    """Circuit of both axes, rotor angle and every flux of the steady state."""
    reactances = {}
    for axis, data in {"d": d_data, "q": q_data}.items():
        X_m = m.calculated(
            f"X_m{axis}",
            (data.X - data.X_l) / saturation,
            "pu",
            f"Magnetising reactance, {axis} axis",
            "S_n",
        )
        b = convert(data, port.omega_b, use_exact)
        branches = RotorBranches(
            *(
                m.calculated(
                    f"{axis}_{name}", value, "pu", f"Rotor branch of the {axis} axis: {name}", "S_n"
                )
                for name, value in {"X_1": b.X_1, "R_1": b.R_1, "X_2": b.X_2, "R_2": b.R_2}.items()
            )
        )
        m.require(
            fmin(branches.X_1, branches.X_2),
            f"machine: no circuit fits the {axis}-axis data; check X, X', X'' and the time constants",
        )
        X_sub = m.calculated(
            f"X_m{axis}2",
            1 / (1 / X_m + 1 / branches.X_1 + 1 / branches.X_2),
            "pu",
            f"Subtransient X''_{axis} − X_l",
            "S_n",
        )
        reactances[axis] = X_m, branches, X_sub, X_sub + data.X_l + X_t

    v_t = port.v_0 + Phasor(R_t, X_t) * port.i_0
    X_q = q_data.X_l + reactances["q"][0]
    delta_0 = (v_t + Phasor(R_s, X_q) * port.i_0).angle()
    i, v = port.i_0.rotated(-delta_0), port.v_0.rotated(-delta_0)
    i_q, i_d, v_q, v_d = i.re, -i.im, v.re, -v.im
    psi_d, psi_q = v_q + (R_s + R_t) * i_q, -(v_d + (R_s + R_t) * i_d)
    X_md, X_mq = reactances["d"][0], reactances["q"][0]
    E_fd = psi_d + (X_t + d_data.X_l + X_md) * i_d
    airgap_d, airgap_q = E_fd - X_md * i_d, -X_mq * i_q
    psi_f = airgap_d + reactances["d"][1].X_1 * E_fd / X_md

    def axis_of(name: str, psi: Expr, *fluxes: tuple[str, Expr, str]) -> Axis:
        X_m, b, X_sub, X_between = reactances[name]
        stator = stator_flux(m, f"psi_{name}", psi, f"Flux of stator and transformer, {name} axis")
        branches = zip(((b.X_1, b.R_1), (b.X_2, b.R_2)), fluxes, strict=True)
        windings = tuple(Winding(X, R, flux_state(m, *flux)) for (X, R), flux in branches)
        return Axis(X_m, windings, stator, X_sub, X_between)

    d = axis_of(
        "d", psi_d, ("psi_f", psi_f, "Field flux"), ("psi_1d", airgap_d, "Damper flux, d axis")
    )
    q = axis_of(
        "q",
        psi_q,
        ("psi_1q", airgap_q, "First damper flux, q axis"),
        ("psi_2q", airgap_q, "Second damper flux, q axis"),
    )
    return Start(v_t.magnitude(), E_fd, psi_d * i_q - psi_q * i_d, v, i), d, q, delta_0
