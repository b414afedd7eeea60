"""Where the time of a run goes: calls, seconds and share of every FMU, and of the coupling itself."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class ComponentStatistics:
    """Statistics of one component: number of steps, time inside FMI calls [s], and its share of the run's threads."""

    name: str
    steps: int
    seconds: float
    share: float


@dataclass(slots=True)
class StepCounts:
    accepted: int = 0  # steps that count, in pairs of equal length
    # pairs that were taken back, because their error was too large or a component refused them
    rejected: int = 0
    # shortest, longest: of the steps that count [s]
    shortest: float = float("inf")
    longest: float = 0.0

    def accept(self, count: int, step_size: float) -> None:
        self.accepted += count
        self.shortest, self.longest = min(self.shortest, step_size), max(self.longest, step_size)


@dataclass(frozen=True, slots=True)
class StepStatistics:
    # steps, seconds: steps that count, and wall-clock time [s] they took, recording included
    steps: int
    seconds: float
    # In the order of the schedule. What is left of the time is the coupling, the observers, and threads that wait.
    components: tuple[ComponentStatistics, ...]
    simulated: float = 0.0  # time that was simulated [s]
    threads: int = 1
    # by component, why only one thread may step it
    one_thread: Mapping[str, str] = field(default_factory=dict)
    adaptive: StepCounts | None = None

    @property
    def steps_per_second(self) -> float:
        return self.steps / self.seconds if self.seconds > 0 else 0.0

    @property
    def real_time_factor(self) -> float:
        """Simulated time by wall-clock time; above 1 the run was faster than real time."""
        return self.simulated / self.seconds if self.seconds > 0 else 0.0

    @property
    def share_in_fmus(self) -> float:
        """Part of all threads' stepping time that was spent inside FMI calls, 0 to 1."""
        return sum(c.share for c in self.components)
