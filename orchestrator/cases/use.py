"""The use of an FMU in a case: step, operating point and values for its acceptance tests."""

from pathlib import Path

from orchestrator.cases.case import Case, load_case
from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Use
from orchestrator.systems.coupling.system import ComponentPlan

_START = {"P_0": 0.0, "Q_0": 0.0, "v_0": 1.0, "theta_0": 0.0}
"""Names of the start values, and the defaults if neither the case nor the FMU gives a value."""


def use_in_case(
    case: str,
    component: str | None,
    fmu: Path,
    step_size: float | None,
    scenario: str | None = None,
) -> tuple[Use, Path | None]:
    """Step, operating point and values that a case gives an FMU, and the file of its binding."""
    loaded = load_case(case, trust_fmus=True)  # of which nothing runs here
    name = _component(loaded, component, fmu)
    table = loaded.table.components[name]
    chosen = _scenario(loaded, name, scenario)
    (prepared,) = loaded.prepare([chosen], step_size=step_size)
    plan = prepared.system.components[name]
    values = dict(plan.parameters)
    start = {n: float(values.pop(n)) for n in _START if n in values}
    origin = f"component {name!r} in scenario {chosen!r} of {loaded.path.name}"
    point, said = _point(plan, start)
    binding = loaded.directory / table.binding if table.binding else None
    fed = {c.target.variable for c in prepared.system.connections if c.target.component == name}
    inputs = {n: v for n, v in plan.inputs.items() if n not in fed}
    return Use(prepared.step_size, point, values, inputs, f"{origin}: {said}"), binding


def _point(plan: ComponentPlan, start: dict[str, float]) -> tuple[OperatingAt | None, str]:
    """The operating point, with defaults for missing values; and its description in words."""
    if not start:
        return None, "no operating point; the checks take their own"
    variables = plan.description.variables
    full, words = {}, []
    for name, default in _START.items():
        if name in start:
            full[name] = start[name]
        else:
            declared = variables.get(name)
            full[name] = (
                default if declared is None or declared.start is None else declared.start_number
            )
        words.append(f"{name} = {full[name]:.6g}{'' if name in start else ' (default)'}")
    return OperatingAt(full["v_0"], full["theta_0"], full["P_0"], full["Q_0"]), ", ".join(words)


def _scenario(case: Case, component: str, wanted: str | None) -> str:
    having = [name for name, table in case.scenarios.items() if component not in table.remove]
    known = ", ".join(having) or "none"
    if wanted is None:
        if not having:
            raise InputError(
                f"{case.source}: every scenario removes component {component!r}; add one that keeps it to the case"
            )
        return having[0]
    if wanted not in case.scenarios:
        raise InputError(
            f"{case.source}: there is no scenario {wanted!r}; scenarios with {component!r}: {known}"
        )
    if wanted not in having:
        raise InputError(
            f"{case.source}: scenario {wanted!r} removes component {component!r}; scenarios that have it: {known}"
        )
    return wanted


def _component(case: Case, wanted: str | None, fmu: Path) -> str:
    files = {
        n: case.directory / t.file for n, t in case.table.components.items() if t.file is not None
    }
    known = ", ".join(files) or "none"
    if wanted is not None:
        if wanted not in case.table.components:
            every = list(case.table.components)
            hint = close_names(wanted, every, f"there are: {', '.join(every)}")
            raise InputError(f"{case.source}: there is no component {wanted!r}; {hint}")
        return wanted
    same = [n for n, path in files.items() if path.exists() and path.resolve() == fmu.resolve()]
    if len(same) != 1:
        found = "no component is" if not same else f"{', '.join(same)} are all"
        raise InputError(
            f"{case.source}: {found} {fmu.name}; say which one it is with "
            + Option.COMPONENT
            + f" (components that are FMUs: {known})"
        )
    return same[0]
