"""Many points of a study: those that are kept are read, the others computed, and kept as soon as they are there."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

from orchestrator.points.executor import Executor, WorkerLostError
from orchestrator.points.store import POINTS, Arrays, PointStore

CountReport = Callable[[int, int], None]  # callback: how many points are done, of how many


class Keyed(Protocol):
    @property
    def key(self) -> str:
        """Name of the point's file, as `key_of` makes it."""
        ...


class Keepable(Protocol):
    @property
    def lasting(self) -> bool:
        """Whether computing the point again would give the same result. Only such results are kept."""
        ...

    def stored(self) -> tuple[dict[str, Any], Arrays]:
        """Header and arrays for a `PointStore`."""
        ...

    @classmethod
    def restored(cls, header: dict[str, Any], arrays: Arrays) -> Self | None:
        """The result that was stored in this form; None if the file has another form."""
        ...

    @classmethod
    def lost(cls, task: Any, error: WorkerLostError) -> Self:
        """The result of a point whose worker died."""
        ...


Task = TypeVar("Task", bound=Keyed)
Point = TypeVar("Point", bound=Keepable)


def kept_or_computed(
    kind: type[Point],
    compute: Callable[[Task], Point],
    tasks: Sequence[Task],
    executor: Executor,
    store: PointStore,
    report: CountReport,
) -> Iterator[tuple[int, Point, bool]]:
    """Yield, in any order, the index of each task, its point, and whether the point was already stored."""
    missing: list[int] = []
    for index, task in enumerate(tasks):
        found = store.load(task.key)
        point = kind.restored(*found) if found else None
        if point is None:
            missing.append(index)
        else:
            yield index, point, True
    done = len(tasks) - len(missing)
    report(done, len(tasks))
    for number, outcome in executor.run(compute, [tasks[index] for index in missing]):
        index = missing[number]
        computed = kind.lost(tasks[index], outcome) if isinstance(outcome, WorkerLostError) else outcome
        if computed.lasting:
            store.save(tasks[index].key, *computed.stored())
        done += 1
        report(done, len(tasks))
        yield index, computed, False


def all_points(
    kind: type[Point],
    compute: Callable[[Task], Point],
    tasks: Sequence[Task],
    executor: Executor,
    folder: Path,
    report: CountReport,
) -> tuple[list[Point], int]:
    """The points in the order of their tasks, kept in a study's folder, and how many of them were stored there."""
    store = PointStore(folder / POINTS)
    done = sorted(kept_or_computed(kind, compute, tasks, executor, store, report), key=lambda entry: entry[0])
    return [point for _, point, _ in done], sum(was_stored for *_, was_stored in done)
