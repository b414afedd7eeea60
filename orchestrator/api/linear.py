"""Linear models with names: those of a scenario, and those that FMUs carry."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from orchestrator.analysis.stability import Stability
from orchestrator.analysis.state_space import StateSpace
from orchestrator.analysis.state_space import read_linear_model as read_state_space
from orchestrator.analysis.steady_state import OperatingPoint
from orchestrator.asked import path as path_of
from orchestrator.errors import InputError
from orchestrator.late import pd, signal
from orchestrator.report.notebook import page

UNKNOWN = OperatingPoint(math.nan, math.nan, math.nan, 0, {})
"""That of a model which was read from an FMU."""

NOT_JUDGED = Stability(None, reason="the model is that of one FMU by itself")


@dataclass(frozen=True, repr=False)
class LinearSystem(StateSpace):
    """x⁺ = A·x + B·u and y = C·x + D·u in deviations from an operating point. `Scenario.linearize` makes it.

    Attributes
    ----------
    operating_point
        Where the model holds.
    stability
        The verdict on the model.
    warnings
        What is to be borne in mind of it.
    """

    operating_point: OperatingPoint = UNKNOWN
    stability: Stability = NOT_JUDGED
    warnings: tuple[str, ...] = ()

    def table(self, matrix: str) -> pd.DataFrame:
        """One of the matrices ``"A"``, ``"B"``, ``"C"``, ``"D"`` with the names of its rows and columns.

        Examples
        --------
        >>> import orchestrator as gfor
        >>> scenario = gfor.load("infinite_bus").scenario("load_step")
        >>> model = scenario.linearize(["gfor.droop.delta_P_ref"], ["gfor.omega"])
        >>> model.table("C").index.tolist()
        ['gfor.omega']
        """
        rows_and_columns = {
            "A": (self.states, self.states),
            "B": (self.states, self.inputs),
            "C": (self.outputs, self.states),
            "D": (self.outputs, self.inputs),
        }
        if not isinstance(matrix, str) or matrix not in rows_and_columns:
            raise InputError(f"there is no matrix {matrix!r}; there are A, B, C and D")
        rows, columns = rows_and_columns[matrix]
        return pd.DataFrame(getattr(self, matrix), index=list(rows), columns=list(columns))

    def to_scipy(self) -> signal.StateSpace:
        """The model as `scipy.signal.StateSpace`; of a step map with its step ``dt`` [s].

        For the design of a controller linearise with ``continuous=True``."""
        step = {} if self.step_size is None else {"dt": self.step_size}
        return signal.StateSpace(self.A, self.B, self.C, self.D, **step)

    def to_control(self) -> Any:
        """The model as a `StateSpace` of python-control, with the names of states, inputs and outputs.

        What that package does not take in a name becomes ``_``: ``gfor.omega`` is ``gfor_omega``."""
        try:
            control = import_module("control")
        except ImportError as error:
            raise InputError(
                "the package control is missing; install it with `pip install control`"
            ) from error
        kinds = ("states", "inputs", "outputs")
        names = {
            kind: [re.sub(r"\W+", "_", name) for name in getattr(self, kind)] for kind in kinds
        }
        return control.ss(self.A, self.B, self.C, self.D, self.step_size or 0, **names)

    def __repr__(self) -> str:
        kind = "continuous" if self.step_size is None else f"step map of {self.step_size:g} s"
        size = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<LinearSystem: {kind}, {size}>"

    def _repr_html_(self) -> str:
        lines = [self.stability.sentence(), *(f"warning: {text}" for text in self.warnings)]
        lines += [f"inputs: {', '.join(self.inputs)}", f"outputs: {', '.join(self.outputs)}"]
        return page(repr(self).strip("<>"), lines, self.table("A"))


def read_linear_model(fmu: str | Path) -> LinearSystem:
    """The continuous linear model that an FMU carries (``gfor fmu build --with-linear-model``).

    Raises
    ------
    InputError
        If the file is no FMU, or has no linear model inside.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> try:
    ...     gfor.read_linear_model("missing.fmu")
    ... except gfor.CosimError as error:
    ...     print("no model:", type(error).__name__)
    no model: FmuFileError
    """
    return LinearSystem(**vars(read_state_space(path_of(fmu, "fmu"))))
