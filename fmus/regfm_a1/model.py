"""REGFM_A1: a voltage source behind an impedance, with P-f and Q-V droop, power limits and a fault current limit.

Names of parameters and signals are those of the specification (PNNL-32278, September 2023)."""

from fmus.converter_parts.fault_current import (
    FaultLimit,
    declare_seen_lag,
    declare_terminal_outputs,
    limited_in_faults,
)
from fmus.toolchain.blocks import low_pass
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, Scalar, fmax, fmin, if_else, logic_and, logic_or
from fmus.toolchain.variables import usual_beside

SPECIFICATION = "PNNL-32278 (2023), as GridKit's REGFMA quotes it"

RETURN_TIME = 0.01
"""Time constant [s] with which an integrator of a power limit comes to rest at 0. The specification stops it there,
which has no linear model."""


def active_droop(m: ModelBuilder, P_0: Scalar, Pf: Expr) -> Expr:
    """Declare the P-f droop with Pmax and Pmin; return the frequency [pu].

    ω = 1 + mp·(Pref − Pf) + u_max + u_min, where u_max ≤ 0 and u_min ≥ 0 act beyond a limit.

    ``P_0``: active power of the operating point [pu, S_n]; ``Pf``: measured active power [pu, S_n]."""
    mp = m.parameter(
        "mp",
        0.01,
        "pu",
        "P-f droop gain",
        base="S_n",
        minimum=1e-4,
        tunable=True,
        source=SPECIFICATION,
    )
    change = m.parameter("delta_Pref", 0, "pu", "Change of Pref", base="S_n", tunable=True)
    Pref = m.calculated(
        "Pref", P_0, "pu", "Active-power reference of the operating point", base="S_n"
    )
    kp = m.parameter(
        "kppmax",
        0.01,
        "pu",
        "Proportional gain of Pmax and Pmin",
        base="S_n",
        minimum=0,
        tunable=True,
        source=SPECIFICATION,
    )
    ki = m.parameter(
        "kipmax",
        0.1,
        "1/s",
        "Integral gain of Pmax and Pmin",
        minimum=0,
        tunable=True,
        source=SPECIFICATION,
    )
    beyond = _limits(m, "P", 1.0, least=-1.0, measured=Pf, start=P_0, kp=kp, ki=ki)
    return 1 + mp * (Pref + change - Pf) + beyond


def internal_voltage(
    m: ModelBuilder, V_0: Scalar, E_0: Scalar, Q_0: Scalar, Qf: Expr, Vf: Expr
) -> Expr:
    """Declare the Q-V droop with Qmax and Qmin and the voltage control; return the internal voltage's magnitude [pu].

    ``V_0``, ``E_0``, ``Q_0``: terminal voltage, internal voltage and reactive power of the operating point [pu, S_n];
    ``Qf``, ``Vf``: measured reactive power and terminal voltage [pu, S_n]."""
    mq = m.parameter(
        "mq",
        0.05,
        "pu",
        "Q-V droop gain",
        base="S_n",
        minimum=0,
        tunable=True,
        source=SPECIFICATION,
    )
    kpv = m.parameter(
        "kpv",
        0.0,
        "pu",
        "Proportional gain of the voltage control",
        base="S_n",
        minimum=0,
        source=SPECIFICATION,
    )
    kiv = m.parameter(
        "kiv", 5.86, "1/s", "Integral gain of the voltage control", minimum=0, source=SPECIFICATION
    )
    most = m.parameter(
        "Emax", 1.15, "pu", "Largest internal voltage", base="S_n", source=SPECIFICATION
    )
    least = m.parameter(
        "Emin", 0.0, "pu", "Smallest internal voltage", base="S_n", source=SPECIFICATION
    )
    controlled = m.switch(
        "VFlag", True, "The terminal voltage is controlled; else the droop gives the internal one"
    )
    change_Q = m.parameter("delta_Qref", 0, "pu", "Change of Qref", base="S_n", tunable=True)
    change_V = m.parameter("delta_Vref", 0, "pu", "Change of Vref", base="S_n", tunable=True)
    kp = m.parameter(
        "kpqmax",
        3.0,
        "pu",
        "Proportional gain of Qmax and Qmin; 0.1 where VFlag is false",
        base="S_n",
        minimum=0,
        source=SPECIFICATION,
    )
    ki = m.parameter(
        "kiqmax",
        20.0,
        "1/s",
        "Integral gain of Qmax and Qmin; 10 where VFlag is false",
        minimum=0,
        source=SPECIFICATION,
    )
    Qref = m.calculated(
        "Qref", Q_0, "pu", "Reactive-power reference of the operating point", base="S_n"
    )
    Vref = m.calculated(
        "Vref",
        if_else(controlled, V_0, E_0),
        "pu",
        "Voltage reference of the operating point",
        base="S_n",
    )
    m.require(
        most - E_0,
        "the power flow asks for an internal voltage above Emax: lower Q_0 or v_0, or raise S_n",
    )
    m.require(
        E_0 - least,
        "the power flow asks for an internal voltage below Emin: raise Q_0 or v_0, or raise S_n",
    )
    beyond = _limits(m, "Q", 0.44, least=-0.44, measured=Qf, start=Q_0, kp=kp, ki=ki)
    command = Vref + change_V + mq * (Qref + change_Q - Qf) + beyond
    error = command - Vf
    x = m.state("x_V", E_0, "pu", "Integrator of the voltage control", base="S_n")
    m.derivative(x, controlled * _rate_within(x, kiv * error, least, most))
    return fmin(fmax(if_else(controlled, kpv * error + x, command), least), most)


def _limits(
    m: ModelBuilder,
    name: str,
    most: float,
    least: float,
    measured: Expr,
    start: Scalar,
    kp: Expr,
    ki: Expr,
) -> Expr:
    """Declare the upper and the lower limit of P or Q; return what both controllers add [pu].

    Each is a proportional-integral controller that only leads back: integrator and output stay on one side of 0."""
    source = (
        "chosen here: storage; the specification's resources feed 0 to 0.9"
        if name == "P"
        else SPECIFICATION
    )
    high = m.parameter(f"{name}max", most, "pu", f"Largest {name}", base="S_n", source=source)
    low = m.parameter(f"{name}min", least, "pu", f"Smallest {name}", base="S_n", source=source)
    m.require(
        high - start,
        f"the power flow asks for more than {name}max: lower {name}_0, or raise {name}max or S_n",
    )
    m.require(
        start - low,
        f"the power flow asks for less than {name}min: raise {name}_0, or lower {name}min",
    )
    down = m.state(f"x_{name}max", 0, "pu", f"Integrator of {name}max", base="S_n")
    up = m.state(f"x_{name}min", 0, "pu", f"Integrator of {name}min", base="S_n")
    above, below = high - measured, low - measured
    m.derivative(down, fmin(ki * above, -down / RETURN_TIME))
    m.derivative(up, fmax(ki * below, -up / RETURN_TIME))
    return fmin(kp * above + down, 0) + fmax(kp * below + up, 0)


def _rate_within(x: Expr, rate: Expr, least: Expr, most: Expr) -> Expr:
    """The rate of an integrator that stays within two values."""
    outward = logic_or(logic_and(x >= most, rate > 0), logic_and(x <= least, rate < 0))
    return if_else(outward, 0, rate)


# the two-area system's converter, whose place it takes
S_N = 1500.0  # default rating [MVA]
P_0 = 0.9  # default dispatch [pu, S_n]
USUAL = usual_beside(__file__)


def regfm_a1_phasor() -> Model:
    """The droop-controlled grid-forming inverter of the WECC, phasor type."""
    title = "Droop-controlled grid-forming inverter REGFM_A1 of the WECC (phasor type)"
    m = phasor_builder("regfm_a1_phasor", title, kind="converter", usual=USUAL)
    port = device_port(m, S_n=S_N, P_0=P_0)
    RL = m.parameter(
        "RL", 0.0, "pu", "Coupling resistance", base="S_n", minimum=0, source="chosen here"
    )
    XL = m.parameter(
        "XL", 0.15, "pu", "Coupling reactance", base="S_n", minimum=0.01, source=SPECIFICATION
    )
    Z = Phasor(RL, XL)
    e_0 = port.v_0 + Z * port.i_0
    delta = m.state(
        "delta_droop", e_0.angle(), "rad", "Angle of the internal voltage in the network frame"
    )

    v = port.v.rotated(-delta)
    P, Q = m.algebraic("P"), m.algebraic("Q")
    Pf, Qf, Vf = _declare_measurement(m, port, P, Q, v)
    omega = active_droop(m, power(port.v_0, port.i_0).re, Pf)
    m.derivative(delta, port.omega_b * (omega - 1))
    E_droop = internal_voltage(
        m, port.v_0.magnitude(), e_0.magnitude(), power(port.v_0, port.i_0).im, Qf, Vf
    )
    inside = Phasor(E_droop, 0)
    at_rest = port.v_0.rotated(-e_0.angle())
    limited, share = limited_in_faults(m, _fault_limit(m, port), inside, v, Z, at_rest)

    i = (limited - v) / Z * port.connected
    s = power(v, i)
    m.close(P, s.re)
    m.close(Q, s.im)
    start = Phasor(e_0.magnitude(), 0)
    declare_phasor_outputs(
        m, port, source_emf(m, limited, start, delta, port.omega_b * (omega - 1)), Z
    )
    m.output("omega", omega, "pu", "Frequency of the internal voltage", base="f_n")
    m.output(
        "E_droop",
        E_droop,
        "pu",
        "Magnitude of the internal voltage before the fault current limit",
        base="S_n",
    )
    declare_terminal_outputs(m, v, i, share)
    return m.build()


def _declare_measurement(
    m: ModelBuilder, port: DevicePort, P: Expr, Q: Expr, v: Phasor
) -> tuple[Expr, Expr, Expr]:
    """P, Q [pu, S_n] and V [pu] at the terminal, each through its own lag."""
    s_0 = power(port.v_0, port.i_0)
    lags = {"P": (P, s_0.re), "Q": (Q, s_0.im), "V": (v.magnitude(), port.v_0.magnitude())}
    found = []
    for name, (signal, start) in lags.items():
        T = m.parameter(
            f"T{name}f",
            0.01,
            "s",
            f"Lag of the measurement of {name}",
            minimum=1e-3,
            source=SPECIFICATION,
        )
        found.append(low_pass(m, f"{name}f", Expr(signal), T, start))
    return found[0], found[1], found[2]


def _fault_limit(m: ModelBuilder, port: DevicePort) -> FaultLimit:
    ImaxF = m.parameter(
        "ImaxF",
        2.0,
        "pu",
        "Largest current in a fault",
        base="S_n",
        minimum=0.1,
        source=SPECIFICATION,
    )
    lag = declare_seen_lag(m, "TIf")
    m.require(
        ImaxF - port.i_0.magnitude(),
        "the power flow asks for more current than ImaxF: lower P_0, or raise S_n",
    )
    return FaultLimit(ImaxF, lag)
