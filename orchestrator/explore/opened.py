"""What `gfor explore` is given: a case, or a folder of results with the case behind it."""

import json
from pathlib import Path
from typing import Any

from orchestrator.api.case import Case, load
from orchestrator.errors import InputError
from orchestrator.explore.certified import CERTIFICATES, certified
from orchestrator.report.cells import CELLS, check_case, found_from, read_cells
from orchestrator.report.html.folder import SUMMARY
from orchestrator.results.comtrade.reading import is_comtrade
from orchestrator.results.csv_recording import SUFFIXES
from orchestrator.results.recording import TRAJECTORY

Opened = tuple[str, Case, dict[str, Any]]
"""A word that opens the case, the case, and what the page begins with where that is not as always: ``recorded`` in it
is a file or folder by scenario, "" for each that has none of its own."""


def opened(given: str, *, trust_fmus: bool = False) -> Opened:
    path = Path(given)
    if path.name == TRAJECTORY or (path / TRAJECTORY).is_file():
        scenario = path.parent if path.name == TRAJECTORY else path
        return _of_run(scenario.parent, trust_fmus, scenario.name)
    if (path / SUMMARY).is_file():
        return _of_run(path, trust_fmus)
    file = path if path.name in CERTIFICATES else next((path / n for n in CERTIFICATES if (path / n).is_file()), None)
    if file is not None and not (path / CELLS).is_file():
        word, study = certified(file)
        return word, load(word, trust_fmus=trust_fmus), {"study": study}
    if path.is_dir():
        study = read_cells(path)
        case = load(study["case"], trust_fmus=trust_fmus)
        check_case(study, case.file, path)
        kept = {key: study.get(key) for key in ("scenario", "step", "values", "range")}
        return study["case"], case, {"study": study, **kept}
    if is_comtrade(path) or path.suffix.lower() in SUFFIXES:
        raise InputError(f"{given}: a recording is shown beside a simulation: gfor explore CASE --beside {given}")
    return given, load(given, trust_fmus=trust_fmus), {}


def _of_run(folder: Path, trust_fmus: bool, scenario: str = "") -> Opened:
    """The case of a run as it is now, with the values that the run was given, and beside it what was recorded."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        word, given = str(found_from(summary["case_file"], folder)), summary["given"]
        recorded = {name: str(folder / name) for name in given if (folder / name / TRAJECTORY).is_file()}
        name = scenario or next(reversed(recorded))
        wanted, text = dict(given[name]), (folder / "case.toml").read_text(encoding="utf-8")
        (step,) = (one["step_size_s"] for one in summary["scenarios"] if one["name"] == name)
    except (OSError, ValueError, KeyError, TypeError, StopIteration) as error:
        raise InputError(f"{folder / SUMMARY}: it does not tell which case was run, and how ({error!r}); run it again "
                         "with `gfor run`, or give the case and --beside FOLDER/SCENARIO") from error  # fmt: skip
    case = load(word, trust_fmus=trust_fmus)
    if text != case.file.text:
        raise InputError(f"{word} is not as it was when {folder} was made; run it again, or give the case and --beside "
                         f"{folder / name}")  # fmt: skip
    own = case.scenario(name).prepared
    values = {key: value for key, value in wanted.items() if own.given.get(key) != value}
    beginning = {"scenario": name, "values": values, "recorded": recorded}
    return word, case, beginning if step == own.step_size else beginning | {"step": step}
