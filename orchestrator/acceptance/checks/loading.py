"""Whether an FMU's binary can be loaded here and gives an instance, and what it does with calls that FMI forbids."""

from orchestrator.acceptance.checks.base import CheckResult, check, failed, passed, provoked, remarked
from orchestrator.acceptance.checks.file import some_of
from orchestrator.acceptance.checks.subject import Subject
from orchestrator.acceptance.process import HostedComponent, ProcessEndedError
from orchestrator.errors import ComponentError, EndedError, InputError, UnsupportedFmuError
from orchestrator.fmi.answers import names
from orchestrator.fmi.port import without_binding


@check("loads", "Can its binary be loaded here, and does it give an instance?")
def loads(subject: Subject) -> CheckResult:
    """What this machine lacks is said here, once; all that needs an instance is not asked then."""
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
        return failed(
            "loads", "missing function", f"its binary has no {', '.join(missing)}, which what it declares needs"
        )
    try:
        subject.open().close()
    except ComponentError as error:
        return failed("loads", "no instance", str(error))
    clocks = f"; it has {len(described.clocks)} clocks, which tick here" if described.clocks else ""
    if spare:
        return remarked(
            "loads",
            f"its binary has no {some_of(spare, ', ')}, which nothing that it declares needs{clocks}",
            f"FMI {described.fmi_version} asks for all of them; other masters may refuse it, tell the author",
        )
    return passed("loads", f"its binary loads, has all functions, and gives an instance{clocks}")


@check("call_order", "Does it refuse calls out of order, and survive them?")
def call_order(subject: Subject) -> CheckResult:
    """Make three calls that FMI forbids, each in an instance of its own; what an FMU does then is provoked."""
    h = subject.step_size
    steps = {
        "before initialisation": (_unborn, 0.0, h),
        "of size 0": (_stepped, h, 0.0),
        "backwards": (_started, 0.0, -h),
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
        return remarked(
            "call_order",
            f"it accepts {' and '.join(accepted)}",
            "FMI forbids these calls; a master that makes them by mistake will not be told",
        )
    return passed("call_order", "steps before initialisation, of size 0 and backwards are refused")


def _unborn(subject: Subject) -> HostedComponent:
    return subject.open()


def _started(subject: Subject) -> HostedComponent:
    return subject.running().component


def _stepped(subject: Subject) -> HostedComponent:
    running = subject.running()
    running.step(subject.step_size)
    return running.component


def _accepts(component: HostedComponent, time: float, step_size: float) -> bool:
    """Whether a call that is forbidden is accepted; the instance is closed after it."""
    try:
        component.step(time, step_size)
    except (ComponentError, EndedError):
        return False
    finally:
        component.close()
    return True
