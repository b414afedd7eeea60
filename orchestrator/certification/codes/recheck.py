"""Whether a code's certificate still holds: its hashes, and its verdict judged again from its responses."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.certification.acceptance import Acceptance
from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, code_for
from orchestrator.certification.codes.bench_case import case_name
from orchestrator.certification.codes.bench_point import BenchResult
from orchestrator.certification.codes.certificate import departures_of, missing_of, sentence_of, verdict_of
from orchestrator.certification.codes.record import FORMAT, finding_json
from orchestrator.certification.codes.row import GridCode
from orchestrator.certification.codes.row_verdict import RowVerdict, judge_row
from orchestrator.certification.files import HTML, JSON, RESPONSES, figures_hash, read_record, seal_of
from orchestrator.certification.verification import Verification
from orchestrator.errors import ErrorKind, InputError
from orchestrator.points.failure import Failure
from orchestrator.safe_files import file_hash


def read_code_certificate(path: Path) -> tuple[Path, dict[str, Any]] | None:
    """Folder and content of a code's certificate; None where there is none of this form."""
    file = path / JSON if path.is_dir() else path
    try:
        content = read_record(file)
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return None
    wanted = {"code": str, "rows": list, "verdict": str, "values": dict, "declared": dict, "files": dict, "f_n": float,
              "missing": list, "sentence": str, "departures": list, "left_out": list, "model": str}  # fmt: skip
    bad = [name for name, kind in wanted.items() if not isinstance(content.get(name), kind)]
    if bad or content["code"] not in {*CODES, *BY_DECLARATION}:
        raise InputError(
            f"{file}: {', '.join(bad) or 'code'} is not what `gfor certify` writes; make the certificate anew"
        )
    return file.parent, content


def verify_code(folder: Path, content: dict[str, Any]) -> Verification:
    """Compare all hashes, and judge every row again from its response."""
    found = Verification()
    said = content.get("seal") == seal_of(content)
    (found.agreed if said else found.faults).append(
        f"{JSON}: its own hash" if said else f"{JSON}: its figures or words are not those that were written"
    )
    for name in dict.fromkeys([RESPONSES, HTML, *content["files"], *(case_name(r["row"]) for r in content["rows"])]):
        path, wanted = folder / name, content["files"].get(name)
        if not path.is_file():
            found.faults.append(f"{name}: there is no such file beside {JSON}; it was removed or renamed")
        elif file_hash(path) != wanted:
            found.faults.append(f"{name}: it is not the file that was certified: its SHA-256 differs")
        else:
            found.agreed.append(f"{name}: SHA-256")
    found.faults += [f"{name}: the record does not know it; take it away, or certify anew"
                     for name in _strangers(folder, content)]  # fmt: skip
    page = folder / HTML
    if page.is_file() and figures_hash(content) not in page.read_text(encoding="utf-8", errors="replace"):
        found.faults.append(f"{HTML}: it was made of other figures than those of {JSON}")
    try:
        faults = _judged_again(folder, content)
    except (OSError, KeyError, ValueError, TypeError, IndexError) as error:
        faults = [f"the rows cannot be judged again: {type(error).__name__}: {error}"]
    found.faults += faults
    found.agreed += [] if faults else ["every row and the verdict, judged again from the responses"]
    return found


def _strangers(folder: Path, content: dict[str, Any]) -> list[str]:
    """Files of rows that neither the record has nor any code, as those of an earlier certificate of another code."""
    codes = [*CODES.values(), code_for(content["code"], content["declared"])]
    known = {*content["files"], *(case_name(row.name) for code in codes for row in code.rows)}
    return sorted(path.name for path in folder.glob("row_*.toml") if path.name not in known)


def _judged_again(folder: Path, content: dict[str, Any]) -> list[str]:
    code = code_for(content["code"], content.get("declared", {}))
    rows = {row.name: row for row in code.rows}
    with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
        kept = [str(name).removeprefix("time_") for name in data.coords]
        faults, verdicts = _of_the_table(code, content, kept), []
        for stated in content["rows"]:
            row = rows.get(stated["row"])
            if row is None:
                continue
            prefix = f"{row.name}."
            signals = {str(n).removeprefix(prefix): data[n].values for n in data.data_vars if str(n).startswith(prefix)}
            times = data[f"time_{row.name}"].values
            failure = Failure(ErrorKind.OTHER, stated["unknown"], False) if stated["unknown"] else None
            result = BenchResult(row.name, times, signals, stated["findings"], failure=failure)
            again = judge_row(row, result, content["f_n"])
            same = [finding_json(f) for f in again.findings] == stated["criteria"]
            if not same or (again.judged, again.accepted) != (stated["judged"], stated["accepted"]):
                faults.append(f"row {row.name}: its response gives other findings than {JSON} states")
            verdicts.append(again)
    return faults + _of_the_verdict(code, content, verdicts)


def _of_the_table(code: GridCode, content: dict[str, Any], kept: Sequence[str]) -> list[str]:
    """Rows of the record against the code's table, the files and the responses: `gfor certify` writes all of a table.

    Row files of another code may lie in the folder, from an earlier certificate; those of the record's files may not.
    """
    recorded, table = [stated["row"] for stated in content["rows"]], [row.name for row in code.rows]
    files = [row.name for row in code.rows if case_name(row.name) in content["files"]]
    files += [name for name in content["files"] if name.startswith("row_") and name not in map(case_name, table)]
    compared = (
        ("rows of the code's table that the record has not", [name for name in table if name not in recorded]),
        ("rows of the record that the code's table has not", [name for name in recorded if name not in table]),
        ("rows that the record has twice", [n for k, n in enumerate(recorded) if n in recorded[:k]]),
        ("files of rows that the record has not", [name for name in files if name not in recorded]),
        (f"rows of {RESPONSES} that the record has not", [name for name in kept if name not in recorded]),
    )
    return [f"{what}: {', '.join(dict.fromkeys(names))}" for what, names in compared if names]


def _of_the_verdict(code: GridCode, content: dict[str, Any], verdicts: Sequence[RowVerdict]) -> list[str]:
    departures = departures_of(content["values"], content["f_n"], code)
    missing = missing_of(code, verdicts, departures)
    wanted = verdict_of([bool(v.accepted) for v in verdicts if v.judged], len(missing))
    sentence = sentence_of(code, content["model"], verdicts, missing, _acceptance(content["acceptance"]))
    faults = []
    if content["departures"] != list(departures):
        faults.append("the departures from the code are not those of its values and its rated frequency")
    if content["missing"] != list(missing):
        faults.append(f"'missing' is not what its rows leave: {'; '.join(missing) or 'nothing'}")
    if content["left_out"] != list(code.left_out):
        faults.append("'left_out' is not what the code's table leaves out")
    if wanted != content["verdict"]:
        faults.append(f"the verdict is {content['verdict']!r}; its rows come to {wanted!r}")
    if sentence != content["sentence"]:
        faults.append(f"the sentence is not the one to which its rows come: {sentence!r}")
    return faults


def _acceptance(report: dict[str, Any] | None) -> Acceptance | None:
    if report is None:
        return None
    failed = tuple(dict.fromkeys(check["fault"] for check in report["checks"] if check["verdict"] == "fail"))
    return Acceptance(report["trusted"], failed, report)
