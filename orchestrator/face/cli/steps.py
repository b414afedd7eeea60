"""``gfor steps``: the largest communication step within a given error, for each schedule."""

import argparse

import numpy as np

from orchestrator.face.api.scenario import steps_of
from orchestrator.face.cli.arguments import add_json_argument, add_request_arguments, asked_by
from orchestrator.face.cli.case_arguments import add_case_arguments, chosen
from orchestrator.face.cli.terminal import make_console, print_json
from orchestrator.linear.spectra.modes import damping_percent
from orchestrator.output.report.tables import make_table
from orchestrator.studies.modes.request import StepsRequest
from orchestrator.studies.modes.step_choice import Allowed, StepChoice, TriedStep, step_choice_json


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
    console.print(
        f"{choice.prepared.title}: critical modes without a communication step, least damped first: "
        + "; ".join(
            f"{z.imag / (2 * np.pi):.4g} Hz, {damping_percent(z):.2f} %" for z in choice.critical
        )
    )
    headings = ("Schedule", "Step", "Δf [mHz]", "Δξ [points]", "Growth [1/s]", "Verdict")
    table = make_table("Steps", *headings)
    for trial in choice.trials:
        step = f"{1e6 * trial.step_size:g} µs"
        if trial.refused:
            table.add_row(trial.schedule, step, "–", "–", "–", "not possible")
            continue
        hertz, points = (
            float(errors[np.argmax(np.abs(errors))]) for errors in (trial.hertz, trial.points)
        )
        growth = f"{trial.growth:+.3g}" if trial.growth else "none"
        table.add_row(
            trial.schedule,
            step,
            f"{1e3 * hertz:+.3g}",
            f"{points:+.3g}",
            growth,
            _verdict(trial, choice.allowed),
        )
    console.print(table)
    if choice.left_out:
        steps = ", ".join(f"{1e6 * step:g} µs" for step in choice.left_out)
        console.print(
            f"not tried, as an event or the end of the run does not fall on it: {steps}",
            style="yellow",
        )
    for text in dict.fromkeys(f"{t.schedule}: {t.refused}" for t in choice.trials if t.refused):
        console.print(text, style="yellow")
    for text in dict.fromkeys(doubt for trial in choice.trials for doubt in trial.doubts):
        console.print(text, style="yellow")
    console.print(
        f"Largest step within {choice.allowed.hertz:g} Hz and {choice.allowed.points:g} points of damping:"
    )
    for name in choice.schedules:
        best = choice.largest(name)
        said = "none of those tried" if best is None else f"{1e6 * best.step_size:g} µs"
        if best is choice.of(name)[-1]:
            said += ", the longest that was tried"
        islands = choice.islands(name)
        if islands:
            longer = ", ".join(f"{1e6 * trial.step_size:g} µs" for trial in islands)
            said += f" (not {longer}: within the error, but a shorter step is not)"
        console.print(f"  {name}: {said}")
    console.print(
        "The figures hold for small deviations from the operating point; faults and limits that begin to act need a "
        "run of their own at half the step."
    )


def _verdict(trial: TriedStep, allowed: Allowed) -> str:
    if not trial.stable:
        return "UNSTABLE"
    if trial.doubts:
        return "in doubt"
    return "within" if trial.is_within(allowed) else "too long"
