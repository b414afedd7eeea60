"""``gfor fmu nyquist``: whether a device is stable at a network, from scans, FMUs and cases."""

import argparse
import json
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.api.nyquist import network_of
from orchestrator.black_box.frequency_response import Excitation
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import add_json_argument, option, quantity, repeatable, seconds, setting, switch
from orchestrator.cli.terminal import make_console, print_json, said_stages, say
from orchestrator.cli.verdict import NOT_MET
from orchestrator.errors import InputError
from orchestrator.immittance.margins import Margin
from orchestrator.immittance.scan_files import ENDINGS
from orchestrator.immittance.study import CutRequest, CutResult, study_cut
from orchestrator.report.tables import make_table
from orchestrator.results.staging import new_run_id, staged
from orchestrator.safe_files import made_folder, write_text

_SIDES = ("device", "network")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("device", metavar="DEVICE", help="a scan (.txt, .csv), an FMU or DLL; or a case alone")
    parser.add_argument("network", nargs="?", metavar="NETWORK", help="a scan of the network, or a case")
    option(parser, "--frequency", "F", "rated frequency (50 Hz)", read=quantity("Hz"), default=50.0)
    option(parser, "--compensation", "PERCENT", "series capacitors, as share of the network's reactance, such as "
           "'32 %%'", read=_share, default=0.0)  # fmt: skip
    option(parser, "--angle", "A", "of the device's frame before the network's, such as 20deg", read=quantity("rad"))
    option(parser, "--voltage", "V", "rated voltage at the cut, between pu and S", read=quantity("kV"))
    for name, text in (("per-unit", "is in pu, 100 MVA"), ("generator", "counts currents out of it")):
        parser.add_argument(f"--{name}", action="append", default=[], choices=_SIDES, help=f"the side's file {text}")
    switch(parser, "--units-checked", "two scans of very different size are meant so")
    option(parser, "--bus", "B", "cut a case between the devices of this bus and all else")
    repeatable(parser, "--component", "NAME", "cut a case at this component (repeatable)")
    option(parser, "--scenario", "NAME", "of a case (default: its first)")
    repeatable(parser, "--set", "NAME=VALUE", "a value of the FMU, or COMPONENT.PARAMETER=VALUE of the case "
               "(repeatable)", read=setting)  # fmt: skip
    option(parser, "--binding", "vendor.toml", "maps the FMU's variables to our port", read=Path)
    option(parser, "--step", "H", "communication step of a scan (100 us)", read=seconds, default=1e-4)
    option(parser, "--from-hz", "F", "lowest frequency of a scan (0.05)", read=quantity("Hz"), default=0.05)
    option(parser, "--to-hz", "F", "highest frequency of a scan (1000)", read=quantity("Hz"), default=1000.0)
    option(parser, "--out", "DIR", "folder (default: results/nyquist_<device>)", read=Path)
    switch(parser, "--trust-fmus", "as for `gfor run`")
    add_json_argument(parser)
    switch(parser, "--fail-unstable", "end with exit code 3 unless it is stable")


def run(options: argparse.Namespace) -> int:
    """Judge, draw, and say what was found."""
    request = _request(options)
    folder = made_folder(options.out or Path("results") / f"nyquist_{Path(options.device).stem}", "--out")
    with said_stages() as report:
        result = study_cut(request, report)
    say("question", result.questions)
    with staged(folder, new_run_id()) as staging:
        _save(result, staging)
    if options.json:
        print_json(result.as_json())
    else:
        _say(make_console(), result, folder)
    return NOT_MET if options.fail_unstable and result.verdict != "stable" else 0


def _request(options: argparse.Namespace) -> CutRequest:
    device, network = options.device, options.network
    if network is None and Path(device).suffix.lower() in (*ENDINGS, ".fmu", ".so", ".dll"):
        raise InputError(f"{device}: give its network as well: a scan, or a case with --bus or --component")
    case = device if network is None else network
    given = dict(options.set)
    other: Path | PreparedScenario
    if Path(case).suffix.lower() in ENDINGS:
        of_fmu, other = given, Path(case)
    else:
        of_case = {name: value for name, value in given.items() if network is None or "." in name}
        of_fmu = {name: value for name, value in given.items() if name not in of_case}
        other = network_of(case, options.scenario, of_case, trust_fmus=options.trust_fmus)
    return CutRequest(
        Path(device) if network is not None else None, other, options.frequency, options.compensation, options.angle,
        options.bus, tuple(options.component), options.voltage, frozenset(options.generator),
        frozenset(options.per_unit), options.units_checked, of_fmu, options.binding,
        options.step, Excitation(lowest_hz=options.from_hz, highest_hz=options.to_hz, lines=160),
    )  # fmt: skip


def _share(text: str) -> float:
    try:
        value = float(text.strip().removesuffix("%"))
    except ValueError:
        value = -1.0
    if not 0 <= value < 100 or (0 < value < 1 and "%" not in text):
        raise ValueError(f"{text!r} is no share in percent from 0 to below 100, such as '32 %'")
    return value / 100


def _save(result: CutResult, folder: Path) -> None:
    from orchestrator.immittance.pictures import draw  # noqa: PLC0415 - a second to import
    from orchestrator.immittance.ztool import write_ztool  # noqa: PLC0415

    write_text(folder / "nyquist.json", json.dumps(result.as_json(), indent=1) + "\n")
    draw(result, folder)
    for side, scan in result.scans.items():
        if scan.unit == "S":
            write_ztool(scan, folder / f"gfor#Y_AC#{side}-1#.txt")


def _say(console: Console, result: CutResult, folder: Path) -> None:
    colour = {"stable": "green", "unstable": "red"}.get(str(result.verdict), "yellow")
    console.print(f"[bold {colour}]{result.verdict}[/]: {escape(result.because)}", soft_wrap=True, highlight=False)
    table = make_table("Margins", "Margin", "Value", "at [Hz]")
    m = result.judgement.margins
    for name, margin, text in (
        ("gain up", m.gain_up, "× {:.3f}"), ("gain down", m.gain_down, "× {:.3f}"), ("phase", m.phase_deg, "{:.1f}°"),
        ("delay", m.delay_s, "{:.2e} s"), ("distance from −1", m.distance, "{:.3f}"), ("disk", m.disk, "{:.3f}"),
    ):  # fmt: skip
        table.add_row(name, *_cells(margin, text))
    console.print(table)
    for side, bands in result.judgement.active.items():
        said = ", ".join(f"{a:.4g}–{b:.4g} Hz" for a, b in bands) or "nowhere"
        console.print(f"{side} ({getattr(result.loop, side).name}) not passive: {said}", highlight=False, markup=False)
    if result.difference is not None:
        far = result.difference
        console.print(f"The device differs from the case's own by {100 * far['largest_relative']:.2g} % at most, at "
                      f"{far['frequency_hz']:.4g} Hz", highlight=False, markup=False)  # fmt: skip
    console.print(f"Results in {folder}", soft_wrap=True, highlight=False, markup=False)


def _cells(margin: Margin | None, text: str) -> tuple[str, str]:
    return ("none", "") if margin is None else (text.format(margin.value), f"{margin.frequency_hz:.3f}")
