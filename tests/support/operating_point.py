"""A model evaluated at an operating point: values by name, complex transfer functions, no FMU."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fmus.toolchain.model import Model


@dataclass(frozen=True)
class OperatingPoint:
    """Parameters, calculated parameters, states and inputs of a model, as vectors."""

    model: Model
    p: np.ndarray
    c: np.ndarray
    x: np.ndarray
    u: np.ndarray

    def changed(
        self, states: Mapping[str, float] | np.ndarray | None = None, inputs: Mapping[str, float] | None = None
    ) -> "OperatingPoint":
        """The same with other values of some states (or all, as a vector) and inputs."""
        x = states if isinstance(states, np.ndarray) else _replaced(self.model.states, self.x, states or {})
        return OperatingPoint(self.model, self.p, self.c, x, _replaced(self.model.inputs, self.u, inputs or {}))

    @property
    def rates(self) -> np.ndarray:
        return np.array(self.model.derivatives(self.x, self.u, self.p, self.c)).ravel()

    @property
    def rate(self) -> dict[str, float]:
        return _named(self.model.states, self.rates)

    @property
    def state(self) -> dict[str, float]:
        return _named(self.model.states, self.x)

    @property
    def calculated(self) -> dict[str, float]:
        return _named(self.model.calculated, self.c)

    @property
    def parameter(self) -> dict[str, float]:
        return _named(self.model.parameters, self.p)

    @property
    def outputs(self) -> np.ndarray:
        return np.array(self.model.outputs_function(self.x, self.u, self.p, self.c)).ravel()

    @property
    def output(self) -> dict[str, float]:
        return _named(self.model.outputs, self.outputs)

    @property
    def jacobians(self) -> tuple[np.ndarray, ...]:
        """A, B, C, D."""
        return tuple(np.array(block) for block in self.model.jacobians()(self.x, self.u, self.p, self.c))

    def transfer(self, s: complex, output: str, input_: str) -> complex:
        """C·(s − A)⁻¹·B + D from one input to one output."""
        A, B, C, D = self.jacobians
        j, i = _position(self.model.inputs, input_), _position(self.model.outputs, output)
        return complex(C[i] @ np.linalg.solve(s * np.eye(len(A)) - A, B[:, j]) + D[i, j])

    @property
    def broken_rules(self) -> list[str]:
        """Texts of the requirements that do not hold."""
        margins = np.array(self.model.requirements(self.p, self.c)).ravel()
        return [text for text, margin in zip(self.model.requirement_texts, margins, strict=True) if not margin > 0]


def operating_point(model: Model, parameters: Mapping[str, float] | None = None) -> OperatingPoint:
    """Initialise a model; inputs at their start values, but ``v_re`` and ``v_im`` at the power flow's voltage."""
    start = np.array([v.start for v in model.parameters])
    p = _replaced(model.parameters, start, parameters or {})
    c, x = (np.array(part).ravel() for part in model.initialise(p))
    point = OperatingPoint(model, p, c, x, np.array([v.start for v in model.inputs]))
    if "theta_0" in point.parameter:
        v = point.parameter["v_0"] * np.exp(1j * point.parameter["theta_0"])
        point = point.changed(inputs={"v_re": v.real, "v_im": v.imag})
    return point


def _named(variables: tuple, values: np.ndarray) -> dict[str, float]:
    return {v.name: float(value) for v, value in zip(variables, values, strict=True)}


def _position(variables: tuple, name: str) -> int:
    return [v.name for v in variables].index(name)


def _replaced(variables: tuple, values: np.ndarray, new: Mapping[str, float]) -> np.ndarray:
    replaced = values.astype(float)
    for name, value in new.items():
        replaced[_position(variables, name)] = value
    return replaced
