"""How a device answers the voltage at its bus: an ideal support by frequency, and a component's own linear model."""

import cmath
import math

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.analysis.component_linearization import ComponentLinearization
from orchestrator.arrays import Vector
from orchestrator.coupling.master import Master

ACTIVE, REACTIVE = "P", "Q"


def ideal_support(kind: str, voltage: complex, eigenvalue: complex) -> Vector:
    """1 MW less, or 1 Mvar more, for each Hz that the bus's frequency is high, which is λ/2π times its angle. A power S
    is the current conj(S/v)."""
    power = {ACTIVE: -1.0 + 0j, REACTIVE: 1j}[kind] / SYSTEM_BASE_MVA
    current = (power / voltage).conjugate()
    angle = np.array([-voltage.imag, voltage.real]) / abs(voltage) ** 2
    frequency = eigenvalue / (2 * math.pi) * angle
    return np.asarray(np.outer([current.real, current.imag], frequency))


def response_of(master: Master, model: ComponentLinearization, eigenvalue: complex) -> Vector:
    """Of a running component's current [pu, 100 MVA] to the voltage of its bus at λ [rad/s], shape (2, 2).

    The component answers the voltage at a step's beginning. A phasor network takes its admittance at the step's end."""
    z = cmath.exp(eigenvalue * master.clock.step_size)
    voltage = [model.inputs.index(part) for part in ("v_re", "v_im")]
    states = np.linalg.solve(z * np.eye(len(model.A)) - model.A, model.B[:, voltage])

    def answer(*parts: str) -> Vector:
        rows = [model.outputs.index(part) for part in parts]
        return np.asarray(z * model.C[rows] @ states + model.D[np.ix_(rows, voltage)])

    if "e_re" not in model.outputs:
        return answer("i_re", "i_im")
    y = complex(*master.components[model.name].get(["y_re", "y_im"]).values())
    times = np.array([[y.real, -y.imag], [y.imag, y.real]])
    return np.asarray(times @ (answer("e_re", "e_im") - z * np.eye(2)))


def turned(response: Vector, angle: float) -> Vector:
    """The response at a bus whose voltage is ahead by an angle [rad] of that where it was found."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return np.asarray(turn @ response @ turn.T)
