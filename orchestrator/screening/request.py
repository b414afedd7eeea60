"""What is asked of a screening."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from orchestrator.analysis.modes import ELECTROMECHANICAL_HZ
from orchestrator.asked import FILE, FLAG, FREQUENCIES, OUTAGES, FieldKind, asked, one_of, percent, read_percent
from orchestrator.cases.sharing import SharingRule
from orchestrator.errors import InputError
from orchestrator.screening.modes import MOST_DAMPING, CriticalRegion

_MOST = 100 * MOST_DAMPING
_DAMPING = FieldKind("PERCENT", partial(read_percent, most=_MOST), partial(percent, most=_MOST))


@dataclass(frozen=True)
class ScreeningRequest:
    points: Path | None = asked(FILE, None, "operating points: a CSV file, a row each (default: the case as it is)")
    outages: str | None = asked(
        OUTAGES, None, "n-1, lines, units, or names such as line_1_2,sg3 or line_1_2+sg3 (repeatable)"
    )
    sharing: SharingRule | None = asked(
        one_of(SharingRule), None, "who feeds what an outage takes: droop (units by droop and rating, the default), "
        "rating, or slack (the slack alone)",
    )  # fmt: skip
    frequencies: tuple[float, float] = asked(
        FREQUENCIES, ELECTROMECHANICAL_HZ, "frequencies [Hz] (0.1:2)", option="--range"
    )
    damping: float = asked(_DAMPING, 0.2, "damping below which a mode is critical, at most 60 (default: 20)")
    whole: bool = asked(FLAG, False, "count growing modes of all frequencies at every point; takes longer")

    @property
    def region(self) -> CriticalRegion:
        low, high = self.frequencies
        if not low > 0:
            raise InputError(f"frequencies {low:g}:{high:g} (--range): a screening begins above 0 Hz")
        return CriticalRegion(low, high, self.damping)
