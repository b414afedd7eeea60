"""Sensitivities of a mode as a table, as JSON and as files. `Scenario.sensitivities` makes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from orchestrator.late import pd
from orchestrator.report.notebook import page
from orchestrator.results.staging import new_run_id, staged
from orchestrator.results.storage import save_json, save_table
from orchestrator.safe_files import made_folder
from orchestrator.sensitivities.sensitivities import SensitivityResult
from orchestrator.sensitivities.tables import as_json, rows_of


class Sensitivities:
    """∂λ/∂p of one mode by the parameters of all FMUs, largest effect first.

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
        """What is to be borne in mind of the modes and of all rows."""
        return (*self.result.modes.warnings, *self.result.warnings)

    def table(self) -> pd.DataFrame:
        """One row for each parameter; columns as in ``sensitivities.csv``."""
        return pd.DataFrame(rows_of(self.result)).set_index("parameter")

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor sensitivities --json`` prints, as JSON's types."""
        return as_json(self.result)

    def save(self, folder: str | Path) -> list[Path]:
        """Write ``sensitivities.csv`` and ``sensitivities.json``; give their paths."""
        place = made_folder(Path(folder), "folder")
        with staged(place, new_run_id()) as staging:
            save_table(rows_of(self.result), staging / "sensitivities.csv")
            save_json(self.as_json(), staging / "sensitivities.json")
        return [place / "sensitivities.csv", place / "sensitivities.json"]

    def __repr__(self) -> str:
        mode = self.result.mode
        return f"<Sensitivities of {mode.frequency_hz:.3g} Hz to {len(self.result.rows)} parameters>"

    def _repr_html_(self) -> str:
        return page(repr(self).strip("<>"), [f"warning: {text}" for text in self.warnings], self.table())
