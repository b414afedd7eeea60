"""One point of a sweep: what is asked, what comes out, and the file that keeps it.

Everything here can be sent to another process or another machine.
"""

import hashlib
import json
import os
import threading
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.analysis.mode_tracking import ModeSet
from orchestrator.analysis.threads import one_thread
from orchestrator.cases.case import BUILT_IN, Case, load_case
from orchestrator.cases.prepare import PreparedScenario
from orchestrator.cases.schema import Value
from orchestrator.errors import CaseError, CosimError, InputError
from orchestrator.study.modes import ModesResult, compute_modes

_FORMAT = 1
"""Of the files; another number makes those of before invalid."""

_one_at_a_time = threading.Lock()
"""FMUs and the limit on BLAS threads belong to the whole process, whose workers may be threads of a Dask cluster."""


@dataclass(frozen=True)
class PointTask:
    """A scenario with the values of one point.

    Attributes
    ----------
    case
        Name of a built-in case, or path of a file that every worker can read.
    fingerprint
        Of the case file's text and of the code that computes; a worker with others refuses.
    overrides
        Values by ``component.variable``.
    step_size
        Communication step [s]; None for the case's.
    frequency_range
        Of the modes [Hz].
    key
        Names the point's file: a hash of all that the result depends on.
    """

    case: str
    fingerprint: str
    scenario: str
    overrides: dict[str, Value]
    step_size: float | None
    frequency_range: tuple[float, float]
    key: str


@dataclass(frozen=True)
class PointRecord:
    """The modes of a point, or why there are none.

    Attributes
    ----------
    modes
        Least damped first.
    named
        Names that the case gives to some of these modes, by index.
    error
        The message of the failure; None where all is well.
    lasting
        Whether the same would come out again: not so where a worker died or the machine was at fault.
    residual
        Of the steady state, as in `OperatingPoint`.
    """

    key: str
    modes: ModeSet | None = None
    named: dict[str, int] = field(default_factory=dict)
    error: str | None = None
    lasting: bool = True
    residual: float = float("nan")
    warnings: tuple[str, ...] = ()


def make_task(
    case: Case,
    prepared: PreparedScenario,
    fixed: Mapping[str, Value],
    varied: Mapping[str, Value],
    step_size: float | None,
    frequency_range: tuple[float, float],
) -> PointTask:
    """The task of one point.

    Parameters
    ----------
    prepared
        The scenario without what is varied: its FMUs and values go into the key.
    fixed, varied
        Overrides; the varied ones go first.
    """
    overrides = {**fixed, **varied}
    fmus = {name: plan.description.guid for name, plan in prepared.system.components.items()}
    content = {
        "format": _FORMAT,
        "fingerprint": fingerprint(case),
        "scenario": prepared.name,
        "fmus": fmus,
        "values": prepared.values,
        "overrides": sorted(overrides.items()),
        "step": step_size,
        "range": list(frequency_range),
    }
    key = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]
    path = case.path.resolve()
    reference = path.parent.name if path.parent.parent == BUILT_IN.resolve() else str(path)
    return PointTask(reference, fingerprint(case), prepared.name, overrides, step_size, frequency_range, key)


def fingerprint(case: Case) -> str:
    """Hash of a case file's text and of this package's code."""
    return hashlib.sha256(f"{_code()}\0{case.text}".encode()).hexdigest()[:32]


@cache
def _code() -> str:
    """Hash of the version and of the modules that a point's result depends on."""
    hasher = hashlib.sha256(version("gfor-cosim").encode())
    root = Path(__file__).parents[1]
    files = [f for part in ("fmi", "coupling", "analysis", "cases") for f in (root / part).rglob("*.py")]
    for file in sorted([*files, root / "study" / "modes.py", Path(__file__)]):
        hasher.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return hasher.hexdigest()


_code()  # now, so that it is the hash of what is loaded


# -- computing ---------------------------------------------------------------------------------------


def compute_point(task: PointTask) -> PointRecord:
    """Prepare, find the steady state, linearise, find the modes; a failure becomes a record as well.

    Raises
    ------
    InputError
        If this worker has another case file or other code than the sweep was started with.
    """
    case = _case(task.case, task.fingerprint)
    # One BLAS thread for every worker: several workers do not fight, and rounding is the same everywhere.
    with _one_at_a_time, one_thread():
        try:
            (prepared,) = case.prepare([task.scenario], task.overrides, task.step_size)
            return _record(task.key, compute_modes(case, prepared, task.frequency_range))
        except CaseError as error:
            return PointRecord(task.key, error="; ".join(str(problem) for problem in error.problems))
        except CosimError as error:
            return PointRecord(task.key, error=str(error))
        except Exception as error:  # whatever a foreign FMU or library does, the other points go on
            return PointRecord(task.key, error=f"{type(error).__name__}: {error}", lasting=False)


@lru_cache(maxsize=8)
def _case(reference: str, wanted: str) -> Case:
    case = load_case(reference)
    if fingerprint(case) != wanted:
        raise InputError(
            f"{case.path}: a worker sees another text of this file, or has other code of gfor-cosim, than the sweep "
            "was started with; give all machines the same file and version, and restart the workers"
        )
    return case


def _record(key: str, result: ModesResult) -> PointRecord:
    modes = result.modes
    return PointRecord(
        key,
        ModeSet.of(modes, result.model.names),
        {name: next(i for i, m in enumerate(modes) if m is mode) for name, mode in result.named.items()},
        residual=result.operating_point.residual,
        warnings=result.warnings,
    )


# -- keeping -----------------------------------------------------------------------------------------


class PointStore:
    """Finished points, one small file each; what is not whole is not there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)

    def load(self, key: str) -> PointRecord | None:
        """The record of a point; None if there is none that can be read."""
        try:
            with np.load(self._path(key), allow_pickle=False) as data:
                header = json.loads(data["header"].tobytes())
                arrays = {name: data[name] for name in ("eigenvalues", "left", "right") if name in data}
            if header["key"] != key or header["format"] != _FORMAT:
                return None
            names = tuple(header.pop("names"))
            del header["format"]
            modes = ModeSet(**arrays, names=names) if arrays else None
            return PointRecord(**header | {"warnings": tuple(header["warnings"]), "modes": modes})
        except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, zlib.error):
            return None

    def save(self, record: PointRecord) -> None:
        """Write a record at once; only a whole file gets the name that `load` looks for."""
        header = {name: value for name, value in vars(record).items() if name != "modes"}
        header |= {"format": _FORMAT, "names": record.modes.names if record.modes else ()}
        arrays: dict[str, Any] = {}
        if record.modes is not None:
            arrays = {name: getattr(record.modes, name) for name in ("eigenvalues", "left", "right")}
        partial = self._path(record.key).with_suffix(f".{os.getpid()}.part")
        try:
            with partial.open("wb") as file:
                np.savez(file, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), **arrays)
            partial.replace(self._path(record.key))
        except OSError as error:
            raise InputError(
                f"--out: a finished point cannot be written to {self.folder}: {error.strerror}; make room there, or "
                "choose another folder, and start the same command again: what is written stays"
            ) from error

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.npz"
