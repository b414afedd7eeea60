"""A rectifier's station with the control of the whole DC line, PSS/E's CDC4T or CDC6T (phasor type).

It solves the DC circuit by its own bus voltage and what the inverter tells (`circuit`), and tells the inverter what
flows through its bridges. A bypassed inverter has no voltage, and the line's current does not flow through its
bridges."""

from dataclasses import dataclass, replace

from fmus.dc_line.bridges import BENCHMARK, DEGREE, Bridges, angle_of, declare_bridges
from fmus.dc_line.circuit import Circuit, Far, Flow, Orders
from fmus.dc_line.delays import declare_delays
from fmus.dc_line.orders import (
    Condition,
    Control,
    Start,
    close_interruptions,
    declare_control,
    declare_interruptions,
    declare_measured,
    triggers_at_once,
)
from fmus.dc_line.station import USUAL, Station, declare_station
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.phasor_port import phasor_builder
from fmus.toolchain.symbols import Expr, cos, fmax, fmin, if_else, logic_or, sqrt

X_C = 13.585
"""Commutating reactance of the benchmark's rectifier [ohm]: 0.18 pu of 603.7 MVA."""

E_N = 213.456
"""Voltage at its valves [kV]."""

CDC4T = "CDC4T"
CDC6T = "CDC6T"

INVERTER_KV = 490.0
"""The inverter's voltage of the benchmark [kV]: 500 kV at the rectifier less 2 kA through 5 ohm."""


@dataclass(frozen=True)
class _Line:
    """The line with its control, in a condition."""

    bridges: Bridges
    least_cosine: Expr
    circuit: Circuit
    control: Control
    far: Far
    state: Condition

    def driven(self, v: Expr) -> Expr:
        """DC voltage of the rectifier at its least angle without a current [kV], at a bus voltage [pu]."""
        return self.bridges.no_load(v) * self.least_cosine

    def without_bypass(self, v: Expr, measured: tuple[Expr, Expr]) -> Flow:
        """Return the flow if the inverter is not bypassed, by what is measured."""
        order = self.control.current(*measured, self.state)
        orders = Orders(order, self.control.kilovolts(self.state, self.far.beyond))
        return self.circuit.solve(self.driven(v), self.bridges.drop, self.far, orders)

    def flowing(self, v: Expr, measured: tuple[Expr, Expr]) -> Flow:
        """Return the flow with a bypassed inverter, and of a blocked line."""
        free = self.without_bypass(v, measured)
        most = self.driven(v) / (self.bridges.drop + self.circuit.ohm)
        past = fmin(self.control.current(*measured, self.state), most)
        bypassed = self.state.bypassed
        out = logic_or(bypassed, self.state.blocked)
        kilovolts, left = (if_else(out, 0, value) for value in (free.kilovolts, free.left))
        return Flow(if_else(bypassed, past, free.current), kilovolts, left)


def lcc_rectifier_phasor(records: str = CDC4T) -> Model:
    """The rectifier with the line's control, phasor type.

    Parameters
    ----------
    records
        PSS/E's name of the control's record: CDC4T, or CDC6T, which waits before it blocks, bypasses and comes back.

    Raises
    ------
    ValueError
        If it is neither.
    """
    if records not in (CDC4T, CDC6T):
        raise ValueError(f"records = {records!r}: write {CDC4T} or {CDC6T}")
    title = f"Rectifier of a DC line with the control {records} of PSS/E (phasor type)"
    waits = records == CDC6T
    name = f"lcc_rectifier_{CDC6T.lower()}_phasor" if waits else "lcc_rectifier_phasor"
    m = phasor_builder(name, title, kind="load", usual=USUAL)
    station = declare_station(m, P_0=-1.0)
    bridges = declare_bridges(m, X_C, E_N)
    circuit, mode = _declare_line(m)
    start = _start(m, station, circuit.ohm)
    cosine_0 = bridges.cosine(station.size_0, start.current, start.rectifier_kv)
    m.require(1 - cosine_0, "P_0, v_0: the rectifier cannot drive its current; raise v_0 or E_n")
    text = "Least firing angle; that of the start where it is less"
    least = m.parameter("ALFDY", 5.0, "deg", text, minimum=0.0, maximum=90.0, source=BENCHMARK)
    control = declare_control(m, mode, circuit, start)
    measured = declare_measured(m, control.p, start)
    delays = declare_delays(m) if waits else None
    interruptions = declare_interruptions(m, station.port.connected)
    line = _Line(
        bridges,
        fmax(cos(least * DEGREE), cosine_0),
        circuit,
        control,
        far=_declare_far(m),
        state=interruptions.condition,
    )
    v, seen = station.seen.value.magnitude(), (measured.kilovolts, measured.current)
    now = line.flowing(v, seen)
    measured.follow(m, now.kilovolts, now.current)
    judged = station.seen.once.magnitude()
    low = line.without_bypass(judged, seen).kilovolts
    triggers = triggers_at_once(control.p, judged, line.far.v, low)
    if delays is not None:
        triggers = delays.triggers(m, control, interruptions, triggers)
    close_interruptions(m, control, interruptions, triggers, low)

    def after(v: Expr, time: Expr) -> Flow:
        return line.flowing(v, measured.after(time, now.kilovolts, now.current))

    def fed(v: Expr, time: Expr) -> tuple[Expr, Expr]:
        then = after(v, time)
        own = then.kilovolts + circuit.ohm * then.current
        return -own * then.current, bridges.reactive(v, then.current, own)

    drawn_0 = bridges.reactive(station.size_0, start.current, start.rectifier_kv)
    station.feed(m, fed, drawn_0)
    ahead = station.master.to_next + station.master.size
    _tell_inverter(m, after(station.size_after(ahead), ahead), line.state)
    own = now.kilovolts + circuit.ohm * now.current
    m.output("I_dc", now.current, "kA", "DC current")
    m.output("V_dc", own, "kV", "DC voltage of the rectifier")
    m.output("V_inverter", now.kilovolts, "kV", "DC voltage of the inverter")
    alpha = angle_of(bridges.cosine(v, now.current, own)) / DEGREE
    m.output("alpha", alpha, "deg", "Firing angle")
    m.output("I_order", control.current(*seen, line.state), "kA", "Order of the DC current")
    m.output("blocked", line.state.blocked, "1", "1 while the line is blocked")
    m.output("bypassed", line.state.bypassed, "1", "1 while the inverter is bypassed")
    return replace(m.build(), of_parts=waits)


def _declare_line(m: ModelBuilder) -> tuple[Circuit, Expr]:
    """Declare the DC circuit, and what is held."""
    ohm = m.parameter("R_dc", 5.0, "ohm", "Resistance of the line", minimum=0.0, source=BENCHMARK)
    text = "Compounding: what the current takes off the inverter's voltage"
    compounding = m.parameter("RCOMP", 0.0, "ohm", text, source=BENCHMARK)
    text = "Margin: share of the current's order below which the inverter holds the current"
    margin = m.parameter("DELTI", 0.1, "1", text, minimum=0.0, maximum=1.0, source=BENCHMARK)
    mode = m.parameter(
        "mode",
        1,
        "1",
        "0: the current of the start is held; 1: the rectifier's power; 2: the inverter's",
        minimum=0,
        maximum=2,
        type="Integer",
        source=BENCHMARK,
    )
    return Circuit(ohm, compounding, margin), mode


def _start(m: ModelBuilder, station: Station, ohm: Expr) -> Start:
    """The line's state at the operating point: its power at the rectifier, and the inverter's voltage."""
    text = "DC voltage of the inverter at the operating point"
    V = m.parameter("V_dc_0", INVERTER_KV, "kV", text, minimum=1e-3, source=BENCHMARK)
    drawn = -station.p_0
    m.require(drawn, "P_0: a rectifier draws power; give P_0 below 0")
    current = 2 * drawn / (V + sqrt(V**2 + 4 * ohm * drawn))
    current = m.calculated("I_dc_0", current, "kA", "DC current at the operating point")
    return Start(current, V, V + ohm * current)


def _declare_far(m: ModelBuilder) -> Far:
    with m.scope("inverter"):
        return Far(
            m.input("V_most", "kV", "Its DC voltage at its least angle, no current", start=545.8),
            m.input("drop", "ohm", "Its voltage lost by commutation, per current", start=25.43),
            m.input("v", "pu", "Voltage of its bus", base="bus", start=1.0),
            m.input("beyond", "kV", "By how much its DC voltage may exceed its order"),
        )


def _tell_inverter(m: ModelBuilder, flow: Flow, state: Condition) -> None:
    current = if_else(state.bypassed, 0, flow.current)
    m.output("inverter_I", current, "kA", "Current of the inverter's bridges")
    text = "DC voltage that its order and the rectifier leave for the inverter"
    m.output("inverter_V", flow.left, "kV", text)
