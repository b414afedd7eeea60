"""The verdict on each scenario of a run, a line each, and one sentence above them for somebody who reads no table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from orchestrator.core.errors import few
from orchestrator.output.report.html.elements import SHADES, VERDICTS, damping, number, table
from orchestrator.output.report.html.least_damped import LeastDamped
from orchestrator.output.report.short_texts import LONGEST_REMARK, short

_WORST_FIRST: Mapping[bool | None, int] = {False: 0, None: 1, True: 2}

_NAMES_IN_A_SENTENCE = 2
"""So many scenarios of one verdict are named in the sentence; more are counted: the lines below name all."""

_SEVERAL = 2
"""From so many stable scenarios on, what their remarks share is said once."""

_BETWEEN = "; "
"""Stands between the parts of a remark."""

_NONE = "–"


@dataclass(frozen=True)
class VerdictLine:
    """The verdict on one scenario.

    ``least``: its least damped mode, ``after``: the one after the events, ``in_time``: how the run rings."""

    scenario: str
    stable: bool | None
    verdict: str
    remark: str
    least: LeastDamped | None
    after: LeastDamped | None
    in_time: LeastDamped | None

    @classmethod
    def of(cls, scenario: Mapping[str, Any]) -> VerdictLine:
        """Read the line from a scenario of a run's or of `gfor modes`' summary."""
        answer = scenario.get("answer") or {}
        stability = scenario.get("stability") or {}
        stable = answer.get("stable", stability.get("stable", scenario.get("stable")))
        verdict = answer.get("verdict") or VERDICTS[stable]
        listed = scenario.get("modes")
        modes = listed if isinstance(listed, list) else [answer]
        judged = [mode for mode in modes if mode.get("damping_percent") is not None]
        least = min(judged, key=lambda mode: mode["damping_percent"], default=None)
        return cls(
            scenario=scenario.get("subject") or scenario.get("title", scenario["name"]),
            stable=stable,
            verdict=", but ".join(filter(None, (verdict, answer.get("but")))),
            remark=short(answer.get("remark") or "", LONGEST_REMARK),
            least=_mode(least),
            after=_mode(answer.get("after_events")),
            in_time=_mode(scenario.get("ring_down")),
        )

    @property
    def modes(self) -> list[LeastDamped]:
        """Return the modes whose figures `words` gives, in their order."""
        return [mode for mode in (self.least, self.after) if mode]

    @property
    def words(self) -> str:
        figures = f", least damped {_figures(self.least)}" if self.least else ""
        figures += f", after the events {_figures(self.after)}" if self.after else ""
        remark = f" ({self.remark})" if self.remark else ""
        return f"{self.scenario}: {self.verdict}{figures}{remark}"


def _mode(record: Mapping[str, Any] | None) -> LeastDamped | None:
    return LeastDamped.of(record) if record else None


def _figures(mode: LeastDamped) -> str:
    return f"{mode.frequency_hz:.3f} Hz, {mode.damping_percent:.2f} %"


def verdicts(lines: Sequence[VerdictLine]) -> str:
    """Return the sentence over all scenarios and the table of their lines, as a page has them.

    What the remarks on all stable scenarios have in common stands once below the table."""
    shared = _shared_remarks(lines)
    columns = ["Scenario", "Verdict", "Least damped"]
    after = any(line.after for line in lines)
    in_time = any(line.in_time for line in lines)
    columns += ["After the events"] if after else []
    columns += ["In the run"] if in_time else []
    remarks = [_remark_without(shared, line) for line in lines]
    remarked = any(remarks)
    columns += ["Remark"] if remarked else []
    rows = []
    for line, remark in zip(lines, remarks, strict=True):
        row = [escape(line.scenario), _in_colour(line.verdict, line.stable)]
        row.append(_cell(line.least))
        row += [_cell(line.after)] if after else []
        row += [_cell(line.in_time)] if in_time else []
        row += [f'<span class="remark">{escape(remark)}</span>'] if remarked else []
        rows.append(row)
    below = f"<p>Each stable one: {escape('; '.join(shared))}.</p>" if shared else ""
    return f'<p class="verdict">{_sentence(lines)}</p>{table("Verdicts", columns, rows, left=2)}{below}'


def _shared_remarks(lines: Sequence[VerdictLine]) -> list[str]:
    """List the parts that the remarks on all stable scenarios have in common, where these are several."""
    stable = [line.remark.split(_BETWEEN) for line in lines if line.stable]
    if len(stable) < _SEVERAL:
        return []
    return [part for part in stable[0] if part and all(part in parts for parts in stable[1:])]


def _remark_without(shared: Sequence[str], line: VerdictLine) -> str:
    parts = line.remark.split(_BETWEEN)
    left = [part for part in parts if part not in shared] if line.stable else parts
    return _BETWEEN.join(left)


def _cell(mode: LeastDamped | None) -> str:
    if mode is None:
        return _NONE
    return (
        f'<span class="mode">{mode.frequency_hz:.3f} Hz, {damping(mode.damping_percent)} %</span>'
    )


def _sentence(lines: Sequence[VerdictLine]) -> str:
    """Join the scenarios of one verdict, the worst verdict first, each in its own colour."""
    alike: dict[tuple[bool | None, str], list[VerdictLine]] = {}
    for line in sorted(lines, key=lambda one: _WORST_FIRST[one.stable]):
        alike.setdefault((line.stable, line.verdict), []).append(line)
    last = list(alike.values())[-1]
    parts = []
    for (stable, verdict), found in alike.items():
        names = _names_or_count(found, len(lines)) if found is last else _names(found)
        parts.append(_in_colour(f"{names}: {verdict}{_worst(found)}", stable))
    return "; ".join(parts) + "."


def _names(lines: Sequence[VerdictLine]) -> str:
    return few([line.scenario for line in lines], _NAMES_IN_A_SENTENCE)


def _names_or_count(lines: Sequence[VerdictLine], of: int) -> str:
    """Name the scenarios of the best verdict, or where they are many, count them."""
    if len(lines) <= _NAMES_IN_A_SENTENCE:
        return _names(lines)
    return f"All {of}" if len(lines) == of else f"the {len(lines)} others"


def _worst(lines: Sequence[VerdictLine]) -> str:
    """Name the least damped swing of scenarios that have one verdict; where they are several, the best as well."""
    known = sorted(
        ((line.least, line.scenario) for line in lines if line.least),
        key=lambda pair: pair[0].damping_percent,
    )
    if not known:
        return ""
    (worst, where), (best, there) = known[0], known[-1]
    if len(known) == 1:
        return f", its least damped swing has {number(worst.damping_percent, 2)} %"
    return (
        f", the least damped swing has {number(worst.damping_percent, 2)} % ({where}) "
        f"to {number(best.damping_percent, 2)} % ({there})"
    )


def _in_colour(text: str, stable: bool | None) -> str:
    return f'<b class="{SHADES[stable]}">{escape(text)}</b>'
