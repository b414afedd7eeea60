"""Experiments of a certificate that any FMI tool can repeat: the FMU alone, with the inputs that the test gave it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.arrays import Numbers
from orchestrator.cases.case import load_case
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.certification.anew import chosen_points
from orchestrator.certification.case_file import CASE, WITH
from orchestrator.certification.codes.bench_case import case_name
from orchestrator.certification.form import NORM
from orchestrator.certification.point import CONVERTER
from orchestrator.coupling.master import Master
from orchestrator.coupling.recorder import Recorder
from orchestrator.errors import CosimError
from orchestrator.fmi.bound import BoundComponent
from orchestrator.fmi.component import Component
from orchestrator.ssp.reference_experiment import as_csv, experiment, parameter_set
from orchestrator.study.modes import running

AFTER = 0.2  # an experiment ends so long after the first event of its row [s]
_THINNED = 10  # steps between two reference results
_REPEATED = 1e-9  # of its range, a coupled output may differ from that of the test
_TEXT = (
    "The row {row} until {after:g} s after its first event. Before each step the inputs are set to the row of the "
    "stimuli at its time, and hold; references are outputs read after a step. The tolerance is relative to an output's "
    "largest value."
)


@dataclass
class _Replay:
    """An FMU stepped alone; names are its own."""

    parameters: dict[str, float | bool | str]
    stimuli: list[list[str]]
    references: list[list[str]]
    coupled: Numbers  # the port's outputs after each step, shape (steps, outputs)


def experiments_of(folder: Path, content: dict[str, Any]) -> dict[str, bytes]:
    """Files of the experiments by name: one a row, or the least damped point of the damping test."""
    case, found = folder / CASE, dict[str, bytes]()
    if content["format"] == NORM:
        (X_L,) = chosen_points(content)
        prepared = load_case(case).prepare([WITH], {"grid.X_L": X_L})
        return _files(f"X_L_{X_L:g}", prepared[0])
    for row in content["rows"]:
        if row["judged"]:
            found |= _files(row["row"], load_case(folder / case_name(row["row"])).prepare()[0])
    return found


def _files(row: str, prepared: PreparedScenario) -> dict[str, bytes]:
    step = prepared.step_size
    first = min((event.time for event in prepared.events), default=0.0)
    steps = round(min(first + AFTER, prepared.stop_time) / step)
    into = {str(c.target.variable): str(c.source) for c in prepared.system.connections
            if c.target.component == CONVERTER}  # fmt: skip
    outputs = list(dict.fromkeys(c.source.variable for c in prepared.system.connections
                                 if c.source.component == CONVERTER))  # fmt: skip
    recorder = Recorder([*into.values(), *(f"{CONVERTER}.{name}" for name in outputs)], 1)
    with running(prepared) as master:
        master.run(steps * step, [event for event in prepared.events if event.time < steps * step], [recorder])
    given, tested = recorder.values[:, : len(into)], recorder.values[1:, len(into) :]
    with running(prepared) as master:
        replay = _replay(master, list(into), given, outputs, step)
    size = np.ptp(tested, axis=0) + np.abs(tested).max(axis=0)
    if not np.all(np.abs(replay.coupled - tested) <= _REPEATED * size):
        worst = float(np.max(np.abs(replay.coupled - tested) / size))
        raise CosimError(
            f"--into: row {row}: with the same inputs the FMU alone answers otherwise than in the test, by {worst:.2g} "
            "of an output's size, so that nobody could repeat it; look at `gfor fmu check`"
        )
    description = _own(master.components[CONVERTER]).description
    names = {"Parameters": f"{row}.parameters.ssv", "Stimuli": f"{row}.stimuli.csv",
             "References": f"{row}.references.csv"}  # fmt: skip
    return {
        f"{row}.exp": experiment(row, _TEXT.format(row=row, after=AFTER), steps * step, step, names),
        names["Parameters"]: parameter_set(row, replay.parameters, description),
        names["Stimuli"]: as_csv(replay.stimuli),
        names["References"]: as_csv(replay.references),
    }


def _own(component: Component) -> Component:
    return component.inner if isinstance(component, BoundComponent) else component


def _replay(master: Master, inputs: Sequence[str], given: Numbers, outputs: Sequence[str], step: float) -> _Replay:
    component = master.components[CONVERTER]
    own = _own(component)
    variables = own.description.variables.values()
    fed = [v.name for v in variables if v.causality == "input"]
    seen = [v.name for v in variables if v.causality == "output" and v.type == "Real"]
    parameters = own.values([v.name for v in variables if v.causality == "parameter"])
    stimuli, references = [["time", *fed]], [["time", *seen]]
    coupled = np.empty((len(given) - 1, len(outputs)))
    for k in range(len(given) - 1):
        component.set(dict(zip(inputs, map(float, given[k]), strict=True)))
        component.step(k * step, step)
        values = own.values(fed)
        stimuli.append([repr(k * step), *(repr(float(values[name])) for name in fed)])
        coupled[k] = list(component.get(outputs).values())
        if (k + 1) % _THINNED == 0:
            found = own.values(seen)
            references.append([repr((k + 1) * step), *(repr(float(found[name])) for name in seen)])
    return _Replay(dict(parameters), stimuli, references, coupled)
