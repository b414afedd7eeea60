"""``gfor new``: a case file from a network's files; without arguments it asks."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.markup import escape

from orchestrator.cases.networks.psse.dyr_model_list import known_records
from orchestrator.cases.networks.record_use import as_json, in_full
from orchestrator.cases.new.network_files import sources_of
from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase, read_converter
from orchestrator.cases.new.widened_limits import limits_to_widen
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.cases.scenario.region_totals import RegionTotal, region_totals
from orchestrator.core.errors import (
    CaseError,
    InputError,
    Problem,
    ResultsError,
    StartError,
    listing_all,
)
from orchestrator.core.options import Option
from orchestrator.core.safe_files import write_text
from orchestrator.core.spelling import Text
from orchestrator.devices.fmi.vendor_files import is_vendor_file
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import make_console, print_json, print_parts, warn
from orchestrator.output.report.short_texts import first_few
from orchestrator.output.report.terminal_tables import PlainTable, make_table

_MOST_TYPED = 8
"""So many values stand in a command that is to be typed; more are a matter of the file."""

_EXAMPLE = 'gfor new own.raw own.dyr --converter "bus 9, 300 MVA, 200 MW, less sg3" --out case.toml'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(parser, "new")
    device = parser.add_mutually_exclusive_group()
    add_options(device, "new 2")
    add_options(parser, "new 3")


def run(options: argparse.Namespace) -> int:
    """Write the case; with ``--json``, what stops it is on standard output as well as in the error."""
    try:
        return _written(options)
    except CaseError as error:
        if options.json:
            print_json({"case": None, "problems": [one.as_json() for one in error.problems]})
        raise
    except InputError as error:
        if options.json:
            problem = Problem("", str(error), error.kind)
            print_json({"case": None, "problems": [problem.as_json()]})
        raise


def _written(options: argparse.Namespace) -> int:
    if options.models is True:
        if options.files:
            raise InputError(
                "--models is 'emt' or 'phasor' for a case; alone it lists what gfor reads"
            )
        _list_models(as_json=options.json)
        return 0
    if not options.files:
        _ask(options)
    wanted = _wanted_case(options)
    sources_of(wanted.files)
    if wanted.out.exists() and not options.force:
        raise InputError(
            f"{wanted.out}: the file is there already; choose another with --out, or --force"
        )
    with listing_all(in_full=options.details or options.json):
        made = write_case(wanted)
    try:
        write_text(wanted.out, made.text)
    except ResultsError as error:
        raise InputError(f"--out {error}") from error
    console = make_console(
        stderr=options.json, names=made.scenarios[0].names if made.scenarios else None
    )
    names = ", ".join(prepared.name for prepared in made.scenarios)
    lines = [f"{wanted.out}: scenarios {names}. Assumed:", *(f"- {line}" for line in made.assumed)]
    if options.details:
        lines += in_full(made.records)
    print_parts(console, map(escape, lines))
    regions = region_totals(made.scenarios[0]) if made.scenarios else []
    if options.details and regions:
        print_parts(console, [_table_of_regions(regions)])
    warnings: dict[str, list[str]] = {
        prepared.name: _start(prepared, wanted)  # what cannot start is told at once
        for prepared in made.scenarios
        if prepared.name in ("base", "converter")
    }
    for name, texts in warnings.items():
        warn(name, texts)
    console.print(
        escape(f"Next: gfor modes {wanted.out}{' --black-box' * made.black_box}"), highlight=False
    )
    if options.json:
        found = made.beside_file
        beside = found.as_json() if found else None
        print_json(
            {
                "case": str(wanted.out),
                "scenarios": [prepared.name for prepared in made.scenarios],
                "assumed": [*made.assumed],
                "power_flow": beside,
                "records": as_json(made.records),
                "regions": [*map(asdict, regions)],
                "questions": [*dict.fromkeys(made.questions)],
                "warnings": [*dict.fromkeys(text for texts in warnings.values() for text in texts)],
            }
        )
    return 0


def _start(prepared: PreparedScenario, wanted: WantedCase) -> list[str]:
    """Start the machines of a scenario of the written case, and return warnings of their limiters and feedbacks.

    The error of what cannot start says what to type."""
    from orchestrator.cases.scenario.service import in_service  # noqa: PLC0415 - these import what a run needs
    from orchestrator.linear.doubts.excitation_limiters import limiter_warnings  # noqa: PLC0415
    from orchestrator.linear.doubts.field_feedbacks import feedback_warnings  # noqa: PLC0415
    from orchestrator.studies.modes.modes import running  # noqa: PLC0415

    try:
        with running(in_service(prepared)) as master:
            setting = f"gfor modes {shlex.quote(str(wanted.out))} --set"
            return [*limiter_warnings(master, setting), *feedback_warnings(master, setting)]
    except StartError as error:
        first, *others = error.problems
        written = Problem(str(wanted.out), _after_refusal(prepared, wanted), first.kind)
        raise StartError(
            prepared.case.source, first, error.component, [*others, written]
        ) from error


def _after_refusal(prepared: PreparedScenario, wanted: WantedCase) -> Text:
    """Return what to do with a case that is written and cannot start, as it is typed."""
    text = Text("it is written all the same, to be corrected there")
    limits = limits_to_widen(prepared)
    if not limits:
        return text
    if len(limits) <= _MOST_TYPED:
        values = [f"{Option.SET} {limit.name}={limit.taken:g}" for limit in limits]
        text += (
            "; it starts with "
            + f"`gfor modes {' '.join([shlex.quote(str(wanted.out)), *values])}`"
        )
    if not wanted.widen_limits:
        text += (
            "; to have these limits widened, and asked about, write it again with "
            + Option.FORCE
            + " and without "
            + Option.NO_WIDENED_LIMITS
        )
    return text


def _table_of_regions(regions: Sequence[RegionTotal]) -> PlainTable:
    rows = [
        (
            f"{one.kind} {one.name}",
            first_few(one.buses, str),
            first_few(one.units, str),
            f"{one.generation_mw:.1f}",
            f"{one.load_mw:.1f}",
        )
        for one in regions
    ]
    return make_table(
        "Areas, zones, owners and stations of the file",
        *("What", "Buses", "Units", "Generation [MW]", "Load [MW]"),
        left=3,
        rows=rows,
    )


def _list_models(*, as_json: bool) -> None:
    records = known_records()
    if as_json:
        print_json([asdict(record) for record in records])
        return
    table = make_table(
        "Records of dynamics data that gfor reads",
        *("record", "what", "part of ours", "held against", "approximated"),
        left=5,
        rows=[(r.name, r.kind, r.part, r.held_against, r.approximated) for r in records],
    )
    sources = dict.fromkeys(record.source for record in records)
    print_parts(make_console(), [table, *(escape(f"Source: {source}") for source in sources)])


def _wanted_case(options: argparse.Namespace) -> WantedCase:
    device = options.fmu or options.dll
    if (device or options.binding) and not options.converter:
        raise InputError(
            "--fmu, --dll and --binding are for a converter; say where by --converter 'bus 9, 300 MVA, 200 MW'"
        )
    if options.binding is not None and options.fmu is None:
        raise InputError("--binding says what an FMU's variables mean; give it with --fmu")
    for path in (
        path for path in (device, options.binding) if path is not None and not path.is_file()
    ):
        raise InputError(f"{path}: there is no such file")
    if device is not None and options.models == "phasor":
        raise InputError(
            f"{device}: a vendor's file meets the network by its currents, as EMT models do; leave out --models"
        )
    out = options.out or Path(f"{options.files[0].stem}.toml")
    if out.suffix.lower() != ".toml":
        raise InputError(f"--out {out}: a case file ends in .toml")
    return WantedCase(
        tuple(options.files),
        out,
        converters=tuple(map(read_converter, options.converter or ())),
        device=device,
        binding=options.binding,
        is_dll=options.dll is not None,
        models=options.models,
        frequency=options.frequency,
        slack=options.slack,
        leave_out=tuple(options.leave_out),
        dyr_leave_out=tuple(options.dyr_leave_out),
        reactive_limits=options.reactive_limits,
        dyr_approximate=options.dyr_approximate,
        replace=tuple(options.replace),
        load_parts=not options.no_load_parts,
        widen_limits=not options.no_widened_limits,
        move_controls=options.move_controls,
        command=f"gfor {shlex.join(sys.argv[1:])}" if sys.argv[1:2] == ["new"] else "gfor new",
    )


def _ask(options: argparse.Namespace) -> None:
    """Ask for what is missing, a line each; an empty answer takes what stands in brackets."""
    if not sys.stdin.isatty():
        raise InputError(
            f"no network is given, and there is no terminal to ask at; write it like\n  {_EXAMPLE}"
        )

    def line(question: str) -> str:
        try:
            return input(f"{question}: ").strip()
        except EOFError as error:
            raise InputError(f"the answers ended; all in one line it is\n  {_EXAMPLE}") from error

    options.files = [
        Path(word) for word in shlex.split(line("Network file(s), such as own.raw own.dyr"))
    ]
    if not options.files:
        raise InputError(f"no network is given; all in one line it is\n  {_EXAMPLE}")
    sources_of(options.files)  # what is wrong is said before the next question
    bus = line("Bus of a converter, such as 9 [no converter]")
    if bus:
        parts = [
            f"bus {bus.removeprefix('bus ')}",
            _with_unit(line("Its rating in MVA, such as 300"), "MVA"),
            _with_unit(line("Its power in MW, such as 200"), "MW"),
        ]
        less = line("Machine that feeds so much less, such as sg3 [the slack]")
        options.converter = [", ".join([*parts, *([f"less {less}"] if less else [])])]
        read_converter(options.converter[0])
        device = line("A vendor's FMU, or the file of a device around a DLL [our converter]")
        if device and is_vendor_file(Path(device)):
            options.dll = Path(device)
        elif device:
            options.fmu = Path(device)
            binding = line("Its binding, as `gfor fmu bind` drafts it [none]")
            options.binding = Path(binding) if binding else None
    default = f"{options.files[0].stem}.toml"
    options.out = options.out or Path(line(f"Case file [{default}]") or default)


def _with_unit(answer: str, unit: str) -> str:
    return f"{answer} {unit}" if answer.replace(".", "", 1).isdigit() else answer
