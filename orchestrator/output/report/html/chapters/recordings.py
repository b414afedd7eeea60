"""Chapters of recordings: two runs beside each other, the modes of a record, and where an oscillation comes from."""

from html import escape
from pathlib import Path
from typing import Any

from orchestrator.core.errors import number_of
from orchestrator.output.report.html.chapters.chapter import Chapter, modes_map
from orchestrator.output.report.html.elements import damping, table


def of_comparison(file: Path, signals: Any) -> Chapter:
    rows = [
        [
            escape(s["expression"]),
            escape(s["unit"]),
            f"{s['largest']:.4g}",
            f"{s['at']:.3f}",
            f"{s['rms']:.4g}",
        ]
        for s in signals
    ]
    first = signals[0]
    answer = f"{first['expression']} differs most, by {first['largest']:.4g} {first['unit']} at {first['at']:.3f} s"
    columns = ["Signal", "Unit", "Largest difference", "at [s]", "RMS"]
    return Chapter(
        file,
        "How do two runs differ?",
        answer=answer,
        good=None,
        sure=f"{number_of(len(signals), 'signal')} compared, listed by how much they differ for their size",
        not_judged=(),
        content=table("Differences", columns, rows, left=2),
    )


def of_identified(file: Path, modes: Any) -> Chapter:
    rows = [
        [
            f"{m['frequency_hz']:.4f}",
            damping(m["damping_percent"]),
            f"{m['amplitude']:.3g}",
            escape("; ".join(m["doubts"])),
        ]
        for m in modes
    ]
    swing = next((m for m in modes if m["frequency_hz"]), None)
    figures = (
        f"{swing['frequency_hz']:.3f} Hz, {swing['damping_percent']:.2f} %"
        if swing
        else "no oscillation"
    )
    sure = (
        f"{sum(not m['doubts'] for m in modes)} of {number_of(len(modes), 'mode')} without a doubt"
    )
    doubts = [f"{m['frequency_hz']:.3f} Hz: {'; '.join(m['doubts'])}" for m in modes if m["doubts"]]
    return Chapter(
        file,
        "With which modes does a record ring?",
        answer=f"strongest oscillation: {figures}" if swing else figures,
        good=None,
        sure=sure,
        doubts=doubts,
        content=modes_map("Modes", {"record": modes})
        + table("Modes", ["f [Hz]", "Damping [%]", "Amplitude", "Doubts"], rows, left=0),
    )


def of_sources(file: Path, records: Any) -> Chapter:
    records = records if isinstance(records, list) else [records]
    found = [
        (f"{x['frequency_hz']:.3f} Hz", x, c["record"]) for c in records for x in c["oscillations"]
    ]
    said = [
        f"{at}: {x['kind']}" + (f", from {x['source']}" if x["source"] else "")
        for at, x, _ in found
    ]
    unnamed = [
        f"{at}: {x['reason']}" for at, x, _ in found if not x["source"] and x["kind"] != "mode"
    ]
    rows = [
        [record, at, x["kind"], x["source"] or "not named", x["reason"], x["advice"]]
        for at, x, record in found
    ]
    cells = [[escape(cell) for cell in row] for row in rows]
    return Chapter(
        file,
        "Where does the oscillation come from?",
        answer="; ".join(said) or "nothing oscillates",
        good=None,
        sure=f"power and voltage of {sum(len(c['places']) for c in records)} places",
        not_judged=unnamed,
        doubts=[text for c in records for text in c["remarks"]],
        content=table(
            "Oscillations",
            ["Record", "Oscillation", "Kind", "Source", "Why", "Next"],
            cells,
            left=6,
        ),
    )
