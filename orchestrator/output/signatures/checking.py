"""Who signed an envelope, and whether one of those who may."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from importlib.util import find_spec
from typing import Any

from fmus.toolchain.extras import MissingLibraryError
from orchestrator.output.signatures import ssh_keygen
from orchestrator.output.signatures.allowed_signers import AllowedSigner, Signers, Standing
from orchestrator.output.signatures.dsse import EnvelopeSignature, SignedEnvelope
from orchestrator.output.signatures.public_key import PublicKey, require_cryptography
from orchestrator.output.signatures.sshsig import MAGIC, read_content
from orchestrator.output.signatures.wire import WireError


class State(StrEnum):
    """The worth of a signature."""

    GOOD = "good"
    UNSIGNED = "unsigned"
    CHANGED = "changed"
    UNKNOWN = "unknown signer"


@dataclass(frozen=True)
class Signatory:
    """One signature: its state, whose it is by the file of signers, its key's fingerprint, and a sentence."""

    state: State
    signer: str | None
    key: str
    sentence: str

    def as_json(self) -> dict[str, str | None]:
        return {
            "state": self.state,
            "signer": self.signer,
            "key": self.key,
            "sentence": self.sentence,
        }


@dataclass(frozen=True)
class SignatureSeen:
    """The signatures of a certificate, looked at."""

    state: State
    sentence: str
    signer: str | None = None
    signatures: Sequence[Signatory] = ()

    def as_json(self) -> dict[str, Any]:
        return {
            "state": self.state,
            "signer": self.signer,
            "sentence": self.sentence,
            "signatures": [one.as_json() for one in self.signatures],
        }


def check_signatures(
    envelope: SignedEnvelope, namespace: str, signers: Signers | None, at: datetime
) -> list[Signatory]:
    """Say of each signature whose it is."""
    return [
        _ssh(envelope, one, namespace, signers, at)
        if one.content.startswith(MAGIC)
        else _plain(envelope, one, namespace, signers, at)
        for one in envelope.signatures
    ]


def _ssh(
    envelope: SignedEnvelope,
    one: EnvelopeSignature,
    namespace: str,
    signers: Signers | None,
    at: datetime,
) -> Signatory:
    try:
        found = read_content(one.content)
        known = found.key.kind
    except WireError as error:
        return Signatory(State.CHANGED, None, one.key, f"the signature is damaged: {error}")
    key = found.key.fingerprint
    if found.key.is_certificate:
        words = f"it is signed with SSH's certificate ({known}), which gfor does not follow; ssh-keygen -Y verify does"
        return Signatory(State.UNKNOWN, None, key, words)
    if found.namespace != namespace:
        words = (
            f"the signature was made for {found.namespace!r}, and that of a certificate is made for "
            f"{namespace!r}: it is one of something else"
        )
        return Signatory(State.CHANGED, None, key, words)
    if not _is_made(found.key, found.signature, found.to_sign(envelope.signed), one, envelope):
        return Signatory(State.CHANGED, None, key, _NOT_MADE.format(key=key))
    return _by_signers(found.key, namespace, signers, at)


_NOT_MADE = "the signature by the key {key} is not one of these bytes: they or it were changed"


def _is_made(
    key: PublicKey,
    signature: bytes,
    signed: bytes,
    one: EnvelopeSignature,
    envelope: SignedEnvelope,
) -> bool:
    if find_spec("cryptography") is not None:
        return key.verifies(signature, signed)
    if ssh_keygen.is_installed():
        return ssh_keygen.check(one.content, envelope.signed, read_content(one.content).namespace)
    raise MissingLibraryError(
        "checking a signature needs ssh-keygen or cryptography, and neither is installed; install OpenSSH, or "
        "`pip install 'gfor-cosim[sign]'`"
    )


def _plain(
    envelope: SignedEnvelope,
    one: EnvelopeSignature,
    namespace: str,
    signers: Signers | None,
    at: datetime,
) -> Signatory:
    """Check a signature without SSH's form, which does not hold its key: the envelope or the signers' file has to."""
    own = [] if signers is None else [line.key for line in signers.lines]
    try:
        named = _named_key(one, own)
    except WireError as error:
        return Signatory(State.CHANGED, None, one.key, f"the signature is damaged: {error}")
    keys = own if named is None else [named]
    if keys:
        require_cryptography("checking a PEM key's signature")
    made = [key for key in keys if key.verifies_plain(one.content, envelope.signed)]
    if made:
        return _by_signers(made[0], namespace, signers, at)
    if named is not None:
        key = named.fingerprint
        return Signatory(State.CHANGED, None, key, _NOT_MADE.format(key=key))
    words = (
        f"it names the key {one.key}, which is not at hand, so that nobody here can say whether that made the "
        f"signature: it counts for nothing; {_ASK}"
    )
    return Signatory(State.UNKNOWN, None, one.key, words)


def _named_key(one: EnvelopeSignature, known: Sequence[PublicKey]) -> PublicKey | None:
    """Return the key that the envelope holds, or else the known one whose fingerprint it names.

    Raises
    ------
    WireError
        If what the envelope holds is no public key."""
    if one.public:
        kind, _, text = one.public.partition(" ")
        return PublicKey.of_text(kind, text)
    return next((key for key in known if key.fingerprint == one.key), None)


_ASK = "ask the signer for the public key by another way, and enter it into the file of --signers"


def _by_signers(key: PublicKey, namespace: str, signers: Signers | None, at: datetime) -> Signatory:
    print_of_key = key.fingerprint
    if signers is None:
        words = f"it is signed by the key {print_of_key}, and nothing says whose that is; give --signers"
        return Signatory(State.UNKNOWN, None, print_of_key, words)
    standing, line = signers.find(key, namespace, at)
    words = _WORDS[standing].format(key=print_of_key, **_words_of(line, signers, at))
    state = State.GOOD if standing is Standing.ALLOWED else State.UNKNOWN
    return Signatory(state, None if line is None else line.principals, print_of_key, words)


_WORDS = {
    Standing.ALLOWED: "signed by {signer} with the key {key}, known from {place}",
    Standing.UNKNOWN: f"it is signed by the key {{key}}, whom {{place}} does not name; {_ASK}",
    Standing.REVOKED: (
        "it is signed by the key {key} of {signer}, which {revoked} revokes: whoever has it may be another; have the "
        "certificate signed anew"
    ),
    Standing.EXPIRED: (
        "the key {key} of {signer} expired on {before}, and it is {at}: a signature does not say when it was made. "
        "Have it signed anew, or, if you know from elsewhere when it was, give that time with --at"
    ),
    Standing.NOT_YET: (
        "the key {key} of {signer} is valid from {after} on, and it is {at}: either this machine's clock is wrong, or "
        "the file of signers"
    ),
    Standing.ANOTHER_PURPOSE: (
        "the key {key} of {signer} may sign for {namespaces} only, and not certificates, by {place}"
    ),
    Standing.AUTHORITY: (
        "the key {key} of {signer} is one of an authority by {place}: it may sign certificates of SSH's keys, and "
        "nothing itself"
    ),
}


def _words_of(line: AllowedSigner | None, signers: Signers, at: datetime) -> dict[str, str]:
    revoked = signers.revoked.place if signers.revoked is not None else ""
    named = {"place": str(signers.place), "at": _day(at), "revoked": str(revoked)}
    if line is None:
        return named | {"signer": "nobody that is named"}
    return named | {
        "signer": line.principals,
        "after": _day(line.after),
        "before": _day(line.before),
        "namespaces": str(line.namespaces),
    }


def _day(time: datetime | None) -> str:
    return "" if time is None else f"{time:%Y-%m-%d %H:%M}"


_WORST = (State.CHANGED, State.GOOD, State.UNKNOWN)
"""Of several signatures: a bad one tells that somebody was at it; of the others one that is known is enough."""


def worst_of(found: Sequence[Signatory]) -> Signatory:
    return min(found, key=lambda one: _WORST.index(one.state))
