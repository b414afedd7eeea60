"""The grid-forming converter: electrical side, inner loops, droops and both POD controllers put together."""

from fmus.toolchain.frames import power
from fmus.toolchain.model import Model, ModelBuilder
from fmus.toolchain.port import declare_port_outputs, device_port
from gfor_fmu.droop import declare_droop, frequency, voltage_reference
from gfor_fmu.filter import declare_filter, filter_equations
from gfor_fmu.inner_loops import inner_loops
from gfor_fmu.pod import pod


def grid_forming_converter() -> Model:
    """Average EMT-type model of a droop-controlled grid-forming converter, stiff DC side (the paper's Fig. 1)."""
    m = ModelBuilder("gfor", "Grid-forming converter with P-f and Q-V droop, POD-P and POD-Q (EMT-type average model)")
    port = device_port(m, S_n=1500.0, P_0=0.9)
    electrical = declare_filter(m, port)
    droop = declare_droop(m, electrical.initial, power(electrical.u, electrical.i_g.value))

    # The POD acts on the frequency that its own output changes. Only states lie between them (T_f),
    # so each controller can be given the deviation symbolically: first w as a function of ΔP, then ΔP.
    omega = m.algebraic("w")
    delta_p = pod(m, "pod_p", omega - 1, sign=-1, T_S1=0.20, T_S2=0.37)
    delta_q = pod(m, "pod_q", omega - 1, sign=+1, T_S1=0.26, T_S2=0.29)
    m.close(omega, frequency(droop, delta_p))
    m.derivative(droop.theta, port.omega_b * (omega - 1))

    v_c = inner_loops(m, electrical, port.omega_b, omega, voltage_reference(droop, delta_q))
    filter_equations(m, electrical, port, v_c, droop.theta, omega)

    declare_port_outputs(m, port, electrical.i_g.value.rotated(droop.theta))
    m.output("omega", omega, "pu", "Frequency imposed by the converter", base="f_n")
    m.output("delta_p_pod", delta_p, "pu", "Supplementary active-power reference of POD-P", base="S_n")
    m.output("delta_q_pod", delta_q, "pu", "Supplementary reactive-power reference of POD-Q", base="S_n")
    m.output("u", electrical.u.magnitude(), "pu", "Voltage magnitude at the filter capacitor", base="S_n")
    m.output("i_s", electrical.i_s.value.magnitude(), "pu", "Current magnitude in the converter", base="S_n")
    return m.build()
