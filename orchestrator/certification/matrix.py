"""Several devices under several codes: a verdict and the narrowest margin for each pair."""

from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.certification.certificate import Certificate, Judged
from orchestrator.certification.margins import CriterionMargin, narrowest
from orchestrator.certification.verdict import FAILS, INCOMPLETE, NOT_TRUSTED, PASSES, exit_code
from orchestrator.errors import InputError
from orchestrator.points.failure import Failure

NOT_TESTED, FIGURES = "not tested", "no verdict"
"""In place of a verdict: where a device could not be tested at all, and where a code gives figures alone."""


@dataclass
class MatrixCell:
    device: str
    code: str
    folder: str
    failure: Failure | None = None
    verdict: str = NOT_TESTED
    sentence: str = ""
    margins: Sequence[CriterionMargin] = ()
    judged: int = 0
    missing: int = 0  # number of parts of the code that were not tested
    refused: bool = False
    has_needs: bool = False  # whether what the failed criteria would take lies beside the certificate
    # what a code without a verdict gives, in words; None of a code with one. Whatever it is, it decides nothing.
    figures: Sequence[str] | None = None

    def take(self, found: Certificate[Judged]) -> None:
        self.verdict, self.sentence, self.refused = found.verdict, found.sentence(), found.refused
        self.margins, self.missing = found.margins, len(found.missing)
        self.judged = sum(1 for v in found.verdicts if v.judged)

    @property
    def narrowest(self) -> CriterionMargin | None:
        return narrowest(self.margins)

    @property
    def without_figure(self) -> list[CriterionMargin]:
        return [m for m in self.margins if not m.accepted and m.margin is None]

    @property
    def failed(self) -> list[CriterionMargin]:
        """Criteria that are not met, least margin first; those without a figure before all."""
        bad = [m for m in self.margins if not m.accepted]
        return sorted(bad, key=lambda m: float("-inf") if m.margin is None else m.margin)

    @property
    def exit_code(self) -> int:
        """As `gfor certify` of this device and code alone ends; 0 of figures without a verdict."""
        if self.figures is not None:
            return 0
        return InputError.exit_code if self.failure is not None else exit_code(self.verdict, refused=self.refused)


@dataclass(frozen=True)
class CertificateMatrix:
    devices: tuple[str, ...]
    codes: tuple[str, ...]
    cells: dict[tuple[str, str], MatrixCell]
    left_out: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """Of the worst cell: one that fails, one that could not be tested, one that is incomplete, one whose FMU an
        acceptance test refuses; 0 where all pass. A code that is left out makes the whole incomplete."""
        found = {cell.exit_code for cell in self.cells.values()}
        found |= {exit_code(INCOMPLETE, refused=False)} if self.left_out else set()
        return next((code for code in WORST_FIRST if code in found), 0)

    def sentence(self) -> str:
        verdicts = [cell.verdict for cell in self.cells.values() if cell.figures is None]
        said = {PASSES: "passed", FAILS: "failed", INCOMPLETE: INCOMPLETE, NOT_TESTED: NOT_TESTED}
        counted = ", ".join(f"{n} {word}" for key, word in said.items() if (n := verdicts.count(key)))
        alone = list(dict.fromkeys(cell.code for cell in self.cells.values() if cell.figures is not None))
        refused = [name for name in self.devices if any(self.cells[name, code].refused for code in self.codes)]
        text = f"Of {len(verdicts)} certificates: {counted}." if verdicts else "No certificate was asked for."
        if alone:
            text += f" Figures without a verdict: {', '.join(alone)}."
        if self.left_out:
            text += f" Left out, as it needs --declare: {', '.join(self.left_out)}."
        return f"{text} Acceptance tests failed: {', '.join(refused)}." if refused else text


WORST_FIRST = (exit_code(FAILS, refused=False), InputError.exit_code, exit_code(INCOMPLETE, refused=False), NOT_TRUSTED)
"""Exit codes of cells, the one that counts most first."""
