"""``gfor design --points``: one setting for many operating points and outages."""

import argparse
import shlex
from pathlib import Path

from orchestrator.cli.arguments import add_request_arguments
from orchestrator.cli.executors import add_executor_arguments
from orchestrator.cli.study import shown, working_in
from orchestrator.coordinated_design.command import STUDY
from orchestrator.coordinated_design.study import ALL, PointsDesignRequest


def add_points_arguments(parser: argparse.ArgumentParser) -> None:
    group = parser.add_argument_group("over operating points")
    add_request_arguments(group, PointsDesignRequest)
    add_executor_arguments(group)


def run_over_points(options: argparse.Namespace, path: Path) -> int:
    several = {"controllers": tuple(options.controller), "components": tuple(options.component),
               "modes": () if ALL in options.mode else tuple(options.mode)}  # fmt: skip
    with working_in(options, "design", STUDY, path.with_suffix(".points"), **several) as (planned, compute, folder):
        design = compute()
        written = design.save(path, _command_line(options, planned.request))
    files = ", ".join(one.name for one in written[1:])
    end = f"Parameter file {path}, beside it {files}; points are kept in {folder}"
    return shown(options, STUDY, design, folder, written, end)


def _command_line(options: argparse.Namespace, request: PointsDesignRequest) -> str:
    chosen = ["gfor", "design", str(options.case), "--points", str(options.points)]
    several = {"--controller": options.controller, "--component": options.component, "--mode": options.mode,
               "--scenario": options.scenario, "--parameters": options.parameters}  # fmt: skip
    chosen += [word for option, values in several.items() for value in values for word in (option, str(value))]
    low, high = request.gain_bounds
    single = {"--outages": request.outages, "--stages": request.stages, "--step": options.step,
              "--damping": None if request.damping is None else f"{100 * request.damping:g}%",
              "--gain-bounds": f"{low:g}:{high:g}", "--min-damping": f"{100 * request.least_damping:g}%"}  # fmt: skip
    chosen += [word for option, value in single.items() if value is not None for word in (option, str(value))]
    for key, value in options.set:
        chosen += ["--set", f"{key}={str(value).lower() if isinstance(value, bool) else value}"]
    return " ".join(shlex.quote(word) for word in chosen)
