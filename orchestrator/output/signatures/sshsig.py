"""Signatures as ``ssh-keygen -Y`` writes and reads them (PROTOCOL.sshsig of OpenSSH)."""

import base64
import binascii
import hashlib
import re
from dataclasses import dataclass
from typing import Any

from orchestrator.output.signatures.public_key import PublicKey, hash_of_curve, public_key_of
from orchestrator.output.signatures.wire import Reader, WireError, packed, packed_integer

MAGIC = b"SSHSIG"
_VERSION = 1
_HASHES = ("sha256", "sha512")
_BEGIN = "-----BEGIN SSH SIGNATURE-----"
_END = "-----END SSH SIGNATURE-----"
_LINE = 70  # characters of base64 a line, as OpenSSH breaks them


@dataclass(frozen=True)
class SshSignature:
    """Who signed, for which purpose, and the signature."""

    key: PublicKey
    namespace: str
    hashed_by: str
    signature: bytes

    def to_sign(self, message: bytes) -> bytes:
        return _bytes_to_sign(self.namespace, self.hashed_by, message)

    @property
    def content(self) -> bytes:
        parts = (
            self.key.blob,
            self.namespace.encode(),
            b"",
            self.hashed_by.encode(),
            self.signature,
        )
        return MAGIC + _VERSION.to_bytes(4, "big") + b"".join(map(packed, parts))


def _bytes_to_sign(namespace: str, hashed_by: str, message: bytes) -> bytes:
    digest = hashlib.new(hashed_by, message).digest()
    parts = (namespace.encode(), b"", hashed_by.encode(), digest)
    return MAGIC + b"".join(map(packed, parts))


def read_content(content: bytes) -> SshSignature:
    """Read a signature without its armour.

    Raises
    ------
    WireError
        If it is none."""
    reader = Reader(content)
    if reader.take(len(MAGIC)) != MAGIC:
        raise WireError("it does not begin with SSHSIG")
    version = reader.number()
    if version != _VERSION:
        raise WireError(f"it is of version {version}, and {_VERSION} is known")
    blob, namespace, _, hashed_by, signature = (reader.string() for _ in range(5))
    reader.end()
    try:
        found = SshSignature(
            PublicKey(blob), namespace.decode(), hashed_by.decode("ascii"), signature
        )
    except UnicodeDecodeError as error:
        raise WireError("its namespace or hash is no text") from error
    if found.hashed_by not in _HASHES:
        raise WireError(f"its hash is {found.hashed_by}; {' or '.join(_HASHES)} is allowed")
    return found


def as_armour(content: bytes) -> str:
    text = base64.b64encode(content).decode()
    lines = [text[k : k + _LINE] for k in range(0, len(text), _LINE)]
    return "\n".join([_BEGIN, *lines, _END, ""])


def read_armour(text: str) -> bytes:
    """Read the content of an armoured signature.

    Raises
    ------
    WireError
        If it is none."""
    inside = re.fullmatch(rf"\s*{_BEGIN}\n(.*)\n{_END}\s*", text.replace("\r\n", "\n"), re.DOTALL)
    if inside is None:
        raise WireError(f"it does not stand between {_BEGIN} and {_END}")
    try:
        return base64.b64decode("".join(inside[1].split()), validate=True)
    except (binascii.Error, ValueError) as error:
        raise WireError(f"it is not in base64: {error}") from error


def sign_with(key: Any, message: bytes, namespace: str) -> bytes:
    """Sign with a private key of the library ``cryptography``: Ed25519, ECDSA or RSA."""
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415 - the extra `sign`
    from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric.utils import (  # noqa: PLC0415
        decode_dss_signature,
    )

    public = public_key_of(key)
    public.as_cryptography()  # refuses one that is too short
    content, kind = _bytes_to_sign(namespace, "sha512", message), public.kind
    if isinstance(key, rsa.RSAPrivateKey):
        kind, made = "rsa-sha2-512", key.sign(content, padding.PKCS1v15(), hashes.SHA512())
    elif isinstance(key, ec.EllipticCurvePrivateKey):
        numbers = decode_dss_signature(
            key.sign(content, ec.ECDSA(hash_of_curve(key.curve.key_size)))
        )
        made = b"".join(map(packed_integer, numbers))
    else:
        made = key.sign(content)
    signature = packed(kind.encode()) + packed(made)
    return SshSignature(public, namespace, "sha512", signature).content
