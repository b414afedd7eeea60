"""∂λ/∂p of all modes that are shown, by one parameter: what moves the map while a slider is dragged."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from orchestrator.api.results import Modes
from orchestrator.api.scenario import Scenario
from orchestrator.arrays import Complex
from orchestrator.cases.schema import Value
from orchestrator.errors import InputError

_CHANGE = 2e-3
"""Of the parameter, in parts of its value, or of 1 where that is 0."""

_FAR = 0.05
"""An eigenvalue that moves by more than this part of itself is no longer known to be the same."""

_WIDER = 1.5  # the range in which changed modes are looked for, beyond that which is shown


def slopes(
    scenario_with: Callable[[Mapping[str, Value]], Scenario], values: Mapping[str, Value], parameter: str,
    frequencies: tuple[float, float], say: Callable[[str], None],
) -> dict[str, Any]:  # fmt: skip
    """``value``, ``eigenvalues`` there, and ``slopes``, each a list of [real, imag]; None where no slope is known.

    The operating point moves with the parameter, and the FMUs are started and linearised at both sides of its value."""
    here = scenario_with(values)
    component, _, variable = parameter.partition(".")
    plan = here.prepared.system.components.get(component)
    if plan is None or variable not in plan.description.variables:
        raise InputError(f"there is no parameter {parameter!r} in scenario {here.name!r}")
    info, value = plan.description.variables[variable], plan.value(variable)
    if info.type != "Real" or isinstance(value, str | bool) or value is None:
        raise InputError(f"{parameter} is of type {info.type}, by which nothing can be differentiated")
    change = _CHANGE * (abs(value) or 1.0)
    least, most = (-np.inf if info.minimum is None else info.minimum, np.inf if info.maximum is None else info.maximum)
    ends = [min(max(end, least), most) for end in (value - change, value + change)]
    say("modes at the value itself")
    base = eigenvalues(here.modes(frequencies))
    wider = (frequencies[0] / _WIDER, frequencies[1] * _WIDER)
    say(f"modes at both sides of {parameter} = {value:.5g}")
    moved = [matched(base, eigenvalues(scenario_with({**values, parameter: end}).modes(wider))) for end in ends]
    width = ends[1] - ends[0]
    found = (moved[1] - moved[0]) / width if width > 0 else np.full(base.shape, np.nan + 0j)
    return {
        "parameter": parameter,
        "value": value,
        "eigenvalues": [[x.real, x.imag] for x in base.tolist()],
        "slopes": [[x.real, x.imag] if np.isfinite(x) else None for x in found.tolist()],
    }


def eigenvalues(modes: Modes) -> Complex:
    return np.array([mode.eigenvalue for mode in modes], dtype=np.complex128)


def matched(base: Complex, other: Complex) -> Complex:
    """Of each eigenvalue, the one that it moved to; nan where none is near."""
    found = np.full(base.shape, np.nan + 0j)
    if base.size and other.size:
        apart = np.abs(base[:, None] - other[None]) / np.maximum(np.abs(base[:, None]), 1e-9)
        rows, columns = linear_sum_assignment(apart)
        near = apart[rows, columns] < _FAR
        found[rows[near]] = other[columns[near]]
    return found
