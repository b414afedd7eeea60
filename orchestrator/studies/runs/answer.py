"""The answer to what a scenario was run for: a verdict, the mode in question, one remark."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.results.mode_json import eigenvalue_json

_SMALLEST = 1e-4
"""Share of a mode from which on a component is named in files."""


@dataclass(frozen=True)
class ScenarioAnswer:
    subject: str
    good: bool | None  # whether that is good; None where it is not known
    verdict: str
    mode: Mode | None  # the least damped mode of the range
    remark: str  # whole; tables shorten it
    # the least damped mode where the events leave something switched, and who swings in it
    after: Mode | None = None
    after_swing: str = ""
    # ``mode`` where the events leave something switched; None where no mode is clearly the same
    became: Mode | None = None
    but: str = ""  # what does not hold although the verdict is good, as "motor5 stalls"
    quiet_relays: str = ""  # that no relay trips, and which came nearest; "" elsewhere

    @property
    def word(self) -> str:
        """The verdict, with what does not hold although it is good."""
        return f"{self.verdict}, but {self.but}" if self.but else self.verdict

    def as_json(self) -> dict[str, Any]:
        mode = self.mode
        frequency = None if mode is None else mode.frequency_hz
        percent = None if mode is None else mode.damping_percent
        found = {
            "stable": self.good,
            "verdict": self.verdict,
            "frequency_hz": frequency,
            "damping_percent": percent,
            "components": _shares(mode),
            "remark": self.remark,
            **({"but": self.but} if self.but else {}),
            **({"quiet_relays": self.quiet_relays} if self.quiet_relays else {}),
        }
        if self.after is None:
            return found
        after = eigenvalue_json(self.after.eigenvalue, self.after.damping_percent)
        became = self.became
        same = (
            None if became is None else eigenvalue_json(became.eigenvalue, became.damping_percent)
        )
        whole = {**after, "components": _shares(self.after), "same_mode": same}
        return found | {"after_events": whole}

    @property
    def another_after(self) -> Mode | None:
        """The least damped mode after the events, where it is not, or not clearly, the one before them."""
        return None if self.after is self.became else self.after


def _shares(mode: Mode | None) -> dict[str, float]:
    if mode is None:
        return {}
    return {name: share for name, share in mode.by_component.items() if share >= _SMALLEST}


@dataclass(frozen=True)
class EarlyEnd:
    """Where a study ended before its time, and what is not there because of that."""

    scenario: str
    interrupted: bool
    kept: bool = True
    not_begun: Mapping[str, str] = field(default_factory=dict)

    @property
    def word(self) -> str:
        return "interrupted" if self.interrupted else "failed"

    @property
    def place(self) -> str:
        """Where it ended, and what never began."""
        rest = f"; never begun: {', '.join(self.not_begun.values())}" if self.not_begun else ""
        return f"in {self.scenario}{'' if self.kept else ', of which nothing is kept'}{rest}"

    def as_json(self) -> dict[str, Any]:
        return {"word": self.word, "place": self.place, "not_begun": list(self.not_begun)}
