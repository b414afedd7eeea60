"""A system on paper: components, the connections between them, and what their variables start from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from orchestrator.core.errors import InputError
from orchestrator.devices.fmi.values import Scalar
from orchestrator.systems.coupling.connections import (
    Connection,
    Endpoint,
    check_direction,
    check_type,
    check_unit,
)
from orchestrator.systems.coupling.imperfections import Imperfection, WirePlan

if TYPE_CHECKING:
    from orchestrator.devices.fmi.description import FmuDescription, VariableInfo


# types of inputs that nobody can feed or give a value here
_KEPT = ("String", "Binary")


@dataclass
class ComponentPlan:
    """An FMU and the values it is given before initialisation; ``isolated`` as in `open_component`."""

    description: FmuDescription
    parameters: dict[str, float | bool] = field(default_factory=dict)
    inputs: dict[str, float] = field(default_factory=dict)
    isolated: bool | None = None

    @property
    def has_port(self) -> bool:
        """Return whether it takes the voltage of its bus and gives its current."""
        return {"v_re", "v_im"} <= {*self.description.inputs} and {"i_re", "i_im"} <= {
            *self.description.outputs
        }

    @property
    def kind(self) -> str:
        """The model's declaration; a device's port without one is a converter's."""
        return self.description.kind or ("converter" if self.has_port else "")

    @property
    def is_of_phasors(self) -> bool:
        """Return whether it is a network that devices give emfs to: one of phasors."""
        return any(name.endswith(".e_re") for name in self.description.inputs)

    def value(self, name: str) -> Scalar | None:
        """The value of a parameter or an input, else its start value; None without both."""
        info = self.description.variables.get(name)
        if info is None:
            raise InputError(
                f"{self.description.model_name} has no variable {name!r}; `gfor fmu info` lists them"
            )
        return self.parameters.get(name, self.inputs.get(name, info.start))

    def number(self, name: str) -> float:
        """The same as a number: 1 or 0 of a switch, 0 where there is neither or it is text."""
        value = self.value(name)
        return 0.0 if value is None or isinstance(value, str) else float(value)


class System:
    """Components by name, with checked connections.

    ``wires``: Connections that do more than carry a value, or may in a run, by their target."""

    def __init__(self) -> None:
        self.components: dict[str, ComponentPlan] = {}
        self.connections: list[Connection] = []
        self.wires: dict[Endpoint, WirePlan] = {}
        self._counted: list[Connection] | None = None
        self._feeding: dict[Endpoint, Endpoint] = {}

    def add(
        self,
        name: str,
        description: FmuDescription,
        parameters: Mapping[str, float | bool] | None = None,
        inputs: Mapping[str, float] | None = None,
        *,
        isolated: bool | None = None,
    ) -> None:
        """Add a component; ``inputs``: constants for inputs that nothing feeds.

        ``isolated``: whether it runs in a process of its own; by default all but our own FMUs do."""
        if name in self.components:
            raise InputError(
                f"component {name!r} is added twice; give each instance a name of its own"
            )
        self.components[name] = ComponentPlan(
            description, dict(parameters or {}), dict(inputs or {}), isolated
        )

    def connect(
        self,
        source: str,
        target: str,
        *,
        ignore_units: bool = False,
        converted: tuple[float, float] | None = None,
    ) -> None:
        """Connect an output to an input, both written ``component.variable``.

        ``ignore_units``: take the value as it is, in whatever unit.
        ``converted``: factor and offset by which the value is converted on its way."""
        label = f"connection {source} → {target}"
        start, out = self._resolve(source, label)
        end, into = self._resolve(target, label)
        connection = Connection(start, end)
        check_direction(connection, out, into)
        kinds = self._declared_type(start), self._declared_type(end)
        check_type(connection, kinds)
        if not ignore_units and converted is None:
            check_unit(connection, out, into)
        feeding = self._sources().get(end)
        if feeding is not None:
            raise InputError(
                f"{label}: {target} is already fed by {feeding}; an input takes one connection"
            )
        if kinds[0] != "Real":
            self._carry(start, 1.0, 0.0, "")
        factor, offset = converted or (1.0, 0.0)
        if kinds[1] != "Real" or (factor, offset) != (1.0, 0.0):
            self._carry(end, factor, offset, out.unit)
        self.connections.append(connection)
        self._feeding[end] = start

    def _declared_type(self, end: Endpoint) -> str:
        """The type that the FMU itself declares for a variable."""
        from orchestrator.devices.fmi.converted_component import native  # noqa: PLC0415 - imports FMPy

        return native(self.components[end.component].description).variables[end.variable].type

    def _carry(self, end: Endpoint, factor: float, offset: float, unit: str) -> None:
        """Have a component take or give a variable as the number, in this unit, that its connection carries."""
        from orchestrator.devices.fmi.converted_component import (  # noqa: PLC0415 - as above
            Conversion,
            ConvertedDescription,
        )

        plan, conversion = self.components[end.component], Conversion(factor, offset, unit)
        plan.description = ConvertedDescription.of(plan.description, end.variable, conversion)

    def _sources(self) -> dict[Endpoint, Endpoint]:
        """The source of each connected input; collected anew where the list of connections was changed from outside."""
        if self._counted is not self.connections or len(self._feeding) != len(self.connections):
            self._counted = self.connections
            self._feeding = {c.target: c.source for c in reversed(self.connections)}
        return self._feeding

    def disturb(self, connection: Connection, imperfection: Imperfection) -> None:
        self._wire(connection).disturb(imperfection)

    def foresee(self, connection: Connection, imperfection: Imperfection) -> None:
        later = self._wire(connection).later
        if imperfection not in later:
            later.append(imperfection)

    def _wire(self, connection: Connection) -> WirePlan:
        if connection not in self.connections:
            raise InputError(
                f"there is no connection {connection}; connect it before it is disturbed"
            )
        return self.wires.setdefault(connection.target, WirePlan(str(connection)))

    def _resolve(self, name: str, label: str) -> tuple[Endpoint, VariableInfo]:
        component, _, variable = name.partition(".")
        if component not in self.components:
            known = ", ".join(self.components) or "none"
            raise InputError(f"{label}: there is no component {component!r}; components: {known}")
        info = self.components[component].description.variables.get(variable)
        if info is None:
            raise InputError(
                f"{label}: component {component!r} has no variable {variable!r}; `gfor fmu info` lists them"
            )
        return Endpoint(component, variable), info

    def unconnected_inputs(self) -> Iterator[Endpoint]:
        """Inputs that nothing feeds; those of text and of bytes keep their start values."""
        fed = {c.target for c in self.connections}
        for name, plan in self.components.items():
            for variable in plan.description.inputs:
                endpoint = Endpoint(name, variable)
                if plan.description.variables[variable].type in _KEPT:
                    continue
                if endpoint not in fed and variable not in plan.inputs:
                    yield endpoint
