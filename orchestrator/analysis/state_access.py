"""Reading and setting the continuous states of a running FMU, where the FMU allows it."""

from orchestrator.analysis.embedded_model import embedded_model
from orchestrator.arrays import Matrix
from orchestrator.errors import AnalysisError, ErrorKind
from orchestrator.fmi.component import Component, RealBatch

_MEASURE = (
    "`gfor modes CASE --black-box` identifies it from its inputs and outputs, and "
    "`gfor modes CASE --black-box --component {}` shows that in detail"
)


def obstacle(component: Component) -> str | None:
    """The reason why a component can neither be perturbed nor brings a linear model; None if it can be linearised."""
    description = component.description
    if not description.can_save_state:
        return (
            f"component {component.name!r}: its FMU cannot save and restore its state (canGetAndSetFMUstate), "
            f"so it cannot be perturbed and put back; {_MEASURE.format(component.name)}. (An export for linearisation "
            "needs both: canGetAndSetFMUstate, and continuous states that a master may set, declared under "
            "VendorAnnotations as fmus/toolchain/README.md has it)"
        )
    # An FMU may hide its states. Treated as an FMU without states, it would give wrong modes.
    if not description.states_are_settable and embedded_model(component) is None:
        return (
            f"component {component.name!r}: its FMU does not let a master set its continuous states, which "
            "linearisation by perturbation needs, and has no linear model inside; "
            f"{_MEASURE.format(component.name)}. (An FMU declares settable states under VendorAnnotations, as "
            "fmus/toolchain/README.md has it; `gfor fmu build --with-linear-model` packs a model of ours)"
        )
    return None


class StateAccess:
    """Reads and sets the continuous states of one component; those that cannot be set stay as they are."""

    def __init__(self, component: Component) -> None:
        if reason := obstacle(component):
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
