"""Whether an FMU gives back the memory that it takes."""

from collections.abc import Callable
from itertools import pairwise

from orchestrator.acceptance.checks.base import CheckResult, check, failed, not_applicable, passed, remarked
from orchestrator.acceptance.checks.running import affordable
from orchestrator.acceptance.checks.subject import Subject, saved
from orchestrator.errors import ComponentError

_BLOCKS = 6
_LEAST = 4.0
"""Bytes kept by each step that count as a leak."""

_RESETS, _FEW = 6, 4
"""Resets in a block, and instances between two counts of open files."""

_INSTANCE = 120.0
"""Bytes kept by each instance, or each saved state."""


_SLIGHT = 4096.0
"""Bytes kept by each instance that no study notices: some tools never free an instance's name or its log's."""

_TOOL = 65536.0
"""What an instance may keep if it runs in a tool, such as an interpreter that remembers every module it ran."""


@check("memory", "Does it give back the memory that it takes?")
def memory(subject: Subject) -> CheckResult:
    if not subject.memory_in_use():
        return not_applicable("memory", "because this platform does not tell how much memory is in use")
    steps, instance = affordable(subject, 1500), _TOOL if subject.description.needs_tool else _INSTANCE
    texts, figures, slight = [], {}, ""
    for what, growth, least in (
        ("step", _of_steps(subject, steps), _LEAST),
        ("later step", _of_a_long_run(subject), _LEAST),
        ("instance", _of_instances(subject, instance), instance),
        ("saved state", _of_states(subject), _INSTANCE),
        ("fmi2Reset", _of_resets(subject, instance), instance),
    ):
        if growth is None:
            continue
        figures[what] = growth
        if growth > least:
            said = f"{growth:.0f} bytes with every {what}"
            if what == "instance" and growth <= _SLIGHT:
                slight = f"it keeps {said}"
            else:
                texts.append(said)
    if files := _of_files(subject):
        figures["open files"] = files
        return failed("memory", "files stay open", f"{files:.2g} files stay open with every instance", **figures)
    if texts:
        return failed("memory", "memory leak", f"it keeps {' and '.join(texts)}", **figures)
    if slight:
        return remarked(
            "memory", slight, "a million instances in one process would be noticed; tell the author", **figures
        )
    return passed("memory", ", ".join(f"{growth:.1f} bytes a {what}" for what, growth in figures.items()), **figures)


def _growth(subject: Subject, block: Callable[[], None], count: int) -> float:
    """Bytes kept by every repetition: the least growth of the later blocks, so that what fills once does not count."""
    sizes = []
    for _ in range(_BLOCKS):
        block()
        sizes.append(subject.memory_in_use())
    return max(0.0, min(b - a for a, b in pairwise(sizes[1:])) / count)


def _of_steps(subject: Subject, steps: int) -> float | None:
    ends = subject.ends
    if ends is not None and _BLOCKS * steps * subject.step_size > ends:
        steps = int(ends / subject.step_size / _BLOCKS)
        if steps < 20:
            return None
    stimulus = subject.steps(hold=10 * subject.step_size)
    with subject.running() as running:

        def block() -> None:
            running.record(steps, subject.step_size, stimulus)

        return _growth(subject, block, steps)


def _of_a_long_run(subject: Subject) -> float | None:
    """Bytes kept by each step at the end of the run of 'runs': the lesser of its last two parts."""
    seen: list[tuple[int, int]] = subject.memory.get("bytes", [])[-3:]
    if len(seen) < 3 or not all(size for _, size in seen):
        return None
    return max(0.0, min((b - a) / (later - sooner) for (sooner, a), (later, b) in pairwise(seen)))


def _of_instances(subject: Subject, least: float) -> float:
    """A quick look, and a longer one where that sees something: an interpreter's own memory moves as well."""
    quick = _of_so_many(subject, max(3, affordable(subject, 4000) // 400))
    return quick if quick <= least else _of_so_many(subject, max(5, affordable(subject, 4000) // 30))


def _of_so_many(subject: Subject, count: int) -> float:
    def block() -> None:
        for _ in range(count):
            with subject.running() as running:
                running.step(subject.step_size)

    return _growth(subject, block, count)


def _of_resets(subject: Subject, least: float) -> float | None:
    """A quick look, and a longer one where that sees something."""
    try:
        quick = _of_so_many_resets(subject, _RESETS)
        return quick if quick <= least else _of_so_many_resets(subject, 5 * _RESETS)
    except ComponentError:
        return None  # which is another check's business


def _of_so_many_resets(subject: Subject, count: int) -> float:
    with subject.running() as running:

        def block() -> None:
            for _ in range(count):
                running.step(subject.step_size)
                running.reset()

        return _growth(subject, block, count)


def _of_files(subject: Subject) -> float:
    """Files that every instance leaves open."""

    def count() -> int:
        return subject.process().number("open files", -1, "open_files")

    with subject.running():
        pass
    before = count()
    for _ in range(_FEW):
        with subject.running():
            pass
    return max(0, count() - before) / _FEW


def _of_states(subject: Subject) -> float | None:
    if not subject.description.can_save_state:
        return None
    with subject.running() as running:

        def block() -> None:
            for _ in range(50):
                with saved(running) as kept:
                    at = running.time
                    running.step(subject.step_size)
                    running.restore(kept)
                    running.time = at

        return _growth(subject, block, 50)
