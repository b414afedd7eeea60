"""One thing that a run did wrong, in words and for programs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["growth", "growing_oscillation", "sustained_oscillation", "run_away", "undisturbed_motion",
               "active_limit", "loss_of_synchronism", "not_finite", "failure"]  # fmt: skip

UNSTABLE: frozenset[Kind] = frozenset(
    {
        "growth",
        "growing_oscillation",
        "sustained_oscillation",
        "run_away",
        "loss_of_synchronism",
        "not_finite",
        "failure",
    }
)
"""Kinds of finding that no stable system gives."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What was seen, where and when.

    Attributes
    ----------
    time
        When it began [s].
    component, variable
        Where it shows most, or whose limit acts.
    message
        The whole finding in words.
    until
        When it was over [s]; None where it lasts to the end, or has no duration.
    figures
        By name, with the unit in it or in the variable's: growth rates, frequencies, amplitudes, durations.
    """

    kind: Kind
    time: float
    component: str
    variable: str
    message: str
    until: float | None = None
    figures: Mapping[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The finding for a summary."""
        return {
            "kind": self.kind,
            "time": self.time,
            "until": self.until,
            "component": self.component,
            "variable": self.variable,
            "message": self.message,
            **self.figures,
        }
