"""One system of a study of interactions: its task, and its modes with the participation of every component."""

import math
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from orchestrator.cases.case import Case
from orchestrator.cases.form.schema import ComponentTable
from orchestrator.linear.models.linear_model import IDENTIFIED, LinearModel
from orchestrator.linear.spectra.modes import Mode, damping_percent
from orchestrator.studies.black_box.coupled_modes import modes_with_boxes
from orchestrator.studies.interactions.exchange import exchanged_case, require_same_flow
from orchestrator.studies.modes.modes import ModesResult, compute_modes, running
from orchestrator.studies.points.failure import Failure
from orchestrator.studies.points.task import Kept, Task, computed


@dataclass(frozen=True)
class SharedMode:
    # real, imag: of the eigenvalue [1/s, rad/s]
    real: float
    imag: float
    components: dict[str, float]  # participation of every component; the shares sum to 1

    @classmethod
    def of(cls, mode: Mode) -> Self:
        return cls(mode.eigenvalue.real, mode.eigenvalue.imag, dict(mode.by_component))

    @property
    def eigenvalue(self) -> complex:
        return complex(self.real, self.imag)

    @property
    def frequency_hz(self) -> float:
        return self.imag / (2 * math.pi)

    @property
    def damping_percent(self) -> float:
        return damping_percent(self.eigenvalue)


@dataclass(frozen=True)
class KeptMatrix:
    """A sparse matrix by its entries."""

    shape: tuple[int, int]
    rows: NDArray[np.int32]
    columns: NDArray[np.int32]
    values: NDArray[np.float64]

    @classmethod
    def of(cls, matrix: sp.csr_array) -> Self:
        entries = sp.coo_array(matrix)
        rows, columns = (places.astype(np.int32) for places in (entries.row, entries.col))
        return cls((matrix.shape[0], matrix.shape[1]), rows, columns, entries.data.astype(float))

    def matrix(self) -> sp.csr_array:
        return sp.csr_array((self.values, (self.rows, self.columns)), shape=self.shape)


@dataclass(frozen=True)
class KeptModel:
    """A linear model as it is kept, so that modes can be followed from one system to another."""

    F: KeptMatrix
    G: KeptMatrix
    H: KeptMatrix
    K: KeptMatrix
    names: tuple[str, ...]
    wires: tuple[str, ...]
    step_size: float | None
    period: int

    @classmethod
    def of(cls, model: LinearModel) -> Self:
        F, G, H, K = (KeptMatrix.of(matrix) for matrix in (model.F, model.G, model.H, model.K))
        return cls(
            F=F,
            G=G,
            H=H,
            K=K,
            names=model.names,
            wires=model.wires,
            step_size=model.step_size,
            period=model.period,
        )

    def model(self) -> LinearModel:
        F, G, H, K = (kept.matrix() for kept in (self.F, self.G, self.H, self.K))
        return LinearModel(
            F,
            G,
            H=H,
            K=K,
            names=self.names,
            step_size=self.step_size,
            disagreement=0.0,
            period=self.period,
            wires=self.wires,
        )


@dataclass(frozen=True)
class SystemRecord(Kept):
    modes: tuple[SharedMode, ...] = ()  # oscillations of the range, least damped first
    # the mode that grows fastest, at any frequency; None where nothing is known to grow
    growing: SharedMode | None = None
    # stability, because: the verdict over the whole spectrum, as `Stability.as_json` gives it, and its figures in
    # words; empty where it failed
    stability: dict[str, Any] = field(default_factory=dict)
    because: str = ""
    warnings: tuple[str, ...] = ()
    identified: tuple[str, ...] = ()  # components that hide their states and were identified
    states: int = 0
    residual: float = float("nan")  # of the steady state, as in `OperatingPoint`
    failure: Failure | None = None  # why there are no modes; None where there are
    model: KeptModel | None = field(default=None, compare=False)  # whose modes these are

    @property
    def stable(self) -> bool | None:
        found: bool | None = self.stability.get("stable")
        return found


@dataclass(frozen=True)
class SystemTask(Task):
    record = SystemRecord
    frequency_range: tuple[float, float]  # of the modes [Hz]
    # tables of the devices that are other than the case's, by component, as their keys and values.
    exchanged: dict[str, dict[str, Any]]
    files: dict[str, list[str]]  # what stands for the files of these devices, by component
    black_box: bool  # whether components that hide their states are identified
    # real and imaginary part [pu] of every bus voltage of the power flow
    voltages: dict[str, tuple[float, float]] = field(compare=False)


def compute_system(task: SystemTask) -> SystemRecord:
    return computed(task, lambda task, case: _record(_modes(case, task)))


def _modes(case: Case, task: SystemTask) -> ModesResult:
    changed = exchanged_case(
        case, {name: ComponentTable.model_validate(table) for name, table in task.exchanged.items()}
    )
    prepared = task.study.prepare(changed, {})
    require_same_flow({bus: complex(*parts) for bus, parts in task.voltages.items()}, prepared)
    if not task.black_box:
        return compute_modes(prepared, task.frequency_range)
    with running(prepared) as master:
        return modes_with_boxes(prepared, master, task.frequency_range)


def _record(result: ModesResult) -> SystemRecord:
    stability = result.stability
    grows = stability.stable is False and stability.mode is not None
    identified = [name for name, source in result.linearised.items() if source == IDENTIFIED]
    return SystemRecord(
        modes=tuple(SharedMode.of(mode) for mode in result.modes if mode.is_oscillation),
        growing=SharedMode.of(stability.mode) if grows and stability.mode is not None else None,
        stability=stability.as_json(),
        because=stability.because(),
        warnings=result.warnings,
        identified=tuple(identified),
        states=result.model.number_of_states,
        residual=result.operating_point.residual,
        model=KeptModel.of(result.model),
    )
