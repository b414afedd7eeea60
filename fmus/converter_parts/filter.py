"""Electrical side of a converter: LC filter and step-up transformer, in the converter's frame.

Everything is complex, f = f_q − j·f_d, per unit on the rating S_n; w is the converter's frequency [pu]."""

from dataclasses import dataclass

from fmus.toolchain.frames import ZERO, Phasor, QdState, power, qd_state
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import BREAKER_TIME, DevicePort, OperatingPoint
from fmus.toolchain.symbols import Expr

APPENDIX = "Mateu-Barriendos et al. 2024, appendix, grid-forming converter parameters"
STAMP = "STAMP toolbox of the paper's group"
LEAST_REACTANCE = 0.01  # of filter and transformer, where the internal step is the usual one [pu]


@dataclass(frozen=True)
class SteadyState:
    """The operating point of the electrical side, in the converter's frame, from the power flow.

    ``u`` is across the capacitor branch; ``drop`` the voltage over a virtual impedance, behind which the frame lies."""

    theta: Expr
    u: Phasor
    i_s: Phasor
    i_g: Phasor
    v_c: Phasor
    s: Phasor
    drop: Phasor = ZERO


@dataclass(frozen=True)
class FilterData:
    """Parameters of the electrical side [pu, S_n], and its operating point."""

    R_c: Expr
    X_c: Expr
    B_c: Expr
    R_t: Expr
    X_t: Expr
    R_cap: Expr
    initial: SteadyState


@dataclass(frozen=True)
class MeasuredFilter(FilterData):
    """The filter as its control sees it: all that the control needs to know of the circuit.

    ``u`` is the voltage across the capacitor branch, the one that is controlled and measured."""

    i_s: QdState
    i_g: QdState
    u: Phasor


@dataclass(frozen=True)
class Filter(MeasuredFilter):
    """The filter with all its states."""

    u_c: QdState


def declare_filter_data(
    m: ModelBuilder, port: OperatingPoint, virtual: Phasor = ZERO, *, least: float = LEAST_REACTANCE
) -> FilterData:
    """Declare parameters alone; the power flow gives the operating point.

    ``virtual``: impedance in the control between the frame's own voltage and the capacitor [pu, S_n]; ``least``:
    reactance of the inductors that is taken [pu, S_n]."""
    with m.scope("filter"):
        R_c = m.parameter(
            "R_c", 0.005, "pu", "Inductor resistance", base="S_n", minimum=0.0, source=APPENDIX
        )
        X_c = m.parameter(
            "X_c", 0.15, "pu", "Inductor reactance", base="S_n", minimum=least, source=APPENDIX
        )
        B_c = m.parameter(
            "B_c", 0.15, "pu", "Capacitor susceptance", base="S_n", minimum=0.01, source=APPENDIX
        )
    with m.scope("transformer"):
        R_t = m.parameter("R_t", 0.002, "pu", "Resistance", base="S_n", minimum=0.0, source=STAMP)
        X_t = m.parameter(
            "X_t", 0.15, "pu", "Reactance", base="S_n", minimum=least, source="paper, case study 1"
        )

    # In series with the capacitor, 1/(3·10·ω_b·C_c) as the paper has it: the factor 3·10 is dimensionless.
    R_cap = 1 / (30 * B_c)
    given = port, Phasor(R_c, X_c), Phasor(R_t, X_t), B_c, R_cap
    return FilterData(
        R_c=R_c,
        X_c=X_c,
        B_c=B_c,
        R_t=R_t,
        X_t=X_t,
        R_cap=R_cap,
        initial=_steady_state(*given, virtual),
    )


def declare_filter(
    m: ModelBuilder, port: DevicePort, virtual: Phasor = ZERO, *, least: float = LEAST_REACTANCE
) -> Filter:
    """Declare parameters and states; the equations follow once the control has formed v_c."""
    data = declare_filter_data(m, port, virtual, least=least)
    start = data.initial
    u_c_start = start.u - (start.i_s - start.i_g) * data.R_cap
    with m.scope("filter"):
        i_s = qd_state(m, "i_s", start.i_s, "Current of the converter-side inductor")
        u_c = qd_state(m, "u_c", u_c_start, "Capacitor voltage")
    with m.scope("transformer"):
        i_g = qd_state(m, "i_g", start.i_g, "Current into the grid")
    u = u_c.value + data.R_cap * (i_s.value - i_g.value)
    return Filter(
        R_c=data.R_c,
        X_c=data.X_c,
        B_c=data.B_c,
        R_t=data.R_t,
        X_t=data.X_t,
        R_cap=data.R_cap,
        initial=start,
        i_s=i_s,
        u_c=u_c,
        i_g=i_g,
        u=u,
    )


def filter_equations(
    m: ModelBuilder, f: Filter, port: DevicePort, v_c: Phasor, theta: Expr, w: Expr
) -> None:
    """Voltage over each inductor and current into the capacitor.

    ``port``: the port, which gives the bus voltage and the breaker's position; ``v_c``: the converter's own voltage, in
    its own frame [pu, S_n]; ``theta``: angle of that frame in the network frame [rad]; ``w``: frequency of the
    converter [pu, f_n]."""
    v_bus = port.v.rotated(-theta)
    i_s, u_c, i_g = f.i_s.value, f.u_c.value, f.i_g.value
    f.i_s.set_derivative(m, (v_c - f.u - Phasor(f.R_c, w * f.X_c) * i_s) * (port.omega_b / f.X_c))
    f.u_c.set_derivative(m, (i_s - i_g - Phasor(0, w * f.B_c) * u_c) * (port.omega_b / f.B_c))
    into_grid = (f.u - v_bus - Phasor(f.R_t, w * f.X_t) * i_g) * (port.omega_b / f.X_t)
    f.i_g.set_derivative(m, port.through_breaker(into_grid, i_g * (-1 / BREAKER_TIME)))


def _steady_state(
    port: OperatingPoint, Z_c: Phasor, Z_t: Phasor, B_c: Expr, R_cap: Expr, virtual: Phasor
) -> SteadyState:
    own = port.v_0 + (Z_t + virtual) * port.i_0
    theta = own.angle()
    i_g = port.i_0.rotated(-theta)
    drop = virtual * i_g
    u = Phasor(own.magnitude(), 0) - drop
    u_c = u / Phasor(1, R_cap * B_c)
    i_s = i_g + Phasor(0, B_c) * u_c
    v_c = u + Z_c * i_s
    return SteadyState(theta=theta, u=u, i_s=i_s, i_g=i_g, v_c=v_c, s=power(u, i_g), drop=drop)
