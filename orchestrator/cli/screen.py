"""``gfor screen``: operating points times outages, from options to points, files and words."""

import argparse
import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.api.screening import WORKERS_IMPORT, Screening, compute
from orchestrator.cases.case import load_case
from orchestrator.cases.sharing import SharingRule
from orchestrator.cli.arguments import Joined, frequency_range, percent
from orchestrator.cli.case_arguments import add_case_arguments, parameters, values_set
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.points import Progressing
from orchestrator.cli.terminal import make_console, make_errors, print_questions
from orchestrator.cli.verdict import add_verdict_argument
from orchestrator.errors import InputError
from orchestrator.points.store import POINTS
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder
from orchestrator.screening import tables
from orchestrator.screening.modes import MOST_DAMPING, CriticalRegion
from orchestrator.screening.record import Status
from orchestrator.screening.study import Shard, plan_screening


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    parser.add_argument(
        "--points", type=Path, metavar="FILE",
        help="operating points: a CSV file, a row each (default: the case as it is)",
    )  # fmt: skip
    parser.add_argument(
        "--outages", action=Joined, metavar="WHICH",
        help="n-1, lines, units, or names such as line_1_2,sg3 or line_1_2+sg3 (repeatable)",
    )  # fmt: skip
    parser.add_argument(
        "--sharing", choices=[str(rule) for rule in SharingRule],
        help="who feeds what an outage takes: units by droop and rating (default), by rating, or the slack alone",
    )  # fmt: skip
    parser.add_argument(
        "--range", type=frequency_range, default=ELECTROMECHANICAL_HZ, metavar="LO:HI", help="frequencies [Hz] (0.1:2)"
    )
    parser.add_argument(
        "--damping", type=_damping, default=0.2, metavar="PERCENT",
        help="damping below which a mode is critical, at most 60 (default: 20)",
    )  # fmt: skip
    parser.add_argument(
        "--whole", action="store_true", help="count growing modes of all frequencies at every point; takes longer"
    )
    parser.add_argument("--shard", type=_shard, metavar="I/N", help="compute the part I of N only, and keep its points")
    parser.add_argument(
        "--merge", action="append", default=[], type=Path, metavar="DIR", help="take the points that a part kept there"
    )
    add_executor_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/<case>_screen); points that are there are not computed again",
    )
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_verdict_argument(parser)


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if nothing has modes, or after an internal error."""
    if len(options.scenario) > 1:
        raise InputError("--scenario: a screening is of one scenario; start one for each")
    executor = choose_executor(options, WORKERS_IMPORT)
    case = load_case(options.case, trust_fmus=options.trust_fmus)
    low, high = options.range
    wanted = CriticalRegion(low, high, options.damping)
    if not wanted.lowest_hz > 0:
        raise InputError(f"--range {wanted.lowest_hz:g}:{wanted.highest_hz:g}: a screening begins above 0 Hz")
    name = options.scenario[0] if options.scenario else None
    planned = plan_screening(
        case,
        options.points,
        options.outages,
        name,
        values_set(options),
        options.step,
        wanted,
        parameters(options),
        whole=options.whole,
        sharing=None if options.sharing is None else SharingRule(options.sharing),
    )
    print_questions([planned.prepared], as_json=options.json)
    folder = made_folder(options.out or Path("results") / f"{case.name}_screen", "--out")
    progress, console = Progressing(folder), make_console(stderr=options.json)
    with saying_how_it_goes_on(progress.how_it_goes_on), held(folder):
        _merge(options.merge, folder / POINTS)
        found = progress.compute(
            lambda report: compute(planned, executor, folder, report, options.shard), executor, console
        )
        if options.shard is not None:
            part, whole = len(found.result.items), planned.number_of_items
            text = f"part {options.shard.number} of {options.shard.total}: {part} of {whole} items are kept in {folder}"
            console.print(escape(text), soft_wrap=True, highlight=False)
            for text in tables.remarks(found.summary) if found.summary.counts[Status.INTERNAL] else ():
                make_errors().print(escape(text), soft_wrap=True)
            return _exit_code(found, found.summary.stable_here, fail_unstable=options.fail_unstable)
        return _present(found, folder, console, options)


def _present(found: Screening, folder: Path, console: Console, options: argparse.Namespace) -> int:
    written, result = found.save(folder), found.result
    if options.json:
        print(json.dumps(found.as_json(), indent=1, ensure_ascii=False))
    else:
        console.print(tables.verdict(found.summary), soft_wrap=True, highlight=False)
        if len(found.result.plan.outages) + len(found.result.plan.points) > 2:
            console.print("", tables.overview(found.summary))
        console.print("", tables.modes(found.summary), "")
    for text in tables.remarks(found.summary):
        make_errors().print(escape(text), soft_wrap=True)
    if not options.json:
        stored = f", {result.stored} were there already" if result.stored else ""
        files = ", ".join(path.name for path in written)
        console.print(escape(f"{result.computed} computed{stored}. Results in {folder}: {files}"), soft_wrap=True)
    return _exit_code(found, found.stable, fail_unstable=options.fail_unstable)


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


def _damping(text: str) -> float:
    ratio = percent(text)
    if ratio > MOST_DAMPING:
        raise argparse.ArgumentTypeError(f"{text!r}; modes of at most {100 * MOST_DAMPING:g} % are looked for")
    return ratio


def _shard(text: str) -> Shard:
    try:
        return Shard.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
