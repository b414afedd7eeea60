"""The form of a certificate's JSON: the entries that a verification reads, and their types."""

import json
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from orchestrator.errors import InputError

_SHOWN = 60
"""Characters of a wrong value that are shown."""

Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Table(BaseModel):
    model_config = ConfigDict(strict=True)


class _Eigenvalue(_Table):
    real: Finite
    imag: Finite
    frequency_hz: Finite
    damping_percent: Finite


class _Mode(_Eigenvalue):
    without: _Eigenvalue | None
    accepted: bool


class _Swings(_Table):
    accepted: bool
    reason: str
    ratio: float | None
    swings: list[dict[str, Any]]


class _Modal(_Table):
    accepted: bool
    modes: list[_Eigenvalue]


class _Time(_Table):
    accepted: bool
    swings: _Swings
    swings_with_first_extremum: _Swings
    modal: _Modal


class _Stability(_Table):
    stable: bool | None
    sentence: str


T = TypeVar("T")


class _Both(_Table, Generic[T]):
    without: T
    having: Annotated[T, Field(alias="with")]


class _Model(_Table):
    source: str | None
    order: int | None
    fit_error: float | None


class _Lowered(_Table):
    frequency_hz: Finite
    from_percent: Finite
    to_percent: Finite


class _Point(_Table):
    X_L: Finite
    accepted: bool
    judged: bool
    faults: list[str]
    unknown: str
    modes: list[_Mode]
    modes_beside: list[_Mode]
    modes_without: list[_Eigenvalue]
    lowered: list[_Lowered]
    growth: _Both[float | None]
    stability: _Both[_Stability | None]
    power: Finite | None
    converter_model: _Model
    time: _Time | None
    time_without: _Time | None


class _Check(_Table):
    check: str
    verdict: str
    fault: str


class _Acceptance(_Table):
    trusted: bool
    checks: list[_Check]


class _Certificate(_Table):
    verdict: str
    passed: bool
    sentence: str
    judged: str
    missing: list[Finite]
    departures: list[str]
    fmu: dict[str, str]
    binding: str | None
    values: dict[str, Any]
    study_values: dict[str, Any]
    black_box: bool
    pod: str
    pod_source: str
    pod_values: dict[str, bool]
    parameters: list[dict[str, Any]]
    acceptance: _Acceptance | None
    signal: str
    event_time: Finite
    linearised: dict[str, str]
    fit_errors: dict[str, float]
    files: dict[str, str | None]
    points: Annotated[list[_Point], Field(min_length=1)]


def check_form(file: Path, content: dict[str, Any]) -> None:
    """Refuse a certificate with a missing entry, or with an entry of another type."""
    remedy = "the certificate is damaged: take the file that `gfor certify` wrote, or make it anew"
    try:
        json.dumps(content, ensure_ascii=False).encode()
        _Certificate.model_validate(content)
    except UnicodeEncodeError as error:
        raise InputError(f"{file}: a text in it holds half a character, which is no Unicode; {remedy}") from error
    except ValidationError as error:
        first, *others = error.errors(include_url=False)
        place = ".".join(str(part) for part in first["loc"])
        more = f" (and {len(others)} more)" if others else ""
        raise InputError(f"{file}: {place} {_wrong(first['type'], first['input'])}{more}; {remedy}") from error


def _wrong(kind: str, seen: object) -> str:
    if kind == "missing":
        return "is missing"
    text = json.dumps(seen, ensure_ascii=False, default=str)
    shown = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
    return f"is {shown}, which is not what a certificate has there"
