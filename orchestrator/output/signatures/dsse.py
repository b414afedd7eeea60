"""Envelopes around what is signed, as DSSE 1.0 has them: payload, its type, signatures."""

import base64
import binascii
import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from orchestrator.output.signatures.wire import WireError

IN_TOTO = "application/vnd.in-toto+json"

_PUBLIC = "publicKey"


def pae(kind: str, payload: bytes) -> bytes:
    """DSSE's pre-authentication encoding: the bytes that are signed."""
    return b"DSSEv1 %d %b %d %b" % (len(kind.encode()), kind.encode(), len(payload), payload)


@dataclass(frozen=True)
class EnvelopeSignature:
    """One signature in an envelope; ``key`` is the fingerprint of its key, a hint that nothing relies on.

    ``public`` is the line of the public key, where the signature does not hold it, as one of SSH does. DSSE lets an
    entry have more than its own, and other libraries pass over it."""

    key: str
    content: bytes
    public: str = ""

    def as_json(self) -> dict[str, str]:
        entry = {"keyid": self.key, "sig": _text(self.content)}
        return entry | {_PUBLIC: self.public} if self.public else entry


@dataclass(frozen=True)
class SignedEnvelope:
    """A content with the signatures on it."""

    kind: str
    payload: bytes
    signatures: tuple[EnvelopeSignature, ...]

    @property
    def signed(self) -> bytes:
        return pae(self.kind, self.payload)

    def as_text(self) -> str:
        content = {
            "payload": _text(self.payload),
            "payloadType": self.kind,
            "signatures": [one.as_json() for one in self.signatures],
        }
        return json.dumps(content, indent=1) + "\n"


def read_envelope(text: str) -> SignedEnvelope:
    """Read an envelope.

    Raises
    ------
    WireError
        If it is none, an entry stands twice, or it has no signature."""
    try:
        content = json.loads(text, object_pairs_hook=read_once)
        payload, kind = _bytes(content["payload"]), content["payloadType"]
        signatures = tuple(_signatures(content["signatures"]))
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise WireError(f"it is no envelope as DSSE has it: {error}") from error
    if not isinstance(kind, str):
        raise WireError("its payloadType is no text")
    if not signatures:
        raise WireError("it has no signature")
    return SignedEnvelope(kind, payload, signatures)


def _signatures(listed: Iterable[Any]) -> Iterable[EnvelopeSignature]:
    for one in listed:
        key, public = one.get("keyid", ""), one.get(_PUBLIC, "")
        if not isinstance(key, str) or not isinstance(public, str):
            raise ValueError("a keyid or a public key is no text")
        yield EnvelopeSignature(key, _bytes(one["sig"]), public)


def read_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Refuse JSON in which a key stands twice: of two readers each could read another."""
    content = dict(pairs)
    if len(content) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"{next(n for n in names if names.count(n) > 1)!r} stands twice in it")
    return content


def _text(content: bytes) -> str:
    return base64.b64encode(content).decode()


def _bytes(text: Any) -> bytes:
    if not isinstance(text, str):
        raise ValueError("a text in base64 is missing")
    try:
        return base64.b64decode(text, validate=True)
    except binascii.Error as error:
        raise ValueError(f"it is not in base64: {error}") from error
