"""The values of parameters over a run: those that components start with, and those that events give them."""

from collections.abc import Sequence

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.coupling.events import Event
from orchestrator.coupling.system import System


class Settings:
    """Parameters of a system at the times of the looks [s]."""

    def __init__(self, system: System, events: Sequence[Event], times: Numbers) -> None:
        self._system, self._times = system, times
        self._changes = [
            (event.time, f"{name}.{variable}", float(value))
            for event in sorted(events, key=lambda e: e.time)
            for name, settings in event.changes().items()
            for variable, value in settings.items()
        ]

    def values(self, component: str, parameter: str) -> Numbers:
        """A parameter or switch (1 or 0) at every look, shape (n,)."""
        plan = self._system.components[component]
        held = np.full(len(self._times), plan.number(parameter))
        for time, name, value in self._changes:
            if name == f"{component}.{parameter}":
                held[self._times > time] = value  # what is seen at an event's time is from before it
        return held

    def effective_times(self) -> list[float]:
        """When an event sets anything to another value than it has [s]."""
        now: dict[str, float | None] = {}
        found = set()
        for time, name, value in self._changes:
            if name not in now:
                component, _, variable = name.partition(".")
                plan = self._system.components[component]
                now[name] = None if plan.value(variable) is None else plan.number(variable)
            if value != now[name]:
                found.add(time)
            now[name] = value
        return sorted(found)

    def connected(self, component: str) -> Numbers:
        """Whether a component is on the grid: its own breaker, and the grid's port for it; 1 or 0, shape (n,)."""
        held = np.ones(len(self._times))
        for name, plan in self._system.components.items():
            switch = "connected" if name == component else f"{component}.connected"
            if switch in plan.description.variables and plan.value(switch) is not None:
                held *= self.values(name, switch) > 0
        return held
