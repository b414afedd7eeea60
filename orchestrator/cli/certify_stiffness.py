"""``gfor certify --code gb``: a converter in the frequency domain, with figures and no verdict."""

import argparse
import json
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.certification.codes.bench_case import rated_frequency
from orchestrator.certification.codes.declared import checked
from orchestrator.certification.codes.frequency_domain import (
    figures_of_stiffness,
    measure_stiffness,
    save_stiffness,
    stiffness_in_words,
)
from orchestrator.certification.devices import Device
from orchestrator.cli.certify_codes import GB, bench_request, check_code_options
from orchestrator.cli.terminal import make_console, said_stages
from orchestrator.errors import InputError
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder


def run_stiffness(options: argparse.Namespace, device: Device) -> int:
    """Measure a converter; there is no verdict, so that it neither passes nor fails.

    Returns
    -------
    0
    """
    asked = {"--pdf": options.pdf, "--details": options.details, "--check": options.check}
    if other := [name for name, value in asked.items() if value]:
        raise InputError(f"{', '.join(other)}: --code {GB} gives figures and no certificate; leave it out")
    checked((), dict(options.declare), GB)
    check_code_options(options, [device])
    folder = made_folder(options.out or Path("results") / f"certify_{device.name}_{GB}", "--out")
    console = make_console(stderr=options.json)
    with held(folder):
        figures, files = measured_figures(device, folder)
    if options.json:
        print(json.dumps(figures, indent=1, ensure_ascii=False))
        return 0
    for line in stiffness_in_words(figures):
        console.print(escape(line), highlight=False)
    console.print(escape(figures["phase_jump"]["sentence"]), soft_wrap=True, highlight=False)
    console.print(escape(figures["sentence"][:1].upper() + figures["sentence"][1:]), soft_wrap=True)
    console.print(escape(f"Files in {folder}: {', '.join(f.name for f in files)}"), soft_wrap=True)
    return 0


def measured_figures(device: Device, folder: Path) -> tuple[dict[str, Any], list[Path]]:
    """Measure a converter and write its files; says on standard error what is being done."""
    request = bench_request(device)
    made_folder(folder, "--out")
    with said_stages() as report:
        f_n = rated_frequency(request, 50.0)
        found = measure_stiffness(request, f_n, report)
    files = save_stiffness(found, request.fmu.stem, f_n, folder)
    return figures_of_stiffness(found, request.fmu.stem, f_n), files
