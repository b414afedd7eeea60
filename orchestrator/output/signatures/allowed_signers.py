"""Who may sign: a file as OpenSSH has it (section ALLOWED SIGNERS of ssh-keygen's manual)."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from fnmatch import fnmatchcase
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes, read_text
from orchestrator.core.options import Option
from orchestrator.output.signatures import ssh_keygen
from orchestrator.output.signatures.public_key import PublicKey
from orchestrator.output.signatures.wire import WireError

_FORMS = {
    len(shape): form
    for shape, form in (
        ("YYYYMMDD", "%Y%m%d"),
        ("YYYYMMDDHHMM", "%Y%m%d%H%M"),
        ("YYYYMMDDHHMMSS", "%Y%m%d%H%M%S"),
    )
}
_WORD = re.compile(r'(?:[^\s"]|"[^"]*")+')
_OPTION = re.compile(r'(?P<name>[a-zA-Z-]+)(?:=(?P<value>"[^"]*"|[^",]*))?(?:,|$)')
_KINDS = re.compile(r"(ssh|ecdsa|sk)-[a-z0-9@.-]+")
_KRL = b"SSHKRL\n\x00"  # begins a revocation list in OpenSSH's own form


class Standing(StrEnum):
    """The standing of a key by a file of allowed signers."""

    ALLOWED = "allowed"
    UNKNOWN = "unknown"
    REVOKED = "revoked"
    EXPIRED = "expired"
    NOT_YET = "not yet valid"
    ANOTHER_PURPOSE = "for another purpose"
    AUTHORITY = "only an authority"


@dataclass(frozen=True)
class AllowedSigner:
    """A line of the file."""

    principals: str
    key: PublicKey
    namespaces: str | None = None
    after: datetime | None = None
    before: datetime | None = None
    is_authority: bool = False

    def standing(self, namespace: str, at: datetime) -> Standing:
        if self.is_authority:
            return Standing.AUTHORITY
        if self.namespaces is not None and not _matches(self.namespaces, namespace):
            return Standing.ANOTHER_PURPOSE
        if self.after is not None and at < self.after:
            return Standing.NOT_YET
        if self.before is not None and at > self.before:
            return Standing.EXPIRED
        return Standing.ALLOWED


@dataclass(frozen=True)
class Signers:
    """Who may sign, and which keys are revoked."""

    place: Path
    lines: Sequence[AllowedSigner]
    revoked: "Revoked | None" = None

    def find(
        self, key: PublicKey, namespace: str, at: datetime
    ) -> tuple[Standing, AllowedSigner | None]:
        """Return what is said of a key, and the line that says it; one line that allows it is enough."""
        own = [line for line in self.lines if line.key == key]
        if self.revoked is not None and self.revoked.has(key):
            return Standing.REVOKED, own[0] if own else None
        said = [(line.standing(namespace, at), line) for line in own]
        allowed = [one for one in said if one[0] is Standing.ALLOWED]
        return next(iter([*allowed, *said]), (Standing.UNKNOWN, None))


@dataclass(frozen=True)
class Revoked:
    """Keys that count no longer: by lines of text, or by a list of OpenSSH's own form."""

    place: Path
    keys: frozenset[PublicKey] = frozenset()
    fingerprints: frozenset[str] = frozenset()
    of_openssh: bool = field(default=False, kw_only=True)

    def has(self, key: PublicKey) -> bool:
        if self.of_openssh:
            return ssh_keygen.is_revoked(key.line, self.place)
        return key in self.keys or key.fingerprint in self.fingerprints


def read_signers(path: Path, revoked: Path | None = None) -> Signers:
    """Read who may sign.

    Raises
    ------
    InputError
        If a file cannot be read, or a line is not as OpenSSH has it."""
    lines = [_read_line(path, k, words) for k, words in _lines(path, Option.SIGNERS)]
    if not lines:
        raise InputError(
            Option.SIGNERS + f" {path}: it names nobody; write a line for each signer, such as "
            "`lab@example.org ssh-ed25519 AAAA…`, with the public key from its owner"
        )
    return Signers(path, lines, None if revoked is None else read_revoked(revoked))


def read_revoked(path: Path) -> Revoked:
    try:
        head = read_bytes(path)[: len(_KRL)]
    except OSError as error:
        raise InputError(
            Option.REVOKED + f" {path}: it cannot be read: {error.strerror}"
        ) from error
    if head == _KRL:
        if not ssh_keygen.is_installed():
            raise InputError(
                Option.REVOKED
                + f" {path}: it is a list of OpenSSH's own form, which ssh-keygen reads, and "
                "that is not installed; install OpenSSH, or write the public keys into a "
                "text, one a line"
            )
        return Revoked(path, of_openssh=True)
    keys, fingerprints = set(), set()
    for number, words in _lines(path, Option.REVOKED):
        if words[0].startswith("SHA256:"):
            fingerprints.add(words[0])
        else:
            keys.add(_read_key((Option.REVOKED + f" {path}, line {number}"), words))
    return Revoked(path, frozenset(keys), frozenset(fingerprints))


def _lines(path: Path, option: str) -> Iterator[tuple[int, list[str]]]:
    try:
        text = read_text(path)
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise InputError(option + f" {path}: it cannot be read: {why}") from error
    for number, line in enumerate(text.splitlines(), start=1):
        words = _WORD.findall(line)
        if words and not words[0].startswith("#"):
            yield number, words


def _read_line(path: Path, number: int, words: list[str]) -> AllowedSigner:
    place = Option.SIGNERS + f" {path}, line {number}"
    principals, *rest = words
    if _KINDS.fullmatch(principals):
        raise InputError(
            place
            + f": it begins with the key's kind, {principals}; write the signer's name before it, such as "
            "lab@example.org"
        )
    options = ""
    if rest and not _KINDS.fullmatch(rest[0]):
        options, *rest = rest
    given = dict(_read_options(place, options))
    return AllowedSigner(
        principals.strip('"'),
        _read_key(place, rest),
        given.get("namespaces"),
        _read_time(place, given.get("valid-after")),
        _read_time(place, given.get("valid-before")),
        "cert-authority" in given,
    )


def _read_options(place: str, text: str) -> Iterator[tuple[str, str]]:
    known = ("cert-authority", "namespaces", "valid-after", "valid-before")
    end, seen = 0, set[str]()
    while end < len(text):
        option = _OPTION.match(text, end)
        name = option["name"].lower() if option else ""
        if option is None or name not in known:
            raise InputError(
                place + f": {text[end:]!r} is no option; there are: {', '.join(known)}"
            )
        if name in seen:  # OpenSSH refuses it too: whichever holds, the other is a mistake
            raise InputError(place + f": {name} stands there twice; leave one of them")
        seen.add(name)
        yield name, (option["value"] or "").strip('"')
        end = option.end()


def _read_key(place: str, words: Sequence[str]) -> PublicKey:
    if len(words) < 2 or not _KINDS.fullmatch(words[0]):
        raise InputError(
            place
            + ": it has no public key; write its kind and its text as in the owner's file .pub, such as "
            "`ssh-ed25519 AAAA…` (of a PEM key: `ssh-keygen -i -m PKCS8 -f public.pem`)"
        )
    try:
        return PublicKey.of_text(words[0], words[1])
    except WireError as error:
        raise InputError(place + f": {error}") from error


def _read_time(place: str, text: str | None) -> datetime | None:
    """A time as OpenSSH has it: of this machine's zone unless a Z follows."""
    if text is None:
        return None
    digits = text.removesuffix("Z")
    try:
        time = datetime.strptime(digits, _FORMS[len(digits)])
        return time.replace(tzinfo=UTC) if text.endswith("Z") else time.astimezone()
    except (KeyError, ValueError, OverflowError) as error:
        raise InputError(
            place + f": {text!r} is no time; write YYYYMMDD or YYYYMMDDHHMM[SS], with Z for UTC"
        ) from error


def read_time(text: str) -> datetime:
    """Read the value of ``--at``."""
    time = _read_time(Option.AT, text)
    assert time is not None
    return time


def _matches(patterns: str, text: str) -> bool:
    """Match a list of patterns: one that begins with ! and fits forbids."""
    names = [name.strip() for name in patterns.split(",")]
    denied = [name[1:] for name in names if name.startswith("!")]
    allowed = [name for name in names if not name.startswith("!")]
    return any(_fits(text, name) for name in allowed) and not any(_fits(text, n) for n in denied)


def _fits(text: str, pattern: str) -> bool:
    return fnmatchcase(text, pattern.replace("[", "[[]"))
