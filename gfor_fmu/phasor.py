"""The converter without network transients, for RMS tools with steps of milliseconds: an emf behind the transformer.

Filter, inner loops, feed-forwards and transformer settle within a few milliseconds, and are algebraic here: the
voltage control holds u = u_ref − Z_v·i_g, so that the emf behind virtual impedance and transformer is u_ref·e^{jθ}, a
function of the droops' and the POD controllers' states alone. The current limit is not represented; ``current_limit``
shows when it would act."""

from fmus.converter_parts.filter import FilterData, declare_filter_data
from fmus.toolchain.frames import Phasor, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import device_port
from fmus.toolchain.symbols import Expr, fabs, fmax
from gfor_fmu.converter import P_0, S_N, Converter, declare_converter_outputs, outer_control
from gfor_fmu.current_limit import declare_box_limits
from gfor_fmu.droop import declare_droop
from gfor_fmu.usual_ranges import FORMING
from gfor_fmu.virtual_impedance import declare_virtual_impedance


def grid_forming_converter_phasor() -> Model:
    """Droops and POD controllers of `grid_forming_converter` behind an algebraic electrical side."""
    title = "Grid-forming converter with P-f and Q-V droop, POD-P and POD-Q (phasor type)"
    m = phasor_builder("gfor_phasor", title, kind="converter", usual=FORMING)
    port = device_port(m, S_n=S_N, P_0=P_0)
    virtual = declare_virtual_impedance(m)
    electrical = declare_filter_data(m, port, virtual.rated)
    P, Q = m.algebraic("P"), m.algebraic("Q")
    droop = declare_droop(m, electrical.initial, Phasor(P, Q))
    control = outer_control(m, droop, port.omega_b)

    impedance = Phasor(electrical.R_t, electrical.X_t) + virtual.rated

    i_g = (control.u_ref - port.v.rotated(-droop.theta)) / impedance * port.connected
    u = control.u_ref - virtual.rated * i_g
    s = power(u, i_g)
    m.close(P, s.re)
    m.close(Q, s.im)

    start = electrical.initial.u + electrical.initial.drop
    turning = port.omega_b * (control.omega - 1)
    emf = source_emf(m, control.u_ref, start, droop.theta, turning)
    declare_phasor_outputs(m, port, emf, impedance)
    i_s = i_g + _capacitor_current(electrical, u)
    declare_converter_outputs(
        m, Converter(i_g.rotated(droop.theta), control, u.magnitude(), i_s.magnitude())
    )
    text = "Current in parts of its limit; above 1 the current limit, which is not represented, would act"
    m.output("current_limit", _of_limit(m, electrical, i_s), "1", text)
    return m.build()


def _capacitor_current(f: FilterData, u: Phasor) -> Phasor:
    """Current into the capacitor with its series resistance, at rated frequency."""
    return Phasor(0.0, f.B_c) * u / Phasor(1.0, f.R_cap * f.B_c)


def _of_limit(m: ModelBuilder, f: FilterData, i_s: Phasor) -> Expr:
    with m.scope("voltage_control"):
        box = declare_box_limits(m, f.initial)
    return fmax(fabs(i_s.re) / box.i_q_max, fabs(i_s.im) / box.i_d_max)
