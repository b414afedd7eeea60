"""Runs of one device that are made side by side: its instances step together, each with the bits that it has alone.

A run asks for steps, and goes on with what an instance answered. So one run by itself and several together are made by
the same code."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import TypeVar

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import CosimError
from orchestrator.devices.fmi.component import Component
from orchestrator.studies.black_box.bench import drive, drive_beside

Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class StepsAsked:
    """Steps that a run asks for, as `drive` makes them."""

    names: tuple[Sequence[str], Sequence[str]]
    inputs: Numbers
    step_size: float
    index: int = 0
    late: Numbers | None = None

    def goes_beside(self, other: StepsAsked) -> bool:
        """Return whether both can be made in one call: they differ in their rows alone."""
        mine, others = (
            (one.names, len(one.inputs), one.step_size, one.index, one.late is None)
            for one in (self, other)
        )
        return mine == others


AskingRun = Generator[StepsAsked, Numbers, Outcome]
"""A run that asks for steps and is sent the outputs after each."""


def run_alone(run: AskingRun[Outcome], component: Component) -> Outcome:
    """The outcome of a run by itself."""
    try:
        asked = next(run)
        while True:
            outputs = drive(
                component,
                asked.names,
                asked.inputs,
                asked.step_size,
                asked.index,
                late=asked.late,
            )
            asked = run.send(outputs)
    except StopIteration as end:
        outcome: Outcome = end.value
        return outcome


@dataclass
class Lane:
    """A run with its instance, and the steps that it waits for."""

    number: int  # among all runs
    component: Component
    run: AskingRun[object]
    asked: StepsAsked


def run_beside(
    runs: Sequence[AskingRun[Outcome]], components: list[Component]
) -> dict[int, Outcome]:
    """The outcomes of runs side by side, by their number; none of one that fails, whose instance is closed.

    ``components``: one for each run; those that failed are taken out."""
    found: dict[int, Outcome] = {}
    waiting: list[Lane] = []

    def go_on(number: int, component: Component, outputs: Numbers | None) -> None:
        """Let a run go on with outputs until it asks again; ``None`` lets it begin."""
        run = runs[number]
        try:
            asked = next(run) if outputs is None else run.send(outputs)
        except StopIteration as end:
            found[number] = end.value
        except CosimError:
            fail(component)
        else:
            waiting.append(Lane(number, component, run, asked))

    def fail(component: Component) -> None:
        components.remove(component)
        component.close()

    for number, component in enumerate(list(components)):
        go_on(number, component, None)
    while waiting:
        first = waiting[0].asked
        lanes = [one for one in waiting if one.asked.goes_beside(first)]
        waiting[:] = [one for one in waiting if not one.asked.goes_beside(first)]
        late = [one.asked.late for one in lanes if one.asked.late is not None] or None
        answers = drive_beside(
            [one.component for one in lanes],
            first.names,
            [one.asked.inputs for one in lanes],
            first.step_size,
            first.index,
            late,
        )
        for lane, outputs in zip(lanes, answers, strict=True):
            if outputs is None:
                fail(lane.component)
            else:
                go_on(lane.number, lane.component, outputs)
    return found
