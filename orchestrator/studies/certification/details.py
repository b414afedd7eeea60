"""Details of a test, from a file of the user: client, laboratory, date and place."""

import datetime
from collections.abc import Mapping
from pathlib import Path

from pydantic import ConfigDict, ValidationError

from orchestrator.cases.form.locate import line_of
from orchestrator.core.errors import CaseError, Problem
from orchestrator.core.options import Option
from orchestrator.core.toml_files import Table, read_toml

TEMPLATE = Path(__file__).with_name("details_template.toml").read_text(encoding="utf-8")

_LABELS = {
    "number": "Certificate number",
    "applicant": "Applicant",
    "operator": "Network operator",
    "tester": "Tester",
    "place": "Place",
    "date": "Date",
}


class Details(Table):
    """The details of a file. An empty text becomes a line to be filled in by hand."""

    model_config = ConfigDict(strict=True)

    number: str = ""
    applicant: str = ""
    operator: str = ""
    tester: str = ""
    place: str = ""
    date: datetime.date | None = None

    def texts(self) -> dict[str, str]:
        return {name: str(value or "").strip() for name, value in self if name in _LABELS}

    def rows(self) -> list[tuple[str, str]]:
        return [(_LABELS[name], text) for name, text in self.texts().items()]


def details_of(texts: Mapping[str, str]) -> Details:
    """Return the details that a record states; the inverse of `Details.texts`."""
    given = {name: text for name, text in texts.items() if name in _LABELS and text}
    date = given.pop("date", None)
    return Details(**given, date=None if date is None else datetime.date.fromisoformat(date))


def read_details(path: Path) -> Details:
    text, raw = read_toml(
        path, "it", "`gfor certify --details-template` prints one", Option.DETAILS
    )
    try:
        return Details.model_validate(raw)
    except ValidationError as error:
        problems = [
            _problem(text, detail["loc"][0], detail["type"], detail.get("input"))
            for detail in error.errors()
        ]
        raise CaseError(Option.DETAILS + f" {path}", problems) from error


def _problem(text: str, key: int | str, kind: str, seen: object) -> Problem:
    line = line_of(text, (key,))
    place = f"line {line}, {key}" if line else str(key)
    if kind == "extra_forbidden":
        return Problem(place, f"this key is unknown; there are: {', '.join(_LABELS)}")
    wanted = (
        "a date as TOML has it, such as 2026-01-31 without quotes"
        if key == "date"
        else "a text in quotes"
    )
    return Problem(place, f"{seen!r} is given; write {wanted}")
