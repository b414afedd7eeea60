"""``gfor sweep``: from its options to points, files and words."""

import argparse

from rich.console import RenderableType

from orchestrator.api.sweep import STUDY, plan
from orchestrator.cli.case_arguments import add_case_arguments, add_range_argument, case_of, values_set
from orchestrator.cli.study import add_study_arguments, folder_of, last_line, present, working_in
from orchestrator.sweep import tables
from orchestrator.sweep.axes import parse_vary
from orchestrator.sweep.sweep import SweepPlan


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    parser.add_argument(
        "--vary",
        action="append",
        required=True,
        type=parse_vary,
        metavar="COMPONENT.PARAMETER=START:STOP:COUNT",
        help="what to vary; also =log:START:STOP:COUNT and =0.1,0.2,0.5 (repeatable: a full grid, followed along the "
        "last one)",
    )
    add_range_argument(parser)
    add_study_arguments(parser, "sweep")


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if no point has modes."""
    case = case_of(options)
    folder = folder_of(options, case.name, "sweep")

    def planning() -> SweepPlan:
        return plan(
            case, options.vary, options.scenario, values_set(options), step=options.step,
            parameters=options.parameters, frequencies=options.range,
        )  # fmt: skip

    with working_in(options, folder, STUDY, planning) as (_, compute):
        sweep = compute()
        end = last_line(sweep.result, "points ", folder, sweep.save(folder))
        parts: list[RenderableType] = [*tables.stability(sweep.samples), "", tables.trajectories(sweep.samples), ""]
        present(options, sweep.as_json, parts, sweep.remarks, end)
    scenarios = sweep.result.scenarios
    if not any(s.trajectories for s in scenarios):
        return 1
    return int(options.fail_unstable and not all(s.stable for s in scenarios))
