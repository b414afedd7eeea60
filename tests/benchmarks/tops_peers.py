"""TOPS' own errors against PowerFactory's speeds: ``python -m tests.benchmarks.tops_peers``.

Needs the package ``tops`` (0.3.0 was used), in an environment of its own: nothing of this project but the recordings is
read. It is TOPS' own validation: RK45 of SciPy with a longest step of 5 ms, the fault switched after the step that
passes its time.
"""

import importlib
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.integrate import RK45

from tests.reference.tops_systems import INTERVAL, recorded_speeds

RUNS = {"k2a": ("k2a_val", 1.1), "ieee39": ("ieee39", 1.05)}
"""Our name of a system → TOPS' name, and the end of the fault [s]."""


def errors(name: str) -> list[float]:
    """Root-mean-square error of each generator's speed [1e-6 pu]."""
    module, end = RUNS[name]
    dynamic: Any = importlib.import_module("tops.dynamic")
    made = dynamic.PowerSystemModel(model=importlib.import_module(f"tops.ps_models.{module}").load())
    made.init_dyn_sim()
    generators = made.gen["GEN"]
    bus = generators.bus_idx_red["terminal"][0]
    columns = [k for k, (_, state) in enumerate(made.state_desc) if state == "speed"]
    solver = RK45(made.ode_fun, 0, made.x0, 10, max_step=INTERVAL)
    times, speeds = [], []
    while solver.t < 10:
        solver.step()
        made.y_bus_red_mod[bus, bus] = 1e6 if 1 <= solver.t <= end else 0
        times.append(solver.t)
        speeds.append(solver.y[columns])
    wanted = recorded_speeds(name)
    found = np.array(speeds).T
    at = np.arange(len(wanted)) * INTERVAL
    return [
        1e6 * float(np.sqrt(np.mean((1 + np.interp(at, times, own) - column) ** 2)))
        for own, column in zip(found, wanted.T, strict=True)
    ]


def main() -> None:
    """Print a line for each system."""
    print(f"TOPS {version('tops')}, NumPy {np.__version__}")
    for name in RUNS:
        print(name, " | ".join(f"{e:.1f}" for e in errors(name)))


if __name__ == "__main__":
    main()
