"""What `gfor fmu info` and `check` say of a folder of FMUs: `python -m tests.benchmarks.other_tools FOLDER`."""

import argparse
import hashlib
import subprocess
import sys
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from orchestrator.core.errors import CosimError
from orchestrator.devices.fmi.description import read_declared
from orchestrator.output.report.terminal_tables import make_table

_PATIENCE = 300
"""Longest time for the checks of one FMU [s]."""


def said(path: Path) -> str:
    """The last line that `gfor fmu check` prints of an FMU, without its name."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", "orchestrator.face.cli", "fmu", "check", str(path)],
            capture_output=True,
            text=True,
            timeout=_PATIENCE,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"no answer in {_PATIENCE} s"
    lines = (done.stdout.strip() or done.stderr.strip()).splitlines()
    return (
        lines[-1].removeprefix("error: ").removeprefix(f"{path}: ").removeprefix(f"{path.name}: ")
        if lines
        else ""
    )


def main() -> None:
    """Print a row for each different file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    rows, seen = [], set()
    for path in sorted(folder.rglob("*.fmu")):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        if digest in seen:
            continue
        seen.add(digest)
        try:
            declared = read_declared(path)
            tool = f"{declared.generation_tool}, FMI {declared.fmi_version}"
        except CosimError:
            tool = ""
        rows.append((path.name, tool, said(path)))
    table = make_table(f"{len(rows)} FMUs", "File", "Tool", "gfor fmu check", left=3)
    for row in rows:
        table.add_row(*map(escape, row))
    Console().print(table)


if __name__ == "__main__":
    main()
