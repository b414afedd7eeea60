"""Checks of what a controller DLL keeps, and of what it touches: arrays, states, instances, memory, threads."""

import itertools

from fmus.vendor_dll.state_trial import SAMPLES
from orchestrator.devices.acceptance.checks.base import CheckResult
from orchestrator.devices.acceptance.controller_dll.host import ARRAYS, Heard, Placement
from orchestrator.devices.acceptance.controller_dll.results import (
    dll_check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.controller_dll.subject import (
    DllSubject,
    differs,
)
from orchestrator.devices.sandbox.dll_process import DllEndedError

_EVERYWHERE = tuple(range(len(ARRAYS)))
_SIDES = {True: "behind", False: "before"}
_FILLING = 0x5A  # what state arrays begin with in place of zeros: large numbers, as doubles 2e+121
_BLOCK = 2000  # samples in which memory is counted
_LEAST_LEAK = 0.5  # less a sample than this is a table that grew once [bytes]
_SIMULATIONS = 40  # first calls and ends in which memory is counted
_LEAST_OF_SIMULATION = 8.0  # less for each than this is none [bytes]
_TASKS = ["entries", "/proc/self/task"]  # order that counts threads
_FILES = ["entries", "/proc/self/fd"]  # order that counts open files
_DRIVEN = "the program under Wine is not looked into"


def _where(heard: Heard) -> str:
    return f"from Model_{heard.call} at {heard.time:g} s on"


@dll_check("dll_memory")
def check_memory(subject: DllSubject) -> CheckResult:
    name = "dll_memory"
    touched = _arrays_left(subject)
    if touched:
        return failed(
            name, "writes outside its arrays", f"something is written beside its {touched}"
        )
    if subject.windows:
        return passed(
            name, f"nothing is written beside its arrays; reading is not seen, as {_DRIVEN}"
        )
    for at_the_end, side in _SIDES.items():
        try:
            _run_guarded(subject, _EVERYWHERE, at_the_end)
        except DllEndedError as error:
            if error.fault != "crash":
                raise
            array = _guilty_array(subject, at_the_end)
            return failed(
                name,
                "reads outside its arrays",
                f"it reads {side} its {array}: with nothing there it ends ({error})",
            )
    return passed(name, "it touches nothing behind and nothing before its arrays")


def _arrays_left(subject: DllSubject) -> str:
    """Arrays beside which a plain run writes, in words."""
    with subject.other_process() as process:
        session, one = subject.begin(process, SAMPLES)
        try:
            subject.play(session)
        except DllEndedError:
            return ""
        return ", ".join(one.arrays_left())


def _run_guarded(subject: DllSubject, arrays: tuple[int, ...], at_the_end: bool) -> None:
    with subject.other_process() as process:
        subject.run(process, Placement(arrays, at_the_end))


def _guilty_array(subject: DllSubject, at_the_end: bool) -> str:
    """Name of the first array that it leaves; by running it with one after the other closed off."""
    for k, name in enumerate(ARRAYS):
        try:
            _run_guarded(subject, (k,), at_the_end)
        except DllEndedError:
            return name
    return "arrays, several of them together"


@dll_check("dll_repeatability")
def check_repeatability(subject: DllSubject) -> CheckResult:
    name = "dll_repeatability"
    with subject.other_process() as process:
        other = differs(subject.run(process), subject.reference)
    if other is not None:
        return failed(name, "not repeatable", f"two runs in two processes differ {_where(other)}")
    with subject.other_process() as process:
        filled = differs(subject.run(process, Placement(filling=_FILLING)), subject.reference)
    same_outputs = filled is None or _same_outputs(subject, Placement(filling=_FILLING))
    if not same_outputs:
        return remarked(
            name,
            "equal to the last bit; where its state arrays begin with something else than zeros, it answers otherwise",
            "set every state in Model_Initialize: the header does not say that a host's arrays begin with zeros",
        )
    return passed(name, f"{SAMPLES} samples in two processes, equal to the last bit")


def _same_outputs(subject: DllSubject, placement: Placement) -> bool:
    with subject.other_process() as process:
        heard = subject.run(process, placement)
    pairs = zip(heard, subject.reference, strict=True)
    return all((a.code, a.outputs) == (b.code, b.outputs) for a, b in pairs)


@dll_check("dll_instances")
def check_instances(subject: DllSubject) -> CheckResult:
    name = "dll_instances"
    with subject.other_process() as process:
        session = subject.session(process)
        first, second = subject.instance(process), subject.instance(process, phase=5)
        session.start(first)
        session.samples(first, 1, SAMPLES // 4)
        session.start(second)  # while the first one runs
        for sample in range(1, SAMPLES + 1):
            if sample > SAMPLES // 4:
                session.sample(first, sample)
            session.sample(second, sample)
        session.call(second, "Terminate", SAMPLES * session.step)
        session.call(first, "Terminate", SAMPLES * session.step)
        heard = subject.play(session)
    alone = {0: subject.reference, 1: subject.reference_of_another}
    for number, reference in alone.items():
        other = differs([h for h in heard if h.instance == number], reference)
        if other is not None:
            which = ("the first", "the second")[number]
            return failed(
                name,
                "shared between instances",
                f"beside another one, {which} instance differs {_where(other)}",
            )
    return passed(name, "two instances, the second begun while the first ran, each as alone")


@dll_check("dll_states")
def check_states(subject: DllSubject) -> CheckResult:
    name = "dll_states"
    with subject.other_process() as process:
        session, one = subject.begin(process, SAMPLES)
        subject.play(session)
        kept = one.snapshot()
        session.samples(one, SAMPLES + 1, SAMPLES)
        onward = subject.play(session)
        one.restore(kept)
        session.samples(one, SAMPLES + 1, SAMPLES)  # at times that it had before
        other = differs(subject.play(session), onward)
    if other is not None:
        says = f"after its arrays and the time were put back it differs {_where(other)}"
        return failed(name, "hidden state", f"{says}; {_kept_elsewhere(subject)}")
    moved = _in_new_process(subject, kept, onward)
    if moved:
        return remarked(
            name,
            f"restored in the same process it goes on alike; in a new process {moved}",
            "a host that keeps a snapshot in a file cannot go on from it; keep no addresses in the states",
        )
    return passed(
        name,
        f"{SAMPLES} samples again from {sum(subject.interface.states)} states and its outputs, also in a new process",
    )


def _kept_elsewhere(subject: DllSubject) -> str:
    """Where it is likely to keep its state, in words."""
    with subject.other_process() as process:
        (regions,) = process.do([["regions"]])
        reads = [["read", start, size] for _, start, size in regions or []]
        session, one = subject.begin(process, SAMPLES)
        subject.play(session)
        early = process.do(reads)
        session.samples(one, SAMPLES + 1, SAMPLES)
        subject.play(session)
        late = process.do(reads)
    if early != late:
        return "variables of the library itself change in a run"
    return "the library's own variables stand still: it keeps it in memory that it allocates, in a thread or outside"


def _in_new_process(subject: DllSubject, kept: list[str], onward: list[Heard]) -> str:
    """The fate of a snapshot that another process takes up, in words; empty where it goes on alike."""
    with subject.other_process() as process:
        session, one = subject.begin(process)
        subject.play(session)
        one.restore(kept)
        session.samples(one, SAMPLES + 1, SAMPLES)
        try:
            other = differs(subject.play(session), onward)
        except DllEndedError as error:
            return str(error)
    return "" if other is None else f"it differs {_where(other)}"


@dll_check("dll_restart")
def check_restart(subject: DllSubject) -> CheckResult:
    name = "dll_restart"
    with subject.other_process() as process:
        subject.run(process, phase=5)
        second = differs(subject.run(process), subject.reference)
    if second is not None:
        return failed(
            name,
            "left from the run before",
            f"a second simulation in the same process differs {_where(second)}",
        )
    with subject.other_process() as process:
        session, one = subject.begin(process)
        for _ in range(5):
            session.call(one, "Initialize")
        session.samples(one, 1, SAMPLES)
        heard = [h for h in subject.play(session) if h.call == "Outputs"]
    reference = [h for h in subject.reference if h.call == "Outputs"]
    more = differs(heard, reference)
    if more is not None:
        return failed(
            name,
            "initialises by adding",
            f"after Model_Initialize six times at time 0 it differs {_where(more)}",
        )
    return passed(name, "a second simulation, and six times Model_Initialize, change nothing")


@dll_check("dll_threads")
def check_threads(subject: DllSubject) -> CheckResult:
    name = "dll_threads"
    if subject.windows:
        return not_applicable(name, f"because {_DRIVEN}")
    with subject.other_process() as process:
        (begun,) = process.do([_TASKS])
        session, one = subject.begin(process, SAMPLES // 2)
        heard = subject.play(session)
        session.in_thread = True
        session.samples(one, SAMPLES // 2 + 1, SAMPLES - SAMPLES // 2)
        session.call(one, "Terminate", SAMPLES * session.step)
        heard += subject.play(session)
        (left,) = process.do([_TASKS])
    other = differs(heard, subject.reference)
    if other is not None:
        return failed(
            name,
            "hidden state",
            f"called from another thread it differs {_where(other)}: it keeps state in its thread",
        )
    if left != begun:
        return remarked(
            name,
            f"{left - begun} threads that it started still run after Model_Terminate",
            "end them in Model_Terminate; a host may unload the DLL then, and its process dies",
        )
    return passed(name, "from another thread the same, to the last bit; no thread is left")


@dll_check("dll_leaks")
def check_leaks(subject: DllSubject) -> CheckResult:
    name = "dll_leaks"
    if subject.windows:
        return not_applicable(name, f"because {_DRIVEN}")
    with subject.other_process() as process:
        session, one = subject.begin(process, 1)
        subject.play(session)
        block = [["heap"], _FILES, one.order_of_many("Outputs", _BLOCK)]
        marks = [process.do(block)[:2] for _ in range(5)]
        if marks[0][0] is None:
            return not_applicable(
                name, "because this system's C library does not tell what is in use"
            )
        # the first block is of tables that grow once
        grown = sorted(b[0] - a[0] for a, b in itertools.pairwise(marks))[0] / _BLOCK
        opened = marks[-1][1] - marks[1][1]
        again = [
            one.order_of_many(call, 1)
            for call in ("FirstCall", "Initialize", "Outputs", "Terminate")
        ]
        again = [order for order in again if order[1] in subject.interface.calls]
        ends = [process.do([*again * _SIMULATIONS, ["heap"], _FILES])[-2:] for _ in range(4)]
    steps = [b[0] - a[0] for a, b in itertools.pairwise(ends)]
    per_run = min(steps) / _SIMULATIONS
    if grown > _LEAST_LEAK:
        return failed(
            name, "memory leak", f"{grown:.3g} bytes more with each sample", bytes_a_sample=grown
        )
    if per_run > _LEAST_OF_SIMULATION:
        return failed(
            name,
            "memory leak",
            f"{per_run:.4g} bytes more with each simulation",
            bytes_a_simulation=per_run,
        )
    more = opened + ends[-1][1] - ends[0][1]
    if more > 0:
        return failed(
            name,
            "files stay open",
            f"{more} files more are open after {3 * _SIMULATIONS} simulations",
        )
    return passed(name, f"nothing grows in {4 * _BLOCK} samples and {4 * _SIMULATIONS} simulations")


@dll_check("dll_arithmetic")
def check_arithmetic(subject: DllSubject) -> CheckResult:
    name = "dll_arithmetic"
    if subject.windows:
        return not_applicable(name, f"because {_DRIVEN}")
    with subject.other_process() as process:
        (loaded,) = process.do([["arithmetic"]])
        if loaded is None:
            return not_applicable(name, "because this processor's control word is not known here")
        session, _ = subject.begin(process, SAMPLES // 4)
        subject.play(session)
        (after,) = process.do([["arithmetic"]])
    usual = 0x1F80  # of x86-64: rounds to nearest, keeps tiny numbers, traps nothing
    if after != usual:
        when = "when it is loaded" if loaded == after else "in a call"
        return remarked(
            name,
            f"it changes how its host rounds or treats tiny numbers, {when} (control word {after:#06x})",
            "build it without -ffast-math, or set the control word back before each return",
        )
    return passed(name, "rounding, tiny numbers and traps stay as they are")
