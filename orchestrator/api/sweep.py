"""What is varied in a sweep, as Python takes it."""

from collections.abc import Iterable, Mapping
from typing import Any

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.api.values import Paths, Time, case_values, check_case_name, in_seconds, parameter_files
from orchestrator.asked import Names, frequency_range, names, plain_value
from orchestrator.cases.case import Case as CaseFile
from orchestrator.errors import InputError
from orchestrator.sweep.axes import Vary, parse_vary
from orchestrator.sweep.limit import Until
from orchestrator.sweep.sweep import SweepPlan, plan_sweep


def plan(
    file: CaseFile,
    vary: Mapping[str, Iterable[Any]] | Iterable[str | Vary],
    scenarios: Names = (),
    values: Mapping[str, Any] | None = None,
    *,
    step: Time | None = None,
    parameters: Paths = (),
    frequencies: tuple[float, float] = ELECTROMECHANICAL_HZ,
    until: str | float | None = None,
) -> SweepPlan:
    """As `Case.sweep` takes it, checked, and its FMUs built."""
    files, fixed = parameter_files(parameters), case_values(values)
    chosen, seen = names(scenarios, "scenarios"), frequency_range(frequencies)
    return plan_sweep(file, _varied(vary), chosen, fixed, in_seconds(step, "step"), seen, files, _until(until))


def _until(given: str | float | None) -> Until | None:
    """What must not be given up: ``unstable``, or a damping [%]."""
    if given is None:
        return None
    if isinstance(given, str) and given.strip().lower() == "unstable":
        return Until()
    try:
        damping = float(given.strip().removesuffix("%") if isinstance(given, str) else given)
    except (TypeError, ValueError):
        damping = -1.0
    if isinstance(given, bool) or not 0 < damping < 100:
        raise InputError(f"until = {given!r}; give 'unstable', or a damping from 0 to 100 % such as '5 %'")
    return Until(damping)


def _varied(vary: Mapping[str, Iterable[Any]] | Iterable[str | Vary]) -> list[Vary]:
    """What is varied, from values by name, from texts, or as it was read already."""
    how = "such as {'grid.X_L': [0.1, 0.3]} or 'grid.X_L=0.1:0.5:9'"
    if isinstance(vary, Mapping):
        if wrong := [key for key in vary if not isinstance(key, str)]:
            raise InputError(f"vary: {wrong[0]!r} is not a name; give values by name, {how}")
        for key, values in vary.items():
            check_case_name(key, "vary")
            if isinstance(values, str | Mapping) or not isinstance(values, Iterable):
                raise InputError(f"vary: {key} = {values!r}; a sweep needs a list of values, {how}")
        lists = {key: tuple(map(plain_value, values)) for key, values in vary.items()}
        empty = [key for key, values in lists.items() if not values]
        if empty:
            raise InputError(f"{', '.join(empty)}: a sweep needs values, such as {{'grid.X_L': [0.1, 0.3]}}")
        found = [Vary(key, None, len(values), False, values) for key, values in lists.items()]
        if not found:
            raise InputError(f"vary = {vary!r} varies nothing; give what is varied, {how}")
        return found
    try:
        given = [vary] if isinstance(vary, str) else list(vary)
        if not given or not all(isinstance(one, str | Vary) for one in given):
            raise InputError(f"vary = {vary!r}; give what is varied, {how}")
        return [one if isinstance(one, Vary) else parse_vary(one) for one in given]
    except TypeError as error:
        raise InputError(f"vary = {vary!r}; give what is varied, {how}") from error
    except ValueError as error:
        raise InputError(str(error)) from error
