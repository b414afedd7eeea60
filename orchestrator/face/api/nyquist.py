"""Stability of a device at a network, by the generalised Nyquist criterion."""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from orchestrator.cases.form.given import case_values, plain
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.asked import names, number_in
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.core.toml_files import read_toml
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.vendor_files import DEVICE_ENDING, DLL_ENDINGS
from orchestrator.face.api.case import Case
from orchestrator.studies.black_box.port import start_of
from orchestrator.studies.immittance.retune import REACH, Tunable
from orchestrator.studies.immittance.scan_files import ENDINGS
from orchestrator.studies.immittance.study import CutRequest, CutResult, study_cut
from orchestrator.studies.immittance.view import Nyquist
from orchestrator.studies.sensitivities.parameters import Parameter, parameters_in

_FMU = "device."  # before the names of an FMU's own parameters


def nyquist(
    device: str | Path | Case,
    network: str | Path | Case | None = None,
    *,
    frequency: float | str = 50.0,
    compensation: float = 0.0,
    angle: float | None = None,
    voltage: float | str | None = None,
    bus: str | None = None,
    components: Sequence[str] = (),
    scenario: str | None = None,
    values: Mapping[str, Any] | None = None,
    scr: float | None = None,
    x_r: float = 10.0,
    rating: float | str | None = None,
) -> Nyquist:
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
    x_r
        Reactance over resistance of its impedance.
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
    rated = (
        None
        if rating is None
        else number_in(rating, "MVA", "rating", "a rating in MVA, such as 100")
    )
    share = number_in(compensation, "", "compensation", "a share in percent, such as 30") / 100
    kilovolt = (
        None
        if voltage is None
        else number_in(voltage, "kV", "voltage", "a voltage in kV, such as 230")
    )
    return Asked(
        _place(device, "device"),
        None if network is None else _place(network, "network"),
        scenario,
        plain(values),
        trust_fmus=any(isinstance(one, Case) and one.file.trust_fmus for one in (device, network)),
        frequency=number_in(frequency, "Hz", "frequency", "one in Hz, such as 50"),
        compensation=share,
        angle=angle,
        bus=bus,
        components=names(components, "components"),
        scr=scr,
        x_r=x_r,
        rating_mva=rated,
        kilovolt=kilovolt,
    ).judge()


def _place(given: str | Path | Case, argument: str) -> str:
    return str(given.file.path if isinstance(given, Case) else path_of(given, argument))


class Asked:
    """A device and a network to be judged, as they were given, and the same with other values.

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
        self,
        device: str,
        network: str | None,
        scenario: str | None,
        given: Mapping[str, Any],
        *,
        trust_fmus: bool = False,
        **rest: Any,
    ) -> None:
        self._of_case = _is_case(network or device)
        if network is None and not self._of_case and rest.get("scr") is None:
            raise InputError(
                f"{device}: give its network as well: a scan, a short-circuit ratio by "
                + Option.SCR
                + ", or a case with "
                + Option.BUS
                + " or "
                + Option.COMPONENT
            )
        self._device = Path(device) if network is not None or not self._of_case else None
        self._case, self._scenario, self._given, self._trust = (
            network or device,
            scenario,
            dict(given),
            trust_fmus,
        )
        self._rest = rest

    def _request(self, changed: Mapping[str, Any] = MappingProxyType({})) -> CutRequest:
        values = self._given | dict(changed)
        of_case = {
            name: v
            for name, v in values.items()
            if self._of_case and (self._device is None or "." in name)
        }
        network: Path | PreparedScenario | None = (
            None if self._rest.get("scr") is not None else Path(self._case)
        )
        network = self._prepared(of_case) if self._of_case else network
        of_fmu = {name: v for name, v in values.items() if name not in of_case}
        if of_fmu and self._device and self._device.suffix.lower() in ENDINGS:
            raise InputError(
                f"{self._device}: a scan has no {next(iter(of_fmu))} to be set; give the FMU itself"
            )
        return CutRequest(self._device, network, values=of_fmu, **self._rest)

    def _prepared(self, values: Mapping[str, Any]) -> PreparedScenario:
        from orchestrator.cases.case import load_case  # noqa: PLC0415
        from orchestrator.face.api.scenario import choose  # noqa: PLC0415 - scans need no cases
        from orchestrator.studies.modes.request import ScenariosRequest  # noqa: PLC0415

        asked, names = (
            ScenariosRequest(values=case_values(values)),
            [self._scenario] if self._scenario else [],
        )
        return choose(
            replace(load_case(self._case, trust_fmus=self._trust), scans=True), names, asked
        )[0].prepared

    def at(self, point: Mapping[str, Any]) -> "Asked":
        """The same with other values; ``device`` among them is the file of another scan of the device."""
        found, values = copy(self), dict(point)
        other = None if self._device is None else values.pop("device", None)
        if other is not None:
            found._device = Path(other)
        found._given = self._given | values
        return found

    def judge(self, report: Callable[[str], None] | None = None) -> Nyquist:
        """Judge it."""
        result = study_cut(self._request(), report)
        return Nyquist(
            result,
            lambda values: study_cut(self._request(values)),
            lambda x: self._settings(result, x),
        )

    def _settings(self, result: CutResult, given: Sequence[str]) -> list[Tunable]:
        """Parameters of the device that are not 0: all tunable ones that are not switched off, or those named."""
        case = (
            None if self._device or result.scans or result.cut is None else result.request.network
        )
        if isinstance(case, PreparedScenario) and result.cut is not None:
            plans = {name: case.system.components[name] for name in result.cut.devices}
            known, patterns = {name: plan.description for name, plan in plans.items()}, list(given)

            def value_of(name: str, variable: str) -> float:
                return plans[name].number(variable)

        elif self._device and self._device.suffix.lower() not in ENDINGS:
            fmu, values = bound_fmu(self._device, result.request.binding), result.request.values
            known, patterns = {_FMU[:-1]: fmu}, [f"{_FMU}{name}" for name in given]

            def value_of(name: str, variable: str) -> float:
                return float(values.get(variable, start_of(fmu, variable)))

        else:
            what = (
                Option.RETUNE
                + f": {self._device or result.loop.device.name} is a scan and has no parameters"
            )
            raise InputError(f"{what}; give the FMU, DLL or case itself")

        def acts(x: Parameter) -> bool:
            switch = f"{x.variable.rpartition('.')[0]}.enabled"
            return switch not in known[x.component].variables or bool(value_of(x.component, switch))

        return [
            _range(x)
            for x in parameters_in(known, value_of, patterns)
            if x.value and (given or acts(x))
        ]


def _range(x: Parameter) -> Tunable:
    """A quarter to four times its value, within its bounds."""
    low, high = sorted((x.value / REACH, x.value * REACH))
    low, high = (
        low if x.minimum is None else max(low, x.minimum),
        high if x.maximum is None else min(high, x.maximum),
    )
    return Tunable(x.name.removeprefix(_FMU), x.unit, x.value, low, high)


def _is_case(text: str) -> bool:
    """Return whether it is neither a scan nor a device: an FMU, a DLL, or a device's file around one."""
    path = Path(text)
    if path.suffix.lower() == DEVICE_ENDING and path.is_file():
        return (
            "dll"
            not in read_toml(path, "the case, or the file of a device", "give one of the two")[1]
        )
    return path.suffix.lower() not in (*ENDINGS, ".fmu", *DLL_ENDINGS)
