"""``gfor certify --code frequency``: voltage source behaviour of a device, from its admittance."""

import argparse
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.cases.form.devices import Device
from orchestrator.core.safe_files import made_folder
from orchestrator.face.cli.certificate import (
    FREQUENCY,
    check_code_options,
    refuse_certificate_options,
)
from orchestrator.face.cli.terminal import make_console, print_json, said_stages
from orchestrator.output.results.lock import hold_folder
from orchestrator.studies.certification.codes.row import checked
from orchestrator.studies.certification.kinds import bench_request
from orchestrator.studies.certification.request import rated_frequency


def run_frequency(options: argparse.Namespace, device: Device) -> int:
    """Measure, print and write; 0 where it behaves as a voltage source at every operating point, else 1."""
    refuse_certificate_options(options, FREQUENCY)
    checked((), dict(options.declare), FREQUENCY)
    check_code_options(options, [device])
    folder = options.out or Path("results") / f"certify_{device.name}_{FREQUENCY}"
    with hold_folder(folder):
        figures, files = measured_behaviour(device, folder)
    if options.json:
        print_json(figures)
    else:
        console = make_console()
        for line in lines_of(figures):
            console.print(escape(line), soft_wrap=True, highlight=False)
        names = ", ".join(file.name for file in files)
        console.print(escape(f"Files in {folder}: {names}"), soft_wrap=True)
    return 0 if figures["verdict"] else 1


def measured_behaviour(device: Device, folder: Path) -> tuple[dict[str, Any], list[Path]]:
    """Measure a device at each operating point, and write figures, impedances and their picture."""
    # scipy, for other codes in vain
    from orchestrator.studies.certification.codes.frequency import files  # noqa: PLC0415
    from orchestrator.studies.certification.codes.frequency.measurement import (  # noqa: PLC0415
        measure_points,
    )

    request = bench_request(device.file, device.binding, device.values)
    made_folder(folder, "--out")
    with said_stages() as report:
        f_n = rated_frequency(request, 50.0)
        points = measure_points(request, f_n, report)
    figures = files.figures_of(points, request.fmu.stem, f_n)
    return figures, files.save(points, figures, folder)


def lines_of(figures: Mapping[str, Any]) -> Iterator[str]:
    """Lines to be printed: a few for each operating point, the sources, and the verdict."""
    for one in figures["points"]:
        where = f"P {one['P']:g}, Q {one['Q']:g}, V {one['V']:g} pu"
        if one["failure"]:
            yield f"{where}: not measured: {one['failure']}"
            continue
        angle, magnitude = one["springs"]["angle"], one["springs"]["magnitude"]
        yield (
            f"{where}: opposes the angle by {angle['value']:.3g} pu/rad, "
            f"the magnitude by {magnitude['value']:.3g} pu/pu"
        )
        parts = (f"{value:.3g} at {hertz}" for hertz, value in one["reactance"].items())
        yield f"  reactance of the positive sequence [pu], at frequencies [Hz]: {', '.join(parts)}"
        bands = ", ".join(f"{low:.3g} to {high:.3g} Hz" for low, high in one["active_hz"])
        yield f"  can feed an oscillation: {bands or 'at no frequency from 1 to 300 Hz'}"
        for row in one["strength"]["ratios"]:
            yield f"  SCR {row['scr']:g}: {_at_ratio(row)}"
        limit = one["strength"]["scr_limit"]
        if limit is not None:
            yield f"  stable down to {f'SCR {limit:.2g}' if limit else 'any SCR'}, by the gain margin"
        slow = one["swing"]
        if slow is not None:
            yield (
                f"  seen from the terminals: H = {slow['inertia']:.3g} s, D = {slow['damping']:.3g} pu/pu "
                f"(unexplained: {100 * slow['misses']:.2g} %)"
            )
    yield from (f"{text[0].upper()}{text[1:]}." for text in figures["sources"])
    yield f"{figures['sentence'][0].upper()}{figures['sentence'][1:]}"


def _at_ratio(row: Mapping[str, Any]) -> str:
    said = [row["verdict"]]
    if row["distance"] is not None:
        said.append(f"{row['distance']:.2f} from −1")
    if row["damping"] is not None:
        said.append(f"least damping {row['damping']:.3g} % at {row['frequency']:.3g} Hz")
    return ", ".join(said)
