"""Outer control: P-f droop, which synchronises the converter, and Q-V droop, which sets its voltage."""

from dataclasses import dataclass

from fmus.converter_parts.filter import APPENDIX, SteadyState
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


@dataclass(frozen=True)
class Droop:
    """Measured powers and set-points.

    ``p_f`` and ``q_f`` are states, so the frequency that they give has no direct feed-through."""

    R_f: Expr
    R_V: Expr
    P_ref: Expr
    Q_ref: Expr
    U_ref: Expr
    p_f: Expr
    q_f: Expr
    theta: Expr


def declare_droop(m: ModelBuilder, start: SteadyState, measured: Phasor) -> Droop:
    """Declare both droops with their measuring lags; ``measured`` is P + jQ at the filter capacitor."""
    with m.scope("droop"):
        R_f = m.parameter(
            "R_f", 0.05, "pu", "P-f droop", base="S_n", minimum=0, tunable=True, source=APPENDIX
        )
        R_V = m.parameter(
            "R_V", 0.067, "pu", "Q-V droop", base="S_n", minimum=0, tunable=True, source=APPENDIX
        )
        tau_P = m.parameter(
            "tau_P", 0.1, "s", "Lag of the P measurement", minimum=1e-3, source=APPENDIX
        )
        tau_Q = m.parameter(
            "tau_Q", 0.1, "s", "Lag of the Q measurement", minimum=1e-3, source=APPENDIX
        )
        delta_P = m.parameter(
            "delta_P_ref", 0, "pu", "Change of the P reference", base="S_n", tunable=True
        )
        delta_Q = m.parameter(
            "delta_Q_ref", 0, "pu", "Change of the Q reference", base="S_n", tunable=True
        )
        delta_U = m.parameter(
            "delta_U_ref", 0, "pu", "Change of the voltage reference", base="S_n", tunable=True
        )
        P_0 = m.calculated(
            "P_ref", start.s.re, "pu", "Active-power reference of the operating point", base="S_n"
        )
        Q_0 = m.calculated(
            "Q_ref", start.s.im, "pu", "Reactive-power reference of the operating point", base="S_n"
        )
        U_0 = m.calculated(
            "U_ref",
            start.u.re + start.drop.re,
            "pu",
            "Voltage reference of the operating point",
            base="S_n",
        )
        p_f = m.state("P_f", P_0, "pu", "Measured active power", base="S_n")
        q_f = m.state("Q_f", Q_0, "pu", "Measured reactive power", base="S_n")
        theta = m.state(
            "theta", start.theta, "rad", "Angle of the converter's frame in the network frame"
        )
        m.derivative(p_f, (measured.re - p_f) / tau_P)
        m.derivative(q_f, (measured.im - q_f) / tau_Q)
    return Droop(
        R_f=R_f,
        R_V=R_V,
        P_ref=P_0 + delta_P,
        Q_ref=Q_0 + delta_Q,
        U_ref=U_0 + delta_U,
        p_f=p_f,
        q_f=q_f,
        theta=theta,
    )


def frequency(d: Droop, delta_p_pod: Expr) -> Expr:
    """Frequency w = 1 + R_f (P_ref + ΔP_POD − P_f)  [pu]."""
    return 1 + d.R_f * (d.P_ref + delta_p_pod - d.p_f)


def voltage_reference(d: Droop, delta_q_pod: Expr) -> Phasor:
    """Reference u_ref = U_0 + R_V (Q_ref + ΔQ_POD − Q_f) on the q axis, 0 on the d axis [pu]."""
    return Phasor(d.U_ref + d.R_V * (d.Q_ref + delta_q_pod - d.q_f), 0)
