"""A scan of a running FMU or DLL, on the test bench of `gfor admittance`."""

import cmath
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from orchestrator.binding.binding import bound_fmu
from orchestrator.black_box.bench import Bench
from orchestrator.black_box.frequency_response import Excitation, FrequencyResponse, measure
from orchestrator.black_box.port import check_port, start_of, values_for
from orchestrator.nyquist.scan import PER_UNIT, PortPoint, Scan


def scan_fmu(
    path: Path, binding: Path | None, given: Mapping[str, float | bool | str], step_size: float, excitation: Excitation,
    report: Callable[[str], None] | None = None,
) -> Scan:  # fmt: skip
    """Measure a device at the operating point of its values [pu on the system base of 100 MVA]."""
    description = bound_fmu(path, binding)
    values = values_for(description, given)
    magnitude, angle = (float(values.get(name, start_of(description, name))) for name in ("v_0", "theta_0"))
    rest = cmath.rect(magnitude, angle)
    bench = Bench(description, values, np.array([rest.real, rest.imag]), step_size=step_size)
    check_port(description, bench)
    return as_scan(path.name, measure(bench, excitation, report), angle)


def as_scan(name: str, response: FrequencyResponse, angle: float) -> Scan:
    """The admittance of a measured response, in the network's frame."""
    size = np.linalg.norm(response.continuous(), ord=2, axis=(1, 2)) / np.linalg.norm(
        response.values, ord=2, axis=(1, 2)
    )
    bounds = size * np.linalg.norm(response.bounds, axis=(1, 2))
    points = {name: PortPoint(angle=0.0)}  # measured in the network's frame already
    return Scan(name, response.frequencies, -response.continuous(), (name,), PER_UNIT, bounds, points)
