"""``gfor design``: a POD controller by eigenvalue sensitivity."""

import argparse
import shlex
from collections.abc import Mapping
from contextlib import suppress
from fnmatch import fnmatchcase
from pathlib import Path
from shutil import rmtree

from rich.markup import escape

from orchestrator.cases.form.schema import Value
from orchestrator.cases.questions.idle_values import DAMPING_CONTROLLERS
from orchestrator.core.errors import NOT_MET, CosimError, InputError
from orchestrator.core.options import Option
from orchestrator.face.cli.arguments import (
    add_executor_arguments,
    add_options,
    add_request_arguments,
    option,
)
from orchestrator.face.cli.case_arguments import (
    add_case_arguments,
    asked_of_case,
    case_of,
    values_set,
)
from orchestrator.face.cli.former_design import place_of_design
from orchestrator.face.cli.interrupted import saying_how_it_goes_on
from orchestrator.face.cli.study import print_study, working_in
from orchestrator.face.cli.terminal import (
    make_console,
    print_json,
    print_parts,
    print_questions,
    said_stages,
    warn,
    with_announced_questions,
)
from orchestrator.face.cli.verdict import add_verdict_argument, exit_code, print_stability
from orchestrator.output.results.manifest import made_now
from orchestrator.output.results.origin import as_typed
from orchestrator.studies.coordinated_design.command import STUDY
from orchestrator.studies.coordinated_design.one_point import design_controller
from orchestrator.studies.coordinated_design.study import ALL, PointsDesignRequest
from orchestrator.studies.pod_design.design import DesignRequest
from orchestrator.studies.pod_design.sheet import first_screen, sheet
from orchestrator.studies.pod_design.target import example_of
from orchestrator.studies.pod_design.view import (
    ControllerDesign,
    parameter_file_path,
    parameters_of_less_gain,
)
from orchestrator.studies.points.store import PointStore, any_kept


def run_over_points(options: argparse.Namespace, path: Path) -> int:
    several = {
        "controllers": tuple(options.controller),
        "components": tuple(options.component),
        "modes": () if ALL in options.mode else tuple(options.mode),
    }
    with working_in(options, "design", STUDY, path.with_suffix(".points"), **several) as (
        planned,
        compute,
        folder,
    ):
        design = compute()
        path = _place(options, path, met=design.met)
        written = design.save(path, as_typed())
    files = ", ".join(one.name for one in written[1:])
    end = f"Parameter file {path}, beside it {files}; points are kept in {folder}"
    prepared = STUDY.prepared(planned)
    return print_study(options, STUDY, design, folder, written, end, prepared=prepared)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    parser.add_argument(
        "--controller",
        action="append",
        default=[],
        choices=DAMPING_CONTROLLERS,
        help="the controller to design (with --points repeatable)",
    )
    add_options(parser, "design")
    add_request_arguments(parser, DesignRequest)
    add_options(parser, "design 2")
    add_verdict_argument(parser)
    option(
        parser,
        "--out",
        "FILE.toml",
        "parameter file, or a folder for it (default: <case>_<controller>.toml, here)",
        read=Path,
    )
    over_points = parser.add_argument_group("over operating points")
    add_request_arguments(over_points, PointsDesignRequest)
    add_executor_arguments(over_points)


def run(options: argparse.Namespace) -> int:
    if not options.controller:
        raise InputError(_no_controller(options))
    if options.points is not None:
        _check_over_points(options)
        controllers = "_".join(dict.fromkeys(options.controller))
        usual = f"{case_of(options).name}_{controllers}_points.toml"
        return run_over_points(options, _writable(options.out, usual))
    _check_for_one_point(options)
    case = case_of(options)
    request = _request(options)
    path = _writable(options.out, f"{case.name}_{request.controller}.toml")
    folder = path.with_suffix(".points")
    with saying_how_it_goes_on(lambda: _how_it_goes_on(folder)):
        try:
            with said_stages() as report:
                store = PointStore(folder)
                controller = design_controller(case, request, report=report, store=store)
        except CosimError:
            rmtree(folder, ignore_errors=True)  # the same would come out again
            raise
        design = controller.result
        print_questions([design.prepared], as_json=options.json)
        warn(design.prepared.name, design.warnings)
        path = _place(options, path, met=design.met)
        controller.save(path, as_typed())
        rmtree(folder, ignore_errors=True)
    ends = exit_code(options, [design.stability]) or (0 if design.met else NOT_MET)
    if options.json:
        print_json(controller.as_json(path) | {"made": made_now()})
        return ends
    console = make_console(names=design.prepared.names)
    first = first_screen(design, _command_with_less_gain(options, controller))
    print_parts(console, with_announced_questions(first, [design.prepared]))
    print_stability(
        console,
        {
            "without the controller": design.stability_before,
            "with the final setting": design.stability,
        },
    )
    print_parts(console, sheet(design))
    warned = "" if design.met else " (the requirement is not met)"
    emt = (
        "; EMT models may differ: add --set models=emt"
        if design.prepared.case.table.models == "phasor"
        else ""
    )
    console.print(
        escape(
            f"Parameter file {path}{warned}; use it with: {_command_with(options, controller, path)}{emt}"
        ),
        soft_wrap=True,
        highlight=False,
    )
    return ends


def _no_controller(options: argparse.Namespace) -> str:
    example = example_of(case_of(options))
    if not example:
        names = " or ".join(DAMPING_CONTROLLERS)
        return f"no controller is given, and no component of the case has one of {names}"
    command = f"gfor design {shlex.quote(options.case)} {example}"
    return f"no controller is given; give {Option.CONTROLLER}, such as {command}"


def _command_with_less_gain(options: argparse.Namespace, controller: ControllerDesign) -> str:
    """The command that shows the modes with the setting that has more damping with less gain."""
    setting = parameters_of_less_gain(controller.result)
    return _command(options, controller, {**_values_beside(options, setting), **setting})


def _command_with(options: argparse.Namespace, controller: ControllerDesign, path: Path) -> str:
    """The command that shows the modes of the system that was designed for, with the setting.

    It has the values and files that the design was given. A value of ``--set`` that is one of the setting's is left
    out, and where a pattern would replace one, the setting's value stands behind it."""
    given = _values_beside(options, controller.parameters)
    replaced = {
        name: value
        for name, value in controller.parameters.items()
        if any(fnmatchcase(name, pattern) or fnmatchcase(pattern, name) for pattern in given)
    }
    return _command(options, controller, given | replaced, path)


def _values_beside(options: argparse.Namespace, setting: Mapping[str, Value]) -> dict[str, Value]:
    """The values of ``--set`` that are none of a setting's."""
    return {k: v for k, v in values_set(options).items() if k not in setting}


def _command(
    options: argparse.Namespace,
    controller: ControllerDesign,
    values: Mapping[str, Value],
    *files: Path,
) -> str:
    words = ["gfor", "modes", options.case, "--scenario", controller.result.target.scenario]
    for name, value in values.items():
        words += ["--set", f"{name}={str(value).lower() if isinstance(value, bool) else value}"]
    for file in (*options.parameters, *files):
        words += ["--parameters", str(file)]
    words += [] if options.step is None else ["--step", repr(options.step)]
    words += ["--trust-fmus"] if options.trust_fmus else []
    return shlex.join(words)


def _check_for_one_point(options: argparse.Namespace) -> None:
    for name in ("controller", "component", "mode"):
        times = len(getattr(options, name))
        if times > 1:
            raise InputError(
                f"--{name} is given {times} times; only a design with --points takes several: give one"
            )
    for name in ("outages", "workers", "scheduler", "tls"):
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name} belongs to a design over operating points: give --points FILE as well"
            )


def _check_over_points(options: argparse.Namespace) -> None:
    given = {
        "--damping-increment": options.damping_increment is not None,
        "--refine": options.refine,
        "--delta-gain": options.delta_gain is not None,
        "--no-margins": options.no_margins,
        "--gain-from": options.gain_from != "non-compensated",
    }
    for name in (name for name, is_given in given.items() if is_given):
        raise InputError(
            f"{name} belongs to a design for one operating point; with --points leave it out"
        )


def _how_it_goes_on(folder: Path) -> str:
    """How to go on after an interrupt; "" and no empty folder where nothing is kept."""
    if any_kept(folder):
        return f"what was computed is in {folder}; the same command continues from there"
    with suppress(OSError):
        folder.rmdir()
    return ""


def _request(options: argparse.Namespace) -> DesignRequest:
    first = {
        name: next(iter(getattr(options, name)), None)
        for name in ("controller", "component", "mode")
    }
    how = {
        "compensated_gain": options.gain_from == "compensated",
        "margins": not options.no_margins,
    }
    return DesignRequest(**asked_of_case(options, DesignRequest, "design") | first | how)


def _place(options: argparse.Namespace, path: Path, *, met: bool) -> Path:
    named = options.out is not None and options.out == path
    return place_of_design(path, as_typed(), met=met, named=named)


def _writable(out: Path | None, usual: str) -> Path:
    """The parameter file's path, tried before anything is computed; of its ``usual`` name in a folder."""
    place = Path() if out is None else out
    is_folder = place.is_dir() or not place.suffix
    path = place / usual if is_folder else parameter_file_path(place, "--out")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        existed = path.exists()
        if (
            existed
            and path.is_file()
            and "[set]" not in (path.read_text("utf-8", "replace") or "[set]")
        ):
            raise InputError(
                f"--out {path}: another file is there, not a parameter file; choose another place"
            )
        path.open("a", encoding="utf-8").close()
        if not existed:
            path.unlink()
    except OSError as error:
        raise InputError(
            f"--out {path}: the parameter file cannot be written there: {error.strerror}; choose another place"
        ) from error
    return path
