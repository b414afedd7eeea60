"""The same converter with three instantaneous phase voltages in, three phase currents out, in SI units: for EMT tools.

The network frame stands at the angle φ = φ_0 + ω_b·t. A master holds inputs during a communication step H. If only the
phase voltages were held, the voltage would stand still while the frame turns on, and would lag by ω_b·H/2 on average.
Therefore φ is held as well. This holds the voltage's phasor in the network frame at its value of the communication
point, exactly as in the variant with v_re and v_im."""

from dataclasses import replace

from fmus.toolchain import port_variables
from fmus.toolchain.frames import of_phases, phases, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import declare_rating, port_at
from fmus.toolchain.symbols import sqrt
from gfor_fmu.converter import P_0, S_N, declare_converter, declare_converter_outputs
from gfor_fmu.usual_ranges import FORMING

V_N = 230.0  # default rated voltage [kV, line to line, rms]


def grid_forming_converter_abc() -> Model:
    """The converter of `grid_forming_converter` behind a three-phase port in volts and amperes."""
    title = "Grid-forming converter with instantaneous phase voltages and currents (EMT-type)"
    m = ModelBuilder("gfor_abc", title, kind="converter", usual=FORMING)
    rating = declare_rating(m, S_N)
    V_n = m.declare(replace(port_variables.V_N, start=V_N))
    angle_0 = m.parameter(
        "angle_0",
        0.0,
        "rad",
        "Angle of the network frame at the start; phase a is v·cos(angle_0 + theta_0) there",
    )
    # Of phase quantities: 1 pu is the amplitude of the rated phase voltage, and the current that gives S_n with it.
    volt, ampere = V_n * 1e3 * sqrt(2 / 3), rating / V_n * 1e3 * sqrt(2 / 3)
    peak = V_N * 1e3 * (2 / 3) ** 0.5
    v_a = m.input("v_a", "V", "Instantaneous voltage of phase a to neutral at the bus", start=peak)
    v_b = m.input(
        "v_b", "V", "Instantaneous voltage of phase b to neutral at the bus", start=-peak / 2
    )
    v_c = m.input(
        "v_c", "V", "Instantaneous voltage of phase c to neutral at the bus", start=-peak / 2
    )
    angle = m.state(
        "frame.angle", angle_0, "rad", "Angle of the network frame, φ_0 + ω_b·t", stepwise=True
    )

    port = port_at(m, of_phases((v_a, v_b, v_c), angle) / volt, P_0, ampere)
    m.derivative(angle, port.omega_b)
    converter = declare_converter(m, port, of_phases=True)

    for name, current in zip(
        "abc", phases(converter.current * port.current_scale, angle), strict=True
    ):
        m.output(f"i_{name}", current, "A", f"Instantaneous current of phase {name} into the bus")
    s = power(port.v, converter.current) * rating
    m.output("p", s.re, "MW", "Active power into the bus")
    m.output("q", s.im, "Mvar", "Reactive power into the bus")
    declare_converter_outputs(m, converter)
    return m.build()
