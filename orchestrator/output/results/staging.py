"""Results beside their place until they are whole: then they are put there at once, with a manifest."""

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from secrets import token_hex
from shutil import copy2, rmtree

from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.options import Option
from orchestrator.core.safe_files import PARTIAL, flush, inputs, not_written
from orchestrator.output.results.manifest import (
    MANIFEST,
    Manifest,
    read_manifest,
    write_manifest,
)
from orchestrator.output.results.recording_writer import ENDED_EARLY

_OLD = ".old-"
_DONE_WITH = ".done-with"
_TRIES = 20


def new_run_id() -> str:
    """An id for all files of one command, which begins with the time (UTC)."""
    return f"{datetime.now(UTC):%Y%m%dT%H%M%S}-{token_hex(4)}"


class ScenarioFolder:
    """The folder of one scenario's results, filled as ``<scenario>.part-<run id>`` beside its place.

    ``path``: Where files go until `publish`.
    ``place``: Where they are afterwards."""

    def __init__(self, folder: Path, scenario: str, run: str) -> None:
        self.run = run
        self.place = folder / scenario
        self.path = folder / f"{scenario}{PARTIAL}{run}"
        require_results(self.place)
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            for left in self.path.rglob(
                f"{PARTIAL}*"
            ):  # a resumed run has the id of the one that was killed
                left.unlink()
        except OSError as error:
            raise not_written(self.path, error) from error

    def discard(self) -> None:
        """Remove what is there, unless something was recorded: that stays for whoever wants to read it."""
        if not _has_rows(self.path):
            rmtree(self.path, ignore_errors=True)

    def publish(self, ended_early: str | None = None) -> Path:
        """Put the folder in its place, whole; results of an earlier run that are there go, and files of others stay.

        ``ended_early``: why the run ended before its stop time; None where it reached that."""
        try:
            about = {"scenario": self.place.name} | (
                {} if ended_early is None else {ENDED_EARLY: ended_early}
            )
            write_manifest(self.path, self.run, _files(self.path), about=about)
            _keep_others(self.place, self.path, self.run)
            flush(self.path)
            _exchange(self.path, self.place, self.run)
        except OSError as error:
            raise not_written(self.place, error) from error
        return self.place


def require_results(place: Path) -> None:
    """Refuse a place for a scenario's results where something is that no run has made."""
    if place.is_file() or (
        place.is_dir() and any(place.iterdir()) and not (place / MANIFEST).is_file()
    ):
        raise InputError(
            f"{place}: the results of the scenario {place.name!r} go there, and no run "
            "has made what is there now; give another " + Option.OUT + ", or move it"
        )


def _keep_others(old: Path, new: Path, run: str) -> None:
    """Copy what a folder's manifest does not list; where the new one has a file of that name, beside it."""
    own = _readable(old)
    for path in sorted(old.rglob("*")):
        name = path.relative_to(old).as_posix()
        place = new / name
        if name == MANIFEST or (own and name in own.files):
            continue
        if path.is_dir() and not path.is_symlink():
            if not any(path.iterdir()):
                place.mkdir(parents=True, exist_ok=True)
        elif own or not place.exists():
            place = place.with_name(f"{place.name}.before-{run}") if place.exists() else place
            place.parent.mkdir(parents=True, exist_ok=True)
            copy2(path, place, follow_symlinks=False)


def _exchange(new: Path, place: Path, run: str) -> None:
    old = place.with_name(f"{place.name}{_OLD}{run}")
    for attempt in range(_TRIES):
        with suppress(FileNotFoundError):
            place.rename(old)
        try:
            new.rename(place)
            break
        except OSError:  # another run put its folder there in the meantime
            if attempt == _TRIES - 1 or not place.exists():
                if old.exists() and not place.exists():
                    old.rename(place)
                raise
            rmtree(old, ignore_errors=True)
    flush(place.parent)
    if old.is_dir() and not old.is_symlink():
        rmtree(old, ignore_errors=True)
    else:
        old.unlink(missing_ok=True)


def _has_rows(folder: Path) -> bool:
    """Return whether something was recorded in the folder of an unfinished run."""
    return any(not path.name.startswith(PARTIAL) for path in folder.rglob("*.nc"))


def mend(folder: Path) -> None:
    """Bring back what a process that was killed had just put aside for its own results, and remove what it had done
    with, or begun without recording anything."""
    for begun in unfinished(folder):
        if not _has_rows(begun):
            rmtree(begun, ignore_errors=True)
    for left in folder.glob(f"{PARTIAL}*{_DONE_WITH}"):
        rmtree(left, ignore_errors=True)
    for old in folder.glob(f"*{_OLD}*"):
        place = old.with_name(old.name.partition(_OLD)[0])
        with suppress(OSError):
            if place.exists():
                rmtree(old, ignore_errors=True)
            else:
                old.rename(place)


def remove_at_once(path: Path, run: str) -> None:
    """Remove a folder so that at no moment, whatever ends the process, a part of it is left in its place."""
    away = path.with_name(f"{PARTIAL}{run}{_DONE_WITH}")
    with suppress(OSError):
        path.rename(away)
    rmtree(away, ignore_errors=True)
    rmtree(path, ignore_errors=True)


def unfinished(folder: Path) -> list[Path]:
    """Folders of scenarios whose run did not end, or still goes on."""
    return sorted(
        path
        for path in folder.glob(f"*{PARTIAL}*")
        if path.is_dir() and not path.name.startswith(PARTIAL)
    )


@contextmanager
def staged(folder: Path, run: str, scenarios: Iterable[str] = ()) -> Iterator[Path]:
    """A folder to write files to that are put into ``folder`` at the end, with a manifest of them.

    Where a file is in the way that no command has written, or that this one reads, all of them stay beside it."""
    path = folder / f"{PARTIAL}{run}"
    rmtree(path, ignore_errors=True)  # a resumed run has the id of the one that was killed
    try:
        path.mkdir(parents=True)
        yield path
        names = _files(path)
        taken = [name for name in names if _is_foreign(folder, name, sha256_of(path / name))]
        write_manifest(path, run, names, scenarios, _readable(folder))
        if taken:
            path.rename(folder / run)
            raise _foreign(folder / taken[0], f"the results are in {folder / run}")
        for name in [*names, MANIFEST]:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            os.replace(path / name, folder / name)
        flush(folder)
    except OSError as error:
        raise not_written(folder, error) from error
    finally:
        rmtree(path, ignore_errors=True)


def check_free(folder: Path, contents: Mapping[str, bytes | None]) -> None:
    """Refuse files that are to be written where somebody else's are, before anything is computed for them.

    ``contents``: by name; None where it is not known yet."""
    for name, content in contents.items():
        if _is_foreign(
            folder, name, None if content is None else hashlib.sha256(content).hexdigest()
        ):
            raise _foreign(folder / name, ("give another " + Option.OUT + ", or move it"))


def _is_foreign(folder: Path, name: str, content: str | None) -> bool:
    """Return whether a file that is there is read by the command, or of somebody else, and other than the new one."""
    path = folder / name
    others = path.is_file() and (path.resolve() in inputs or not _is_listed(folder, name))
    return path.is_dir() or (others and sha256_of(path) != content)


def _is_listed(folder: Path, name: str) -> bool:
    """Return whether a command has written the file, be it one that was killed while it put its files there."""
    for place in (folder, *folder.glob(f"{PARTIAL}*")):
        with suppress(InputError):  # one that is damaged lists nothing
            found = read_manifest(place)
            if found and name in found.files:
                return True
    return False


def _foreign(path: Path, remedy: str) -> InputError:
    why = "the command reads it" if path.resolve() in inputs else "no command has written it"
    return InputError(f"{path}: this file would be written over, and {why}; {remedy}")


def _readable(folder: Path) -> Manifest | None:
    """Read what commands noted of a folder's files, without those that are gone; nothing where that is damaged."""
    try:
        found = read_manifest(folder)
    except InputError:
        return None
    return found and Manifest(
        folder, {n: f for n, f in found.files.items() if (folder / n).is_file()}, found.scenarios
    )


def _files(folder: Path) -> list[str]:
    """Names of all files below a folder, but for manifests and what is not finished."""
    found = (
        path.relative_to(folder)
        for path in folder.rglob("*")
        if path.is_file() and path.name != MANIFEST
    )
    return sorted(
        name.as_posix() for name in found if not any(PARTIAL in part for part in name.parts)
    )
