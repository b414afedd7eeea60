"""The verdict on one row: what its criteria say of the response, and what none of them can say."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from orchestrator.core.errors import InputError
from orchestrator.simulation.watch.finding import BENCH_RESONANCE
from orchestrator.studies.certification.codes.bench_point import INTERVAL, RECORDED, BenchResult
from orchestrator.studies.certification.codes.criteria import CURRENT, carries, holds_together
from orchestrator.studies.certification.codes.measured import MeasuredRow
from orchestrator.studies.certification.codes.row import CodeRow, GridCode, RowFinding
from orchestrator.studies.certification.margins import CriterionMargin

# in place of a verdict
NO_VERDICT = "no verdict"  # the code gives none
NOT_JUDGED = "not judged"  # the response allows none


@dataclass(frozen=True)
class RowVerdict:
    """A row with a finding for each criterion.

    ``unknown``: why nothing is known of it, as the run failed; ``of_the_bench``: why its response, which is known, says
    nothing of the converter, as the bench itself makes what fails there."""

    row: CodeRow
    findings: tuple[RowFinding, ...] = ()
    unknown: str = ""
    of_the_bench: str = ""

    @property
    def name(self) -> str:
        return self.row.name

    @property
    def is_judged(self) -> bool:
        return not self.not_judged and not self.row.shown_only

    @property
    def not_judged(self) -> str:
        """Return why the row has no verdict; empty where it has one."""
        return self.unknown or self.of_the_bench

    @property
    def accepted(self) -> bool | None:
        """Return whether every criterion is met; None where the row does not count."""
        return all(finding.accepted for finding in self.findings) if self.is_judged else None

    @property
    def failed(self) -> list[RowFinding]:
        return [finding for finding in self.findings if finding.accepted is False]

    def margins(self) -> list[CriterionMargin]:
        known = [(f, f.accepted) for f in self.findings if f.accepted is not None]
        return [
            CriterionMargin(self.name, f.criterion, f.margin, accepted, f.text)
            for f, accepted in known
        ]

    def word(self, finding: RowFinding) -> str:
        if self.row.shown_only:
            return NO_VERDICT
        return {True: "accepted", False: "not accepted", None: NOT_JUDGED}[finding.accepted]


def try_criteria(code: GridCode[CodeRow], f_n: float) -> None:
    """Judge a response that never moves in every row, so that what cannot be judged is told before the run."""
    for row in code.rows:
        try:
            times = np.arange(0, row.programme(f_n).stop + INTERVAL, INTERVAL)
            with np.errstate(all="ignore"):
                judge_row(
                    row,
                    BenchResult(row.name, times, dict.fromkeys(RECORDED, np.ones(times.shape))),
                    f_n,
                )
        except InputError as error:
            raise InputError(f"code {code.key!r}, row {row.name!r}: {error}") from error


def judge_row(
    row: CodeRow, result: BenchResult, f_n: float, stated: Sequence[Mapping[str, Any]] | None = None
) -> RowVerdict:
    """Apply a row's criteria to its response, and that of the current.

    ``stated``: Criteria of a certificate; where it was issued without that of the current, a current that is within its
    limit is left out, and one that is not contradicts it.

    A converter that does not hold together answers nothing else: what its other criteria meet is not judged, and what
    they miss stays missed."""
    if result.failure:
        return RowVerdict(row, unknown=str(result.failure))
    programme = row.programme(f_n)
    measured = MeasuredRow(
        result.times,
        result.signals,
        f_n,
        programme.times,
        tuple(result.findings),
        current_limit=result.current_limit,
        source_angle=programme.source_angle(result.times, f_n),
    )
    if len(result.times) < 2 or result.times[-1] < programme.stop - 2e-3:
        found: Sequence[RowFinding] = [_ended_early(result, measured, programme.stop)]
    else:
        found = [judge(measured) for judge in row.criteria]
        current = carries()(measured) if {"q", "v"} <= set(result.signals) else None
        if current and (
            not current.accepted or stated is None or any(c["criterion"] == CURRENT for c in stated)
        ):
            found.append(current)
        reason = measured.broken
        if reason:
            why = f"{NOT_JUDGED}, {reason}"  # what a broken response meets has no meaning
            found = [
                replace(f, accepted=None, margin=None, text=f"{f.text}; {why}") if f.accepted else f
                for f in found
            ]
            if all(f.accepted is None for f in found):  # no criterion of the row asks for it
                found.append(holds_together()(measured))
    if row.shown_only:
        return RowVerdict(row, tuple(replace(finding, accepted=None) for finding in found))
    resonance = next((f for f in result.findings if f["kind"] == BENCH_RESONANCE), None)
    if resonance is not None and not all(finding.accepted for finding in found):
        return _left_open(row, found, str(resonance["message"]))
    return RowVerdict(row, tuple(found))


def _left_open(row: CodeRow, found: Sequence[RowFinding], why: str) -> RowVerdict:
    """A row whose response the bench makes: its figures are shown, and none is a verdict on the converter."""
    told = f"{NOT_JUDGED}, the bench's own capacitance makes the response"
    shown = [
        f
        if f.accepted is None
        else replace(f, accepted=None, margin=None, text=f"{f.text}; {told}")
        for f in found
    ]
    return RowVerdict(row, tuple(shown), of_the_bench=why)


def _ended_early(result: BenchResult, measured: MeasuredRow, stop: float) -> RowFinding:
    """The finding on a run that ended before its time [s]."""
    ended = float(result.times[-1]) if len(result.times) else 0.0
    return RowFinding(
        "runs",
        "the converter runs to the end",
        origin="reading",
        value=ended,
        limit=stop,
        margin=None,
        accepted=False,
        text="; ".join(measured.faults) or f"the run ended at {ended:g} s",
        unit="s",
    )
