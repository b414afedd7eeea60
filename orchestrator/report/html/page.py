"""The page as a whole."""

import re
from collections.abc import Sequence
from pathlib import Path

from orchestrator.errors import InputError
from orchestrator.report.html import sections, studies
from orchestrator.report.html.chapters import (
    Chapter,
    changes,
    chapters_of,
    first_page,
    kept_answers,
    made,
    of_run,
    of_sweep,
)
from orchestrator.report.html.chapters import sections as sections_of
from orchestrator.report.html.document import document
from orchestrator.report.html.elements import Figures, table
from orchestrator.report.html.folder import SUMMARY, Results, read_results, sweeps_of
from orchestrator.safe_files import write_text

_USED = "run, modes, screen, sweep, site, design, certify, check, nyquist and compare (both as JSON)"

Sections = list[tuple[str, str]]


def write_report(
    folder: Path, others: Sequence[Path] = (), path: Path | None = None, against: Path | None = None
) -> Path:
    """One file that needs no other, by default in the first folder; of an older page it says what changed since."""
    target = path or (folder if folder.is_dir() else folder.parent) / "report.html"
    write_text(target, page(list(dict.fromkeys([folder, *others])), against))
    return target


def page(places: Sequence[Path], against: Path | None = None) -> str:
    for place in places:
        if not place.exists():
            raise InputError(f"{place}: there is no such file or folder")
    figures, chapters, content = Figures(), list[Chapter](), Sections()
    runs = {place: read_results(place) for place in places if (place / SUMMARY).is_file()}
    scenarios = [s for run in runs.values() for s in run.scenarios]
    for place in places:
        count = len(chapters)
        if (run := runs.get(place)) is not None:
            chapters.append(of_run(place, run.scenarios))
            content += _of_run(run, figures, f"{place.name}: " if len(runs) > 1 else "")
        for sweep in sweeps_of(place):
            chapters.append(of_sweep(place, sweep))
            content.append((studies.sweep_title(sweep), studies.sweep(sweep, scenarios, figures)))
        for chapter in chapters_of(place):
            chapters.append(chapter)
            content.append((chapter.title or chapter.question, sections_of(chapter, len(chapters))))
        if len(chapters) == count:
            pages = ", ".join(file.name for file in sorted(place.glob("*.html"))) if place.is_dir() else ""
            own = f"it has a page of its own: {pages}; " if pages else ""
            raise InputError(f"{place}: nothing in it can be used for a report; {own}a report takes results of {_USED}")
    if against is not None:
        content.insert(0, ("What changed since", changes(against, chapters)))
    rows = [[*made(place)] for place in places]
    columns = ["Results", "Made", "Version", "Code", "Command that makes them again"]
    further = "".join(sections.provenance(run) for run in runs.values())
    content.append(("Provenance", table("Where every chapter comes from", columns, rows, left=5) + further))
    first = next(iter(runs.values()), None)
    title = (first.case.table.title or first.case.name) if first else f"Report on {', '.join(p.name for p in places)}"
    kind = "Small-signal and time-domain study by co-simulation of FMUs"
    found = "".join(sections.findings(run) for run in runs.values())
    picture = next(
        (m[0] for _, text in content if (m := re.search(r'<svg class="chart".*?</svg>', text, re.DOTALL))), ""
    )
    return document(title, kind, first_page(chapters) + picture + found + kept_answers(chapters), content)


def _of_run(run: Results, figures: Figures, prefix: str) -> Sections:
    content = [
        ("What was studied", sections.studied(run)),
        ("Operating point", sections.operating_point(run)),
        ("Modes", sections.modes(run, figures)),
    ]
    if run.trajectories:
        content.append(("Time responses", sections.responses(run, figures)))
    if run.step_sizes:
        content.append(("Communication step", sections.step_sizes(run)))
    return [(f"{prefix}{heading}", text) for heading, text in content]
