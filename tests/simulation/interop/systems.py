"""The systems that run in every master, and where the emulation stands for it."""

from collections.abc import Callable
from dataclasses import dataclass

from fmus.toolchain.exporter import cached
from fmus.toolchain.model import Model
from fmus.toolchain.model_builder import ModelBuilder
from fmus.toolchain.native_fmu import NativeFmu
from fmus.toolchain.python_fmu import PythonFmu
from orchestrator.devices.fmi.description import read_description
from orchestrator.systems.coupling.system import System
from tests.support.scenarios import prepare_one

STEP_SIZE, STOP_TIME = 1e-4, 0.05
KINDS = ("Python-backed", "native")
MAGNIFIED = 1e9


@dataclass(frozen=True)
class Coupled:
    """A system and what is recorded of it: states, and outputs with direct feed-through."""

    title: str
    build: Callable[[str], System]
    record: tuple[str, ...]


def two_area(kind: str) -> System:
    """The paper's system with both POD controllers; a load is 1 % above its steady state from the start."""
    system = _prepared("two_area", "pod_pq", kind, {})
    system.components["grid"].parameters["load_2.scale"] = 1.01
    return system


def voltage_dip(kind: str) -> System:
    """A converter on an infinite bus; no master changes anything while it runs, so the FMU's own clock does."""
    timed = {
        "grid.clock.runs": True,
        "grid.dip.timed_depth": 0.2,
        "grid.dip.start": 0.01,
        "grid.dip.duration": 0.02,
    }
    return _prepared("infinite_bus", "dip", kind, timed)


def load_step(kind: str) -> System:
    timed = {"grid.clock.runs": True, "grid.load.step": 0.5, "grid.load.step_time": 0.01}
    return _prepared("infinite_bus", "load_step", kind, timed)


def _prepared(case: str, scenario: str, kind: str, values: dict) -> System:
    prepared = prepare_one(case, scenario, {"*.native": kind == "native", **values})
    return prepared.system


_SINGLE = ("gfor.p", "gfor.i_s", "gfor.omega", "gfor.i_re", "grid.v", "grid.p", "grid.v_re")
SYSTEMS = {
    "two-area system": Coupled(
        "two-area system",
        two_area,
        (
            "sg1.omega",
            "sg2.omega",
            "sg2.p",
            "gfor.p",
            "gfor.i_re",
            "gfor.delta_p_pod",
            "grid.bus_2.v",
            "grid.L.p",
        ),
    ),
    "voltage dip": Coupled("converter on an infinite bus, voltage dip", voltage_dip, _SINGLE),
    "load step": Coupled("converter on an infinite bus, load step", load_step, _SINGLE),
}


def with_magnifier(system: System, record: tuple[str, ...], kind: str) -> tuple[System, list[str]]:
    """Add a component that shows what is recorded 10⁹ times larger, for a tool that writes six decimals."""
    model = _magnifier(len(record))
    path = cached((NativeFmu if kind == "native" else PythonFmu)(model))
    system.add("magnifier", read_description(path))
    for index, name in enumerate(record):
        system.connect(name, f"magnifier.u_{index}")
    return system, [f"magnifier.y_{index}" for index in range(len(record))]


def _magnifier(size: int) -> Model:
    m = ModelBuilder(f"magnifier_{size}", "Shows its inputs larger")
    for index in range(size):
        m.output(
            f"y_{index}",
            MAGNIFIED * m.input(f"u_{index}", "pu", "What is shown", base="any"),
            "pu",
            "Large",
            base="any",
        )
    return m.build()
