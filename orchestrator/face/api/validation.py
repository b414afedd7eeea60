"""A device's model beside recordings of the plant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.cases.form.given import Time, binding_path, case_values, in_seconds, moment, plain
from orchestrator.core.asked import check_callable, names, number_in
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import remembered_sha256
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.description import FmuDescription
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.face.api.given_recording import Recorded, open_given
from orchestrator.face.api.methods import in_turn
from orchestrator.studies.black_box.port import start_of, values_for
from orchestrator.studies.validation.device import PlayedDevice
from orchestrator.studies.validation.limits import read_limits
from orchestrator.studies.validation.record import PortBases
from orchestrator.studies.validation.study import GivenRecording, ValidationRequest, validate_device
from orchestrator.studies.validation.transformer import read_transformer
from orchestrator.studies.validation.view import Validation
from orchestrator.systems.coupling.step_awareness import STEP_PARAMETER

_FMUS = (".fmu", ".dll", ".so", ".dylib", ".toml")
_RATED_HZ = 50.0  # of a device that says nothing


@in_turn
def validate(
    device: str | Path,
    recordings: Recorded | Sequence[Recorded],
    *,
    values: Mapping[str, Any] | None = None,
    binding: str | Path | None = None,
    component: str | None = None,
    scenario: str | None = None,
    channels: Sequence[str] = (),
    place: str | None = None,
    voltage: float | str | None = None,
    transformer: str | None = None,
    events: Sequence[tuple[Time, Time]] = (),
    average: Time | None = None,
    limits: str | Path | None = None,
    fit: str | Sequence[str] = (),
    bounds: Mapping[str, tuple[float, float]] | None = None,
    hold_back: Recorded | Sequence[Recorded] = (),
    beside: str | Path | None = None,
    explain: bool = False,
    start: Time | None = None,
    stop: Time | None = None,
    step: Time = 1e-4,
    report: Callable[[str], None] = lambda text: None,
) -> Validation:
    """Let the recorded voltage drive a device, and compare its P and Q with the measured ones.

    Parameters
    ----------
    device
        An FMU, a DLL or the file of a device around one, the name of a model of ours, or a case with ``component``.
    recordings
        One or several: runs, datasets, DataFrames over the time [s], or files (CSV, Excel, COMTRADE).
    values
        Of the device, such as ``{"pod_p.enabled": True}``; of a case ``component.parameter``.
    binding
        File that says what the device's variables mean at our port.
    component, scenario
        Of a case.
    channels
        Which column is what, such as ``"p=-P_total in kW"``; others are found by their names.
    place
        Unit of a run, or the part of the names before the point.
    voltage
        Rated voltage between lines [kV], where the recording is in kV or V.
    transformer
        Between meter and port, such as ``"X 0.12"`` or ``"R 0.005 X 0.12"`` [pu of the rating]; ``"X 0.12 of V"`` if
        the voltage alone is measured beyond it, ``"X 0.12 of PQ"`` if P and Q alone are.
    events
        Begin and end of the event [s], one for all recordings or one for each; found where none is given.
    average
        Time over which P and Q are averaged before they are compared [s]; a period by default, 0 for none.
    limits
        File of limits; without it there is no verdict.
    fit
        Parameters that are fitted, such as ``"droop.R_f, pod_p.K"``; switches are tried on and off. What the recordings
        cannot tell is left where it is.
    bounds
        Of fitted parameters, in their units; by default what the device declares.
    hold_back
        Recordings that are not fitted, and confirm the fit.
    beside
        Another model of the same plant, such as its EMT model beside the phasor model: driven, compared and judged in
        the same way. It takes those ``values`` that it knows.
    explain
        Whether to look for the cause that would explain the errors: a switch, one number or two, a delay or a limit of
        the current.
    start, stop
        The part of each recording that is used [s].
    step
        Communication step [s].
    report
        Called with a sentence before each part of the work.

    Raises
    ------
    InputError
        If a file, channel, unit or value cannot be used.
    ComponentError
        If the device fails while it runs.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> run = gfor.load("two_area").scenario("pod_p").run(stop=3.0)
    >>> found = gfor.validate("gfor", run, values={"pod_p.enabled": True}, place="gfor")
    >>> "no noise" in [question["kind"] for question in found.as_json()["events"][0]["questions"]]
    True
    """
    step_size = in_seconds(step, "step") or 1e-4
    check_callable(report, "report")
    if bounds and not fit:
        raise InputError(
            f"bounds = {bounds!r}: they are of parameters that are fitted; give fit={', '.join(bounds)!r}"
        )
    if component is not None:
        found = _of_case(str(device), component, scenario, values, step_size)
    else:
        found = _alone(device, binding, values, step_size)
    port = found.description.port if isinstance(found.description, BoundDescription) else None
    kilovolt = port.V_n if port else None
    if voltage is not None:
        kilovolt = number_in(voltage, "kV", "voltage", "a voltage in kV, such as 230")
    mean = None if average is None else moment(average, "average")
    bases = PortBases(found.rating, found.rated_hz, kilovolt, read_transformer(transformer), mean)
    given = _all_given(_as_list(recordings), hold_back, start, stop)
    request = ValidationRequest(
        found,
        given,
        bases,
        channels=names(channels, "channels"),
        place=place,
        events=_windows(events),
        limits=None if limits is None else read_limits(path_of(limits, "limits")),
        fit=_names_of(fit),
        bounds=bounds or {},
        beside=None if beside is None else _other(beside, found, values, step_size),
        explain=explain,
    )
    return Validation(validate_device(request, report))


def _as_list(recordings: Any) -> list[Any]:
    found = list(recordings) if isinstance(recordings, list | tuple) else [recordings]
    if not found:
        raise InputError("recordings = []; give at least one recording")
    return found


def _names_of(fit: str | Sequence[str]) -> list[str]:
    """Names that are listed, or stand in one text with commas."""
    return [one.strip() for text in names(fit, "fit") for one in text.split(",") if one.strip()]


def _all_given(
    recordings: Sequence[Any], hold_back: Any, start: Time | None, stop: Time | None
) -> list[GivenRecording]:
    kept = list(hold_back) if isinstance(hold_back, list | tuple) else [hold_back]
    found = [_read_given(one, k, start, stop) for k, one in enumerate(recordings, 1)]
    others = [_read_given(one, k, start, stop) for k, one in enumerate(kept, len(found) + 1)]
    return found + [replace(one, held_back=True) for one in others]


def _windows(given: Any) -> list[tuple[float, float]]:
    """Begin and end of each event; two times alone are one event."""
    if isinstance(given, str) or not isinstance(given, Sequence):
        raise InputError(f"events = {given!r}; give begin and end of each, such as [(2.0, 2.15)]")
    is_one = len(given) == 2 and all(isinstance(one, float | int | str) for one in given)
    return [_window(given)] if is_one else [_window(one) for one in given]


def _window(given: Any) -> tuple[float, float]:
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise InputError(f"events: {given!r}; give begin and end of an event, such as (2.0, 2.15)")
    return moment(given[0], "events"), moment(given[1], "events")


def _read_given(one: Any, number: int, start: Time | None, stop: Time | None) -> GivenRecording:
    dataset, label = open_given(one, f"recording {number}")
    low = None if start is None else moment(start, "start")
    high = None if stop is None else moment(stop, "stop")
    dataset = dataset.sel(time=slice(low, high))
    if not dataset.sizes["time"]:
        raise InputError(f"{label}: it has no sample between start and stop")
    is_file = isinstance(one, str | Path) and Path(one).is_file()
    return GivenRecording(dataset, label, remembered_sha256(Path(one)) if is_file else "")


def _alone(
    device: str | Path, binding: str | Path | None, values: Mapping[str, Any] | None, step: float
) -> PlayedDevice:
    path = path_of(device, "device")
    of_ours = not path.exists() and path.suffix.lower() not in _FMUS
    description = _of_ours(str(device)) if of_ours else bound_fmu(path, binding_path(binding))
    own = values_for(description, plain(values))
    rating = float(own.get("S_n", _declared(description, "S_n", 100.0)))
    if isinstance(description, BoundDescription):
        rated_hz = description.port.f_n
    else:
        rated_hz = float(own.get("f_n", _declared(description, "f_n", _RATED_HZ)))
    return PlayedDevice(path.stem, description, own, rating, rated_hz, step)


def _other(
    device: str | Path, first: PlayedDevice, values: Mapping[str, Any] | None, step: float
) -> PlayedDevice:
    """Another model with the values that it knows, and the rating of the first."""
    path = path_of(device, "beside")
    of_ours = not path.exists() and path.suffix.lower() not in _FMUS
    description = _of_ours(str(device)) if of_ours else bound_fmu(path, None)
    given = {"S_n": first.rating, **first.values, **plain(values)}
    known = {name: value for name, value in given.items() if name in description.variables}
    own = values_for(description, known)
    rating = float(own.get("S_n", _declared(description, "S_n", 100.0)))
    name = path.stem if path.stem != first.name else f"{path.parent.name}/{path.stem}"
    return PlayedDevice(name, description, own, rating, first.rated_hz, step)


def _declared(description: FmuDescription, name: str, otherwise: float) -> float:
    known = name in description.variables
    return (start_of(description, name) or otherwise) if known else otherwise


def _of_ours(name: str) -> FmuDescription:
    """A model of ours, without Python in it where this machine can compile."""
    from orchestrator.cases.scenario.catalogue_fmus import quickest_fmu  # noqa: PLC0415 - likewise
    from orchestrator.face.api.models import building, known_parts  # noqa: PLC0415 - builds models

    known_parts(name)  # refuses what is none, or needs a network
    with building(name):
        return quickest_fmu(name)


def _of_case(
    case: str, component: str, scenario: str | None, values: Mapping[str, Any] | None, step: float
) -> PlayedDevice:
    from orchestrator.cases.scenario.catalogue_fmus import quickest_twin  # noqa: PLC0415 - likewise
    from orchestrator.face.api.case import load  # noqa: PLC0415 - an FMU needs no case

    prepared = load(case).scenario(scenario, case_values(plain(values))).prepared
    plans = prepared.system.components
    if component not in plans:
        raise InputError(
            f"component = {component!r}: {case} has {', '.join(plans)}; give one of them"
        )
    plan = plans[component]
    known = plan.description.variables
    # what the recording and the step of its own run say
    others = ("P_0", "Q_0", "v_0", "theta_0", STEP_PARAMETER)
    own = {k: v for k, v in plan.parameters.items() if k not in others}
    rating = plan.number("S_n") if "S_n" in known else 100.0
    rated_hz = plan.number("f_n") if "f_n" in known else _RATED_HZ
    held = {k: float(v) for k, v in plan.inputs.items() if k not in ("v_re", "v_im")}
    description = quickest_twin(plan.description)
    return PlayedDevice(component, description, own, rating, rated_hz, step_size=step, held=held)
