"""``gfor modes``: steady state and eigenvalues of a case's scenarios."""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape

from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.face.api.scenario import Scenario, modes_of
from orchestrator.face.cli import terminal
from orchestrator.face.cli.arguments import add_options, add_request_arguments, asked_by
from orchestrator.face.cli.case_arguments import (
    add_case_arguments,
    add_excitation_arguments,
    chosen,
    excitation_given,
)
from orchestrator.face.cli.verdict import (
    add_details_argument,
    add_verdict_argument,
    exit_code,
    print_answers,
    print_details,
)
from orchestrator.linear.spectra.modes import damping_ratio, in_range
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.modes import beside
from orchestrator.studies.modes.all_modes import compute_all_modes, without_repeated
from orchestrator.studies.modes.dead_band_weight import growth_beyond_dead_bands
from orchestrator.studies.modes.load_model_weight import load_model_weights
from orchestrator.studies.modes.modes import ModesResult, modes_json
from orchestrator.studies.modes.request import ModesRequest
from orchestrator.studies.modes.tables import all_modes
from orchestrator.studies.runs.answer_of_modes import of_modes


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, schedule=True)
    add_request_arguments(parser, ModesRequest)
    add_options(parser, "modes")
    add_excitation_arguments(parser)
    add_options(parser, "modes 2")
    add_verdict_argument(parser)
    add_details_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Compute, print, and write what is asked for, while no other command works in the folder of the results."""
    if options.component is not None:
        return _with_a_black_box(options)
    excited = excitation_given(options)
    if excited:
        raise InputError(
            f"{excited[0]} is for a black box of its own: give --black-box --component NAME as well"
        )
    scenarios = chosen(options)
    request = ModesRequest(**asked_by(options, ModesRequest))
    request.check()
    folder = made_folder(options.out, "--out") if options.out else None
    with hold_folder(folder) if folder else nullcontext():
        return _compute(scenarios, request, options, folder)


def _with_a_black_box(options: argparse.Namespace) -> int:
    from orchestrator.face.cli import black_box  # noqa: PLC0415 - only here

    if not options.black_box:
        raise InputError(
            "--component names what is taken for a black box: give --black-box as well"
        )
    others = {
        "--critical": options.critical is not None,
        "--directional": options.directional,
        "--range": options.frequencies is not None,
        "--details": options.details,
    }
    given = [name for name, is_given in others.items() if is_given]
    if given:
        raise InputError(
            f"{given[0]} does not go with --component, which shows all modes of one black box; leave it out"
        )
    return black_box.run(options)


def _compute(
    scenarios: Sequence[Scenario],
    request: ModesRequest,
    options: argparse.Namespace,
    folder: Path | None,
) -> int:
    if request.black_box:
        with terminal.said_stages() as report:
            results = [
                modes_of(scenario, replace(request, report=report)) for scenario in scenarios
            ]
    else:
        prepared = [scenario.prepared for scenario in scenarios]
        results = compute_all_modes(
            prepared, request.frequencies, request.critical, directional=request.directional
        )
    told = without_repeated(results)
    shown = [first for first, _ in told]
    weights: list[str] = []
    if not options.black_box:
        by_name = {scenario.name: scenario for scenario in scenarios}
        of_shown = [by_name[first.prepared.name] for first in shown]
        weights += load_model_weights(of_shown, shown, request.frequencies)
        weights += growth_beyond_dead_bands(shown)
    written, said = [], [*beside.sentences_beside(results)]
    if folder:
        from orchestrator.studies.runs.files import write_modes  # noqa: PLC0415 - plots: a second to import

        written = write_modes(results, folder, weights, said)
    if options.json:
        terminal.print_json(modes_json(results, weights, said))
        return exit_code(options, [r.stability for r in results])
    console = terminal.make_console(names=results[0].prepared.names if results else None)
    answers = [of_modes(r) for r in shown]
    below = terminal.announced_questions(r.prepared for r in results)
    beside_answers = [*_repetitions(told), *said, *below]
    print_answers(console, answers, shown, beside_answers, details=options.details)
    _warn(told)
    terminal.say("question", weights)
    _show(console, shown, options, request)
    if folder:
        console.print(escape(f"Modes in {folder}: {', '.join(written)}"), soft_wrap=True)
    return exit_code(options, [r.stability for r in results])


def _warn(told: Sequence[tuple[ModesResult, Sequence[ModesResult]]]) -> None:
    """Say the warnings of results, and of those that repeat one what it does not say."""
    terminal.print_warnings([first for first, _ in told])
    for first, repeated in told:
        for result in repeated:
            own = [text for text in result.unasked if text not in first.unasked]
            terminal.warn(result.prepared.name, own)


def _show(
    console: Console,
    shown: Sequence[ModesResult],
    options: argparse.Namespace,
    request: ModesRequest,
) -> None:
    """Print the tables below the answers."""
    whole = len(shown) == 1 or options.details
    for result in shown:
        if result.critical is not None and not result.modes:
            none = _none_below(result, result.critical, request.frequencies)
            console.print(escape(none), highlight=False, soft_wrap=True)
        elif whole:
            console.print(all_modes(result, whole=options.details), "")
    shapes = whole or any(r.named for r in shown)
    terminal.print_named_modes(console, shown, shapes=shapes, details=options.details)
    terminal.print_sources(console, shown)
    if options.details:
        print_details(console, shown)
    if not whole:
        console.print(
            "All modes of each scenario, and who swings in them: --details, or one --scenario"
        )


def _repetitions(told: Sequence[tuple[ModesResult, Sequence[ModesResult]]]) -> Iterator[str]:
    """Yield a line for each result that others repeat."""
    for first, repeated in told:
        if repeated:
            named = ", ".join(result.prepared.name for result in repeated)
            own = "their own events" if len(repeated) > 1 else "its own events"
            yield f"{named}: the same modes as {first.prepared.name}; only {own} come later"


def _none_below(result: ModesResult, damping: float, hertz: tuple[float, float]) -> str:
    """The sentence in the place of an empty table, with the least damped mode where all eigenvalues are known.

    ``damping``: the ratio below which modes were looked for; ``hertz``: the range of their frequencies."""
    said = f"{result.prepared.title}: no mode from {hertz[0]:g} to {hertz[1]:g} Hz is below {100 * damping:g} %"
    values = np.array(result.eigenvalues, complex)
    values = values[in_range(values, *hertz)]
    if not len(values):
        return f"{said}."
    least = min(values, key=damping_ratio)
    at = f"{least.imag / (2 * np.pi):.4f} Hz"
    return f"{said}; the least damped has {100 * damping_ratio(least):.2f} %, at {at}."
