"""A case with a device at some buses, which feeds nothing at rest, and how it answers a voltage."""

import cmath
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from fmus.toolchain.port_variables import SYSTEM_BASE_MVA
from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import ComponentTable
from orchestrator.cases.scenario.prepare import PreparedScenario
from orchestrator.core.arrays import Vector
from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.linear.models.component_linearization import ComponentLinearization
from orchestrator.systems.coupling.master import Master

OURS_MVA = 100.0
STAGES = 3  # lead/lag stages of a POD that is put somewhere: together they turn by any angle


def converter(prepared: PreparedScenario, rating: float, controller: str | None) -> ComponentTable:
    """The catalogue's grid-forming converter of a rating [MVA], of the kind that the network takes; one of its PODs is
    going to be tuned."""
    grid = prepared.case.table.power_flow
    is_phasor = grid is not None and prepared.system.components[grid.grid].is_of_phasors
    model = "gfor_phasor" if is_phasor else "gfor"
    stages = {f"{controller}.N_S": STAGES} if controller else {}
    return ComponentTable(model=model, parameters={"S_n": rating, "P_0": 0.0, "Q_0": 0.0, **stages})


def foreign(fmu: Path, binding: Path | None, rating: float | None) -> ComponentTable:
    for path in (fmu, *([binding] if binding else [])):
        if not path.is_file():
            raise InputError(
                f"{path}: there is no such file; "
                + Option.DEVICE
                + " takes pod_p, pod_q, droop or the path of an FMU"
            )
    own = str(binding.absolute()) if binding else None
    values = {"P_0": 0.0, "Q_0": 0.0, **({} if rating is None else {"S_n": rating})}
    return ComponentTable(fmu=str(fmu.absolute()), binding=own, parameters=values)


def name_at(bus: str) -> str:
    return f"site_{bus}"


def with_devices(case: Case, device: ComponentTable, buses: Sequence[str]) -> Case:
    table = case.table
    further: Mapping[str, ComponentTable] = {
        name_at(b): device.model_copy(update={"bus": b}) for b in buses
    }
    taken = [name for name in further if name in table.components]
    if taken:
        raise InputError(
            f"{case.source}: the name {taken[0]!r} is for what `gfor site` puts there; give it another name"
        )
    grid = table.power_flow.grid if table.power_flow else ""
    groups = table.solver.groups
    if groups:
        first = next((k for k, group in enumerate(groups) if grid not in group), 0)
        groups = [[*group, *further] if k == first else group for k, group in enumerate(groups)]
    solver = table.solver.model_copy(update={"groups": groups})
    changed = table.model_copy(
        update={"components": {**table.components, **further}, "solver": solver}
    )
    return replace(case, table=changed)


ACTIVE = "P"  # kind of support: active power
REACTIVE = "Q"  # kind of support: reactive power


def ideal_support(kind: str, voltage: complex, eigenvalue: complex) -> Vector:
    """1 MW less, or 1 Mvar more, for each Hz that the bus's frequency is high, which is λ/2π times its angle. A power S
    is the current conj(S/v)."""
    power = {ACTIVE: -1.0 + 0j, REACTIVE: 1j}[kind] / SYSTEM_BASE_MVA
    current = (power / voltage).conjugate()
    angle = np.array([-voltage.imag, voltage.real]) / abs(voltage) ** 2
    frequency = eigenvalue / (2 * math.pi) * angle
    return np.asarray(np.outer([current.real, current.imag], frequency))


def response_of(master: Master, model: ComponentLinearization, eigenvalue: complex) -> Vector:
    """Response of a running component's current [pu, 100 MVA] to its bus voltage at λ [rad/s], shape (2, 2).

    The component answers the voltage at a step's beginning. A phasor network takes its admittance at the step's end."""
    z = cmath.exp(eigenvalue * master.clock.step_size)
    voltage = [model.inputs.index(part) for part in ("v_re", "v_im")]
    states = np.linalg.solve(z * np.eye(len(model.A)) - model.A, model.B[:, voltage])

    def answer(*parts: str) -> Vector:
        rows = [model.outputs.index(part) for part in parts]
        return np.asarray(z * model.C[rows] @ states + model.D[np.ix_(rows, voltage)])

    if "e_re" not in model.outputs:
        return answer("i_re", "i_im")
    y = complex(*master.components[model.name].get(["y_re", "y_im"]).values())
    times = np.array([[y.real, -y.imag], [y.imag, y.real]])
    return np.asarray(times @ (answer("e_re", "e_im") - z * np.eye(2)))


def turned(response: Vector, angle: float) -> Vector:
    """The response at a bus whose voltage is ahead by an angle [rad] of that where it was found."""
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return np.asarray(turn @ response @ turn.T)
