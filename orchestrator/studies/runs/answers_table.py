"""Answers of scenarios as a table for a terminal, and what lies outside of its range."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table
from rich.text import Text

from orchestrator.cases.case import as_typed
from orchestrator.core.options import Option
from orchestrator.linear.spectra.modes import Mode, damping_percent
from orchestrator.output.report.colours import OF_VERDICTS
from orchestrator.output.report.short_texts import short
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.answer import ScenarioAnswer
from orchestrator.studies.runs.answer_of_modes import least_damped, name_of_answers


@dataclass(frozen=True)
class OtherFigures:
    """Somebody else's figures for the answers' modes, which stand in brackets behind ours.

    ``figures``: frequency [Hz] and damping ratio [%] for each answer, None where they have none."""

    title: str = ""
    figures: Sequence[tuple[float, float] | None] = ()

    def heading(self, own: str) -> str:
        return f"{own} ({self.title})" if any(self.figures) else own


def other_figures(results: Sequence[ModesResult]) -> OtherFigures:
    """Return the figures that the case has for its only named mode, if that is every answer's mode."""
    name = name_of_answers(results)
    reference = results[0].prepared.case.table.reference if name else None
    if reference is None:
        return OtherFigures()
    tables = [r.references.get(name) for r in results]
    figures = [(one.frequency_hz, one.damping_percent) if one else None for one in tables]
    return OtherFigures(reference.title, figures)


def answers_table(
    answers: Sequence[ScenarioAnswer],
    frequency_range: tuple[float, float],
    others: OtherFigures | None = None,
    *,
    longest: int | None = None,
) -> Table:
    """Return a row for each scenario's answer.

    ``longest``: characters from which a remark is cut, as on a terminal; None where all of it is shown."""
    low, high = frequency_range
    others = others or OtherFigures()
    theirs = dict(enumerate(others.figures))
    figures = (others.heading("f [Hz]"), others.heading("Damping [%]"))
    table = make_table("", "Scenario", "Verdict", *figures, left=2)
    table.title = None
    when = ", before → after the events" if any(answer.became for answer in answers) else ""
    table.add_column(
        f"Least damped mode from {low:g} to {high:g} Hz{when}: who swings; remark", overflow="fold"
    )
    for k, answer in enumerate(answers):
        word = Text(answer.word, style=f"bold {OF_VERDICTS[answer.good]}")
        modes = [mode for mode in (answer.mode, answer.became) if mode]
        figures = _figures(modes, theirs.get(k))
        table.add_row(answer.subject, word, *figures, _remark(answer.remark, longest))
        another = answer.another_after
        if another:
            which = "another mode" if answer.became else "not clearly the same mode"
            who = f": {answer.after_swing}" if answer.after_swing else ""
            remark = f"least damped after the events, {which}{who}"
            table.add_row("", "", *_figures([another]), _remark(remark, longest))
    return table


def _remark(text: str, longest: int | None) -> str:
    return text if longest is None else short(text, longest)


def _figures(modes: Sequence[Mode], theirs: tuple[float, float] | None = None) -> tuple[str, str]:
    """Frequency and damping of one mode, before and after the events; somebody else's are those before them."""
    hertz = [f"{mode.frequency_hz:.3f}" for mode in modes]
    percent = [f"{mode.damping_percent:.2f}" for mode in modes]
    if theirs and modes:
        hertz[0] += f" ({theirs[0]:.2f})"
        percent[0] += f" ({theirs[1]:.2f})"
    return " → ".join(hertz) or "–", " → ".join(percent) or "–"


def outside(results: Sequence[ModesResult], *, details: bool = False) -> str:
    """How many modes lie outside of the range, which are mostly the network's own; "" where it is not known.

    Machines may swing there with less damping than the answers have: that mode is named.

    ``details``: whether the details are told anyway."""
    counts = sorted({r.hidden.count for r in results if r.hidden is not None})
    if not counts or counts == [0]:
        return ""
    number = f"{counts[0]} to {counts[-1]}" if len(counts) > 1 else f"{counts[0]}"
    swings = max(
        (r.hidden for r in results if r.hidden is not None),
        key=lambda hidden: len(hidden.electromechanical),
    )
    wide = (
        f", of which machines swing in {len(swings.electromechanical)}"
        if swings.electromechanical
        else ""
    )
    further = "" if details else "; --details tells of them"
    return (
        f"Outside of the range: {number} oscillatory modes{wide}{_least_swing(results)}{further}."
    )


def _least_swing(results: Sequence[ModesResult]) -> str:
    """The least damped swing of machines outside of the range, where it has less damping than the scenario's answer."""
    found, answers = [], []
    for result in results:
        swing = None if result.hidden is None else result.hidden.least_swing
        answered = least_damped(result)
        answers += [answered] if answered else []
        if swing is None:
            continue
        percent = damping_percent(swing)
        if answered is None or percent < answered.damping_percent:
            text = f"{swing.imag / math.tau:.3f} Hz, {percent:.2f} %"
            found.append((percent, text, result))
    if not found:
        return ""
    _, text, result = min(found, key=lambda entry: entry[0])
    everywhere = len(found) == len(results) and len({told for _, told, _ in found}) == 1
    where = "" if everywhere else f", in {result.prepared.title}"
    wide = "" if result.hidden is None else result.hidden.wide
    typed = f"`gfor modes {as_typed(result.prepared.case)} {Option.RANGE} {wide}`"
    worse = "LESS damped than those above" if answers else "the least damped"
    return f", {worse}: {text}{where} ({typed})"
