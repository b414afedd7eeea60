"""Sensitivities of a mode as Python has them, as rows for files, as JSON, and as a table for a terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.core.late import pd
from orchestrator.core.options import Option
from orchestrator.core.safe_files import made_folder
from orchestrator.linear.spectra.modes import mode_in_words
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.results.file_writers import save_json, save_table
from orchestrator.output.results.mode_json import eigenvalue_json
from orchestrator.output.results.staging import new_run_id, staged

if TYPE_CHECKING:  # a scenario knows what it may be asked for, and need not compute it
    from orchestrator.studies.sensitivities.sensitivities import Sensitivity, SensitivityResult


class Sensitivities:
    """∂λ/∂p of one mode by the parameters of all FMUs, first what moves damping most for the same percentage.

    Attributes
    ----------
    result
        All that was computed.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> scenario = gfor.load("infinite_bus").scenario("dip", {"gfor.pod_p.enabled": True})
    >>> found = scenario.sensitivities("critical", ["gfor.pod_p.K"], frequencies=(0.01, 20.0))
    >>> found.table().index.tolist()
    ['gfor.pod_p.K']
    """

    def __init__(self, result: SensitivityResult) -> None:
        self.result = result

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return what is to be borne in mind of the modes and of all rows."""
        return (*self.result.modes.warnings, *self.result.warnings)

    def table(self) -> pd.DataFrame:
        """One row for each parameter; columns as in ``sensitivities.csv``."""
        return sensitivity_table(self.result).frame().set_index("parameter")

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor sensitivities --json`` prints, as JSON's types."""
        return as_json(self.result)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``sensitivities.csv`` and ``sensitivities.json``; give their paths."""
        place = made_folder(folder, "folder")
        with staged(place, new_run_id()) as staging:
            save_table(rows_of(self.result), staging / "sensitivities.csv")
            save_json(self.as_json(), staging / "sensitivities.json")
        return [place / "sensitivities.csv", place / "sensitivities.json"]

    def __repr__(self) -> str:
        mode = self.result.mode
        return (
            f"<Sensitivities of {mode.frequency_hz:.3g} Hz to {len(self.result.rows)} parameters>"
        )

    def _repr_html_(self) -> str:
        table = self.table()
        lines = [f"warning: {text}" for text in self.warnings]
        for name, text in _long_texts(table).items():
            lines.append(f"{name}: {text}")
        top = headline(_most_of(self.result), None)
        return page(repr(self).strip("<>"), lines, table.map(_short_text), verdict=top)


_LONGEST = 40
"""Characters of a text in a table that a notebook shows; a longer one makes rows of many lines, and stands above."""


def _long_texts(table: pd.DataFrame) -> dict[str, str]:
    """Return, by parameter, the texts that are too long for a table."""
    found = {}
    for name, row in table.iterrows():
        texts = [one for one in row if isinstance(one, str) and len(one) > _LONGEST]
        if texts:
            found[str(name)] = "; ".join(texts)
    return found


def _short_text(value: Any) -> Any:
    return "see above" if isinstance(value, str) and len(value) > _LONGEST else value


_TOLD = 3
"""Values that a sentence names, those that move the mode most."""


def name_of(result: SensitivityResult) -> str:
    """Return a mode's name if it has one, its frequency and damping, and who takes part most."""
    mode = result.mode
    name = result.modes.name_of(mode)
    told = mode_in_words(mode.eigenvalue, mode.by_component.items())
    return f"{name}, {told}" if name else told


def _less_damped(result: SensitivityResult) -> str:
    """Tell which mode is damped less than the one that is shown, with what takes it; "" where none is."""
    swings = [mode for mode in result.modes.modes if mode.is_oscillation]
    least = min(swings, key=lambda mode: mode.damping_percent, default=result.mode)
    if least.damping_percent >= result.mode.damping_percent:
        return ""
    told = f"{least.frequency_hz:.3f} Hz, {least.damping_percent:.2f} %"
    return f", not the least damped, which is {told} ({Option.MODE} critical)"


def tell_most(result: SensitivityResult) -> str:
    """Tell what moves the damping most, and how the rows are ordered."""
    return (
        f"{_most_of(result)}. The table is ordered by points per %, the largest first; behind lines come values of 0, "
        "which have no percent, what moves nothing, and what has no derivative"
    )


def _most_of(result: SensitivityResult) -> str:
    """Return the values that move the damping most, of the figures without a doubt."""
    trusted = (row for row in result.rows if row.damping_per_percent and not row.doubts)
    first = [
        f"{row.parameter.name} ({_text(row.damping_per_percent)})" for row in islice(trusted, _TOLD)
    ]
    most = f"damping moves most with {', '.join(first)}, in points for 1 % more of the value"
    return f"{name_of(result)}: {most if first else 'no percentage of a value moves its damping'}"


def sensitivity_table(result: SensitivityResult) -> ColumnTable[Sensitivity]:
    point = (
        "is held" if result.held else "moves with the value, which the figures include, or stays"
    )
    notes = _notes(result.rows)
    shown = f"{result.modes.prepared.title}, {name_of(result)}{_less_damped(result)}"
    title = (
        f"{shown}: how it changes for one unit and for 1 % more of each "
        f"value. A point is one percent of damping, as from 5 % to 6 %. The operating point {point}"
    )
    return ColumnTable(
        title,
        (
            Column("Parameter", lambda row: row.parameter.name, name="parameter"),
            Column(
                "Value",
                lambda row: row.parameter,
                lambda p: f"{p.value:.5g} {p.unit}".removesuffix(" 1"),
            ),
            Column("", lambda row: row.parameter.value, name="value"),
            Column("", lambda row: row.parameter.unit, name="unit"),
            Column(
                "", lambda row: "tunable" if row.parameter.tunable else "fixed", name="variability"
            ),
            Column(
                "Hz per unit", lambda row: row.frequency_per_unit, _text, "frequency_hz_per_unit"
            ),
            Column(
                "Points per unit",
                lambda row: row.damping_per_unit,
                _text,
                "damping_points_per_unit",
            ),
            Column(
                "Hz per %", lambda row: row.frequency_per_percent, _text, "frequency_hz_per_percent"
            ),
            Column(
                "Points per %",
                lambda row: row.damping_per_percent,
                _text,
                "damping_points_per_percent",
            ),
            Column("", lambda row: _part(row.derivative, "real"), name="real_per_unit"),
            Column("", lambda row: _part(row.derivative, "imag"), name="imag_per_unit"),
            Column("", lambda row: _part(row.continuous, "real"), name="continuous_real_per_unit"),
            Column("", lambda row: _part(row.continuous, "imag"), name="continuous_imag_per_unit"),
            Column("Operating point", lambda row: row.operating_point, name="operating_point"),
            Column("", lambda row: "; ".join(row.doubts), name="doubts"),
            Column("", lambda row: row.reason, name="reason"),
            Column("Remark", _remark, lambda text: notes.get(text, text), text=True),
        ),
        result.rows,
        note="\n".join(f"{short.capitalize()}: {text}." for text, short in notes.items()),
        part=_part_of_table,
    )


def _remark(row: Sensitivity) -> str:
    return row.reason or "; ".join(row.doubts)


def _notes(rows: Sequence[Sensitivity]) -> dict[str, str]:
    """Return what stands in the rows in the place of a remark that several of them have, and below the table once."""
    times = Counter(filter(None, map(_remark, rows)))
    repeated = [text for text, number in times.items() if number > 1]
    return {text: f"note {k}" for k, text in enumerate(repeated, 1)}


def _part_of_table(row: Sensitivity) -> str:
    """Name the part of the table that a row is in: what moves the mode, what does not, and what is not known."""
    if row.derivative is None:
        return "not known"
    if not row.derivative:
        return "moves nothing"
    return "in percent" if row.damping_per_percent is not None else "of values of 0"


def rows_of(result: SensitivityResult) -> list[dict[str, Any]]:
    return sensitivity_table(result).records()


def _part(value: complex | None, part: str) -> float | None:
    return None if value is None else float(getattr(value, part))


def as_json(result: SensitivityResult) -> dict[str, Any]:
    modes, mode = result.modes, result.mode
    return {
        **modes.prepared.about,
        "stable": modes.stability.stable,
        "stability": modes.stability.as_json(),
        "mode": {
            **eigenvalue_json(mode.eigenvalue, mode.damping_percent),
            "name": modes.name_of(mode),
        },
        "derivative": "partial" if result.held else "total",
        "warnings": [*modes.warnings, *result.warnings],
        "sensitivities": rows_of(result),
    }


def _text(figure: float | None) -> str:
    if figure is None:
        return "–"
    return "0" if figure == 0 else f"{figure:+.3g}"


def left_out(result: SensitivityResult) -> list[Sensitivity]:
    return [row for row in result.rows if row.derivative is None]
