"""A run as it is kept at one communication point, and taken up again to the last bit."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from orchestrator.coupling.observers import Observer
from orchestrator.coupling.run_state import Resumable, RunState, set_state, state_as_bytes
from orchestrator.coupling.stepping import Stepper
from orchestrator.errors import ComponentError, NotTakenUpError


def state_of(
    stepper: Stepper, observers: Iterable[Observer], components: Mapping[str, bytes] | None, applied: bool,
    seconds: float, spent: NDArray[np.float64],
) -> RunState:  # fmt: skip
    """All that another process needs to go on from here."""
    if components is None:
        components = {name: state_as_bytes(component) for name, component in stepper.components.items()}
    return RunState(
        index=stepper.index, applied=applied, handed_over=stepper.handed_over, seconds=seconds, spent=spent,
        y=stepper.y.copy(), tracks=stepper.tracks.saved(),
        before=np.empty(0) if stepper.before is None else stepper.before.copy(), components=components,
        observers=[observer.position() for observer in observers if isinstance(observer, Resumable)],
        wires=stepper.wires.state(),
    )  # fmt: skip


def take_up(stepper: Stepper, kept: RunState) -> None:
    """Go to where another run of the same system was."""
    for name, content in kept.components.items():
        try:
            set_state(stepper.components[name], content)
        except ComponentError as error:
            raise NotTakenUpError(name, str(error)) from error
    stepper.index, stepper.handed_over = kept.index, kept.handed_over
    if kept.components and not kept.handed_over:  # then inputs are newer than outputs
        _compare_outputs(stepper, kept)
    stepper.y[:] = kept.y
    stepper.wires.restore(kept.wires)
    stepper.tracks.restore(kept.tracks)
    stepper.before = kept.before if len(kept.before) else None


def _compare_outputs(stepper: Stepper, kept: RunState) -> None:
    """A component that was brought back must give the outputs that it gave before, to the last bit."""
    for name, exchange in stepper.exchanges.items():
        was = kept.y[exchange.window]
        now = exchange.outputs.read()
        for variable, a, b in zip(exchange.outputs.names, was.tolist(), now.tolist(), strict=True):
            if a != b:
                raise NotTakenUpError(name, f"{variable} was {a!r} and is {b!r}")
