"""``gfor fmu nyquist``: whether a device is stable at a network, from scans, FMUs and cases."""

import argparse
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.core.asked import read_part
from orchestrator.core.errors import NOT_MET, InputError
from orchestrator.core.safe_files import made_folder, write_page
from orchestrator.face.api.nyquist import Asked
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.by_point import by_point
from orchestrator.face.cli.terminal import make_console, print_json, print_parts, said_stages, say
from orchestrator.output.results.staging import new_run_id, staged
from orchestrator.studies.black_box.frequency_response import Excitation
from orchestrator.studies.immittance.margins import margins_json
from orchestrator.studies.immittance.view import GOAL, Nyquist, parts

_SHARE = "a share in percent from 0 to below 100, such as '32 %'"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "nyquist", share=read_part(_SHARE, 0, 99.99), sides=("device", "network"))


def run(options: argparse.Namespace) -> int:
    if (options.parameter or options.distance) and not options.retune:
        raise InputError(
            "--parameter and --distance belong to --retune, which is not given; add it, or leave them out"
        )
    if options.html and (options.points or options.scr is None):
        raise InputError(
            "--html: the page has a slider of the short-circuit ratio; give --scr, the ratio in its middle, and no "
            "--points"
        )
    asked = Asked(
        options.device,
        options.network,
        options.scenario,
        dict(options.set),
        trust_fmus=options.trust_fmus,
        frequency=options.frequency,
        compensation=options.compensation,
        angle=options.angle,
        bus=options.bus,
        components=tuple(options.component),
        kilovolt=options.voltage,
        generator=frozenset(options.generator),
        per_unit=frozenset(options.per_unit),
        units_checked=options.units_checked,
        binding=options.binding,
        scr=options.scr,
        x_r=options.x_r,
        rating_mva=options.rating,
        step_size=options.step,
        excitation=Excitation(lowest_hz=options.from_hz, highest_hz=options.to_hz, lines=160),
    )
    folder = made_folder(
        options.out or Path("results") / f"nyquist_{Path(options.device).stem}", "--out"
    )
    if options.points:
        judged = lambda values, place: _row(_judge(options, asked.at(values), place))  # noqa: E731
        rows = by_point(options, folder, judged, {"verdict": "not known"})
        return (
            NOT_MET
            if options.fail_unstable and any(row["verdict"] != "stable" for row in rows)
            else 0
        )
    found = _judge(options, asked, folder)
    if options.html:
        write_page(options.html, found.html())
    if options.json:
        print_json(found.as_json())
    else:
        print_parts(make_console(), [*parts(found), escape(f"Results in {folder}")])
    return NOT_MET if options.fail_unstable and found.verdict != "stable" else 0


def _judge(options: argparse.Namespace, asked: Asked, folder: Path) -> Nyquist:
    with said_stages() as report:
        found = asked.judge(report)
        say("question", found.result.questions)
        if options.retune:
            found.retune(options.parameter, distance=options.distance or GOAL, report=report)
    with staged(folder, new_run_id()) as staging:
        found.save(staging)
    return found


def _row(found: Nyquist) -> dict[str, Any]:
    m, result = margins_json(found.result.margins), found.result
    told = {
        key: (m[key] or {}).get("value") for key in ("distance", "gain", "phase_deg", "delay_s")
    }
    at = {"at_hz": (m["distance"] or {}).get("frequency_hz")}
    ratios = {"scr": result.scr, "lost_below_scr": result.scr_limit}
    return {"verdict": found.verdict} | at | told | ratios | {"remark": "; ".join(found.reasons)}
