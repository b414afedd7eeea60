"""``gfor fmu nyquist``: whether a device is stable at a network, from scans, FMUs and cases."""

import argparse
from pathlib import Path

from rich.markup import escape

from orchestrator.api.nyquist import network_of
from orchestrator.asked import read_part
from orchestrator.black_box.frequency_response import Excitation
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cli.arguments import add_json_argument, option, quantity, repeatable, seconds, setting, switch
from orchestrator.cli.terminal import make_console, print_json, print_parts, said_stages, say
from orchestrator.errors import NOT_MET, InputError
from orchestrator.immittance.scan_files import ENDINGS
from orchestrator.immittance.study import CutRequest, study_cut
from orchestrator.immittance.view import Nyquist, parts
from orchestrator.results.staging import new_run_id, staged
from orchestrator.safe_files import made_folder

_SHARE = "a share in percent from 0 to below 100, such as '32 %'"
_SIDES = ("device", "network")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("device", metavar="DEVICE", help="a scan (.txt, .csv), an FMU or DLL; or a case alone")
    parser.add_argument("network", nargs="?", metavar="NETWORK", help="a scan of the network, or a case")
    option(parser, "--frequency", "F", "rated frequency (50 Hz)", read=quantity("Hz"), default=50.0)
    option(parser, "--compensation", "PERCENT", "series capacitors, as share of the network's reactance, such as "
           "'32 %%'", read=read_part(_SHARE, 0, 99.99), default=0.0)  # fmt: skip
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
        Nyquist(result).save(staging)
    if options.json:
        print_json(result.as_json())
    else:
        print_parts(make_console(), [*parts(result), escape(f"Results in {folder}")])
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
