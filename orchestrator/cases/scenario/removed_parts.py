"""Parts of generators that a scenario or the command line takes off: what their records set goes with them."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.build_choices import PartChoice
from orchestrator.cases.networks.unit_row import UnitRow

NONE = "none"
_SCOPES = {"stabilizer": "pss.", "oel": "oel.", "uel": "uel."}
"""Beginnings of the parameters of parts that a generator may be without."""


def without_removed_parts(draft: Draft, rows: Sequence[UnitRow]) -> list[UnitRow]:
    """Return the units without parameters of parts that a layer of values chooses as ``none``."""
    choices = [choice for layer in draft.given.layers for choice in layer.parts]
    return [_without(row, choices) for row in rows]


def _without(row: UnitRow, choices: Sequence[PartChoice]) -> UnitRow:
    """Return a unit without those parameters; the last layer is the strongest."""
    fitting = [choice for choice in choices if choice.fits(f"sg{row.label}", has_part=True)]
    chosen = {choice.part: choice.given for choice in fitting}
    gone = tuple(scope for part, scope in _SCOPES.items() if chosen.get(part) == NONE)
    own = row.parameters.get("sg", {})
    kept = {name: value for name, value in own.items() if not name.startswith(gone)}
    return replace(row, parameters={**row.parameters, "sg": kept}) if len(kept) < len(own) else row
