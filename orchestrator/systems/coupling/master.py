"""The master: brings FMUs to life, exchanges their values, and steps them along a schedule."""

from collections.abc import Sequence

from orchestrator.core.interrupts import calls
from orchestrator.systems.coupling.events import Event, Forcing
from orchestrator.systems.coupling.observers import Observer
from orchestrator.systems.coupling.run import Run
from orchestrator.systems.coupling.run_state import NOT_KEPT, Keeper
from orchestrator.systems.coupling.statistics import StepStatistics
from orchestrator.systems.coupling.stepping import Stepper


class Master(Stepper):
    """A running system; use it as a context manager, so that every FMU is released.

    ``stop_time``: Told to the FMUs at set-up [s].
    ``opener``: Brings a component to life, from its name, its plan and the folder with its FMU's files.
    ``threads``: How many step FMUs; None for as many as make a step shortest. No value depends on it.

    ``late_starts``: By component, which output was another just after initialisation than just before its end, at the
    same inputs. Its partners were initialised with the first value. All else is `ObservedRun`'s."""

    def run(
        self,
        stop_time: float,
        events: Sequence[Event] = (),
        observers: Sequence[Observer] = (),
        keeper: Keeper = NOT_KEPT,
    ) -> StepStatistics:
        """Step until a time [s].

        An event happens at its communication point before the step that starts there, and the outputs of its components
        are read again, so that its partners see the change at once.

        ``keeper``: Says where an earlier run is taken up, and keeps this one's state when it is due and at the end."""
        calls.watch()  # again: a notebook hands Ctrl-C back to Python after each cell
        stop = self.clock.index(stop_time, "the stop")
        due: dict[int, list[Event]] = {}
        for event in events:
            index = self.clock.index(event.time, "an event")
            if isinstance(event, Forcing):
                for change in event.values(self.clock.step_size, stop_time):
                    due.setdefault(round(change.time / self.clock.step_size), []).append(change)
            else:
                due.setdefault(index, []).append(event)
        return Run(self, observers, keeper).until(stop, due)
