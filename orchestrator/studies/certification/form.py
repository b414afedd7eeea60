"""The form of a certificate's JSON: the entries that a verification reads; all others it compares."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from orchestrator.core.errors import InputError
from orchestrator.studies.certification.case_file import CASE
from orchestrator.studies.certification.codes.bench_point import case_name
from orchestrator.studies.certification.codes.known import KNOWN

_SHOWN = 60  # characters of a wrong value that are shown

Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(strict=True)


class _Mode(_Table):
    real: Finite
    imag: Finite
    damping_percent: Finite


class _ModeWith(_Mode):
    without: _Mode | None
    likeness: Finite
    components: str


class _Point(_Table):
    X_L: Finite
    faults: list[str]
    unknown: str
    modes: list[_ModeWith]
    modes_beside: list[_ModeWith]
    modes_without: list[_Mode]
    growth: dict[str, Finite | None]
    stability: dict[str, dict[str, Any] | None]
    power: Finite | None
    converter_model: dict[str, str | float | None]
    time: dict[str, Any] | None
    time_without: dict[str, Any] | None


class _Check(_Table):
    verdict: str
    fault: str


class _Acceptance(_Table):
    trusted: bool
    checks: list[_Check]


class _Certified(_Table):
    verdict: str
    sentence: str
    values: dict[str, Any]
    binding: str | None
    acceptance: _Acceptance | None
    files: dict[str, str | None]

    @field_validator("files")
    @classmethod
    def _in_the_folder(cls, files: dict[str, str | None]) -> dict[str, str | None]:
        """Refuse names that lead out of the certificate's folder, on any system."""
        if any(name in ("", ".", "..") or set(name) & set("/\\:") for name in files):
            raise ValueError(files)
        return files


class _Certificate(_Certified):
    judged: str
    study_values: dict[str, Any]
    black_box: bool
    pod: str
    pod_source: str
    pod_values: dict[str, bool]
    signal: str
    event_time: Finite
    linearised: dict[str, str]
    points: Annotated[list[_Point], Field(min_length=1)]


class _Criterion(_Table):
    margin: float | None


class _Row(_Table):
    row: str
    accepted: bool | None
    unknown: str
    criteria: list[_Criterion]
    findings: list[dict[str, Any]]


class _CodeCertificate(_Certified):
    code: str
    f_n: Finite
    declared: dict[str, Finite]
    rows: list[_Row]

    @field_validator("code")
    @classmethod
    def _known(cls, code: str) -> str:
        if code not in KNOWN:
            raise ValueError(code)
        return code


# forms of the JSON
NORM = 2  # of the damping test
CODE = "code-2"  # of a code on the test bench

_FORMS: dict[object, type[_Table]] = {NORM: _Certificate, CODE: _CodeCertificate}


def check_form(file: Path, content: Any) -> None:
    remedy = "the certificate is damaged: take the file that `gfor certify` wrote, or make it anew"
    kind = content.get("format") if isinstance(content, dict) else None
    form = _FORMS.get(kind) if isinstance(kind, int | str) else None
    if form is None:
        raise InputError(
            f"{file}: it is no certificate of format {NORM} or {CODE} (found: {kind}); older ones hold "
            "too little to be verified, make it anew with `gfor certify`"
        )
    try:
        json.dumps(content, ensure_ascii=False).encode()
        form.model_validate(content)
    except UnicodeEncodeError as error:
        raise InputError(
            f"{file}: a text in it holds half a character, which is no Unicode; {remedy}"
        ) from error
    except ValidationError as error:
        first, *others = error.errors(include_url=False)
        place = ".".join(str(part) for part in first["loc"])
        more = f" (and {len(others)} more)" if others else ""
        raise InputError(
            f"{file}: {place} {_wrong(first['type'], first['input'])}{more}; {remedy}"
        ) from error


def _wrong(kind: str, seen: object) -> str:
    if kind == "missing":
        return "is missing"
    text = json.dumps(seen, ensure_ascii=False, default=str)
    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
    return f"is {shown}, which is not what a certificate has there"


def case_files(content: Mapping[str, Any]) -> list[str]:
    return (
        [CASE] if content["format"] == NORM else [case_name(row["row"]) for row in content["rows"]]
    )
