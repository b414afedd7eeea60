"""Request that every study of a case shares, beside its own fields: its case's values, and where it is computed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from orchestrator.cases.form.given import (
    Paths,
    Time,
    case_values,
    in_seconds,
    parameter_files,
    path_of_given,
)
from orchestrator.cases.form.parameter_files import ParameterFile
from orchestrator.cases.form.schema import Value
from orchestrator.cases.settings.layers import OptionValues
from orchestrator.core.asked import (
    FLAG,
    FREQUENCIES,
    NAMES,
    FieldKind,
    request_field,
    seen,
    text_or_none,
)
from orchestrator.core.errors import InputError
from orchestrator.linear.spectra.modes import ELECTROMECHANICAL_HZ
from orchestrator.systems.coupling.no_trip_regions import NO_TRIP_REGIONS, read_no_trip_code

POINTS_FILE = FieldKind(
    "FILE",
    Path,
    lambda given, argument: None if given is None else path_of_given(given, "points.csv", argument),
)
ANYTHING = FieldKind("", str, lambda given, _: given)  # checked where it is used
_VALUES = FieldKind("", str, case_values)
_STEP = FieldKind("", str, in_seconds)
_FILES = FieldKind("", Path, lambda given, argument: parameter_files(given))
_SCENARIO = FieldKind(
    "NAME",
    str,
    lambda given, name: text_or_none(
        given, name, "it is for one scenario: give its name, or leave it out"
    ),
)


def of_scenario(text: str = "its name; the first one where None") -> Any:
    return request_field(_SCENARIO, None, text, option=None)


def of_scenarios() -> Any:
    return request_field(NAMES, (), "names of the scenarios; all of them where empty", option=None)


def of_values() -> Any:
    return request_field(
        _VALUES,
        None,
        "values by ``component.variable``, as with ``--set``: numbers, truth values, or text such as "
        '``"1350 MVA"``; they override the parameter files',
        option=None,
    )


def of_frequencies(python: str = "") -> Any:
    """The range of a study's modes; ``python`` says what they are for where "frequencies" does not."""
    return request_field(
        FREQUENCIES,
        ELECTROMECHANICAL_HZ,
        "frequencies [Hz] (0.1:2)",
        option="--range",
        python=python,
    )


def _known_code(given: Any, argument: str) -> Any:
    if given is None or given in NO_TRIP_REGIONS:
        return given
    raise InputError(
        f"{argument} = {seen(given)}; it must be one of {', '.join(NO_TRIP_REGIONS)}, or be left out"
    )


def of_protection(option: str | None = "") -> Any:
    """The code by which converters trip that have no relays of their own; None for no option."""
    return request_field(
        FieldKind("CODE", read_no_trip_code, _known_code),
        None,
        "converters without relays of their own trip as soon as this code lets them: prc029",
        option=option,
    )


def of_black_box() -> Any:
    return request_field(
        FLAG, False, "identify the components that hide their states from their inputs and outputs"
    )


class _Layered:
    """Values and files as the preparation of a scenario takes them; a request has them among its own fields."""

    values: Mapping[str, Any] | None
    step: Time | None
    parameters: Paths

    @property
    def overrides(self) -> dict[str, Value]:
        return dict(self.values or {})

    @property
    def step_size(self) -> float | None:
        """Communication step [s]; None for the case's."""
        return cast("float | None", self.step)

    @property
    def files(self) -> Sequence[ParameterFile]:
        return cast("Sequence[ParameterFile]", self.parameters)

    @property
    def layers(self) -> tuple[ParameterFile, ...]:
        """Parameter files, and after them the values of the command line; weakest first."""
        return (*self.files, *([OptionValues.of(self.overrides)] if self.overrides else []))


@dataclass(frozen=True, kw_only=True)
class OfCase(_Layered):
    """Asked of every study; scenario and values stand among the fields of each, where Python takes them by place."""

    step: Time | None = request_field(
        _STEP, None, "communication step [s]; the case's by default", option=None
    )
    parameters: Paths = request_field(
        _FILES, (), "parameter files, as ``gfor design`` writes them", option=None
    )


@dataclass(frozen=True, kw_only=True)
class OverPoints(OfCase):
    """Asked of every study that computes points side by side; no value depends on it."""

    workers: int | None = request_field(
        ANYTHING, 1, "processes to compute in; one for each core where None", option=None
    )
    folder: str | Path | None = request_field(
        ANYTHING,
        None,
        "keeps the points: a later study with this folder reads them instead of computing them again; "
        "without a folder they are forgotten",
        option=None,
    )
    progress: bool = request_field(FLAG, False, "show a bar", option=None)


@dataclass(frozen=True, kw_only=True)
class OverCluster(OverPoints):
    """A study whose points a Dask cluster may compute as well."""

    scheduler: str | None = request_field(
        ANYTHING,
        None,
        "address of a Dask cluster to compute on instead, such as ``tcp://host:8786``",
        option=None,
    )
    tls: str | Path | None = request_field(
        ANYTHING,
        None,
        "folder with ``ca.pem``, ``cert.pem`` and ``key.pem``, for a scheduler at ``tls://host:8786``",
        option=None,
    )
