"""Checks that an FMU gives back the memory that it takes."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from statistics import median_low

from orchestrator.core.errors import ComponentError
from orchestrator.devices.acceptance.checks.base import (
    CheckResult,
    check,
    failed,
    not_applicable,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.checks.running import affordable
from orchestrator.devices.acceptance.checks.subject import Subject, unmoved

_BLOCKS = 8  # parts of a measurement
_QUICK = 5  # instances in a part of a quick look
_MANY = 60  # the same of a longer one

_LEAST = 4.0  # bytes kept by each step that count as a leak
_RESETS = 5  # resets in a block
_FEW = 4  # instances between two counts of open files
_INSTANCE = 120.0  # bytes kept by each instance, or each saved state
# bytes kept by each instance that no study notices: some tools never free its name or log
_SLIGHT = 4096.0

_OF_WRAPPER = 65536.0
"""The same of an FMU that PythonFMU makes: its wrapper frees no slave.

PythonFMU 0.7.0 keeps 4.1 kB with each instance of a slave of two variables, and some hundred bytes more with each other
variable, in a process in which FMUs in C keep none. So it is neither the author's code nor what loads it."""


@dataclass(frozen=True)
class _Unknown:
    """A growth that was not measured."""

    why: str
    refused: bool = True


@check("memory", "Does it give back the memory that it takes?")
def memory(subject: Subject) -> CheckResult:
    if not subject.memory_in_use():
        return not_applicable(
            "memory", "because this platform does not tell how much memory is in use"
        )
    steps = affordable(subject, 1500)
    wrapped = subject.description.generation_tool.lower().startswith("pythonfmu")
    texts, figures, slight, unknown = [], {}, "", dict[str, _Unknown]()
    for what, growth, least in (
        ("step", _of_steps(subject, steps), _LEAST),
        ("later step", _of_a_long_run(subject), _LEAST),
        ("instance", _of_instances(subject), _INSTANCE),
        ("saved state", _of_states(subject), _INSTANCE),
        ("fmi2Reset", _of_resets(subject), _INSTANCE),
    ):
        if isinstance(growth, _Unknown):
            unknown[what] = growth
            continue
        figures[what] = growth
        if growth > least:
            said = f"{growth:.0f} bytes with every {what}"
            if what == "instance" and wrapped and growth <= _OF_WRAPPER:
                slight = f"{subject.description.generation_tool}, which wraps it, keeps {said}"
            elif what == "instance" and growth <= _SLIGHT:
                slight = f"it keeps {said}"
            else:
                texts.append(said)
    files = _of_files(subject)
    if isinstance(files, _Unknown):
        unknown["open files"] = files
    elif files:
        figures["open files"] = files
        return failed(
            "memory",
            "files stay open",
            f"{files:.2g} files stay open with every instance",
            **figures,
        )
    left_out = "".join(f"; not measured: {what}, because {u.why}" for what, u in unknown.items())
    if texts:
        return failed(
            "memory", "memory leak", f"it keeps {' and '.join(texts)}{left_out}", **figures
        )
    if slight:
        remedy = "a million instances in one process would be noticed; tell the author"
        return remarked("memory", f"{slight}{left_out}", remedy, **figures)
    measured = ", ".join(f"{growth:.1f} bytes a {what}" for what, growth in figures.items())
    if any(u.refused for u in unknown.values()):
        remedy = "no leak was seen in the rest; see the check of that call, and repeat this one"
        return remarked("memory", f"{measured}{left_out}", remedy, **figures)
    return passed("memory", f"{measured}{left_out}", **figures)


def _growth(subject: Subject, block: Callable[[], None], count: int) -> float | _Unknown:
    """Bytes kept by every repetition: the lower median of the later blocks.

    What fills within some blocks, and what something else takes or frees in two of them, does not count."""
    sizes = []
    for _ in range(_BLOCKS):
        block()
        sizes.append(subject.memory_in_use())
    if not all(sizes):
        return _Unknown("its process no longer tells how much memory is in use")
    return max(0.0, median_low(b - a for a, b in pairwise(sizes[1:])) / count)


def _of_steps(subject: Subject, steps: int) -> float | _Unknown:
    ends = subject.ends
    if ends is not None and _BLOCKS * steps * subject.step_size > ends:
        steps = int(ends / subject.step_size / _BLOCKS)
        if steps < 20:
            return _Unknown(f"the FMU ends at t = {ends:g} s, after too few steps", refused=False)
    stimulus = subject.steps(hold=10 * subject.step_size)
    with subject.running() as running:

        def block() -> None:
            running.record(steps, subject.step_size, stimulus)

        return _growth(subject, block, steps)


def _of_a_long_run(subject: Subject) -> float | _Unknown:
    """Bytes kept by each step at the end of the run of 'runs': the lesser of its last two parts."""
    seen: list[tuple[int, int]] = subject.memory.get("bytes", [])[-3:]
    if len(seen) < 3 or not all(size for _, size in seen):
        return _Unknown("the check 'runs' did not run long enough", refused=False)
    return max(0.0, min((b - a) / (later - sooner) for (sooner, a), (later, b) in pairwise(seen)))


def _of_instances(subject: Subject) -> float | _Unknown:
    """A quick look, and a longer one where that sees something: an interpreter's own memory moves as well."""
    quick = _of_so_many(subject, _QUICK)
    if isinstance(quick, float) and quick <= _INSTANCE:
        return quick
    return _of_so_many(subject, _MANY)


def _of_so_many(subject: Subject, count: int) -> float | _Unknown:
    def block() -> None:
        for _ in range(count):
            with subject.running() as running:
                running.step(subject.step_size)

    return _growth(subject, block, count)


def _of_resets(subject: Subject) -> float | _Unknown:
    """A quick look, and a longer one where that sees something."""
    try:
        quick = _of_so_many_resets(subject, _RESETS)
        small = isinstance(quick, float) and quick <= _INSTANCE
        return quick if small else _of_so_many_resets(subject, 5 * _RESETS)
    except ComponentError as error:
        return _Unknown(f"{error.call} returned {error.status}")


def _of_so_many_resets(subject: Subject, count: int) -> float | _Unknown:
    with subject.running() as running:

        def block() -> None:
            for _ in range(count):
                running.step(subject.step_size)
                running.reset()

        return _growth(subject, block, count)


def _of_files(subject: Subject) -> float | _Unknown:
    def count() -> int:
        return subject.process().number("open files", -1, "open_files")

    with subject.running():
        pass
    before = count()
    if not before:
        return _Unknown("this platform does not tell which files are open", refused=False)
    for _ in range(_FEW):
        with subject.running():
            pass
    return max(0, count() - before) / _FEW


def _of_states(subject: Subject) -> float | _Unknown:
    if not subject.description.can_save_state:
        return _Unknown("the FMU declares that it saves none", refused=False)
    with subject.running() as running:

        def block() -> None:
            for _ in range(50):
                with unmoved(running):
                    running.step(subject.step_size)

        return _growth(subject, block, 50)
