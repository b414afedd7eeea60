"""Whether a certificate still holds: its hashes, and all that it says, rebuilt from what its folder keeps."""

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any

import xarray as xr

from orchestrator.certification.case_file import BINDING, CASE, FMU
from orchestrator.certification.codes.all_codes import CODES, code_for
from orchestrator.certification.codes.bench_point import case_name
from orchestrator.certification.files import HTML, JSON, RESPONSES, figures_hash, figures_of, read_record, seal_of
from orchestrator.certification.form import NORM, check_form
from orchestrator.certification.rebuilt import case_faults, rebuilt
from orchestrator.errors import InputError
from orchestrator.safe_files import file_hash


@dataclass
class Verification:
    faults: list[str] = field(default_factory=list)
    agreed: list[str] = field(default_factory=list)

    @property
    def holds(self) -> bool:
        return not self.faults


def read_certificate(path: Path) -> tuple[Path, dict[str, Any]]:
    """Folder and content of a certificate, from either the folder or ``certificate.json``."""
    file = path / JSON if path.is_dir() else path
    try:
        content = read_record(file)
    except OSError as error:
        raise InputError(
            f"{file}: the certificate cannot be read: {error.strerror}; give the folder that `gfor certify` wrote"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{file}: it is not JSON: {error}; give the certificate.json of `gfor certify`") from error
    check_form(file, content)
    return file.parent, content


def verify_files(folder: Path, content: dict[str, Any]) -> Verification:
    found = Verification()
    if content.get("seal") != seal_of(content):
        found.faults.append(f"{JSON}: its figures or words are not those that were written: its own hash differs")
    else:
        found.agreed.append(f"{JSON}: its own hash")
    hashes, names = content["files"], [FMU, RESPONSES, HTML, *([BINDING] if content["binding"] else [])]
    names += [CASE] if content["format"] == NORM else [case_name(row["row"]) for row in content["rows"]]
    for name in dict.fromkeys([*names, *hashes]):
        _compare_file(folder, name, hashes.get(name), found)
    _compare_page(folder / HTML, content, found)
    faults = _judged_again(folder, content)
    found.faults += faults
    found.agreed += [] if faults else ["every row and the verdict, judged again from the figures and the responses"]
    return found


def _compare_page(page: Path, content: dict[str, Any], found: Verification) -> None:
    if not page.is_file():
        return
    text = page.read_text(encoding="utf-8", errors="replace")
    if f">{escape(content['sentence'])}</b>" not in text:
        found.faults.append(f"{HTML}: it does not hold the verdict's sentence of {JSON}")
    if figures_hash(content) not in text:
        found.faults.append(f"{HTML}: it was made of other figures than those of {JSON}: their hash is not on the page")
    else:
        found.agreed.append(f"{HTML}: the hash of the figures that it shows")


def _judged_again(folder: Path, content: dict[str, Any]) -> list[str]:
    try:
        with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
            again = json.loads(json.dumps(figures_of(rebuilt(folder, content, data))))
            beside = case_faults if content["format"] == NORM else _of_the_table
            return [*faults_of(content, again), *beside(folder, content, data)]
    except (InputError, OSError, KeyError, ValueError, TypeError, IndexError, AttributeError) as error:
        return [f"the certificate cannot be judged again from {FMU}, its case files and {RESPONSES}: "
                f"{type(error).__name__}: {error}"]  # fmt: skip


def _of_the_table(folder: Path, content: dict[str, Any], data: xr.Dataset) -> list[str]:
    """Rows of the record against the code's table, the files and the responses: `gfor certify` writes all of a table.

    Row files of another code may lie in the folder, from an earlier certificate; those of the record's files may not.
    """
    codes = [*CODES.values(), code := code_for(content["code"], content["declared"])]
    recorded, table = [row["row"] for row in content["rows"]], [row.name for row in code.rows]
    own = {*content["files"], *(case_name(row.name) for code in codes for row in code.rows)}
    files = [name.removeprefix("row_").removesuffix(".toml") for name in content["files"] if name.startswith("row_")]
    kept = [str(name).removeprefix("time_") for name in data.coords]
    compared = (
        ("rows of the code's table that the record has not", [name for name in table if name not in recorded]),
        ("files of rows that the record has not", [name for name in files if name not in recorded]),
        (f"rows of {RESPONSES} that the record has not", [name for name in kept if name not in recorded]),
    )
    strangers = sorted(path.name for path in folder.glob("row_*.toml") if path.name not in own)
    faults = [f"{what}: {', '.join(names)}" for what, names in compared if names]
    return [*faults, *(f"{name}: the record does not know it; take it away, or certify anew" for name in strangers)]


def _compare_file(folder: Path, name: str, wanted: str | None, found: Verification) -> None:
    path = folder / name
    if not path.is_file():
        found.faults.append(f"{name}: there is no such file beside {JSON}; it was removed or renamed")
    elif wanted is None:
        found.faults.append(f"{name}: {JSON} has no hash of it")
    elif file_hash(path) != wanted:
        found.faults.append(f"{name}: it is not the file that was certified: its SHA-256 differs")
    else:
        found.agreed.append(f"{name}: SHA-256")


WRITTEN_LAST = ("made", "files", "seal")

TAKEN = frozenset(
    ("tool", "environment", "details", "parameters", "file", "binding", "again", "reason",
     "norm", "title", "clause", "source", "date", "readings")
)  # fmt: skip
"""Entries that cannot be had anew, or that another version has in other words; beside those that are written last."""

_SAME, _SAME_IN_SIGNAL = 1e-9, 1e-5
"""Largest relative difference of a figure that comes out anew; of a mode that is found in a signal."""

_NOTHING = "no such entry"
_SHOWN = 200  # characters of a value that are shown


def faults_of(stated: Mapping[str, Any], again: Mapping[str, Any]) -> Iterator[str]:
    """Sentences on what is stated and does not come out; rows are compared by their names."""
    rows = "points" if "points" in again else "rows"
    whole = [{k: v for k, v in c.items() if k not in (rows, *WRITTEN_LAST)} for c in (stated, again)]
    for place, text in differences(whole[0], whole[1]):
        yield f"{place!r} {text}"
    named = [{_name(row): row for row in content[rows]} for content in (stated, again)]
    listed = [_name(row) for row in stated[rows]]
    compared = (
        ("rows of the record that do not come out anew", [name for name in listed if name not in named[1]]),
        ("rows that come out anew that the record has not", [name for name in named[1] if name not in named[0]]),
        ("rows that the record has twice", [name for k, name in enumerate(listed) if name in listed[:k]]),
    )
    yield from (f"{what}: {', '.join(dict.fromkeys(names))}" for what, names in compared if names)
    for name in (name for name in named[0] if name in named[1]):
        for place, text in differences(named[0][name], named[1][name]):
            yield f"{name}: its response and figures come to other findings: {place!r} {text}"


def _name(row: Mapping[str, Any]) -> str:
    return f"row {row['row']}" if "row" in row else f"X_L = {row['X_L']:g} pu"


def differences(stated: Any, again: Any, tolerance: float = _SAME) -> Iterator[tuple[str, str]]:
    if isinstance(stated, dict) and isinstance(again, dict):
        keys = [k for k in (*again, *stated) if not (k in TAKEN and k in again)]
        pairs = {k: (stated.get(k, _NOTHING), again.get(k, _NOTHING)) for k in keys}
    elif isinstance(stated, list) and isinstance(again, list) and len(stated) == len(again):
        pairs = {str(k): pair for k, pair in enumerate(zip(stated, again, strict=True))}
    else:
        if not _same(stated, again, tolerance):
            yield "", f"is {_text(stated)}, and {_text(again)} comes out"
        return
    for key, pair in pairs.items():
        for place, text in differences(*pair, _SAME_IN_SIGNAL if key == "modal" else tolerance):
            yield f"{key}.{place}" if place else key, text


def _same(stated: Any, again: Any, tolerance: float) -> bool:
    if {type(stated), type(again)} <= {int, float}:
        return math.isclose(stated, again, rel_tol=tolerance, abs_tol=1e-12)
    return bool(stated == again) and type(stated) is type(again)


def _text(value: object) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
