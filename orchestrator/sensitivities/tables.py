"""Sensitivities as rows for files, as JSON, and as a table for a terminal."""

from typing import Any

from rich.table import Table

from orchestrator.report.tables import make_table
from orchestrator.results.mode_json import eigenvalue_json
from orchestrator.sensitivities.sensitivities import Sensitivity, SensitivityResult


def rows_of(result: SensitivityResult) -> list[dict[str, Any]]:
    """One row for each parameter, largest effect first; None where there is no figure."""
    return [
        {
            "parameter": row.parameter.name,
            "value": row.parameter.value,
            "unit": row.parameter.unit,
            "variability": "tunable" if row.parameter.tunable else "fixed",
            "frequency_hz_per_unit": row.frequency_per_unit,
            "damping_points_per_unit": row.damping_per_unit,
            "frequency_hz_per_percent": row.frequency_per_percent,
            "damping_points_per_percent": row.damping_per_percent,
            "real_per_unit": _part(row.derivative, "real"),
            "imag_per_unit": _part(row.derivative, "imag"),
            "continuous_real_per_unit": _part(row.continuous, "real"),
            "continuous_imag_per_unit": _part(row.continuous, "imag"),
            "operating_point": row.operating_point,
            "doubts": "; ".join(row.doubts),
            "reason": row.reason,
        }
        for row in result.rows
    ]


def _part(value: complex | None, part: str) -> float | None:
    return None if value is None else float(getattr(value, part))


def as_json(result: SensitivityResult) -> dict[str, Any]:
    """What ``gfor sensitivities --json`` prints of a scenario."""
    modes, mode = result.modes, result.mode
    return {
        "case": modes.prepared.case.name,
        "scenario": modes.prepared.name,
        "stable": modes.stability.stable,
        "stability": modes.stability.as_json(),
        "mode": {**eigenvalue_json(mode.eigenvalue, mode.damping_percent), "name": modes.name_of(mode)},
        "derivative": "partial" if result.held else "total",
        "warnings": [*modes.warnings, *result.warnings],
        "sensitivities": rows_of(result),
    }


def sensitivity_table(result: SensitivityResult, shown: int | None = None) -> Table:
    """The table for a terminal.

    ``shown``: number of rows; all where None.
    """
    mode = result.mode
    name = result.modes.name_of(mode) or "critical"
    kind = "the operating point held" if result.held else "total: the operating point moves with the parameter"
    title = f"{result.modes.prepared.title}, {name}, {mode.frequency_hz:.4f} Hz, {mode.damping_percent:.2f} %; {kind}"
    columns = ("Parameter", "Value", "Hz per unit", "Points per unit", "Hz per %", "Points per %", "Point")
    table = make_table(title, *columns)
    table.add_column("Doubt", overflow="fold")
    for row in result.rows[:shown]:
        unit = "" if row.parameter.unit == "1" else f" {row.parameter.unit}"
        figures = (row.frequency_per_unit, row.damping_per_unit, row.frequency_per_percent, row.damping_per_percent)
        why = row.reason or "; ".join(row.doubts)
        value = f"{row.parameter.value:.5g}{unit}"
        table.add_row(row.parameter.name, value, *map(_text, figures), row.operating_point, why)
    return table


def _text(figure: float | None) -> str:
    return "–" if figure is None else "0" if figure == 0 else f"{figure:+.3g}"


def left_out(result: SensitivityResult) -> list[Sensitivity]:
    """Parameters without a figure."""
    return [row for row in result.rows if row.derivative is None]
