"""REGFM_A1: a voltage source behind an impedance, with P-f and Q-V droop, power limits and a fault current limit.

Names of parameters and signals are those of the specification (PNNL-32278, September 2023)."""

from fmus.regfm_a1.droops import SPECIFICATION, active_droop, internal_voltage
from fmus.toolchain.blocks import low_pass
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import DevicePort, device_port
from fmus.toolchain.symbols import Expr, fmax, sqrt
from fmus.toolchain.variables import usual_beside

S_N, P_0 = 1500.0, 0.9
"""Default rating [MVA] and dispatch [pu]: those of the two-area system's converter, whose place it can take."""
USUAL = usual_beside(__file__)


def regfm_a1_phasor() -> Model:
    """The droop-controlled grid-forming inverter of the WECC, phasor type."""
    m = phasor_builder(
        "regfm_a1_phasor",
        "Droop-controlled grid-forming inverter REGFM_A1 of the WECC (phasor type)",
        kind="converter",
        usual=USUAL,
    )
    port = device_port(m, S_n=S_N, P_0=P_0)
    RL = m.parameter("RL", 0.0, "pu", "Coupling resistance", base="S_n", minimum=0, source="chosen here")
    XL = m.parameter("XL", 0.15, "pu", "Coupling reactance", base="S_n", minimum=0.01, source=SPECIFICATION)
    Z = Phasor(RL, XL)
    e_0 = port.v_0 + Z * port.i_0
    delta = m.state("delta_droop", e_0.angle(), "rad", "Angle of the internal voltage in the network frame")

    v = port.v.rotated(-delta)
    P, Q = m.algebraic("P"), m.algebraic("Q")
    Pf, Qf, Vf = _declare_measurement(m, port, P, Q, v)
    omega = active_droop(m, power(port.v_0, port.i_0).re, Pf)
    m.derivative(delta, port.omega_b * (omega - 1))
    E_droop = internal_voltage(m, port.v_0.magnitude(), e_0.magnitude(), power(port.v_0, port.i_0).im, Qf, Vf)
    inside = Phasor(E_droop, 0)
    limited, share = _limited(m, port, inside, v, Z, e_0)

    i = (limited - v) / Z * port.connected
    s = power(v, i)
    m.close(P, s.re)
    m.close(Q, s.im)
    start = Phasor(e_0.magnitude(), 0)
    declare_phasor_outputs(m, port, source_emf(m, limited, start, delta, port.omega_b * (omega - 1)), Z)
    m.output("omega", omega, "pu", "Frequency of the internal voltage", base="f_n")
    m.output("E_droop", E_droop, "pu", "Magnitude of the internal voltage before the fault current limit", base="S_n")
    m.output("V", v.magnitude(), "pu", "Voltage magnitude at the terminal", base="bus")
    m.output("I", i.magnitude(), "pu", "Magnitude of the current", base="S_n")
    m.output("fault_current", share, "1", "Current without the fault current limit, in parts of it; above 1 it acts")
    return m.build()


def _declare_measurement(m: ModelBuilder, port: DevicePort, P: Expr, Q: Expr, v: Phasor) -> tuple[Expr, Expr, Expr]:
    """P, Q [pu, S_n] and V [pu] at the terminal, each through its own lag."""
    s_0 = power(port.v_0, port.i_0)
    lags = {"P": (P, s_0.re), "Q": (Q, s_0.im), "V": (v.magnitude(), port.v_0.magnitude())}
    found = []
    for name, (signal, start) in lags.items():
        T = m.parameter(
            f"T{name}f", 0.01, "s", f"Lag of the measurement of {name}", minimum=1e-3, source=SPECIFICATION
        )  # fmt: skip
        found.append(low_pass(m, f"{name}f", Expr(signal), T, start))
    return found[0], found[1], found[2]


def _limited(
    m: ModelBuilder, port: DevicePort, inside: Phasor, v: Phasor, Z: Phasor, e_0: Phasor
) -> tuple[Phasor, Expr]:
    """The internal voltage that keeps the current within ImaxF, and the current without it in parts of ImaxF.

    The specification takes the terminal voltage of the same instant. A port whose emf follows from states alone needs a
    measured one: while the limit acts, the current is limited after that lag."""
    ImaxF = m.parameter("ImaxF", 2.0, "pu", "Largest current in a fault", base="S_n", minimum=0.1, source=SPECIFICATION)
    T = m.parameter("TIf", 0.002, "s", "Lag of the terminal voltage that the fault current limit sees", minimum=1e-3,
                    source="chosen here; none in the specification")  # fmt: skip
    m.require(ImaxF - port.i_0.magnitude(), "the power flow asks for more current than ImaxF: lower P_0, or raise S_n")
    start = port.v_0.rotated(-e_0.angle())
    seen = Phasor(low_pass(m, "V_seen_re", Expr(v.re), T, start.re), low_pass(m, "V_seen_im", Expr(v.im), T, start.im))
    current = (inside - seen) / Z
    square = (current.re**2 + current.im**2) / ImaxF**2
    scale = 1 / sqrt(fmax(1, square))
    # Exactly the internal voltage where the limit does not act.
    return inside + Z * current * (scale - 1), sqrt(square)
