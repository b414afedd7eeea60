"""Tutorials are notebooks. They are executed here, and ``python -m tests.pages.notebooks`` writes their outputs anew.

What is kept of an output is what a reader of the page sees: text without colours, tables, pictures with few colours.
"""

from __future__ import annotations

import base64
import io
import os
import re
import shutil
import sys
import sysconfig
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from tests.pages.markdown import ROOT
from tests.support.late import LateLibrary

if TYPE_CHECKING:
    from nbformat import NotebookNode

nbclient, nbformat = LateLibrary("nbclient"), LateLibrary("nbformat")
pictures = LateLibrary("PIL.Image")

NOTEBOOKS = sorted((ROOT / ".docs" / "tutorials").glob("*.ipynb"))
SECONDS = 1800
"""Longest time that one cell may take on a busy machine."""

_CONTROL = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\r")
"""Colours, and moves of the terminal's cursor."""

_SPINNING = re.compile(r"[^\n]*[\u2800-\u28ff][^\n]*\n")
"""A line that turns while a command works."""

_WIDTH = 96
"""Columns of the terminal that commands believe to have."""


def execute(path: Path, folder: Path, more: str = "") -> NotebookNode:
    """Execute a notebook in a folder, with this environment's ``gfor``; returns it with its outputs.

    Raises ``CellExecutionError`` where a cell fails. ``more`` is executed behind the last cell. The folder beside the
    notebook that has its name holds files that it needs.
    """
    if path.with_suffix("").is_dir():
        shutil.copytree(path.with_suffix(""), folder / path.stem)
    notebook = nbformat.read(path, as_version=4)
    if more:
        notebook.cells.append(nbformat.v4.new_code_cell(more))
    client = nbclient.NotebookClient(
        notebook, timeout=SECONDS, record_timing=False, resources={"metadata": {"path": folder}}
    )
    client.execute(env=_environment(folder))
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [_tidy(output) for output in _joined(cell.outputs)]
    return notebook


def _environment(folder: Path) -> dict[str, str]:
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    paths = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH")]))
    shown = {
        "NO_COLOR": "1",
        "COLUMNS": str(_WIDTH),
        "TERM": "dumb",
        "IPYTHONDIR": str(folder / ".ipython"),
    }
    return (
        {k: v for k, v in os.environ.items() if k != "MPLBACKEND"}
        | {"PATH": path, "PYTHONPATH": paths}
        | shown
    )


def _joined(outputs: list[NotebookNode]) -> list[NotebookNode]:
    """Outputs with the pieces of each stream put together: where they part depends on the time."""
    joined: list[NotebookNode] = []
    for output in outputs:
        before = joined[-1] if joined else None
        if (
            before
            and before.output_type == output.output_type == "stream"
            and before.name == output.name
        ):
            before.text += output.text
        else:
            joined.append(output)
    return joined


def _tidy(output: NotebookNode) -> NotebookNode:
    if output.output_type == "stream":
        lines = _SPINNING.sub("", _CONTROL.sub("", output.text)).strip("\n").splitlines()
        output.text = "".join(f"{line.rstrip()}\n" for line in lines)
    elif "image/png" in output.get("data", {}):
        output.data = {"image/png": _small(output.data["image/png"])}
        output.metadata = {}
    return output


def _small(png: str) -> str:
    """A picture with 64 colours, in base64."""
    picture = pictures.open(io.BytesIO(base64.b64decode(png))).convert("RGB").quantize(64)
    written = io.BytesIO()
    picture.save(written, "png", optimize=True)
    return base64.b64encode(written.getvalue()).decode("ascii")


def shown_text(notebook: NotebookNode) -> list[tuple[str, str]]:
    """Id of a code cell, and all the text that it shows."""
    found = []
    for cell in notebook.cells:
        if cell.cell_type == "code":
            parts = [o.get("text") or o.get("data", {}).get("text/plain", "") for o in cell.outputs]
            found.append((cell.id, "\n".join(parts)))
    return found


def main(names: list[str]) -> None:
    """Execute the notebooks, all or those named, and write them with their outputs."""
    for path in NOTEBOOKS:
        if not names or path.stem in names:
            with TemporaryDirectory() as folder:
                notebook = execute(path, Path(folder))
            path.write_text(nbformat.writes(notebook, indent=1) + "\n", encoding="utf-8")
            print(f"{path.relative_to(ROOT)}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main(sys.argv[1:])
