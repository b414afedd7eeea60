"""Whether an FMU's outputs are there when a master initialises its partners with them."""

import numpy as np

from orchestrator.acceptance.checks.base import CheckResult, check, failed, not_applicable, passed, remarked
from orchestrator.acceptance.checks.port import POINTS
from orchestrator.acceptance.checks.running import affordable
from orchestrator.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.arrays import Numbers
from orchestrator.errors import ComponentError
from orchestrator.fmi.component import RealBatch

_LATE = 1e-3  # part of an output's size by which it may change as initialisation ends; 1e-6 is worth a remark
_CLEAR = 1e-6
_ELSEWHERE = POINTS[1]  # another operating point: at its own, an FMU may start from what it declares


@check("initial_outputs", "Are its outputs there before initialisation ends?")
def initial_outputs(subject: Subject) -> CheckResult:
    """Read them in initialisation mode, end it with the inputs as they are, and read them again.

    A master reads outputs in initialisation mode, to find inputs and outputs of all components that agree."""
    if not subject.outputs:
        return not_applicable("initial_outputs", "because the FMU has no Real outputs")
    worst, seen = 0.0, ""
    for point in (None, _ELSEWHERE) if subject.starts else (None,):
        try:
            before, after, size = _around_the_end(subject, point)
        except ComponentError:
            if point is None:
                raise
            continue  # it may not be able to work there
        apart = np.abs(after - before) / np.maximum(size, 1e-9)
        apart = np.where(np.isfinite(apart), apart, np.inf)
        k = int(np.argmax(apart))
        if apart[k] > worst:
            worst = float(apart[k])
            seen = f"{subject.outputs[k]} is {before[k]:.6g} in initialisation mode"
            seen += f" and {after[k]:.6g} just after it, at the same inputs"
    if worst > _LATE:
        return failed("initial_outputs", "outputs come late", seen, difference=worst)
    if worst > _CLEAR:
        remedy = "its partners are initialised with the first value: ask what changes it as initialisation ends"
        return remarked("initial_outputs", seen, remedy, difference=worst)
    return passed("initial_outputs", f"the end of initialisation changes no output ({worst:.1g})", difference=worst)


def _around_the_end(subject: Subject, point: OperatingAt | None) -> tuple[Numbers, Numbers, Numbers]:
    """Outputs before and after the end of initialisation, and the size that they have in a short run."""
    component = subject.open()
    try:
        subject.prepare(component, point)
        component.enter_initialization_mode()
        inputs, outputs = RealBatch(component, subject.inputs), RealBatch(component, subject.outputs)
        inputs.values[:] = subject.start_inputs(point)
        inputs.write()
        before = outputs.read().copy()
        component.exit_initialization_mode()
        after = outputs.read().copy()
    finally:
        component.close()
    steps, h = affordable(subject, 50), subject.step_size
    with subject.running(point=point) as running:
        rows = np.abs(running.record(steps, h, subject.steps(hold=5 * h)))
    size: Numbers = np.maximum(np.nan_to_num(rows, posinf=0.0).max(axis=0), np.abs(after))
    return before, after, size
