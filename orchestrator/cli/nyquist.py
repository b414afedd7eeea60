"""``gfor fmu nyquist``: whether a device is stable at a network, from scans, FMUs and cases."""

import argparse
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.api.nyquist import Asked
from orchestrator.asked import Value, read_part
from orchestrator.black_box.frequency_response import Excitation
from orchestrator.cli.arguments import add_options
from orchestrator.cli.terminal import make_console, print_json, print_parts, said_stages, say
from orchestrator.errors import NOT_MET, CosimError, InputError
from orchestrator.immittance.margins import margins_json
from orchestrator.immittance.view import GOAL, Nyquist, parts
from orchestrator.operating_points.points_file import folder_of, settings_in
from orchestrator.report.tables import make_table
from orchestrator.results.staging import new_run_id, staged
from orchestrator.results.storage import save_table
from orchestrator.safe_files import made_folder

_SHARE = "a share in percent from 0 to below 100, such as '32 %'"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "nyquist", share=read_part(_SHARE, 0, 99.99), sides=("device", "network"))


def run(options: argparse.Namespace) -> int:
    if (options.parameter or options.distance) and not options.retune:
        raise InputError("--parameter and --distance belong to --retune, which is not given; add it, or leave them out")
    asked = Asked(
        options.device, options.network, options.scenario, dict(options.set), trust_fmus=options.trust_fmus,
        frequency=options.frequency, compensation=options.compensation, angle=options.angle, bus=options.bus,
        components=tuple(options.component), kilovolt=options.voltage, generator=frozenset(options.generator),
        per_unit=frozenset(options.per_unit), units_checked=options.units_checked, binding=options.binding,
        scr=options.scr, x_r=options.x_r, rating_mva=options.rating, step_size=options.step,
        excitation=Excitation(lowest_hz=options.from_hz, highest_hz=options.to_hz, lines=160),
    )  # fmt: skip
    folder = made_folder(options.out or Path("results") / f"nyquist_{Path(options.device).stem}", "--out")
    if options.points:
        return _over_points(options, asked, folder)
    found = _judged(options, asked, folder, {})
    if options.json:
        print_json(found.as_json())
    else:
        print_parts(make_console(), [*parts(found), escape(f"Results in {folder}")])
    return NOT_MET if options.fail_unstable and found.verdict != "stable" else 0


def _judged(options: argparse.Namespace, asked: Asked, folder: Path, point: dict[str, Value]) -> Nyquist:
    with said_stages() as report:
        found = asked.judged(report, point)
        say("question", found.result.questions)
        if options.retune:
            found.retune(options.parameter, distance=options.distance or GOAL, report=report)
    with staged(folder, new_run_id()) as staging:
        found.save(staging)
    return found


_COLUMNS = ("point", "verdict", "distance", "gain", "phase_deg", "scr_limit", "remark")


def _over_points(options: argparse.Namespace, asked: Asked, folder: Path) -> int:
    """Judge at each point, in a folder of its own; one that cannot be judged says why, and the others go on."""
    rows: list[dict[str, Any]] = []
    for name, values in settings_in(options.points).items():
        try:
            found = _judged(options, asked, folder / folder_of(name), values)
        except CosimError as error:
            rows.append(dict.fromkeys(_COLUMNS) | {"point": name, "verdict": "not known", "remark": str(error)})
            continue
        m = {key: (margin or {}).get("value") for key, margin in margins_json(found.result.margins).items()}
        told = {"point": name, "verdict": found.verdict, "scr_limit": found.result.scr_limit}
        rows.append({key: (m | told | {"remark": "; ".join(found.reasons)})[key] for key in _COLUMNS})
    save_table(rows, folder / "points.csv")
    if options.json:
        print_json(rows)
    else:
        cells = [[f"{x:.4g}" if isinstance(x, float) else str(x or "") for x in row.values()] for row in rows]
        print_parts(make_console(), [make_table("Operating points", *_COLUMNS, rows=cells), f"Results in {folder}"])
    return NOT_MET if options.fail_unstable and any(row["verdict"] != "stable" for row in rows) else 0
