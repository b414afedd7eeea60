"""Statements of a certificate that follow from its files and its own points, derived again."""

import math
import tomllib
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from orchestrator.binding.binding import bound_fmu
from orchestrator.certification.acceptance import Acceptance
from orchestrator.certification.case_file import BASE, BINDING, CASE, FMU, WITH, WITHOUT
from orchestrator.certification.damping_controllers import DampingControllers, damping_controllers
from orchestrator.certification.judgement import LOWERED, PointVerdict
from orchestrator.certification.point import CONVERTER
from orchestrator.certification.request import REACTANCES, CertificationRequest, missing_reactances
from orchestrator.certification.study import Certification
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.fmi.origin import read_origin


def derived_faults(folder: Path, content: dict[str, Any]) -> list[str]:
    """Statements that do not follow: counts, departures, values, origin of the FMU, sentence, and lowered dampings."""
    faults = list(_of_points(content))
    try:
        request = _request(folder, content)
        description = bound_fmu(request.fmu, request.binding)
        faults += _of_request(request, content)
        faults += _of_case(folder / CASE, content)
        faults += _of_fmu(request, description, content)
        faults += _of_sentence(request, description, content)
    except (InputError, OSError, ValueError, KeyError, TypeError, AttributeError):
        faults.append(f"what was set cannot be derived again: {FMU} or {CASE} is missing, or is none")
    return faults


def _request(folder: Path, content: dict[str, Any]) -> CertificationRequest:
    return CertificationRequest(
        folder / FMU,
        folder / BINDING if content["binding"] else None,
        content["values"],
        None,
        [p["X_L"] for p in content["points"]],
        content["study_values"],
        content["black_box"],
    )


def _of_points(content: dict[str, Any]) -> Iterator[str]:
    missing = missing_reactances(p["X_L"] for p in content["points"] if p["judged"])
    if content["missing"] != list(missing):
        yield f"'missing' is {content['missing']}; its points leave {list(missing)}"
    judged = f"{len(REACTANCES) - len(missing)} of {len(REACTANCES)}"
    if content["judged"] != judged:
        yield f"'judged' is {content['judged']!r}; its points come to {judged!r}"
    for point in content["points"]:
        wanted = [
            (m["frequency_hz"], m["without"]["damping_percent"], m["damping_percent"])
            for m in (*point["modes"], *point["modes_beside"])
            if m["without"] and m["without"]["damping_percent"] - m["damping_percent"] > LOWERED
        ]
        stated = [(m["frequency_hz"], m["from_percent"], m["to_percent"]) for m in point["lowered"]]
        if len(wanted) != len(stated) or not all(map(_close, wanted, stated)):
            yield (
                f"X_L = {point['X_L']:g} pu: {len(stated)} lowered dampings are stated; its modes come to {len(wanted)}"
            )


def _close(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return all(math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12) for a, b in zip(one, other, strict=True))


def _of_request(request: CertificationRequest, content: dict[str, Any]) -> Iterator[str]:
    if content["departures"] != list(request.departures):
        yield f"'departures' is {content['departures']}; the values that were set come to {list(request.departures)}"


def _of_case(path: Path, content: dict[str, Any]) -> Iterator[str]:
    """Compare the values of the case file with those of the certificate, in both directions."""
    own = {f"{CONVERTER}.{k}": v for k, v in {**content["values"], **content["pod_values"]}.items()}
    scenarios = tomllib.loads(path.read_text(encoding="utf-8"))["scenarios"]
    base = tomllib.loads(BASE.read_text(encoding="utf-8"))["scenarios"]
    for name, values in ((WITHOUT, {}), (WITH, own)):
        wanted = {**base[name].get("set", {}), **content["study_values"], **values}
        if scenarios[name].get("set", {}) != wanted:
            yield f"'values', 'study_values' or 'pod_values' are not those that {CASE} sets {name} the converter"


def _of_fmu(request: CertificationRequest, description: FmuDescription, content: dict[str, Any]) -> Iterator[str]:
    origin = {"model": description.model_name, "guid": description.guid} | asdict(read_origin(request.fmu))
    for name, value in origin.items():
        if content["fmu"].get(name) != value:
            yield f"'fmu.{name}' is {content['fmu'].get(name)!r}; {FMU} says {value!r}"
    if _controllers(request, description, content) is None:
        yield f"'pod', 'pod_source' and 'pod_values' are not what {FMU} and the values come to"


def _controllers(
    request: CertificationRequest, description: FmuDescription, content: dict[str, Any]
) -> DampingControllers | None:
    """The stated damping controllers, derived with ``--pod`` or without it; None if they follow from neither."""
    stated = (content["pod"], content["pod_source"], content["pod_values"])
    for given in (None, content["pod"]):
        again = CertificationRequest(request.fmu, request.binding, request.values, given)
        try:
            found = damping_controllers(description, again)
        except InputError:
            continue  # the switches contradict this one
        if (found.pod, found.source, found.settings) == stated:
            return found
    return None


def _of_sentence(request: CertificationRequest, description: FmuDescription, content: dict[str, Any]) -> Iterator[str]:
    controllers = _controllers(request, description, content)
    if controllers is None:
        return  # reported above
    verdicts = [
        PointVerdict(p["X_L"], (), None, None, tuple(p["faults"]), unknown=p["unknown"]) for p in content["points"]
    ]
    report = content["acceptance"]
    again = Certification(
        request, description, controllers, content["event_time"], request.fmu.parent / CASE, {}, {}, verdicts
    )
    if report is not None:
        faults = tuple(dict.fromkeys(r["fault"] for r in report["checks"] if r["verdict"] == "fail"))
        again.acceptance = Acceptance(report["trusted"], faults, report)
    if content["sentence"] != again.sentence():
        yield f"the sentence is not the one to which its points come: {again.sentence()!r}"
