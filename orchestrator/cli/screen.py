"""``gfor screen``: operating points times outages, from options to points, files and words."""

import argparse
import shutil
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.cli.arguments import add_request_arguments, asked_by, option, repeatable
from orchestrator.cli.case_arguments import add_case_arguments, case_of, of_one_scenario
from orchestrator.cli.study import add_study_arguments, folder_of, last_line, present, working_in
from orchestrator.cli.terminal import make_console, make_errors, print_parts
from orchestrator.errors import InputError
from orchestrator.operating_points.item import Status
from orchestrator.points.store import POINTS
from orchestrator.safe_files import made_folder
from orchestrator.screening.request import ScreeningRequest
from orchestrator.screening.study import Shard, plan_screening
from orchestrator.screening.summary import Summary
from orchestrator.screening.view import STUDY, Screening, modes_table, overview, remarks, verdict


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    add_request_arguments(parser, ScreeningRequest)
    option(parser, "--shard", "I/N", "compute the part I of N only, and keep its points", read=Shard.parse)
    repeatable(parser, "--merge", "DIR", "take the points that a part kept there", read=Path)
    add_study_arguments(parser, "screen")


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if nothing has modes, or after an internal error."""
    of_case = of_one_scenario(options, "a screening is of one scenario")
    case = case_of(options)
    request = ScreeningRequest(**asked_by(options, ScreeningRequest))
    folder = folder_of(options, case.name, "screen")
    plan = partial(
        plan_screening, case, request.points, request.outages, wanted=request.region, whole=request.whole,
        sharing=request.sharing, **of_case,
    )  # fmt: skip
    with working_in(options, folder, STUDY, plan) as (planned, compute):
        _merge(options.merge, folder / POINTS)
        found = compute(options.shard)
        if options.shard is not None:
            part, whole = len(found.result.items), planned.number_of_items
            text = f"part {options.shard.number} of {options.shard.total}: {part} of {whole} items are kept in {folder}"
            said = remarks(found.summary) if found.summary.counts[Status.INTERNAL] else ()
            print_parts(make_console(stderr=options.json), [escape(text)])
            for text in said:
                make_errors().print(escape(text), soft_wrap=True)
            return _exit_code(found, found.summary.stable_here, fail_unstable=options.fail_unstable)
        end = last_line(found.result, "", folder, found.save(folder))
        present(options, found.as_json, _parts(found.summary), remarks(found.summary), end)
    return _exit_code(found, found.stable, fail_unstable=options.fail_unstable)


def _parts(summary: Summary) -> Iterator[RenderableType]:
    plan = summary.result.plan
    yield verdict(summary)
    if len(plan.outages) + len(plan.points) > 2:
        yield from ("", overview(summary))
    yield from ("", modes_table(summary), "")


def _exit_code(found: Screening, stable: bool | None, *, fail_unstable: bool) -> int:
    """1 if nothing has modes, after an internal error, and where ``--fail-unstable`` asks for it; of a part likewise.

    A part without a stretch has nothing that could fail."""
    counts, items = found.summary.counts, found.result.items
    failed = bool(items) and not counts[Status.COMPUTED]
    return int(failed or bool(counts[Status.INTERNAL]) or (fail_unstable and not stable))


def _merge(folders: Sequence[Path], store: Path) -> None:
    """Copy the points that parts kept elsewhere."""
    made_folder(store, "--out")
    for folder in folders:
        kept = sorted((folder / POINTS).glob("*.npz"))
        if not (folder / POINTS).is_dir():  # a part without a stretch keeps an empty folder
            raise InputError(
                f"--merge {folder}: no points are kept there; give the --out folder of a part (--shard I/N)"
            )
        for path in kept:
            if not (store / path.name).exists():
                shutil.copyfile(path, store / path.name)
