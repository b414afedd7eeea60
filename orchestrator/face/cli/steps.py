"""``gfor steps``: the largest communication step within a given error, for each schedule."""

import argparse
from collections.abc import Iterator

import numpy as np

from orchestrator.face.api.scenario import steps_of
from orchestrator.face.cli.arguments import add_json_argument, add_request_arguments, asked_by
from orchestrator.face.cli.case_arguments import add_case_arguments, chosen
from orchestrator.face.cli.terminal import make_console, print_json
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.output.report.terminal_tables import PlainTable, make_table
from orchestrator.studies.modes.request import StepsRequest
from orchestrator.studies.modes.step_choice import Allowed, StepChoice, TriedStep, step_choice_json
from orchestrator.systems.coupling.schedule import ScheduleName


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    add_request_arguments(parser, StepsRequest)
    add_json_argument(parser)


def run(options: argparse.Namespace) -> int:
    request = StepsRequest(**asked_by(options, StepsRequest))
    choices = [steps_of(scenario, request) for scenario in chosen(options)]
    if options.json:
        print_json([step_choice_json(choice) for choice in choices])
    else:
        for choice in choices:
            _print(choice)
    found = [any(choice.largest(name) for name in choice.schedules) for choice in choices]
    return 0 if all(found) else 1


def _print(choice: StepChoice) -> None:
    console = make_console()
    modes = (f"{z.imag / (2 * np.pi):.4g} Hz, {damping_percent(z):.2f} %" for z in choice.critical)
    title = choice.prepared.title
    console.print(
        f"{title}: critical modes without a communication step, least damped first: "
        + "; ".join(modes)
    )
    console.print(_table(choice))
    for text in _remarks(choice):
        console.print(text, style="yellow")
    console.print(
        f"Largest step within {choice.allowed.hertz:g} Hz and {choice.allowed.points:g} points of damping:"
    )
    for name in choice.schedules:
        console.print(f"  {name}: {_largest_step(choice, name)}")
    console.print(
        "The figures hold for small deviations from the operating point; faults and limits that begin to act need a "
        "run of their own at half the step."
    )


def _table(choice: StepChoice) -> PlainTable:
    """All steps that were tried, with the largest error of any critical mode."""
    headings = ("Schedule", "Step", "Δf [mHz]", "Δξ [points]", "Growth [1/s]", "Verdict")
    table = make_table("Steps", *headings)
    for trial in choice.trials:
        step = _microseconds(trial.step_size)
        if trial.refused:
            table.add_row(trial.schedule, step, "–", "–", "–", "not possible")
            continue
        hertz, points = (
            float(errors[np.argmax(np.abs(errors))]) for errors in (trial.hertz, trial.points)
        )
        growth = f"{trial.growth:+.3g}" if trial.growth else "none"
        table.add_row(
            *(trial.schedule, step, f"{1e3 * hertz:+.3g}", f"{points:+.3g}", growth),
            _verdict(trial, choice.allowed),
        )
    return table


def _remarks(choice: StepChoice) -> Iterator[str]:
    """Steps that were not tried or not possible, and doubts of those that were; each text once."""
    if choice.left_out:
        steps = ", ".join(map(_microseconds, choice.left_out))
        yield f"not tried, as an event or the end of the run does not fall on it: {steps}"
    yield from dict.fromkeys(f"{t.schedule}: {t.refused}" for t in choice.trials if t.refused)
    yield from dict.fromkeys(doubt for trial in choice.trials for doubt in trial.doubts)


def _largest_step(choice: StepChoice, schedule: ScheduleName) -> str:
    """The largest step of a schedule within the error, and longer ones that are within it by chance."""
    best = choice.largest(schedule)
    said = "none of those tried" if best is None else _microseconds(best.step_size)
    if best is choice.of(schedule)[-1]:
        said += ", the longest that was tried"
    islands = choice.islands(schedule)
    if islands:
        longer = ", ".join(_microseconds(trial.step_size) for trial in islands)
        said += f" (not {longer}: within the error, but a shorter step is not)"
    return said


def _microseconds(step: float) -> str:
    return f"{1e6 * step:g} µs"


def _verdict(trial: TriedStep, allowed: Allowed) -> str:
    if not trial.stable:
        return "UNSTABLE"
    if trial.doubts:
        return "in doubt"
    return "within" if trial.is_within(allowed) else "too long"
