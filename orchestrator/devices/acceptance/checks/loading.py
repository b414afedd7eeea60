"""Checks that an FMU's binary can be loaded here and gives an instance; how that initialises, and what it does
with calls that FMI forbids."""

from collections.abc import Callable

import numpy as np

from orchestrator.core.arrays import Numbers
from orchestrator.core.errors import (
    ComponentError,
    EndedError,
    InputError,
    UnsupportedFmuError,
    few,
)
from orchestrator.devices.acceptance.checks.base import (
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    provoked,
    remarked,
)
from orchestrator.devices.acceptance.checks.port import POINTS
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.subject import OperatingAt, Subject
from orchestrator.devices.acceptance.process import HostedComponent, ProcessEndedError
from orchestrator.devices.fmi.component import RealBatch
from orchestrator.devices.fmi.port_mapping import without_binding
from orchestrator.devices.sandbox.answer_forms import names


@check("loads", "Can its binary be loaded here, and does it give an instance?")
def loads(subject: Subject) -> CheckResult:
    """Say once what this machine lacks; nothing that needs an instance is asked then."""
    described, process = without_binding(subject.description), subject.process()
    try:
        answer = process.talk("loading its binary", -1, "absent_functions")
    except UnsupportedFmuError:
        raise
    except InputError as error:
        return failed("loads", "binary not loadable", str(error))
    both = answer if isinstance(answer, list) and len(answer) == 2 else (None, None)
    missing, spare = (process.typed(names, found) for found in both)
    if missing:
        says = f"its binary has no {', '.join(missing)}, which what it declares needs"
        return failed("loads", "missing function", says)
    try:
        subject.open().close()
    except ComponentError as error:
        return failed("loads", "no instance", str(error))
    clocks = f"; it has {len(described.clocks)} clocks, which tick here" if described.clocks else ""
    if spare:
        says = f"its binary has no {few(spare, 3)}, which nothing that it declares needs{clocks}"
        remedy = f"FMI {described.fmi_version} asks for all of them; other masters may refuse it, tell the author"
        return remarked("loads", says, remedy)
    return passed("loads", f"its binary loads, has all functions, and gives an instance{clocks}")


@check("call_order", "Does it refuse calls out of order, and survive them?")
def call_order(subject: Subject) -> CheckResult:
    """Make three calls that FMI forbids, each in an instance of its own; what an FMU does then is provoked."""
    h = subject.step_size
    steps: dict[str, tuple[Callable[[Subject], HostedComponent], float, float]] = {
        "before initialisation": (Subject.open, 0.0, h),
        "of size 0": (_stepped, h, 0.0),
        "backwards": (lambda subject: subject.running().component, 0.0, -h),
    }
    accepted, ended = [], []
    for words, (begin, time, step_size) in steps.items():
        component = begin(subject)  # until here all is allowed
        try:
            if _accepts(component, time, step_size):
                accepted.append(f"a step {words}")
        except ProcessEndedError as error:
            ended.append(f"after a step {words}, {error.fault}: {error.how}")
    if ended:
        return provoked("call_order", "; ".join(ended))
    if accepted:
        remedy = "FMI forbids these calls; a master that makes them by mistake will not be told"
        return remarked("call_order", f"it accepts {' and '.join(accepted)}", remedy)
    return passed("call_order", "steps before initialisation, of size 0 and backwards are refused")


def _stepped(subject: Subject) -> HostedComponent:
    running = subject.running()
    running.step(subject.step_size)
    return running.component


def _accepts(component: HostedComponent, time: float, step_size: float) -> bool:
    """Return whether a call that is forbidden is accepted; the instance is closed after it."""
    try:
        component.step(time, step_size)
    except (ComponentError, EndedError):
        return False
    finally:
        component.close()
    return True


# part of an output's size by which it may change as initialisation ends; 1e-6 is worth a remark
_LATE = 1e-3
_CLEAR = 1e-6
# another operating point: at its own, an FMU may start from what it declares
_ELSEWHERE = POINTS[1]


@check("initial_outputs", "Are its outputs there before initialisation ends?")
def initial_outputs(subject: Subject) -> CheckResult:
    """Read them in initialisation mode, end it with the inputs as they are, and read them again.

    A master reads outputs in initialisation mode, to find inputs and outputs of all components that agree."""
    if not subject.outputs:
        return not_applicable("initial_outputs", "because the FMU has no Real outputs")
    seen = ""
    worst = 0.0
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
    return passed(
        "initial_outputs",
        f"the end of initialisation changes no output ({worst:.1g})",
        difference=worst,
    )


def _around_the_end(
    subject: Subject, point: OperatingAt | None
) -> tuple[Numbers, Numbers, Numbers]:
    """Outputs before and after the end of initialisation, and the size that they have in a short run."""
    component = subject.open()
    try:
        subject.prepare(component, point)
        component.enter_initialization_mode()
        inputs, outputs = (
            RealBatch(component, subject.inputs),
            RealBatch(component, subject.outputs),
        )
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
