"""A limit of an FMU, described by the variables that show when it acts."""

from collections.abc import Container
from dataclasses import dataclass

BYPASS_TIME = 0.01
"""Time constant [s] with which the state of a block that is left out follows its input, as the models have it."""


@dataclass(frozen=True)
class Lead:
    """The limited quantity, reconstructed as signal + T/gain·(d state/dt) from the state of a block or of a control's
    integrator."""

    state: str
    # time, gain: parameters with T [s] and the gain; None stands for 1
    time: str
    gain: str | None = None
    # parameter with the lag of a lead/lag, whose block is left out where it is 0; its state then follows the input with
    # `BYPASS_TIME`, and T is that time
    lag: str | None = None


@dataclass(frozen=True)
class Limit:
    """The variables of an FMU that show an active limit. The limit is watched if the FMU has all of them."""

    name: str
    signal: str
    # parameter with the limit of the magnitude, or the upper one where there is a lower one; None if the signal is
    # given as a part of the limit
    limit: str | None
    # reconstruction of the limited quantity from a derivative, if the signal only follows this quantity
    lead: Lead | None = None
    enabled: str | None = None  # switch that must be on for the limited signal to have an effect
    represented: bool = True  # Whether the model has the limit. Otherwise the FMU only shows when the limit would act.
    low: str | None = None  # parameter with the lower limit; None if the magnitude is limited
    scale: str | None = None  # signal that both limits are multiplied by
    unless: str | None = None  # Parameter that is above 0 where another limit acts instead. An FMU need not have it.
    knows: tuple[str, ...] = ()
    lacks: tuple[str, ...] = ()

    def variables(self) -> tuple[str, ...]:
        derivative = None if self.lead is None else f"der({self.lead.state})"
        return tuple(name for name in (self.signal, derivative, self.scale) if name is not None)

    def needed(self) -> tuple[str, ...]:
        lead = (self.lead.time, self.lead.gain, self.lead.lag) if self.lead is not None else ()
        parameters = (self.limit, self.low, self.enabled, *lead)
        return (*self.variables(), *self.knows, *(p for p in parameters if p is not None))

    def fits(self, variables: Container[str]) -> bool:
        return all(name in variables for name in self.needed()) and not any(name in variables for name in self.lacks)
