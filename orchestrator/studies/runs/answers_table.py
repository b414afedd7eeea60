"""Answers of scenarios as a table for a terminal, and what lies outside of its range."""

from collections.abc import Sequence

from rich.table import Table
from rich.text import Text

from orchestrator.linear.spectra.modes import Mode
from orchestrator.output.report.colours import OF_VERDICTS
from orchestrator.output.report.short_texts import short
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.studies.modes.modes import ModesResult
from orchestrator.studies.runs.answer import LONGEST_REMARK, ScenarioAnswer


def answers_table(answers: Sequence[ScenarioAnswer], frequency_range: tuple[float, float]) -> Table:
    low, high = frequency_range
    table = make_table("", "Scenario", "Verdict", "f [Hz]", "Damping [%]", left=2)
    table.title = None
    when = ", before → after the events" if any(answer.became for answer in answers) else ""
    table.add_column(
        f"Least damped mode from {low:g} to {high:g} Hz{when}: who swings; remark", overflow="fold"
    )
    for answer in answers:
        word = Text(answer.verdict, style=f"bold {OF_VERDICTS[answer.good]}")
        figures = _figures([mode for mode in (answer.mode, answer.became) if mode])
        table.add_row(answer.subject, word, *figures, answer.remark)
        another = answer.another_after
        if another:
            which = "another mode" if answer.became else "not clearly the same mode"
            who = f": {answer.after_swing}" if answer.after_swing else ""
            remark = f"least damped after the events, {which}{who}"
            table.add_row("", "", *_figures([another]), short(remark, LONGEST_REMARK))
    return table


def _figures(modes: Sequence[Mode]) -> tuple[str, str]:
    """Frequency and damping of one mode, before and after the events."""
    hertz = " → ".join(f"{mode.frequency_hz:.3f}" for mode in modes)
    percent = " → ".join(f"{mode.damping_percent:.2f}" for mode in modes)
    return hertz or "–", percent or "–"


def outside(results: Sequence[ModesResult]) -> str:
    """How many modes lie outside of the range, which are mostly the network's own; "" where it is not known."""
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
    return f"Outside of the range: {number} oscillatory modes{wide}; --details tells of them."
