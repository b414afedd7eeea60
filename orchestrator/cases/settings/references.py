"""Published figures of a scenario, where the values that they were published for are the scenario's own."""

from collections.abc import Mapping

import numpy as np

from orchestrator.cases.draft import Draft
from orchestrator.cases.form.names import close_names
from orchestrator.cases.form.schema import ReferenceModeTable, Value
from orchestrator.cases.form.values import convert
from orchestrator.cases.settings.imperfection_tables import sets_imperfection


def references_of(
    draft: Draft, imperfections: Mapping[str, float | bool]
) -> dict[str, ReferenceModeTable]:
    """The modes of ``[reference]`` for a scenario; none where a condition of ``when`` does not hold, or where the
    command line or one of its parameter files sets a value that is no condition.

    A condition is compared in the variable's own unit, with the value that is set, else with the default. A name that
    nothing has is noted as a problem."""
    table = draft.given.case.reference
    if table is None:
        return {}
    held = [_holds(draft, key, wanted, imperfections) for key, wanted in table.when.items()]
    return (
        table.modes.get(draft.given.name, {})
        if all(held) and draft.given.from_outside <= set(table.when)
        else {}
    )


def _holds(
    draft: Draft, key: str, wanted: Value, imperfections: Mapping[str, float | bool]
) -> bool:
    place = draft.given.place("reference", "when", key)
    if sets_imperfection(key):
        return key in imperfections and _equal(imperfections[key], wanted)
    name, _, variable = key.partition(".")
    if name not in draft.known and draft.given.whole:
        hint = close_names(
            name,
            sorted(draft.known),
            f"the case has: {', '.join([*draft.given.case.components][:12])}",
        )
        draft.note(place, f"there is no component {name!r}; {hint}")
        return False
    plan = draft.system.components.get(name)
    if plan is None:
        return False  # another scenario has it
    info = plan.description.variables.get(variable)
    if info is None:
        if draft.tables[name].file is None:
            hint = close_names(
                variable, plan.description.parameters, "`gfor fmu info` lists the variables"
            )
            draft.note(place, f"component {name!r} has no variable {variable!r}; {hint}")
        return False  # the FMU of somebody else may lack what the catalogue's model has
    try:
        converted = convert(info, wanted)
    except ValueError as error:
        draft.note(place, str(error))
        return False
    value = plan.value(variable)
    return value is not None and _equal(value, converted)


def _equal(value: Value, wanted: Value) -> bool:
    try:
        return bool(np.isclose(float(value), float(wanted)))
    except ValueError:
        return value == wanted
