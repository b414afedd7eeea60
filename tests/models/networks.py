"""Networks as FMUs, stepped with given currents: for tests of elements."""

import numpy as np
import pytest

from fmus.toolchain.exporter import cached
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent

STEP = 1e-4


def stepped(model, inputs, seconds, watched, values=None, changes=None, step=STEP, native=True):
    """Rows of the watched variables after every step, the start first.

    Parameters
    ----------
    model
        The network's model.
    inputs
        Values by name, held; or a function of the step's start [s] that gives them.
    seconds, step
        Length of the run, and of a communication step.
    watched
        Names.
    values
        Parameters before the start.
    changes
        Step's index → tunable parameters set before it.
    native
        Whether the FMU is native or Python-backed.
    """
    given = inputs if callable(inputs) else lambda t: inputs
    path = cached((NativeFmu if native else PythonFmu)(model))
    with LoadedComponent("grid", read_description(path)) as grid:
        grid.set(values or {})
        grid.setup(0.0, None)
        grid.enter_initialization_mode()
        grid.set(given(0.0))
        grid.exit_initialization_mode()
        rows = [list(grid.get(list(watched)).values())]
        for k in range(round(seconds / step)):
            grid.set(given(k * step) | (changes or {}).get(k, {}))
            grid.step(k * step, step)
            rows.append(list(grid.get(list(watched)).values()))
    return np.array(rows)


def phasors(rows, watched, *names):
    """Complex columns ``<name>_re + j·<name>_im`` of stepped rows."""
    at = list(watched).index
    return [rows[:, at(f"{name}_re")] + 1j * rows[:, at(f"{name}_im")] for name in names]


def are_the_same(one, other, model):
    """To the last bit; rows of a phasor network, which only one of two FMUs solves as data, to rounding."""
    return (
        np.array_equal(one, other)
        if model.nodal is None
        else one == pytest.approx(other, rel=1e-12, abs=1e-12)
    )
