"""``gfor certify --code gb``: a converter in the frequency domain, with figures and no verdict."""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from rich.markup import escape

from orchestrator.certification.codes.bench_case import rated_frequency
from orchestrator.certification.codes.declared import checked
from orchestrator.certification.codes.frequency_domain import figures_of_stiffness, measure_stiffness, save_stiffness
from orchestrator.certification.devices import Device
from orchestrator.cli.certify_codes import GB, bench_request, check_code_options
from orchestrator.cli.terminal import make_console, said_stages
from orchestrator.errors import InputError
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder


def run_stiffness(options: argparse.Namespace, devices: Sequence[Device]) -> int:
    """Measure a converter; there is no verdict, so that it neither passes nor fails.

    Parameters
    ----------
    options
        Of the command.
    devices
        What is measured: one device.

    Returns
    -------
    0

    Raises
    ------
    InputError
        If there are several devices, or an option that it does not have.
    """
    if len(devices) > 1:
        raise InputError(f"--code {GB} gives no verdict that a matrix could compare; give one converter at a time")
    (device,) = devices
    checked((), dict(options.declare), GB)
    check_code_options(options, devices)
    request = bench_request(device)
    folder = made_folder(options.out or Path("results") / f"certify_{device.name}_{GB}", "--out")
    console = make_console(stderr=options.json)
    with held(folder), said_stages() as report:
        found = measure_stiffness(request, rated_frequency(request, 50.0), report)
        files = save_stiffness(found, request.fmu.stem, folder)
    figures = figures_of_stiffness(found, request.fmu.stem)
    if options.json:
        print(json.dumps(figures, indent=1, ensure_ascii=False))
        return 0
    for name, one in figures["least"].items():
        console.print(escape(f"least |{name}|: {one['value']:.4g} at {one['at_hz']:.4g} Hz"), highlight=False)
    slow = figures["slow"]
    console.print(
        escape(f"P/ω at {slow['at_hz']:g} Hz: {slow['real']:.4g} {slow['imag']:+.4g}j pu/pu"), highlight=False
    )
    console.print(escape(figures["sentence"][:1].upper() + figures["sentence"][1:]), soft_wrap=True)
    console.print(escape(f"Files in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return 0
