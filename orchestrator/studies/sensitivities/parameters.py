"""Which parameters of a running system a mode can be differentiated by."""

import fnmatch
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from orchestrator.cases.form.names import close_names
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo
from orchestrator.systems.coupling.master import Master

SHARE = 0.01  # part of a parameter for which effects "per percent" are given
_USUAL = 0.1  # part of a parameter that is about its usual step


@dataclass(frozen=True)
class Parameter:
    component: str
    variable: str
    unit: str  # as the FMU declares it; "1" for a plain number
    value: float  # at the operating point, in ``unit``
    # whether the FMU takes a change while it runs; a fixed one is set before the start only
    tunable: bool
    # minimum, maximum: declared bounds; None without
    minimum: float | None = None
    maximum: float | None = None

    @property
    def name(self) -> str:
        return f"{self.component}.{self.variable}"

    @property
    def scale(self) -> float:
        """Size that steps and percents are related to: |value|, or 1 of its unit where it is 0."""
        return abs(self.value) or 1.0

    @property
    def step(self) -> float:
        """A round step within the bounds: about a tenth of the value, or of 1 unit where it is 0."""
        step = round_step(_USUAL * self.scale)
        return step if self.allows(step) else -step

    def allows(self, change: float) -> bool:
        changed = self.value + change
        above = self.minimum is None or changed >= self.minimum
        return above and (self.maximum is None or changed <= self.maximum)


def round_step(size: float) -> float:
    """The number of 1, 2 or 5 times a power of ten that is nearest to a size above 0, in ratio."""
    power = math.floor(math.log10(size))
    near = (digit * 10.0**exponent for exponent in (power, power + 1) for digit in (1, 2, 5))
    return float(f"{min(near, key=lambda x: abs(math.log(x / size))):.1g}")


def parameters_of(
    master: Master, patterns: Sequence[str] = (), *, fixed: bool = False
) -> list[Parameter]:
    """The Real parameters of all components that are asked for.

    ``patterns``: names ``component.variable``, also with ``*``; fixed parameters that fit are taken too. Without
    patterns all tunable ones are taken.
    ``fixed``: without patterns, take the fixed ones as well."""
    descriptions = {name: running.description for name, running in master.components.items()}
    return parameters_in(
        descriptions,
        lambda name, variable: master.components[name].get([variable])[variable],
        patterns,
        fixed=fixed,
    )


def parameters_in(
    descriptions: Mapping[str, FmuDescription],
    value_of: Callable[[str, str], float],
    patterns: Sequence[str] = (),
    *,
    fixed: bool = False,
) -> list[Parameter]:
    """List parameters as `parameters_of` does, of components that need not run.

    ``value_of``: value of a component's variable, in its unit; asked for the chosen ones only."""
    everything = {
        f"{component}.{info.name}": (component, info)
        for component, description in descriptions.items()
        for info in description.variables.values()
        if info.causality == "parameter"
    }
    real = {name: found for name, found in everything.items() if found[1].type == "Real"}
    for pattern in patterns:
        _check_fits(pattern, everything, real)

    def is_chosen(name: str, info: VariableInfo) -> bool:
        if patterns:
            return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)
        return fixed or info.variability == "tunable"

    chosen = {name: found for name, found in real.items() if is_chosen(name, found[1])}
    return [
        _parameter(component, info, value_of(component, info.name))
        for component, info in chosen.values()
    ]


def _check_fits(
    pattern: str,
    everything: dict[str, tuple[str, VariableInfo]],
    real: dict[str, tuple[str, VariableInfo]],
) -> None:
    if any(fnmatch.fnmatchcase(name, pattern) for name in real):
        return
    for name, (_, info) in everything.items():
        if fnmatch.fnmatchcase(name, pattern):
            raise InputError(
                Option.PARAMETER
                + f" {pattern}: {name} is of type {info.type}, by which nothing can be "
                "differentiated; name a Real parameter"
            )
    hint = close_names(pattern, real, "`gfor fmu info` lists the parameters of an FMU")
    raise InputError(
        Option.PARAMETER + f" {pattern}: no component of the scenario has such a parameter; {hint}"
    )


def _parameter(component: str, info: VariableInfo, value: float) -> Parameter:
    tunable = info.variability == "tunable"
    return Parameter(
        component,
        info.name,
        unit=info.unit or "1",
        value=value,
        tunable=tunable,
        minimum=info.minimum,
        maximum=info.maximum,
    )
