"""``gfor sweep``: from its options to points, files and words."""

import argparse

from rich.console import RenderableType

from orchestrator.api.sweep import plan
from orchestrator.cli.arguments import option, repeatable
from orchestrator.cli.case_arguments import add_case_arguments, add_range_argument, case_of, values_set
from orchestrator.cli.study import add_study_arguments, folder_of, last_line, present, working_in
from orchestrator.errors import InputError
from orchestrator.sweep import tables
from orchestrator.sweep.axes import Vary, parse_vary
from orchestrator.sweep.limit import Ending
from orchestrator.sweep.sweep import SweepPlan
from orchestrator.sweep.view import STUDY


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser)
    repeatable(parser, "--vary", "COMPONENT.PARAMETER=START:STOP:COUNT", "what to vary; also =log:START:STOP:COUNT and "
               "=0.1,0.2,0.5 (repeatable: a full grid, followed along the last one); several together: "
               "'grid.X_a,grid.X_b=…', 'grid.X_line_7_*=…', 'line_7_9,line_8_9: length=1:4:7'",
               read=parse_vary)  # fmt: skip
    parser.add_argument("--scr", action="append", dest="vary", type=_scr, metavar="BUS=START:STOP:COUNT", help="SCR of "
                        "the converters at a bus, or its short-circuit power ('bus_9=3000 MVA:800 MVA:5'): R and X of "
                        "all branches that end there are multiplied")  # fmt: skip
    option(parser, "--until", "unstable|PERCENT", "how far the range START:STOP may go before the system is unstable, "
           "or a mode of --range is damped less than so many percent: coarse grid (COUNT, 9), then "
           "bisection")  # fmt: skip
    add_range_argument(parser)
    add_study_arguments(parser, "sweep")


def run(options: argparse.Namespace) -> int:
    """Plan, compute, write and print; returns 1 if no point has modes."""
    if not options.vary:
        raise InputError("nothing is varied; give --vary, such as --vary grid.X_L=0.1:0.5:9, or --scr bus_9=5:1.2:5")
    case = case_of(options)
    folder = folder_of(options, case.name, "sweep")

    def planning() -> SweepPlan:
        return plan(
            case, options.vary, options.scenario, values_set(options), step=options.step,
            parameters=options.parameters, frequencies=options.range, until=options.until,
        )  # fmt: skip

    with working_in(options, folder, STUDY, planning) as (_, compute):
        sweep = compute()
        end = last_line(sweep.result, "points ", folder, sweep.save(folder))
        first = tables.limits(sweep.samples) or tables.stability(sweep.samples)
        parts: list[RenderableType] = [*first, "", tables.trajectories(sweep.samples), ""]
        present(options, sweep.as_json, parts, sweep.remarks, end)
    scenarios = sweep.result.scenarios
    if not any(s.trajectories for s in scenarios):
        return 1
    held_up = all(x.kind is Ending.HOLDS for x in sweep.limits) and all(s.stable for s in scenarios)
    return int(options.fail_unstable and not held_up)


def _scr(text: str) -> Vary:
    bus, equals, values = text.partition("=")
    return parse_vary(f"{bus}: scr{equals}{values}")
