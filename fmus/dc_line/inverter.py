"""An inverter's station of a DC line whose control is at the rectifier (phasor type).

It feeds the power that the line brings, at most the voltage that its least extinction angle gives, and tells the
rectifier what that is."""

from fmus.dc_line.bridges import BENCHMARK, DEGREE, angle_of, declare_bridges
from fmus.dc_line.rectifier import INVERTER_KV
from fmus.dc_line.station import USUAL, declare_station
from fmus.toolchain.model import Model
from fmus.toolchain.phasor_port import phasor_builder
from fmus.toolchain.symbols import Expr, cos, fmax, fmin, if_else

X_C = 13.315
"""Commutating reactance of the benchmark's inverter [ohm]: 0.18 pu of 591.8 MVA."""

E_N = 209.229
"""Voltage at its valves [kV]."""

NO_ORDER = 1e4
"""Voltage [kV] that no line has: with it beside the order, no order of the voltage acts."""


def lcc_inverter_phasor() -> Model:
    """The inverter, phasor type."""
    title = "Inverter of a DC line (phasor type)"
    m = phasor_builder("lcc_inverter_phasor", title, kind="load", usual=USUAL)
    station = declare_station(m, P_0=0.98)
    bridges = declare_bridges(m, X_C, E_N)
    text = "DC voltage at the operating point"
    V_0 = m.parameter("V_dc_0", INVERTER_KV, "kV", text, minimum=1e-3, source=BENCHMARK)
    m.require(station.p_0, "P_0: an inverter feeds power; give P_0 above 0")
    I_0 = station.p_0 / V_0
    cosine_0 = bridges.cosine(station.size_0, I_0, V_0)
    m.require(1 - cosine_0, "V_dc_0, v_0: the inverter cannot give its voltage; raise v_0 or E_n")
    text = "Least extinction angle; that of the start where it is less"
    least = m.parameter("GAMDY", 15.0, "deg", text, minimum=0.0, maximum=90.0, source=BENCHMARK)
    holds_angle = m.switch("holds_angle", False, "The angle of the start is held, not the voltage")
    free = fmax(cos(least * DEGREE), cosine_0)
    most_cosine = if_else(holds_angle, cosine_0, free)
    current = m.input("I_dc", "kA", "Current of the bridges", start=2.0)
    V_line = m.input(
        "V_dc", "kV", "Most DC voltage that the line's control leaves", start=INVERTER_KV
    )

    def kilovolts(v: Expr) -> Expr:
        return fmax(fmin(V_line, bridges.no_load(v) * most_cosine - bridges.drop * current), 0)

    def fed(v: Expr, time: Expr) -> tuple[Expr, Expr]:
        V = kilovolts(v)
        return V * current, bridges.reactive(v, current, V)

    station.feed(m, fed, bridges.reactive(station.size_0, I_0, V_0))
    v_next = station.size_after(station.master.to_next + station.master.size)
    seen = station.seen.value.magnitude()
    closed = station.port.connected
    most = closed * bridges.no_load(v_next) * most_cosine
    m.output("V_most", most, "kV", "DC voltage at the least angle, without a current")
    m.output("drop", bridges.drop, "ohm", "DC voltage lost by commutation, per current")
    text = "Voltage of the bus through one lag; 0 behind an open breaker"
    m.output("v", closed * station.seen.once.magnitude(), "pu", text, base="bus")
    text = "By how much the DC voltage may exceed its order; much where the angle is held"
    m.output("beyond", if_else(holds_angle, NO_ORDER, 0), "kV", text)
    gamma = angle_of(bridges.cosine(seen, current, kilovolts(seen))) / DEGREE
    m.output("gamma", gamma, "deg", "Extinction angle")
    return m.build()
