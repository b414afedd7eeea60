"""An EMT network in the frame that turns at ω_b: dynamic lines, loads, bus capacitances.

A bus with capacitance has its voltage as a state. A bus without capacitance has v = Σ i / G, directly from the currents
that the devices inject: the FMU has direct feed-through there, and declares it."""

from math import pi

from fmus.grid import elements
from fmus.grid.fault import declare_fault, declare_fault_outputs
from fmus.grid.load_laws import FollowingLoad, declare_following_load, following_load_equations
from fmus.grid.network import Network
from fmus.grid.three_winding import (
    declare_transformer,
    declare_winding_powers,
    transformer_equations,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr


def grid(network: Network) -> Model:
    """Build the model of a network; parameters are named after its elements (``X_<line>``, ``<load>.P``)."""
    m = ModelBuilder(
        network.name, f"EMT network {network.name} in the frame turning at ω_b", kind="network"
    )
    f_n = m.parameter("f_n", 50.0, "Hz", "Rated frequency", minimum=1.0, maximum=400.0)
    omega_b = 2 * pi * f_n
    buses = {bus: elements.declare_bus(m, bus) for bus in network.buses}
    fed = [elements.declare_port(m, port, buses) for port in network.ports]
    lines = [elements.declare_line(m, line, buses) for line in network.lines]
    transformers = [declare_transformer(m, data, buses) for data in network.transformers]
    others: list[elements.Branch] = []
    following: list[FollowingLoad] = []
    for load in network.loads:
        declared = elements.declare_load(m, load, buses, alone=network.hangs_on(load))
        others += declared.branches
        if load.follows:
            following.append(declare_following_load(m, load, declared, buses, omega_b))
    for shunt in network.shunts:
        others += elements.declare_shunt(m, shunt, buses)
    elements.add_stray(m, network, buses)
    for name in network.injections:
        elements.declare_injection(m, name, buses)
    faults = [declare_fault(m, bus, buses) for bus in network.faults]
    others += faults
    for name, bus in buses.items():
        _bus_voltage(m, name, bus, omega_b, network)
    for branch in (*lines, *others):
        elements.branch_equation(m, branch, buses, omega_b)
    for transformer in transformers:
        transformer_equations(m, transformer, buses, omega_b)
    for following_load in following:
        following_load_equations(m, following_load)
    elements.declare_network_outputs(m, network, buses, [line.drawn for line in lines], fed)
    for transformer in transformers:
        declare_winding_powers(m, transformer, buses)
    for fault in faults:
        declare_fault_outputs(m, fault.from_bus, fault.current)
    # Bus capacitances against small line reactances are far faster than any communication step: such a
    # network needs an integrator that is stable at any step and damps the ringing after a switching.
    # So does a fault's small reactance.
    stiff = bool(network.faults) or any(network.has_capacitance(bus) for bus in network.buses)
    return m.build(integrator="sdirk" if stiff else "runge_kutta")


def _bus_voltage(
    m: ModelBuilder, name: str, bus: elements.Bus, omega_b: Expr, network: Network
) -> None:
    """(B/ω_b)·dv/dt = Σ i − (G + jB)·v, or v = Σ i / G where there is no capacitance."""
    dynamic = network.has_capacitance(name)
    if network.loads_decide(name):
        m.require(
            bus.B if dynamic else bus.G,
            f"the voltage of {name} hangs on its loads; leave one of them switched on",
        )
    if not dynamic:
        bus.v = bus.injected / bus.G
        return
    with m.scope(name):
        re = m.state("v_re_state", bus.v_0.re, "pu", "Bus voltage, real part", base="bus")
        im = m.state("v_im_state", bus.v_0.im, "pu", "Bus voltage, imaginary part", base="bus")
    bus.v = Phasor(re, im)
    rate = (bus.injected - Phasor(bus.G, bus.B) * bus.v) * (omega_b / bus.B)
    m.derivative(re, rate.re)
    m.derivative(im, rate.im)
