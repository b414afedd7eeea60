"""The values of parameters over a run: the start values, and the values that events set."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.systems.coupling.events import Event, Fault
from orchestrator.systems.coupling.imperfections import Noise, Quantisation
from orchestrator.systems.coupling.system import System

_FAULT = ".fault.on"  # the switch of a fault at a bus, whose values act only while it is on


def left_changed(
    system: System, events: Sequence[Event], until: float = math.inf
) -> Mapping[str, float | bool]:
    """Values by ``component.variable`` that are others after the events until a time [s] than at the start; without
    those of faults that are over."""
    now = {
        f"{name}.{variable}": value
        for event in sorted(events, key=lambda event: event.time)
        if event.time <= until
        for name, settings in event.changes().items()
        for variable, value in settings.items()
    }
    over = tuple(
        name.removesuffix("on")
        for name, value in now.items()
        if name.endswith(_FAULT) and not value
    )
    return {
        name: value
        for name, value in now.items()
        if not name.startswith(over) and value != _start(system, name)
    }


def _start(system: System, name: str) -> float | None:
    component, _, variable = name.partition(".")
    plan = system.components[component]
    return None if plan.value(variable) is None else plan.number(variable)


class Settings:
    """Parameters of a system at the times of the looks [s]."""

    def __init__(self, system: System, events: Sequence[Event], times: Numbers) -> None:
        self._system, self._events, self._times = system, events, times
        self._faults = {event.time for event in events if isinstance(event, Fault)}
        if any(
            isinstance(i, Noise | Quantisation)
            for plan in system.wires.values()
            for i in plan.permanent.values()
        ):
            self._faults.add(0.0)  # nothing stands still from the beginning
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
                # a look at an event's time shows the state before the event
                held[self._times > time] = value
        return held

    def effective_times(self) -> list[float]:
        """When an event sets anything to another value than it has, or a fault begins or ends [s]."""
        now: dict[str, float | None] = {}
        found = set(self._faults)
        for time, name, value in self._changes:
            if value != now.get(name, _start(self._system, name)):
                found.add(time)
            now[name] = value
        return sorted(found)

    def as_at_start(self, time: float) -> bool:
        """Tell if all that was set until a time [s] has its start value again, as after a fault that opens nothing."""
        return not left_changed(self._system, self._events, time) and all(
            fault > time for fault in self._faults
        )

    def ends_fault(self, time: float) -> bool:
        return any(
            when == time and name.endswith(_FAULT) and not on for when, name, on in self._changes
        )

    def connected(self, component: str) -> Numbers:
        """Tell if a component is on the grid, from its own breaker and the grid's port for it: 1 or 0, shape (n,)."""
        held = np.ones(len(self._times))
        for name, plan in self._system.components.items():
            switch = "connected" if name == component else f"{component}.connected"
            if switch in plan.description.variables and plan.value(switch) is not None:
                held *= self.values(name, switch) > 0
        return held
