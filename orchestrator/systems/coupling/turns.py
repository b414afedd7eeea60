"""Parts that the inner loop steps, and what it offers: the forms that the loop in C and the one in Python share."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.errors import NotFiniteError
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.systems.coupling.wire_bank import WireBank, WireValues


class Exchange:
    """The coupled inputs and outputs of one component.

    ``inputs``, ``outputs``: Batches of the connected variables. The outputs' values are a window of the system's vector
    y.
    ``sources``: For each input the index in y of the output that feeds it.
    ``delivered``: The index of what arrives at each input: the same, or behind the outputs the place of what a
    connection makes of it (`orchestrator.systems.coupling.imperfect_wires`)."""

    def __init__(
        self,
        component: Component,
        inputs: RealBatch,
        outputs: RealBatch,
        window: slice,
        sources: NDArray[np.int64],
    ) -> None:
        self.component, self.inputs, self.outputs = component, inputs, outputs
        self.window, self.sources, self.delivered = window, sources, sources

    @property
    def follows_directly(self) -> bool:
        """Return whether an output depends on a connected input directly, or the FMU does not say."""
        fed = set(self.inputs.names)
        return any(
            fed.intersection(self.component.description.feedthrough(name))
            for name in self.outputs.names
        )


Turn = Exchange | WireBank


class Loop(Protocol):
    def advance(self, index: int, count: int, step_size: float) -> None:
        """Do communication steps.

        Raises a `ComponentError` if a call fails; ``completed`` tells how many steps were done before.
        Raises a `NotFiniteError` if a step gives an output that is no finite number."""

    completed: int  # communication steps that the last call did
    # the outputs one step earlier, where inputs are extrapolated; else None
    before: NDArray[np.float64] | None

    def seconds(self) -> list[float]:
        """Time spent inside each component's FMI calls [s], in the order of the schedule."""

    @property
    def threads(self) -> int:
        """How many threads have stepped it."""

    def close(self) -> None:
        """End the threads that were started for it."""


def not_finite(outputs: RealBatch | WireValues, index: int, time: float) -> NotFiniteError:
    return NotFiniteError(
        outputs.component.name, outputs.names[index], float(outputs.values[index]), time
    )
