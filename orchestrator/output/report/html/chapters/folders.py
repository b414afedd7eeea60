"""Chapters of all studies in a folder, without their pictures: what each of them answers."""

from pathlib import Path

from orchestrator.output.report.html.chapters.chapter import Chapter
from orchestrator.output.report.html.chapters.files import chapters_of
from orchestrator.output.report.html.chapters.runs import of_run
from orchestrator.output.report.html.chapters.studies import of_sweep
from orchestrator.output.report.html.folder import SUMMARY, read_results, sweeps_of


def chapters_in(folder: Path) -> list[Chapter]:
    """Return the chapter of the folder's run, and those of the other studies in it."""
    found = []
    if (folder / SUMMARY).is_file():
        run = read_results(folder)
        found.append(of_run(folder, run.scenarios, beside=run.beside))
    found += [of_sweep(folder, sweep) for sweep in sweeps_of(folder)]
    return [*found, *chapters_of(folder)]
