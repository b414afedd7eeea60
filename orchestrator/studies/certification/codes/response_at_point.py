"""The frequency response of a certified device at one operating point of the bench."""

from collections.abc import Callable, Mapping

from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.studies.black_box.frequency_response import Excitation, FrequencyResponse, measure
from orchestrator.studies.black_box.port import bench_at
from orchestrator.studies.certification.codes.bench_point import STEP
from orchestrator.studies.certification.codes.programme import RATING_MVA
from orchestrator.studies.certification.request import CertificationRequest


def point_values(
    active: float, reactive: float, voltage: float, f_n: float
) -> dict[str, float | bool]:
    """Values of a device that feeds in powers [pu of its rating] at a voltage [pu] and a frequency [Hz]."""
    return {
        "S_n": RATING_MVA,
        "P_0": active,
        "Q_0": reactive,
        "v_0": voltage,
        "theta_0": 0.0,
        "f_n": f_n,
    }


def response_at(
    request: CertificationRequest,
    values: Mapping[str, float | bool],
    excitation: Excitation,
    report: Callable[[str], None],
    *,
    can_be_moved: bool = False,
) -> tuple[FrequencyResponse, complex]:
    """Measure a device at an ideal bus; return its response and the voltage there [pu].

    Parameters
    ----------
    values
        Of the operating point; those that the device does not have are left out.
    can_be_moved
        If a value that the user gave counts in place of the point's own.

    Raises
    ------
    InputError
        If the device has no port, or has no variable that the user names.
    """
    description = bound_fmu(request.fmu, request.binding)
    own = {name: value for name, value in values.items() if name in description.variables}
    given = dict(request.values)
    bench = bench_at(description, own | given if can_be_moved else given | own, STEP)
    return measure(bench, excitation, report), complex(*bench.rest)
