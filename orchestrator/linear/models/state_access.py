"""Reading and setting the continuous states of a running FMU, where the FMU allows it.

Where it does not, the linear model inside it may take the place of perturbation. That holds at one operating point and
for one set of parameters, so both are compared with the running FMU before it is used."""

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError, ErrorKind
from orchestrator.core.options import Option, command
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.devices.fmi.converted_component import ConvertedDescription
from orchestrator.devices.fmi.linear_model import EmbeddedModel, read_embedded_model
from orchestrator.devices.fmi.port_mapping import BoundDescription

# largest difference of a variable from the model's operating point, relative to max(1, |value|)
_TOLERANCE = 1e-6


def embedded_model(component: Component) -> EmbeddedModel | None:
    """The model inside a component's FMU; None if the component can be perturbed, or its FMU has no model inside."""
    description = component.description
    if description.states_are_settable or isinstance(
        description, BoundDescription | ConvertedDescription
    ):  # it has the FMU's own names
        return None
    return read_embedded_model(description.path)


def check_operating_point(component: Component, model: EmbeddedModel) -> None:
    """Compare a running FMU with the operating point and the parameters of the model inside it."""
    where = f"component {component.name!r}: the linear model inside its FMU"
    if tuple(model.states) != component.description.states:
        raise AnalysisError(
            f"{where} has other states than the FMU; build the FMU again with its model"
        )
    variables = component.description.variables
    expected = {**model.states, **model.inputs, **model.outputs, **_parameters(component, model)}
    unknown = [name for name in expected if name not in variables]
    if unknown:
        raise AnalysisError(
            f"{where} speaks of {unknown[0]!r}, which the FMU does not have; build both together"
        )
    found = component.values(expected)
    far = {
        name: abs(found[name] - value) / max(1.0, abs(value)) for name, value in expected.items()
    }
    worst = max(far, key=lambda name: far[name], default=None)
    if worst is not None and not far[worst] <= _TOLERANCE:
        raise AnalysisError(
            f"{where} is of another operating point: {worst} is {found[worst]:.9g}, but {expected[worst]:.9g} there; "
            "build an FMU with the model of this case and scenario"
        )


def _parameters(component: Component, model: EmbeddedModel) -> dict[str, float | bool]:
    """Required value of every parameter of the FMU: the model's value, or the parameter's start value."""
    variables = component.description.variables
    starts = {
        name: start
        for name in component.description.parameters
        if (start := variables[name].start) is not None and not isinstance(start, str)
    }
    return starts | model.parameters


def _measure(name: str) -> str:
    """Return the ways to a linear model of a component that is only measured."""
    return (
        command("modes CASE", Option.BLACK_BOX)
        + " identifies it from its inputs and outputs, and "
        + command("modes CASE", Option.BLACK_BOX, (Option.COMPONENT, name))
        + " shows that in detail"
    )


def obstacle(component: Component) -> str | None:
    """The reason why a component can neither be perturbed nor brings a linear model; None if it can be linearised."""
    description = component.description
    if not description.can_save_state:
        return (
            f"component {component.name!r}: its FMU cannot save and restore its state (canGetAndSetFMUstate), "
            "so it cannot be perturbed and put back; "
            + _measure(component.name)
            + ". (An export for linearisation needs both: canGetAndSetFMUstate, and continuous states "
            "that a master may set, declared under VendorAnnotations as fmus/toolchain/README.md has it)"
        )
    # An FMU may hide its states. Treated as an FMU without states, it would give wrong modes.
    if not description.states_are_settable and embedded_model(component) is None:
        return (
            f"component {component.name!r}: its FMU does not let a master set its "
            "continuous states, which linearisation by perturbation needs, and has no "
            "linear model inside; "
            + _measure(component.name)
            + ". (An FMU declares settable states under VendorAnnotations, as fmus/toolchain/README.md has "
            "it; " + command("fmu build", Option.WITH_LINEAR_MODEL) + " packs a model of ours)"
        )
    return None


class StateAccess:
    """Reads and sets the continuous states of one component; those that cannot be set stay as they are."""

    def __init__(self, component: Component) -> None:
        reason = obstacle(component)
        if reason:
            raise AnalysisError(reason, kind=ErrorKind.HIDDEN_STATES)
        self._settable = component.description.states_are_settable
        self.batch = RealBatch(component, component.description.states)
        self._buffer = RealBatch(component, component.description.states)

    def read(self) -> Matrix:
        return self.batch.read().copy()

    def write(self, values: Matrix) -> None:
        if self._settable:
            self._buffer.values[:] = values
            self._buffer.write()
