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
from orchestrator.cli.arguments import percent, positive
from orchestrator.cli.case_arguments import add_case_arguments, parameters, values_set
from orchestrator.cli.interrupted import saying_how_it_goes_on
from orchestrator.cli.terminal import make_console, print_questions, warn
from orchestrator.cli.verdict import add_verdict_argument, exit_code, print_stability
from orchestrator.errors import CosimError, InputError
from orchestrator.pod_design.design import DesignRequest
from orchestrator.pod_design.sheet import sheet
from orchestrator.pod_design.target import CONTROLLERS
from orchestrator.points.store import PointStore, any_kept


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor design``."""
    add_case_arguments(parser)
    defaults = DesignRequest(controller="")
    parser.add_argument("--controller", required=True, choices=CONTROLLERS, help="the controller to design")
    parser.add_argument(
        "--component",
        metavar="NAME",
        help="the converter, or a pattern such as 'gfor*' for several with one setting (default: all with this POD)",
    )
    parser.add_argument("--mode", metavar="NAME", help="the case's mode to damp (default: its first)")
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
        default=defaults.gain_bounds,
        metavar="MIN:MAX",
        help="bounds of the gain [pu] (default: 200:400)",
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


def run(options: argparse.Namespace) -> int:
    """Design, print, and write the parameter file."""
    files, case, console = (
        parameters(options),
        load_case(options.case, trust_fmus=options.trust_fmus),
        make_console(stderr=options.json),
    )
    if len(options.scenario) > 1:
        raise InputError(f"--scenario: a design is made for one scenario, not for {' and '.join(options.scenario)}")
    if options.damping is not None and options.damping_increment is not None:
        raise InputError("--damping and --damping-increment both say what is required; give one of them")
    path = _writable(
        parameter_file_path(options.out, "--out") if options.out else Path(f"{case.name}_{options.controller}.toml")
    )
    scenario = next(iter(options.scenario), None)
    folder = path.with_suffix(".points")
    with saying_how_it_goes_on(lambda: _how_it_goes_on(folder)):
        try:
            with console.status("starting") as status:
                controller = design_controller(
                    case,
                    options.controller,
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
        print_questions([design.prepared])
        warn(design.prepared.name, design.warnings)
        controller.save(path, _command_line(options))
        rmtree(folder, ignore_errors=True)
    if options.json:
        print(json.dumps(controller.as_json(path), indent=1, ensure_ascii=False))
        return exit_code(options, [design.stability])
    print_stability(
        console, {"without the controller": design.stability_before, "with the final setting": design.stability}
    )
    for part in sheet(design):
        console.print(part, soft_wrap=isinstance(part, str), highlight=False)
    warned = "" if design.met else " (the requirement is not met)"
    console.print(escape(f"Parameter file {path}{warned}; use it with: gfor modes {options.case} --scenario "
                  f"{design.target.scenario} --parameters {path}"), soft_wrap=True, highlight=False)  # fmt: skip
    return exit_code(options, [design.stability])


def _how_it_goes_on(folder: Path) -> str:
    """What an interrupt leaves; "" where that is nothing, and no empty folder either."""
    if any_kept(folder):
        return f"what was computed is in {folder}; the same command continues from there"
    with suppress(OSError):
        folder.rmdir()
    return ""


def _wanted(options: argparse.Namespace) -> Wanted:
    """What the options ask of the design."""
    wanted = Wanted(
        delta_gain=options.delta_gain,
        gain_bounds=options.gain_bounds,
        compensated_gain=options.gain_from == "compensated",
        least_damping=options.min_damping,
        refine=options.refine,
        margins=not options.no_margins,
    )
    if options.component is not None:
        wanted["component"] = options.component
    if options.mode is not None:
        wanted["mode"] = options.mode
    if options.damping is not None:
        wanted["damping"] = options.damping
    if options.damping_increment is not None:
        wanted["damping_increment"] = options.damping_increment
    if options.stages is not None:
        wanted["stages"] = options.stages
    return wanted


def _command_line(options: argparse.Namespace) -> str:
    """The command that was given, with all that is not left to its default."""
    words = ["gfor", "design", str(options.case), "--controller", options.controller]
    single = {"--component": options.component, "--mode": options.mode, "--damping": _in_percent(options.damping),
              "--damping-increment": _in_percent(options.damping_increment), "--stages": options.stages,
              "--step": options.step}  # fmt: skip
    words += [word for key, value in single.items() if value is not None for word in (key, str(value))]
    low, high = options.gain_bounds
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
