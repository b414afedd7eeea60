"""Many communication steps of one FMU in one call, as ``many_steps.h`` has them for C."""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.devices.fmi.component import Component, RealBatch


class Steps(ctypes.Structure):
    _fields_ = (
        ("input_references", ctypes.c_void_p),
        ("output_references", ctypes.c_void_p),
        ("n_in", ctypes.c_int64),
        ("n_out", ctypes.c_int64),
        ("inputs", ctypes.c_void_p),
        ("late", ctypes.c_void_p),
        ("outputs", ctypes.c_void_p),
        ("index", ctypes.c_int64),
        ("count", ctypes.c_int64),
        ("step_size", ctypes.c_double),
    )


@dataclass
class StepRows:
    """Rows of so many steps, one below the other, for the variables of one component.

    ``inputs``: set before each step, shape (n, m); ``late``: set after it, before it is read, or None; ``outputs``: for
    what is read, shape (n, p); all contiguous."""

    component: Component
    names: tuple[Sequence[str], Sequence[str]]  # of the inputs and of the outputs
    inputs: Numbers
    outputs: Numbers
    late: Numbers | None = None

    def __post_init__(self) -> None:
        given = (self.inputs, self.outputs, self.late)
        if not all(one.flags.c_contiguous for one in given if one is not None):
            raise ValueError("rows that C reads or fills must be contiguous")
        rows = (np.zeros(len(names)) for names in self.names)
        pairs = zip(self.names, rows, strict=True)
        self._batches = [RealBatch(self.component, names, row) for names, row in pairs]

    def at(self, index: int, step_size: float) -> Steps:
        """The steps behind ``index`` others of ``step_size`` [s]; valid as long as these rows are."""
        (_, into, n_in, _), (_, out, n_out, _) = (one.arguments for one in self._batches)
        late = None if self.late is None else self.late.ctypes.data
        return Steps(
            input_references=into,
            output_references=out,
            n_in=n_in,
            n_out=n_out,
            inputs=self.inputs.ctypes.data,
            late=late,
            outputs=self.outputs.ctypes.data,
            index=index,
            count=len(self.inputs),
            step_size=step_size,
        )
