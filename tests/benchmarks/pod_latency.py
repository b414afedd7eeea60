"""Damping against the delay of the POD controllers' measurement, and the delay that they bear: `pod-latency.md`.

    python -m tests.benchmarks.pod_latency            prints the tables of the two-area system
    python -m tests.benchmarks.pod_latency ieee118    the delays that the IEEE 118-bus system bears
    python -m tests.benchmarks.pod_latency figure X   draws the two-area system's figure to the file X

The cases are the built-in ones with the model `gfor_pod_input` in place of `gfor`: its POD controllers act on an input,
and the connection from the converter's own frequency to that input has the delay.
"""

import sys
import tempfile
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tomli_w
from numpy.typing import NDArray

from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.linear.models.coupled_state import CoupledState
from orchestrator.linear.models.delays import WireLink
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import Blocks, compose
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.linear.signals.identification import identify_modes, nearest
from orchestrator.linear.spectra.critical_modes import find_critical_modes
from orchestrator.linear.spectra.modes import eigenvalues, find_spectrum
from orchestrator.studies.modes.naming import named_modes
from orchestrator.systems.coupling.master import Master
from orchestrator.systems.coupling.recorder import Recorder

PODS = {"pod_p": "POD-P", "pod_q": "POD-Q", "pod_pq": "both"}
DELAYS = (0.0, 0.01, 0.02, 0.05, 0.1, 0.15, 0.2)
"""Of the table [s]."""

LOOKS = {
    "two_area": (tuple(np.arange(0.005, 1.0, 0.005).tolist()), 1e-4),
    "ieee118": ((0.02, 0.03, 0.045, 0.065, 0.1, 0.15, 0.22, 0.33, 0.5, 0.75, 1.1), 1e-3),
}
"""Delays [s] that are looked at for the first crossing, and how closely it is halved in [s]."""

_AMPLITUDE = 1e-5
"""Of a motion in one mode: of the state that takes part most [its unit]."""

_EM_HZ = (0.1, 2.0)
_DENSE = 400
_FASTEST_HZ = 20.0
"""Modes that a delay of a measurement can move: above, the POD controllers' low-pass leaves nothing of it."""


def delayed_case(name: str, folder: Path) -> Case:
    """A built-in case with the POD controllers' measurement as a connection, and its delay as `latency`."""
    home = BUILT_IN / name
    raw = tomllib.loads((home / "case.toml").read_text(encoding="utf-8"))
    for key in ("plots", "reference"):
        raw.pop(key, None)
    for key in ("lines_file", "loads_file"):
        if key in raw.get("network", {}):
            raw["network"][key] = str(home / raw["network"][key])
    if "units" in raw:
        raw["units"] |= {"converter": "gfor_pod_input", "file": str(home / raw["units"]["file"])}
        rows = (home / "units.csv").read_text(encoding="utf-8").splitlines()[1:]
        converters = [f"gfor{row.partition(',')[0]}" for row in rows]
    else:
        raw["components"]["gfor"]["model"] = "gfor_pod_input"
        converters = ["gfor"]
    raw["connections"] = [{"from": f"{c}.omega", "to": f"{c}.omega_pod"} for c in converters]
    raw["imperfections"] = {
        "latency": {"type": "delay", "connection": "gfor*.omega -> gfor*.omega_pod", "delay": 0.0}
    }
    raw["scenarios"] = {pod: raw["scenarios"][pod] for pod in PODS}
    path = folder / "case.toml"
    path.write_text(tomli_w.dumps(raw), encoding="utf-8")
    return load_case(path)


@dataclass
class Latency:
    """The linear model of a scenario with any delay of the POD controllers' measurement."""

    case: Case
    blocks: Blocks
    master: Master

    def model(self, delay: float) -> LinearModel:
        """The step map with this delay [s]."""
        wires = [c for c in self.master.system.connections if c.target.variable == "omega_pod"]
        self.blocks.links = (
            {c.target: WireLink(str(c), delay, is_cut=False) for c in wires} if delay else {}
        )
        return compose(self.blocks, self.master.schedule)

    def damping(self, delay: float) -> dict[str, complex]:
        """The modes that fit the case's names best [rad/s], also where another one fits about as well."""
        model = self.model(delay)
        modes = [mode for mode in find_spectrum(model, *_EM_HZ).modes if mode.is_oscillation]
        return {
            name: mode.eigenvalue
            for name, (mode, _) in named_modes(self.case, model, modes).fits.items()
        }

    def mode(self, delay: float) -> complex:
        """The first of them."""
        return next(iter(self.damping(delay).values()))

    def motion(self, delay: float, wanted: complex) -> tuple[NDArray[np.complex128], complex]:
        """The states' and the measured frequency's part in a mode [rad/s]."""
        model = self.model(delay)
        modes = find_spectrum(model, _EM_HZ[0], _FASTEST_HZ).modes
        shape = min(modes, key=lambda mode: abs(mode.eigenvalue - wanted)).shape
        states = np.array([shape[name] for name in model.names])
        outputs = model.settle((model.H @ states).real.copy()) + 1j * model.settle(
            (model.H @ states).imag.copy()
        )
        return states, complex(outputs[self.master.output_names.index("gfor.omega")])

    def worst(self, delay: float) -> complex:
        """The mode of least damping up to 20 Hz [rad/s]; in a large system −1 where all have more than 6 %."""
        model = self.model(delay)
        if len(model.names) > _DENSE:
            critical = find_critical_modes(model, _EM_HZ[0], _FASTEST_HZ, 0.06)
            return critical[0].eigenvalue if critical else complex(-1.0)
        values = eigenvalues(model)
        swinging = values[
            (values.imag > 2 * np.pi * 0.05) & (values.imag < 2 * np.pi * _FASTEST_HZ)
        ]
        return complex(swinging[np.argmax(swinging.real / np.abs(swinging))])

    def margin(self, least: float, looks: Sequence[float], close: float) -> tuple[float, complex]:
        """The smallest delay [s] at which a mode has no more than this damping ratio, and that mode.

        Parameters
        ----------
        least
            Damping ratio.
        looks
            Delays at which the crossing is looked for [s], rising.
        close
            How closely it is halved in [s].
        """

        def worst(delay: float) -> tuple[bool, complex]:
            mode = self.worst(delay)
            return -mode.real <= least * abs(mode), mode

        low = 0.0
        for high in looks:
            short, mode = worst(high)
            if short:
                break
            low = high
        else:
            return float("inf"), 0j
        while high - low > 1.001 * close:
            middle = low + round((high - low) / 2 / close) * close
            short, there = worst(middle)
            low, high, mode = (low, middle, there) if short else (middle, high, mode)
        return high, mode


@contextmanager
def latency(case: Case, scenario: str) -> Iterator[Latency]:
    """A scenario, linearised without a delay."""
    (prepared,) = case.prepare([scenario])
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        find_operating_point(master)
        yield Latency(case, Blocks(master), master)


def rung_down(
    case: Case, scenario: str, delay: float, system: Latency, eigenvalue: complex
) -> complex:
    """A mode [rad/s] of the two-area system in a run that begins in it: the states, and what is on its way, move in it.

    So the mode is seen by itself where another one grows as well.

    Parameters
    ----------
    case, scenario
        What is run.
    delay
        Of the measurement [s].
    system
        The same scenario's linear model.
    eigenvalue
        The mode [rad/s].
    """
    states, measured = system.motion(delay, eigenvalue)
    (prepared,) = case.prepare([scenario], {"imperfections.latency.delay": delay})
    recorder = Recorder(["sg1.omega", "sg2.omega"], 50)
    with Master(prepared.system, prepared.schedule, prepared.step_size) as master:
        find_operating_point(master)
        coupled = CoupledState(master)
        x = coupled.read()
        coupled.write(x + _AMPLITUDE * states[: len(x)].real)
        for bank in master.wires.banks:
            if bank is not None:
                (ring,) = bank._rings
                ago = np.arange(len(ring), 0, -1)  # the oldest stands where the next is written
                ring[:] = (
                    1
                    + _AMPLITUDE * (measured * np.exp(-eigenvalue * ago * prepared.step_size)).real
                )
        master.run(2.0, (), [recorder])
    return nearest(
        identify_modes(recorder.times, recorder.values[:, 0] - recorder.values[:, 1]), eigenvalue
    ).eigenvalue


def percent(value: complex) -> float:
    """Damping ratio [%]."""
    return -100 * value.real / abs(value)


def main(name: str = "two_area") -> None:
    """Print the tables."""
    with tempfile.TemporaryDirectory() as folder:
        case = delayed_case(name, Path(folder))
        for pod, title in PODS.items():
            with latency(case, pod) as system:
                for least in (0.0, 0.05):
                    delay, mode = system.margin(least, *LOOKS[name])
                    print(
                        f"{title}: damping {100 * least:g} % at {1e3 * delay:.1f} ms, {mode:.4g} rad/s",
                        flush=True,
                    )
                for delay in DELAYS if name == "two_area" else ():
                    mode = system.mode(delay)
                    seen = rung_down(case, pod, delay, system, mode)
                    text = f"step map {percent(mode):.2f} %, ring-down {percent(seen):.2f} %"
                    print(f"{title}: {1e3 * delay:g} ms: {text}", flush=True)


def draw(picture: str) -> None:
    """The two-area system's damping against the delay: step map as lines, ring-down as marks."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only this needs it

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    with tempfile.TemporaryDirectory() as folder:
        case = delayed_case("two_area", Path(folder))
        for k, (pod, title) in enumerate(PODS.items()):
            with latency(case, pod) as system:
                delays = np.linspace(0, 0.2, 21)
                label = f"{title}, inter-area mode"
                axes.plot(
                    1e3 * delays, [percent(system.mode(d)) for d in delays], f"C{k}-", label=label
                )
                seen = [percent(rung_down(case, pod, d, system, system.mode(d))) for d in DELAYS]
                axes.plot(1e3 * np.array(DELAYS), seen, f"C{k}o", label=f"{title}, simulated")
                if pod != "pod_q":
                    worst = [percent(system.worst(d)) for d in delays]
                    axes.plot(
                        1e3 * delays,
                        worst,
                        f"C{k}:",
                        label=f"{title}, least damped mode up to 20 Hz",
                    )
    axes.axhline(0, color="black", linewidth=0.8)
    axes.set(xlabel="Delay of the POD controllers' input [ms]", ylabel="Damping [%]")
    axes.legend(fontsize="small")
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    if sys.argv[1:2] == ["figure"]:
        draw(sys.argv[2])
    else:
        main(*sys.argv[1:])
