"""All that commands write, kept in a folder, and two such folders compared to the last digit.

``python -m tests.benchmarks.outputs write FOLDER [--only NAME]`` runs the commands below in a folder and keeps what
they print, their exit codes and files; with ``--tree`` it runs the code of another tree, such as that of an older
commit. ``python -m tests.benchmarks.outputs compare BEFORE AFTER`` lists each value,
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
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from fnmatch import fnmatchcase
from pathlib import Path
from shutil import copyfile
from typing import Any
from zipfile import ZipFile

import numpy as np
import xarray as xr
from scipy.io import loadmat

import orchestrator as gfor
from orchestrator.cases.case import built_in_cases
from orchestrator.face.cli import whole_parser
from tests.pages.markdown import blocks

ROOT = Path(__file__).parents[2]
GUIDE = ROOT / ".docs" / "how-to" / "several-vendors.md"
NETWORK = ROOT / ".docs" / "tutorials" / "psse"

TABLES = {
    "lines.csv": "name,grid.X_L,load\nusual,0.1,1\nlong,0.3,1\n",
    "day.csv": "time,hours,load,generation\nnight,8,0.9,0.9\nday,16,1.0,1.0\n",
}
"""Operating points that commands read."""

MACHINES = "kundur --scenario thyristor --set 'sg*.governor=tgov1' --device regulator --confirm 1"
DEVICE = "fmus/gfor.fmu --set S_n=1500 --set P_0=0.6 --from-hz 5 --to-hz 100"
SWITCHED = "gfor record/load_step --set S_n=1500 --set pod_p.enabled=true"

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
    "sweep_until": "sweep two_area --vary grid.X_L=0.1:0.5:3 --until unstable --out until --workers 1",
    "design_text": "design two_area --controller pod_p --out pod.toml",
    "design": "design two_area --controller pod_p --json",
    "design_points": "design two_area --controller pod_p --points lines.csv --damping 10 --out points.toml "
    "--workers 1",
    "screen_text": "screen wscc9 --outages n-1 --out screen --workers 1",
    "screen": "screen wscc9 --outages n-1 --out screen --workers 1 --json",
    "screen_points": "screen wscc9 --scenario pod_p --points day.csv --out screen_points --workers 1",
    "site_text": "site wscc9 --confirm 1 --out site",
    "site": "site wscc9 --confirm 1 --out site --json",
    "site_outages": "site wscc9 --device droop --outages lines --confirm 0 --out site_outages",
    "site_machines_text": f"site {MACHINES} --out machines",
    "site_machines": f"site {MACHINES} --json",
    "site_fixed": "site two_area --device regulator --confirm 1 --out machines_fixed",
    "interactions_text": "interactions park.toml --out interactions --workers 1",
    "interactions": "interactions park.toml --out interactions --workers 1 --json",
    "sensitivities_text": "sensitivities two_area --scenario gfor --out sensitivities",
    "sensitivities": "sensitivities two_area --scenario gfor --json",
    "scr_text": "scr two_area",
    "scr": "scr two_area --json",
    "steps_text": "steps two_area --scenario gfor --try 100us,500us --schedule gauss-seidel",
    "steps": "steps two_area --scenario gfor --try 100us --schedule jacobi --json",
    "nyquist_text": "fmu nyquist infinite_bus --component gfor --out nyquist",
    "nyquist": "fmu nyquist infinite_bus --component gfor --json --out nyquist_json",
    "new_text": "new areas.raw areas.dyr --details --out own.toml",
    "new": "new areas.raw areas.dyr --json --out own_too.toml",
    "new_models": "new --models",
    "modes_own": "modes own.toml --details",
    "build": "fmu build gfor gfor_phasor --dest fmus",
    "info": "fmu info fmus/gfor.fmu --json",
    "info_text": "fmu info fmus/gfor.fmu",
    "bind": "fmu bind fmus/gfor.fmu --out binding.toml",
    "admittance_text": f"fmu admittance {DEVICE} --out admittance",
    "admittance": f"fmu admittance {DEVICE} --scan plant.txt --voltage '230 kV' --json --out admittance_json",
    "convert": "fmu admittance plant.txt --form alphabeta --out sequences --voltage '230 kV'",
    "convert_jacobian": f"fmu admittance {DEVICE} --form jacobian --out jacobian",
    "linear": "export linear two_area --scenario gfor --out linear",
    "ssp": "export ssp two_area --scenario pod_p --out pod_p.ssp",
    "modes_ssp": "modes pod_p.ssp",
    "comtrade": "export comtrade run_two/gfor --signal sg1.omega --signal gfor.p --out swing.cfg",
    "which": "master which --build probes",
    "check_text": "fmu check fmus/gfor.fmu --only units --only signs --seed 1",
    "check": "fmu check fmus/gfor.fmu --only units --only signs --seed 1 --json --out check",
    "certify_text": "certify fmus/gfor.fmu --reactances 0.2 --no-check --out certificate --workers 1",
    "certify": "certify fmus/gfor.fmu --reactances 0.2 --no-check --out certificate --workers 1 --json",
    "certify_rows": "certify fmus/gfor.fmu --code fingrid --no-check --out rows --workers 1",
    "certify_code": "certify fmus/gfor.fmu --code frequency --no-check --out frequency --workers 1",
    "verify_text": "verify certificate --files-only",
    "verify": "verify certificate --files-only --json",
    "verify_rows": "verify rows --rows rocof --workers 1",
    "record": "run infinite_bus --scenario load_step --stop 1.6 --threads 1 --out record",
    "validate_text": "validate gfor record/load_step --set S_n=1500 --out validation",
    "validate": "validate gfor record/load_step --set S_n=1500 --json",
    "explain_text": f"validate {SWITCHED} --explain",
    "report_run": "report run --out report_run.html",
    "report_two": "report run_two --out report_two.html",
    "report_site": "report site --out report_site.html",
    "report_all": "report . --out report_all.html",
    "completion": "completion bash",
}
"""Name → words of the command ``gfor``, in an order in which each finds the files that it reads."""

MISTAKES = {
    "no_case": "modes no_such_case",
    "no_parameter": "modes two_area --set grid.XL=0.3",
    "no_unit": "modes two_area --set grid.X_L=0.3furlong",
    "no_file": "new missing.raw --out missing.toml",
    "no_regulator": "site kundur --device regulator",
    "no_fmu": "fmu info missing.fmu",
    "no_word": "sweep two_area",
}
"""The same of commands that are refused, with exit code 2."""

COMMANDS = {
    **{f"modes_{case}": f"modes {case} --json" for case in built_in_cases()},
    **STUDIES,
    **MISTAKES,
}

REFUSED = 2
"""Exit code of a command that is refused."""

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
    (re.compile(r"\bcode [0-9a-f]{12}\b"), "code HASH"),
    (re.compile(r"│ +[\d,]+ │ +[\d.]+ │ +\d+ │ +\d+% │[^│]*│"), "│ SPEED │"),
)
"""Pieces of text that differ from run to run: times, hashes of files with a time in them and of the
code, identifiers, and how fast a run was."""

_IN_LINES = {".html", ".txt", ".toml"}
"""Kinds of files whose lines are aligned before they are compared."""

_XML = {".xml", ".ssd", ".ssv", ".ssm"}
"""Kinds of files in an archive that are compared line by line."""

_ONLY_PRESENT = {".png", ".pdf", ".lock"}
"""Kinds of files of which only the presence is compared."""


TREE = "tree.txt"
"""File in a folder of outputs with the path of the tree whose code ran."""

Leaf = tuple[str, str]
"""A place in a file and what stands there."""


def write(folder: Path, only: Sequence[str], tree: Path = ROOT) -> list[str]:
    """Run the commands of a tree in a folder and keep what they print there.

    Returns
    -------
    list of str
        Each command that was refused and should not have been, or the other way round: what two refused commands
        write is alike, whatever they were to show.

    Raises
    ------
    SystemExit
        If the folder has files already, whose kept points would be taken for computed ones.
    """
    if not only and folder.exists() and any(folder.iterdir()):
        sys.exit(
            f"{folder}: it has files already, and a kept point is not computed again; give a new folder"
        )
    environment = os.environ | {"PYTHONPATH": str(tree)}
    _check_tree(tree, environment)
    _write_inputs(folder)
    (folder / TREE).write_text(str(tree), encoding="utf-8")
    wrong = []
    for name, words in COMMANDS.items():
        if only and not any(fnmatchcase(name, pattern) for pattern in only):
            continue
        command = f"{sys.executable} -m orchestrator.face.cli {words}"
        done = subprocess.run(
            command, shell=True, cwd=folder, env=environment, capture_output=True, check=False
        )
        kind = "json" if "--json" in words and done.stdout[:1] in (b"{", b"[") else "txt"
        (folder / f"printed_{name}.{kind}").write_bytes(done.stdout)
        errors = done.stderr.decode() + f"exit code {done.returncode}\n"
        (folder / f"printed_{name}.errors.txt").write_text(errors, encoding="utf-8")
        print(f"{name}: exit code {done.returncode}", flush=True)
        if (done.returncode == REFUSED) != (name in MISTAKES):
            wrong.append(f"{name}: exit code {done.returncode}: {done.stderr.decode().strip()}")
    if not only or "frames" in only:
        script = [sys.executable, __file__, "frames", str(folder)]
        subprocess.run(script, cwd=folder, env=environment, check=True)
    return wrong


def _check_tree(tree: Path, environment: Mapping[str, str]) -> None:
    """Stop if another tree's code would run than the one that is to be shown."""
    asked = [sys.executable, "-c", "import orchestrator; print(orchestrator.__file__)"]
    done = subprocess.run(
        asked, cwd=tree, env=dict(environment), capture_output=True, text=True, check=True
    )
    used = Path(done.stdout.strip()).resolve().parents[1]
    if used != tree.resolve():
        sys.exit(f"{tree}: Python takes orchestrator from {used}")


def _write_inputs(folder: Path) -> None:
    """Write the files that commands read."""
    folder.mkdir(parents=True, exist_ok=True)
    (park,) = (block.text for block in blocks(GUIDE) if block.path == "park.toml")
    for name, text in {"park.toml": park, **TABLES}.items():
        (folder / name).write_text(text, encoding="utf-8")
    for path in NETWORK.glob("areas.*"):
        copyfile(path, folder / path.name)


def write_frames(folder: Path) -> None:
    """Keep the help of all commands, and results as Python and its notebooks have them."""
    for name, text in help_texts("gfor", whole_parser()):
        (folder / f"help_{name.replace(' ', '_')}.txt").write_text(text, encoding="utf-8")
    modes = gfor.load("two_area").scenario("gfor").modes()
    run = gfor.load("infinite_bus").scenario("dip").run(stop=1.05)
    machines = gfor.load("two_area").site(scenario="gfor", device="regulator", confirm=0)
    buses = gfor.load("two_area").site(scenario="gfor", confirm=0)
    frames = {
        "modes": modes.table(),
        "participation": modes.participation(),
        "shapes": modes.dataset.to_dataframe(),
        "run": run.table().iloc[::50],
        "machines": machines.table(),
        "buses": buses.table(),
        **{f"flow_{kind}": frame for kind, frame in modes.power_flow().items()},
    }
    for name, frame in frames.items():
        frame.to_csv(folder / f"frame_{name}.csv")
    for name, study in {"modes": modes, "run": run, "machines": machines, "buses": buses}.items():
        (folder / f"notebook_{name}.html").write_text(study._repr_html_(), encoding="utf-8")
        (folder / f"repr_{name}.txt").write_text(repr(study), encoding="utf-8")


def help_texts(name: str, parser: argparse.ArgumentParser) -> Iterator[Leaf]:
    """Yield each command and its help."""
    yield name, parser.format_help()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for word, command in action.choices.items():
                yield from help_texts(f"{name} {word}", command)


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
    return (
        path
        for path in top.rglob("*")
        if path.is_file() and path.name not in ("manifest.json", TREE)
    )


def _leaves(path: Path, top: Path) -> Iterator[Leaf]:
    """Yield the places in a file and what stands there."""
    if path.suffix in _ONLY_PRESENT:
        return
    of_bytes = {
        ".nc": _of_dataset,
        ".npz": _of_arrays,
        ".mat": _of_matrices,
        ".fmu": _of_archive,
        ".ssp": _of_archive,
        ".dat": _of_bytes,
    }
    if path.suffix in of_bytes:
        yield from of_bytes[path.suffix](path)
        return
    text = path.read_text(encoding="utf-8", errors="replace").replace(str(top), "FOLDER")
    if (top / TREE).exists():
        text = text.replace((top / TREE).read_text(encoding="utf-8"), "TREE")
    text = _masked(text)
    readers: dict[str, Callable[[str], Iterator[Leaf]]] = {
        ".json": _of_json,
        ".csv": _of_csv,
        ".html": _of_html,
    }
    yield from readers.get(path.suffix, _of_text)(text)


def _masked(text: str) -> str:
    """A text without the pieces that differ from run to run."""
    for mask, word in _MASKS:
        text = mask.sub(word, text)
    return text


def _of_dataset(path: Path) -> Iterator[Leaf]:
    with xr.open_dataset(path) as dataset:
        for name, variable in dataset.variables.items():
            yield str(name), f"{variable.dims} {_digest(variable.values)}"
            for key, value in variable.attrs.items():
                yield f"{name}.{key}", str(value)


def _of_arrays(path: Path) -> Iterator[Leaf]:
    with np.load(path, allow_pickle=False) as arrays:
        for name in arrays.files:
            yield name, _digest(arrays[name])


def _of_matrices(path: Path) -> Iterator[Leaf]:
    """Yield the variables of a file of MATLAB, whose head has the time."""
    for name, value in loadmat(path).items():
        if not name.startswith("__"):
            yield name, _digest(np.asarray(value))


def _of_archive(path: Path) -> Iterator[Leaf]:
    """Yield the names in an FMU or SSP archive and the lines of its XML; libraries differ by their builds."""
    with ZipFile(path) as archive:
        yield "files", ", ".join(sorted(archive.namelist()))
        for name in archive.namelist():
            if Path(name).suffix in _XML:
                for place, line in _of_text(_masked(archive.read(name).decode("utf-8"))):
                    yield f"{name} {place}", line


def _of_bytes(path: Path) -> Iterator[Leaf]:
    yield "bytes", hashlib.sha256(path.read_bytes()).hexdigest()


def _digest(values: np.ndarray[Any, Any]) -> str:
    """Shape and hash of the digits of an array."""
    digest = hashlib.sha256(str(values.tolist()).encode()).hexdigest()
    return f"{values.shape} {digest[:16]}"


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
    writing.add_argument(
        "--tree", type=Path, default=ROOT, help="the tree whose code runs (default: this one)"
    )
    keeping = parts.add_parser("frames", help="what `write` keeps of Python, by itself")
    keeping.add_argument("folder", type=Path)
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
        wrong = write(options.folder.resolve(), options.only, options.tree.resolve())
        print("\n".join(wrong) or "all commands ended as they should")
        return int(bool(wrong))
    if options.part == "frames":
        write_frames(options.folder)
        return 0
    lines = compare(options.before.resolve(), options.after.resolve(), options.meant)
    print("\n".join(lines) or "nothing differs")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
