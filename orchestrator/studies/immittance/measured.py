"""A scan of a running FMU or DLL, on the test bench of `gfor fmu admittance`."""

import cmath
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.core.arrays import Complex, Vector
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.black_box.fitting import IdentifiedModel, fit, require_fitting
from orchestrator.studies.black_box.frequency_response import Excitation, FrequencyResponse, measure
from orchestrator.studies.black_box.port import bench_at
from orchestrator.studies.immittance.scan import PER_UNIT, PortPoint, Scan


def scan_fmu(
    path: Path,
    binding: Path | None,
    given: Mapping[str, float | bool | str],
    step_size: float,
    excitation: Excitation,
    report: Callable[[str], None] | None = None,
) -> Scan:
    """Measure a device at the operating point of its values [pu on the system base of 100 MVA]."""
    require_fitting()
    bench = bench_at(bound_fmu(path, binding), given, step_size)
    return as_scan(path.name, measure(bench, excitation, report), complex(*bench.rest))


def as_scan(
    name: str, response: FrequencyResponse, voltage: complex, kilovolt: float = 1.0
) -> Scan:
    """The admittance of a measured response, d along the voltage, dense where the model fitted to it turns quickly.

    Its bounds hold what two amplitudes differ by and what the model misses of the measured values."""
    model, measured = fit(response), response.frequencies
    at, wide = np.abs(model.poles.imag) / (2 * np.pi), np.abs(model.poles.real) / (2 * np.pi)
    around = [at + k * wide for k in (-4, -2, -1, -0.5, -0.25, 0, 0.25, 0.5, 1, 2, 4)]
    wanted = np.unique(
        np.concatenate([measured, np.geomspace(measured[0], measured[-1], 1500), *around])
    )
    inside = wanted[(wanted >= measured[0]) & (wanted <= measured[-1])]
    apart = np.diff(inside, prepend=-1.0) > 1e-6 * inside
    frequencies = inside[apart]
    values = -_without_hold(model, 2j * np.pi * frequencies)
    size = np.linalg.norm(values, ord=2, axis=(1, 2))
    bounds = np.linalg.norm(response.bounds, axis=(1, 2)) / np.linalg.norm(
        response.values, ord=2, axis=(1, 2)
    )
    power = voltage * complex(*response.operating_point).conjugate() * SYSTEM_BASE_MVA
    point = PortPoint(abs(voltage) * kilovolt, power.real, power.imag, cmath.phase(voltage))
    share = np.interp(frequencies, measured, bounds) + model.error
    in_network = Scan(
        name,
        frequencies,
        values=values,
        ports=(name,),
        unit=PER_UNIT,
        bounds=share * size,
        points={name: point},
    )
    return in_network.rotated([-cmath.phase(voltage)])


def _without_hold(model: IdentifiedModel, s: Vector) -> Complex:
    """Return what held inputs make of the device over a step, taken back to the device itself, mode by mode."""
    mu, V = np.linalg.eig(model.A)
    poles = np.log(mu.astype(complex)) / model.step_size
    rise = np.where(np.abs(mu - 1) < 1e-12, 1 / model.step_size, poles / (mu - 1))
    B = rise[:, None] * np.linalg.solve(V, model.B.astype(complex))
    return np.asarray(((model.C @ V) / (s[:, None, None] - poles)) @ B + model.D)
