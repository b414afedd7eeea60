"""The values of parameters over a run: the start values, and the values that events set."""

from collections.abc import Sequence

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.coupling.events import BusFault, Event, Fault, WireFault, WireRecovery
from orchestrator.coupling.imperfections import Noise, Quantisation
from orchestrator.coupling.system import System


class Settings:
    """Parameters of a system at the times of the looks [s]."""

    def __init__(self, system: System, events: Sequence[Event], times: Numbers) -> None:
        self._system, self._times = system, times
        self._events = sorted(events, key=lambda e: e.time)
        self._faults = {event.time for event in events if isinstance(event, Fault)}
        if any(isinstance(i, Noise | Quantisation) for plan in system.wires.values() for i in plan.permanent.values()):
            self._faults.add(0.0)  # nothing stands still from the beginning
        self._changes = [
            (event.time, f"{name}.{variable}", float(value))
            for event in self._events
            for name, settings in event.changes().items()
            for variable, value in settings.items()
        ]

    def values(self, component: str, parameter: str) -> Numbers:
        """A parameter or switch (1 or 0) at every look, shape (n,)."""
        plan = self._system.components[component]
        held = np.full(len(self._times), plan.number(parameter))
        for time, name, value in self._changes:
            if name == f"{component}.{parameter}":
                held[self._times > time] = value  # a look at an event's time shows the state before the event
        return held

    def effective_times(self) -> list[float]:
        """When an event sets anything to another value than it has, or a fault begins or ends [s]."""
        now: dict[str, float | None] = {}
        found = set(self._faults)
        for time, name, value in self._changes:
            if name not in now:
                component, _, variable = name.partition(".")
                plan = self._system.components[component]
                now[name] = None if plan.value(variable) is None else plan.number(variable)
            if value != now[name]:
                found.add(time)
            now[name] = value
        return sorted(found)

    def as_at_start(self, time: float) -> bool:
        """Whether all that was set until a time [s] has its start value again, as after a fault that opens nothing."""
        if any(fault <= time for fault in self._faults):
            return False
        now = {name: value for when, name, value in self._changes if when <= time}
        for name, value in now.items():
            component, _, variable = name.partition(".")
            plan, fault = self._system.components[component], f"{name.rpartition('.')[0]}.on"
            of_an_ended_fault = name != fault and now.get(fault) == 0  # its R and X act no more
            if not of_an_ended_fault and (plan.value(variable) is None or plan.number(variable) != value):
                return False
        return True

    def during_fault(self, begin: float, end: float) -> bool:
        """Whether two times [s] are inside of one fault, its begin and its end included."""
        begun: dict[tuple[str, str], float] = {}
        for event in self._events:
            match event:
                case BusFault(component=component, bus=where, on=on):
                    key = (component, where)
                case WireFault(connection=connection) | WireRecovery(connection=connection):
                    key, on = (str(connection), ""), isinstance(event, WireFault)
                case _:
                    continue
            if on:
                begun.setdefault(key, event.time)
            elif begun.pop(key, end) <= begin and end <= event.time:
                return True
        return False

    def connected(self, component: str) -> Numbers:
        """Whether a component is on the grid, from its own breaker and the grid's port for it: 1 or 0, shape (n,)."""
        held = np.ones(len(self._times))
        for name, plan in self._system.components.items():
            switch = "connected" if name == component else f"{component}.connected"
            if switch in plan.description.variables and plan.value(switch) is not None:
                held *= self.values(name, switch) > 0
        return held
