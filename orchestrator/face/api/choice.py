"""The methods of a case that choose scenarios; beside the studies, which they need not import."""

from typing import Any, cast

from orchestrator.cases.case import with_protection
from orchestrator.cases.forcing import with_events
from orchestrator.core.asked import names as names_given
from orchestrator.core.asked import text_or_none
from orchestrator.core.errors import InputError
from orchestrator.face.api.methods import method
from orchestrator.face.api.scenario import Scenario, question
from orchestrator.face.api.scenario import choose as chosen_of
from orchestrator.studies.modes.request import ScenarioRequest, ScenariosRequest
from orchestrator.systems.coupling.no_trip_regions import NoTripCode


def _scenario(case: Any, request: ScenarioRequest) -> Scenario:
    known, name = ", ".join(case.scenarios), request.name
    text_or_none(name, "name", f"give the name of one scenario: {known}")
    if name is None and len(case.scenarios) != 1:
        raise InputError(
            f"{case.name}: the case has {len(case.scenarios)} scenarios; choose one of: {known}"
        )
    file = with_events(
        case.file, names_given(request.force, "force"), names_given(request.fault, "fault")
    )
    file = with_protection(file, cast("NoTripCode | None", request.protection))
    (chosen,) = chosen_of(file, [name] if name else [], request)
    question([chosen.prepared], above=1)
    return chosen


def _chosen(case: Any, request: ScenariosRequest) -> list[Scenario]:
    chosen = chosen_of(case.file, request.names, request, cast("float | None", request.stop))
    question((scenario.prepared for scenario in chosen), above=1)
    return chosen


scenario = method("Case.scenario", ScenarioRequest, _scenario)
choose = method("Case.choose", ScenariosRequest, _chosen)
