"""Chapters of runs and of modes: one line of an answer for each scenario."""

from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path

from orchestrator.core.truth import all_true
from orchestrator.output.report.html.chapters.chapter import (
    Chapter,
    Content,
    bases_of,
    kinds_of,
    modes_map,
)
from orchestrator.output.report.html.elements import damping, table
from orchestrator.output.report.html.verdict_lines import VerdictLine


def of_run(
    folder: Path, scenarios: Sequence[Content], content: str = "", beside: Sequence[str] = ()
) -> Chapter:
    """Make the chapter of a run's summary, or the same of `gfor modes`; ``beside``: what devices bring."""
    open_ = []
    lines = [VerdictLine.of(scenario) for scenario in scenarios]
    for line, s in zip(lines, scenarios, strict=True):
        open_ += [
            f"{line.scenario}: {f['message']}"
            for f in s.get("findings", [])
            if f["kind"] == "not_judged"
        ]
        open_ += [f"{line.scenario}: {s['failure']}"] if s.get("failure") else []
        if line.stable is None and not line.remark:
            reason = (s.get("stability") or {}).get("reason")
            open_.append(f"{line.scenario}: {reason or 'stability'}")
    warned = (text for s in scenarios for text in s.get("warnings", []))
    good = all_true(line.stable for line in lines)
    basis = (
        "modes of the FMUs that were simulated"
        if any("step_size_s" in s for s in scenarios)
        else ("linear model of the FMUs at the operating point; nothing was run")
    )
    asked = "Is the fault survived" if any(map(has_fault, scenarios)) else "Is the network stable"
    return Chapter(
        folder,
        f"{asked}, and which swing is damped least?",
        answer="; ".join([*(line.words for line in lines), *beside]),
        good=good,
        sure="; ".join([*kinds_of(scenarios), *faults_of(scenarios), basis]),
        not_judged=open_,
        doubts=list(dict.fromkeys(warned)),
        content=content,
        bases=bases_of(scenarios),
        least=[mode for line in lines for mode in line.modes],
        lines=lines,
        beside=beside,
    )


def has_fault(scenario: Content) -> bool:
    """Return whether a run had a fault; of a result of an earlier version this is not known."""
    return bool(scenario.get("bus_faults") or scenario.get("line_faults"))


def faults_of(scenarios: Sequence[Content]) -> list[str]:
    """Return the faults of fewer than three phases, with the impedances of both other sequences, in words."""
    said = (fault["words"] for s in scenarios for fault in s.get("sequences", []))
    return [*dict.fromkeys(said)]


def of_modes(file: Path, content: Content) -> Chapter:
    rows = [
        [
            escape(_called(s)),
            f"{m['frequency_hz']:.4f}",
            damping(m["damping_percent"]),
            escape(m["name"] or ""),
            escape(", ".join(f"{c} {share:.0%}" for c, share in list(m["components"].items())[:3])),
        ]
        for s in content["scenarios"]
        for m in s["modes"]
    ]
    columns = ["Scenario", "f [Hz]", "Damping [%]", "Name", "Who swings"]
    groups = {_called(s): s["modes"] for s in content["scenarios"]}
    shown = modes_map("Modes", groups) + table("Modes", columns, rows)
    made = of_run(file, content["scenarios"], shown, beside=content.get("beside", []))
    sure = "; ".join(
        filter(None, (made.sure, content["facts"], f"steps of {1e3 * content['step_size_s']:g} ms"))
    )
    return replace(made, sure=sure)


def _called(scenario: Content) -> str:
    """Name a scenario as the verdicts above do."""
    return str(scenario.get("subject") or scenario.get("title", scenario["name"]))
