"""``gfor design --points``: one setting for many operating points and outages."""

import argparse
import shlex
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from rich.console import RenderableType
from rich.markup import escape

from orchestrator.cli.arguments import Joined, add_request_arguments, asked_by, option
from orchestrator.cli.case_arguments import case_of, of_one_scenario
from orchestrator.cli.executors import add_executor_arguments
from orchestrator.cli.study import present, working_in
from orchestrator.cli.verdict import NOT_MET
from orchestrator.coordinated_design import view, words
from orchestrator.coordinated_design.study import ALL, PointsDesign, PointsDesignRequest, plan_points_design
from orchestrator.coordinated_design.verdict import PointsVerdict
from orchestrator.operating_points.item import Status

A_DESIGN = "a design is made for one scenario"


def add_points_arguments(parser: argparse.ArgumentParser) -> None:
    """Options that a design over operating points has beside those of a design for one."""
    group = parser.add_argument_group("over operating points")
    option(group, "--points", "FILE", "operating points: a CSV file, as gfor screen has it", read=Path)
    group.add_argument("--outages", action=Joined, metavar="WHICH",
                       help="n-1, lines, units, or names, each at every point (repeatable)")  # fmt: skip
    add_request_arguments(group, PointsDesignRequest)
    add_executor_arguments(group)


def run_over_points(options: argparse.Namespace, out: Path | None) -> int:
    """Design, write the files and print.

    Returns
    -------
    0; 1 where no point has modes, gfor-cosim itself failed somewhere, or ``--fail-unstable`` asks for it; 3 where a
    damping that was asked for is not reached everywhere, or that is not known.
    """
    several = {"controllers": tuple(options.controller), "components": tuple(options.component),
               "modes": () if ALL in options.mode else tuple(options.mode)}  # fmt: skip
    request = PointsDesignRequest(
        **asked_by(options, PointsDesignRequest) | several | of_one_scenario(options, A_DESIGN)
    )
    case = case_of(options)
    path = out or Path(f"{case.name}_{'_'.join(options.controller)}_points.toml")
    folder = path.with_suffix(".points")
    plan = partial(plan_points_design, case, request, options.points, options.outages)
    with working_in(options, folder, view.STUDY, plan) as (_, compute):
        design = compute()
        written = design.save(path, _command_line(options, request))
    verdict = design.result.verdict
    files = ", ".join(one.name for one in written[1:])
    end = f"Parameter file {path}, beside it {files}; points are kept in {folder}"
    present(options, design.as_json, _parts(design.result), words.remarks(verdict), end)
    return _exit_code(verdict, fail_unstable=options.fail_unstable)


def _parts(design: PointsDesign) -> Iterator[RenderableType]:
    yield words.verdict_of(design.verdict).markup()
    yield from ("", view.least_damped_table(design.verdict), "", view.settings_table(design))
    if design.plan.request.ranked:
        yield from ("", view.ranking_table(design))
    yield from ("", escape(words.what_it_rests_on(design)))


def _exit_code(verdict: PointsVerdict, *, fail_unstable: bool) -> int:
    internal = any(point.before.status is Status.INTERNAL or point.after.status is Status.INTERNAL
                   for point in verdict.points)  # fmt: skip
    if internal or not verdict.known or (fail_unstable and not verdict.stable):
        return 1
    return NOT_MET if verdict.wanted is not None and not verdict.met else 0


def _command_line(options: argparse.Namespace, request: PointsDesignRequest) -> str:
    """The command that was given, with all that is not left to its default."""
    chosen = ["gfor", "design", str(options.case), "--points", str(options.points)]
    several = {"--controller": options.controller, "--component": options.component, "--mode": options.mode,
               "--scenario": options.scenario, "--parameters": options.parameters}  # fmt: skip
    chosen += [word for option, values in several.items() for value in values for word in (option, str(value))]
    low, high = request.gain_bounds
    single = {"--outages": options.outages, "--stages": request.stages, "--step": options.step,
              "--damping": None if request.damping is None else f"{100 * request.damping:g}%",
              "--gain-bounds": f"{low:g}:{high:g}", "--min-damping": f"{100 * request.least_damping:g}%"}  # fmt: skip
    chosen += [word for option, value in single.items() if value is not None for word in (option, str(value))]
    for key, value in options.set:
        chosen += ["--set", f"{key}={str(value).lower() if isinstance(value, bool) else value}"]
    return " ".join(shlex.quote(word) for word in chosen)
