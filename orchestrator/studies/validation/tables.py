"""Tables of a validation that a terminal and a page show."""

from collections.abc import Sequence

from orchestrator.output.report.column_table import ShownTable
from orchestrator.studies.validation.causes import Explanation
from orchestrator.studies.validation.limits import Criterion
from orchestrator.studies.validation.study import FitCheck, ValidationResult
from orchestrator.studies.validation.words import EXPLANATION_COLUMNS, explanation_cells


def beside_table(result: ValidationResult) -> ShownTable:
    """Where two models of one plant differ from the recording, and from each other [pu]."""
    first, second = result.comparisons[0].device.name, result.others[0].device.name
    rows = [
        (
            one.recording,
            one.window,
            one.signal.upper(),
            *(f"{x:.4f}" for x in (one.first, one.second, one.apart, one.largest)),
        )
        for one in result.apart
    ]
    columns = ("Recording", "Window", "", first, second, "apart", "most apart")
    title = "Two models of one plant: rms from the recording, and from each other [pu]"
    return ShownTable(title, columns, rows, left=3)


def explanation_table(explanations: Sequence[Explanation]) -> ShownTable:
    """Causes that would each explain the error, the best first."""
    rows = [explanation_cells(one) for one in explanations]
    return ShownTable("One cause that would explain the error", EXPLANATION_COLUMNS, rows)


def confirmation_table(confirmations: Sequence[FitCheck]) -> ShownTable:
    """The error of each recording with the fitted values [pu]."""
    rows = [
        (
            one.recording,
            "fitted" if one.fitted else "kept back",
            f"{one.before:.4g}",
            f"{one.after:.4g}",
        )
        for one in confirmations
    ]
    columns = ("Recording", "", "rms error now [pu]", "fitted [pu]")
    return ShownTable("The error with the fitted values", columns, rows, left=2)


def criteria_table(
    title: str, criteria: Sequence[Criterion], *, by_device: bool = False
) -> ShownTable:
    """Figures beside their limits; ``by_device``: whether a device's name stands beside that of the recording."""
    rows = [_criterion_cells(one, by_device=by_device) for one in criteria]
    headings = ("Recording", "Figure", "Value", "Limit", "Verdict")
    return ShownTable(title, headings, rows, left=2)


def _criterion_cells(criterion: Criterion, *, by_device: bool) -> tuple[str, ...]:
    return (
        criterion.place if by_device else criterion.recording,
        criterion.shown_name,
        "–" if criterion.value is None else f"{criterion.value:.4g} {criterion.unit}",
        f"{criterion.limit:g} {criterion.unit}",
        str(criterion.verdict),
    )
