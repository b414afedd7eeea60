"""The certificate anew from what its folder keeps, by the judgement that made it: from the FMU, the case file, the
responses and, of a damping test, the eigenvalues."""

import json
import tomllib
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from orchestrator.analysis.mode_tracking import ModeSet
from orchestrator.binding.binding import bound_fmu
from orchestrator.certification.acceptance import KEPT, Acceptance
from orchestrator.certification.case_file import BASE, BINDING, CASE, FMU, WITH, WITHOUT
from orchestrator.certification.certificate import Certificate, Judged
from orchestrator.certification.codes.all_codes import code_for
from orchestrator.certification.codes.bench_point import BenchResult
from orchestrator.certification.codes.certificate import CodeCertificate
from orchestrator.certification.codes.row_verdict import judge_row
from orchestrator.certification.criteria import ModeVerdict, judge_mode
from orchestrator.certification.damping_controllers import DampingControllers, damping_controllers
from orchestrator.certification.form import NORM
from orchestrator.certification.judgement import PointVerdict, judge
from orchestrator.certification.pod_effect import kept_off, with_pod
from orchestrator.certification.point import CONVERTER, PointResult
from orchestrator.certification.request import CertificationRequest
from orchestrator.certification.study import Certification
from orchestrator.errors import ErrorKind, InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.points.failure import Failure


def rebuilt(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Certificate[Judged]:
    made = _damping_test if content["format"] == NORM else _bench_test
    certificate = made(folder, content, responses)
    if content["acceptance"] is not None:
        report = json.loads((folder / KEPT).read_text(encoding="utf-8"))
        faults = tuple(dict.fromkeys(check["fault"] for check in report["checks"] if check["verdict"] == "fail"))
        certificate.acceptance = Acceptance(not faults, faults, {**report, "trusted": not faults})
    return certificate


def _request(folder: Path, content: dict[str, Any], **of_the_norm: Any) -> CertificationRequest:
    binding = folder / BINDING if content["binding"] else None
    return CertificationRequest(folder / FMU, binding, content["values"], **of_the_norm)


def _bench_test(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> CodeCertificate:
    code, request = code_for(content["code"], content["declared"]), _request(folder, content)
    stated = {row["row"]: row for row in content["rows"]}
    rows = [row for row in code.rows if row.name in stated or f"time_{row.name}" in responses.coords]
    results = {row.name: _response(row.name, stated.get(row.name), responses) for row in rows}
    verdicts = [
        judge_row(row, results[row.name], content["f_n"], stated.get(row.name, {}).get("criteria")) for row in rows
    ]
    description = bound_fmu(request.fmu, request.binding)
    return CodeCertificate(request, description, verdicts, code, content["f_n"], results)


def _response(row: str, stated: dict[str, Any] | None, responses: xr.Dataset) -> BenchResult:
    said = stated or {"unknown": "", "findings": []}
    if why := said["unknown"]:
        return BenchResult(row, findings=said["findings"], failure=Failure(ErrorKind.OTHER, why, False))
    prefix = f"{row}."
    signals = {
        str(n).removeprefix(prefix): v.values for n, v in responses.data_vars.items() if str(n).startswith(prefix)
    }
    return BenchResult(row, responses[f"time_{row}"].values, signals, said["findings"])


def _damping_test(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Certification:
    request = _request(folder, content, reactances=responses["X_L"].values.tolist(),
                       study_values=content["study_values"], black_box=content["black_box"])  # fmt: skip
    description = bound_fmu(request.fmu, request.binding)
    controllers, event = _controllers(request, description, content), content["event_time"]
    points: dict[tuple[str, float], PointResult] = {}
    verdicts = []
    for point in content["points"]:
        having, lacking = (_point(point, scenario, content, responses) for scenario in (WITH, WITHOUT))
        points |= {(result.scenario, result.X_L): result for result in (having, lacking)}
        verdicts.append(_verdict(point, having, lacking, controllers.pod, event))
    if any("pod" in point for point in content["points"]):  # until 0.3 they were not switched off
        verdicts = with_pod(verdicts, {X: result for (name, X), result in points.items() if name == WITH},
                            controllers, event)  # fmt: skip
    return Certification(request, description, verdicts, controllers, event, folder / CASE, {}, points)


def _controllers(
    request: CertificationRequest, description: FmuDescription, content: dict[str, Any]
) -> DampingControllers:
    """Derived with ``--pod`` or without it; those that are stated where they follow from either."""
    found = []
    for given in (None, content["pod"]):
        try:
            again = CertificationRequest(request.fmu, request.binding, request.values, given)
            found.append(damping_controllers(description, again))
        except InputError:
            continue  # the switches contradict this one
    stated = (content["pod"], content["pod_source"], content["pod_values"])
    return next((one for one in found if (one.pod, one.source, one.settings) == stated), found[0])


def _point(point: dict[str, Any], scenario: str, content: dict[str, Any], responses: xr.Dataset) -> PointResult:
    """What was computed of a point; its states' shapes are not kept, and so its modes have none."""
    having = scenario == WITH
    modes = [*point["modes"], *point["modes_beside"]] if having else point["modes_without"]
    kept = responses.sel(scenario=scenario, X_L=point["X_L"])
    signals = {str(name): values.values for name, values in kept.items() if not np.isnan(values).all()}
    growth, model = point["growth"][scenario], point["converter_model"]
    sources, error = dict(content["linearised"]), model["fit_error"]
    if having and model["source"] is not None:
        sources[CONVERTER] = model["source"]
    shapes = np.empty((len(modes), 0), complex)
    residual = point.get("residual", {}).get(scenario)
    values = np.array([_value(mode) for mode in modes], dtype=complex)
    off = kept_off(point["pod"]) if having and "pod" in point else {}
    return PointResult(
        point["X_L"], scenario, ModeSet(values, shapes, shapes, ()),
        growth=np.nan if growth is None else growth, stability=point["stability"][scenario],
        residual=np.nan if residual is None else residual, identified=model["order"] if having else None,
        linearised=sources if having else {}, fit_errors={CONVERTER: error} if having and error is not None else {},
        power=point["power"] if having else None, times=responses["time"].values, signals=signals,
        warnings=tuple(point.get("warnings", {}).get(scenario, ())),
        findings=point.get("findings", {}).get(scenario, []),
        units={str(name): str(values.attrs.get("units", "")) for name, values in kept.items()}, **off,
    )  # fmt: skip


def _verdict(point: dict[str, Any], having: PointResult, lacking: PointResult, pod: str, event: float) -> PointVerdict:
    """Judged again; why it was not accepted or not judged is told in the words of then.

    Modes are matched by shapes, which are not kept: which mode was which without the converter is taken as stated. A
    point without a whole response failed or was not judged, and the reasons are taken as stated too."""
    again = judge(having, lacking, pod, event, [_matched(mode) for mode in (*point["modes"], *point["modes_beside"])])
    if point["time_without"] is None:
        again = replace(again, base_time=None)
    faults, unknown = tuple(point["faults"]), point["unknown"]
    if point["time"] is None and (faults or unknown):
        return replace(again, time=None, faults=faults, unknown=unknown)
    same = (bool(again.faults), bool(again.unknown)) == (bool(faults), bool(unknown))
    stability = having.stability or {"stable": True}
    if again.unknown and faults and not unknown and stability["stable"] is None:
        same = True  # until 0.3 a point whose stability is not known was one that fails
    return replace(again, faults=faults, unknown=unknown) if same else again


def _matched(mode: dict[str, Any]) -> ModeVerdict:
    before = None if mode["without"] is None else _value(mode["without"])
    accepted, reason = judge_mode(_value(mode), before)
    told = mode["components"], mode.get("doubt", "")
    return ModeVerdict(_value(mode), before, mode["likeness"], accepted, reason, *told)


def _value(mode: dict[str, Any]) -> complex:
    return complex(mode["real"], mode["imag"])


def case_faults(folder: Path, content: dict[str, Any], responses: xr.Dataset) -> Iterator[str]:
    """Values of a damping test's case file that are others than the certificate's, and what it leaves out or adds."""
    stated = [point["X_L"] for point in content["points"]]
    if left_out := [f"{X:g}" for X in responses["X_L"].values.tolist() if X not in stated]:
        yield f"the record has no points for the responses at X_L = {', '.join(left_out)} pu"
    for point in content["points"]:
        partners = [_value(mode["without"]) for mode in (*point["modes"], *point["modes_beside"]) if mode["without"]]
        if not Counter(partners) <= Counter(_value(mode) for mode in point["modes_without"]):
            yield f"X_L = {point['X_L']:g} pu: a mode without the converter is none, or stands for two"
    own = {f"{CONVERTER}.{k}": v for k, v in {**content["values"], **content["pod_values"]}.items()}
    scenarios, base = (tomllib.loads(path.read_text(encoding="utf-8"))["scenarios"] for path in (folder / CASE, BASE))
    for name, values in ((WITHOUT, {}), (WITH, own)):
        wanted = {**base[name].get("set", {}), **content["study_values"], **values}
        if scenarios[name].get("set", {}) != wanted:
            yield f"'values', 'study_values' or 'pod_values' are not those that {CASE} sets {name} the converter"
