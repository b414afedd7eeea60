"""How a case uses one of its components: what an FMU is checked with."""

from pathlib import Path

from orchestrator.acceptance.checks.subject import Point, Use
from orchestrator.cases.case import Case, load_case
from orchestrator.errors import InputError

_START = ("P_0", "Q_0", "v_0", "theta_0")


def use_in_case(case: str, component: str | None, fmu: Path, step_size: float | None) -> tuple[Use, Path | None]:
    """Step, operating point and values that a case gives an FMU, and the file of its binding.

    Parameters
    ----------
    component
        Its name; the one component that is that file where None.
    step_size
        Communication step [s]; the case's where None.

    Raises
    ------
    InputError
        If no component is that FMU, or the case cannot be prepared.
    """
    loaded = load_case(case)
    name = _component(loaded, component, fmu)
    table = loaded.table.components[name]
    scenario = next(iter(loaded.scenarios))
    (prepared,) = loaded.prepare([scenario], step_size=step_size)
    plan = prepared.system.components[name]
    values = dict(plan.parameters)
    start = {n: float(values.pop(n)) for n in _START if n in values}
    point = None
    if len(start) == len(_START):
        point = Point(start["v_0"], start["theta_0"], start["P_0"], start["Q_0"])
    binding = loaded.directory / table.binding if table.binding else None
    fed = {c.target.variable for c in prepared.system.connections if c.target.component == name}
    inputs = {n: v for n, v in plan.inputs.items() if n not in fed}
    return Use(prepared.step_size, point, values, inputs), binding


def _component(case: Case, wanted: str | None, fmu: Path) -> str:
    """Name of the component that is an FMU."""
    files = {n: case.directory / t.fmu for n, t in case.table.components.items() if t.fmu is not None}
    known = ", ".join(files) or "none"
    if wanted is not None:
        if wanted not in case.table.components:
            raise InputError(f"{case.path}: there is no component {wanted!r}; components that are FMUs: {known}")
        return wanted
    same = [n for n, path in files.items() if path.exists() and path.resolve() == fmu.resolve()]
    if len(same) != 1:
        found = "no component is" if not same else f"{', '.join(same)} are all"
        raise InputError(
            f"{case.path}: {found} {fmu.name}; say which one it is with --component (components that are FMUs: {known})"
        )
    return same[0]
