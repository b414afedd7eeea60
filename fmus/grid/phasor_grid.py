"""A network without transients: admittances at rated frequency, and devices as emfs behind admittances of their own.

    (Y + Σ y)·v = Σ y·e          solved directly from the newest emfs whenever an output is read: there is no state

Elements, parameters and outputs are those of `grid`. Constant-impedance loads, ratios and open lines behave as
described there."""

from collections.abc import Mapping, Sequence
from math import pi

from fmus.grid import elements
from fmus.grid.fault import declare_fault_outputs, fault_admittance
from fmus.grid.line_parts import LineParts, declare_line_parts
from fmus.grid.load_laws import FollowingLoad, declare_following_load, following_load_equations
from fmus.grid.network import Line, Network, Port
from fmus.grid.nodal_equations import Admittances, add_admittance, solve_for_voltages
from fmus.grid.three_winding import add_windings, declare_winding_powers, declare_windings
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import phasor_builder
from fmus.toolchain.port_variables import SYSTEM_BASE
from fmus.toolchain.symbols import Expr, Scalar

LEAST_CONDUCTANCE = 1e-12
"""Conductance to earth [pu, 100 MVA] of a bus that has no other admittance to earth: where all its lines open, its
voltage is 0 and not 0/0."""


def phasor_grid(network: Network) -> Model:
    """Build the model of a network; parameters are named after its elements, as in `grid`."""
    m = phasor_builder(
        network.name, f"Phasor network {network.name} at rated frequency", kind="network"
    )
    following: list[FollowingLoad] = []
    omega_b: Expr | None = None
    if any(load.follows and (load.k_pf or load.k_qf) for load in network.loads):
        omega_b = (
            2 * pi * m.parameter("f_n", 50.0, "Hz", "Rated frequency", minimum=1.0, maximum=400.0)
        )
    buses = {bus: elements.declare_bus(m, bus) for bus in network.buses}
    Y: Admittances = {bus: {} for bus in buses}
    sources = [_declare_source(m, port, buses, Y) for port in network.ports]
    lines = [elements.declare_line_values(m, line, buses) for line in network.lines]
    for load in network.loads:
        declared = elements.declare_load(m, load, buses, alone=False, inductor=_susceptance)
        if load.follows:
            following.append(
                declare_following_load(m, load, declared, buses, omega_b, phasors=True)
            )
    for shunt in network.shunts:
        elements.declare_shunt(m, shunt, buses, inductor=_susceptance)
    elements.add_stray(m, network, buses)
    for name in network.injections:
        elements.declare_injection(m, name, buses)
    for name, bus in buses.items():
        least = LEAST_CONDUCTANCE if network.floats(name) else 0.0
        add_admittance(
            Y, name, name, Phasor(bus.G + least, bus.B) if least else Phasor(bus.G, bus.B)
        )
    faults = {bus: fault_admittance(m, bus) for bus in network.faults}
    for name, y in faults.items():
        add_admittance(Y, name, name, y)
    parts = _add_lines(m, Y, network.lines, lines)
    transformers = [declare_windings(m, data) for data in network.transformers]
    for transformer in transformers:
        add_windings(Y, transformer)
    solve_for_voltages(m, buses, Y)
    for following_load in following:
        following_load_equations(m, following_load)
    drawn = [
        _drawn(line, values, buses, parts.get(line.name))
        for line, values in zip(network.lines, lines, strict=True)
    ]
    fed = [(e - buses[port.bus].v) * y for port, (e, y) in zip(network.ports, sources, strict=True)]
    elements.declare_network_outputs(m, network, buses, drawn, fed)
    for transformer in transformers:
        declare_winding_powers(m, transformer, buses)
    for name, y in faults.items():
        declare_fault_outputs(m, name, buses[name].v * y)
    _declare_line_fault_outputs(m, network.lines, lines, parts, buses)
    return m.build()


def _declare_line_fault_outputs(
    m: ModelBuilder,
    lines: Sequence[Line],
    declared: Sequence[elements.LineValues],
    parts: Mapping[str, LineParts],
    buses: dict[str, elements.Bus],
) -> None:
    for line, values in zip(lines, declared, strict=True):
        if line.faulted:
            ends = _behind_ratio(line, values, buses)
            declare_fault_outputs(m, line.name, parts[line.name].fault_current(*ends))


def _declare_source(
    m: ModelBuilder, port: Port, buses: dict[str, elements.Bus], Y: Admittances
) -> tuple[Phasor, Phasor]:
    """Declare a device's emf and admittance, add them to its bus, and return both."""
    with m.scope(port.name):
        e = Phasor(
            m.input("e_re", "pu", "Emf of the device, real part", base="bus"),
            m.input("e_im", "pu", "Emf of the device, imaginary part", base="bus"),
        )
        y = Phasor(
            m.input("y_re", "pu", "Admittance between emf and bus, real part", base=SYSTEM_BASE),
            m.input(
                "y_im", "pu", "Admittance between emf and bus, imaginary part", base=SYSTEM_BASE
            ),
        )
        y *= m.switch("connected", True, "The device's breaker at the bus is closed", tunable=True)
    buses[port.bus].injected += e * y
    add_admittance(Y, port.bus, port.bus, y)
    return e, y


def _susceptance(
    m: ModelBuilder, bus: elements.Bus, name: str, X: Expr, scale: Scalar
) -> list[elements.Branch]:
    """An inductor between a bus and earth, as an admittance."""
    bus.B -= scale / X
    return []


def _add_lines(
    m: ModelBuilder, Y: Admittances, lines: Sequence[Line], declared: Sequence[elements.LineValues]
) -> dict[str, LineParts]:
    """Add all lines; return the parts of those that have any."""
    parts = {
        line.name: declare_line_parts(m, line, values, _series(values))
        for line, values in zip(lines, declared, strict=True)
        if not line.is_plain
    }
    for line, values in zip(lines, declared, strict=True):
        _add_line(Y, line, values, parts.get(line.name))
    return parts


def _add_line(
    Y: Admittances, line: Line, values: elements.LineValues, parts: LineParts | None
) -> None:
    """Series admittance y behind the ratio t: y/|t|² and y on the diagonal, −y/t* and −y/t beside it."""
    y = _series(values)
    one, other, between = (y, y, -y) if parts is None else (*parts.own(), parts.between())
    t = Phasor(1.0, 0.0) if values.ratio is None else values.ratio
    add_admittance(Y, line.from_bus, line.from_bus, one / (t.re**2 + t.im**2))
    add_admittance(Y, line.to_bus, line.to_bus, other)
    add_admittance(Y, line.from_bus, line.to_bus, between / t.conjugate())
    add_admittance(Y, line.to_bus, line.from_bus, between / t)


def _behind_ratio(
    line: Line, values: elements.LineValues, buses: dict[str, elements.Bus]
) -> tuple[Phasor, Phasor]:
    """Voltages behind the ratio at the from side, and at the to bus."""
    v_from, v_to = buses[line.from_bus].v, buses[line.to_bus].v
    return (v_from if values.ratio is None else v_from / values.ratio), v_to


def _drawn(
    line: Line,
    values: elements.LineValues,
    buses: dict[str, elements.Bus],
    parts: LineParts | None,
) -> Phasor:
    """Current of a line at its from bus, without its charging."""
    v_from, v_to = buses[line.from_bus].v, buses[line.to_bus].v
    if parts is not None:
        drawn = parts.drawn(*_behind_ratio(line, values, buses))
        return drawn if values.ratio is None else drawn / values.ratio.conjugate()
    if values.ratio is None:
        return (v_from - v_to) * _series(values)
    return (v_from / values.ratio - v_to) * _series(values) / values.ratio.conjugate()


def _series(values: elements.LineValues) -> Phasor:
    X = values.X if values.X_C is None else values.X - values.X_C
    return Phasor(1.0, 0.0) / Phasor(values.R, X) * values.connected
