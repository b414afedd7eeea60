"""The linear models of a case's units, and how far each unit's current reaches in the closed system."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from orchestrator.cases.case import built_in_cases, load_case
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Complex, Matrix
from orchestrator.core.errors import InputError, few
from orchestrator.core.file_hashes import sha256_of
from orchestrator.linear.models.blocks import Blocks
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.linear.models.linear_model import LinearModel
from orchestrator.linear.models.linearization import continuous
from orchestrator.linear.models.steady_state import find_operating_point
from orchestrator.output.results.file_writers import measuring_places
from orchestrator.studies.modes.modes import running
from orchestrator.studies.oscillations.models import Response, UnitModel, UnitModels, turn
from orchestrator.systems.coupling.master import Master

_VOLTAGE, _CURRENT, _EMF, _SHUNT = (
    ("v_re", "v_im"),
    ("i_re", "i_im"),
    ("e_re", "e_im"),
    ("y_re", "y_im"),
)


def unit_models(prepared: PreparedScenario) -> UnitModels:
    with running(prepared) as master:
        find_operating_point(master)
        homes = _buses_of_units(prepared, master)
        scales = _sizes_of_loads(master, homes)
        observed = [f"{unit}.{i}" for unit in homes for i in _CURRENT]
        blocks = Blocks(master, inputs=scales, outputs=observed, without_step=True)
        model = continuous(blocks)
        currents = {
            unit: complex(*master.components[unit].get([*_CURRENT]).values()) for unit in homes
        }
        values = dict(zip(master.output_names, master.y.tolist(), strict=True))
    buses = tuple(dict.fromkeys(homes.values()))
    closed = _ClosedSystem.of(model, blocks.output_names, buses)
    first = len(closed.row) + len(blocks.links)
    loads = {
        name.removesuffix(".scale"): closed.reach(closed.settled[:, [first + k]])
        for k, name in enumerate(scales)
    }
    found = {}
    for unit, bus in homes.items():
        drive = closed.drive_of(unit, values)
        if drive is not None:
            voltage = complex(*(values[f"{bus}.{v}"] for v in _VOLTAGE))
            own = _admittance(blocks.components[unit])
            found[unit] = UnitModel(bus, voltage, currents[unit], own, closed.reach(drive))
    return UnitModels(found, buses, loads)


def _buses_of_units(prepared: PreparedScenario, master: Master) -> dict[str, str]:
    """The units that take a voltage and show a current, each with its bus."""
    homes = {
        name: bus
        for name, bus in measuring_places(prepared).items()
        if name in master.exchanges
        and {*_CURRENT} <= {*master.components[name].description.variables}
    }
    if not homes:
        raise InputError(
            f"{prepared.case.name}: no unit takes a voltage (v_re, v_im) and shows a current (i_re, "
            "i_im), so there are no models to compare the record with"
        )
    return homes


def _sizes_of_loads(master: Master, homes: Mapping[str, str]) -> list[str]:
    """The grid's variables by which its loads grow."""
    grid = {bus.partition(".")[0] for bus in homes.values()} & set(master.components)
    return [
        f"{name}.{v}"
        for name in sorted(grid)
        for v in master.components[name].description.variables
        if v.endswith(".scale")
    ]


@dataclass(frozen=True)
class _ClosedSystem:
    """The linear model of all components together, seen at the units' buses."""

    A: Matrix
    G: Matrix  # from what drives the outputs to the states' derivatives
    C: Matrix  # from the states to the buses' voltages
    # from what drives one output to all of them: outputs act on each other without delay
    settled: Matrix
    row: Mapping[str, int]  # of each output
    seen: Sequence[int]  # rows of the buses' voltages

    @classmethod
    def of(
        cls, model: LinearModel, outputs: Sequence[str], buses: Sequence[str]
    ) -> "_ClosedSystem":
        F, G, H, K = (M.toarray() for M in (model.F, model.G, model.H, model.K))
        settled = np.linalg.inv(np.eye(len(K)) - K)
        row = {name: k for k, name in enumerate(outputs)}
        seen = [row[f"{bus}.{v}"] for bus in buses for v in _VOLTAGE]
        return cls(F + G @ settled @ H, G, (settled @ H)[seen], settled, row=row, seen=seen)

    def reach(self, drive: Matrix) -> Response:
        """The voltages of the buses that something brings about, by which all outputs are driven."""
        return partial(_response, A=self.A, B=self.G @ drive, C=self.C, D=drive[self.seen])

    def drive_of(self, unit: str, values: Mapping[str, float]) -> Matrix | None:
        """How a current into a unit's bus drives the outputs; None if the unit gives nothing that stands for one."""
        given, y = _CURRENT, complex(1.0)
        # a source behind an admittance y, which gives y times its own voltage
        if f"{unit}.i_re" not in self.row:
            given, y = _EMF, complex(*(values.get(f"{unit}.{part}", 0.0) for part in _SHUNT))
        if not y or f"{unit}.{given[0]}" not in self.row:
            return None
        columns = [self.row[f"{unit}.{name}"] for name in given]
        drive: Matrix = self.settled[:, columns] @ np.linalg.inv(turn(y))
        return drive


def _admittance(c: ComponentLinearization) -> Response:
    """From a unit's voltage to its current."""
    assert c.A_c is not None and c.B_c is not None  # noqa: PT018 - `continuous` has refused it
    columns = [c.inputs.index(v) for v in _VOLTAGE]
    return partial(_response, A=c.A_c, B=c.B_c[:, columns], C=c.C_o, D=c.D_o[:, columns])


def _response(s: complex, A: Matrix, B: Matrix, C: Matrix, D: Matrix) -> Complex:
    return np.asarray(C @ np.linalg.solve(s * np.eye(len(A)) - A, B) + D)


def recorded_case(attributes: Mapping[str, Any]) -> PreparedScenario | None:
    """The scenario that a run's record is of, where it is one of a built-in case with the values that it has now."""
    name, text = str(attributes.get("case")), attributes.get("case_file")
    if name not in built_in_cases() or (case := load_case(name)).text != text:
        return None
    scenario, values = str(attributes["scenario"]), json.loads(attributes["values"])
    (prepared,) = case.prepare([scenario])
    given = json.loads(attributes.get("given", "{}"))
    changed = {key: value for key, value in given.items() if prepared.given.get(key) != value}
    if changed:
        (prepared,) = case.prepare([scenario], changed)
    return prepared if dict(prepared.values) == values else None


def unlike(attributes: Mapping[str, Any], prepared: PreparedScenario) -> str:
    """Tell what of a record's own case differs in the scenario whose models judge it; "" where nothing is known."""
    case, there = prepared.case, prepared.given
    found = ["the case file"] if attributes.get("case_file", case.text) != case.text else []
    for name, content in json.loads(attributes.get("inputs", "{}")).items():
        path = case.directory / name
        if path != case.path and path.is_file() and sha256_of(path) != content:
            found.append(name)
    if attributes.get("scenario", prepared.name) != prepared.name:
        found.append(f"the scenario ({attributes['scenario']!r}, not {prepared.name!r})")
    elif "given" in attributes:
        own = json.loads(attributes["given"])
        found += sorted(key for key in {*own, *there} if own.get(key) != there.get(key))
    return few(found, 4)
