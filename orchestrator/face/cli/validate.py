"""``gfor validate``: a device's model beside recordings of the plant."""

import argparse
from typing import Any

from orchestrator.core.asked import as_number
from orchestrator.core.errors import INTERRUPTED, NOT_MET, InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.core.units import read_value, to_unit
from orchestrator.face.api.validation import validate
from orchestrator.face.cli.arguments import add_options
from orchestrator.face.cli.terminal import (
    make_console,
    print_json,
    print_parts,
    said_stages,
    say,
    saying_warnings,
)
from orchestrator.studies.validation.limits import LimitVerdict
from orchestrator.studies.validation.view import Validation, parts


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_options(
        parser,
        "validate",
        event=_read_event,
        moment=_moment,
        bounds=_bounds,
        INTERRUPTED=INTERRUPTED,
    )


def run(options: argparse.Namespace) -> int:
    """Print how far the device is off, and whether limits are met; returns the exit code that the help tells."""
    if options.pdf and not options.out:
        raise InputError("--pdf: the page that is printed is written into a folder; give --out DIR")
    with saying_warnings(), said_stages() as report:
        found = validate(options.device, options.recordings, report=report, **_keywords(options))
    say("question", found.open_questions)
    say("note", found.notes)
    if options.out:
        found.save(made_folder(options.out, "--out"), pdf=options.pdf)
    if options.json:
        print_json(found.as_json())
    else:
        print_parts(make_console(), parts(found))
    return _exit_code(found)


def _keywords(options: argparse.Namespace) -> dict[str, Any]:
    return {
        "values": dict(options.set),
        "binding": options.binding,
        "component": options.component,
        "scenario": options.scenario,
        "channels": options.channel,
        "place": options.place,
        "voltage": options.voltage,
        "transformer": options.transformer,
        "events": options.event,
        "average": options.average,
        "limits": options.limits,
        "fit": options.fit,
        "bounds": dict(options.bounds),
        "hold_back": options.hold_back,
        "beside": options.beside,
        "explain": options.explain,
        "start": options.start,
        "stop": options.stop,
        "step": options.step,
    }


def _exit_code(found: Validation) -> int:
    if not found.result.finished:
        return INTERRUPTED
    return 0 if found.result.verdict in (None, LimitVerdict.MET) else NOT_MET


def _read_event(text: str) -> tuple[float, float]:
    """``BEGIN:END`` [s]."""
    low, colon, high = text.partition(":")
    begin, end = as_number(low), as_number(high)
    if not colon or not begin < end:
        raise ValueError(
            f"{text!r} is no event; write BEGIN:END in seconds of the recording, such as 2.0:2.15"
        )
    return begin, end


def _bounds(text: str) -> tuple[str, tuple[float, float]]:
    """``NAME=LO:HI``."""
    name, sign, rest = text.partition("=")
    low, colon, high = rest.partition(":")
    limits = as_number(low), as_number(high)
    if not (sign and colon and limits[0] < limits[1]):
        raise ValueError(f"{text!r} are no bounds; write NAME=LO:HI, such as pod_p.K=50:400")
    return name.strip(), limits


def _moment(text: str) -> float:
    return float(to_unit(read_value(text), "s"))
