"""Whether a device is stable at a network, by the generalised Nyquist criterion."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from orchestrator.binding.binding import bound_fmu
from orchestrator.black_box.port import start_of
from orchestrator.cases.given import case_values, plain
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.errors import InputError
from orchestrator.immittance.retune import REACH, Tunable
from orchestrator.immittance.scan_files import ENDINGS
from orchestrator.immittance.study import CutRequest, CutResult, study_cut
from orchestrator.immittance.view import Nyquist
from orchestrator.sensitivities.parameters import Parameter, parameters_in
from orchestrator.units import to_unit


def nyquist(
    device: str | Path, network: str | Path | None = None, *, frequency: float | str = 50.0, compensation: float = 0.0,
    angle: float | None = None, voltage: float | str | None = None, bus: str | None = None,
    components: Sequence[str] = (), scenario: str | None = None, values: Mapping[str, Any] | None = None,
    scr: float | None = None, rating: float | str | None = None,
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
    scr
        Short-circuit ratio of an ideal source that stands for the network.
    rating
        Of the device [MVA], where it states none.

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
    rated = None if rating is None else to_unit(rating, "MVA")
    return Asked(
        str(device), None if network is None else str(network), scenario, plain(values),
        frequency=to_unit(frequency, "Hz"), compensation=compensation / 100, angle=angle, bus=bus,
        components=tuple(components), scr=scr, rating_mva=rated,
        kilovolt=None if voltage is None else to_unit(voltage, "kV"),
    ).judged()  # fmt: skip


class Asked:
    """What is judged, as it was given, and the same with other values.

    Parameters
    ----------
    device, network, scenario, given
        As `nyquist` has them, ``given`` for ``values``.
    trust_fmus
        As for `load`.
    rest
        Further fields of the request.
    """

    def __init__(
        self, device: str, network: str | None, scenario: str | None, given: Mapping[str, Any], *,
        trust_fmus: bool = False, **rest: Any,
    ) -> None:  # fmt: skip
        self._of_case = is_case(device) if network is None else is_case(network)
        if network is None and not is_case(device) and rest.get("scr") is None:
            raise InputError(
                f"{device}: give its network as well: a scan, a short-circuit ratio by --scr, or a case with --bus or "
                "--component"
            )
        self._device = Path(device) if network is not None or not self._of_case else None
        self._case, self._scenario, self._given, self._trust = network or device, scenario, dict(given), trust_fmus
        self._rest = rest

    def request(self, changed: Mapping[str, Any] = MappingProxyType({})) -> CutRequest:
        """The request, with some values changed."""
        values = self._given | dict(changed)
        of_case = {name: v for name, v in values.items() if self._of_case and (self._device is None or "." in name)}
        network: Path | PreparedScenario | None = None if self._rest.get("scr") is not None else Path(self._case)
        if self._of_case:
            network = network_of(self._case, self._scenario, of_case, trust_fmus=self._trust)
        of_fmu = {name: v for name, v in values.items() if name not in of_case}
        return CutRequest(self._device, network, values=of_fmu, **self._rest)

    def judged(self, report: Callable[[str], None] | None = None) -> Nyquist:
        """Judge it."""
        result = study_cut(self.request(), report)
        return Nyquist(
            result, lambda changed: study_cut(self.request(changed)), lambda names: self._settings(result, names)
        )

    def _settings(self, result: CutResult, given: Sequence[str]) -> list[Tunable]:
        """Parameters of the device: all tunable ones, or those that are named, each with its range."""
        prefix, descriptions, values = "", {}, {}
        if self._device is None and isinstance(result.request.network, PreparedScenario) and result.cut is not None:
            plans = {name: result.request.network.system.components[name] for name in result.cut.devices}
            descriptions = {name: plan.description for name, plan in plans.items()}
            value_of = lambda name, variable: plans[name].number(variable)  # noqa: E731
        elif self._device is not None and self._device.suffix.lower() not in ENDINGS:
            prefix, values = "device.", result.request.values
            descriptions = {"device": bound_fmu(self._device, result.request.binding)}
            value_of = lambda _, variable: float(values.get(variable, start_of(descriptions["device"], variable)))  # noqa: E731
        else:
            raise InputError(
                f"--retune: {self._device} is a scan, which has no parameters; give the FMU or DLL itself, or a "
                "case with it"
            )
        ranges = {name: read_range(span) for name, _, span in (text.partition("=") for text in given)}
        found = parameters_in(descriptions, value_of, [prefix + name for name in ranges])
        return [setting for x in found if (setting := _setting(x, x.name.removeprefix(prefix), ranges)) is not None]


def _setting(x: Parameter, name: str, ranges: Mapping[str, tuple[float, float] | None]) -> Tunable | None:
    """With its range, within its bounds; None for one that is 0 and has none."""
    low, high = ranges.get(name) or sorted((x.value / REACH, x.value * REACH))
    low, high = (max(min(end, math.inf if x.maximum is None else x.maximum),
                     -math.inf if x.minimum is None else x.minimum) for end in (low, high))  # fmt: skip
    return Tunable(name, x.unit, x.value, min(low, x.value), max(high, x.value)) if low < high else None


def read_range(text: str) -> tuple[float, float] | None:
    """``LOW:HIGH``; None where it is empty."""
    if not text:
        return None
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        low = high = math.nan
    if not low < high:
        raise InputError(f"--parameter: {text!r} is no range; write NAME=LOW:HIGH, such as droop.R_f=0.02:0.2")
    return low, high


def is_case(text: str) -> bool:
    """Whether a side is a case, and no scan, FMU or DLL."""
    return Path(text).suffix.lower() not in (*ENDINGS, ".fmu", ".so", ".dll")


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
