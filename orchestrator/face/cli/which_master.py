"""``gfor master which``: which schedule another tool runs."""

import argparse
from dataclasses import asdict
from typing import Any

from rich.console import Console

from fmus.toolchain.catalogue import build_model
from fmus.toolchain.compiler import TARGETS, host_platform
from fmus.toolchain.extras import require
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder, write_text
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import make_console, print_json
from orchestrator.output.report.terminal_tables import PlainTable
from orchestrator.simulation.interop.probe_result import Candidate, read_probe_result
from orchestrator.simulation.interop.which_master import (
    PROPERTIES,
    STEP_SIZE,
    STOP_TIME,
    Identified,
    identify,
    instructions,
)

_WORDS: dict[str, tuple[str, dict[Any, str]]] = {
    # property: what it is called, what its values mean
    "order": (
        "Components step",
        {
            "side by side": "side by side (Jacobi)",
            "a, then b": "a, then b (Gauss-Seidel)",
            "b, then a": "b, then a (Gauss-Seidel)",
        },
    ),
    "first_inputs": (
        "Inputs of the first step",
        {
            "consistent": "outputs, propagated until consistent",
            "once": "outputs as read after initialisation",
            "start": "their start values",
            "zero": "zero",
        },
    ),
    "extrapolation": (
        "Inputs within a step",
        {
            0.0: "held",
            0.5: "extrapolated to the middle of the step",
            1.0: "extrapolated to the end of the step",
        },
    ),
    "wire_by_wire": ("Connections are served", {False: "all at once", True: "one after the other"}),
    "after_exchange": (
        "Outputs are recorded",
        {False: "with the inputs of the step", True: "with the inputs of the next step"},
    ),
    "early_label": (
        "A row labelled t holds",
        {
            0: "what is reached at t",
            1: "what is reached one step after t",
            -1: "what was reached one step before t",
        },
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(
        parser, "which_master", platforms=sorted(TARGETS), STEP_SIZE=STEP_SIZE, STOP_TIME=STOP_TIME
    )


def run(options: argparse.Namespace) -> int:
    """Write the probe pair, or tell which schedule gave a result: 1 where none of those known does."""
    if (options.build is None) == (options.result is None):
        raise InputError("give either the tool's RESULT.csv, or --build DIR for the probe pair")
    if options.build is not None:
        return _build(options)
    named = dict(_read_column(text) for text in options.column)
    verdict = identify(read_probe_result(options.result, named), options.step, options.stop)
    if options.json:
        told = {
            name: a[0] if len(a) == 1 else None
            for name in PROPERTIES
            for a in [verdict.answers(name)]
        }
        print_json(
            {
                "fits": [asdict(fit) for fit in verdict.fits],
                "told": told,
                "nearest": asdict(verdict.nearest),
                "difference": verdict.difference,
                "rows": verdict.rows,
                "steps": verdict.steps,
                "intervals": verdict.intervals,
                "masters": list(verdict.masters),
            }
        )
    else:
        _print(verdict, make_console())
    return 0 if verdict.fits else 1


def _build(options: argparse.Namespace) -> int:
    require("building the probe FMUs", "ziglang")
    from fmus.toolchain.exporter import export  # noqa: PLC0415 - needs the extra `build`
    from fmus.toolchain.native_fmu import NativeFmu  # noqa: PLC0415 - as above

    folder, host = made_folder(options.build, "--build"), host_platform()
    platforms = tuple(options.platform or ([host] if host else []))
    for name in ("probe_a", "probe_b"):
        print(export(NativeFmu(build_model(name)), folder, platforms))
    path = folder / "INSTRUCTIONS.md"
    write_text(path, instructions(options.step, options.stop, platforms))
    print(path)
    return 0


def _read_column(text: str) -> tuple[str, str]:
    signal, equals, heading = text.partition("=")
    if not equals or not heading:
        raise InputError(f"--column {text}: write SIGNAL=HEADING, such as a.y=Probe1.Output")
    return signal.strip(), heading.strip()


def _print(verdict: Identified, console: Console) -> None:
    compared = f"{verdict.rows} rows compared, largest difference {verdict.difference:.1e}"
    if not verdict.fits:
        console.print(
            f"None of the schedules known here gives these values ({compared}). The nearest is: "
            f"{_in_words(verdict.nearest)}.\nCheck connections, start values, --step and --stop; a master "
            "that repeats steps or solves for its inputs is not among them.",
            soft_wrap=True,
        )
        return
    table = PlainTable(title=f"Schedule ({compared})", title_justify="left", show_header=False)
    for name, (title, words) in _WORDS.items():
        told = [words[value] for value in verdict.answers(name)]
        table.add_row(title, told[0] if len(told) == 1 else "not told: " + " or ".join(told))
    table.add_row(
        f"Steps until the last row, {verdict.last_row * verdict.step_size:g} s",
        "not told" if verdict.steps is None else f"{verdict.steps} (N = {verdict.intervals})",
    )
    table.add_row("Known masters that do so", ", ".join(verdict.masters) or "none")
    console.print(table)
    if len(verdict.fits) > 1:
        console.print(
            "These schedules give the same values here:",
            *(f"- {_in_words(f)}" for f in verdict.fits),
            sep="\n",
            soft_wrap=True,
        )


def _in_words(candidate: Candidate) -> str:
    return "; ".join(
        f"{title.lower()} {words[getattr(candidate, name)]}"
        for name, (title, words) in _WORDS.items()
    )
