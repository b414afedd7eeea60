"""``gfor steps``: the largest communication step within a given error, for each schedule."""

import argparse

import numpy as np

from orchestrator.analysis.modes import damping_percent
from orchestrator.cli.arguments import option, seconds, switch
from orchestrator.cli.case_arguments import add_case_arguments, add_range_argument, prepare
from orchestrator.cli.terminal import make_console, print_json
from orchestrator.coupling.schedule import SCHEDULES
from orchestrator.report.tables import make_table
from orchestrator.study.step_choice import TRIED, Allowed, StepChoice, TriedStep, choose_step, step_choice_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    option(parser, "--error", "HZ:POINTS", "accepted error of a critical mode's frequency [Hz] and damping [points] "
           "(default: 0.001:0.1)", read=_error, default=Allowed())  # fmt: skip
    parser.add_argument("--try", dest="tried", type=_steps, default=[], metavar="H,H,...", help="communication steps "
                        "to try, such as '100 us,500 us' (default: 0.5 to 50 times the case's own)")  # fmt: skip
    parser.add_argument("--schedule", action="append", choices=SCHEDULES, default=None,
                        help=f"schedule to try (repeatable; default: {', '.join(TRIED)})")  # fmt: skip
    add_range_argument(parser, "frequencies of the critical modes [Hz] (default: 0.1:2)")
    switch(parser, "--json", "print JSON")


def _error(text: str) -> Allowed:
    parts = text.split(":")
    try:
        hertz, points = map(float, parts)
    except ValueError:
        raise ValueError(f"{text!r} is not of the form HZ:POINTS, such as 0.001:0.1") from None
    if not (0 < hertz < np.inf and 0 < points < np.inf):
        raise ValueError(f"{text!r}: both errors must be above 0 and finite")
    return Allowed(hertz, points)


def _steps(text: str) -> list[float]:
    return [seconds(part.strip()) for part in text.split(",")]


def run(options: argparse.Namespace) -> int:
    """Try, print, and return 1 where no schedule has a step within the error."""
    wanted = options.schedule
    options.schedule = None  # here it says what is tried, not how the case is prepared
    choices = [
        choose_step(prepared, options.error, options.tried, wanted or (), options.range)
        for prepared in prepare(options)
    ]
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
        + "; ".join(f"{z.imag / (2 * np.pi):.4g} Hz, {damping_percent(z):.2f} %" for z in choice.critical)
    )
    table = make_table("Steps", "Schedule", "Step", "Δf [mHz]", "Δξ [points]", "Growth [1/s]", "Verdict")
    for trial in choice.trials:
        step = f"{1e6 * trial.step_size:g} µs"
        if trial.refused:
            table.add_row(trial.schedule, step, "–", "–", "–", "not possible")
            continue
        hertz, points = (float(errors[np.argmax(np.abs(errors))]) for errors in (trial.hertz, trial.points))
        growth = f"{trial.growth:+.3g}" if trial.growth else "none"
        table.add_row(
            trial.schedule, step, f"{1e3 * hertz:+.3g}", f"{points:+.3g}", growth, _verdict(trial, choice.allowed)
        )
    console.print(table)
    if choice.left_out:
        steps = ", ".join(f"{1e6 * step:g} µs" for step in choice.left_out)
        console.print(f"not tried, as an event or the end of the run does not fall on it: {steps}", style="yellow")
    for text in dict.fromkeys(f"{t.schedule}: {t.refused}" for t in choice.trials if t.refused):
        console.print(text, style="yellow")
    for text in dict.fromkeys(doubt for trial in choice.trials for doubt in trial.doubts):
        console.print(text, style="yellow")
    console.print(f"Largest step within {choice.allowed.hertz:g} Hz and {choice.allowed.points:g} points of damping:")
    for name in choice.schedules:
        best = choice.largest(name)
        said = "none of those tried" if best is None else f"{1e6 * best.step_size:g} µs"
        if best is choice.of(name)[-1]:
            said += ", the longest that was tried"
        if islands := choice.islands(name):
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
