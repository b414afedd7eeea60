"""Speed and size of the 118-bus study: ``python -m tests.benchmarks.ieee118``.

Prints, taken in one run: memory of 57 FMUs; communication steps per second against 57 empty pythonfmu models
with the same connections in the same loop, and against native FMUs; the share of time outside the FMUs; the time
from instantiated FMUs to modes, against perturbing the coupled system state by state; and how all that grows with
the size of ring networks.
"""

import os
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from pythonfmu import FmuBuilder

from orchestrator.cases.case import Case, load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.devices.fmi.description import FmuDescription, read_description
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.linearization import Blocks, LinearModel, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.spectra.modes import eigenvalues
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.system import System

STEPS, REPEATS = 5_000, 3
BRUTE_FORCE_SAMPLE = 20
RING_FMUS = (4, 15, 29, 57, 113)
PERTURBATION = 1e-5


def start(prepared: PreparedScenario) -> Master:
    return Master(prepared.system, prepared.schedule, prepared.step_size)


def best_rate(make: Callable[[], Master], steps: int) -> tuple[float, float]:
    """Communication steps per second, best of a few fresh runs, and the share of that time inside FMUs."""
    best = (0.0, 0.0)
    for _ in range(REPEATS):
        with make() as master:
            statistics = master.run(steps * master.clock.step_size)
        best = max(best, (statistics.steps_per_second, statistics.share_in_fmus))
    return best


# -- memory --------------------------------------------------------------------------------------


def resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def print_memory(prepared: PreparedScenario) -> None:
    """Must come before anything else is run: memory that was used and freed would hide what is needed."""
    before = resident_mb()
    with start(prepared):
        first = resident_mb()
        with start(prepared):
            second = resident_mb()
    n = len(prepared.system.components)
    print(
        f"memory: {before:.0f} MB resident before, {first:.0f} MB with {n} FMUs: {(first - before) / n:.2f} MB each, "
        f"libraries and loop included; {(second - first) / n:.2f} MB each for {n} more of the same"
    )


# -- empty models --------------------------------------------------------------------------------

_EMPTY = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class {name}(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for i in range({inputs}):
            setattr(self, f"u{{i}}", 0.0)
            self.register_variable(Real(f"u{{i}}", causality=Fmi2Causality.input))
        for i in range({outputs}):
            setattr(self, f"y{{i}}", 0.0)
            self.register_variable(Real(f"y{{i}}", causality=Fmi2Causality.output))
{more}
    def do_step(self, current_time, step_size):
        return True
"""
_LEAN = """
        self.values = [0.0] * ({inputs} + {outputs})

    def get_real(self, vrs):
        values = self.values
        return [values[reference] for reference in vrs]

    def set_real(self, vrs, values):
        for reference, value in zip(vrs, values):
            self.values[reference] = value
"""


def empty_fmu(folder: Path, inputs: int, outputs: int, lean: bool) -> FmuDescription:
    """A pythonfmu model that does nothing; a lean one keeps its variables in a list instead of attributes."""
    name = f"Empty_{inputs}_{outputs}_{'lean' if lean else 'plain'}"
    more = _LEAN.format(inputs=inputs, outputs=outputs) if lean else ""
    script = folder / f"{name.lower()}_model.py"
    script.write_text(
        _EMPTY.format(name=name, inputs=inputs, outputs=outputs, more=more), encoding="utf-8"
    )
    with redirect_stdout(StringIO()):
        return read_description(FmuBuilder.build_FMU(script, dest=folder))


def empty_copy(system: System, folder: Path, lean: bool) -> System:
    """The same components and connections, with empty models that have the connected variables only."""
    inputs: dict[str, dict[str, str]] = {name: {} for name in system.components}
    outputs: dict[str, dict[str, str]] = {name: {} for name in system.components}
    for wire in system.connections:
        into, out = inputs[wire.target.component], outputs[wire.source.component]
        into[wire.target.variable] = f"u{len(into)}"
        out.setdefault(wire.source.variable, f"y{len(out)}")
    built: dict[tuple[int, int], FmuDescription] = {}
    copy = System()
    for name in system.components:
        size = len(inputs[name]), len(outputs[name])
        if size not in built:
            built[size] = empty_fmu(folder, *size, lean)
        copy.add(name, built[size])
    for wire in system.connections:
        (a, b), (c, d) = ((e.component, e.variable) for e in (wire.source, wire.target))
        copy.connect(f"{a}.{outputs[a][b]}", f"{c}.{inputs[c][d]}")
    return copy


def print_speed(prepared: PreparedScenario) -> None:
    rate, share = best_rate(lambda: start(prepared), STEPS)
    n = len(prepared.system.components)
    print(f"{n} FMUs: {rate:,.0f} communication steps/s; {1 - share:.1%} of the time outside FMUs")
    with tempfile.TemporaryDirectory() as folder:
        for lean, what in ((False, "with attributes"), (True, "with their variables in a list")):
            copy = empty_copy(prepared.system, Path(folder), lean)
            empty, _ = best_rate(
                lambda c=copy: Master(c, prepared.schedule, prepared.step_size), STEPS
            )  # type: ignore[misc]
            print(
                f"  {n} empty pythonfmu models {what}: {empty:,.0f} steps/s; ours / empty = {rate / empty:.2f}"
            )


def print_native(case: Case, backed: PreparedScenario) -> None:
    (native,) = case.prepare([backed.name], {"*.native": True})
    rates = {}
    for name, prepared in (("Python-backed", backed), ("native", native)):
        rates[name], share = best_rate(lambda p=prepared: start(p), STEPS)  # type: ignore[misc]
        print(f"  {name}: {rates[name]:,.0f} steps/s; {1 - share:.1%} of the time outside FMUs")
    print(f"  native / Python-backed = {rates['native'] / rates['Python-backed']:.2f}")


# -- linearisation -------------------------------------------------------------------------------


@dataclass(frozen=True)
class Linearisation:
    """Seconds of each part, and the result."""

    instances: float
    steady_state: float
    blocks: float
    compose: float
    eigenvalues: float
    model: LinearModel

    @property
    def total(self) -> float:
        return self.instances + self.steady_state + self.blocks + self.compose + self.eigenvalues


def linearise(prepared: PreparedScenario) -> Linearisation:
    """The parts of `compute_modes`, one by one."""
    times = [time.perf_counter()]

    def lap() -> None:
        times.append(time.perf_counter())

    with start(prepared) as master:
        lap()
        find_operating_point(master)
        lap()
        blocks = Blocks(master)
        lap()
        model = compose(blocks, master.schedule)
        lap()
        eigenvalues(model)
        lap()
    return Linearisation(*np.diff(times).tolist(), model)


def brute_force(prepared: PreparedScenario, model: LinearModel) -> tuple[float, float]:
    """Seconds to perturb every state of the coupled system, from a sample; largest difference of its columns."""
    n, difference = model.number_of_states, 0.0
    with start(prepared) as master:
        find_operating_point(master)
        state = CoupledState(master)
        x_0 = state.read()
        sample = np.linspace(0, n - 1, BRUTE_FORCE_SAMPLE).astype(int)
        seconds = 0.0
        for k in sample:
            begun = time.perf_counter()
            step = np.zeros(n)
            step[k] = PERTURBATION * max(1.0, abs(x_0[k]))
            column = (state.step_from(x_0 + step) - state.step_from(x_0 - step)) / (2 * step[k])
            seconds += time.perf_counter() - begun
            difference = max(difference, float(np.abs(column - model.A[:n, k]).max()))
    return seconds * n / len(sample), difference


def print_linearisation(case: Case, prepared: PreparedScenario) -> None:
    begun = time.perf_counter()
    compute_modes(prepared)
    whole = time.perf_counter() - begun
    parts = linearise(prepared)
    ours = parts.blocks + parts.compose
    brute, difference = brute_force(prepared, parts.model)
    print(
        f"{parts.model.number_of_states} states: {whole:.1f} s from built FMUs to modes (compute_modes); of this:"
    )
    print(
        f"  instances {parts.instances:.2f} s, steady state {parts.steady_state:.2f} s, blocks {parts.blocks:.2f} s, "
        f"compose {parts.compose:.2f} s, eigenvalues alone {parts.eigenvalues:.2f} s"
    )
    print("  the rest: eigenvectors and the named modes' shapes")
    print(
        f"  step map alone: blocks and compose {ours:.2f} s; brute force {brute:.1f} s, extrapolated from "
        f"{BRUTE_FORCE_SAMPLE} states; brute force / ours = {brute / ours:.1f}; with two perturbation sizes, as blocks "
        f"take them: {2 * brute / ours:.1f}"
    )
    print(
        f"  largest difference between the two in those {BRUTE_FORCE_SAMPLE} columns: {difference:.1e}"
    )


# -- growth --------------------------------------------------------------------------------------


def ring_case(folder: Path, buses: int) -> Path:
    """A ring of buses, each with a load and a generator that feeds about as much."""
    numbers = range(1, buses + 1)
    rows = {
        "lines": ["from,to,R,X,B", *(f"{i},{i % buses + 1},0.002,0.02,0.05" for i in numbers)],
        "loads": ["bus,p_mw,q_mvar", *(f"{i},{90 + 20 * (i % 2)},20" for i in numbers)],
        "units": ["bus,rating_mva,p_mw,v_pu", *(f"{i},150,100,1.0" for i in numbers)],
    }
    for name, lines in rows.items():
        (folder / f"{name}_{buses}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    path = folder / f"ring_{buses}.toml"
    path.write_text(
        f"""
name = "ring_{buses}"
title = "Ring of {buses} buses with a generator each"
source = "Made up, to see how cost grows with size"
[solver]
step_size = "100 us"
stop_time = "1 s"
record_interval = "5 ms"
[power_flow]
grid = "grid"
slack = "bus_1"
[components.grid]
model = "grid"
[network]
lines_file = "lines_{buses}.csv"
loads_file = "loads_{buses}.csv"
[units]
file = "units_{buses}.csv"
alpha = 0.0
generator = "synchronous_generator_ac4a"
converter = "gfor"
""",
        encoding="utf-8",
    )
    return path


def print_growth() -> None:
    print(
        "growth (rings of generators; seconds of the linearisation's parts, total from built FMUs to eigenvalues):"
    )
    columns = (
        "FMUs",
        "states",
        "steps/s",
        "us/step/FMU",
        "outside",
        "steady",
        "blocks",
        "compose",
        "eigen",
        "total",
    )
    print("  " + "".join(f"{c:>12}" for c in columns), flush=True)
    with tempfile.TemporaryDirectory() as folder:
        for fmus in RING_FMUS:
            (prepared,) = load_case(ring_case(Path(folder), fmus - 1)).prepare()
            rate, share = best_rate(lambda p=prepared: start(p), max(500, 100_000 // fmus))  # type: ignore[misc]
            parts = linearise(prepared)
            seconds = (
                parts.steady_state,
                parts.blocks,
                parts.compose,
                parts.eigenvalues,
                parts.total,
            )
            cells = [
                f"{fmus}",
                f"{parts.model.number_of_states}",
                f"{rate:,.0f}",
                f"{1e6 / rate / fmus:.2f}",
            ]
            cells += [f"{1 - share:.1%}", *(f"{s:.2f}" for s in seconds)]
            print("  " + "".join(f"{c:>12}" for c in cells), flush=True)


def main() -> None:
    case = load_case("ieee118")
    (prepared,) = case.prepare(["pod_pq"])
    print_memory(prepared)
    print_speed(prepared)
    print_native(case, prepared)
    print_linearisation(case, prepared)
    print_growth()


if __name__ == "__main__":
    main()
