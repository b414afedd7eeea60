"""PSS/E's CSVGN5: a static var compensator of the WSCC, a susceptance that follows the voltage, with a fast override.

    v → 1/(1+sT_S1) → V_ref − its output = e
    e within ±V_EMAX → (1+sT_S2)(1+sT_S4)/((1+sT_S3)(1+sT_S5)) → K_SVS → b_R
    b_R, or B'_MAX + K_SD·(e − D_V) if e > D_V, or B'_MIN if e < −D_V → 1/(1+sT_S6), within B_MIN and B_MAX → B

D_V = 0 stands for B'_MAX/K_SVS above, and for B'_MIN/K_SVS below. At the start B follows from the reactive power of the
power flow, and V_ref from B.

Sources: PowerWorld's guide to PSS/E's models for the fields, InterPSS' `Csvgn5Model` for the equations (it compares
them with PSS/E 36.7); with D_V = 0 InterPSS takes 0 in the product with K_SD, which would make B jump."""

from fmus.static_var.held_bus import HeldVoltage, holds_elsewhere
from fmus.static_var.susceptance import MOST_POWER, initial_susceptance, susceptance_model
from fmus.toolchain.blocks import (
    lead_lag,
    limit,
    limited_low_pass,
    low_pass_or_nothing,
)
from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.port import DevicePort
from fmus.toolchain.symbols import Expr, if_else

SOURCE = "InterPSS' test of CSVGN5"

S_N = 100.0
"""Default rating [MVA]."""


def csvgn5_phasor(records: str = "CSVGN5") -> Model:
    """The static var compensator, phasor type.

    Parameters
    ----------
    records
        PSS/E's name of its record, CSVGN5; behind it the word ``elsewhere`` if it holds another bus' voltage.

    Raises
    ------
    ValueError
        If it is none of these.
    """
    elsewhere = holds_elsewhere(records, ("CSVGN5",))
    title = "Static var compensator CSVGN5 of PSS/E (phasor type)"
    return susceptance_model("csvgn5_phasor", title, S_N, _susceptance, elsewhere=elsewhere)


def _susceptance(
    m: ModelBuilder, port: DevicePort, rating: Expr, v: Phasor, held: HeldVoltage
) -> Expr:
    def seconds(name: str, start: float, text: str) -> Expr:
        return m.parameter(name, start, "s", text, minimum=0, source=SOURCE)

    def number(name: str, start: float, text: str, least: float | None = None) -> Expr:
        return m.parameter(name, start, "pu", text, base="S_n", minimum=least, source=SOURCE)

    def voltage(name: str, start: float, text: str) -> Expr:
        return m.parameter(name, start, "pu", text, base="bus", minimum=0, source=SOURCE)

    T_filter = seconds("Ts1", 0.017, "Lag of the measurement; 0 leaves it out")
    most_error = voltage("Vemax", 0.083, "Limit of the voltage error")
    leads = seconds("Ts2", 0.013, "Lead"), seconds("Ts4", 0.019, "Second lead")
    lags = (
        seconds("Ts3", 0.071, "Lag; 0 leaves the stage out"),
        seconds("Ts5", 0.097, "Second lag; 0 leaves the stage out"),
    )
    K_SVS = number("Ksvs", 73.0, "Gain, susceptance per voltage", 1e-3)
    K_SD = number("Ksd", 2.4, "Gain of the override, susceptance per voltage", 0)
    B_MAX = number("Bmax", 1.41, "Largest susceptance")
    high, low = (
        number("Bpmax", 1.23, "Susceptance of the override at low voltage"),
        number("Bpmin", -0.51, "Susceptance of the override at high voltage"),
    )
    B_MIN = number("Bmin", -0.62, "Smallest susceptance")
    T_thyristors = seconds("Ts6", 0.043, "Lag of the thyristors' control; 0 leaves it out")
    D_V = voltage("DV", 0.061, "Voltage error of the override; 0: Bpmax/Ksvs and Bpmin/Ksvs")

    B_0 = initial_susceptance(m, port)
    error_0 = B_0 / K_SVS
    chosen = D_V <= 0
    above = if_else(chosen, high / K_SVS, D_V)
    below = if_else(chosen, low / K_SVS, -D_V)
    text = "the power flow's reactive power asks for a susceptance outside of Bmin to Bmax"
    m.require(B_0 - B_MIN + MOST_POWER, f"{text}: raise Q_0, or lower Bmin")
    m.require(B_MAX - B_0 + MOST_POWER, f"{text}: lower Q_0, or raise Bmax")
    text = (
        "the power flow's reactive power needs a voltage error beyond Vemax: raise Vemax, or Ksvs"
    )
    m.require(most_error - error_0 + MOST_POWER, text)
    m.require(most_error + error_0 + MOST_POWER, text)
    acts = "the override acts at the power flow's point already"
    too_high, too_low = above - error_0 + MOST_POWER, error_0 - below + MOST_POWER
    # with DV = 0 both limits go with 1/Ksvs, as the error does: Ksvs decides nothing
    given = f"{acts}: raise DV, or Ksvs"
    m.require(if_else(chosen, 1, too_high), given)
    m.require(if_else(chosen, 1, too_low), given)
    m.require(
        if_else(chosen, too_high, 1), f"{acts}, with DV = 0 at Bpmax: lower Q_0, or raise Bpmax"
    )
    m.require(
        if_else(chosen, too_low, 1), f"{acts}, with DV = 0 at Bpmin: raise Q_0, or lower Bpmin"
    )

    reference = m.calculated("Vref", held.start + error_0, "pu", "Voltage reference", base="bus")
    seen = low_pass_or_nothing(m, "measured", held.now, T_filter, held.start)
    error = reference - seen
    first = lead_lag(m, "first", limit(error, most_error), leads[0], lags[0], error_0)
    second = lead_lag(m, "second", first, leads[1], lags[1], error_0)
    raised = high + K_SD * (error - above)
    asked = if_else(error > above, raised, if_else(error < below, low, K_SVS * second))
    return limited_low_pass(m, "susceptance", asked, T_thyristors, B_MIN, B_MAX, initial=B_0)
