"""The page as a whole."""

from collections.abc import Sequence
from pathlib import Path

from orchestrator.report.html import sections, studies
from orchestrator.report.html.document import document
from orchestrator.report.html.elements import Figures
from orchestrator.report.html.folder import Results, read_results
from orchestrator.safe_files import write_text


def write_report(folder: Path, others: Sequence[Path] = (), path: Path | None = None) -> Path:
    """Write ``report.html``: one file that needs no network and no other file.

    ``others``: folders or files with sweeps and designs that belong to it.
    ``path``: by default ``report.html`` in the folder.
    """
    results = read_results(folder, others)
    target = path or folder / "report.html"
    write_text(target, page(results))
    return target


def page(results: Results) -> str:
    figures = Figures()
    content: list[tuple[str, str]] = [
        ("What was studied", sections.studied(results)),
        ("Operating point", sections.operating_point(results)),
        ("Modes", sections.modes(results, figures)),
    ]
    content += [(studies.sweep_title(sweep), studies.sweep(sweep, results, figures)) for sweep in results.sweeps]
    content += [(studies.design_title(sheet), studies.design(sheet)) for sheet in results.designs]
    if results.trajectories:
        content.append(("Time responses", sections.responses(results, figures)))
    if results.step_sizes:
        content.append(("Communication step", sections.step_sizes(results)))
    content.append(("Provenance", sections.provenance(results)))
    title = results.case.table.title or results.case.name
    kind = "Small-signal and time-domain study by co-simulation of FMUs"
    return document(title, kind, sections.findings(results), content)
