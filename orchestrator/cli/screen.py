"""``gfor screen``: operating points times outages, from options to points, files and words."""

import argparse
import shutil
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.api.studies import SCREENING
from orchestrator.asked import read_percent
from orchestrator.cases.sharing import SharingRule
from orchestrator.cli.arguments import Joined, option, repeatable, switch
from orchestrator.cli.case_arguments import add_case_arguments, add_range_argument, case_of, of_one_scenario
from orchestrator.cli.study import add_study_arguments, folder_of, last_line, present, working_in
from orchestrator.cli.terminal import make_console, make_errors, print_parts
from orchestrator.errors import InputError
from orchestrator.points.store import POINTS
from orchestrator.safe_files import made_folder
from orchestrator.screening.modes import MOST_DAMPING, CriticalRegion
from orchestrator.screening.record import Status
from orchestrator.screening.study import Shard, plan_screening
from orchestrator.screening.summary import Summary
from orchestrator.screening.view import Screening, modes_table, overview, remarks, verdict


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    option(parser, "--points", "FILE",
           "operating points: a CSV file, a row each (default: the case as it is)", read=Path)  # fmt: skip
    parser.add_argument(
        "--outages", action=Joined, metavar="WHICH",
        help="n-1, lines, units, or names such as line_1_2,sg3 or line_1_2+sg3 (repeatable)",
    )  # fmt: skip
    parser.add_argument(
        "--sharing", choices=[str(rule) for rule in SharingRule],
        help="who feeds what an outage takes: units by droop and rating (default), by rating, or the slack alone",
    )  # fmt: skip
    add_range_argument(parser)
    parser.add_argument(
        "--damping", type=partial(read_percent, most=100 * MOST_DAMPING), default=0.2, metavar="PERCENT",
        help="damping below which a mode is critical, at most 60 (default: 20)",
    )  # fmt: skip
    switch(parser, "--whole", "count growing modes of all frequencies at every point; takes longer")
    option(parser, "--shard", "I/N", "compute the part I of N only, and keep its points", read=Shard.parse)
    repeatable(parser, "--merge", "DIR", "take the points that a part kept there", read=Path)
    add_study_arguments(parser, "screen")


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if nothing has modes, or after an internal error."""
    of_case = of_one_scenario(options, "a screening is of one scenario")
    case = case_of(options)
    low, high = options.range
    wanted = CriticalRegion(low, high, options.damping)
    if not wanted.lowest_hz > 0:
        raise InputError(f"--range {wanted.lowest_hz:g}:{wanted.highest_hz:g}: a screening begins above 0 Hz")
    sharing = None if options.sharing is None else SharingRule(options.sharing)
    how = {"wanted": wanted, "whole": options.whole, "sharing": sharing, **of_case}
    folder = folder_of(options, case.name, "screen")
    plan = partial(plan_screening, case, options.points, options.outages, **how)
    with working_in(options, folder, SCREENING, plan) as (planned, compute):
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

    A part without a stretch has nothing that could fail.
    """
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
