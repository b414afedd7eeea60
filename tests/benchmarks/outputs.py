"""All that commands write, kept in a folder, and two such folders compared to the last digit.

``python -m tests.benchmarks.outputs write FOLDER [--only NAME]`` runs the commands below in a folder and keeps what
they print, their exit codes and files. ``python -m tests.benchmarks.outputs compare BEFORE AFTER`` lists each value,
key, row and line that differs. It proves that a change of the code that presents results loses nothing. A difference
that is meant is named by ``--except 'FILE: PLACE'``, with patterns as a shell has them.
"""

import argparse
import csv
import hashlib
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from difflib import SequenceMatcher
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import xarray as xr

import orchestrator as gfor
from orchestrator.cases.case import built_in_cases
from tests.pages.markdown import blocks

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / ".docs" / "how-to" / "several-vendors.md"

STUDIES = {
    "modes_text": "modes two_area --details --out modes_text",
    "modes_one": "modes two_area --scenario pod_p",
    "modes_critical": "modes ieee39 --scenario base --critical 5 --out modes_critical",
    "run_text": "run infinite_bus --scenario dip --stop 1.2 --threads 1 --linear --details --out run",
    "run_json": "run infinite_bus --scenario dip --stop 1.2 --threads 1 --linear --json --out run_json",
    "run_two": "run two_area --scenario gfor --scenario pod_p --stop 3.2 --threads 1 --out run_two",
    "run_flow": "run wscc9 --scenario pod_p --stop 1.2 --threads 1 --details --out run_flow",
    "source_text": "signal source run_two/gfor",
    "source": "signal source run_two/gfor --json",
    "identify": "signal identify run_two/gfor 'sg1.omega - sg2.omega' --json",
    "identify_text": "signal identify run_two/gfor 'sg1.omega - sg2.omega'",
    "compare_text": "signal compare run_two/gfor run_two/pod_p",
    "compare": "signal compare run_two/gfor run_two/pod_p --json",
    "sweep_text": "sweep two_area --scenario gfor --vary grid.X_L=0.1:0.3:3 --out sweep --workers 1",
    "sweep": "sweep two_area --scenario gfor --vary grid.X_L=0.1:0.3:3 --out sweep --workers 1 --json",
    "design_text": "design two_area --controller pod_p --out pod.toml",
    "design": "design two_area --controller pod_p --json",
    "screen_text": "screen wscc9 --outages n-1 --out screen --workers 1",
    "screen": "screen wscc9 --outages n-1 --out screen --workers 1 --json",
    "site_text": "site wscc9 --confirm 1 --out site",
    "site": "site wscc9 --confirm 1 --out site --json",
    "interactions_text": "interactions park.toml --out interactions --workers 1",
    "interactions": "interactions park.toml --out interactions --workers 1 --json",
    "sensitivities_text": "sensitivities two_area --scenario gfor --out sensitivities",
    "sensitivities": "sensitivities two_area --scenario gfor --json",
    "scr_text": "scr two_area",
    "scr": "scr two_area --json",
    "steps_text": "steps two_area --scenario gfor --try 100us,500us --schedule gauss-seidel",
    "nyquist_text": "fmu nyquist infinite_bus --component gfor --out nyquist",
    "nyquist": "fmu nyquist infinite_bus --component gfor --json --out nyquist_json",
    "build": "fmu build gfor --dest fmus",
    "check_text": "fmu check fmus/gfor.fmu --only units --only signs --seed 1",
    "check": "fmu check fmus/gfor.fmu --only units --only signs --seed 1 --json --out check",
    "certify_text": "certify fmus/gfor.fmu --reactances 0.2 --no-check --out certificate --workers 1",
    "certify": "certify fmus/gfor.fmu --reactances 0.2 --no-check --out certificate --workers 1 --json",
    "certify_code": "certify fmus/gfor.fmu --code frequency --no-check --out frequency --workers 1",
    "verify_text": "verify certificate --files-only",
    "verify": "verify certificate --files-only --json",
    "report_run": "report run --out report_run.html",
    "report_two": "report run_two --out report_two.html",
    "report_all": "report . --out report_all.html",
}
"""Name → words of the command ``gfor``, in an order in which each finds the files that it reads."""

COMMANDS = {**{f"modes_{case}": f"modes {case} --json" for case in built_in_cases()}, **STUDIES}

CHANGES_BY_ITSELF = {
    "steps_per_second": "the speed of this run",
    "share_in_fmus": "the speed of this run",
    "real_time_factor": "the speed of this run",
    "seconds": "the time that it took",
    "time_s": "the time that it took",
}
"""Keys of JSON whose figures are not compared, and why."""

_MASKS = (
    (re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d(\.\d+)?)?(Z|\+00:00)?"), "DATE"),
    (re.compile(r"\b[0-9a-f]{40,64}\b(\.\.\.)?"), "HASH"),
    (re.compile(r"\b[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}\b"), "ID"),
)
"""Pieces of text that differ from run to run: times, hashes of files with a time in them, identifiers."""

_IN_LINES = {".html", ".txt", ".toml"}
"""Kinds of files whose lines are aligned before they are compared."""

_ONLY_PRESENT = {".png", ".pdf", ".fmu", ".npz", ".lock"}
"""Kinds of files of which only the presence is compared."""


Leaf = tuple[str, str]
"""A place in a file and what stands there."""


def write(folder: Path, only: Sequence[str]) -> None:
    """Run the commands in a folder and keep what they print there."""
    folder.mkdir(parents=True, exist_ok=True)
    (park,) = (block.text for block in blocks(GUIDE) if block.path == "park.toml")
    (folder / "park.toml").write_text(park, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    for name, words in COMMANDS.items():
        if only and not any(fnmatchcase(name, pattern) for pattern in only):
            continue
        command = f"{sys.executable} -m orchestrator.face.cli {words}"
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, check=False
        )
        kind = "json" if "--json" in words else "txt"
        (folder / f"printed_{name}.{kind}").write_bytes(done.stdout)
        errors = done.stderr.decode() + f"exit code {done.returncode}\n"
        (folder / f"printed_{name}.errors.txt").write_text(errors, encoding="utf-8")
        print(f"{name}: exit code {done.returncode}", flush=True)
    if not only or "frames" in only:
        _write_frames(folder)


def _write_frames(folder: Path) -> None:
    """Keep the DataFrames and Datasets of modes and a run, as Python has them."""
    modes = gfor.load("two_area").scenario("gfor").modes()
    run = gfor.load("infinite_bus").scenario("dip").run(stop=1.05)
    frames = {
        "modes": modes.table(),
        "participation": modes.participation(),
        "shapes": modes.dataset.to_dataframe(),
        "run": run.table().iloc[::50],
        **{f"flow_{kind}": frame for kind, frame in modes.power_flow().items()},
    }
    for name, frame in frames.items():
        frame.to_csv(folder / f"frame_{name}.csv")
    pages = {"modes": modes._repr_html_(), "run": run._repr_html_()}
    for name, page in pages.items():
        (folder / f"notebook_{name}.html").write_text(page, encoding="utf-8")


def compare(before: Path, after: Path, meant: Sequence[str]) -> list[str]:
    """Return a line for each difference that nothing names, as ``file: place: before -> after``."""
    names = sorted({str(p.relative_to(top)) for top in (before, after) for p in _files(top)})
    found: list[tuple[str, str, str, str]] = []
    for name in names:
        there = [(top / name).is_file() for top in (before, after)]
        if not all(there):
            found.append((name, "the file", str(there[0]), str(there[1])))
            continue
        first, second = (list(_leaves(top / name, top)) for top in (before, after))
        differences = _of_lines if Path(name).suffix in _IN_LINES else _of_places
        found += [(name, *one) for one in differences(first, second)]
    return [
        f"{name}: {place}: {old} -> {new}"
        for name, place, old, new in found
        if not any(fnmatchcase(f"{name}: {place}", pattern) for pattern in meant)
    ]


def _of_places(first: Sequence[Leaf], second: Sequence[Leaf]) -> Iterator[tuple[str, str, str]]:
    """Yield each place whose values differ."""
    old, new = dict(first), dict(second)
    for place in dict.fromkeys([*old, *new]):
        values = old.get(place, "nothing"), new.get(place, "nothing")
        if values[0] != values[1]:
            yield place, *values


def _of_lines(first: Sequence[Leaf], second: Sequence[Leaf]) -> Iterator[tuple[str, str, str]]:
    """Yield the lines that one text has and the other does not have there."""
    old, new = ([line for _, line in leaves] for leaves in (first, second))
    for kind, i, k, j, m in SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if kind != "equal":
            yield f"line {i}", " ".join(old[i:k]) or "nothing", " ".join(new[j:m]) or "nothing"


def _files(top: Path) -> Iterator[Path]:
    return (path for path in top.rglob("*") if path.is_file() and path.name != "manifest.json")


def _leaves(path: Path, top: Path) -> Iterator[Leaf]:
    """Yield the places in a file and what stands there."""
    if path.suffix in _ONLY_PRESENT:
        return
    if path.suffix == ".nc":
        yield from _of_dataset(path)
        return
    text = path.read_text(encoding="utf-8", errors="replace").replace(str(top), "FOLDER")
    for mask, word in _MASKS:
        text = mask.sub(word, text)
    readers: dict[str, Callable[[str], Iterator[Leaf]]] = {
        ".json": _of_json,
        ".csv": _of_csv,
        ".html": _of_html,
    }
    yield from readers.get(path.suffix, _of_text)(text)


def _of_dataset(path: Path) -> Iterator[Leaf]:
    with xr.open_dataset(path) as dataset:
        for name, variable in dataset.variables.items():
            digest = hashlib.sha256(str(variable.values.tolist()).encode()).hexdigest()
            yield str(name), f"{variable.dims} {variable.shape} {digest[:16]}"


def _of_json(text: str) -> Iterator[Leaf]:
    """Yield each figure with its digits as they are written, and the keys of each object in their order."""
    if text.strip():
        yield from _of_value(json.loads(text, parse_float=str, parse_int=str), "")


def _of_value(value: Any, place: str) -> Iterator[Leaf]:
    if isinstance(value, dict):
        yield f"{place}.keys", ", ".join(value)
        for key, one in value.items():
            if key not in CHANGES_BY_ITSELF:
                yield from _of_value(one, f"{place}.{key}")
    elif isinstance(value, list):
        yield f"{place}.length", str(len(value))
        for k, one in enumerate(value):
            yield from _of_value(one, f"{place}[{k}]")
    else:
        yield place, repr(value)


def _of_csv(text: str) -> Iterator[Leaf]:
    for k, row in enumerate(csv.reader(text.splitlines())):
        yield f"row {k}", " | ".join(row)


def _of_html(text: str) -> Iterator[Leaf]:
    """Yield a page's pieces, each up to the end of a tag."""
    for k, piece in enumerate(re.split(r"(?<=>)|\n", text)):
        yield f"line {k}", piece


def _of_text(text: str) -> Iterator[Leaf]:
    for k, line in enumerate(text.splitlines()):
        yield f"line {k}", line


def main() -> int:
    """Write or compare; the exit code is 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parts = parser.add_subparsers(dest="part", required=True)
    writing = parts.add_parser("write", help="run the commands and keep what they write")
    writing.add_argument("folder", type=Path)
    writing.add_argument(
        "--only", action="append", default=[], help="only commands that fit (repeatable)"
    )
    comparing = parts.add_parser("compare", help="list what differs between two folders")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument(
        "--except",
        dest="meant",
        action="append",
        default=[],
        metavar="'FILE: PLACE'",
        help="a difference that is meant, such as 'printed_run*: line *' (repeatable)",
    )
    options = parser.parse_args()
    if options.part == "write":
        write(options.folder.resolve(), options.only)
        return 0
    lines = compare(options.before.resolve(), options.after.resolve(), options.meant)
    print("\n".join(lines) or "nothing differs")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
