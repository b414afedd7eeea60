"""Elements of a network as parameters and states: the contribution of each to its buses, and its own equation."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.grid.names import injection_names
from fmus.grid.network import OPEN_CHARGING, SMALLEST_REACTANCE, Line, Load, Network, Port, Shunt
from fmus.toolchain.frames import ZERO, Phasor, phasor_derivative, phasor_state, polar, power
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import BREAKER_TIME
from fmus.toolchain.port_variables import SYSTEM_BASE, SYSTEM_BASE_MVA
from fmus.toolchain.symbols import Expr, Scalar


@dataclass
class Bus:
    """The sums at a bus: injected current, conductance, susceptance; and its voltage once it is known."""

    v_0: Phasor
    injected: Phasor
    G: Expr
    B: Expr
    v: Phasor = ZERO


@dataclass(frozen=True)
class Branch:
    """An inductive current state with R and X, from a voltage to a voltage or to earth.

    ``current``: the state with the current; behind the ratio, if there is one; ``drawn``: current that the branch takes
    from its from bus; ``ratio``: complex ratio at the from side; ``connected``: 1 for a connected branch, 0 for an open
    one; None for a branch that cannot be opened; ``capacitor``: voltage of a capacitor in series, a state, and its
    reactance."""

    current: Phasor
    drawn: Phasor
    R: Scalar
    X: Expr
    from_bus: str
    to_bus: str | None = None
    ratio: Phasor | None = None
    connected: Expr | None = None
    capacitor: tuple[Phasor, Expr] | None = None


@dataclass(frozen=True)
class DeclaredLoad:
    """A load at scale 1 [pu, 100 MVA], and its ``scale``."""

    G_0: Scalar
    B_0: Scalar
    G: Scalar
    scale: Expr
    branches: list[Branch]


Inductor = Callable[[ModelBuilder, Bus, str, Expr, Scalar], list[Branch]]
"""Puts an inductor of reactance X [pu, 100 MVA] between a bus and earth; the bus feeds ``scale`` times its current."""


@dataclass(frozen=True)
class LineValues:
    """Parameters of a line: series impedance, ratio at the from side (None without one), 1 or 0 where it is open,
    series capacitor (None without one), charging (None without any)."""

    R: Expr
    X: Expr
    ratio: Phasor | None
    connected: Expr
    X_C: Expr | None = None
    B: Expr | None = None


def declare_bus(m: ModelBuilder, name: str) -> Bus:
    """Declare the power flow's voltage of a bus."""
    with m.scope(name):
        magnitude = m.parameter(
            "v_0", 1.0, "pu", "Power flow: voltage magnitude", base="bus", minimum=0.1, maximum=2.0
        )
        angle = m.parameter("theta_0", 0.0, "rad", "Power flow: voltage angle")
    return Bus(polar(magnitude, angle), ZERO, Expr(0), Expr(0))


def declare_port(m: ModelBuilder, port: Port, buses: dict[str, Bus]) -> Phasor:
    """Declare a device's current; returns the current that reaches the bus."""
    with m.scope(port.name):
        current = Phasor(
            m.input("i_re", "pu", "Current injected by the device, real part", base=SYSTEM_BASE),
            m.input(
                "i_im", "pu", "Current injected by the device, imaginary part", base=SYSTEM_BASE
            ),
        )
        connected = m.switch(
            "connected", True, "The device's breaker at the bus is closed", tunable=True
        )
    fed = current * connected
    buses[port.bus].injected += fed
    return fed


def declare_injection(m: ModelBuilder, name: str, buses: dict[str, Bus]) -> None:
    """Declare a current into a bus beside those of its devices, as `injection_names` calls its parts."""
    parts = [
        m.parameter(
            part,
            0.0,
            "pu",
            "Current injected besides, network frame",
            base=SYSTEM_BASE,
            tunable=True,
        )
        for part in injection_names(name)
    ]
    buses[name].injected += Phasor(parts[0], parts[1])


def declare_line_values(m: ModelBuilder, line: Line, buses: dict[str, Bus]) -> LineValues:
    """Declare the parameters of a π section and add its charging to both buses."""

    def parameter(
        name: str, value: float, unit: str, text: str, minimum: float | None, maximum: float | None
    ) -> Expr:
        base = ""
        if unit == "pu":
            base = "bus" if name == "tap" else SYSTEM_BASE
        return m.parameter(
            line.variable(name),
            value,
            unit,
            f"{text} of line {line.name}",
            base=base,
            minimum=minimum,
            maximum=maximum,
            tunable=name != "B",
        )

    start, end = buses[line.from_bus], buses[line.to_bus]
    least, most = (-100, -SMALLEST_REACTANCE) if line.X < 0 else (SMALLEST_REACTANCE, 100)
    X = parameter("X", line.X, "pu", "Reactance", least, most)
    R = parameter("R", line.R, "pu", "Resistance", *((None, 0) if line.R < 0 else (0, None)))
    connected = m.switch(
        line.variable("connected"), True, f"Line {line.name} is closed at both ends", tunable=True
    )
    ratio, turns = None, Expr(1)
    if line.has_ratio:
        turns = parameter("tap", line.tap, "1", "Magnitude of the ratio at the from side", 0.1, 10)
        ratio = polar(
            turns, parameter("shift", line.shift, "rad", "Phase shift at the from side", None, None)
        )
    B = None
    if line.B:
        B = parameter("B", line.B, "pu", "Charging", 1e-9, None)
        rest = OPEN_CHARGING + (1 - OPEN_CHARGING) * connected if line.is_plain else OPEN_CHARGING
        start.B += B * rest / 2 / turns**2
        end.B += B * rest / 2
    X_C = None
    if line.X_C:
        text = f"Reactance of the series capacitor of line {line.name}"
        X_C = m.parameter(
            line.variable("X_C"), line.X_C, "pu", text, base=SYSTEM_BASE, minimum=1e-6, maximum=100
        )
        m.require(
            X - X_C, f"line {line.name}: X must exceed X_C, the reactance of its series capacitor"
        )
    return LineValues(R, X, ratio, connected, X_C, B)


def declare_line(m: ModelBuilder, line: Line, buses: dict[str, Bus]) -> Branch:
    """Declare a π section with its current as a state."""
    start, end = buses[line.from_bus], buses[line.to_bus]
    values = declare_line_values(m, line, buses)
    v_from = start.v_0 if values.ratio is None else start.v_0 / values.ratio
    X = values.X if values.X_C is None else values.X - values.X_C
    initial = (v_from - end.v_0) / Phasor(values.R, X) * values.connected
    with m.scope(line.name):
        current = _current_state(m, initial, f"Current of line {line.name}")
        capacitor = None
        if values.X_C is not None:
            capacitor = _capacitor_state(m, initial * Phasor(0.0, -values.X_C)), values.X_C
    drawn = current if values.ratio is None else current / values.ratio.conjugate()
    start.injected -= drawn
    end.injected += current
    return Branch(
        current=current,
        drawn=drawn,
        R=values.R,
        X=values.X,
        from_bus=line.from_bus,
        to_bus=line.to_bus,
        ratio=values.ratio,
        connected=values.connected,
        capacitor=capacitor,
    )


def inductor_state(m: ModelBuilder, bus: Bus, name: str, X: Expr, scale: Scalar) -> list[Branch]:
    """An inductor whose state is its current at scale 1.

    The bus feeds ``scale`` times this current. A load that is switched off and on again therefore comes back without a
    direct component.

    ``bus``: the bus whose injected current is reduced by the inductor's; ``name``: name of the bus; ``X``: reactance
    [pu, 100 MVA]; ``scale``: factor from the state to the current drawn."""
    current = _current_state(m, bus.v_0 / Phasor(0, X), "Inductor current at scale 1")
    drawn = current * scale
    bus.injected -= drawn
    return [Branch(current, drawn, 0.0, X, name)]


def declare_load(
    m: ModelBuilder,
    load: Load,
    buses: dict[str, Bus],
    *,
    alone: bool,
    inductor: Inductor = inductor_state,
) -> DeclaredLoad:
    """Declare a load, and put the part of it that is a constant impedance to its bus.

    ``load``: its power and name; the power is the default of parameters; ``buses``: by name; that of the load is
    changed; ``alone``: whether this load alone determines the voltage of its bus, and therefore cannot be switched off;
    ``inductor``: declares the inductor of a load that draws reactive power."""
    bus = buses[load.bus]
    v_squared = bus.v_0.re**2 + bus.v_0.im**2
    text = "Load step: factor on G and 1/X; 0 is switched off"
    if alone:
        text = "Load step: factor on G and 1/X; not 0, because nothing else determines the voltage of this bus"
    with m.scope(load.name):
        scale = m.parameter(
            "scale", 1.0, "1", text, minimum=1e-6 if alone else 0, maximum=100, tunable=True
        )
        P = m.parameter(
            "P",
            load.p_mw,
            "MW",
            "Active power at the power flow's voltage",
            minimum=None if load.p_mw < 0 else 0,
            maximum=0 if load.p_mw < 0 else None,
        )
        G = P / SYSTEM_BASE_MVA / v_squared
        if load.conductance_mw or not load.p_mw:
            bus.G += scale * G
        own_G = G if load.conductance_mw else 0.0
        if load.q_mvar == 0:
            return DeclaredLoad(G, 0.0, own_G, scale, [])
        inductive = load.q_mvar > 0
        Q = m.parameter(
            "Q",
            load.q_mvar,
            "Mvar",
            "Reactive power at the power flow's voltage",
            minimum=1e-6 if inductive else None,
            maximum=None if inductive else -1e-6,
        )
        B = -Q / SYSTEM_BASE_MVA / v_squared
        if not load.susceptance_mvar:
            return DeclaredLoad(G, B, own_G, scale, [])
        if not inductive:
            bus.B += -scale * Q / SYSTEM_BASE_MVA / v_squared
            return DeclaredLoad(G, B, own_G, scale, [])
        X = v_squared / (Q / SYSTEM_BASE_MVA)
        return DeclaredLoad(G, B, own_G, scale, inductor(m, bus, load.bus, X, scale))


def declare_shunt(
    m: ModelBuilder, shunt: Shunt, buses: dict[str, Bus], *, inductor: Inductor = inductor_state
) -> list[Branch]:
    """Declare an admittance to earth: conductance, and a capacitor or an inductor.

    ``shunt``: its powers at 1 pu and its name; the powers are the defaults of parameters; ``buses``: by name; that of
    the shunt is changed; ``inductor``: declares the inductor of a shunt that draws reactive power."""
    bus = buses[shunt.bus]
    with m.scope(shunt.name):
        text = "The shunt is connected"
        connected: Scalar = (
            m.switch("connected", True, text, tunable=True) if shunt.switched else 1.0
        )
        if shunt.g_mw:
            G = m.parameter("G", shunt.g_mw, "MW", "Active power drawn at 1 pu") / SYSTEM_BASE_MVA
            bus.G += G * connected if shunt.switched else G
        if not shunt.b_mvar:
            return []
        capacitive = shunt.b_mvar > 0
        B = m.parameter(
            "B",
            shunt.b_mvar,
            "Mvar",
            "Reactive power generated at 1 pu",
            minimum=1e-6 if capacitive else None,
            maximum=None if capacitive else -1e-6,
        )
        if capacitive:
            rest = OPEN_CHARGING + (1 - OPEN_CHARGING) * connected
            bus.B += B / SYSTEM_BASE_MVA * rest if shunt.switched else B / SYSTEM_BASE_MVA
            return []
        return inductor(m, bus, shunt.bus, -SYSTEM_BASE_MVA / B, connected)


def add_stray(m: ModelBuilder, network: Network, buses: dict[str, Bus]) -> None:
    """Declare the stray capacitance of every bus without capacitance of its own, if the network has stray
    capacitance."""
    floating = [bus for name, bus in buses.items() if network.needs_stray(name)]
    if floating:
        text = "Capacitance to earth of every bus that has none of its own"
        stray = m.parameter(
            "stray_B", network.stray_B, "pu", text, base=SYSTEM_BASE, minimum=1e-9, maximum=100
        )
        for bus in floating:
            bus.B += stray


def declare_network_outputs(
    m: ModelBuilder, network: Network, buses: dict[str, Bus], drawn: list[Phasor], fed: list[Phasor]
) -> None:
    """Declare the outputs: all voltages, the power of every line at its from bus, and the power of every device.

    ``network``: its lines and ports; ``buses``: by name, with their voltages; ``drawn``: current of every line at its
    from bus, in the order of the lines: network frame [pu, 100 MVA]; ``fed``: current of every device, in the order of
    the ports: network frame [pu, 100 MVA]."""
    for name, bus in buses.items():
        with m.scope(name):
            m.output("v_re", bus.v.re, "pu", "Bus voltage, real part, network frame", base="bus")
            m.output(
                "v_im", bus.v.im, "pu", "Bus voltage, imaginary part, network frame", base="bus"
            )
            m.output("v", bus.v.magnitude(), "pu", "Bus voltage magnitude", base="bus")
    for line, current in zip(network.lines, drawn, strict=True):
        texts = "Active power entering the line", "Reactive power entering the line"
        declare_power(m, line.name, buses[line.from_bus].v, current, *texts)
    for port, current in zip(network.ports, fed, strict=True):
        texts = "Active power fed into the bus", "Reactive power fed into the bus"
        declare_power(m, port.name, buses[port.bus].v, current, *texts)


def branch_equation(m: ModelBuilder, branch: Branch, buses: dict[str, Bus], omega_b: Expr) -> None:
    """(X/ω_b)·di/dt = v_from/t − v_to − (R + jX)·i; where the line is open, di/dt = −i/τ.

    ``branch``: with its current as a state; ``buses``: by name, with their voltages; ``omega_b``: base angular
    frequency [rad/s]."""
    over = buses[branch.from_bus].v
    if branch.ratio is not None:
        over = over / branch.ratio
    if branch.to_bus is not None:
        over -= buses[branch.to_bus].v
    if branch.capacitor is not None:
        over -= branch.capacitor[0]
        _capacitor_equation(m, branch, omega_b)
    rate = over - Phasor(branch.R, branch.X) * branch.current
    if branch.connected is None:
        rate *= omega_b / branch.X
    else:
        fading = (1 - branch.connected) / BREAKER_TIME
        rate = rate * (branch.connected * omega_b / branch.X) - branch.current * fading
    phasor_derivative(m, branch.current, rate)


def _capacitor_equation(m: ModelBuilder, branch: Branch, omega_b: Expr) -> None:
    """dv/dt = ω_b·(X_C·i − j·v); where the line is open its capacitor is bypassed, and dv/dt = −v/τ."""
    assert branch.capacitor is not None
    assert branch.connected is not None
    v, X_C = branch.capacitor
    rate = (branch.current * X_C - v.times_j()) * (omega_b * branch.connected)
    rate -= v * ((1 - branch.connected) / BREAKER_TIME)
    phasor_derivative(m, v, rate)


def declare_power(
    m: ModelBuilder, name: str, v: Phasor, current: Phasor, active: str, reactive: str
) -> None:
    """Declare ``<name>.p`` and ``<name>.q`` of a current at a voltage.

    ``name``: scope of both outputs; ``v``: voltage [pu]; ``current``: in the same frame [pu, 100 MVA]; ``active``,
    ``reactive``: descriptions of the two outputs."""
    s = power(v, current)
    with m.scope(name):
        m.output("p", s.re, "pu", active, base=SYSTEM_BASE)
        m.output("q", s.im, "pu", reactive, base=SYSTEM_BASE)


def _capacitor_state(m: ModelBuilder, initial: Phasor) -> Phasor:
    text = "Voltage of the series capacitor"
    return phasor_state(m, "v_C", initial, text, "bus")


def _current_state(m: ModelBuilder, initial: Phasor, text: str) -> Phasor:
    return phasor_state(m, "i", initial, text, SYSTEM_BASE)
