"""Differences and integration of equations that a test writes by hand, over states by name."""

import numpy as np


def eigenvalues(rates, x, h=1e-7):
    """Of the equations about a point [1/s], by central differences."""
    columns = []
    for name in x:
        up, down = (rates(x | {name: x[name] + side * h}) for side in (1, -1))
        columns.append([(up[n] - down[n]) / (2 * h) for n in x])
    return np.linalg.eigvals(np.array(columns).T)


def stepped(rates, x, step):
    """Return the states a step [s] later, by Runge and Kutta's method."""
    k1 = rates(x)
    k2 = rates({n: x[n] + step / 2 * k1[n] for n in x})
    k3 = rates({n: x[n] + step / 2 * k2[n] for n in x})
    k4 = rates({n: x[n] + step * k3[n] for n in x})
    return {n: x[n] + step / 6 * (k1[n] + 2 * k2[n] + 2 * k3[n] + k4[n]) for n in x}
