"""PSS/E's CSTATT, and CSTCNT of a FACTS device: a static condenser (STATCOM), a voltage behind a reactance.

    V_ref − v − DROOP·I → (1+sT_1)(1+sT_2)/((1+sT_3)(1+sT_4)) → within V_MIN and V_MAX → K/s, within limits → E
    I = (E − v)/X_t        [pu, S_n; above 0 capacitive]
    limits of E: v − X_t·I_L, and the lower of v + X_t·I_C and E_LIMIT
    I_C, I_L: I_CMAX and I_LMAX, times v/V_CUTOFF if v < V_CUTOFF

E has the phase of the bus voltage, so that no active power is fed. At the start E follows from the reactive power of
the power flow, and V_ref from its current.

Sources: PowerWorld's guide to PSS/E's models, the diagram and the fields of CSTATT; OPAL-RT's
ephasorsim-modelica-library at cba975b for CSTCNT, its equations, the order of its fields and the defaults: it lets the
inductive current fall below V_CUTOFF as the capacitive one does. S_n as the base of DROOP is ours, as it is that of
X_t."""

from fmus.converter_parts.bus_voltage import extrapolated_voltage
from fmus.static_var.held_bus import (
    HeldVoltage,
    held_voltage,
    holds_elsewhere,
    named_by_bus,
)
from fmus.static_var.susceptance import MOST_POWER
from fmus.toolchain.blocks import clamp, held_at_limits, lead_lag, reached
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import (
    SourceEmf,
    declare_master_step,
    declare_phasor_outputs,
    phasor_builder,
)
from fmus.toolchain.port import DevicePort, declare_rating, device_port_of
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else

SOURCE = "OPAL-RT's list of CSTCNT"

S_N = 100.0
"""Default rating [MVA]."""

LEAST_VOLTAGE = 1e-3
"""Voltage below which the phase of the emf is not known, and its current falls with it [pu]."""


def cstatt_phasor(records: str = "CSTATT") -> Model:
    """The static condenser, phasor type.

    Parameters
    ----------
    records
        PSS/E's name of its record, CSTATT or CSTCNT; behind it the word ``elsewhere`` if it holds another bus' voltage.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    elsewhere = holds_elsewhere(records, ("CSTATT", "CSTCNT"))
    title = "Static condenser CSTATT of PSS/E (phasor type)"
    m = phasor_builder("cstatt_phasor", title, kind="load")
    rating = declare_rating(m, S_N)
    port = device_port_of(m, rating, P_0=0.0)
    text = "Reactance between emf and bus, the transformer's"
    X = m.parameter("Xt", 0.1, "pu", text, base="S_n", minimum=0.01, source=SOURCE)
    R = m.parameter("R", 0.0, "pu", "Resistance of the port", base="S_n", minimum=0.0)
    Z = Phasor(R, X)
    master = declare_master_step(m)
    seen = extrapolated_voltage(m, port, master)
    seen.follow(m, port.v)
    size = seen.value.magnitude()
    held = held_voltage(m, port, seen, elsewhere=elsewhere)
    E = _emf(m, port, size, held, X)

    def emf(time: Expr) -> Phasor:
        v = seen.after(time)
        direction = (1 / fmax(v.magnitude(), LEAST_VOLTAGE)) * v
        return v + Z * Phasor(0.0, (v.magnitude() - E) / X) * direction

    source = SourceEmf(behind=emf(-master.size / 2), ahead=emf(master.to_next))
    declare_phasor_outputs(m, port, source, Z)
    m.output("I", (E - size) / X, "pu", "Current; above 0 capacitive", base="S_n")
    return named_by_bus(m.build(), elsewhere=elsewhere)


def _emf(m: ModelBuilder, port: DevicePort, size: Expr, held: HeldVoltage, X: Expr) -> Expr:
    """Declare the regulator; return the size of the emf [pu].

    ``size``: measured voltage of the own bus [pu]; ``held``: of the bus that is held; ``X``: reactance between emf and
    own bus [pu, S_n]."""

    def seconds(name: str, start: float, text: str) -> Expr:
        return m.parameter(name, start, "s", text, minimum=0, source=SOURCE)

    def number(name: str, start: float, text: str, base: str, least: float | None = None) -> Expr:
        return m.parameter(name, start, "pu", text, base=base, minimum=least, source=SOURCE)

    leads = seconds("T1", 0.1, "Lead"), seconds("T2", 0.2, "Second lead")
    lags = (
        seconds("T3", 0.3, "Lag; 0 leaves the stage out"),
        seconds("T4", 0.4, "Second lag; 0 leaves the stage out"),
    )
    K = m.parameter("K", 40.0, "1/s", "Gain of the integrator", minimum=0, source=SOURCE)
    droop = number("DROOP", 0.025, "Voltage by which the current lowers the reference", "S_n", 0)
    V_MAX = number("VMAX", 999.0, "Upper limit of the regulator", "bus")
    V_MIN = number("VMIN", -999.0, "Lower limit of the regulator", "bus")
    I_C = number("ICMAX", 1.25, "Largest capacitive current", "S_n", 0)
    I_L = number("ILMAX", 1.25, "Largest inductive current", "S_n", 0)
    cutoff = number("VCUTOFF", 0.2, "Voltage below which both currents fall with it", "bus", 0)
    E_LIMIT = number("ELIMIT", 1.2, "Largest emf", "bus", 0)

    s_0, size_0 = power(port.v_0, port.i_0), port.v_0.magnitude()
    m.require(MOST_POWER - fabs(s_0.re), "P_0: a static condenser feeds no active power")
    I_0 = s_0.im / size_0
    E_0 = size_0 + X * I_0
    text = "the power flow's reactive power asks for more than"
    m.require(I_C - I_0 + MOST_POWER, f"{text} ICMAX: lower Q_0, or raise ICMAX")
    m.require(I_0 + I_L + MOST_POWER, f"{text} ILMAX: raise Q_0, or raise ILMAX")
    m.require(E_LIMIT - E_0 + MOST_POWER, f"{text} ELIMIT: lower Q_0, or raise ELIMIT")
    text = "VMIN to VMAX, the limits of the regulator's error, do not hold the 0 of a steady state"
    m.require(fmin(V_MAX, -V_MIN), f"{text}: raise VMAX above 0, or lower VMIN below it")
    reference = m.calculated(
        "Vref", held.start + droop * I_0, "pu", "Voltage reference", base="bus"
    )
    E = m.state("emf", E_0, "pu", "integrator with limits, the emf", base="bus")
    share = if_else(size < cutoff, size / fmax(cutoff, LEAST_VOLTAGE), 1)
    high = fmin(size + X * I_C * share, E_LIMIT)
    low = fmin(size - X * I_L * share, high)
    error = reference - held.now - droop * (reached(E, low, high) - size) / X
    first = lead_lag(m, "first", error, leads[0], lags[0])
    second = lead_lag(m, "second", first, leads[1], lags[1])
    m.derivative(E, held_at_limits(E, K * clamp(second, V_MIN, V_MAX), low, high))
    return clamp(E, low, high)
