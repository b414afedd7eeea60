"""Time as an integer number of communication steps: it never drifts and events hit their step exactly."""

import math
from dataclasses import dataclass

from orchestrator.core.errors import InputError


@dataclass(frozen=True, slots=True)
class Clock:
    """Communication points t = k·H."""

    step_size: float

    def __post_init__(self) -> None:
        if not (self.step_size > 0 and math.isfinite(self.step_size)):
            raise InputError(
                f"communication step size {self.step_size!r} s: it must exceed 0 and be finite"
            )

    def time(self, index: int) -> float:
        return index * self.step_size

    def index(self, time: float, what: str) -> int:
        if not math.isfinite(time):
            raise InputError(f"{what} at {time} s is not a time; give a finite number of seconds")
        index = round(time / self.step_size)
        if index < 0 or abs(time - self.time(index)) > 1e-6 * self.step_size:
            raise InputError(
                f"{what} at {time:g} s is not a communication point; with steps of {self.step_size:g} s the nearest is "
                f"{self.time(max(index, 0)):g} s"
            )
        return index
