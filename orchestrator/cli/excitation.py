"""How a device is excited whose admittance is measured: options of two commands."""

import argparse

from orchestrator.asked import read_positive
from orchestrator.black_box.frequency_response import METHODS, Excitation
from orchestrator.cli.arguments import switch
from orchestrator.errors import InputError

_DEFAULTS = Excitation()


def add_excitation_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--method", choices=METHODS, default=_DEFAULTS.method, help="excitation (default: multisine)")
    parser.add_argument("--amplitude", type=read_positive, default=_DEFAULTS.amplitude, metavar="A",
                        help=f"largest deviation of the voltage [pu] ({_DEFAULTS.amplitude:g})")  # fmt: skip
    parser.add_argument("--from-hz", type=read_positive, default=_DEFAULTS.lowest_hz, metavar="F",
                        help=f"lowest frequency [Hz] ({_DEFAULTS.lowest_hz:g})")  # fmt: skip
    parser.add_argument("--to-hz", type=read_positive, default=_DEFAULTS.highest_hz, metavar="F",
                        help=f"highest frequency [Hz] ({_DEFAULTS.highest_hz:g})")  # fmt: skip
    switch(parser, "--no-state", "never save or restore the FMU's state")


def excitation_given(options: argparse.Namespace) -> list[str]:
    """Options of the excitation that are not left to their defaults."""
    said = {"--method": options.method != _DEFAULTS.method, "--amplitude": options.amplitude != _DEFAULTS.amplitude,
            "--from-hz": options.from_hz != _DEFAULTS.lowest_hz, "--to-hz": options.to_hz != _DEFAULTS.highest_hz,
            "--no-state": options.no_state}  # fmt: skip
    return [name for name, is_said in said.items() if is_said]


def excitation_of(options: argparse.Namespace) -> Excitation:
    if not options.from_hz < options.to_hz:
        raise InputError(f"--from-hz {options.from_hz:g} must be below --to-hz {options.to_hz:g}")
    return Excitation(options.method, options.from_hz, options.to_hz, amplitude=options.amplitude)
