"""The controller of a plant of several units, and the part of it at each unit: REPC_B, in PSS/E's files PLNTBU1 with
REAX3BU1 or REAX4BU1.

    PLNTBU1:  as REPCA1, with outputs that are changes of references, from 0 on; RefFlag 2: P·tan φ_0 − Q is the error
    REAX:     change of the plant [pu, system] → pu of S_n → Kw (reactive), Kz (active) → 1/(1 + s·Tw) within limits
              → added to the reference of the unit's control

One controller has one integrator of each kind for all units: copies of it would share the plant's power in any ratio.

Sources: WECC's REPC_B as PowerWorld's help lists it; fields, states and bases as InterPSS' `Plntbu1Model` and
`Reaxbu1Model` have them."""

from math import pi

from fmus.converter_parts.bus_voltage import extrapolated_voltage, frequency_of
from fmus.synchronous_generator.data_lines import Line, declared, number, power, seconds
from fmus.toolchain import port_variables
from fmus.toolchain.blocks import clamp, held_at_limits
from fmus.toolchain.frames import Phasor, polar
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_master_step, phasor_builder
from fmus.toolchain.port import OperatingPoint, declare_rating
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr, fabs, fmax, fmin, if_else, logic_and
from fmus.wecc_renewable.plant import (
    LEAST_LAG,
    LINES,
    Limits,
    active_control,
    droop,
    measured_branch,
    reactive_control,
    regulated_voltage,
)
from fmus.wecc_renewable.signals import SOURCE, References

S_N = 100.0  # default base of the plant's data [MVA]: that of networks

LEAST_POWER = 1e-3
"""Active power [pu, S_n] at the measured point below which there is no power factor to hold."""

AT_A_UNIT: tuple[Line, ...] = (
    seconds("Tw", 0.02, "Lag of both changes; 1 ms at least"),
    number("Kw", 1.0, "Weight of the change of reactive power or voltage"),
    number("Kz", 1.0, "Weight of the change of active power"),
    power("Qmax", 0.43, "Most change of the reference of reactive power or voltage"),
    power("Qmin", -0.43, "Least change of it"),
    power("Pmax", 1.0, "Most change of the reference of active power"),
    power("Pmin", -1.0, "Least change of it"),
)


def plant_controller_phasor() -> Model:
    """PLNTBU1: the controller of a plant of several units; it feeds nothing itself."""
    m = phasor_builder("plant_controller_phasor", "Controller of several units, PLNTBU1")
    rating = declare_rating(m, S_N)
    scale = rating / m.declare(port_variables.S_BASE)
    f_n = m.declare(port_variables.F_N)
    v_0, theta_0 = m.declare(port_variables.V_0), m.declare(port_variables.THETA_0)
    v = Phasor(m.declare(port_variables.V_RE), m.declare(port_variables.V_IM))
    at = OperatingPoint(polar(v_0, theta_0), Phasor(0.0, 0.0), 2 * pi * f_n)
    seen = extrapolated_voltage(m, at, declare_master_step(m))
    seen.follow(m, v)
    t = measured_branch(m, v.magnitude(), v_0, scale)
    compensates = m.switch("VCFlag", False, "Rc and Xc compensate; else Kc")
    mode = m.parameter(
        "RefFlag",
        0,
        "1",
        "0: the reactive power is controlled; 1: the voltage; 2: the power factor",
        minimum=0,
        maximum=2,
        type="Integer",
    )
    in_use = m.switch("Fflag", False, "Active power is controlled, with frequency; else not")
    p = declared(m, LINES, SOURCE, {"Pmin": -1.0})
    change_Q, change_V, change_P = (
        m.parameter(f"delta_{name}", 0, "pu", f"Change of {name}", base=base, tunable=True)
        for name, base in (("Qref", "S_n"), ("Vref", "bus"), ("Pref", "S_n"))
    )
    regulated, regulated_0 = (
        regulated_voltage(p, compensates, *point)
        for point in ((t.v, t.P, t.Q), (Expr(t.v_0), t.P_0, t.Q_0))
    )
    V = t.filter(m, "V_filtered", regulated, p.Tfltr, initial=regulated_0)
    Q = t.filter(m, "Q_filtered", t.Q, p.Tfltr, initial=t.Q_0)
    P = t.filter(m, "P_filtered", t.P, p.Tp, initial=t.P_0)
    of_voltage, of_factor = logic_and(mode > 0.5, mode < 1.5), mode > 1.5
    text = "RefFlag = 2 holds a power factor, and p_0 is 0: measure another branch, or take 0 or 1"
    m.require(if_else(of_factor, fabs(Expr(t.P_0)) - LEAST_POWER, 1), text)
    held = if_else(of_factor, t.Q_0 / if_else(of_factor, t.P_0, 1) * P, t.Q_0)
    wanted = held + change_Q
    error = if_else(of_voltage, regulated_0 + change_V - V, wanted - Q)
    reactive = reactive_control(m, p, error, _around_0(p.Qmin, p.Qmax), t.v < p.Vfrz, initial=0.0)
    of_frequency = droop(p, 1 - frequency_of(m, seen, at.omega_b, p.T_f))
    power_error = t.P_0 + change_P - P + of_frequency
    active = active_control(m, p, power_error, _around_0(p.Pmin, p.Pmax), in_use, initial=0.0)
    changes = {"P": in_use * active, "Q": reactive}
    for name, what in (("P", "active power"), ("Q", "reactive power, or of voltage")):
        text = f"Change of the units' references of {what}"
        m.output(f"delta_{name}", changes[name] * scale, "pu", text, base=SYSTEM_BASE)
    return m.build()


def _around_0(low: Expr, high: Expr) -> Limits:
    """Limits of a change, which starts at 0; as in PowerWorld, 0 lies within them."""
    return Limits(fmin(low, 0), fmax(high, 0))


def references_by_plant(m: ModelBuilder, scale: Expr, start: References) -> References:
    """Declare REAX3BU1 or REAX4BU1 in the current scope; return the references with the plant's changes.

    ``scale``: S_n by the base of the system; ``start``: references of the operating point."""
    p = declared(m, AT_A_UNIT, "chosen here")
    changed = {}
    for name, weight, limits in (
        ("P", p.Kz, _around_0(p.Pmin, p.Pmax)),
        ("Q", p.Kw, _around_0(p.Qmin, p.Qmax)),
    ):
        text = f"Change of {name}'s reference that the plant's controller asks for"
        asked = weight / scale * m.input(f"delta_{name}", "pu", text, base=SYSTEM_BASE)
        x = m.state(f"of_plant_{name}", 0.0, "pu", "first-order lag with limits", base="S_n")
        rate = (asked - x) / fmax(p.Tw, LEAST_LAG)
        m.derivative(x, held_at_limits(x, rate, limits.low, limits.high))
        own = m.parameter(
            f"delta_{name}ref", 0, "pu", f"Change of {name}ref", base="S_n", tunable=True
        )
        changed[name] = clamp(x, limits.low, limits.high) + own
    return References(start.P + changed["P"], start.Q + changed["Q"])
