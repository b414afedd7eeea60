"""Whether a system is stable, asked in four ways: ``python -m tests.benchmarks.detunings``.

Forty detunings of droops, damping controllers, exciters, governors, network, communication step and schedule, drawn by
a seed. For each: the program's verdict; 60 s simulated with the FMUs and judged by the record alone; the exact
Jacobians of the continuous system; the exact step map of the coupled one. Prints a row for each.
"""

import argparse
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from orchestrator.cases.case import Case, load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.errors import CosimError
from orchestrator.core.threads import alone
from orchestrator.linear.spectra.stability import Cause, Stability
from orchestrator.studies.modes.modes import compute_modes
from orchestrator.systems.coupling.events import Event, LoadChange, ReferenceChange
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder
from orchestrator.systems.coupling.schedule import jacobi
from tests.support.exact import exact_continuous, exact_step_map, network_of

CASES = {"two_area": "two_area", "wscc9": str(Path(__file__).parent / "nine_buses" / "case.toml")}
SEED, FORTY = 631, range(40)

SECONDS = 60.0
PULSE = 1e-4
"""Size of the disturbance, in parts of a load and of references [pu], from 0.1 to 0.2 s."""

FAR = 1.0
"""A deviation [pu; the network's powers on 100 MVA] that the pulses do not cause in a stable system: 0.05 at most."""

ROUNDING = 3e-11
"""A deviation [pu] that is rounding."""

WINDOW, TAIL = 2.5, 30.0
"""Length of a window, and where the record's later part begins [s]."""


@dataclass(frozen=True)
class Detuning:
    """A scenario with other values, and how it is coupled."""

    name: str
    case: str
    scenario: str
    values: dict[str, float | bool]
    step_size: float = 100e-6
    jacobi: bool = False

    def prepared(self) -> tuple[Case, PreparedScenario]:
        case = load_case(CASES[self.case])
        values = {"*.native": True} | self.values
        (ready,) = case.prepare(
            [self.scenario], values, step_size=self.step_size, stop_time=SECONDS
        )
        if self.jacobi:
            ready = replace(ready, schedule=jacobi(tuple(ready.system.components)))
        return case, ready


@dataclass(frozen=True)
class Answers:
    """Growth rates [1/s] by every way, and what the simulation ended with."""

    program: Stability
    simulated: float
    system: float
    coupled: float
    ending: str

    @property
    def agree(self) -> bool:
        """Whether the program says what the others do, and blames what they do where only one of two grows."""
        stable = self.system <= 0 and self.coupled <= 0
        only_coupled = self.system <= 0 < self.coupled
        blamed = self.program.cause is Cause.COUPLING if only_coupled else True
        return (
            self.program.stable == stable and blamed and (self.simulated > 0) == (self.coupled > 0)
        )

    @property
    def verdict(self) -> str:
        """The program's, in a few words."""
        cause = f" by the {self.program.cause}" if self.program.cause else ""
        hidden = (
            ", hidden by the step" if self.program.stable is False and self.coupled <= 0 else ""
        )
        return f"{self.program.verdict}{cause}{hidden}" + (
            "" if self.agree else ": **they differ**"
        )


# -- linear --------------------------------------------------------------------------------------------


def growth(values: np.ndarray) -> float:
    """Largest real part but for the common angle's, which is 0 where nothing fixes it."""
    return float(np.delete(values, np.argmin(np.abs(values))).real.max())


def exact_growth(case: Case, ready: PreparedScenario, detuning: Detuning) -> tuple[float, float]:
    """Of the continuous system, and of the step map with exactly integrated devices."""
    network = (
        network_of(case, detuning.scenario, detuning.values) if detuning.case == "wscc9" else None
    )
    system = growth(np.linalg.eigvals(exact_continuous(ready, network)[0]))
    multipliers = np.linalg.eigvals(exact_step_map(ready, network)).astype(complex)
    coupled = np.log(multipliers[np.abs(multipliers) > 1e-9]) / ready.step_size
    return system, growth(coupled)


# -- simulation ----------------------------------------------------------------------------------------


def pulses(ready: PreparedScenario) -> list[Event]:
    """A load and one reference of every unit for a tenth of a second, each a little otherwise."""
    load = next(
        v.rpartition(".")[0]
        for v in sorted(ready.system.components["grid"].description.variables)
        if v.endswith(".scale")
    )
    events: list[Event] = [
        LoadChange(t, "grid", load, scale) for t, scale in ((0.1, 1 + PULSE), (0.2, 1.0))
    ]
    for k, name in enumerate(sorted(set(ready.system.components) - {"grid"})):
        reference = "exciter.V_ref" if name.startswith("sg") else "droop.P_ref"
        size = PULSE * (0.6 + 0.3 * k) * (-1) ** k
        events += [
            ReferenceChange(t, name, reference, delta) for t, delta in ((0.1, size), (0.2, 0.0))
        ]
    return events


def signals(ready: PreparedScenario) -> list[str]:
    """Speeds, powers and voltage magnitudes: nothing that turns with the common angle."""
    shown = {"omega", "p", "q", "v_t", "v", "u"}
    return [
        f"{name}.{variable}"
        for name, plan in ready.system.components.items()
        for variable, v in plan.description.variables.items()
        if variable.rpartition(".")[2] in shown and v.causality == "output"
    ]


def simulated_growth(ready: PreparedScenario) -> tuple[float, str]:
    """Growth [1/s] as the record shows it; +inf where the system left its operating point, −inf where it is at rest."""
    recorder = Recorder(signals(ready), max(1, round(5e-3 / ready.step_size)))
    start, size = None, []
    with Master(ready.system, ready.schedule, ready.step_size, SECONDS) as master:
        for stop in np.arange(2.0, SECONDS + 1, 2.0):
            due = pulses(ready) if stop == 2.0 else []
            try:
                master.run(float(stop), due, [recorder])
            except CosimError as error:
                return np.inf, f"failed by {master.time:.2f} s: {str(error)[:60]}"
            start = recorder.values[0].copy() if start is None else start
            size.append((recorder.times.copy(), np.linalg.norm(recorder.values - start, axis=1)))
            if not np.isfinite(size[-1][1]).all() or size[-1][1].max() > FAR:
                return np.inf, f"{FAR:g} pu away at {master.time:.0f} s"
    times, away = (np.concatenate(parts) for parts in zip(*size, strict=True))
    return growth_of_record(times, away)


def growth_of_record(times: np.ndarray, away: np.ndarray) -> tuple[float, str]:
    """Slope of the logarithm of the deviation's rms value over windows of the record's later half."""
    middles = np.arange(TAIL, SECONDS - WINDOW / 2, WINDOW) + WINDOW / 2
    rms = np.array([np.sqrt(np.mean(away[np.abs(times - t) <= WINDOW / 2] ** 2)) for t in middles])
    if rms[-1] < ROUNDING:
        return -np.inf, "at rest"
    slope = np.polyfit(middles, np.log(rms), 1)[0]
    return float(slope), f"{rms[0]:.2g} to {rms[-1]:.2g} pu"


# -- all together --------------------------------------------------------------------------------------


def ask(detuning: Detuning) -> Answers:
    """All four ways."""
    with alone():
        case, ready = detuning.prepared()
        system, coupled = exact_growth(case, ready, detuning)
        program = compute_modes(ready).stability
        simulated, ending = simulated_growth(ready)
    return Answers(program, simulated, system, coupled, ending)


# -- drawing -------------------------------------------------------------------------------------------

UNITS = {
    "two_area": (("sg1", "sg2"), ("gfor",)),
    "wscc9": (("sg1", "sg2", "sg3"), ("gfor1", "gfor2", "gfor3")),
}
EXCITERS = {"sg1": ("K_PR", "K_IR"), "sg2": ("K_A", "T_C")}
GAINS = {"K_A": 200.0, "T_C": 1.0, "K_PR": 3.15, "K_IR": 3.15}


def spread(rng: np.random.Generator, value: float, low: float, high: float) -> float:
    """A value times a factor between ``low`` and ``high``, drawn on a logarithmic scale; three digits."""
    return float(f"{value * np.exp(rng.uniform(np.log(low), np.log(high))):.3g}")


def drawn_values(rng: np.random.Generator, case: str, scenario: str) -> dict[str, float | bool]:
    """One to three groups of parameters of one device each, and the network."""
    machines, converters = UNITS[case]
    values: dict[str, float | bool] = {}
    for group in rng.choice(
        ["droop", "pod", "avr", "governor", "network"], rng.integers(1, 4), replace=False
    ):
        sg, gfor = rng.choice(machines), rng.choice(converters)
        if group == "droop" and scenario != "base":
            values[f"{gfor}.droop.R_f"] = spread(rng, 0.05, 0.2, 60)
            values[f"{gfor}.droop.R_V"] = spread(rng, 0.067, 0.1, 15)
            values[f"{gfor}.droop.tau_P"] = spread(rng, 0.1, 0.1, 8)
        elif group == "pod" and scenario.startswith("pod"):
            kind = scenario[4]
            values[f"{gfor}.pod_{kind}.K"] = spread(rng, 200, 0.3, 30)
            values[f"{gfor}.pod_{kind}.T_S1"] = spread(rng, 0.2, 0.2, 4)
            values[f"{gfor}.pod_{kind}.T_S2"] = spread(rng, 0.3, 0.2, 4)
        elif group == "avr":
            names = EXCITERS[sg] if case == "two_area" else ("K_A", "T_C")
            values |= {f"{sg}.exciter.{k}": spread(rng, GAINS[k], 0.1, 8) for k in names}
        elif group == "governor":
            values[f"{sg}.governor.inverse_R"] = spread(rng, 20, 0.1, 10)
        elif group == "network":
            line = (
                "X_L"
                if case == "two_area"
                else rng.choice(["X_line_5_6", "X_line_6_7", "X_line_8_9"])
            )
            start = {"X_L": 0.1, "X_line_5_6": 0.17, "X_line_6_7": 0.1008, "X_line_8_9": 0.161}[
                line
            ]
            values[f"grid.{line}"] = spread(rng, start, 0.2, 5)
    return values


def drawn(seed: int, index: int) -> Detuning:
    """One candidate; every fifth is coupled as it should not be."""
    rng = np.random.default_rng([seed, index])
    case = ("two_area", "wscc9")[index % 2]
    choices = (
        ("base", "gfor", "pod_p", "pod_q", "pod_pq")
        if case == "two_area"
        else ("base", "gfor", "pod_pq")
    )
    scenario = str(rng.choice(choices))
    values = drawn_values(rng, case, scenario)
    detuning = Detuning(f"{case} {index}", case, scenario, values)
    if index % 5 == 4:
        step = float(rng.choice([100e-6, 200e-6, 400e-6, 500e-6]))
        detuning = replace(detuning, step_size=step, jacobi=bool(rng.integers(2)))
    return detuning


CHOSEN_BY_HAND = (
    Detuning("hidden by the step", "two_area", "pod_q", {"grid.X_L": 0.01, "gfor.pod_q.K": 1510.0}),
    Detuning("nine buses, R_f = 3", "wscc9", "gfor", {"gfor3.droop.R_f": 3.0}),
)
"""A growth of 0.017 1/s at 44 Hz that a step of 100 µs damps away; and one of 120 1/s at 37 Hz."""


def safely(detuning: Detuning) -> Answers | str:
    """A candidate that has no operating point is none."""
    try:
        return ask(detuning)
    except CosimError as error:
        return f"refused: {str(error)[:200]}"


def row(detuning: Detuning, answers: Answers | str) -> str:
    """A line of the page's table."""
    set_to = ", ".join(f"{name} = {value:g}" for name, value in detuning.values.items())
    how = f"{1e6 * detuning.step_size:g} µs{', Jacobi' if detuning.jacobi else ''}"
    if isinstance(answers, str):
        return f"| {detuning.name} | {detuning.scenario} | {set_to} | {how} | {answers} |"
    figures = " | ".join(
        f"{x:+.4g}" for x in (answers.program.largest_growth_rate, answers.coupled, answers.system)
    )
    simulated = (
        answers.ending
        if np.isinf(answers.simulated)
        else f"{answers.simulated:+.3g} ({answers.ending})"
    )
    return f"| {detuning.name} | {detuning.scenario} | {set_to} | {how} | {figures} | {simulated} | {answers.verdict} |"


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "indices", type=int, nargs="*", default=FORTY, help="of other draws than the forty"
    )
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    chosen = [*(drawn(options.seed, k) for k in options.indices), *CHOSEN_BY_HAND]
    agree = 0
    with ProcessPoolExecutor(options.workers) as pool:
        for detuning, answers in zip(chosen, pool.map(safely, chosen), strict=True):
            print(row(detuning, answers), flush=True)
            agree += isinstance(answers, Answers) and answers.agree
    print(f"{agree} of {len(chosen)} agree")
    return int(agree < len(chosen))


if __name__ == "__main__":
    sys.exit(main())
