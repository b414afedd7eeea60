"""``gfor design``: a POD controller by eigenvalue sensitivity."""

import argparse
import json
import math
import shlex
from contextlib import suppress
from pathlib import Path
from shutil import rmtree

from rich.markup import escape

from orchestrator.api.design import Wanted, design_controller, parameter_file_path
from orchestrator.cases.case import load_case
from orchestrator.cases.idle_values import DAMPING_CONTROLLERS
from orchestrator.cli.arguments import percent, positive
from orchestrator.cli.case_arguments import add_case_arguments, parameters, values_set
from orchestrator.cli.design_points import add_points_arguments, run_over_points
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.terminal import make_console, print_questions, warn
from orchestrator.cli.verdict import NOT_MET, add_verdict_argument, exit_code, print_stability
from orchestrator.errors import CosimError, InputError
from orchestrator.pod_design.design import DesignRequest
from orchestrator.pod_design.sheet import first_screen, sheet
from orchestrator.points.store import PointStore, any_kept


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_case_arguments(parser, several=False)
    defaults = DesignRequest(controller="")
    parser.add_argument(
        "--controller",
        action="append",
        required=True,
        choices=DAMPING_CONTROLLERS,
        help="the controller to design (with --points repeatable)",
    )
    parser.add_argument(
        "--component",
        action="append",
        default=[],
        metavar="NAME",
        help="the converter, or a pattern such as 'gfor*' for several with one setting (default: all with this POD); "
        "with --points repeatable: each gets a setting of its own",
    )
    parser.add_argument(
        "--mode",
        action="append",
        default=[],
        metavar="NAME",
        help="the case's mode to damp (default: its first); with --points repeatable, all from 0.1 to 2 Hz by default",
    )
    parser.add_argument("--damping", type=percent, metavar="PERCENT", help="required damping, such as 20")
    parser.add_argument(
        "--damping-increment",
        type=percent,
        metavar="POINTS",
        help=f"required increase of the damping in points (default: {100 * defaults.damping_increment:g})",
    )
    parser.add_argument(
        "--delta-gain",
        type=positive,
        default=defaults.delta_gain,
        metavar="DK",
        help=f"gain of the finite-difference sensitivity [pu] (default: {defaults.delta_gain:g})",
    )
    parser.add_argument(
        "--gain-bounds",
        type=_bounds,
        metavar="MIN:MAX",
        help="bounds of the gain [pu] (default: 200:400; with --points 0:400)",
    )
    parser.add_argument(
        "--gain-from",
        choices=("non-compensated", "compensated"),
        default="non-compensated",
        help="sensitivity that the gain is computed from, without or with the lead/lag (default: non-compensated)",
    )
    parser.add_argument("--stages", type=int, metavar="N_S", help="lead/lag stages (default: the component's own)")
    parser.add_argument(
        "--min-damping",
        type=percent,
        default=defaults.least_damping,
        metavar="PERCENT",
        help=f"damping below which no other mode may be pushed (default: {100 * defaults.least_damping:g})",
    )
    parser.add_argument("--refine", action="store_true", help="search gain and lead/lag on the closed loop as well")
    parser.add_argument("--no-margins", action="store_true", help="leave out the margins, which take longest")
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_verdict_argument(parser)
    parser.add_argument(
        "--out", type=Path, metavar="FILE.toml", help="parameter file (default: <case>_<controller>.toml, here)"
    )
    add_points_arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Design, print, and write the parameter file."""
    if options.points is not None:
        _check_over_points(options)
        return run_over_points(options, None if options.out is None else _writable(_given(options.out)))
    _check_for_one_point(options)
    (controller_name,) = options.controller
    files, case, console = (
        parameters(options),
        load_case(options.case, trust_fmus=options.trust_fmus),
        make_console(stderr=options.json),
    )
    if len(options.scenario) > 1:
        raise InputError(f"--scenario: a design is made for one scenario, not for {' and '.join(options.scenario)}")
    if options.damping is not None and options.damping_increment is not None:
        raise InputError("--damping and --damping-increment both say what is required; give one of them")
    path = _writable(_given(options.out) if options.out else Path(f"{case.name}_{controller_name}.toml"))
    scenario = next(iter(options.scenario), None)
    folder = path.with_suffix(".points")
    with saying_how_it_goes_on(lambda: _how_it_goes_on(folder)):
        try:
            with console.status("starting") as status:
                controller = design_controller(
                    case,
                    controller_name,
                    scenario,
                    values_set(options),
                    options.step,
                    files,
                    _wanted(options),
                    report=status.update,
                    store=PointStore(folder),
                )
        except CosimError:
            rmtree(folder, ignore_errors=True)  # the same would come out again
            raise
        design = controller.result
        print_questions([design.prepared], as_json=options.json)
        warn(design.prepared.name, design.warnings)
        controller.save(path, _command_line(options))
        rmtree(folder, ignore_errors=True)
    ends = exit_code(options, [design.stability]) or (0 if design.met else NOT_MET)
    if options.json:
        print(json.dumps(controller.as_json(path), indent=1, ensure_ascii=False))
        return ends
    for part in first_screen(design):
        console.print(part, soft_wrap=isinstance(part, str), highlight=False)
    print_stability(
        console, {"without the controller": design.stability_before, "with the final setting": design.stability}
    )
    for part in sheet(design):
        console.print(part, soft_wrap=isinstance(part, str), highlight=False)
    warned = "" if design.met else " (the requirement is not met)"
    console.print(escape(f"Parameter file {path}{warned}; use it with: gfor modes {options.case} --scenario "
                  f"{design.target.scenario} --parameters {path}"), soft_wrap=True, highlight=False)  # fmt: skip
    return ends


def _given(out: Path) -> Path:
    return parameter_file_path(out, "--out")


def _check_for_one_point(options: argparse.Namespace) -> None:
    """Refuse what only a design over operating points takes."""
    for name in ("controller", "component", "mode"):
        if len(getattr(options, name)) > 1:
            times = len(getattr(options, name))
            raise InputError(f"--{name} is given {times} times; only a design with --points takes several: give one")
    for name in ("outages", "workers", "scheduler", "tls"):
        if getattr(options, name) is not None:
            raise InputError(f"--{name} belongs to a design over operating points: give --points FILE as well")


def _check_over_points(options: argparse.Namespace) -> None:
    """Refuse what a design over operating points does not take."""
    defaults = DesignRequest(controller="")
    given = {"--damping-increment": options.damping_increment is not None, "--refine": options.refine,
             "--delta-gain": options.delta_gain != defaults.delta_gain, "--no-margins": options.no_margins,
             "--gain-from": options.gain_from != "non-compensated"}  # fmt: skip
    for name in (name for name, is_given in given.items() if is_given):
        raise InputError(f"{name} belongs to a design for one operating point; with --points leave it out")


def _how_it_goes_on(folder: Path) -> str:
    """What an interrupt leaves; "" where that is nothing, and no empty folder either."""
    if any_kept(folder):
        return f"what was computed is in {folder}; the same command continues from there"
    with suppress(OSError):
        folder.rmdir()
    return ""


def _wanted(options: argparse.Namespace) -> Wanted:
    wanted = Wanted(
        delta_gain=options.delta_gain,
        gain_bounds=options.gain_bounds or DesignRequest(controller="").gain_bounds,
        compensated_gain=options.gain_from == "compensated",
        least_damping=options.min_damping,
        refine=options.refine,
        margins=not options.no_margins,
    )
    if options.component:
        wanted["component"] = options.component[0]
    if options.mode:
        wanted["mode"] = options.mode[0]
    if options.damping is not None:
        wanted["damping"] = options.damping
    if options.damping_increment is not None:
        wanted["damping_increment"] = options.damping_increment
    if options.stages is not None:
        wanted["stages"] = options.stages
    return wanted


def _command_line(options: argparse.Namespace) -> str:
    """The command that was given, with all that is not left to its default."""
    words = ["gfor", "design", str(options.case), "--controller", *options.controller]
    single = {"--component": next(iter(options.component), None), "--mode": next(iter(options.mode), None),
              "--damping": _in_percent(options.damping),
              "--damping-increment": _in_percent(options.damping_increment), "--stages": options.stages,
              "--step": options.step}  # fmt: skip
    words += [word for key, value in single.items() if value is not None for word in (key, str(value))]
    low, high = options.gain_bounds or DesignRequest(controller="").gain_bounds
    words += ["--delta-gain", f"{options.delta_gain:g}", "--gain-bounds", f"{low:g}:{high:g}"]
    words += ["--gain-from", options.gain_from, "--min-damping", f"{100 * options.min_damping:g}%"]
    for name in options.scenario:
        words += ["--scenario", name]
    for key, value in options.set:
        words += ["--set", f"{key}={str(value).lower() if isinstance(value, bool) else value}"]
    for file in options.parameters:
        words += ["--parameters", str(file)]
    words += ["--refine"] if options.refine else []
    return " ".join(shlex.quote(word) for word in words)


def _writable(path: Path) -> Path:
    """The parameter file's path, tried before anything is computed."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        existed = path.exists()
        path.open("a", encoding="utf-8").close()
        if not existed:
            path.unlink()
    except OSError as error:
        raise InputError(
            f"--out {path}: the parameter file cannot be written there: {error.strerror}; choose another place"
        ) from error
    return path


def _in_percent(ratio: float | None) -> str | None:
    """A damping ratio as the options take it."""
    return None if ratio is None else f"{100 * ratio:g}%"


def _bounds(text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    try:
        limits = float(low), float(high)
    except ValueError:
        limits = (1.0, 0.0)
    if not colon or not 0 <= limits[0] <= limits[1] < math.inf or limits[1] == 0:
        raise argparse.ArgumentTypeError(
            f"{text!r} are no bounds; write MIN:MAX in pu with 0 ≤ MIN ≤ MAX, such as 200:400"
        )
    return limits
