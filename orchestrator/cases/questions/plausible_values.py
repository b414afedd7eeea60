"""One value of a component: what it is, where it was set, and the question that it raises outside of its range."""

from collections.abc import Iterator

from fmus.toolchain.variables import Usual
from orchestrator.cases.draft import Draft
from orchestrator.cases.form.unusual_value import UnusualValue
from orchestrator.systems.coupling.system import ComponentPlan

_FAR = 3
"""A value that is outside of its range by less than this factor may be a mistake, but not one of a factor of 1000."""


def place_of(draft: Draft, name: str, *variables: str) -> str:
    """Place of the first of some variables of a component that was set, or otherwise the place of the component."""
    found = (draft.places.get(f"{name}.{variable}") for variable in variables)
    return next(
        (place for place in found if place),
        f"{draft.given.place('components', name)}, {variables[0]} (its default)",
    )


def place_of_source(draft: Draft) -> str:
    """The key that names another program's data, or else the table of the network."""
    table = draft.given.case.network
    source = [
        key for key in ("raw", "matpower", "pandapower", "cgmes") if table and getattr(table, key)
    ]
    return draft.given.place("network", *source[:1])


def value_of(plan: ComponentPlan, variable: str) -> float | None:
    value = plan.value(variable) if variable in plan.description.variables else None
    return None if value is None or isinstance(value, bool | str) else float(value)


def unit_of(plan: ComponentPlan, variable: str) -> str:
    return plan.description.variables[variable].unit


def outside(
    draft: Draft,
    component: str,
    variable: str,
    value: float,
    wanted: Usual,
    where: str | None = None,
    scale: float = 1.0,
    bases: tuple[str, str] = ("", ""),
) -> Iterator[UnusualValue]:
    """Yield a question about a value outside of its usual range.

    ``scale``: factor from the base of the value to that of the range; ``bases``: the names of both."""
    given, value = value, value * scale
    if wanted.fits(value):
        return
    info = draft.system.components[component].description.variables.get(variable)
    # a sum of variables, such as of two windings, is none itself
    declared = "pu" if info is None else info.unit
    unit = f" {declared}" if declared != "1" else ""
    slip = f"; is it {wanted.slip}?" if wanted.slip else ""
    slipped = wanted.slip
    ratio = declared in ("pu", "1")
    for meant, text, far, cause in (
        (
            value / 100,
            f"{value / wanted.high:.3g} times too large",
            ratio and value > wanted.high,
            "in percent",
        ),
        (1 / value if value else 0, "", ratio and 0 < value < wanted.low / _FAR, "the inverse"),
        (value / 1e3, f"{value / wanted.high:.3g} times too large", value > _FAR * wanted.high, ""),
        (
            value * 1e3,
            f"{wanted.low / value if value else 0:.3g} times too small",
            value < wanted.low / _FAR,
            "",
        ),
    ):
        if far and not slip and wanted.low <= meant <= wanted.high:
            slipped = cause or "a factor of 1000"
            slip = (
                f"; is it {cause}? {meant:.4g}{unit} would be usual"
                if cause
                else (f"; it is {text}, and usual by a factor of 1000: check its unit and base")
            )
    shown = (
        f"{given:g}{unit}"
        if scale == 1
        else f"{given:g}{unit} on {bases[0]}, {value:.4g}{unit} on {bases[1]},"
    )
    text = f"{variable} = {shown} is outside of {wanted.low:g} to {wanted.high:g}{unit} ({wanted.why}){slip}"
    place = where or place_of(draft, component, variable)
    of_which = "the network" if component == draft.grid else variable  # its elements are alike
    kind = f"{of_which}, {wanted.why}: {slipped}"
    yield UnusualValue(f"{component}.{variable}", place, text, kind)
