"""Check that what was kept of a run has the form of the run that is to go on from it."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from orchestrator.core.errors import NotTakenUpError
from orchestrator.systems.coupling.run_state import RunState
from orchestrator.systems.coupling.stepping import Stepper


@contextmanager
def of_this_run(kept: RunState | None) -> Iterator[None]:
    """Take the error of an array of an unexpected form for what it is: this run cannot go on from a checkpoint."""
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError, OverflowError) as error:
        if kept is None:
            raise
        raise NotTakenUpError("the run", f"what was kept is of another form: {error}") from error


def check_form(stepper: Stepper, kept: RunState, stop: int) -> None:
    """Raise a `NotTakenUpError` unless what was kept has the shapes of this run, and holds numbers.

    ``stop``: communication point at which the run ends."""
    outputs = stepper.y.shape
    wanted = {
        "y": (kept.y, (outputs,)),
        "tracks": (kept.tracks, (stepper.tracks.saved().shape,)),
        "before": (kept.before, ((0,), outputs)),
        "spent": (kept.spent, ((len(stepper.seconds()),),)),
    }
    for name, (values, shapes) in wanted.items():
        if values.shape not in shapes or values.dtype.kind != "f":
            said = f"{values.dtype} of shape {values.shape}, and this run's has {shapes[-1]}"
            raise NotTakenUpError("the run", f"{name} was kept as {said}")
    arrived = [
        (f"{name} of a connection", bank[name])
        for bank in kept.wires
        for name in ("rings", "delivered")
        if name in bank
    ]
    for name, values in [("y", kept.y), ("tracks", kept.tracks), ("before", kept.before), *arrived]:
        if not np.isfinite(values).all():
            raise NotTakenUpError("the run", f"{name} was kept with what is no finite number")
    if not 0 <= kept.index <= stop:
        raise NotTakenUpError("the run", f"it was kept at step {kept.index} of {stop}")
