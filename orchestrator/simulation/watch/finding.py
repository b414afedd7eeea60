"""One finding about a run, in words and for programs."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil
from typing import Any, Literal

Kind = Literal[
    "growth",
    "growing_oscillation",
    "sustained_oscillation",
    "run_away",
    "excursion",
    "undisturbed_motion",
    "active_limit",
    "loss_of_synchronism",
    "not_judged",
    "not_finite",
    "failure",
    "misfit",
    "trip",
    "stall",
    "interruption",
    "bench_resonance",
]

UNSTABLE: frozenset[Kind] = frozenset(
    (
        "growth",
        "growing_oscillation",
        "sustained_oscillation",
        "run_away",
        "loss_of_synchronism",
        "not_finite",
        "failure",
    )
)
"""Kinds of finding that a stable system cannot give. ``not_judged`` is a remark: noise hides what there may
be, or the run ends too early after an event; ``misfit`` is of a device and its binding, whatever the run does."""

EXCURSION: Kind = "excursion"
"""Kind of finding of a speed that left what grid codes allow for longer than they let it, and came back."""

MISFIT: Kind = "misfit"

NOT_JUDGED: Kind = "not_judged"

TRIP: Kind = "trip"
"""Kind of finding of a relay that acted; what it does to the system, the others tell."""

LIMIT: Kind = "active_limit"

STALL: Kind = "stall"
"""Kind of finding of a motor that stands still or nearly; what that does to the system, the others tell."""

INTERRUPTION: Kind = "interruption"
"""Kind of finding of a DC line that is blocked or bypassed; what that does to the system, the others tell."""

# of a test bench whose own capacitance makes the oscillation: the response tells nothing of the device in a grid
BENCH_RESONANCE: Kind = "bench_resonance"


_ROUNDING = 1e-9  # part of a hundredth by which a whole one may be missed in floats


def rounded_up(time: float) -> float:
    """Round a time up to whole hundredths [s]: a run that is told to stop there is not shorter than it."""
    return ceil(100 * time - _ROUNDING) / 100


def go_on_to(time: float) -> str:
    return f"let the run go on to t = {time:.12g} s"


def remedy_of(enough: float | None) -> str:
    """Say what shows what a stretch is too short for: a longer run [s], or with None a later next event."""
    return "give the events more distance" if enough is None else go_on_to(enough)


@dataclass(frozen=True, slots=True)
class Finding:
    kind: Kind
    time: float  # when it began [s]
    # component, variable: the component and variable that show the fault most, or whose limit acts
    component: str
    variable: str
    message: str
    # its end [s]; None if it lasts to the end of the run, or has no duration
    until: float | None = None
    # by name, with the unit in it or in the variable's: growth rates, frequencies, amplitudes, durations
    figures: Mapping[str, float] = field(default_factory=dict)
    represented: bool = True  # False of a limit that would act and that the model lacks
    what: str = ""  # of a limit, what it is: "limiter of overexcitation"
    # stop of a longer run that shows what this one does not [s], as the message has it; None where none is told
    enough: float | None = None

    def asking_for(self, stop: float) -> "Finding":
        """Return the finding, its message with a longer stop [s] where it tells one."""
        if self.enough is None or stop <= self.enough:
            return self
        message = self.message.replace(go_on_to(self.enough), go_on_to(stop))
        return replace(self, message=message, enough=stop)

    def as_json(self) -> dict[str, Any]:
        return {
            "kind": self.kind,
            "time": self.time,
            "until": self.until,
            "component": self.component,
            "variable": self.variable,
            "message": self.message,
            **self.figures,
            **({} if self.represented else {"represented": False}),
        }
