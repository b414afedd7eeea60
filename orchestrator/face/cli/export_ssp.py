"""``gfor export ssp``: scenarios of a case as SSP archives."""

import argparse
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.face.api.export import write_ssp
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.case_arguments import add_case_arguments, prepare


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    add_options(parser, "export_ssp")


def run(options: argparse.Namespace) -> int:
    out: Path | None = options.out
    scenarios = prepare(options)
    single = out is not None and out.suffix.lower() == ".ssp"
    if single and len(scenarios) > 1:
        names = ", ".join(s.name for s in scenarios)
        raise InputError(
            f"--out {out}: an SSP holds one scenario, not {names}; choose with --scenario, or give a folder"
        )
    for prepared in scenarios:
        target = (
            out
            if out is not None and single
            else (out or Path()) / f"{prepared.case.name}_{prepared.name}.ssp"
        )
        write_ssp(prepared, target)
        print(target)
    return 0
