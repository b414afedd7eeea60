"""The circuit around a vendor's controller: filter, transformer and averaged two-level bridge, at our port.

Complex quantities are per unit on the rating, in the network frame, which turns at ω_b. What the controller measures
are phase quantities: the frame's angle brings them to the standing frame, 1 pu is the amplitude of the rated one."""

from dataclasses import dataclass
from typing import Literal

from fmus.toolchain.frames import Phasor, of_phases, phases, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import (
    BREAKER_TIME,
    DevicePort,
    declare_port_outputs,
    declare_rating,
    device_port_of,
)
from fmus.toolchain.symbols import Expr, fmax, fmin, sqrt

FilterKind = Literal["L", "LC", "LCL"]
BridgeKind = Literal["modulation", "voltage"]

ANGLE = "frame.angle"
"""State that the host sets anew at each sample: it follows from the time, so it is none of the device's states."""

# inputs that the controller gives: modulation indices, or phase voltages
BRIDGE = ("bridge.a", "bridge.b", "bridge.c")
TRIMS = ("trim.P", "trim.Q", "trim.V")  # inputs that the host sets while it looks for the start
REFERENCES = ("P_ref", "Q_ref", "V_ref")
MEASURED = tuple(f"{name}_{phase}" for name in ("u", "v", "i_s", "i_g") for phase in "abc")
"""Phase quantities at the circuit: voltages at the filter and at the bus, currents of the bridge and into the grid."""

BASES = {"voltage": "base.voltage", "current": "base.current", "power": "S_n"}
"""Parameters that hold what 1 pu is [kV, kA, MVA]."""

S_N = 100.0  # default rating [MVA]: the base of networks
P_0 = 0.8  # default dispatch [pu, S_n]
V_N = 0.69  # default rated voltage [kV]: that of most converters' terminals


@dataclass(frozen=True)
class _Branches:
    """Data of the series branches and of the capacitor [pu, S_n]."""

    z_s: Phasor
    z_g: Phasor
    B_c: Expr | None
    R_d: Expr | None

    def capacitor_voltage(self, u: Phasor) -> Phasor:
        """Behind the damping resistor, at rest."""
        return u if self.B_c is None or self.R_d is None else u / Phasor(1, self.R_d * self.B_c)


def converter_circuit(name: str, filter_kind: FilterKind, bridge: BridgeKind) -> Model:
    """The circuit as a model whose inputs are the bus voltage and what the controller gives.

    ``filter_kind``: ``L``: one inductor. ``LC``: an inductor and a capacitor. ``LCL``: a second inductor, before the
    transformer.
    ``bridge``: What the controller gives: ``modulation`` of half the DC voltage, or a phase ``voltage`` [kV]."""
    m = ModelBuilder(name, "Converter circuit around a vendor's controller", internal_step=1e-5)
    rating = declare_rating(m, S_N)
    port = device_port_of(m, rating, P_0)
    V_n = m.parameter(
        "V_n", V_N, "kV", "Rated voltage at the filter, line to line, rms", minimum=1e-3
    )
    volt = m.calculated(
        "base.voltage", V_n * sqrt(2 / 3), "kV", "Amplitude of the rated phase voltage"
    )
    m.calculated("base.current", rating / V_n * sqrt(2 / 3), "kA", "Amplitude of the rated current")
    branches = _declare_branches(m, filter_kind)
    angle = m.state(ANGLE, 0.0, "rad", "Angle of the network frame")
    m.derivative(angle, port.omega_b)
    e = _bridge_voltage(m, bridge, volt, angle)
    i_s, u, i_g = _equations(m, port, branches, e)
    declare_port_outputs(m, port, i_g)
    _measurements(m, {"u": u, "v": port.v, "i_s": i_s, "i_g": i_g}, angle)
    _references(m, port, branches, power(u, i_g), u)
    m.output("i_s", i_s.magnitude(), "pu", "Current magnitude in the bridge", base="S_n")
    return m.build()


def _declare_branches(m: ModelBuilder, kind: FilterKind) -> _Branches:
    def branch(R: float, X: float, what: str) -> Phasor:
        return Phasor(
            m.parameter("R", R, "pu", f"Resistance of {what}", base="S_n", minimum=0.0),
            m.parameter("X", X, "pu", f"Reactance of {what}", base="S_n", minimum=1e-3),
        )

    with m.scope("filter"):
        z_s = branch(0.005, 0.15, "the inductor at the bridge")
        B_c = R_d = None
        if kind != "L":
            B_c = m.parameter(
                "B", 0.05, "pu", "Susceptance of the capacitor", base="S_n", minimum=1e-3
            )
            R_d = m.parameter(
                "R_d", 0.1, "pu", "Resistance in series with the capacitor", base="S_n", minimum=0.0
            )
    with m.scope("transformer"):
        z_g = branch(0.005, 0.1, "the transformer")
    if kind == "LCL":
        with m.scope("grid_inductor"):
            z_g = z_g + branch(0.002, 0.05, "the second inductor")
    return _Branches(z_s, z_g, B_c, R_d)


def _bridge_voltage(m: ModelBuilder, kind: BridgeKind, volt: Expr, angle: Expr) -> Phasor:
    """The averaged bridge [pu]: half the DC voltage times the modulation, which cannot exceed its limit."""
    V_dc = m.parameter("V_dc", 1.2, "kV", "DC voltage, held by a stiff source", minimum=1e-3)
    largest = m.parameter(
        "m_max", 1.15, "1", "Limit of the modulation; 1.15 with a third harmonic", minimum=0.1
    )
    unit, text = ("1", "Modulation") if kind == "modulation" else ("kV", "Voltage demanded")
    given = [m.input(name, unit, f"{text} of phase {name[-1]}") for name in BRIDGE]
    half = V_dc / 2
    wanted = [signal * half for signal in given] if kind == "modulation" else given
    a, b, c = (fmin(fmax(v, -largest * half), largest * half) / volt for v in wanted)
    return of_phases((a, b, c), angle)


def _equations(
    m: ModelBuilder, port: DevicePort, z: _Branches, e: Phasor
) -> tuple[Phasor, Phasor, Phasor]:
    """Declare states and their rates; return bridge current, filter voltage and current into the grid."""

    def complex_state(name: str, initial: Phasor, text: str) -> tuple[Phasor, tuple[Expr, Expr]]:
        re = m.state(
            f"{name}_re", initial.re, "pu", f"{text}, real part, network frame", base="S_n"
        )
        im = m.state(
            f"{name}_im", initial.im, "pu", f"{text}, imaginary part, network frame", base="S_n"
        )
        return Phasor(re, im), (re, im)

    def rate(state: tuple[Expr, Expr], value: Phasor) -> None:
        m.derivative(state[0], value.re)
        m.derivative(state[1], value.im)

    u_0 = port.v_0 + z.z_g * port.i_0
    fading = -1 / BREAKER_TIME
    if z.B_c is None or z.R_d is None:
        i, state = complex_state(
            "filter.i", port.i_0, "Current of the bridge, which goes into the grid"
        )
        both = z.z_s + z.z_g
        closed = (e - port.v - both * i) * (port.omega_b / both.im)
        moving = port.through_breaker(closed, i * fading)
        rate(state, moving)
        return i, port.v + z.z_g * i + moving * (z.z_g.im / port.omega_b), i
    u_c0 = z.capacitor_voltage(u_0)
    i_s, state_s = complex_state(
        "filter.i_s", port.i_0 + Phasor(0, z.B_c) * u_c0, "Current of the inductor"
    )
    u_c, state_c = complex_state("filter.u_c", u_c0, "Voltage of the capacitor")
    i_g, state_g = complex_state("transformer.i_g", port.i_0, "Current into the grid")
    u = u_c + z.R_d * (i_s - i_g)
    rate(state_s, (e - u - z.z_s * i_s) * (port.omega_b / z.z_s.im))
    rate(state_c, (i_s - i_g - Phasor(0, z.B_c) * u_c) * (port.omega_b / z.B_c))
    rate(
        state_g,
        port.through_breaker((u - port.v - z.z_g * i_g) * (port.omega_b / z.z_g.im), i_g * fading),
    )
    return i_s, u, i_g


def _measurements(m: ModelBuilder, quantities: dict[str, Phasor], angle: Expr) -> None:
    texts = {
        "u": "Voltage at the filter",
        "v": "Voltage at the bus",
        "i_s": "Current of the bridge",
        "i_g": "Current into the grid",
    }
    for name, value in quantities.items():
        for phase, instant in zip("abc", phases(value, angle), strict=True):
            m.output(
                f"{name}_{phase}",
                instant,
                "pu",
                f"{texts[name]}, phase {phase}",
                base="amplitude at S_n, V_n",
            )


def _references(m: ModelBuilder, port: DevicePort, z: _Branches, s: Phasor, u: Phasor) -> None:
    """References of the controller: of the power flow at the filter, with what the start adds, and what a user adds."""
    u_0 = port.v_0 + z.z_g * port.i_0
    s_0 = power(u_0, port.i_0)
    texts = {"P": "active power", "Q": "reactive power", "V": "voltage magnitude"}
    for letter, value, at_start in (
        ("P", s.re, s_0.re),
        ("Q", s.im, s_0.im),
        ("V", u.magnitude(), u_0.magnitude()),
    ):
        text = texts[letter]
        first = m.calculated(
            f"{letter}_ref_0", at_start, "pu", f"Power flow: {text} at the filter", base="S_n"
        )
        trim = m.input(
            f"trim.{letter}", "pu", f"What the start adds to the reference of {text}", base="S_n"
        )
        added = m.parameter(
            f"d{letter}_ref",
            0.0,
            "pu",
            f"Added to the reference of {text}",
            base="S_n",
            tunable=True,
        )
        m.output(
            f"{letter}_ref",
            first + trim + added,
            "pu",
            f"Reference of {text} at the filter",
            base="S_n",
        )
        m.output(
            {"P": "p_u", "Q": "q_u", "V": "u"}[letter],
            value,
            "pu",
            f"{text.capitalize()} at the filter",
            base="S_n",
        )
