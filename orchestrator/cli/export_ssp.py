"""``gfor export ssp``: scenarios of a case as SSP archives."""

import argparse
from pathlib import Path
from typing import Any

from fmus.toolchain.archive import write_archive
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import option, seconds
from orchestrator.cli.case_arguments import add_case_arguments, prepare
from orchestrator.errors import InputError
from orchestrator.ssp.study import study_of
from orchestrator.ssp.writing import ssp_members

_TABLES: dict[str, Any] = {
    "source": True,
    "analysis": True,
    "plots": True,
    "reference": True,
    "solver": {"record_interval", "record", "record_filter"},
}
"""What of a case file SSP has no place for and no structure of our annotation holds."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    option(parser, "--stop", "T", "stop time [s] (default: the case's)", read=seconds)
    option(parser, "--out", "FILE.ssp", "the archive, or a folder for one archive a scenario (default: "
           "<case>_<scenario>.ssp here)", read=Path)  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Write every scenario to an archive of its own and print their paths."""
    out: Path | None = options.out
    scenarios = prepare(options)
    single = out is not None and out.suffix.lower() == ".ssp"
    if single and len(scenarios) > 1:
        names = ", ".join(s.name for s in scenarios)
        raise InputError(
            f"--out {out}: an SSP holds one scenario, not {names}; choose with --scenario, or give a folder"
        )
    for prepared in scenarios:
        target = out if out is not None and single else (out or Path()) / f"{prepared.case.name}_{prepared.name}.ssp"
        try:
            _write(prepared, target)
        except OSError as error:
            raise InputError(f"--out {target}: it cannot be written: {error.strerror}; choose another place") from error
        print(target)
    return 0


def _write(prepared: PreparedScenario, target: Path) -> None:
    case = prepared.case
    tables: dict[str, Any] = case.table.model_dump(
        mode="json", by_alias=True, exclude_none=True, exclude_unset=True, include=_TABLES
    )
    study = study_of(
        prepared.name, prepared.title, prepared.step_size, prepared.schedule, prepared.events, _filled(tables)
    )
    write_archive(target, ssp_members(case.name, case.table.title, prepared.system, prepared.stop_time, study))


def _filled(tables: dict[str, Any]) -> dict[str, Any]:
    return {name: table for name, table in tables.items() if table}
