"""The variables of an FMU in tables, by their causality."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from orchestrator.devices.fmi.values import as_text
from orchestrator.output.report.terminal_tables import PlainTable, make_table

if TYPE_CHECKING:
    from orchestrator.devices.fmi.description import FmuDescription, VariableInfo

# variables in a table; rich takes half a millisecond for each
_MOST_IN_A_TABLE = 5000


def fmu_variables(description: FmuDescription) -> Iterable[PlainTable | str]:
    """A table for each causality; plain text for one with more than `_MOST_IN_A_TABLE` variables."""
    for causality in ("input", "output", "parameter", "calculatedParameter", "local"):
        variables = [
            v
            for v in description.variables.values()
            if v.causality == causality and not v.name.startswith("der(")
        ]
        if not variables:
            continue
        columns = ("Name", "Unit", "Start", "Range", "Variability", "Description")
        rows = [
            (
                v.name,
                v.unit,
                "" if v.start is None else as_text(v.start),
                _bounds(v),
                v.variability,
                v.description,
            )
            for v in variables
        ]
        title = f"{causality} ({len(variables)})"
        if len(variables) > _MOST_IN_A_TABLE:
            yield _in_columns(title, columns, rows)
        else:
            yield make_table(title, *columns, left=6, rows=rows)


def _in_columns(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Text in columns, on one line for each row."""
    lines = [columns, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    padded = (map(str.ljust, line, widths) for line in lines)
    return "\n".join([title, *("  ".join(line).rstrip() for line in padded)])


def _bounds(variable: VariableInfo) -> str:
    bounds = ["" if b is None else f"{b:g}" for b in (variable.minimum, variable.maximum)]
    return "…".join(bounds) if any(bounds) else ""
