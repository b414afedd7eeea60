"""``gfor certify --sensitivities``: what the failed criteria of a certificate would take."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape

from orchestrator.core.asked import read_part
from orchestrator.core.errors import InputError
from orchestrator.face.cli.arguments import add_options, choose_executor
from orchestrator.face.cli.interrupted import saying_how_it_goes_on
from orchestrator.face.cli.study import Progressing
from orchestrator.face.cli.terminal import print_parts
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes import needs_record
from orchestrator.studies.certification.codes.change_point import ChangeTask
from orchestrator.studies.certification.codes.what_it_takes import (
    CHANGE,
    confirm_changes,
    plan_changes,
    run_changes,
)


def add_sensitivity_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("what a failed criterion would take")
    change = read_part("a change in percent from 0.01 to 50, such as 5", 0.01, 50)
    add_options(group, "sensitivity", change=change, usual=100 * CHANGE)


def check_sensitivity_options(options: argparse.Namespace, codes: Sequence[str], norm: str) -> None:
    others = {
        "--parameter": options.parameter,
        "--fixed": options.fixed,
        "--change": options.change,
        "--confirm": options.confirm,
    }
    if not options.sensitivities:
        idle = [name for name, value in others.items() if value]
        if idle:
            raise InputError(
                f"{idle[0]}: it belongs to --sensitivities, which is not given; add it, or leave this out"
            )
        return
    if set(codes) <= {norm}:
        raise InputError(
            f"--sensitivities: --code {norm} has no rows that can be run again with another parameter; `gfor "
            "sensitivities` on the certificate's case file says how each parameter moves a mode"
        )


def find_needs(
    options: argparse.Namespace, certificate: Certificate, folder: Path, console: Console
) -> dict[str, Any] | None:
    """Run what failed rows would take, and write and print it; returns all figures, None where no row fails."""
    change = CHANGE if options.change is None else options.change
    plan = plan_changes(certificate, folder, options.parameter, fixed=options.fixed, change=change)
    if not plan.rows:
        console.print(
            "No row fails: there is nothing that a criterion would take.", highlight=False
        )
        return None
    console.print(escape(needs_record.plan_text(plan)), soft_wrap=True, highlight=False)
    progress = Progressing(folder)

    def computed(study: Any) -> Any:
        executor = choose_executor(options, [ChangeTask.__module__])
        return progress.compute(lambda report: study(executor, report), executor, console)

    with saying_how_it_goes_on(progress.how_it_goes_on), hold_folder(folder):
        needs = computed(lambda executor, report: run_changes(plan, executor, report))
        if options.confirm:
            computed(lambda executor, report: confirm_changes(plan, needs, executor, report))
        files = needs_record.save_needs(plan, needs, folder)
    if not options.json:
        for need in needs:
            console.print(needs_record.needs_table(need))
            print_parts(console, map(escape, needs_record.remarks_of(need)))
            if options.confirm:
                console.print(
                    escape(needs_record.confirmed_text(need)), soft_wrap=True, highlight=False
                )
            console.print("")
        text = needs_record.left_out_text(plan)
        if text:
            console.print(escape(f"Not changed: {text}"), soft_wrap=True, highlight=False)
        console.print(
            escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True
        )
    return needs_record.needs_json(plan, needs)
