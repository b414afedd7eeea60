"""How cost grows with the size of a network: ``python -m tests.benchmarks.size [CASE ...]``.

pandapower's networks of 39 to 9241 buses with a machine and a converter at every bus with generators, as phasor models
at 5 ms. A row for each: seconds of processor time of each part, peak memory, steps per second; then the exponents with
which all that grows with the number of buses. Each network has a process of its own, with nothing kept from others.
``--check`` compares the critical modes with the dense eigenvalues where there are at most `WHOLE` states.
``--json`` prints three stages beside their floors, both measured in the same run (`floors`), as seconds and multiples.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from orchestrator.cases.case import load_case
from orchestrator.cases.flow.power_flow import (
    FlowLine,
    FlowLoad,
    FlowShunt,
    FlowUnit,
    PowerFlow,
    solve_power_flow,
)
from orchestrator.cases.form.schema import NetworkTable
from orchestrator.cases.networks.data import NetworkData, network_data
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, compose, linearize_within
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.critical_modes import find_critical_modes
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.linear.spectra.stability import WHOLE
from orchestrator.systems.coupling.master import Master

CASES = ("case39", "case118", "case300", "case1354pegase", "case2869pegase", "case9241pegase")

STRAY = 0.001
"""pu: only there because every bus must have something to earth; phasor models need none of it."""

BELOW, HIGHEST_HZ, LOWEST_HZ = 0.1, 2.0, 0.1
"""Critical modes: damping ratio and range of frequencies."""

STAGES = {"linearisation": "linearise", "critical modes": "modes", "step": "step"}
"""Names of the stages of ``--json``, with the key of a row that holds their seconds."""

COPIED_BYTES = 256 * 1024**2
"""What the measurement of the memory's bandwidth copies: far beyond any cache."""

STEPS = 200
_LOADING, _LEAST_MVA = 0.6, 20.0


def write_case(name: str, folder: Path) -> Path:
    """A case file, with ratings by which no unit is loaded by more than `_LOADING` of its rating."""
    data = network_data(NetworkTable(pandapower=name, stray_B=STRAY), folder)
    units = [
        FlowUnit(g.label, bus, 100.0, g.p_mw / 100, g.v_pu) for bus, g in data.generation.items()
    ]
    begun = time.process_time()
    flow = _flow(data, units)
    print(
        json.dumps({"flow": time.process_time() - begun, "buses": len(data.buses)}), file=sys.stderr
    )
    ratings = {u.name: max(abs(flow.powers[u.name]) * u.S_n / _LOADING, _LEAST_MVA) for u in units}
    rows = ["bus,rating_mva", *(f"{label},{rating:.1f}" for label, rating in ratings.items())]
    (folder / "units.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    path = folder / "case.toml"
    path.write_text(
        f"""
name = "{name}"
title = "{name}: a machine and a converter at every bus with generators"
source = "pandapower"
[solver]
step_size = "5 ms"
stop_time = "10 s"
record_interval = "10 ms"
[power_flow]
grid = "grid"
reactive_limits = false
[components.grid]
model = "phasor_grid"
[network]
pandapower = "{name}"
stray_B = {STRAY}
[units]
file = "units.csv"
alpha = 0.25
generator = "synchronous_generator_ac4a_phasor"
converter = "gfor_phasor"
generator_parameters = {{ transformer.X_t = 0.0, transformer.R_t = 0.0, machine.exact_conversion = true }}
[scenarios.base]
""",
        encoding="utf-8",
    )
    return path


def _flow(data: Any, units: list[FlowUnit]) -> PowerFlow:
    lines = [
        FlowLine(x.name, x.from_bus, x.to_bus, R=x.R, X=x.X, B=x.B, tap=x.tap, shift=x.shift)
        for x in data.lines
    ]
    loads = [FlowLoad(x.bus, x.p_mw, x.q_mvar) for x in data.loads]
    shunts = [FlowShunt(x.bus, x.g_mw / 100, x.b_mvar / 100) for x in data.shunts]
    return solve_power_flow(data.buses, lines, loads, units, data.slack, shunts)


def measure(name: str, native: str, *, check: bool) -> dict[str, float]:
    """Figures of one network, in seconds of processor time, children's included, where nothing else is said."""
    row: dict[str, float] = {}

    @contextmanager
    def timed(key: str) -> Iterator[None]:
        begun, wall = _processor_time(), time.perf_counter()
        yield
        row[key], row[f"{key}_wall"] = _processor_time() - begun, time.perf_counter() - wall
        print(
            f"  {name}: {key} {row[key]:.2f} s, wall {row[f'{key}_wall']:.1f} s",
            file=sys.stderr,
            flush=True,
        )

    with tempfile.TemporaryDirectory() as folder:
        path = write_case(name, Path(folder))
        case = load_case(path)
        choices = {f"{pattern}.native": True for pattern in native.split(",") if pattern}
        with timed("build"):
            (prepared,) = case.prepare(overrides=choices)
        with timed("prepare"):
            case.prepare(overrides=choices)
        components = prepared.system.components
        row["buses"] = sum(
            output.endswith(".v_re") for output in components["grid"].description.outputs
        )
        row["fmus"] = len(components)
        with timed("instances"):
            master = Master(prepared.system, prepared.schedule, prepared.step_size)
        with master:
            row["states"] = sum(len(c.description.states) for c in master.components.values())
            with timed("steady"):
                row["residual"] = find_operating_point(master).residual
            with timed("linearise"):
                blocks = Blocks(master)
                model = compose(blocks, master.schedule)
            with timed("linearise_floor"):
                for kind in one_of_each_kind(master):
                    linearize_within(master, kind, master.clock.step_size)
            network = blocks.components["grid"]
            moved = int(np.abs(np.vstack([network.B, network.D])).any(axis=0).sum())
            row["columns"] = moved + len(network.states)
            with timed("modes"):
                critical = find_critical_modes(model, LOWEST_HZ, HIGHEST_HZ, BELOW)
            row["found"] = len(critical)
            shift = complex(0.0, 2 * np.pi * np.sqrt(LOWEST_HZ * HIGHEST_HZ))
            with timed("modes_floor"):
                solve_around(model, shift, len(critical))
            row["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            if check and len(model.names) <= WHOLE:
                row |= _against_dense(eigenvalues(model), critical)
            begun = time.process_time()
            master.advance(STEPS)
            row["step"] = (time.process_time() - begun) / STEPS
            row["steps"] = 1 / row["step"]
            table = NetworkTable(pandapower=name, stray_B=STRAY)
            numbers = network_bytes(network_data(table, Path(folder))) + 8 * row["states"]
            row["step_floor"] = numbers / bandwidth()
            row["linearise_floor"] += row["columns"] * row["step_floor"]
    return row


def one_of_each_kind(master: Master) -> list[str]:
    """Return the first device of each model: equal devices need to be perturbed only once. The network is no device."""
    firsts: dict[str, str] = {}
    for name, component in master.components.items():
        if name != "grid":
            firsts.setdefault(component.description.model_name, name)
    return list(firsts.values())


def solve_around(model: LinearModel, shift: complex, modes: int) -> None:
    """Do what no search can do without: one factorisation, and a solution for each left and right eigenvector.

    ``shift``: a point of the region [rad/s]."""
    sigma = complex(np.exp(shift * model.step_size)) if model.step_size else shift
    factors = model.shifted(sigma)
    right = np.ones(len(model.names), dtype=complex)
    for solve in (factors.solve, factors.solve_adjoint):
        for _ in range(modes):
            solve(right)


def network_bytes(data: NetworkData) -> int:
    """Return the bytes of the factors of the network's admittances, which each step's solution reads once."""
    place = {bus: k for k, bus in enumerate(data.buses)}
    ends = np.array([(place[x.from_bus], place[x.to_bus]) for x in data.lines]).T
    series = np.array([1 / complex(x.R, x.X) for x in data.lines])
    shape = (len(place), len(place))
    off_diagonal = sp.coo_array((-series, ends), shape=shape)
    both = off_diagonal + off_diagonal.T
    # every bus has something to earth, so that the matrix has an inverse
    admittances = both - sp.diags_array(both.sum(axis=1) + complex(0, STRAY))
    factors = spla.splu(sp.csc_array(admittances))
    numbers = factors.L.nnz + factors.U.nnz
    return int(numbers) * (np.dtype(complex).itemsize + np.dtype(np.int32).itemsize)


def bandwidth() -> float:
    """Return the bytes that this machine's memory reads in a second, the best of five copies."""
    source = np.ones(COPIED_BYTES // 8)
    target = np.empty_like(source)
    took = []
    for _ in range(5):
        begun = time.perf_counter()
        np.copyto(target, source)
        took.append(time.perf_counter() - begun)
    return 2 * COPIED_BYTES / min(took)


def stages(row: dict[str, float]) -> list[dict[str, float | str]]:
    """Return the stages of a network beside the least that their arithmetic needs [s of processor time].

    Floors: linearisation, one device of each kind, and a solution of the network for each of its states and of its
    inputs that move; critical modes, one factorisation and a solution for each left and
    right eigenvector; step, the bytes of the network's factors and of the states by the memory's bandwidth."""
    return [
        {
            "name": name,
            "seconds": row[key],
            "floor_seconds": row[f"{key}_floor"],
            "multiple_of_floor": row[key] / row[f"{key}_floor"],
        }
        for name, key in STAGES.items()
    ]


def _against_dense(values: Any, critical: list[Any]) -> dict[str, float]:
    """Number of dense eigenvalues in the same region, and the largest distance of a critical mode from the nearest."""
    hertz, damping = values.imag / (2 * np.pi), -values.real / np.abs(values)
    inside = (hertz >= LOWEST_HZ) & (hertz <= HIGHEST_HZ) & (damping <= BELOW) & (damping >= -0.1)
    apart = [float(np.abs(values - mode.eigenvalue).min()) for mode in critical]
    return {"dense_found": int(inside.sum()), "apart": max(apart, default=0.0)}


def _processor_time() -> float:
    """Of this process and of its children that have ended [s]."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=CASES)
    parser.add_argument(
        "--one", action="store_true", help="measure one case in this process, and print JSON"
    )
    parser.add_argument("--check", action="store_true", help="compare with the dense eigenvalues")
    parser.add_argument(
        "--native",
        default="*",
        help="patterns of components that are compiled without Python",
    )
    parser.add_argument(
        "--json", action="store_true", help="print the stages beside their floors, as JSON"
    )
    given = parser.parse_args()
    if given.one:
        print(json.dumps(measure(given.cases[0], given.native, check=given.check)))
        return
    rows = {}
    for name in given.cases:
        command = [
            sys.executable,
            "-m",
            "tests.benchmarks.size",
            name,
            "--one",
            "--native",
            given.native,
        ]
        with tempfile.TemporaryDirectory() as cache:
            environment = os.environ | {"XDG_CACHE_HOME": cache, "OPENBLAS_NUM_THREADS": "1"}
            done = subprocess.run(
                [*command, *(["--check"] if given.check else [])],
                env=environment,
                stdout=subprocess.PIPE,
                text=True,
                check=False,
            )
        if done.returncode:
            print(f"{name}: not reached (exit status {done.returncode}); the reason stands above")
            continue
        rows[name] = json.loads(done.stdout)
        figures = ", ".join(f"{key} {value:.4g}" for key, value in rows[name].items())
        print(f"{name}: {figures}", file=sys.stderr if given.json else sys.stdout, flush=True)
    if given.json:
        networks = [
            {"case": name, "buses": row["buses"], "states": row["states"], "stages": stages(row)}
            for name, row in rows.items()
        ]
        print(
            json.dumps(networks[0] if len(given.cases) == 1 and networks else {"cases": networks})
        )
    elif len(rows) > 1:
        buses = np.log([row["buses"] for row in rows.values()])
        for key in ("build", "prepare", "steady", "linearise", "modes", "peak_mb", "steps"):
            slope = np.polyfit(buses, np.log([max(row[key], 1e-3) for row in rows.values()]), 1)[0]
            print(f"{key} grows as buses^{slope:.2f}")


if __name__ == "__main__":
    main()
