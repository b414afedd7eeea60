"""The grid-forming converter at a source behind an impedance, in one model: no communication step lies between."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fmus.toolchain.exporter import cached
from fmus.toolchain.frames import Phasor, polar, power
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.port import declare_rating, port_at
from fmus.toolchain.symbols import Expr
from gfor_fmu.converter import P_0, S_N, declare_converter, declare_converter_outputs
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.description import FmuDescription, read_description
from orchestrator.devices.fmi.loaded_component import LoadedComponent

X_R = 6.0
"""X/R of the grid's impedance: that of MISO's and AEMO's tests of grid-forming converters."""

B = 0.03
"""Capacitance at the bus [pu, S_n]."""

SIGNALS = ("droop.theta", "i_s", "omega", "v", "p", "q", "current_demand")


def converter_at_grid() -> Model:
    """The converter, a bus with capacitance, and a source whose voltage and angle can be set while it runs."""
    m = ModelBuilder("gfor_at_grid", "Grid-forming converter at a source behind an impedance")
    rating = declare_rating(m, S_N)
    R = m.parameter("R", 0.05, "pu", "Resistance of the grid", base="S_n", minimum=0)
    X = m.parameter("X", 0.3, "pu", "Reactance of the grid", base="S_n", minimum=1e-3)
    depth = m.parameter(
        "source.v", 1.0, "1", "Voltage of the source, of that at the start", minimum=0, tunable=True
    )
    jump = m.parameter(
        "source.jump", 0.0, "rad", "Angle of the source, beyond that at the start", tunable=True
    )
    v_re, v_im = m.algebraic("v_re"), m.algebraic("v_im")
    port = port_at(m, Phasor(v_re, v_im), P_0, rating / 100.0)
    converter = declare_converter(m, port)
    line_0 = port.i_0 - Phasor(0.0, B) * port.v_0
    source_0 = port.v_0 - Phasor(R, X) * line_0
    line, v = (
        Phasor(
            *(
                m.state(f"{name}_{part}", getattr(start, part), "pu", text, base="S_n")
                for part in ("re", "im")
            )
        )
        for name, start, text in (
            ("line", line_0, "Current into the grid"),
            ("bus", port.v_0, "Bus voltage"),
        )
    )
    m.close(v_re, v.re)
    m.close(v_im, v.im)
    source = source_0 * polar(depth, jump)
    rates = (
        (line, (v - source - Phasor(R, X) * line) * (port.omega_b / X)),
        (v, (converter.current - line - Phasor(0.0, B) * v) * (port.omega_b / B)),
    )
    for state, rate in rates:
        m.derivative(Expr(state.re), rate.re)
        m.derivative(Expr(state.im), rate.im)
    s = power(v, converter.current)
    m.output("v", v.magnitude(), "pu", "Bus voltage magnitude", base="bus")
    m.output("p", s.re, "pu", "Active power into the bus", base="S_n")
    m.output("q", s.im, "pu", "Reactive power into the bus", base="S_n")
    declare_converter_outputs(m, converter)
    return m.build()


@dataclass(frozen=True)
class Response:
    """Signals every millisecond, by name; ``jump`` is where the source's angle ended [rad]."""

    time: NDArray[np.float64]
    signals: dict[str, NDArray[np.float64]]
    jump: float

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        return self.signals[name]

    @property
    def keeps_synchronism(self) -> bool:
        """Whether it ends within its limit and within 0.5 rad of the source's new angle, without a turn more or less.

        What slips is limited again in every turn, or runs at another frequency. With POD-P the angle is slow to return.
        """
        turned = self["droop.theta"][-1] - self["droop.theta"][0] - self.jump
        free = (self["current_demand"][-200:] < 1).all()
        return bool(free and abs(turned) < 0.5 and abs(self["omega"][-1] - 1) < 2e-3)


Stage = tuple[float, dict[str, float]]
"""What is set, and for how long it stays [s]."""


@cache
def _described() -> FmuDescription:
    """The model's FMU; to find it, its equations are written, which takes ten times a run of it."""
    return read_description(cached(NativeFmu(converter_at_grid())))


class AtGrid:
    """Runs of that model at one short-circuit ratio; use it as a context manager."""

    def __init__(self, scr: float) -> None:
        self._description = _described()
        X = X_R / np.hypot(1, X_R) / scr
        self._grid = {"R": X / X_R, "X": X}

    def run(self, values: dict[str, float], stages: list[Stage]) -> Response:
        """From the steady state through all stages."""
        rows, interval, time = [], 1e-3, 0
        with LoadedComponent("gfor_at_grid", self._description) as device:
            device.set(self._grid | values)
            device.setup(0.0, None)
            device.enter_initialization_mode()
            device.exit_initialization_mode()
            batch = RealBatch(device, list(SIGNALS))
            rows.append(batch.read().copy())
            jump = 0.0
            for seconds, change in stages:
                device.set(change)
                jump = change.get("source.jump", jump)
                for _ in range(round(seconds / interval)):
                    device.step(time * interval, interval)
                    time += 1
                    rows.append(batch.read().copy())
        table = np.array(rows, dtype=np.float64)
        columns = {name: table[:, k] for k, name in enumerate(SIGNALS)}
        return Response(np.arange(len(table), dtype=np.float64) * interval, columns, jump)
