"""The table of a scenario's modes, for terminals, CSV files and DataFrames."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.report.column_table import Column, ColumnTable
from orchestrator.output.report.mode_tables import damping, eigenvalue_text
from orchestrator.studies.modes.modes import ModesResult

WELL_DAMPED = 0.3
"""Damping ratio from which a control's mode is only counted: it is over within a period."""


@dataclass(frozen=True)
class ScenarioMode:
    """A mode of a scenario, in the range; ``swings`` if machines swing in it or it has a name."""

    result: ModesResult
    mode: Mode
    swings: bool = True

    @property
    def scenario(self) -> str:
        return self.result.prepared.name

    @property
    def name(self) -> str:
        """Return the name that the case gives, "" if none."""
        return self.result.name_of(self.mode) or ""


def _states(count: int, write: str, between: str = ", ") -> Callable[[ScenarioMode], str]:
    """Write the states that take part most, each with its factor."""
    return lambda row: between.join(write.format(*it) for it in row.mode.participation[:count])


SCENARIO: Column[ScenarioMode] = Column("", lambda row: row.scenario, file="scenario")
FREQUENCY: Column[ScenarioMode] = Column(
    "f [Hz]",
    lambda row: row.mode.frequency_hz,
    ".4f",
    name="frequency_hz",
    file="frequency [Hz]",
    stored=".6g",
)
DAMPING: Column[ScenarioMode] = Column(
    "Damping [%]",
    lambda row: row.mode.damping_percent,
    damping,
    name="damping_percent",
    file="damping [%]",
    stored=".6g",
)
NAME: Column[ScenarioMode] = Column("Name", lambda row: row.name, name="name", text=True)
COLUMNS: Sequence[Column[ScenarioMode]] = (
    SCENARIO,
    Column("Mode [rad/s]", lambda row: row.mode.eigenvalue, eigenvalue_text),
    Column("", lambda row: row.mode.eigenvalue.real, name="real", file="real [1/s]", stored=".8g"),
    Column(
        "", lambda row: row.mode.eigenvalue.imag, name="imag", file="imag [rad/s]", stored=".8g"
    ),
    FREQUENCY,
    DAMPING,
    NAME,
    Column("Most associated states (participation)", _states(3, "{} ({:.2f})"), text=True),
    Column("", _states(3, "{} {:.2f}"), name="states", file=""),
    Column("", _states(6, "{} {:.4f}", "; "), file="participation"),
)
"""A mode's eigenvalue, name and leading states."""


def modes_table(results: Sequence[ModesResult], title: str = "Modes") -> ColumnTable[ScenarioMode]:
    """All modes in the range, least damped first."""
    rows = [ScenarioMode(result, mode) for result in results for mode in result.modes]
    return ColumnTable(title, COLUMNS, rows)


def head_of(row: ScenarioMode) -> dict[str, Any]:
    """Return the first cells of tables that have several rows for a mode."""
    columns = (SCENARIO, FREQUENCY, DAMPING, NAME)
    return {column.file_heading: column.stored_value(row) for column in columns}


def all_modes(result: ModesResult, *, whole: bool = False) -> ColumnTable[ScenarioMode]:
    """Modes in the range: those in which machines swing, or that have a name, above those of controls and fluxes.

    ``whole``: also lists the latter where they are well damped; else a line below counts them."""
    states, residual = result.model.number_of_states, result.operating_point.residual
    swings, others = result.swings_apart()
    kept = [mode for mode in others if whole or not swings or mode.damping_ratio < WELL_DAMPED]
    counted = [mode.damping_percent for mode in others if mode.damping_ratio >= WELL_DAMPED]
    rows = [ScenarioMode(result, mode) for mode in swings]
    rows += [ScenarioMode(result, mode, swings=False) for mode in kept]
    note = ""
    if len(kept) < len(others):
        modes = "modes" if len(counted) > 1 else "mode"
        how_many = f"{len(counted)} {modes} of controls and fluxes"
        note = f"and {how_many}, damped by {min(counted):.0f} % or more: --details"
    return ColumnTable(
        f"{result.prepared.title}: {states} states, residual {residual:.1e}",
        COLUMNS,
        rows,
        note=note,
        stands_out=lambda row: bool(row.name),
        part=lambda row: row.swings,
    )
