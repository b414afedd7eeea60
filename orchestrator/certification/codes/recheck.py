"""Whether a code's certificate still holds: its hashes, and its verdict judged again from its responses."""

import json
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.acceptance.runner import file_hash
from orchestrator.certification.codes.all_codes import BY_DECLARATION, CODES, code_for
from orchestrator.certification.codes.bench_case import case_name
from orchestrator.certification.codes.bench_point import BenchResult
from orchestrator.certification.codes.certificate import departures_of, verdict_of
from orchestrator.certification.codes.record import FORMAT, finding_json
from orchestrator.certification.codes.row_verdict import judge_row
from orchestrator.certification.files import HTML, JSON, RESPONSES, figures_hash, seal_of
from orchestrator.certification.verification import Verification
from orchestrator.errors import InputError


def read_code_certificate(path: Path) -> tuple[Path, dict[str, Any]] | None:
    """Folder and content of a code's certificate; None where there is none of this form."""
    file = path / JSON if path.is_dir() else path
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        return None
    wanted = {"code": str, "rows": list, "verdict": str, "values": dict, "declared": dict, "files": dict, "f_n": float,
              "missing": list, "sentence": str, "departures": list}  # fmt: skip
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


def _judged_again(folder: Path, content: dict[str, Any]) -> list[str]:
    code, faults, accepted = code_for(content["code"], content.get("declared", {})), [], []
    rows = {row.name: row for row in code.rows}
    with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
        for stated in content["rows"]:
            row = rows[stated["row"]]
            prefix = f"{row.name}."
            signals = {str(n).removeprefix(prefix): data[n].values for n in data.data_vars if str(n).startswith(prefix)}
            times = data[f"time_{row.name}"].values
            result = BenchResult(row.name, times, signals, stated["findings"], failure=stated["unknown"] or None)
            again = judge_row(row, result, content["f_n"])
            same = [finding_json(f) for f in again.findings] == stated["criteria"]
            if not same or (again.judged, again.accepted) != (stated["judged"], stated["accepted"]):
                faults.append(f"row {row.name}: its response gives other findings than {JSON} states")
            if again.judged:
                accepted.append(bool(again.accepted))
    if content["departures"] != list(departures_of(content["values"], content["f_n"], code)):
        faults.append("the departures from the code are not those of its values and its rated frequency")
    done = {stated["row"] for stated in content["rows"] if stated["judged"]}
    absent = [row.name for row in code.rows if not row.shown_only and row.name not in done]
    wanted = verdict_of(accepted, len(absent) + len(code.left_out) + len(content["departures"]))
    if wanted != content["verdict"]:
        faults.append(f"the verdict is {content['verdict']!r}; its rows come to {wanted!r}")
    if wanted not in content["sentence"]:
        faults.append(f"the sentence does not say {wanted!r}, to which its rows come")
    return faults
