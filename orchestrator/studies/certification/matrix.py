"""Several devices under several codes: a verdict and the narrowest margin for each pair, and the files with them."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

from orchestrator.cases.form.devices import Device
from orchestrator.core.errors import InputError, number_of
from orchestrator.core.safe_files import write_text
from orchestrator.devices.fmi.values import as_text
from orchestrator.output.report.html.elements import document, table
from orchestrator.output.results.file_writers import save_json
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.needs_record import NEEDS_HTML, NEEDS_JSON
from orchestrator.studies.certification.codes.perturbation_plot import FIGURES_JSON, FIGURES_PNG
from orchestrator.studies.certification.environment import environment
from orchestrator.studies.certification.files import HTML, JSON
from orchestrator.studies.certification.margins import CriterionMargin, margin_text, narrowest
from orchestrator.studies.certification.texts import TEXTS
from orchestrator.studies.certification.verdict import (
    FAILS,
    INCOMPLETE,
    NOT_TRUSTED,
    PASSES,
    exit_code,
)
from orchestrator.studies.points.failure import Failure

# in place of a verdict
NOT_TESTED = "not tested"  # a device could not be tested at all
FIGURES = "no verdict"  # a code gives figures alone

BEHAVIOUR = "frequency"  # the code of voltage source behaviour: a verdict from figures, without a certificate


@dataclass
class MatrixCell:
    device: str
    code: str
    folder: str
    failure: Failure | None = None
    verdict: str = NOT_TESTED
    sentence: str = ""
    margins: Sequence[CriterionMargin] = ()
    judged: int = 0
    missing: int = 0  # number of parts of the code that were not tested
    refused: bool = False
    # whether what the failed criteria would take lies beside the certificate
    has_needs: bool = False
    # what a code without a verdict gives, in words; None of a code with one. Whatever it is, it decides nothing.
    figures: Sequence[str] | None = None
    # names of the files with its figures and with its page; a verdict without a certificate has others
    record: str = JSON
    page: str = HTML

    @property
    def has_certificate(self) -> bool:
        """Return whether its folder holds a certificate."""
        return self.failure is None and self.figures is None and self.record == JSON

    @property
    def file_of_figures(self) -> str | None:
        """Where the figures lie that are no certificate's; None where there are none."""
        if self.has_certificate or self.failure is not None:
            return None
        return f"{self.folder}/{FIGURES_JSON if self.record == JSON else self.record}"

    def take_behaviour(self, found: Mapping[str, Any], record: str, page: str) -> None:
        """Take the verdict on voltage source behaviour, which has figures and no certificate."""
        self.verdict = {True: PASSES, False: FAILS, None: INCOMPLETE}[found["verdict"]]
        self.sentence, self.judged = found["sentence"], len(found["points"])
        self.record, self.page = record, page

    def take(self, found: Certificate) -> None:
        self.verdict, self.sentence, self.refused = found.verdict, found.sentence(), found.refused
        self.margins, self.missing = found.margins, len(found.missing)
        self.judged = sum(1 for v in found.verdicts if v.is_judged)

    @property
    def narrowest(self) -> CriterionMargin | None:
        return narrowest(self.margins)

    @property
    def failed(self) -> list[CriterionMargin]:
        """Criteria that are not met, least margin first; those without a figure before all."""
        bad = [m for m in self.margins if not m.accepted]
        return sorted(bad, key=lambda m: float("-inf") if m.margin is None else m.margin)

    @property
    def exit_code(self) -> int:
        """Exit code of `gfor certify` of this device and code alone; 0 of figures without a verdict."""
        if self.figures is not None:
            return 0
        return (
            InputError.exit_code
            if self.failure is not None
            else exit_code(self.verdict, refused=self.refused)
        )


@dataclass(frozen=True)
class CertificateMatrix:
    devices: tuple[str, ...]
    codes: tuple[str, ...]
    cells: dict[tuple[str, str], MatrixCell]
    left_out: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """Exit code of the worst cell: one that fails, one that could not be tested, one that is incomplete, one
        whose FMU an acceptance test refuses; 0 where all pass. A code that is left out makes the whole incomplete."""
        found = {cell.exit_code for cell in self.cells.values()}
        found |= {exit_code(INCOMPLETE, refused=False)} if self.left_out else set()
        return next((code for code in WORST_FIRST if code in found), 0)

    def sentence(self) -> str:
        verdicts = [cell.verdict for cell in self.cells.values() if _is_of_certificate(cell)]
        said = {PASSES: "passed", FAILS: "failed", INCOMPLETE: INCOMPLETE, NOT_TESTED: NOT_TESTED}
        judged = ", ".join(
            f"{n} {word}" for key, word in said.items() if (n := verdicts.count(key))
        )
        alone = list(
            dict.fromkeys(cell.code for cell in self.cells.values() if cell.figures is not None)
        )
        refused = [
            name
            for name in self.devices
            if any(self.cells[name, code].refused for code in self.codes)
        ]
        text = (
            f"Of {number_of(len(verdicts), 'certificate')}: {judged}."
            if verdicts
            else "No certificate was asked for."
        )
        without = [cell for cell in self.cells.values() if cell.code == BEHAVIOUR]
        if without:
            found = ", ".join(
                f"{cell.device} {said.get(cell.verdict, cell.verdict)}" for cell in without
            )
            text += f" Voltage source in frequency: {found}."
        if alone:
            text += f" Figures without a verdict: {', '.join(alone)}."
        if self.left_out:
            text += f" Left out, as it needs --declare: {', '.join(self.left_out)}."
        return f"{text} Acceptance tests failed: {', '.join(refused)}." if refused else text


def _is_of_certificate(cell: MatrixCell) -> bool:
    return cell.figures is None and cell.code != BEHAVIOUR


WORST_FIRST = (
    exit_code(FAILS, refused=False),
    InputError.exit_code,
    exit_code(INCOMPLETE, refused=False),
    NOT_TRUSTED,
)
"""Exit codes of cells, the one that counts most first."""


FORMAT = "matrix-1"  # form of the JSON
# names of files in the results
MATRIX_HTML = "matrix.html"
MATRIX_JSON = "matrix.json"

READING = TEXTS["matrix"]


def save_matrix(matrix: CertificateMatrix, devices: Sequence[Device], folder: Path) -> list[Path]:
    made = datetime.now(UTC).replace(microsecond=0)
    content = {"made": made.isoformat(), **matrix_json(matrix, devices)}
    write_text(folder / MATRIX_HTML, matrix_page(matrix, devices, made))
    save_json(content, folder / MATRIX_JSON)
    return [folder / MATRIX_HTML, folder / MATRIX_JSON]


def matrix_json(matrix: CertificateMatrix, devices: Sequence[Device]) -> dict[str, Any]:
    tested = [
        {
            "name": d.name,
            "file": d.file.name,
            "binding": d.binding.name if d.binding else None,
            "values": dict(d.values),
        }
        for d in devices
    ]
    return {
        "format": FORMAT,
        "sentence": matrix.sentence(),
        "exit_code": matrix.exit_code,
        "devices": tested,
        "codes": list(matrix.codes),
        "left_out": list(matrix.left_out),
        "cells": [_cell_json(cell) for cell in matrix.cells.values()],
        "environment": environment(),
    }


def _cell_json(cell: MatrixCell) -> dict[str, Any]:
    least = cell.narrowest
    certificate = f"{cell.folder}/{JSON}" if cell.has_certificate else None
    needs = f"{cell.folder}/{NEEDS_JSON}" if cell.has_needs else None
    return {
        "device": cell.device,
        "code": cell.code,
        "verdict": cell.verdict,
        "exit_code": cell.exit_code,
        "sentence": cell.sentence,
        "failure": None if cell.failure is None else str(cell.failure),
        "judged": cell.judged,
        "missing": cell.missing,
        "acceptance_failed": cell.refused,
        "narrowest": None if least is None else asdict(least),
        "failed": list(map(asdict, cell.failed)),
        "certificate": certificate,
        "figures": cell.file_of_figures,
        "sensitivities": needs,
    }


def in_words(cell: MatrixCell) -> list[str]:
    """Return what a cell of the matrix shows, line by line: verdict, narrowest margin, and what has no figure."""
    if cell.failure is not None:
        return [cell.verdict]
    if cell.figures is not None:
        return [cell.verdict, *cell.figures]
    without_figure = (m for m in cell.margins if not m.accepted and m.margin is None)
    lines = [cell.verdict, *(f"{m.place}: {m.criterion}" for m in without_figure)]
    least = cell.narrowest
    if least is not None:
        lines.append(f"{margin_text(least.margin)} {least.place}: {least.criterion}")
    return lines


def matrix_page(matrix: CertificateMatrix, devices: Sequence[Device], made: datetime) -> str:
    whole = [
        [escape(code.upper()), *(_cell_html(matrix.cells[name, code]) for name in matrix.devices)]
        for code in matrix.codes
    ]
    tried = [[escape(text) for text in _device_cells(device)] for device in devices]
    bad = [
        [
            escape(cell.device),
            escape(cell.code.upper()),
            escape(m.place),
            escape(m.criterion),
            escape(m.text),
            margin_text(m.margin),
        ]
        for cell in matrix.cells.values()
        for m in cell.failed
    ]
    lost = [
        [escape(c.device), escape(c.code.upper()), escape(str(c.failure)).replace("\n", "<br>")]
        for c in matrix.cells.values()
        if c.failure is not None
    ]
    columns = ["Device", "Code", "Where", "Criterion", "Found", "Margin"]
    width = 1 + len(matrix.devices)
    sections = [
        (
            "Verdict and narrowest margin",
            table("Codes and devices", ["", *matrix.devices], whole, left=width)
            + f"<p>{escape(READING)}</p>",
        ),
        (
            "What is not met",
            table("Criteria, least margin first", columns, bad, left=5)
            if bad
            else "<p>Nothing.</p>",
        ),
        *(
            [("Not tested", table("Why", ["Device", "Code", "Reason"], lost, left=3))]
            if lost
            else []
        ),
        (
            "The devices",
            table("As they were given", ["Device", "File", "Binding", "Values set"], tried, left=4),
        ),
    ]
    kind = "Grid codes for grid-forming converters"
    return document(
        "Codes and devices", kind, f"<p><b>{escape(matrix.sentence())}</b></p>", sections, made
    )


def _device_cells(device: Device) -> list[str]:
    values = ", ".join(f"{name} = {as_text(value)}" for name, value in device.values.items())
    return [
        device.name,
        device.file.name,
        device.binding.name if device.binding else "none",
        values or "none",
    ]


def _cell_html(cell: MatrixCell) -> str:
    verdict, *rest = in_words(cell)
    if cell.figures is not None and cell.failure is None:
        word = (
            f'<a class="soft" href="{quote(f"{cell.folder}/{FIGURES_PNG}")}">{escape(verdict)}</a>'
        )
        return "<br>".join([word, *(escape(line) for line in rest)])
    passing = cell.exit_code == 0 and cell.failure is None
    style = "bad" if verdict == FAILS or cell.failure is not None else "soft"
    style = "good" if passing else style
    word = f'<span class="{style}">{escape(verdict)}</span>'
    if cell.failure is None:
        word = f'<a href="{quote(f"{cell.folder}/{cell.page}")}">{word}</a>'
    if verdict == PASSES and cell.refused:
        rest = ["acceptance tests failed", *rest]
    lines = [word, *(escape(line) for line in rest)]
    if cell.has_needs:
        lines.append(f'<a href="{quote(f"{cell.folder}/{NEEDS_HTML}")}">what it would take</a>')
    return "<br>".join(lines)
