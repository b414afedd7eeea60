"""A device and the network at its bus as one model without the bus voltage as an input, moved by its kernel.

The emf and the admittance of a device are of its states alone, so that the voltage follows from them and from the
network, whose numbers are the model's inputs.
"""

from collections.abc import Callable
from ctypes import c_double
from dataclasses import replace

import numpy as np

from fmus.toolchain.frames import Phasor
from fmus.toolchain.model import Model
from fmus.toolchain.symbols import Expr, Function, symbols
from fmus.toolchain.variables import Input, Output
from tests.support.evaluated import Evaluated
from tests.support.kernels import taped

Network = Callable[[dict[str, Expr], list[Expr]], tuple[Phasor, dict[str, Expr]]]
"""Outputs of a device at one voltage, and the numbers of the network → the bus voltage, and further outputs."""


def closed(model: Model, numbers: tuple[str, ...], network: Network, at: float) -> Model:
    """Return the model whose inputs are the ``numbers`` of a network in place of the bus voltage.

    ``at``: voltage at which the network is told of the device [pu]."""
    x, p, c = (
        symbols(name, len(group))
        for name, group in (("x", model.states), ("p", model.parameters), ("c", model.calculated))
    )
    given = symbols("given", len(numbers))
    names = [v.name for v in model.outputs]
    (still,) = model.outputs_function.of(x, [at, 0.0], p, c)
    v, further = network(dict(zip(names, still, strict=True)), given)
    (outputs,) = model.outputs_function.of(x, [v.re, v.im], p, c)
    (rates,) = model.derivatives.of(x, [v.re, v.im], p, c)
    known = [x, given, p, c]
    return replace(
        model,
        inputs=tuple(Input(name, "1", name) for name in numbers),
        outputs=(*model.outputs, *(Output(name, "1", name) for name in further)),
        derivatives=Function("derivatives", known, [rates]),
        outputs_function=Function("outputs", known, [[*outputs, *further.values()]]),
    )


class Moved:
    """All values of a model, from the states and parameters of a device on; its kernel moves them.

    ``inputs``, ``states``, ``parameters``: views of them."""

    def __init__(self, model: Model, device: Evaluated) -> None:
        assert model.integrator == "runge_kutta"
        assert not any(state.stepwise for state in model.states)
        self._kernel, self._names = taped(model), [v.name for v in model.outputs]
        self._z = (c_double * len(model.value_references))(*device.p, *device.c)
        values = np.frombuffer(self._z)
        ends = np.cumsum(
            [len(device.p), len(device.c), len(model.inputs), len(model.states), len(self._names)]
        )
        self.parameters, _, self.inputs, self.states, self._outputs, self._rates = np.split(
            values, ends
        )
        self.states[:] = device.x

    def outputs(self) -> dict[str, float]:
        self._kernel.outputs(self._z)
        return dict(zip(self._names, self._outputs.tolist(), strict=True))

    def rates(self) -> np.ndarray:
        """Rates of the states, of which a later call gives others."""
        self._kernel.derivatives(self._z)
        return self._rates.copy()

    def advance(self, step: float, steps: int) -> None:
        """Integrate by Runge-Kutta of order 4 at constant inputs."""
        assert self._kernel.advance(self._z, step, steps) == 0  # all states are finite

    def eigenvalues(self, h: float) -> np.ndarray:
        """Eigenvalues about the states [1/s], by central differences."""
        x = self.states.copy()
        columns = []
        for place in range(len(x)):
            sides = []
            for side in (h, -h):
                self.states[:] = x
                self.states[place] += side
                sides.append(self.rates())
            columns.append((sides[0] - sides[1]) / (2 * h))
        self.states[:] = x
        return np.linalg.eigvals(np.array(columns).T)


def behind(Z: complex) -> Network:
    """Return the network of a source behind an impedance, whose two numbers are its voltage."""
    y = 1 / Z

    def voltage(still, given):
        e, Y = Phasor(still["e_re"], still["e_im"]), Phasor(still["y_re"], still["y_im"])
        beside = Phasor(y.real, y.imag)
        v = (Phasor(*given) * beside + e * Y) / (beside + Y)
        return v, {"bus.v_re": v.re, "bus.v_im": v.im}

    return voltage


class AtSource:
    """A device at a source behind an impedance [pu]."""

    def __init__(self, device: Evaluated, Z: complex) -> None:
        self.device = device
        self._model = closed(device.model, ("source_re", "source_im"), behind(Z), at=1.0)

    def _at(self, source: complex) -> Moved:
        moved = Moved(self._model, self.device)
        moved.inputs[:] = complex(source).real, complex(source).imag
        return moved

    def voltage(self, x: np.ndarray, source: complex) -> complex:
        """Voltage at the device's bus."""
        moved = self._at(source)
        moved.states[:] = x
        found = moved.outputs()
        return complex(found["bus.v_re"], found["bus.v_im"])

    def eigenvalues(self, source: complex, h: float = 1e-7) -> np.ndarray:
        return self._at(source).eigenvalues(h)

    def run(self, source: complex, until: float, step: float, *names: str) -> np.ndarray:
        """Outputs at every step; the size of the bus voltage where none is named."""
        moved, found = self._at(source), []
        for _ in range(round(until / step) + 1):
            here = moved.outputs()
            v = abs(complex(here["bus.v_re"], here["bus.v_im"]))
            found.append([here[name] for name in names] if names else v)
            moved.advance(step, 1)
        return np.array(found).squeeze()
