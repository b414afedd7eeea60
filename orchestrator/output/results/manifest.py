"""``manifest.json``: which run left the files of a folder, and how each of them looked when it was written."""

import json
import warnings
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.output.results import origin
from orchestrator.output.results.file_writers import save_json, versions_of

MANIFEST = "manifest.json"
_FORMAT = 1
_AGAIN = "make the results again, into an empty folder"


class ResultsWarning(UserWarning):
    """Results can be read, and are not as a finished run leaves them: no manifest, or the run goes on."""


@dataclass(frozen=True)
class WrittenFile:
    run: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Manifest:
    folder: Path
    files: dict[str, WrittenFile]
    scenarios: dict[str, str] = field(default_factory=dict)
    scenario: str = ""

    def check(self, names: Iterable[str]) -> None:
        """Compare files with what was written.

        ``names``: of the files; those that are not listed, and were written by nobody, are not looked at."""
        for name in names:
            if name in self.files:
                self._check(self.folder / name, self.files[name])

    def _check(self, path: Path, written: WrittenFile) -> None:
        try:
            size = path.stat().st_size
            same = size == written.bytes and sha256_of(path) == written.sha256
        except OSError as error:
            text = (
                f"{path}: this file of run {written.run} cannot be read: {error.strerror}; {_AGAIN}"
            )
            raise InputError(text) from error
        if size != written.bytes:
            raise InputError(
                f"{path}: it has {size} bytes, and run {written.run} wrote {written.bytes}: it was cut "
                f"off, changed, or is of another run; {_AGAIN}"
            )
        if not same:
            raise InputError(
                f"{path}: its content is not what run {written.run} wrote (SHA-256 differs): it was "
                f"damaged, changed, or is of another run; {_AGAIN}"
            )


def write_manifest(
    folder: Path,
    run: str,
    names: Iterable[str],
    scenarios: Iterable[str] = (),
    before: Manifest | None = None,
    about: Mapping[str, str] | None = None,
) -> None:
    """Write a folder's manifest, after its files.

    ``scenarios``: folders beside them that are of the same run.
    ``before``: what an earlier command said of the files' place: its files that are not written anew stay listed.
    ``about``: of a scenario's folder: its ``scenario``, and ``ended_early`` with the reason where its run did so."""
    paths = {name: folder / name for name in sorted(names)}
    files = {
        name: WrittenFile(run, sha256_of(path), path.stat().st_size) for name, path in paths.items()
    }
    listed = {**(before.files if before else {}), **files}
    beside = dict.fromkeys(scenarios, run) or (before.scenarios if before else {})
    entries = {name: asdict(listed[name]) for name in sorted(listed)}
    content = {"format": _FORMAT, "run": run, **made_now(), "files": entries}
    save_json(content | dict(about or {}) | {"scenarios": beside}, folder / MANIFEST)


def made_now() -> dict[str, Any]:
    """Where results come from: version, date, and what the command line says of itself."""
    date = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    return {
        "made_by": versions_of(["gfor-cosim"]),
        "date": date,
        **(origin.said[-1]() if origin.said else {}),
    }


def read_manifest(folder: Path) -> Manifest | None:
    """The manifest of a folder; None where there is none, as in those of older versions."""
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        files = {
            str(n): WrittenFile(str(f["run"]), str(f["sha256"]), int(f["bytes"]))
            for n, f in content["files"].items()
        }
        beside = {str(n): str(run) for n, run in content["scenarios"].items()}
        return Manifest(folder, files, beside, str(content.get("scenario", "")))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{path}: it cannot be read as the list of a run's files: {error}; {_AGAIN}"
        ) from error


def spare_result(path: Path) -> None:
    """Refuse a file to write that stands in the manifest beside it: results of a run are replaced by a run alone."""
    found = read_manifest(path.parent)
    if found and path.name in (*found.files, MANIFEST):
        raise InputError(
            f"{path}: it is one of the results in {path.parent}, and would be written over; name another "
            "file to write"
        )


def inputs_behind(result: Path) -> dict[str, str]:
    """Hashes of what a run's folder, or a file in it, was made from; empty where no manifest says so of it."""
    try:
        place = result if result.is_dir() else result.parent
        content = json.loads((place / MANIFEST).read_text(encoding="utf-8"))
        known = result.is_dir() or content["files"][result.name]["run"] == content["run"]
        return {str(name): str(of) for name, of in content["inputs"].items()} if known else {}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}  # somebody else's


def checked(folder: Path, names: Collection[str]) -> Manifest | None:
    """The manifest of a folder in which these files are as they were written; warns where there is none."""
    manifest = read_manifest(folder)
    if manifest is None or not manifest.files.keys() & {*names}:
        text = f"{folder}: there is no {MANIFEST} of these results, so nobody can check them"
        warnings.warn(text, ResultsWarning, stacklevel=3)
        return None
    manifest.check(names)
    return manifest


def check_one_run(folder: Path, names: Iterable[str], inner: Iterable[str]) -> None:
    """Compare the files of a run, and those in the folders of its scenarios, with what one run wrote."""
    there = [name for name in names if (folder / name).exists()]
    manifest = checked(folder, there)
    if manifest is None:
        return
    first = there[0]
    if first not in manifest.files:
        raise InputError(
            f"{folder / first}: {MANIFEST} beside it does not list it, so its run is unknown; {_AGAIN}"
        )
    run = manifest.files[first].run
    for name in there:
        found = manifest.files.get(name)
        if found is None or found.run != run:
            seen = "of no run that is known" if found is None else f"of run {found.run}"
            raise InputError(
                f"{folder}: {name} is {seen}, and {first} of run {run}: they do not belong together; {_AGAIN}"
            )
    for scenario, of in manifest.scenarios.items():
        if of == run:
            _check_scenario(folder, scenario, run, inner)


def _check_scenario(folder: Path, scenario: str, run: str, names: Iterable[str]) -> None:
    manifest = read_manifest(folder / scenario)
    runs = (
        {"no run that is known"}
        if manifest is None
        else {f.run for n, f in manifest.files.items() if n in {*names}}
    )
    if manifest is None or runs - {run}:
        raise InputError(
            f"{folder / scenario}: it is of run {', '.join(sorted(runs))}, and the summary in {folder} of run {run}: "
            f"another run into this folder did not come to its end; {_AGAIN}"
        )
    manifest.check(names)
