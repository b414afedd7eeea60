"""Linear models with names: those of a scenario, and those that FMUs carry."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from orchestrator.core.asked import flag
from orchestrator.core.asked import path as path_of
from orchestrator.core.attributes import KnownNames
from orchestrator.core.errors import InputError
from orchestrator.core.late import pd, signal
from orchestrator.linear.models.state_space import StateSpace
from orchestrator.linear.models.state_space import read_linear_model as read_state_space
from orchestrator.linear.models.steady_state import OperatingPoint
from orchestrator.linear.spectra.stability import Stability
from orchestrator.output.report.notebook import headline, page

_MATRICES = ("A", "B", "C", "D")

UNKNOWN = OperatingPoint(math.nan, math.nan, math.nan, 0, {})
"""That of a model which was read from an FMU."""

NOT_JUDGED = Stability(None, reason="the model is that of one FMU by itself")


@dataclass(frozen=True, repr=False, eq=False)
class LinearSystem(KnownNames, StateSpace):
    """x⁺ = A·x + B·u and y = C·x + D·u in deviations from an operating point. `Scenario.linearize` makes it.

    Attributes
    ----------
    operating_point
        Where the model holds.
    stability
        The verdict on the model.
    warnings
        What is to be borne in mind of it.
    continuous_form
        Of a step map, what makes the continuous model of the same system; None if there is none.
    """

    operating_point: OperatingPoint = UNKNOWN
    stability: Stability = NOT_JUDGED
    warnings: tuple[str, ...] = ()
    continuous_form: Callable[[], LinearSystem] | None = field(default=None, compare=False)

    _elsewhere: ClassVar[Mapping[str, str]] = {
        "poles": "numpy.linalg.eigvals(model.continuous().A)"
    }

    def __post_init__(self) -> None:
        """Protect the matrices, which the verdict is of."""
        for name in _MATRICES:
            shown = np.asarray(getattr(self, name)).view()
            shown.flags.writeable = False
            object.__setattr__(self, name, shown)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, LinearSystem):
            return NotImplemented
        named = ("states", "inputs", "outputs", "step_size")
        return all(getattr(self, one) == getattr(other, one) for one in named) and all(
            np.array_equal(getattr(self, one), getattr(other, one)) for one in _MATRICES
        )

    __hash__ = None  # type: ignore[assignment]  # its matrices have none

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

    def continuous(self) -> LinearSystem:
        """ẋ = A·x + B·u of the same system: what a controller is designed for.

        Raises
        ------
        InputError
            If there is the step map alone, as with components that were identified.
        """
        if self.step_size is None:
            return self
        if self.continuous_form is None:
            raise InputError(
                "there is the step map alone, as with components that were identified; give step_map=True"
            )
        return self.continuous_form()

    def to_scipy(self, *, step_map: bool = False) -> signal.StateSpace:
        """The continuous model as `scipy.signal.StateSpace`.

        Parameters
        ----------
        step_map
            The map over one communication step in its place, with the step ``dt`` [s].

        Raises
        ------
        InputError
            If the other of the two models was linearised alone.
        """
        model = self._of_kind(step_map)
        step = {} if model.step_size is None else {"dt": model.step_size}
        return signal.StateSpace(model.A, model.B, model.C, model.D, **step)

    def to_control(self, *, step_map: bool = False) -> Any:
        """The continuous model as a `StateSpace` of python-control, with the names of states, inputs and outputs.

        What that package does not take in a name becomes ``_``: ``gfor.omega`` is ``gfor_omega``.

        Parameters
        ----------
        step_map
            The map over one communication step in its place, with the step ``dt`` [s].

        Raises
        ------
        InputError
            If the package control is missing, or the other of the two models was linearised alone.
        """
        model = self._of_kind(step_map)
        try:
            control = import_module("control")
        except ImportError:
            raise InputError(
                "the package control is missing; install it with `pip install control`"
            ) from None
        kinds = ("states", "inputs", "outputs")
        names = {
            kind: [re.sub(r"\W+", "_", name) for name in getattr(model, kind)] for kind in kinds
        }
        return control.ss(model.A, model.B, model.C, model.D, model.step_size or 0, **names)

    def _of_kind(self, step_map: bool) -> LinearSystem:
        if not flag(step_map, "step_map"):
            return self.continuous()
        if self.step_size is None:
            raise InputError(
                "the model is continuous; linearise without continuous=True for the step map"
            )
        return self

    def __repr__(self) -> str:
        kind = "continuous" if self.step_size is None else f"step map of {self.step_size:g} s"
        size = f"{len(self.states)} states, {len(self.inputs)} inputs, {len(self.outputs)} outputs"
        return f"<LinearSystem: {kind}, {size}>"

    def _repr_html_(self) -> str:
        top = headline(self.stability.sentence(), self.stability.stable)
        lines = [f"warning: {text}" for text in self.warnings]
        lines += [f"inputs: {', '.join(self.inputs)}", f"outputs: {', '.join(self.outputs)}"]
        if self.states:
            lines.append("table('A') … table('D') have the matrices, eigenvalues of A the modes")
        b, c = self.table("B").add_prefix("B: "), self.table("C").T.add_prefix("C: ")
        lines.append(
            "B by input and C by output, a row for each state; below, D, outputs by inputs"
        )
        below = self.table("D").to_html() if self.outputs and self.inputs else ""
        return page(repr(self).strip("<>"), lines, b.join(c), rest=below, verdict=top)


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
