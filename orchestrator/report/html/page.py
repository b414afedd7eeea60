"""The page as a whole."""

import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path

from orchestrator.errors import InputError
from orchestrator.report.html import sections, studies
from orchestrator.report.html.chapters import Chapter, chapters_of, of_run, of_sweep
from orchestrator.report.html.chapters import sections as sections_of
from orchestrator.report.html.document import document
from orchestrator.report.html.elements import Figures
from orchestrator.report.html.first_page import changes, first_page, kept_answers, origins
from orchestrator.report.html.folder import SUMMARY, Results, read_results, sweeps_of
from orchestrator.results.manifest import MANIFEST, ResultsWarning
from orchestrator.safe_files import write_text

USED = (
    "run, modes, screen, sweep, site, design, sensitivities, interactions, certify, scr, fmu check, fmu nyquist, "
    "signal identify, signal compare, signal source"
)
"""Commands whose results a report takes."""

Sections = list[tuple[str, str]]
_PICTURE = r'(?:<ul class="legend">[^\n]*?</ul>)?<svg class="chart".*?</svg>|<img .*?>'


def write_report(
    folder: Path, others: Sequence[Path] = (), path: Path | None = None, against: Path | None = None,
    title: str | None = None, *, short: bool = False,
) -> Path:  # fmt: skip
    """One file that needs no other, by default in the first folder.

    ``against``: an older page, or an older folder of results, of which it says what changed since.
    ``short``: the first page and where all comes from, without the chapters."""
    target = path or (folder if folder.is_dir() else folder.parent) / "report.html"
    write_text(target, page(list(dict.fromkeys([folder, *others])), against, title, short=short))
    return target


def page(places: Sequence[Path], against: Path | None = None, title: str | None = None, *, short: bool = False) -> str:
    told, runs = _told(places, Figures())
    chapters = [chapter for chapter, _ in told]
    headings = [heading for _, content in told for heading, _ in content]
    content = [
        (heading if headings.count(heading) == 1 else f"{heading} ({_name(chapter.source)})", text)
        for chapter, found in told for heading, text in found
    ]  # fmt: skip
    charts = (re.search(_PICTURE, text, re.DOTALL) for _, text in content)
    picture = next((found[0] for found in charts if found), "")
    content = [] if short else content
    if against is not None:
        before = [chapter for chapter, _ in _told([against], Figures())[0]] if against.is_dir() else None
        content.insert(0, ("What changed since", changes(against, before, chapters)))
    content.append(("Provenance", origins(chapters) + "".join(map(sections.provenance, runs))))
    case = runs[0].case if runs else None
    title = title or (case.table.title or case.name if case else f"Report on {', '.join(map(_name, places))}")
    kind = "Small-signal and time-domain study by co-simulation of FMUs"
    found = "".join(map(sections.findings, runs))
    return document(title, kind, first_page(chapters) + picture + found + kept_answers(chapters), content)


def _told(places: Sequence[Path], figures: Figures) -> tuple[list[tuple[Chapter, Sections]], list[Results]]:
    """The chapters of all places with their sections, and the runs among them."""
    parts = {place: list(_parts(place)) for place in places}
    runs = {part: read_results(part) for found in parts.values() for part in found if (part / SUMMARY).is_file()}
    scenarios = [s for run in runs.values() for s in run.scenarios]
    told: list[tuple[Chapter, Sections]] = []
    for place, within in parts.items():
        before = len(told)
        for part in within:
            count = len(told)
            if (run := runs.get(part)) is not None:
                told.append((of_run(part, run.scenarios, kind=run.case.table.models or ""), _of_run(run, figures)))
            for sweep in sweeps_of(part):
                shown = studies.sweep(sweep, scenarios, figures)
                told.append((of_sweep(part, sweep), [(studies.sweep_title(sweep), shown)]))
            for chapter in chapters_of(part):
                text = sections_of(chapter, len(told) + 1)
                told.append((chapter, [(chapter.title or chapter.question, text)]))
            if part != place and len(told) == count and (part / MANIFEST).is_file():
                warnings.warn(f"{part}: nothing in it can be used for a report", ResultsWarning, stacklevel=2)
        if len(told) == before:
            pages = ", ".join(file.name for file in sorted(place.glob("*.html"))) if place.is_dir() else ""
            own = f"it has a page of its own: {pages}; " if pages else ""
            raise InputError(f"{place}: nothing in it can be used for a report; {own}a report takes results of {USED}")
    return told, [*runs.values()]


def _parts(place: Path, depth: int = 2) -> Iterator[Path]:
    """A place, and the folders in it; those of a run's scenarios are of the run, and points of their study."""
    if not place.exists():
        raise InputError(f"{place}: there is no such file or folder")
    yield place
    if place.is_dir() and depth and not (place / SUMMARY).is_file():
        for inner in sorted(path for path in place.iterdir() if path.is_dir()):
            if not inner.name.startswith(".") and not inner.name.endswith("points"):
                yield from _parts(inner, depth - 1)


def _name(place: Path) -> str:
    """The folder's."""
    return (place if place.is_dir() else place.parent).resolve().name


def _of_run(run: Results, figures: Figures) -> Sections:
    content = [
        ("What was studied", sections.studied(run)),
        ("Operating point", sections.operating_point(run)),
        ("Modes", sections.modes(run, figures)),
    ]
    if run.trajectories:
        content.append(("Time responses", sections.responses(run, figures)))
    if run.step_sizes:
        content.append(("Communication step", sections.step_sizes(run)))
    return content
