"""The norm's study of one converter: a case file of its own, all points, and the verdict on each."""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.certification.criteria import (
    ModalTest,
    ModeVerdict,
    eigenvalue_test,
    modal_test,
    stability_fault,
)
from orchestrator.certification.point import CONVERTER, FREQUENCY, POWER, PointResult, PointTask, compute_point
from orchestrator.certification.swings import SwingTest, slow_part, swing_test
from orchestrator.distributed.executor import Executor
from orchestrator.errors import InputError
from orchestrator.fmi.description import FmuDescription
from orchestrator.study.point_key import fingerprint, key_of, reference_to, scenario_content
from orchestrator.study.point_store import PointStore
from orchestrator.study.points import Report, kept_or_computed

REACTANCES = (0.01, *(round(0.05 * k, 2) for k in range(1, 13)))
"""X_L of the norm [pu, 100 MVA]."""

SETTLING = 0.5
"""From this long after the event [s] the signal is taken for a free response and decomposed into modes."""

BASE = BUILT_IN / "norm631" / "case.toml"
"""The study, with our converter in it."""

PODS = ("none", "p", "q", "pq")
WITHOUT, WITH = "without", "with"


@dataclass(frozen=True)
class CertificationRequest:
    """What is to be certified.

    Attributes
    ----------
    fmu, binding
        The converter, and how its variables are mapped to our port.
    values
        Values of the converter's own variables, by name.
    pod
        One of `PODS`: which damping controllers are active; None to see it from ``pod_p.enabled``, ``pod_q.enabled``.
    study_values
        Values of the study's other components, by ``component.variable``.
    black_box
        Identify the converter for the modes even if it shows its states; one that does not is always identified.
    """

    fmu: Path
    binding: Path | None = None
    values: Mapping[str, Value] = field(default_factory=dict)
    pod: str | None = None
    reactances: Sequence[float] = REACTANCES
    study_values: Mapping[str, Value] = field(default_factory=dict)
    black_box: bool = False


@dataclass(frozen=True)
class TimeVerdict:
    """The time-domain criterion on one response: either of its two ways is enough.

    Attributes
    ----------
    other_reading
        The swings with the first extremum kept.
    """

    signal: str
    swings: SwingTest
    other_reading: SwingTest
    modal: ModalTest

    @property
    def accepted(self) -> bool:
        return self.swings.accepted or self.modal.accepted


@dataclass(frozen=True)
class PointVerdict:
    """Everything the norm says of one reactance.

    Attributes
    ----------
    base_time
        The criterion on the system without the converter, for comparison; it is not judged.
    faults
        Why the point is not accepted; empty where it is.
    """

    X_L: float
    modes: tuple[ModeVerdict, ...]
    time: TimeVerdict | None
    base_time: TimeVerdict | None
    faults: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        return not self.faults

    @property
    def eigenvalues_accepted(self) -> bool:
        return bool(self.modes) and all(m.accepted for m in self.modes)


@dataclass
class Certification:
    """The study, done.

    Attributes
    ----------
    points
        By scenario and X_L.
    stored
        How many of them an earlier start had left.
    """

    request: CertificationRequest
    description: FmuDescription
    pod: str
    event_time: float
    case: Path
    points: dict[tuple[str, float], PointResult]
    verdicts: list[PointVerdict]
    stored: int = 0

    @property
    def passed(self) -> bool:
        return bool(self.verdicts) and all(v.accepted for v in self.verdicts)

    @property
    def linearised(self) -> dict[str, str]:
        """How the linear model of every component was found at the points with the converter."""
        having = [point for (name, _), point in self.points.items() if name == WITH]
        return {component: how for point in having for component, how in point.linearised.items()}

    @property
    def fit_errors(self) -> dict[str, float]:
        """Largest of all points, of the components that were identified."""
        found: dict[str, float] = {}
        for point in self.points.values():
            for component, error in point.fit_errors.items():
                found[component] = max(error, found.get(component, 0.0))
        return found

    @property
    def signal(self) -> str:
        """What the time-domain criterion watches."""
        return watched(self.pod)

    def sentence(self) -> str:
        """The result, and where."""
        with_pod = {"none": "without POD", "p": "with POD-P", "q": "with POD-Q", "pq": "with POD-P and POD-Q"}[self.pod]
        subject = f"The converter {self.description.model_name!r} {with_pod}"
        failed = [v for v in self.verdicts if not v.accepted]
        if not failed:
            return f"{subject} passes the damping test at all {len(self.verdicts)} line reactances."
        places = ", ".join(f"{v.X_L:g}" for v in failed)
        first = "; ".join(failed[0].faults)
        return f"{subject} fails the damping test at X_L = {places} pu. At {failed[0].X_L:g} pu: {first}."


def watched(pod: str) -> str:
    """SG1's active power; the frequency at bus 2 where a POD-P is active."""
    return FREQUENCY if "p" in pod.removeprefix("none") else POWER


def write_case(request: CertificationRequest, folder: Path) -> Path:
    """The study's case file with this converter in it; FMU and binding are laid beside it, so that it stands alone."""
    text = BASE.read_text(encoding="utf-8")
    for file in (request.fmu, *([request.binding] if request.binding else [])):
        if not file.is_file():
            raise InputError(f"{file}: there is no such file; give the path of an .fmu, and with --binding of a .toml")
    shutil.copyfile(request.fmu, folder / "converter.fmu")
    source = 'fmu = "converter.fmu"'
    if request.binding:
        shutil.copyfile(request.binding, folder / "vendor.toml")
        source += '\nbinding = "vendor.toml"'
    built_in = 'model = "gfor"'
    if text.count(built_in) != 1:
        raise ValueError(f"the study's case file must have {built_in} once")
    path = folder / "case.toml"
    path.write_text(text.replace(built_in, source), encoding="utf-8")
    return path


def certify(
    request: CertificationRequest,
    executor: Executor,
    folder: Path,
    report: Report = lambda done, total: None,
) -> Certification:
    """Compute all points and judge them.

    Parameters
    ----------
    folder
        Takes the study's case file, the FMU and its binding, and every point as soon as it is there: those that are
        there already are not computed again.
    report
        Is told how many points are done, of how many.

    Raises
    ------
    InputError
        If the FMU or a value cannot be used.
    """
    case = load_case(write_case(request, folder))
    own = {f"{CONVERTER}.{name}": value for name, value in request.values.items()}
    settings = {WITHOUT: dict(request.study_values), WITH: {**request.study_values, **own}}
    prepared = {
        name: case.prepare([name], {**values, "grid.X_L": request.reactances[0]})[0]
        for name, values in settings.items()
    }
    description = prepared[WITH].system.components[CONVERTER].description
    pod = request.pod or _pod_of(description, prepared[WITH].values)
    without = _tasks(case, prepared[WITHOUT], settings[WITHOUT], request.reactances, black_box=False)
    having = _tasks(case, prepared[WITH], settings[WITH], request.reactances, black_box=request.black_box)
    tasks = [task for pair in zip(without, having, strict=True) for task in pair]
    points: dict[tuple[str, float], PointResult] = {}
    stored = 0
    store = PointStore(folder / "points")
    for index, point, was_stored in kept_or_computed(PointResult, compute_point, tasks, executor, store, report):
        points[tasks[index].scenario, tasks[index].X_L] = point
        stored += was_stored
    event = prepared[WITH].events[0].time
    verdicts = [judge(points[WITH, X], points[WITHOUT, X], watched(pod), event) for X in request.reactances]
    return Certification(request, description, pod, event, case.path, points, verdicts, stored)


def _tasks(
    case: Case, prepared: PreparedScenario, values: dict[str, Value], reactances: Sequence[float], *, black_box: bool
) -> list[PointTask]:
    """One scenario at all reactances."""
    # The case file names the binding, if there is one: what that says is in the scenario's content, where it matters.
    content = {
        "case": BASE.read_text(encoding="utf-8"),
        **scenario_content(prepared),
        "overrides": sorted(values.items()),
        "black box": black_box,
    }
    place, mark = reference_to(case), fingerprint(case)
    return [
        PointTask(place, mark, prepared.name, X_L, values, key_of({**content, "X_L": X_L}), black_box)
        for X_L in reactances
    ]


def judge(having: PointResult, lacking: PointResult, signal: str, event_time: float) -> PointVerdict:
    """All criteria at one reactance."""
    faults = [f"the study failed {name} the converter: {point.failure}"
              for name, point in ((WITH, having), (WITHOUT, lacking)) if point.failure]  # fmt: skip
    modes: tuple[ModeVerdict, ...] = ()
    if having.modes is not None and lacking.modes is not None:
        modes = tuple(eigenvalue_test(having.modes, lacking.modes, having.components))
        faults += [f"{m.frequency_hz:.3f} Hz: {m.reason}" for m in modes if not m.accepted]
        fault = stability_fault(having.growth, lacking.growth)
        faults += [fault] if fault else []
    time, base = (_judge_response(point, signal, event_time) for point in (having, lacking))
    if time is not None and not time.accepted:
        faults.append(f"response of {signal}: {time.swings.reason}; and by its modes: {time.modal.reason}")
    return PointVerdict(having.X_L, modes, time, base, tuple(faults))


def _judge_response(point: PointResult, signal: str, event_time: float) -> TimeVerdict | None:
    y = point.signals.get(signal)
    if y is None or point.failure:
        return None
    y = slow_part(point.times, y)
    return TimeVerdict(
        signal,
        swing_test(point.times, y, event_time),
        swing_test(point.times, y, event_time, drop_first=False),
        modal_test(point.times, y, event_time + SETTLING),
    )


def _pod_of(description: FmuDescription, values: Mapping[str, float | bool]) -> str:
    """Active controllers of a converter that shows them as ours does; none where it does not."""

    def active(name: str) -> bool:
        info = description.variables.get(name)
        return info is not None and bool(values.get(f"{CONVERTER}.{name}", info.start == "true"))

    return "".join(letter for letter in "pq" if active(f"pod_{letter}.enabled")) or "none"
