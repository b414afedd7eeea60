"""Delays of PSS/E's CDC6T: times behind which a line blocks, bypasses and comes back, and its stations' messages.

    blocked     at once below VBLOCK at the rectifier's bus; after TRB below VRB there; TCOM after the inverter's bus
                fell below VIB
    comes back  after TBLOCK at least, once the rectifier's bus has been above VUNBL for TRUB, and TCOM after the
                inverter's bus has been above VUNBY for TIUB
    bypassed    at once where the inverter's DC voltage is below VBYPAS; after TIY with its bus below VIY
    no longer   once its bus has been above VUNBY for TIUY, which begins when TBYPAS is over

A message to the other station holds, whatever the bus does while it travels. A time begins anew where its voltage
returns.

Source: the order of the fields and the control as STEPS has them (Shandong University, `CDC6T`); the names of the
fields are ours."""

from dataclasses import dataclass

from fmus.dc_line.orders import (
    AT_REST,
    Control,
    Interruptions,
    Latch,
    Triggers,
    declare_latch,
)
from fmus.synchronous_generator.data_lines import Given, declared, pu, seconds
from fmus.toolchain.blocks import RETURN_TIME
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.symbols import Expr, if_else, logic_and, logic_or

SOURCE = "PSS/E's CDC6T, with values for the benchmark line"

FIRMLY = 0.9
"""Value of a latch up to which what sets it goes on, so that nothing takes it back while it rises."""

LINES = (
    pu("VRB", 0.7, "Voltage of the rectifier's bus below which the line blocks in time", 0, "bus"),
    seconds("TRB", 0.05, "Time below VRB after which the line blocks"),
    seconds("TRUB", 0.02, "Time above VUNBL after which the rectifier may come back"),
    pu("VIB", 0.2, "Voltage of the inverter's bus below which it asks for blocking", 0, "bus"),
    seconds("TCOM", 0.02, "Time that a message takes from the inverter to the rectifier"),
    pu("VIY", 0.5, "Voltage of the inverter's bus below which it is bypassed in time", 0, "bus"),
    seconds("TIY", 0.05, "Time below VIY after which the inverter is bypassed"),
    seconds("TIUB", 0.02, "Time above VUNBY after which the inverter says that it may come back"),
    seconds("TIUY", 0.02, "Time above VUNBY, from the end of TBYPAS on, after which a bypass ends"),
)


@dataclass(frozen=True)
class _Span:
    """How long something lasts without a break [s]."""

    time: Expr

    def count(self, m: ModelBuilder, lasts: Expr) -> None:
        m.derivative(self.time, if_else(lasts, 1, -self.time / RETURN_TIME))

    def reaches(self, lasts: Expr, wanted: Expr) -> Expr:
        """Return whether it lasts, and has done so for a time [s]."""
        return logic_and(lasts, self.time >= wanted)


@dataclass(frozen=True)
class Delays:
    """The parameters, how long what each time waits for lasts, and the inverter's messages."""

    p: Given
    low: _Span
    high: _Span
    far_low: _Span
    far_high: _Span
    ends: _Span
    asks: Latch
    permits: Latch

    def triggers(
        self, m: ModelBuilder, control: Control, now: Interruptions, seen: Triggers
    ) -> Triggers:
        """Return what blocks, bypasses and ends both; ``seen``: what does so at once, without a delay."""
        own, limits = self.p, control.p
        v, far_v, state = seen.v, seen.far_v, now.condition
        blocks, bypasses = now.blocking.value, now.bypassing.value

        low = logic_and(blocks < FIRMLY, v < own.VRB)
        self.low.count(m, low)
        self.asks.close(m, logic_and(1 - state.blocked, far_v < own.VIB), 0, state.blocked)
        asked = logic_and(self.asks.acts, self.asks.timer >= own.TCOM)
        in_time = logic_or(self.low.reaches(low, own.TRB), asked)

        high = logic_and(blocks > AT_REST, v >= limits.VUNBL)
        self.high.count(m, high)
        far_high = logic_and(blocks > AT_REST, far_v >= limits.VUNBY)
        self.far_high.count(m, far_high)
        told = self.far_high.reaches(far_high, own.TIUB)
        self.permits.close(m, told, 0, 1 - state.blocked)
        permitted = logic_and(self.permits.acts, self.permits.timer >= own.TCOM)

        in_service = logic_or(1 - state.comes_back, bypasses > AT_REST)
        in_service = logic_and(in_service, logic_and(1 - state.blocked, bypasses < FIRMLY))
        far_low = logic_and(in_service, far_v < own.VIY)
        self.far_low.count(m, far_low)
        may_end = logic_and(bypasses > AT_REST, now.bypassing.timer >= limits.TBYPAS)
        ends = logic_and(may_end, far_v > limits.VUNBY)
        self.ends.count(m, ends)
        return Triggers(
            v,
            far_v,
            blocks=logic_or(seen.blocks, in_time),
            unblocks=logic_and(self.high.reaches(high, own.TRUB), permitted),
            bypasses=logic_or(seen.bypasses, self.far_low.reaches(far_low, own.TIY)),
            unbypasses=self.ends.reaches(ends, own.TIUY),
        )


def declare_delays(m: ModelBuilder) -> Delays:
    """Declare the parameters and the states of what CDC6T adds."""
    p = declared(m, LINES, SOURCE)
    with m.scope("delay"):
        spans = {
            name: _Span(m.state(name, 0.0, "s", text))
            for name, text in (
                ("low", "Time for which the rectifier's bus has been below VRB"),
                ("high", "Time for which it has been above VUNBL, of a blocked line"),
                ("far_low", "Time for which the inverter's bus has been below VIY"),
                ("far_high", "Time for which it has been above VUNBY, of a blocked line"),
                ("ends", "Time for which it has been, of a bypass that may end"),
            )
        }
        asks = declare_latch(m, "asks", "The inverter asks for blocking")
        permits = declare_latch(m, "permits", "The inverter says that it may come back")
    return Delays(p, **spans, asks=asks, permits=permits)
