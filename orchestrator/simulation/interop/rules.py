"""The choices by which masters differ, each of which changes the digits of a result, and the masters that are known."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from fmus.toolchain.plugins import Collections
from orchestrator.core.errors import InputError
from orchestrator.systems.coupling.schedule import FirstInputs, Schedule

Steps = Literal["side by side", "in turn"]
"""Jacobi: all components step with the outputs of the step before. Gauss-Seidel: each sees those that stepped first."""

LastLabel = Literal["stop", "before stop", "sum below stop", "sum up to stop"]
"""The label of the last row.

Either the stop time, or one step before it. A master that sums up the time step by step ends where rounding decides: at
the last label below the stop time, or at the last label that a step reaches without passing the stop time.
"""


@dataclass(frozen=True, slots=True)
class MasterRules:
    # name, title: ``name`` is the word on the command line. ``title`` is the name for people, with the version that was
    # examined.
    name: str
    title: str
    steps: Steps  # jacobi or Gauss-Seidel
    # what connected inputs hold in the first step; see `FirstInputs`
    first_inputs: FirstInputs = "consistent"
    # a row labelled t holds what t/H + ``early_label`` steps gave: 1 where the time is noted before the step and the
    # outputs after it
    early_label: int = 0
    # outputs are recorded after the inputs for the next step were handed over; else with the inputs of the step
    after_exchange: bool = False
    # extrapolation, wire_by_wire, ticks_per_second: see `Schedule`
    extrapolation: float = 0.0
    wire_by_wire: bool = False
    ticks_per_second: int | None = None
    last_label: LastLabel = "stop"  # see `LastLabel`
    # where in the master's source code or in the test results each choice can be seen
    source: str = ""

    def schedule(self, components: Sequence[str], order: Sequence[str] | None = None) -> Schedule:
        """The schedule for a system.

        ``components``: names of all components, in the order in which the master was given them.
        ``order``: order in which the components step, if it differs from ``components``; only Gauss-Seidel has one.
        Raises an `InputError` if the master steps all components side by side and an order is given, or the order does
        not list every component once."""
        if self.steps == "side by side":
            if order is not None:
                raise InputError(
                    f"{self.title} steps all components side by side, so that they have no order"
                )
            groups: tuple[tuple[str, ...], ...] = (tuple(components),)
        else:
            groups = tuple((name,) for name in (order or components))
        chosen = Schedule(
            self.name,
            groups,
            self.first_inputs,
            self.extrapolation,
            self.wire_by_wire,
            self.ticks_per_second,
        )
        chosen.check(set(components))
        return chosen

    def rows(self, step_size: float, stop_time: float) -> int:
        if not self.last_label.startswith("sum"):
            return round(stop_time / step_size) + (self.last_label == "stop")
        time, steps, ahead = 0.0, 0, step_size if self.last_label == "sum up to stop" else 0.0
        while time + ahead < stop_time or (ahead and time + ahead == stop_time):
            time += step_size
            steps += 1
        return steps + bool(ahead)


MASTERS: Collections[MasterRules] = Collections("gfor_cosim.masters", (MasterRules,))
"""Masters by the word on the command line, ours first."""


def master_rules(name: str) -> MasterRules:
    if name not in MASTERS:
        raise InputError(
            f"there is no master {name!r} to run like; known are: {', '.join(MASTERS)}"
        )
    return MASTERS[name]
