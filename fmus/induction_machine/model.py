"""Induction machines, phasor type: a motor as a load, and a generator, started at its power of the power flow.

What the power flow's reactive power has more or less than the machine's is a susceptance beside it, as in PSS/E."""

from dataclasses import replace

from fmus.induction_machine.circuit import Circuit, declare_circuit
from fmus.induction_machine.load_torque import LEAST_SPEED, load_torque
from fmus.induction_machine.reactances import GENERATOR, declare_by_reactances
from fmus.induction_machine.relay import undervoltage_relay
from fmus.induction_machine.start import Start, find_start
from fmus.toolchain.blocks import BYPASS_TIME, held_at_limits
from fmus.toolchain.frames import Phasor, phasor_derivative, phasor_state, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import declare_phasor_outputs, phasor_builder, source_emf
from fmus.toolchain.port import DevicePort, declare_rating, device_port_of
from fmus.toolchain.symbols import Expr, fmax, if_else
from fmus.toolchain.variables import usual_beside

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = -0.8  # default power into the bus [pu, S_n]: a motor at four fifths of its rating
MOST_POWER = 10.0  # of the operating point [pu, S_n]: beside a small motor a load may draw much reactive power
MOST_SPEED = 10.0  # [pu]: far above what any machine reaches
USUAL = usual_beside(__file__)


def induction_motor_phasor() -> Model:
    """PSS/E's CIM5, CIM6 and CIMW: an induction motor with one cage or two, and its load's torque."""
    title = "Induction motor of one cage or two, as a load (phasor type)"
    m = phasor_builder("induction_motor_phasor", title, kind="load", usual=USUAL)
    port = device_port_of(m, declare_rating(m, S_N), P_0, MOST_POWER)
    circuit = declare_circuit(m)
    start = find_start(m, circuit, port)
    closed = undervoltage_relay(m, port.v.magnitude(), port.omega_b)
    port = replace(port, connected=port.connected * closed)
    w, torque = _rotor(m, circuit, start, port)
    T_L = load_torque(m, w, 1 - start.slip, start.torque)
    H = m.parameter(
        "H", 0.5, "s", "Inertia constant of motor and load, on S_n", minimum=1e-3, source=_INERTIA
    )
    m.derivative(w, held_at_limits(w, (torque - T_L) / (2 * H), 0.0, MOST_SPEED))
    _declare_outputs(m, w, torque)
    m.output("T_L", T_L, "pu", "Torque of the load", base="S_n")
    return m.build()


def induction_generator_phasor() -> Model:
    """PSS/E's CIMTR1 to CIMTR4: an induction machine as a generator of the network, by its reactances."""
    title = "Induction machine by its reactances, as a generator or a motor (phasor type)"
    m = phasor_builder("induction_generator_phasor", title, kind="machine")
    port = device_port_of(m, declare_rating(m, S_N), -P_0, MOST_POWER)
    circuit = declare_by_reactances(m, port.omega_b)
    start = find_start(m, circuit, port)
    w, torque = _rotor(m, circuit, start, port)
    text = "Power of the speed with which the mechanical torque goes; -1: its power is constant"
    E = m.parameter("E", -1.0, "1", text, source=GENERATOR)
    driving = start.torque * (fmax(w, LEAST_SPEED) / (1 - start.slip)) ** E
    text = "Inertia constant, on S_n"
    H = m.parameter("H", 1.5, "s", text, minimum=1e-3, source=GENERATOR)
    m.derivative(w, held_at_limits(w, (torque - driving) / (2 * H), 0.0, MOST_SPEED))
    _declare_outputs(m, w, torque)
    return m.build()


_INERTIA = "WECC's composite load model, motor B"


def _declare_outputs(m: ModelBuilder, w: Expr, torque: Expr) -> None:
    m.output("speed", w, "pu", "Speed; it is no synchronous one", base="f_n")
    m.output("T_e", torque, "pu", "Electrical torque of a motor", base="S_n")


def _rotor(m: ModelBuilder, circuit: Circuit, start: Start, port: DevicePort) -> tuple[Expr, Expr]:
    """Declare the cages and the port; return the speed, a state without its rate, and the torque [pu]."""
    w = m.state("w", 1 - start.slip, "pu", "Speed of the rotor", base="f_n")
    psi_1, psi_2 = (
        phasor_state(m, f"psi_{k}", flux, f"Flux linkage of cage {k}, network frame", "S_n")
        for k, flux in enumerate(start.fluxes, 1)
    )
    emf = circuit.emf((psi_1, psi_2))
    y = Phasor(1.0, 0.0) / circuit.subtransient
    stator = (port.v - emf) * y * port.connected
    i_1, i_2 = circuit.cage_currents((psi_1, psi_2), stator)
    for k, (psi, i) in enumerate(((psi_1, i_1), (psi_2, i_2))):
        turning = (psi * (1 - w)).times_j()
        rate = (i * circuit.cages.resistances[k] - turning) * port.omega_b
        if k:
            there = circuit.cages.has_second
            rate = Phasor(
                if_else(there, rate.re, -Expr(psi.re) / BYPASS_TIME),
                if_else(there, rate.im, -Expr(psi.im) / BYPASS_TIME),
            )
        phasor_derivative(m, psi, rate)
    Z = Phasor(1.0, 0.0) / (y + Phasor(0.0, start.shunt))
    share = y * Z
    source = source_emf(m, emf * share, start.emf * share, Expr(0.0), Expr(0.0))
    declare_phasor_outputs(m, port, source, Z)
    return w, Expr(power(emf, stator).re)
