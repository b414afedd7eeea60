"""Events of a case file as the coupling's typed events."""

from typing import Any

from orchestrator.cases.schema import (
    BranchChangeTable,
    EventTable,
    LoadChangeTable,
    ParameterChangeTable,
    ReferenceChangeTable,
)
from orchestrator.coupling.events import BranchChange, Event, LoadChange, ParameterChange, ReferenceChange


def event_of(table: EventTable) -> Event:
    """The event that a table describes; its values are still as the file has them."""
    match table:
        case LoadChangeTable():
            return LoadChange(table.time, table.component, table.load, table.scale)
        case BranchChangeTable():
            return BranchChange(table.time, table.component, table.line, table.X, table.R)
        case ReferenceChangeTable():
            return ReferenceChange(table.time, table.component, table.reference, table.delta)
        case ParameterChangeTable():
            value: Any = table.value  # brought to the variable's type and unit by the check
            return ParameterChange(table.time, table.component, table.parameter, value)
