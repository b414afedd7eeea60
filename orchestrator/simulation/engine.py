"""Engines: where the components of a run step if not in this process."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, Self

from fmus.toolchain.plugins import PlugIns
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.devices.fmi.component import Component
from orchestrator.simulation.federates import Federates
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.observers import Observer
from orchestrator.systems.coupling.system import ComponentPlan


class Engine(Protocol):
    """The components of one run elsewhere, from ``with`` to its end, which ends all that the engine has started."""

    # inside of ``with``: the scenario as the engine runs it
    prepared: PreparedScenario

    def __enter__(self) -> Self: ...

    def __exit__(self, *error: object) -> None: ...

    def open(self, name: str, plan: ComponentPlan, directory: Path) -> Component:
        """Open a component: of this process until `begin`, so that it is initialised and linearised as any other."""

    def begin(self, master: Master) -> None:
        """Take the initialised components over, before the run's first step."""

    def observers(self) -> Sequence[Observer]:
        """Observers of the run, such as one that tells the expected time."""

    def obstacle(self, component: Component) -> str | None:
        """Return why a component keeps the system from being linearised; None where it does not."""


ENGINES: PlugIns[Callable[[PreparedScenario, Federates], Engine]] = PlugIns(
    "gfor_cosim.engines", lambda: (type,)
)
"""Classes of engines by the name that ``--engine`` takes; the local one is none of them."""
