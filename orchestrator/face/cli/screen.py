"""``gfor screen``: what its command has beside its study, the parts of a screening that several machines compute."""

import argparse
import shutil
from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape

from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.face.cli.arguments import option, repeatable
from orchestrator.face.cli.study import add_study_arguments, print_study, working_in
from orchestrator.face.cli.terminal import make_console, make_errors, print_parts
from orchestrator.studies.operating_points.item import Status
from orchestrator.studies.points.store import POINTS
from orchestrator.studies.screening.command import STUDY
from orchestrator.studies.screening.study import Shard


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_study_arguments("screen", STUDY, parser)
    option(
        parser,
        "--shard",
        "I/N",
        "compute the part I of N only, and keep its points",
        read=Shard.parse,
    )
    repeatable(parser, "--merge", "DIR", "take the points that a part kept there", read=Path)


def run(options: argparse.Namespace) -> int:
    with working_in(options, "screen", STUDY) as (planned, compute, folder):
        _merge(options.merge, folder / POINTS)
        found, shard = compute(options.shard), options.shard
        if shard is None:
            written, prepared = found.save(folder), STUDY.prepared(planned)
            return print_study(options, STUDY, found, folder, written, prepared=prepared)
        part, whole = len(found.result.items), planned.number_of_items
        text = f"part {shard.number} of {shard.total}: {part} of {whole} items are kept in {folder}"
        print_parts(make_console(stderr=options.json), [escape(text)])
        for text in STUDY.remarks(found) if found.summary.counts[Status.INTERNAL] else ():
            make_errors().print(escape(text), soft_wrap=True)
        return STUDY.code(found, options.fail_unstable)


def _merge(folders: Sequence[Path], store: Path) -> None:
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
