"""Files of a study of interactions: tables of modes, pairs and assignments, all of it as JSON, and the page."""

from pathlib import Path

from orchestrator.interactions.judgement import JudgedInteractions
from orchestrator.interactions.report import write_page
from orchestrator.interactions.tables import as_json, assignment_rows, mode_rows, pair_rows
from orchestrator.results.staging import new_run_id, staged
from orchestrator.results.storage import save_json, save_table

MODES, PAIRS, ASSIGNMENTS = "modes.csv", "pairs.csv", "assignments.csv"
SUMMARY, PAGE = "interactions.json", "interactions.html"


def save(judgement: JudgedInteractions, folder: Path) -> list[Path]:
    tables = {MODES: mode_rows(judgement), PAIRS: pair_rows(judgement), ASSIGNMENTS: assignment_rows(judgement)}
    wanted = {name: rows for name, rows in tables.items() if rows}
    with staged(folder, new_run_id()) as staging:
        for name, rows in wanted.items():
            save_table(rows, staging / name)
        save_json(as_json(judgement), staging / SUMMARY)
        write_page(judgement, staging / PAGE)
    return [folder / name for name in (*wanted, SUMMARY, PAGE)]
