"""One FMU by itself: what it declares; opened, set, stepped and read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NoReturn, Self

import pandas as pd

from orchestrator.cases.form.given import Time, binding_path, in_seconds, plain
from orchestrator.cases.form.values import convert
from orchestrator.core.asked import Names
from orchestrator.core.asked import names as names_given
from orchestrator.core.asked import path as path_of
from orchestrator.core.attributes import Unchanged
from orchestrator.core.closing import Closing
from orchestrator.core.errors import InputError
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.devices.fmi.component import Component
from orchestrator.devices.fmi.description import FmuDescription, VariableInfo, read_declared
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.fmi.linear_model import EmbeddedModel, read_embedded_model
from orchestrator.output.report.notebook import page

_COLUMNS = (
    *("causality", "variability", "type", "unit"),
    *("start", "minimum", "maximum", "description"),
)
"""Columns of a table of variables: fields of `VariableInfo`."""


class Fmu(Unchanged, Closing):
    """A running FMU at its time 0, initialised with what it was given. `open_fmu` makes it; leaving ``with`` ends it.

    Attributes
    ----------
    description
        What it declares.
    """

    _own = frozenset({"description"})
    _instead = "set({…}) gives its variables values"

    def __init__(
        self, description: FmuDescription, values: Mapping[str, Any], stop: float | None
    ) -> None:
        self.description = description
        self._time = 0.0
        start = self._converted(values)
        component: Component = open_component(description.model_name, description)
        try:
            component.setup(0.0, stop)
            component.set(start)
            component.enter_initialization_mode()
            component.exit_initialization_mode()
        except BaseException:
            component.close()
            raise
        self._component: Component | None = component

    @property
    def time(self) -> float:
        """The time [s] that it has come to."""
        return self._time

    def set(self, values: Mapping[str, Any]) -> None:
        """Set inputs and tunable parameters: numbers, truth values, or text with a unit such as ``"30 MW"``.

        Raises
        ------
        InputError
            If there is no such variable, a value does not fit its type, unit or range, or the FMU was closed.
        ComponentError
            If the FMU refuses.
        """
        self._open().set(self._converted(values))

    def get(self, name: str) -> float | bool:
        """The value of one variable.

        Raises
        ------
        InputError
            If there is no such variable, or the FMU was closed.
        """
        self._variable(name)
        return self.values([name])[name]

    def values(self, names: Names | None = None) -> dict[str, float | bool]:
        """The values of several variables; of all outputs by default.

        Raises
        ------
        InputError
            If there is no such variable, or the FMU was closed.
        """
        component = self._open()
        chosen = self.description.outputs if names is None else names_given(names, "names")
        for name in chosen:
            self._variable(name)
        return component.values(list(chosen))

    def step(self, step_size: Time) -> None:
        """One communication step [s], or text with a unit such as ``"1 ms"``.

        Raises
        ------
        InputError
            If the step is no time above 0, or the FMU was closed.
        ComponentError
            If the FMU refuses.
        """
        component = self._open()
        seconds = in_seconds(step_size, "step_size")
        if seconds is None:
            raise InputError(
                "step_size = None; give a communication step above 0 s, such as 1e-4 or '100 us'"
            )
        component.step(self._time, seconds)
        self._time += seconds

    def close(self) -> None:
        """End it, and remove what was extracted for it; a second call does nothing."""
        component, self._component = self._component, None
        if component is not None:
            component.close()

    def _open(self) -> Component:
        """The running FMU. A call into one that was closed would end the whole interpreter."""
        if self._component is None:
            raise InputError(
                f"{self.description.model_name}: this FMU was closed; open it again with open_fmu, and use it within "
                "its 'with' block"
            )
        return self._component

    def table(self) -> pd.DataFrame:
        """The variables that it declares: causality, type, unit, start value, range, description."""
        return _variables(self.description)

    def _variable(self, name: str) -> VariableInfo:
        if not isinstance(name, str) or name not in self.description.variables:
            raise InputError(
                f"{self.description.model_name}: there is no variable {name!r}; table() lists them"
            )
        return self.description.variables[name]

    def _converted(self, values: Mapping[str, Any]) -> dict[str, float | bool]:
        try:
            return {
                name: convert(self._variable(name), value) for name, value in plain(values).items()
            }
        except ValueError as error:
            raise InputError(f"{self.description.model_name}: {error}") from error

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        raise InputError(
            f"{self.description.model_name}: a running FMU has no copy, and goes to no other process; open it again "
            "with open_fmu"
        )

    def __enter__(self) -> Self:
        self._open()
        return self

    def __repr__(self) -> str:
        return f"<Fmu {self.description.model_name} at {self.time:.6g} s>"

    def _repr_html_(self) -> str:
        return page(
            f"{self.description.model_name}: {self.description.title}",
            [f"t = {self.time:.6g} s"],
            self.table(),
        )


def open_fmu(
    path: str | Path,
    values: Mapping[str, Any] | None = None,
    *,
    binding: str | Path | None = None,
    stop: Time | None = None,
) -> Fmu:
    """Open and initialise an FMU; use it in a ``with`` block. Foreign ones run in a process of their own.

    Parameters
    ----------
    path
        The FMU's file.
    values
        Start values of parameters and inputs.
    binding
        File that says what the FMU's variables mean; its inputs and outputs then have the names of our port.
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
    return Fmu(
        bound_fmu(path_of(path, "path"), binding_path(binding)),
        values or {},
        in_seconds(stop, "stop"),
    )


class FmuInfo:
    """Declarations of an FMU. `info` makes it.

    Attributes
    ----------
    description
        The FMU's own description: names, platforms, abilities, variables.
    linear_model
        The linear model that the file carries; None where it carries no model.
    """

    def __init__(self, description: FmuDescription, linear_model: EmbeddedModel | None) -> None:
        self.description, self.linear_model = description, linear_model

    def table(self) -> pd.DataFrame:
        """One row for every variable: causality, type, unit, start value, range, description."""
        return _variables(self.description)

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor fmu info --json`` prints, as JSON's types."""
        d = self.description
        keys = ("name", "type", *(column for column in _COLUMNS if column != "type"))
        return {
            "model_name": d.model_name,
            "title": d.title,
            "guid": d.guid,
            "generation_tool": d.generation_tool,
            "fmi_version": d.fmi_version,
            "platforms": list(d.platforms),
            "continuous_states": list(d.states),
            "states_are_settable": d.states_are_settable,
            "can_save_state": d.can_save_state,
            "has_linear_model": self.linear_model is not None,
            "variables": [{key: getattr(v, key) for key in keys} for v in d.variables.values()],
        }

    def __repr__(self) -> str:
        d = self.description
        return f"<FmuInfo of {d.model_name}: FMI {d.fmi_version}, {len(d.variables)} variables>"

    def _repr_html_(self) -> str:
        return page(f"{self.description.model_name}: {self.description.title}", table=self.table())


def info(path: str | Path) -> FmuInfo:
    """Read what an FMU declares, for whatever platform.

    Nothing in the file is executed, but for a vendor's DLL, in a process of its own.

    Raises
    ------
    InputError
        If the file cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> found = gfor.info(gfor.build("infinite_bus"))
    >>> found.description.fmi_version
    '2.0'
    >>> found.table().loc["v", ["causality", "unit"]].to_list()
    ['output', 'pu']
    """
    file = path_of(path, "path")
    described = read_declared(file)
    return FmuInfo(described, read_embedded_model(described.path))


def _variables(description: FmuDescription) -> pd.DataFrame:
    """The variables that an FMU declares, one row for each."""
    rows = {
        variable.name: [getattr(variable, column) for column in _COLUMNS]
        for variable in description.variables.values()
    }
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(_COLUMNS))
