"""One FMU by itself: opened, set, stepped and read."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import pandas as pd

from orchestrator.api.show import page
from orchestrator.api.values import plain
from orchestrator.binding.binding import bound_fmu
from orchestrator.cases.values import convert
from orchestrator.errors import InputError
from orchestrator.fmi.component import Component
from orchestrator.fmi.description import FmuDescription, VariableInfo
from orchestrator.fmi.instance import open_component


class Fmu:
    """A running FMU at its time 0, initialised with what it was given. `open_fmu` makes it; leaving ``with`` ends it.

    Attributes
    ----------
    description
        What it declares.
    time
        Where it stands [s].
    """

    def __init__(self, description: FmuDescription, values: Mapping[str, Any], stop: float | None) -> None:
        self.description = description
        self.time = 0.0
        start = self._converted(values)
        self._component: Component = open_component(description.model_name, description)
        try:
            self._component.set(start)
            self._component.setup(0.0, stop)
            self._component.enter_initialization_mode()
            self._component.exit_initialization_mode()
        except BaseException:
            self._component.close()
            raise

    def set(self, values: Mapping[str, Any]) -> None:
        """Set inputs and tunable parameters: numbers, truth values, or text with a unit such as ``"30 MW"``.

        Raises
        ------
        InputError
            If there is no such variable, or a value does not fit its type, unit or range.
        ComponentError
            If the FMU refuses.
        """
        self._component.set(self._converted(values))

    def get(self, name: str) -> float | bool:
        """The value of one variable.

        Raises
        ------
        InputError
            If there is no such variable.
        """
        return self.values([name])[name]

    def values(self, names: Iterable[str] | None = None) -> dict[str, float | bool]:
        """The values of several variables; of all outputs by default."""
        chosen = list(self.description.outputs if names is None else names)
        for name in chosen:
            self._variable(name)
        return self._component.values(chosen)

    def step(self, step_size: float) -> None:
        """One communication step [s].

        Raises
        ------
        ComponentError
            If the FMU refuses.
        """
        if not 0 < step_size < float("inf"):
            raise InputError(f"step_size = {step_size!r}; a communication step must be above 0 s and finite")
        self._component.step(self.time, step_size)
        self.time += step_size

    def close(self) -> None:
        """End it, and remove what was extracted for it."""
        self._component.close()

    def table(self) -> pd.DataFrame:
        """The variables that it declares: causality, type, unit, start value, range, description."""
        rows = {
            v.name: (v.causality, v.variability, v.type, v.unit, v.start, v.minimum, v.maximum, v.description)
            for v in self.description.variables.values()
        }
        columns = ["causality", "variability", "type", "unit", "start", "minimum", "maximum", "description"]
        return pd.DataFrame.from_dict(rows, orient="index", columns=columns)

    def _variable(self, name: str) -> VariableInfo:
        if name not in self.description.variables:
            raise InputError(f"{self.description.model_name}: there is no variable {name!r}; table() lists them")
        return self.description.variables[name]

    def _converted(self, values: Mapping[str, Any]) -> dict[str, float | bool]:
        """The values in the variables' own units."""
        try:
            return {name: convert(self._variable(name), value) for name, value in plain(values).items()}
        except ValueError as error:
            raise InputError(f"{self.description.model_name}: {error}") from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Fmu {self.description.model_name} at {self.time:.6g} s>"

    def _repr_html_(self) -> str:
        return page(
            f"{self.description.model_name}: {self.description.title}", [f"t = {self.time:.6g} s"], self.table()
        )


def open_fmu(
    path: str | Path,
    values: Mapping[str, Any] | None = None,
    *,
    binding: str | Path | None = None,
    stop: float | None = None,
) -> Fmu:
    """Open and initialise an FMU; use it in a ``with`` block. Foreign ones run in a process of their own.

    Parameters
    ----------
    path
        Of the FMU.
    values
        Start values of parameters and inputs.
    binding
        File that says what its variables mean; the FMU then has the names of our port.
    stop
        Time up to which it will be run [s], which some FMUs want to know.

    Raises
    ------
    InputError
        If the file cannot be used, or a value does not fit.
    ComponentError
        If the FMU does not start.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> with gfor.open_fmu(gfor.build("infinite_bus"), {"v_0": 1.0}) as fmu:
    ...     fmu.set({"dip.depth": 0.2})
    ...     for _ in range(1000):
    ...         fmu.step(1e-4)
    ...     print(f"{fmu.get('v'):.1f} pu after {fmu.time:.1f} s")
    0.8 pu after 0.1 s
    """
    return Fmu(bound_fmu(path, binding), values or {}, stop)
