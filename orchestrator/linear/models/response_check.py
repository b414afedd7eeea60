"""Comparison of a linear model with its FMU: the responses of both to small changes of the inputs.

The inputs are stepped up and down between communication points, all at once and each in an order of its own, and the
FMU is put back. A model with states passes if three conditions hold at every compared time: the FMU's derivatives are
A·x + B·u of its own states, its outputs are C·x + D·u of these states, and states and outputs follow the response of
the model alone. The first two conditions show an error in a single element of a slow state, which hardly moves. The
third shows states that the FMU hides."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from orchestrator.core.arrays import Matrix
from orchestrator.core.errors import AnalysisError
from orchestrator.core.options import Option, command
from orchestrator.devices.fmi.component import Component, RealBatch
from orchestrator.linear.models.held_inputs import over_held_inputs

SIZES = (2e-4, 2e-3, 2e-5)
"""Sizes of the steps, relative to max(1, |value|). They are tried in turn until half of a step has half its effect. The
second size is for an FMU with a coarse integrator, the third for a strongly nonlinear one."""

EQUATIONS = 3e-6
"""Largest error of the equations, as a part of a derivative or an output. The operating point is compared to 1e-6,
which moves derivatives by as much and their matrices by a few times that. A model with a smaller error moves a mode of
0.1 to 2 Hz by a similarly small part."""

COURSE = 1e-2
"""Largest difference between the response of a state or an output and that of the model alone, relative to its size.
The model is integrated exactly; an FMU's integrator is inexact for modes that decay within a few of its steps."""

PROPORTIONAL = 1e-3
"""Largest difference between the effect of half a step and half the effect of the step, relative to the largest effect.
A larger difference is not linear."""

ONE_SIDED = 0.1
"""Largest relative difference between the effects of steps up and down. A larger difference shows a limit, or the edge
of a dead band."""

DURATION = 0.1  # time for which the FMU's response is compared [s]
MOST_STEPS = 1000  # largest number of communication steps in one response
_HOLDS = (1, 1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144)
"""Numbers of communication steps for which an input is held, in turn. They excite fast parts and slow ones."""

# relative error of what an FMU computes, before it is divided by the size of a step
_ROUNDING = 1e-11


@dataclass(frozen=True)
class ContinuousModel:
    """ẋ = A·x + B·u, y = C·x + D·u, with names."""

    # states, rates, inputs, outputs: names of the FMU's variables; rates are the derivatives of the states
    states: tuple[str, ...]
    rates: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    @property
    def signals(self) -> tuple[str, ...]:
        return (*self.states, *self.rates, *self.outputs)


@dataclass(frozen=True)
class _Plan:
    """Steps of the inputs. Each row of ``levels``, shape (k, m), is held for a number of communication steps."""

    holds: tuple[int, ...]
    levels: Matrix

    @classmethod
    def of(cls, step_size: float, scales: Matrix) -> "_Plan":
        count = min(MOST_STEPS, max(len(_HOLDS), round(DURATION / step_size)))
        holds: list[int] = []
        while sum(holds) < count:
            holds.append(_HOLDS[len(holds) % len(_HOLDS)])
        # The same signs in every check, which makes results repeatable.
        signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(len(holds), len(scales)))
        return cls(tuple(holds), signs * scales)

    @property
    def ends(self) -> Matrix:
        """Number of communication steps done at the end of each hold."""
        return np.cumsum(self.holds)


@dataclass(frozen=True)
class _Response:
    """The response of the FMU, divided by the steps' size."""

    course: Matrix  # half the difference between steps up and down, shape (k, signals)
    # peaks, curved, one_sided: figures of every signal: its largest value, the difference with half a step, and the
    # difference between up and down
    peaks: Matrix
    curved: Matrix
    one_sided: Matrix
    floors: Matrix  # difference that rounding alone may cause

    @property
    def too_curved(self) -> NDArray[np.bool_]:
        return self.curved > PROPORTIONAL * self.peaks + self.floors


_AGREED: WeakKeyDictionary[Component, set[bytes]] = WeakKeyDictionary()
"""Checks that have passed already: a study linearises the same instance at the same operating point many times."""


def check_response(
    component: Component, model: ContinuousModel, what: str, time: float, step_size: float
) -> None:
    """Compare a linear model with its FMU, and restore the FMU's state.

    ``what``: what the model is, for the error: ``the linear model inside its FMU``."""
    values = RealBatch(component, (*model.states, *model.inputs, *model.outputs)).read().copy()
    key = _digest(model, values, step_size)
    agreed = _AGREED.setdefault(component, set())
    if key in agreed:
        return
    at_rest = values[len(model.states) : len(model.states) + len(model.inputs)]
    plan = _Plan.of(step_size, np.maximum(1.0, np.abs(at_rest)))
    response = _measure(component, model, plan, at_rest, time, step_size)
    _refuse_edges(component, model, response)
    _Comparison(component, model, what, plan, response, step_size).judge()
    agreed.add(key)


def _digest(model: ContinuousModel, values: Matrix, step_size: float) -> bytes:
    text = repr((model.signals, model.inputs, step_size)).encode()
    matrices = (model.A, model.B, model.C, model.D, values)
    return hashlib.sha256(
        text + b"".join(np.ascontiguousarray(m).tobytes() for m in matrices)
    ).digest()


def _measure(
    component: Component,
    model: ContinuousModel,
    plan: _Plan,
    at_rest: Matrix,
    time: float,
    step_size: float,
) -> _Response:
    """The response to the first of `SIZES` whose half gives half the response."""
    bench = _Courses(component, model, plan, at_rest, time, step_size)
    undisturbed = bench.course(0.0)
    for size in SIZES:
        response = bench.response(size, undisturbed)
        if not response.too_curved.any():
            return response
    worst = int(np.argmax(response.curved / (response.peaks + response.floors)))
    raise AnalysisError(
        f"component {component.name!r}: half a step of its inputs does not have half the effect on "
        f"{model.signals[worst]}, but {100 * response.curved[worst] / response.peaks[worst]:.3g} % of the largest more "
        f"or less, for every size from {max(SIZES):g} to {min(SIZES):g}; no linear model holds there: look for noise, "
        "a coarse tolerance of its integrator, or a limit that is active at the operating point"
    )


@dataclass(frozen=True)
class _Courses:
    """Runs the same steps of the inputs in several sizes, each from the same state."""

    component: Component
    model: ContinuousModel
    plan: _Plan
    at_rest: Matrix
    time: float
    step_size: float

    def response(self, size: float, undisturbed: Matrix) -> _Response:
        up, down, half_up, half_down = (self.course(s) for s in (size, -size, size / 2, -size / 2))
        course = (half_up - half_down) / size
        return _Response(
            course,
            np.abs(course).max(axis=0),
            np.abs((up - down) / (2 * size) - course).max(axis=0),
            np.abs((half_up + half_down) / 2 - undisturbed).max(axis=0) / (size / 2),
            _ROUNDING * np.maximum(1.0, np.abs(undisturbed).max(axis=0)) / size,
        )

    def course(self, size: float) -> Matrix:
        """All signals at the end of each hold, shape (k, signals)."""
        component = self.component
        inputs, signals = (
            RealBatch(component, names) for names in (self.model.inputs, self.model.signals)
        )
        rows = np.empty((len(self.plan.holds), len(signals.names)))
        done = 0
        saved = component.save_state()
        try:
            for k, (hold, level) in enumerate(zip(self.plan.holds, self.plan.levels, strict=True)):
                inputs.values[:] = self.at_rest + size * level
                inputs.write()
                for _ in range(hold):
                    component.step(self.time + done * self.step_size, self.step_size)
                    done += 1
                rows[k] = signals.read()
        finally:
            component.restore_state(saved)
            component.free_state(saved)
        return rows


def _refuse_edges(component: Component, model: ContinuousModel, response: _Response) -> None:
    """Refuse a signal whose responses to steps up and down differ: half their difference describes neither."""
    part = response.one_sided / (response.peaks + response.floors)
    part[response.one_sided <= ONE_SIDED * response.peaks + 10 * response.floors] = 0.0
    worst = int(np.argmax(part))
    if part[worst] > 0:
        raise AnalysisError(
            f"component {component.name!r}: small steps of its inputs up and down have effects on "
            f"{model.signals[worst]} that differ by {200 * part[worst]:.3g} % of each other; no linear model holds at "
            "the edge of a limit or a dead band: move the operating point off it"
        )


@dataclass(frozen=True)
class _Comparison:
    component: Component
    model: ContinuousModel
    what: str
    plan: _Plan
    response: _Response
    step_size: float

    def judge(self) -> None:
        n = len(self.model.states)
        course = self.response.course
        follow = range(n, course.shape[1])
        self._refuse(follow, self._by_equations(), EQUATIONS, "computed from the FMU's own states")
        shown = [*range(n), *range(2 * n, course.shape[1])]
        # a wrong model may grow beyond the range of numbers
        with np.errstate(over="ignore", invalid="ignore"):
            by_itself = self._by_itself()[:, shown]
        self._refuse(shown, by_itself, COURSE, "computed from the inputs alone")

    def _by_equations(self) -> Matrix:
        """Derivatives and outputs from the states that the FMU itself shows."""
        m, n = self.model, len(self.model.states)
        x, u = self.response.course[:, :n], self.plan.levels
        return np.hstack([x @ m.A.T + u @ m.B.T, x @ m.C.T + u @ m.D.T])

    def _by_itself(self) -> Matrix:
        m = self.model
        over = {k: over_held_inputs(m.A, m.B, k * self.step_size) for k in set(self.plan.holds)}
        x = np.zeros(len(m.A))
        rows = []
        for hold, u in zip(self.plan.holds, self.plan.levels, strict=True):
            A, B = over[hold]
            x = A @ x + B @ u
            rows.append(np.concatenate([x, m.A @ x + m.B @ u, m.C @ x + m.D @ u]))
        return np.array(rows)

    def _refuse(self, columns: Sequence[int], said: Matrix, part: float, how: str) -> None:
        response, columns = self.response, list(columns)
        found, peaks = response.course[:, columns], response.peaks[columns]
        differs = np.where(np.isfinite(said), np.abs(found - said), np.inf)
        with np.errstate(invalid="ignore"):
            largest = np.maximum(peaks, np.abs(said).max(axis=0))
        allowed = part * peaks + 2 * response.curved[columns] + response.floors[columns]
        excess = differs / allowed
        k, worst = divmod(int(np.argmax(excess)), excess.shape[1])
        if not excess[k, worst] > 1:
            return
        share = differs[k, worst] / max(largest[worst], response.floors[columns[worst]])
        raise AnalysisError(
            f"component {self.component.name!r}: {self.what} is not what the FMU does: "
            f"{self.plan.ends[k] * self.step_size:.4g} s into small steps of "
            f"{', '.join(self.model.inputs)}, {self.model.signals[columns[worst]]} is "
            f"{found[k, worst]:.6g} per unit of them, where it should be "
            f"{said[k, worst]:.6g} ({how}): off by {100 * share:.3g} % of its largest "
            f"value, and {100 * part:g} % is allowed; pack the model of this FMU anew ("
            + command("fmu build", Option.WITH_LINEAR_MODEL)
            + "), or have the FMU measured instead ("
            + command("modes", Option.BLACK_BOX)
            + ")"
        )
