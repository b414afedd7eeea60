"""Checks that a certificate still holds: its hashes, all that it says, rebuilt from what its folder keeps, and parts
computed anew."""

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.late import xr
from orchestrator.output.signatures.checking import State
from orchestrator.studies.certification.case_file import BINDING, FMU
from orchestrator.studies.certification.compared import (
    THIS,
    Content,
    Verification,
    faults_of,
    issued_by,
    of_one_program,
)
from orchestrator.studies.certification.files import (
    HTML,
    JSON,
    RESPONSES,
    figures_hash,
    figures_of,
    read_record,
    seal_of,
    signatures_of,
)
from orchestrator.studies.certification.form import case_files, check_form
from orchestrator.studies.certification.kinds import Parts, parts_of, rebuilt
from orchestrator.studies.certification.page_again import PageSeen, look_at_page, views_beside
from orchestrator.studies.certification.signed import Asked, look_at_signature
from orchestrator.studies.certification.verdict import INCOMPLETE, PASSES, verdicts_on_page
from orchestrator.studies.points.executor import Executor
from orchestrator.studies.points.points import CountReport, nobody


def read_certificate(path: Path) -> tuple[Path, dict[str, Any]]:
    """Folder and content of a certificate, from either the folder or ``certificate.json``."""
    file = path / JSON if path.is_dir() else path
    if file.is_symlink():
        raise InputError(
            f"{file}: it is a link, and a certificate's files lie in its folder; give the folder to which it leads"
        )
    try:
        content = read_record(file)
    except OSError as error:
        raise InputError(
            f"{file}: the certificate cannot be read: {error.strerror}; give the folder that `gfor "
            "certify` wrote"
        ) from error
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{file}: it is not JSON: {error}; give the certificate.json of `gfor certify`"
        ) from error
    check_form(file, content)
    return file.parent, content


def verify_files(folder: Path, content: dict[str, Any]) -> Verification:
    found = Verification()
    if content.get("seal") != seal_of(content):
        found.faults.append(
            f"{JSON}: its figures or words are not those that were written: its own hash differs"
        )
    else:
        found.agreed.append(f"{JSON}: its own hash")
    hashes, names = (
        content["files"],
        [FMU, RESPONSES, HTML, *([BINDING] if content["binding"] else [])],
    )
    names += case_files(content)
    names = list(dict.fromkeys([*names, *hashes]))
    for name in names:
        _compare_file(folder, name, hashes.get(name), found)
    if any((folder / name).is_symlink() for name in names):
        return found
    _compare_page(folder / HTML, content, found)
    faults = _judged_again(folder, content, found.agreed, found.views)
    found.faults += faults
    found.agreed += (
        []
        if faults
        else ["every row and the verdict, judged again from the figures and the responses"]
    )
    return found


def _compare_page(page: Path, content: dict[str, Any], found: Verification) -> None:
    if not page.is_file():
        return
    text = page.read_text(encoding="utf-8", errors="replace")
    shown = text.replace("\N{NO-BREAK SPACE}", " ")
    sentence = content["sentence"]  # which pages of earlier versions hold as a whole
    if not (_holds(shown, [sentence]) or _holds(shown, verdicts_on_page(sentence))):
        found.faults.append(f"{HTML}: it does not hold the verdict's sentence of {JSON}")
    if figures_hash(content) not in text:
        found.faults.append(
            f"{HTML}: it was made of other figures than those of {JSON}: their hash is not on the page"
        )
    else:
        found.agreed.append(f"{HTML}: the hash of the figures that it shows")


def _holds(page: str, verdicts: Iterable[str]) -> bool:
    """Return whether a page shows verdicts in the type that it has for them."""
    return all(f">{escape(one)}</b>" in page for one in verdicts)


def _judged_again(
    folder: Path, content: dict[str, Any], said: list[str], views: list[str]
) -> list[str]:
    try:
        with xr.open_dataset(folder / RESPONSES, engine="scipy") as data:
            seen = look_at_page(folder, content, data) if (folder / HTML).is_file() else PageSeen()
            views += [seen.unproved] if seen.unproved else []
            certificate = rebuilt(folder, content, data)
            again = json.loads(json.dumps(figures_of(certificate)))
            if content["sentence"] in certificate.earlier_sentences():
                again["sentence"] = content["sentence"]
            if not of_one_program(content, again):
                said.append(
                    "figures and verdicts alone: another commit issued it, so title, source, readings and the "
                    "rows' titles are not compared"
                )
            return [
                *([seen.fault] if seen.fault else []),
                *faults_of(content, again),
                *parts_of(content).again.faults(folder, content, data),
            ]
    except (
        InputError,
        OSError,
        KeyError,
        ValueError,
        TypeError,
        IndexError,
        AttributeError,
    ) as error:
        kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        return [
            f"the certificate cannot be judged again from {FMU}, its case files and {RESPONSES}: {kind}{error}"
        ]


def _compare_file(folder: Path, name: str, wanted: str | None, found: Verification) -> None:
    path = folder / name
    if path.is_symlink():
        found.faults.append(
            f"{name}: it is a link, and a certificate's files lie in its folder; nothing else was looked at"
        )
    elif not path.is_file():
        found.faults.append(
            f"{name}: there is no such file beside {JSON}; it was removed or renamed"
        )
    elif wanted is None:
        found.faults.append(f"{name}: {JSON} has no hash of it")
    elif sha256_of(path) != wanted:
        found.faults.append(f"{name}: it is not the file that was certified: its SHA-256 differs")
    else:
        found.agreed.append(f"{name}: SHA-256")


@dataclass(kw_only=True)
class Verified(Verification):
    """A certificate with what was said of it; ``computed`` are the parts that were computed anew."""

    content: Content
    parts: Parts
    chosen: list[Any]
    computed: list[Any]
    later: tuple[str, ...]  # rows that the table had not in the version that issued the certificate

    @property
    def verdict(self) -> str:
        """The record's; what passed is incomplete where the table has more rows by now."""
        stated = str(self.content["verdict"])
        return INCOMPLETE if self.later and stated == PASSES else stated


def verified(
    place: Path,
    wanted: Sequence[Any] | None,
    executor: Callable[[list[str]], Executor],
    report: CountReport = nobody,
    *,
    every: bool = False,
    asked: Asked | None = None,
) -> Verified:
    """Verify the files of a certificate, and, if they hold, parts computed anew: by default those that count most.

    ``wanted``: no part where it is empty and ``every`` is not asked for; ``executor``: made of a worker's imports.
    ``asked``: who may have signed it; where signers are named, a certificate without a signature of theirs does not
    hold."""
    folder, content = read_certificate(place)
    parts = parts_of(content)
    chosen = (
        []
        if wanted == () and not every
        else parts.chosen(folder, content, wanted or (), every=every)
    )
    asked = asked or Asked()
    files = verify_files(folder, content)
    signature = look_at_signature(folder, content, asked)
    if signature.state is State.CHANGED:
        files.faults.append(f"signature: {signature.sentence}")
    found = Verified(
        faults=files.faults,
        agreed=files.agreed,
        content=content,
        parts=parts,
        chosen=chosen,
        computed=chosen if files.holds else [],
        later=parts.later(content),
        signatures={folder.name: signature},
        views=files.views,
        unproved=[*files.views, *views_beside(content), *_unproved(folder, content)],
    )
    if found.later:
        found.agreed.append(
            f"issued by gfor-cosim {issued_by(content)}, whose table had not "
            f"{', '.join(found.later)}: this version, {THIS}, judges {len(found.later)} more; "
            "certify anew to have that judged"
        )
    if found.computed:
        with closing(executor([parts.task.__module__])) as workers:
            again = parts.verify(folder, content, chosen, workers, report)
        found.faults, found.agreed = found.faults + again.faults, found.agreed + again.agreed
    if asked.signers is not None and signature.state in (State.UNSIGNED, State.UNKNOWN):
        found.faults.append(f"signature: {signature.sentence}")
    return found


def _unproved(folder: Path, content: Content) -> list[str]:
    """Files in the folder, and in folders in it, of which the certificate has no hash; those of a kind together."""
    known = {JSON, *content["files"], *signatures_of(folder).names()}
    found = [path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir()]
    kinds: dict[str, list[str]] = {}
    for name in sorted(path.relative_to(folder).as_posix() for path in found):
        if name not in known:
            parent, _, last = name.rpartition("/")
            kind = f"{parent}/*{Path(last).suffix}" if parent else name
            kinds.setdefault(kind, []).append(name)
    return [
        f"{names[0]}: the certificate does not cover it"
        if len(names) == 1
        else f"{kind}: {len(names)} files that the certificate does not cover"
        for kind, names in kinds.items()
    ]
