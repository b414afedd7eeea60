"""``gfor certify``: the grid code's damping test on any converter FMU."""

import argparse
import json
from pathlib import Path

from rich.markup import escape
from rich.table import Table

from orchestrator.certification.files import certification_json, save
from orchestrator.certification.study import PODS, REACTANCES, Certification, CertificationRequest, certify
from orchestrator.cli.arguments import setting
from orchestrator.cli.executors import add_executor_arguments, choose_executor
from orchestrator.cli.points import compute_points
from orchestrator.cli.terminal import made_folder, make_console
from orchestrator.errors import INTERRUPTED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of ``gfor certify``."""
    parser.add_argument("fmu", type=Path, metavar="FILE.fmu", help="the converter")
    parser.add_argument("--binding", type=Path, metavar="vendor.toml", help="maps the FMU's variables to our port")
    parser.add_argument(
        "--pod", choices=PODS, help="damping controllers that are active (default: as the FMU shows them)"
    )
    parser.add_argument(
        "--set", action="append", default=[], type=setting, metavar="VARIABLE=VALUE",
        help="a value of the converter, such as pod_p.enabled=true, or of the study, such as "
        "sg1.governor.enabled=true (repeatable)",
    )  # fmt: skip
    parser.add_argument(
        "--reactances", type=_reactances, default=REACTANCES, metavar="X,X,…",
        help="line reactances X_L [pu] (default: the norm's, 0.01 and 0.05 to 0.60)",
    )  # fmt: skip
    parser.add_argument("--black-box", action="store_true",
                        help="do not use the converter's states for the modes, even if it shows them")  # fmt: skip
    add_executor_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="folder for results (default: results/certify_<file>); points that are there are not computed again",
    )
    parser.add_argument(
        "--pdf", action="store_true", help="print the report to certificate.pdf with an installed browser"
    )
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")


def run(options: argparse.Namespace) -> int:
    """Run the test, write its report and print the verdict; returns 1 where the converter does not pass."""
    folder = made_folder(options.out or Path("results") / f"certify_{options.fmu.stem}")
    console = make_console(stderr=options.json)
    study = {name: value for name, value in options.set if name.split(".")[0] in ("sg1", "sg2", "grid")}
    own = {name: value for name, value in options.set if name not in study}
    request = CertificationRequest(
        options.fmu, options.binding, own, options.pod, options.reactances, study, options.black_box
    )
    executor = choose_executor(options.workers, options.scheduler, ["orchestrator.certification.point"])
    result = compute_points(lambda report: certify(request, executor, folder, report), executor, folder, console)
    if result is None:
        return INTERRUPTED
    files = save(result, folder, pdf=options.pdf)
    if options.json:
        print(json.dumps(certification_json(result), indent=1, ensure_ascii=False))
    else:
        console.print(_table(result), "")
        console.print(f"[bold {'green' if result.passed else 'red'}]{escape(result.sentence())}[/]", soft_wrap=True)
        if result.stored:
            console.print(f"{result.stored} of {len(result.points)} points were there already")
        console.print(escape(f"Report in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return 0 if result.passed else 1


def _table(result: Certification) -> Table:
    table = Table(title=f"Damping test, {result.signal} watched", title_justify="left", header_style="bold")
    for column in (
        "X_L [pu]",
        "least damped [Hz]",
        "ξ [%]",
        "without: ξ [%]",
        "ΔP5M5/ΔP1M1",
        "in the signal: ξ [%]",
        "",
    ):
        table.add_column(escape(column), justify="right")
    for v in result.verdicts:
        worst = v.modes[0] if v.modes else None
        ratio = v.time.swings.ratio if v.time else None
        seen = min((m.damping_percent for m in v.time.modal.modes), default=None) if v.time else None
        before = worst.before if worst else None
        table.add_row(
            f"{v.X_L:g}",
            f"{worst.frequency_hz:.3f}" if worst else "–",
            f"{worst.damping_percent:.2f}" if worst else "–",
            f"{-100 * before.real / abs(before):.2f}" if before else "–",
            "–" if ratio is None else f"{ratio:.3f}",
            "–" if seen is None else f"{seen:.2f}",
            "accepted" if v.accepted else "[red]not accepted[/]",
        )
    return table


def _reactances(text: str) -> tuple[float, ...]:
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = (0.0,)
    if not all(1e-3 <= value <= 10 for value in values) or len(set(values)) < len(values):
        raise argparse.ArgumentTypeError(
            f"{text!r} are no reactances; write different numbers from 0.001 to 10, such as 0.1,0.3"
        )
    return values
