"""Parts of a certificate that are computed anew: points of the damping test, or rows of another code."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.certification.codes.bench_point import BenchTask
from orchestrator.certification.codes.rows_anew import chosen_rows, verify_rows
from orchestrator.certification.form import NORM
from orchestrator.certification.point import CertificatePointTask
from orchestrator.certification.points_anew import chosen_points, verify_points
from orchestrator.certification.verification import Verification
from orchestrator.errors import InputError
from orchestrator.points.task import Task


@dataclass(frozen=True)
class Parts:
    one: str  # what a part is called
    choose: Callable[..., list[Any]]  # from content, wishes and ``every``: the parts that are computed anew
    verify: Callable[..., Verification]  # from folder, content, chosen parts, executor and report
    task: type[Task]
    times: int  # so many points each

    def chosen(self, folder: Path, content: Mapping[str, Any], wanted: Sequence[Any], *, every: bool) -> list[Any]:
        """Line reactances, or names of rows; ``wanted``: those that were asked for."""
        named = any(isinstance(one, str) for one in wanted)
        if self is POINTS and named:
            raise InputError(f"--rows: {folder} is the certificate of a damping test, which has points; give --points, "
                             "with line reactances")  # fmt: skip
        if wanted and self is ROWS and not named:
            raise InputError(f"--points: {folder} is the certificate of a grid code, which has rows; give --rows, with "
                             "their names")  # fmt: skip
        return self.choose(content, wanted, every=every)


POINTS = Parts("point", chosen_points, verify_points, CertificatePointTask, 2)
ROWS = Parts("row", chosen_rows, verify_rows, BenchTask, 1)


def parts_of(content: Mapping[str, Any]) -> Parts:
    return POINTS if content["format"] == NORM else ROWS
