"""A command on a device at each operating point of a file."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.markup import escape

from orchestrator.core.asked import Value
from orchestrator.core.errors import CosimError, InputError
from orchestrator.face.cli.terminal import make_console, print_json, print_parts
from orchestrator.output.report.terminal_tables import make_table
from orchestrator.output.results.file_writers import save_table
from orchestrator.output.results.staging import check_free, new_run_id, staged
from orchestrator.studies.operating_points.points_file import folder_of, settings_in

TABLE = "points.csv"


def by_point(
    options: argparse.Namespace,
    folder: Path,
    found: Callable[[dict[str, Value], Path], dict[str, Any]],
    failed: dict[str, str],
) -> list[dict[str, Any]]:
    """Rows of what is found at each point, shown and kept; one that fails says why, and the others go on.

    Raises an `InputError` where all of them fail."""
    check_free(folder, {TABLE: None})
    rows: list[dict[str, Any]] = []
    lost = 0
    for name, values in settings_in(options.points).items():
        try:
            rows.append({"point": name} | found(values, folder / folder_of(name)))
        except CosimError as error:
            rows.append({"point": name, **failed, "remark": str(error)})
            lost += 1
    columns = max((list(row) for row in rows), key=len)
    cells = [{column: row.get(column) for column in columns} for row in rows]
    if options.json:
        print_json(rows)
    else:
        shown = [tuple(_cell(value) for value in row.values()) for row in cells]
        table = make_table(
            "Operating points", *(column.replace("_", " ") for column in columns), rows=shown
        )
        print_parts(make_console(), [table, escape(f"Results in {folder}")])
    with staged(folder, new_run_id()) as staging:
        save_table(cells, staging / TABLE)
    if lost == len(rows):
        raise InputError(
            f"{options.points}: no point could be computed; the remark of each says why"
        )
    return rows


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
