"""The master: brings FMUs to life, exchanges their values, and steps them along a schedule."""

from collections.abc import Sequence

from orchestrator.coupling.events import Event, Forcing
from orchestrator.coupling.observers import Observer
from orchestrator.coupling.run import Run
from orchestrator.coupling.run_state import NOT_KEPT, Keeper
from orchestrator.coupling.statistics import StepStatistics
from orchestrator.coupling.stepping import Stepper
from orchestrator.fmi.interrupts import calls


class Master(Stepper):
    """A running system; use it as a context manager, so that every FMU is released.

    ``system``: Components and connections; every input must be fed or constant.
    ``schedule``: Order of the components within a communication step.
    ``step_size``: Communication step H [s].
    ``stop_time``: Told to the FMUs at set-up [s].
    ``opener``: Brings a component to life, from its name, its plan and the folder with its FMU's files.
    ``threads``: How many step FMUs; None for as many as make a step shortest, up to one for each core. No value depends
    on it.

    ``index``, ``time``: Number of communication steps done, and the time [s] reached.
    ``y``: All coupled outputs, shape (n,), as last exchanged; their names are ``output_names``.
    ``tracks``: Where each of them went, step by step, since an observer last looked.
    ``late_starts``: By component, which output was another just after initialisation than just before its end, at the
    same inputs. Its partners were initialised with the first value.
    ``wires``: The connections that do more than carry a value."""

    def run(
        self, stop_time: float, events: Sequence[Event] = (), observers: Sequence[Observer] = (),
        keeper: Keeper = NOT_KEPT,
    ) -> StepStatistics:  # fmt: skip
        """Step until a time [s].

        An event happens at its communication point before the step that starts there, and the
        outputs of its components are read again, so that its partners see the change at once.

        ``stop_time``: [s]
        ``keeper``: Says where an earlier run of the same system is taken up, and keeps this one's state when it is due,
        at the end, and where an interrupt ends it."""
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
