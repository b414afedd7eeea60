"""The command ``gfor``."""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as ProgressBar

from fmus.toolchain.catalogue import build_model, model_names, needs_arguments
from fmus.toolchain.compiler import TARGETS, host_platform
from fmus.toolchain.native_fmu import export_native
from fmus.toolchain.python_fmu import export
from orchestrator import (
    cli_black_box,
    cli_certify,
    cli_compare,
    cli_design,
    cli_interop,
    cli_linear_model,
    cli_ssp,
    cli_vendor,
)
from orchestrator.cases.case import Case, load_case
from orchestrator.cases.parameter_files import ParameterFile, read_parameter_file
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.cli_sweep import INTERRUPTED, choose_executor, present
from orchestrator.cli_sweep import run as run_points
from orchestrator.coupling.progress import Progress
from orchestrator.errors import CosimError, InputError
from orchestrator.fmi.description import read_description
from orchestrator.fmi.linear_model import read_embedded_model
from orchestrator.report import tables
from orchestrator.report.html.page import write_report
from orchestrator.report.linear_model_files import save_linear_model
from orchestrator.report.study_files import save_modes, save_run, save_study, summary_of
from orchestrator.study.linear import default_inputs, default_outputs, linear_model
from orchestrator.study.modes import ModesResult, compute_modes, modes_json
from orchestrator.study.run import RunResult, run_scenario
from orchestrator.study.sweep import plan_sweep
from orchestrator.study.sweep_axes import Vary, parse_vary
from orchestrator.units import to_unit

EXAMPLES = """\
examples:
  gfor run two_area                              the paper's first case study, into results/two_area
  gfor run two_area --scenario pod_p --stop 5    one scenario, five seconds
  gfor modes two_area --set grid.X_L=0.3         eigenvalues on a longer line
  gfor modes my_case.toml --json                 a case file of your own, for a program to read
  gfor linearize two_area --scenario gfor        A, B, C, D with names, for MATLAB and others
  gfor export-ssp two_area --scenario pod_p      for FMI tools that read SSP; gfor itself runs it as well
  gfor sweep two_area --vary grid.X_L=0.1:0.5:9  modes followed along the line's reactance
  gfor design two_area --controller pod_p        POD-P for its electromechanical mode
  gfor compare results/two_area/gfor results/two_area/pod_p
  gfor identify results/two_area/gfor "sg1.omega - sg2.omega"
  gfor run two_area --like fmpy_ssp              what another master would give, to its last digits
  gfor which-master --build probes               two FMUs that tell which schedule a tool runs
  gfor admittance vendor.fmu                     its admittance, 0.05 Hz to 1 kHz
  gfor black-box two_area --scenario gfor --component gfor
  gfor certify vendor.fmu --binding vendor.toml  the grid code's damping test
  gfor build gfor --dest fmus                    the converter as an FMU for any FMI tool
  gfor info fmus/gfor.fmu                        what an FMU declares
  gfor bind vendor.fmu                           draft of a binding: what its variables mean at our port
  gfor check vendor.fmu --binding vendor.toml    whether it can be trusted in a co-simulation
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0, 1 for a failure during a run, 2 for input that cannot be used."""
    options = _parser().parse_args(arguments)
    errors = Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)
    try:
        return int(options.command(options))
    except CosimError as error:
        errors.print(f"[bold red]error:[/bold red] {_escape(str(error))}")
        return error.exit_code
    except BrokenPipeError:
        return 0
    except KeyboardInterrupt:
        errors.print("interrupted")
        return 130


def _escape(text: str) -> str:
    return text.replace("[", "\\[")


class _Parser(argparse.ArgumentParser):
    """A parser whose help opens with the examples."""

    def format_help(self) -> str:
        text = super().format_help()
        return text if self.prog != "gfor" else f"{EXAMPLES}\n{text}"


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="gfor", description="Co-simulation of grid-forming converters: run, linearise, build FMUs.")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=argparse.ArgumentParser)

    run = commands.add_parser("run", help="steady state, modes and time response of a case's scenarios")
    _case_arguments(run)
    run.add_argument("--stop", type=_seconds, metavar="T", help="stop time [s], e.g. 5 or '500 ms'")
    run.add_argument("--out", type=Path, metavar="DIR", help="folder for results (default: results/<case>)")
    run.add_argument("--linear", action="store_true", help="lay the linear model's response over the simulated one")
    run.add_argument("--json", action="store_true", help="print the summary as JSON")
    cli_interop.add_like(run)
    run.set_defaults(command=_run)

    modes = commands.add_parser("modes", help="steady state and eigenvalues of a case's scenarios")
    _case_arguments(modes)
    modes.add_argument(
        "--range",
        type=_range,
        default=(0.1, 2.0),
        metavar="LO:HI",
        help="frequencies shown [Hz] (default: 0.1:2)",
    )
    modes.add_argument(
        "--critical",
        type=_percent,
        nargs="?",
        const=0.2,
        metavar="PERCENT",
        help="only modes with less damping than this (20 by default), by sparse search instead of the full spectrum",
    )
    modes.add_argument(
        "--directional",
        action="store_true",
        help="linearise with the FMUs' own directional derivatives instead of by perturbation (with --native)",
    )
    modes.add_argument("--out", type=Path, metavar="DIR", help="write modes, participation, shapes and plots there")
    modes.add_argument("--json", action="store_true", help="print JSON")
    modes.set_defaults(command=_modes)

    linearize = commands.add_parser("linearize", help="write a scenario's linear model A, B, C, D for other tools")
    _case_arguments(linearize)
    linearize.add_argument(
        "--input",
        action="append",
        metavar="COMPONENT.VARIABLE",
        help="tunable parameter or open input (repeatable; default: what the scenario's events change)",
    )
    linearize.add_argument(
        "--output",
        action="append",
        metavar="COMPONENT.VARIABLE",
        help="observed output (repeatable; default: what the case plots)",
    )
    linearize.add_argument("--continuous", action="store_true", help="ẋ = A·x + B·u instead of the step map")
    linearize.add_argument("--out", type=Path, metavar="DIR", help="folder (default: results/<case>_linear)")
    linearize.set_defaults(command=_linearize)

    ssp = commands.add_parser("export-ssp", help="write a case's scenarios as SSP archives for other tools")
    _case_arguments(ssp)
    ssp.add_argument("--stop", type=_seconds, metavar="T", help="stop time [s] (default: the case's)")
    cli_ssp.add_arguments(ssp)
    ssp.set_defaults(command=_export_ssp)

    vary = commands.add_parser("sweep", help="modes over a grid of parameters, followed from point to point")
    _case_arguments(vary)
    vary.add_argument(
        "--vary",
        action="append",
        required=True,
        type=_vary,
        metavar="COMPONENT.PARAMETER=START:STOP:COUNT",
        help="what to vary; also =log:START:STOP:COUNT and =0.1,0.2,0.5 (repeatable: a full grid, followed along the "
        "last one)",
    )
    vary.add_argument("--range", type=_range, default=(0.1, 2.0), metavar="LO:HI", help="frequencies [Hz] (0.1:2)")
    vary.add_argument("--workers", type=_count, metavar="N", help="processes to compute in (default: one a core)")
    vary.add_argument("--scheduler", metavar="ADDRESS", help="compute on a Dask cluster, such as tcp://host:8786")
    vary.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/<case>_sweep); points that are there are not computed again",
    )
    vary.add_argument("--json", action="store_true", help="print JSON")
    vary.set_defaults(command=_sweep)

    comparison = commands.add_parser("compare", help="two recorded runs: differences, and what each rings with")
    cli_compare.add_compare(comparison)
    comparison.set_defaults(command=lambda options: cli_compare.run_compare(options, _console()))

    identify = commands.add_parser("identify", help="the modes in a recorded signal (matrix pencil)")
    cli_compare.add_identify(identify)
    identify.set_defaults(command=lambda options: cli_compare.run_identify(options, _console()))

    report = commands.add_parser("report", help="one self-contained HTML page from the folder of a run")
    report.add_argument("folder", type=Path, metavar="DIR", help="folder of `gfor run`")
    report.add_argument("others", type=Path, nargs="*", metavar="DIR", help="folders of sweeps and designs beside it")
    report.add_argument("--out", type=Path, metavar="FILE.html", help="page (default: DIR/report.html)")
    report.set_defaults(command=_report)

    design = commands.add_parser("design", help="design a POD controller by eigenvalue sensitivity")
    _case_arguments(design)
    cli_design.add_arguments(design)
    design.set_defaults(command=_design)

    admittance = commands.add_parser("admittance", help="measure a device's admittance, and fit a model to it")
    cli_black_box.add_admittance(admittance, _seconds, cli_certify.setting)
    admittance.set_defaults(
        command=lambda options: cli_black_box.run_admittance(options, _console(stderr=options.json))
    )

    black_box = commands.add_parser("black-box", help="modes of a case with a component known by its port alone")
    _case_arguments(black_box)
    cli_black_box.add_black_box(black_box)
    black_box.set_defaults(command=_black_box)

    certificate = commands.add_parser("certify", help="the grid code's damping test on a converter FMU")
    cli_certify.add_arguments(certificate, _count)
    certificate.set_defaults(command=_certify)

    build = commands.add_parser("build", help="build FMUs of the catalogue's models")
    build.add_argument("names", nargs="*", metavar="NAME", help="models (default: all that need no further data)")
    build.add_argument("--dest", type=Path, default=Path(), metavar="DIR", help="folder (default: here)")
    build.add_argument("--native", action="store_true", help="compiled FMUs with no Python in them")
    build.add_argument("--fmi", choices=("2.0", "3.0"), default="2.0", help="version of FMI (3.0: native only)")
    build.add_argument(
        "--platform",
        action="append",
        choices=sorted(TARGETS),
        help="compile for this platform (repeatable; default: this machine's, for native FMUs all)",
    )
    cli_linear_model.add_arguments(build)
    build.set_defaults(command=_build)

    which = commands.add_parser("which-master", help="which schedule another tool runs, told by a pair of probe FMUs")
    cli_interop.add_which_master(which, sorted(TARGETS))
    which.set_defaults(command=_which_master)
    cli_vendor.add_commands(commands)

    info = commands.add_parser("info", help="show what an FMU declares")
    info.add_argument("file", type=Path, metavar="FILE.fmu")
    info.set_defaults(command=_info)
    return parser


def _case_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "case", metavar="CASE", help="a built-in case (two_area), or the path of a case file or an .ssp"
    )
    parser.add_argument(
        "--scenario", action="append", default=[], metavar="NAME", help="only this scenario (repeatable)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=_assignment,
        metavar="COMPONENT.PARAMETER=VALUE",
        help="override a value (repeatable)",
    )
    parser.add_argument(
        "--parameters",
        action="append",
        default=[],
        type=Path,
        metavar="FILE",
        help="values from a parameter file, as `gfor design` writes it (repeatable; --set goes before it)",
    )
    parser.add_argument("--step", type=_seconds, metavar="H", help="communication step [s], e.g. 1e-4 or '200 us'")
    parser.add_argument(
        "--native",
        dest="set",
        action="append_const",
        const=("*.native", True),
        help="run native FMUs instead of Python-backed ones; short for --set '*.native=true'",
    )


# -- arguments -----------------------------------------------------------------------------------


def _seconds(text: str) -> float:
    try:
        value = to_unit(_value(text), "s")
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"{text!r} must exceed 0 and be finite")
    return value


def _percent(text: str) -> float:
    """Damping [%] as a ratio."""
    try:
        value = float(text.removesuffix("%"))
    except ValueError:
        value = math.nan
    if not 0 < value <= 90:
        raise argparse.ArgumentTypeError(f"{text!r} is not a damping in percent between 0 and 90, such as 20")
    return value / 100


def _range(text: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    try:
        limits = float(low), float(high)
    except ValueError:
        limits = (1.0, 0.0)
    if not colon or not 0 <= limits[0] < limits[1]:
        raise argparse.ArgumentTypeError(f"{text!r} is not a range; write LO:HI in Hz with 0 ≤ LO < HI, such as 0.1:2")
    return limits


def _count(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 1000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to 1000")
    return int(text)


def _vary(text: str) -> Vary:
    try:
        return parse_vary(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _assignment(text: str) -> tuple[str, Value]:
    key, equals, value = text.partition("=")
    if not equals or "." not in key or not value:
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form component.parameter=value, such as grid.X_L=0.2")
    return key.strip(), _value(value.strip())


def _value(text: str) -> Value:
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    try:
        return float(text)
    except ValueError:
        return text


def _prepare(options: argparse.Namespace) -> tuple[Case, list[PreparedScenario]]:
    case = load_case(options.case)
    stop = getattr(options, "stop", None)
    return case, case.prepare(options.scenario, dict(options.set), options.step, stop, _parameters(options))


def _parameters(options: argparse.Namespace) -> list[ParameterFile]:
    return [read_parameter_file(path) for path in options.parameters]


# -- commands ------------------------------------------------------------------------------------


def _modes(options: argparse.Namespace) -> int:
    case, scenarios = _prepare(options)
    if options.critical is not None and not options.range[0] > 0:
        raise InputError("--critical needs a --range that begins above 0 Hz, such as 0.1:2")
    folder = _folder(options.out) if options.out else None
    results = [
        compute_modes(case, prepared, options.range, options.critical, directional=options.directional)
        for prepared in scenarios
    ]
    plots = save_modes(case, results, folder) if folder else []
    if options.json:
        print(json.dumps(modes_json(case, scenarios[0].step_size, results), indent=1, ensure_ascii=False))
        return 0
    console = _console()
    for result in results:
        console.print(tables.all_modes(result), "")
    _print_electromechanical(console, case, results)
    if folder:
        console.print(f"Modes in {folder}: modes.csv, participation.csv, mode_shapes.csv, "
                      f"{', '.join(p.name for p in plots)}", soft_wrap=True)  # fmt: skip
    _print_warnings(results)
    return 0


def _linearize(options: argparse.Namespace) -> int:
    case, scenarios = _prepare(options)
    folder = _folder(options.out or Path("results") / f"{case.name}_linear")
    for prepared in scenarios:
        inputs = options.input or default_inputs(prepared)
        outputs = options.output or default_outputs(case, prepared)
        model, point = linear_model(prepared, inputs, outputs, as_continuous=options.continuous)
        paths = save_linear_model(model, point, case, prepared, folder / prepared.name)
        size = f"{len(model.states)} states, {len(model.inputs)} inputs, {len(model.outputs)} outputs"
        kind = "continuous" if model.step_size is None else f"step map of {model.step_size:g} s"
        print(f"{prepared.name}: {kind}, {size}: {', '.join(map(str, paths))}")
    return 0


def _export_ssp(options: argparse.Namespace) -> int:
    return cli_ssp.run_export(*_prepare(options), options.out)


def _report(options: argparse.Namespace) -> int:
    print(write_report(options.folder, options.others, options.out))
    return 0


def _design(options: argparse.Namespace) -> int:
    values = {"overrides": dict(options.set), "parameters": _parameters(options), "step_size": options.step}
    return cli_design.run_design(options, load_case(options.case), _console(stderr=options.json), values)


def _run(options: argparse.Namespace) -> int:
    rules = cli_interop.like_of(options)
    case, scenarios = _prepare(options)
    if rules is not None:
        return cli_interop.run_like_master(case, scenarios, rules, options)
    folder = _folder(options.out or Path("results") / case.name)
    console = _console(stderr=options.json)
    results: list[RunResult] = []
    with _progress_bar(console) as bar:
        for prepared in scenarios:
            task = bar.add_task(prepared.title, total=None)

            def report(done: int, total: int, task: Any = task) -> None:
                bar.update(task, completed=done, total=total)

            result = run_scenario(case, prepared, observers=[Progress(report)], linear=options.linear)
            results.append(result)
            save_run(result, folder)
            _print_warnings([result.modes])
            if result.failure:
                break
    plots = save_study(case, results, folder)
    if options.json:
        print(json.dumps([summary_of(r) for r in results], indent=1, ensure_ascii=False))
    else:
        _print_run(console, case, results)
        console.print(f"Results in {folder}: trajectories (.nc, .csv), modes.csv, participation.csv, mode_shapes.csv, "
                      f"step_size.csv, summary.json, "
                      f"{', '.join(p.name for p in plots)}", soft_wrap=True)  # fmt: skip
    if results and results[-1].failure:
        Console(stderr=True, soft_wrap=True, highlight=False).print(
            f"[bold red]error:[/bold red] scenario {results[-1].modes.prepared.name!r}: "
            f"{_escape(str(results[-1].failure))}\nWhat was computed until then is in {folder}"
        )
        return 1
    return 0


def _sweep(options: argparse.Namespace) -> int:
    executor = choose_executor(options.workers, options.scheduler)
    case = load_case(options.case)
    values = {key: value for file in _parameters(options) for key, value in file.values.items()} | dict(options.set)
    plan = plan_sweep(case, options.vary, options.scenario, values, options.step, options.range)
    folder = _folder(options.out or Path("results") / f"{case.name}_sweep")
    console = _console(stderr=options.json)
    with _progress_bar(console) as bar:
        task = bar.add_task("Points", total=None)

        def report(done: int, total: int) -> None:
            bar.update(task, completed=done, total=total)

        result = run_points(plan, executor, folder, report)
    return INTERRUPTED if result is None else present(result, folder, console, as_json=options.json)


def _black_box(options: argparse.Namespace) -> int:
    case, scenarios = _prepare(options)
    return cli_black_box.run_black_box(options, _console(stderr=options.json), scenarios, case)


def _certify(options: argparse.Namespace) -> int:
    console = _console(stderr=options.json)
    with _progress_bar(console) as bar:
        task = bar.add_task("Points", total=None)
        return cli_certify.run_certify(
            options, console, lambda done, total: bar.update(task, completed=done, total=total)
        )


def _folder(path: Path, option: str = "--out") -> Path:
    """The folder for results, made before anything is computed."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{option} {path}: results cannot be written there: {error.strerror}; choose another folder"
        ) from error
    return path


def _console(*, stderr: bool = False) -> Console:
    """A terminal's own width; elsewhere one that lets no table wrap."""
    console = Console(stderr=stderr)
    return console if console.is_terminal else Console(stderr=stderr, width=160)


def _print_run(console: Console, case: Case, results: Sequence[RunResult]) -> None:
    modes = [r.modes for r in results]
    console.print(tables.steady_states(modes), "")
    _print_electromechanical(console, case, modes)
    if any(r.ring_down for r in results):
        console.print("", tables.ring_downs(results))
    if any(r.shifts for r in results):
        console.print("", tables.mode_shifts(results))
    if any(r.linear is not None for r in results):
        console.print("", tables.linear_differences(case, results))
    console.print("", tables.run_statistics(results), "")


def _print_electromechanical(console: Console, case: Case, results: Sequence[ModesResult]) -> None:
    if any(r.electromechanical for r in results):
        title = case.table.reference.title if case.table.reference else None
        console.print(tables.named_modes(results, title))
        if case.table.reference and any(r.references for r in results):
            console.print(f"{title}: {case.table.reference.source}", style="dim", soft_wrap=True)
    if any(r.swing and (r.named or r.modes) for r in results):
        console.print("", tables.mode_shapes(results), "")


def _print_warnings(results: Sequence[ModesResult]) -> None:
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    for result in results:
        for text in result.warnings:
            console.print(f"[bold yellow]warning:[/bold yellow] scenario {result.prepared.name!r}: {_escape(text)}")


def _progress_bar(console: Console) -> ProgressBar:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeRemainingColumn(),
    )
    return ProgressBar(*columns, console=console, disable=not console.is_terminal, transient=True)


def _build(options: argparse.Namespace) -> int:
    if options.fmi != "2.0" and not options.native:
        raise InputError("--fmi 3.0 is for native FMUs: pythonfmu's wrapper speaks FMI 2.0; add --native")
    names = options.names or [name for name in model_names() if not needs_arguments(name)]
    models = []
    for name in names:
        if name not in model_names():
            raise InputError(f"there is no model {name!r}; there are: {', '.join(model_names())}")
        if needs_arguments(name):
            raise InputError(
                f"model {name!r} is built from the [network] table of a case file, by `gfor run` or `gfor modes`"
            )
        models.append(build_model(name))
    extra = cli_linear_model.extra_members(options, [model.name for model in models])
    for model in models:
        platforms = tuple(options.platform) if options.platform else None
        if options.native:
            print(export_native(model, options.dest, platforms, options.fmi, extra))
        else:
            print(export(model, options.dest, platforms, extra))
    return 0


def _which_master(options: argparse.Namespace) -> int:
    if (options.build is None) == (options.result is None):
        raise InputError("give either the tool's RESULT.csv, or --build DIR for the probe pair")
    if options.build is None:
        return cli_interop.run_which_master(options, _console(stderr=options.json))
    folder, host = _folder(options.build, "--build"), host_platform()
    platforms = tuple(options.platform or ([host] if host else []))
    for name in ("probe_a", "probe_b"):
        print(export_native(build_model(name), folder, platforms))
    print(cli_interop.write_instructions(folder, options, platforms))
    return 0


def _info(options: argparse.Namespace) -> int:
    description = read_description(options.file)
    console = _console()
    console.print(f"[bold]{_escape(description.model_name)}[/bold]: {_escape(description.title)}")
    console.print(
        f"FMI 2.0 co-simulation, guid {_escape(description.guid)}, "
        f"made by {_escape(description.generation_tool or 'an unnamed tool')}",
        highlight=False,
    )
    settable = "settable by a master" if description.states_are_settable else "not settable"
    console.print(
        f"platforms: {', '.join(description.platforms)}; continuous states: {len(description.states)} ({settable}); "
        f"state can be saved and restored: {'yes' if description.can_save_state else 'no'}",
        highlight=False,
    )
    embedded = read_embedded_model(options.file)
    if embedded is not None:
        console.print(_escape(cli_linear_model.in_words(embedded)), highlight=False)
    for table in tables.fmu_variables(description):
        console.print("", table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
