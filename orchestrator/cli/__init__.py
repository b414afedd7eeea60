"""The command ``gfor``. Each subcommand is a module of this package, imported only where it is called."""

import argparse
import codecs
import shlex
import sys
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper
from typing import Any

from fmus.toolchain.extras import SetupError
from orchestrator.cli.interrupted import ending, is_interrupt
from orchestrator.errors import INTERRUPTED, TERMINATED, CosimError, InputError
from orchestrator.fmi.interrupts import calls
from orchestrator.late import import_xarray_alone
from orchestrator.results import origin

_ESCAPE = "gfor_escape"

COMMANDS = {
    "new": "write a case file from a network's files, such as RAW and DYR",
    "run": "steady state, modes and time response of a case's scenarios",
    "federate": "one component of a case as a federate at HELICS, for a run elsewhere",
    "modes": "steady state and eigenvalues of a case's scenarios",
    "linearize": "write a scenario's linear model A, B, C, D for other tools",
    "export-ssp": "write a case's scenarios as SSP archives for other tools",
    "export-comtrade": "write a run's signals as a COMTRADE recording for other tools",
    "export-dll": "write a converter's control as IEEE/CIGRE DLL for EMT programs",
    "steps": "the largest communication step within a given error, for each schedule",
    "scr": "short-circuit power of every bus, and SCR of the converters",
    "sweep": "modes over a grid of parameters, followed from point to point",
    "sensitivities": "how each parameter of each FMU moves a mode",
    "interactions": "modes that several vendors' converters share, and the pair that does not agree",
    "site": "where a converter helps: the shift of each mode by support at each bus",
    "screen": "critical modes of many operating points and outages",
    "compare": "two recorded runs: differences, and what each rings with",
    "source": "where the oscillations of a run or recording come from: which unit drives them",
    "identify": "the modes in a recorded signal (matrix pencil)",
    "report": "one self-contained HTML page from results of any study",
    "design": "design a POD controller by eigenvalue sensitivity",
    "admittance": "measure a device's admittance, and fit a model to it",
    "nyquist": "whether a device is stable at a network, from scans, FMUs and cases",
    "black-box": "modes of a case with a component known by its port alone",
    "certify": "the grid code's damping test on a converter FMU",
    "verify": "whether a certificate still holds: hashes, verdict, points computed anew",
    "build": "build FMUs of the catalogue's models",
    "which-master": "which schedule another tool runs, shown by a pair of probe FMUs",
    "bind": "draft a binding: what a foreign FMU's variables mean at our port",
    "check": "acceptance tests of an FMU: can it be trusted in a co-simulation?",
    "info": "show what an FMU declares",
}
"""Subcommands, each with a module of its name."""

_READERS = ("compare", "identify", "source", "verify")
"""Commands that read recordings, with xarray, and hand no array of theirs to dask or pint."""

EXAMPLES = """\
examples:
  gfor new own.raw own.dyr --converter "bus 9, 300 MVA, 200 MW, less sg3" --out case.toml
  gfor run two_area                              the paper's first case study, into results/two_area
  gfor run two_area --scenario pod_p --stop 5    one scenario, five seconds
  gfor modes two_area --set grid.X_L=0.3         eigenvalues on a longer line
  gfor modes my_case.toml --json                 a case file of your own, for a program to read
  gfor linearize two_area --scenario gfor        A, B, C, D with names, for MATLAB and others
  gfor export-ssp two_area --scenario pod_p      for FMI tools that read SSP; gfor itself runs it as well
  gfor sweep two_area --vary grid.X_L=0.1:0.5:9  modes followed along the line's reactance
  gfor sweep two_area --vary grid.X_L=0.1:3 --until unstable   how far it may grow
  gfor scr my_case.toml                          how weak the grid is at each bus
  gfor sensitivities two_area --scenario pod_p   which parameters move the mode, and how far
  gfor screen ieee39 --points year.csv --outages lines   critical modes hour by hour, outage by outage
  gfor site ieee39 --device pod_p --outages lines        at which bus a converter helps most
  gfor interactions my_case.toml                 which vendors' converters do not agree with each other
  gfor design two_area --controller pod_p        POD-P for its electromechanical mode
  gfor steps two_area --error 0.001:0.1          the largest step for 1 mHz and 0.1 points of damping
  gfor compare results/two_area/gfor results/two_area/pod_p
  gfor identify results/two_area/gfor "sg1.omega - sg2.omega"
  gfor identify recorder.cfg "F NORTH" --start 12     the modes in a measured recording
  gfor run two_area --like fmpy_ssp              what another master would give, to its last digits
  gfor run two_area --engine helics --federate gfor   the converter in a process of its own, over HELICS
  gfor federate two_area --component gfor --broker tcp://host:23405
  gfor which-master --build probes               two FMUs that tell which schedule a tool runs
  gfor admittance vendor.fmu                     its admittance, 0.05 Hz to 1 kHz
  gfor nyquist plant.txt network.txt --compensation "32 %"    is a scanned plant stable there?
  gfor black-box two_area --scenario gfor --component gfor
  gfor certify vendor.fmu --binding vendor.toml  the grid code's damping test
  gfor certify one.fmu two.fmu --code all        several converters under all codes, as one matrix
  gfor verify results/certify_vendor             whether a certificate still holds
  gfor build gfor --dest fmus                    the converter as an FMU for any FMI tool
  gfor export-dll gfor --dest dlls                its control as IEEE/CIGRE DLL for EMT programs
  gfor info fmus/gfor.fmu                        what an FMU declares
  gfor bind vendor.fmu                           draft of a binding: what its variables mean at our port
  gfor check vendor.fmu --binding vendor.toml    whether it can be trusted in a co-simulation
"""

QUESTIONS = """\
gfor: co-simulation of grid-forming converters, from FMUs and a case file

Is the network stable, and which swing is damped least?
  gfor modes two_area                                 modes of each scenario of a built-in case
  gfor modes two_area --scenario pod_p --set grid.X_L=0.3       with another value
  gfor run two_area --scenario pod_p --stop 5         after a fault or a step: signals and plots, in results/two_area
  gfor report results/two_area                        all that as one page for a browser

What makes it better or worse?
  gfor design two_area --controller pod_p             settings of a damping controller
  gfor sensitivities two_area --scenario pod_p        which parameter moves the mode, and how far
  gfor sweep two_area --vary grid.X_L=0.1:0.5:9       modes along a parameter
  gfor screen ieee39 --points year.csv --outages n-1  hour by hour, outage by outage
  gfor site ieee39 --device pod_p                     where to put a converter

Can this converter's FMU be trusted, and does it meet the grid code?
  gfor info vendor.fmu                                what it declares
  gfor bind vendor.fmu                                draft of its binding: what its variables mean
  gfor check vendor.fmu --binding vendor.toml         acceptance tests
  gfor certify vendor.fmu --binding vendor.toml       the damping test of a grid code
  gfor verify results/certify_vendor                  whether a certificate still holds

What does a recording say?
  gfor identify results/two_area/gfor "sg1.omega - sg2.omega"   the modes in a signal
  gfor compare results/two_area/gfor results/two_area/pod_p     two runs beside each other
  gfor source results/two_area/gfor                   which unit drives an oscillation

How do I take the models elsewhere?
  gfor build gfor --dest fmus                         an FMU for any FMI tool
  gfor export-dll gfor --dest dlls                    a DLL for EMT programs
  gfor linearize two_area --scenario gfor             A, B, C, D

A case of your own: `gfor new own.raw own.dyr --out case.toml` writes one, for the place of two_area; also from CGMES.
`gfor COMMAND --help` has a command's options, `gfor --help` all commands.
"""
"""What ``gfor`` alone prints."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns 0, 1 for a failure during a run, 2 for input that cannot be used."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    _print_anything()
    with calls.terminable(ending=arguments is None):
        code = _run(words)
    return TERMINATED if calls.terminated and code == INTERRUPTED else code


def _run(words: Sequence[str]) -> int:
    """Run; where it returns, no signal changes the exit code any more."""
    try:
        code = _done(words)
        if calls.taken and code != INTERRUPTED:
            raise KeyboardInterrupt  # somebody swallowed it on its way
        calls.over = True
    except BaseException as error:
        if not is_interrupt(error):
            raise
        calls.over = True
        print(ending(error), file=sys.stderr)
        exec("")  # clears CPython's note of an interrupt inside exec(), as of dataclasses; it would end us by SIGINT
        code = INTERRUPTED
    return code


def _done(words: Sequence[str]) -> int:
    try:
        with calls:  # libraries take an interrupt in their import for an error of their own
            parser = _parser(next((word for word in words if not word.startswith("-")), None))
        options = parser.parse_args(words)
        origin.said[:] = [lambda: _origin(words)]
        return int(options.command(options))
    except (CosimError, SetupError, OSError) as error:
        if is_interrupt(error):
            raise
        return _failed(error)


def _origin(words: Sequence[str]) -> dict[str, str]:
    from orchestrator.points.key import code_hash  # noqa: PLC0415 - only where results are written

    return {"command": shlex.join(["gfor", *words]), "code": code_hash()}


def _failed(error: CosimError | SetupError | OSError) -> int:
    """Say what was wrong; returns the exit code."""
    match error:
        case CosimError():
            _print_error(str(error))
            return error.exit_code
        case SetupError():
            _print_error(str(error))
            return InputError.exit_code
        case BrokenPipeError():
            return 0
        case OSError():  # of a file that no command expected to fail with
            _print_error(_os_error(error))
    return CosimError.exit_code


def _print_anything() -> None:
    """Have characters that a terminal's encoding lacks replaced; an error would come after all was computed."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors == "strict":
            codecs.register_error(_ESCAPE, _escaped)
            stream.reconfigure(errors=_ESCAPE)


def _escaped(error: UnicodeError) -> tuple[str, int]:
    r"""Characters that an encoding lacks, as ``\uXXXX``, which JSON reads."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    units = error.object[error.start : error.end].encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[k]:02x}{units[k + 1]:02x}" for k in range(0, len(units), 2)), error.end


def _os_error(error: OSError) -> str:
    where = f"{error.filename}: " if error.filename is not None else ""
    return f"{where}{error.strerror or error}; make sure that the disk has room and that you may read and write there"


def _print_error(text: str) -> None:
    from rich.console import Console  # noqa: PLC0415 - `gfor --version` and `gfor --help` do without
    from rich.markup import escape  # noqa: PLC0415

    console = Console(stderr=True, soft_wrap=True, highlight=False, emoji=False)
    console.print(f"[bold red]error:[/bold red] {escape(text)}")


def _first_page() -> int:
    print(QUESTIONS, end="")
    return 0


class _Version(argparse.Action):
    """Prints the installed version; it is only looked up when it is asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version  # noqa: PLC0415 - not needed by any command

        print(f"gfor-cosim {version('gfor-cosim')}")
        parser.exit()


class _Once(argparse._StoreAction):
    """An option whose second value would put the first one away in silence."""

    given = False

    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option: str | None = None) -> None:
        if option and self.given:
            parser.error(f"argument {option}: it is given twice, and takes one value; give it once")
        self.given = True
        super().__call__(parser, namespace, values, option)


class _Parser(argparse.ArgumentParser):
    """A parser whose help opens with the examples."""

    def format_help(self) -> str:
        return f"{EXAMPLES}\n{super().format_help()}"


class _Command(argparse.ArgumentParser):
    """A command's parser; it says what a reader of an option says is wrong."""

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        try:
            return super()._get_value(action, text)
        except InputError as error:
            raise argparse.ArgumentError(action, str(error)) from error
        except argparse.ArgumentError as error:
            if isinstance(error.__context__, ValueError) and not isinstance(action.type, type):
                raise argparse.ArgumentError(action, str(error.__context__)) from error
            raise


def _parser(chosen: str | None) -> argparse.ArgumentParser:
    """The parser, with the arguments of the one command that was chosen: the others' imports would take seconds."""
    parser = _Parser(prog="gfor", description="Co-simulation of grid-forming converters: run, linearise, build FMUs.")
    parser.set_defaults(command=lambda _: _first_page())
    parser.add_argument("--version", action=_Version, nargs=0, help="show the version and exit")
    commands = parser.add_subparsers(metavar="COMMAND", parser_class=_Command)
    for name, words in COMMANDS.items():
        command = commands.add_parser(name, help=words)
        if name == chosen:
            for kind in (None, "store"):
                command.register("action", kind, _Once)
            if name in _READERS:
                import_xarray_alone()
            module = import_module(f"orchestrator.cli.{name.replace('-', '_')}")
            module.add_arguments(command)
            command.set_defaults(command=module.run)
    return parser
