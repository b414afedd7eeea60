"""Measurement of a device's admittance at an ideal bus, at each operating point."""

from collections.abc import Callable, Sequence

import numpy as np

from orchestrator.core.errors import AnalysisError
from orchestrator.studies.black_box.fitting import bands_of, passivity, require_fitting
from orchestrator.studies.black_box.frequency_response import Excitation, FrequencyResponse
from orchestrator.studies.certification.codes.frequency.figures import (
    SLOW,
    TOLD,
    impedances,
    springs,
    swing,
)
from orchestrator.studies.certification.codes.frequency.point import (
    POINTS,
    AtPoint,
    ScannedPoint,
)
from orchestrator.studies.certification.codes.frequency.strength import strengths
from orchestrator.studies.certification.codes.response_at_point import point_values, response_at
from orchestrator.studies.certification.codes.stiffness import stiffness
from orchestrator.studies.certification.request import CertificationRequest

# at the first operating point, from 0.05 Hz on, where inertia shows
WHOLE = Excitation()
FAST = Excitation(lowest_hz=1.0, lines=90)  # at the others


def measure_points(
    request: CertificationRequest,
    f_n: float,
    report: Callable[[str], None],
    points: Sequence[ScannedPoint] = (),
) -> list[AtPoint]:
    """Measure a device at an ideal bus, at each operating point; at `POINTS` where none is given.

    Raises a `MissingLibraryError` without what fits a model to the admittance."""
    require_fitting()
    found, wanted = [], points or POINTS
    for number, point in enumerate(wanted):
        report(f"Operating point {number + 1} of {len(wanted)}: {point}")
        try:
            found.append(_measured(request, f_n, report, point, number == 0))
        except AnalysisError as error:
            found.append(AtPoint(point, failure=str(error)))
    return found


def _measured(
    request: CertificationRequest,
    f_n: float,
    report: Callable[[str], None],
    point: ScannedPoint,
    slowly: bool,
) -> AtPoint:
    values = point_values(point.active, point.reactive, point.voltage, f_n)
    response, voltage = response_at(request, values, WHOLE if slowly else FAST, report)
    return at_point(point, request.fmu.name, response, voltage, f_n=f_n)


def at_point(
    point: ScannedPoint, name: str, response: FrequencyResponse, voltage: complex, *, f_n: float
) -> AtPoint:
    """Figures of a measured response."""
    stiff = stiffness(response, voltage, f_n)
    passive = passivity(response)
    told = (passive.frequencies >= TOLD[0]) & (passive.frequencies <= TOLD[1])
    active = bands_of(passive.frequencies[told], (passive.index < -passive.bounds)[told])
    f, Y = response.frequencies, response.continuous()
    return AtPoint(
        point,
        springs=springs(stiff, f_n),
        impedances=impedances(f, Y, float(np.angle(voltage)), f_n),
        active_hz=tuple(active),
        strengths=strengths(name, response, voltage, f_n),
        swing=swing(stiff) if f[0] < SLOW else None,
    )
