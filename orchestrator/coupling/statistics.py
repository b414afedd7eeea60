"""Where the time of a run goes: calls, seconds and share of every FMU, and of the coupling itself."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ComponentStatistics:
    """Of one component: number of steps, time inside its FMI calls [s], and its share of the run."""

    name: str
    steps: int
    seconds: float
    share: float


@dataclass(frozen=True, slots=True)
class StepStatistics:
    """Of a whole run.

    Attributes
    ----------
    steps, seconds
        Communication steps done, and wall-clock time [s] they took, recording included.
    components
        In the order of the schedule. What is left of the time is the coupling and the observers.
    """

    steps: int
    seconds: float
    components: tuple[ComponentStatistics, ...]

    @property
    def steps_per_second(self) -> float:
        """Communication steps in a second of wall-clock time."""
        return self.steps / self.seconds if self.seconds > 0 else 0.0

    @property
    def share_in_fmus(self) -> float:
        """Part of the stepping time spent inside FMI calls, 0 to 1."""
        return sum(c.share for c in self.components)
