"""``gfor design --points``: one setting for many operating points and outages."""

import argparse
from pathlib import Path

from orchestrator.cli.arguments import add_request_arguments
from orchestrator.cli.executors import add_executor_arguments
from orchestrator.cli.study import shown, working_in
from orchestrator.coordinated_design.command import STUDY
from orchestrator.coordinated_design.study import ALL, PointsDesignRequest
from orchestrator.results.origin import as_typed


def add_points_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("over operating points")
    add_request_arguments(group, PointsDesignRequest)
    add_executor_arguments(group)


def run_over_points(options: argparse.Namespace, path: Path) -> int:
    several = {"controllers": tuple(options.controller), "components": tuple(options.component),
               "modes": () if ALL in options.mode else tuple(options.mode)}  # fmt: skip
    with working_in(options, "design", STUDY, path.with_suffix(".points"), **several) as (_, compute, folder):
        design = compute()
        written = design.save(path, as_typed())
    files = ", ".join(one.name for one in written[1:])
    end = f"Parameter file {path}, beside it {files}; points are kept in {folder}"
    return shown(options, STUDY, design, folder, written, end)
