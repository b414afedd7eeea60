"""Devices and networks whose closed system is known exactly, and scans made of them.

A device is a state space from voltage to current with a conductance beside it; the network is R, L and perhaps a
series capacitor, in a dq frame whose q axis leads. Only NumPy is used: nothing here knows `orchestrator`'s own count.
"""

from dataclasses import dataclass, field

import numpy as np

J = np.array([[0.0, -1.0], [1.0, 0.0]])
OMEGA = 2 * np.pi * 50


@dataclass
class Plant:
    """i = C·x + G·v with ẋ = A·x + B·v; currents into the device."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    G: float

    def admittance(self, f):
        eye = np.eye(len(self.A))
        return np.array(
            [self.C @ np.linalg.solve(2j * np.pi * x * eye - self.A, self.B) for x in f]
        ) + self.G * np.eye(2)


@dataclass
class Line:
    """R and L, and ``share`` of ω₀L as capacitor in series."""

    R: float
    L: float
    share: float = 0.0

    def impedance(self, f, *, capacitor=True):
        s = 2j * np.pi * np.asarray(f)[:, None, None]
        Z = (self.R + s * self.L) * np.eye(2) + OMEGA * self.L * J
        if self.share and capacitor:
            x = self.share * OMEGA * self.L
            Z = Z + np.linalg.inv((s * np.eye(2) + OMEGA * J) / (x * OMEGA))
        return Z


def constant_power(g=0.6, h=0.6, T=0.01, G=0.05):
    """It draws less current where the d voltage rises, as a constant power does, after a lag."""
    return Plant(-np.eye(2) / T, np.diag([-g, h]) / T, np.eye(2), G)


def eigenvalues(plant, line):
    """Of the closed system: states of the device, line current, capacitor voltage."""
    n = len(plant.A)
    to_i, to_x = np.eye(2) / plant.G, -plant.C / plant.G  # v = (i − C·x)/G
    A = np.zeros((n + 4, n + 4))
    A[:n, :n], A[:n, n : n + 2] = plant.A + plant.B @ to_x, plant.B @ to_i
    A[n : n + 2, :n] = -to_x / line.L
    A[n : n + 2, n : n + 2] = -(to_i + line.R * np.eye(2)) / line.L - OMEGA * J
    A[n : n + 2, n + 2 :] = -np.eye(2) / line.L
    A[n + 2 :, n : n + 2] = np.eye(2) * line.share * OMEGA**2 * line.L
    A[n + 2 :, n + 2 :] = -OMEGA * J
    return np.linalg.eigvals(A if line.share else A[: n + 2, : n + 2])


def is_stable(plant, line):
    return eigenvalues(plant, line).real.max() < 0


def random_plant(rng, *, unstable=False):
    """Some modes from 2 to 150 Hz, damped by 3 to 60 %."""
    pairs = rng.integers(1, 4)
    A = np.zeros((2 * pairs, 2 * pairs))
    for k in range(pairs):
        w, z = (
            2 * np.pi * np.exp(rng.uniform(np.log(2), np.log(150))),
            np.exp(rng.uniform(np.log(0.03), np.log(0.6))),
        )
        z = -z if unstable and k == 0 else z
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = w * (np.sqrt(1 - z * z) * J - z * np.eye(2))
    size = np.repeat(np.abs(A.diagonal()[::2]), 2)
    B = rng.normal(size=(2 * pairs, 2)) * size[:, None] ** 0.5
    C = rng.normal(size=(2, 2 * pairs)) * size[None, :] ** 0.5
    return Plant(A, B, rng.uniform(0.1, 0.6) * C, rng.uniform(0.03, 0.3))


def random_line(rng):
    X = np.exp(rng.uniform(np.log(0.1), np.log(1.5)))
    return Line(X * rng.uniform(0.03, 0.3), X / OMEGA, rng.choice([0.0, rng.uniform(0.1, 0.6)]))


@dataclass
class Noise:
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def on(self, values, size):
        shape = values.shape
        return values * (
            1 + size * (self.rng.normal(size=shape) + 1j * self.rng.normal(size=shape))
        )
