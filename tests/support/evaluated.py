"""A model's functions at one set of parameters, with names instead of positions."""

from collections.abc import Mapping
from functools import cached_property

import numpy as np

from fmus.toolchain.model import Model
from tests.support.jacobians import jacobians
from tests.support.kernels import taped
from tests.support.written_out import written_out


class Evaluated:
    """Derivatives, outputs and Jacobians of a model; states start where its own operating point is."""

    def __init__(self, model: Model, values: Mapping[str, float] | None = None):
        values = dict(values or {})
        assert set(values) <= {v.name for v in model.parameters}
        self.model = model = written_out(model)  # functions of (x, u, p, c) alone
        self.p = np.array([float(values.get(v.name, v.start)) for v in model.parameters])
        self.c, self.x = (np.array(v).ravel() for v in model.initialise(self.p))

    @property
    def parameters(self):
        return self._named(self.model.parameters, self.p) | self._named(
            self.model.calculated, self.c
        )

    @property
    def states(self):
        return self._named(self.model.states, self.x)

    @cached_property
    def kernel(self):
        """The same functions as compiled code executes them."""
        assert self.model.integrator == "runge_kutta"
        assert not any(state.stepwise for state in self.model.states)
        return taped(self.model)

    def vector(self, states):
        """Values by name as the vector of states."""
        return np.array([states[s.name] for s in self.model.states])

    def rates(self, u, x=None):
        rates = self.model.derivatives(self.x if x is None else x, u, self.p, self.c)
        return self._named(self.model.states, np.array(rates).ravel())

    def outputs(self, u, x=None):
        values = self.model.outputs_function(self.x if x is None else x, u, self.p, self.c)
        return self._named(self.model.outputs, np.array(values).ravel())

    def blocks(self, u):
        """Exact A, B, C, D at the states."""
        return [np.array(block) for block in self._jacobians(self.x, u, self.p, self.c)]

    @cached_property
    def _jacobians(self):
        return jacobians(self.model)

    def response(self, s, u):
        """Transfer function at s [1/s] from every input to every output, as (output, input) → value."""
        A, B, C, D = self.blocks(u)
        found = C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D
        outputs, inputs = ([v.name for v in vs] for vs in (self.model.outputs, self.model.inputs))
        return {(y, v): found[i, k] for i, y in enumerate(outputs) for k, v in enumerate(inputs)}

    @staticmethod
    def _named(variables, values):
        return {v.name: float(value) for v, value in zip(variables, values, strict=True)}
