"""TOPS' own errors against PowerFactory's speeds: ``python -m tests.benchmarks.tops_peers``.

Needs the package ``tops`` (0.3.0 was used), in an environment of its own: nothing of this project but the recordings is
read. It is TOPS' own validation: RK45 of SciPy with a longest step of 5 ms, the fault switched after the step that
passes its time. With the name of a system behind it, it prints that system's errors, voltages and eigenvalues as JSON.
"""

import importlib
import json
import sys
from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.integrate import RK45

from tests.reference.tops_systems import INTERVAL, recorded_speeds

RUNS = {"k2a": ("k2a_val", 1.1), "ieee39": ("ieee39", 1.05)}
"""Our name of a system → TOPS' name, and the end of the fault [s]."""


STEP = 1e-5
"""Of the differences by which TOPS' equations are linearised; its own 1e-10 sees rounding."""


def made_by_tops(name: str, *, stabilisers: bool = True) -> Any:
    """TOPS' model of a system, at its power flow."""
    dynamic: Any = importlib.import_module("tops.dynamic")
    model = importlib.import_module(f"tops.ps_models.{RUNS[name][0]}").load()
    if not stabilisers:
        del model["pss"]
    made = dynamic.PowerSystemModel(model=model)
    made.init_dyn_sim()
    return made


def eigenvalues(name: str, *, stabilisers: bool) -> list[complex]:
    """Of TOPS' equations at its operating point [rad/s], by central differences."""
    made = made_by_tops(name, stabilisers=stabilisers)
    x = np.asarray(made.x0, dtype=float)
    columns = []
    for unit in STEP * np.eye(len(x)):
        ahead, behind = (np.array(made.ode_fun(0, x + sign * unit)) for sign in (1, -1))
        columns.append((ahead - behind) / (2 * STEP))
    return [complex(z) for z in np.linalg.eigvals(np.column_stack(columns))]


def errors(name: str) -> list[float]:
    """Root-mean-square error of each generator's speed [1e-6 pu]."""
    _, end = RUNS[name]
    made = made_by_tops(name)
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


def findings(name: str) -> dict[str, Any]:
    """What TOPS says of a system, in JSON's types; complex numbers as pairs."""

    def pairs(values: Any) -> list[list[float]]:
        return [[complex(z).real, complex(z).imag] for z in values]

    return {
        "tops": version("tops"),
        "errors": errors(name),
        "voltages": pairs(made_by_tops(name).v_0),
        "pss": pairs(eigenvalues(name, stabilisers=True)),
        "no_pss": pairs(eigenvalues(name, stabilisers=False)),
    }


def main() -> None:
    """Print a line for each system, or all about the one that is named."""
    if sys.argv[1:]:
        print(json.dumps(findings(sys.argv[1])))
        return
    print(f"TOPS {version('tops')}, NumPy {np.__version__}")
    for name in RUNS:
        print(name, " | ".join(f"{e:.1f}" for e in errors(name)))


if __name__ == "__main__":
    main()
