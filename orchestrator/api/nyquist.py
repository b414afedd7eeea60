"""Whether a device is stable at a network, by the generalised Nyquist criterion."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from orchestrator.cases.given import case_values, plain
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.immittance.scan_files import ENDINGS
from orchestrator.immittance.study import CutRequest, study_cut
from orchestrator.immittance.view import Nyquist
from orchestrator.units import to_unit


def nyquist(
    device: str | Path, network: str | Path | None = None, *, frequency: float | str = 50.0, compensation: float = 0.0,
    angle: float | None = None, voltage: float | str | None = None, bus: str | None = None,
    components: Sequence[str] = (), scenario: str | None = None, values: Mapping[str, Any] | None = None,
) -> Nyquist:  # fmt: skip
    """Judge a device at a network.

    Parameters
    ----------
    device
        A scan of Z-tool's or IMTB's form, an FMU or a DLL; or a case, with ``network`` left out.
    network
        A scan, or a case, of which the device takes the place that ``bus`` or ``components`` names.
    frequency
        Rated frequency [Hz].
    compensation
        Series capacitors, in percent of the network's reactance.
    angle
        Of the device's frame before the network's [rad]; None where the files state it.
    voltage
        Rated voltage at the cut [kV], between per unit and siemens.
    bus, components
        Where a case is cut; at all its devices where neither is given.
    scenario
        Of the case; its first by default.
    values
        ``component.parameter`` of the case, or variables of the FMU.

    Returns
    -------
    Nyquist
        Verdict, crossings and margins.

    Raises
    ------
    InputError
        If a file cannot be used, or both sides do not belong together.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.nyquist("two_area", components=["gfor"], scenario="gfor").verdict
    'stable'
    """
    case = device if network is None else network
    given = plain(values)
    of_case = {name: value for name, value in given.items() if network is None or "." in name}
    is_scan = Path(case).suffix.lower() in ENDINGS
    other = Path(case) if is_scan else network_of(str(case), scenario, of_case)
    request = CutRequest(
        None if network is None else Path(device), other, to_unit(frequency, "Hz"), compensation / 100, angle, bus,
        tuple(components), None if voltage is None else to_unit(voltage, "kV"),
        values={n: v for n, v in given.items() if is_scan or n not in of_case},
    )  # fmt: skip
    return Nyquist(study_cut(request))


def network_of(
    case: str, scenario: str | None, values: Mapping[str, Any], *, trust_fmus: bool = False
) -> PreparedScenario:
    """The scenario that is cut.

    Parameters
    ----------
    case
        A built-in case, or a path.
    scenario
        Its name; the case's first where None.
    values
        ``component.parameter`` of the case.
    trust_fmus
        As for `load`.
    """
    from orchestrator.api.scenario import choose  # noqa: PLC0415 - scans need no cases
    from orchestrator.cases.case import load_case  # noqa: PLC0415
    from orchestrator.study.request import ScenariosRequest  # noqa: PLC0415

    asked = ScenariosRequest(values=case_values(values))
    return choose(load_case(case, trust_fmus=trust_fmus), [scenario] if scenario else [], asked)[0].prepared
