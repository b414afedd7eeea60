"""Public keys as OpenSSH writes them, and whether one of them made a signature."""

import base64
import binascii
import hashlib
from dataclasses import dataclass, field
from typing import Any

from fmus.toolchain.extras import require
from orchestrator.output.signatures.wire import Reader, WireError, packed

_CURVES = {"nistp256": "SECP256R1", "nistp384": "SECP384R1", "nistp521": "SECP521R1"}
_HASH_OF_CURVE = {"nistp256": "SHA256", "nistp384": "SHA384", "nistp521": "SHA512"}
_HASH_OF_RSA = {"rsa-sha2-256": "SHA256", "rsa-sha2-512": "SHA512"}
"""RSA with SHA-1, ``ssh-rsa`` as a signature, is left out, as OpenSSH leaves it out."""

LEAST_RSA = 2048
"""Bits of an RSA key whose signatures count (NIST SP 800-131A); shorter ones can be broken."""

_HARDWARE = {
    "sk-ssh-ed25519@openssh.com": "ssh-ed25519",
    "sk-ecdsa-sha2-nistp256@openssh.com": "ecdsa-sha2-nistp256",
}
"""Kinds of keys in hardware, and of the key inside of each."""

_PRESENT = 0x01  # flag of a hardware key's signature: somebody touched it


@dataclass(frozen=True)
class PublicKey:
    """A public key; two are the same where their bytes are."""

    blob: bytes = field(repr=False)

    @classmethod
    def of_text(cls, kind: str, text: str) -> "PublicKey":
        """Read the two words of a line, such as ``ssh-ed25519 AAAA…``.

        Raises
        ------
        WireError
            If they are no public key."""
        try:
            key = cls(base64.b64decode(text, validate=True))
        except (binascii.Error, ValueError) as error:
            raise WireError(f"the key is not in base64: {error}") from error
        if key.kind != kind:
            raise WireError(f"the key is said to be {kind}, and is {key.kind}")
        return key

    @property
    def kind(self) -> str:
        try:
            return Reader(self.blob).string().decode("ascii")
        except UnicodeDecodeError as error:
            raise WireError("the kind of the key is no text") from error

    @property
    def is_certificate(self) -> bool:
        return "-cert-" in self.kind

    @property
    def fingerprint(self) -> str:
        """``SHA256:…`` as ``ssh-keygen -l`` shows it."""
        digest = hashlib.sha256(self.blob).digest()
        return f"SHA256:{base64.b64encode(digest).decode().rstrip('=')}"

    @property
    def line(self) -> str:
        return f"{self.kind} {base64.b64encode(self.blob).decode()}"

    def verifies(self, signature: bytes, signed: bytes) -> bool:
        """Return whether this key made a signature as SSH lays it out: its kind, and its bytes."""
        from cryptography.exceptions import InvalidSignature  # noqa: PLC0415 - the extra `sign`

        try:
            _check(self, signature, signed)
        except (InvalidSignature, WireError, ValueError):
            return False
        return True

    def verifies_plain(self, signature: bytes, signed: bytes) -> bool:
        """Return whether this key made a signature as DSSE's libraries lay it out, without SSH's form."""
        from cryptography.exceptions import InvalidSignature  # noqa: PLC0415

        try:
            _check_plain(self.as_cryptography(), signature, signed)
        except (InvalidSignature, WireError, ValueError):
            return False
        return True

    def as_cryptography(self) -> Any:
        """The key of the library ``cryptography``.

        Raises
        ------
        WireError
            If it is of another kind, or too short."""
        from cryptography.exceptions import UnsupportedAlgorithm  # noqa: PLC0415
        from cryptography.hazmat.primitives.asymmetric.rsa import RSAPublicKey  # noqa: PLC0415
        from cryptography.hazmat.primitives.serialization import (  # noqa: PLC0415
            load_ssh_public_key,
        )

        try:
            key = load_ssh_public_key(_without_hardware(self).line.encode())
        except (UnsupportedAlgorithm, ValueError) as error:
            raise WireError(f"a key of the kind {self.kind} cannot be read: {error}") from error
        if isinstance(key, RSAPublicKey) and key.key_size < LEAST_RSA:
            raise WireError(f"an RSA key of {key.key_size} bits; at least {LEAST_RSA} are needed")
        return key


def public_key_of(key: Any) -> PublicKey:
    """The public half of a key of the library ``cryptography``, private or public."""
    from cryptography.hazmat.primitives.serialization import (  # noqa: PLC0415
        Encoding,
        PublicFormat,
    )

    public = key.public_key() if hasattr(key, "public_key") else key
    kind, text = public.public_bytes(Encoding.OpenSSH, PublicFormat.OpenSSH).decode().split()[:2]
    return PublicKey.of_text(kind, text)


def require_cryptography(purpose: str) -> None:
    require(purpose, "cryptography")


def _without_hardware(key: PublicKey) -> PublicKey:
    inner = _HARDWARE.get(key.kind)
    if inner is None:
        return key
    reader = Reader(key.blob)
    reader.string()
    parts = [reader.string() for _ in range(1 if inner == "ssh-ed25519" else 2)]
    reader.string()  # the application, such as ``ssh:``
    reader.end()
    return PublicKey(packed(inner.encode()) + b"".join(map(packed, parts)))


def _check(key: PublicKey, signature: bytes, signed: bytes) -> None:
    reader = Reader(signature)
    kind, content = reader.string().decode("ascii"), reader.string()
    if key.kind in _HARDWARE:
        signed = _signed_by_hardware(key, reader, signed)
    reader.end()
    wanted = {kind, "ssh-rsa"} if kind in _HASH_OF_RSA else {kind}
    if key.kind not in wanted:
        raise WireError(f"a signature of the kind {kind} is not by a key of the kind {key.kind}")
    _check_content(key, kind, content, signed)


def _signed_by_hardware(key: PublicKey, reader: Reader, signed: bytes) -> bytes:
    """Return what the hardware signs: its application, whether somebody touched it, its counter, and the message."""
    flags, counter = reader.take(1), reader.take(4)
    if not flags[0] & _PRESENT:
        raise WireError("nobody touched the hardware key while it signed")
    own = Reader(key.blob)
    own.string()
    for _ in range(1 if _HARDWARE[key.kind] == "ssh-ed25519" else 2):
        own.string()
    application = hashlib.sha256(own.string()).digest()
    return application + flags + counter + hashlib.sha256(signed).digest()


def _check_content(key: PublicKey, kind: str, content: bytes, signed: bytes) -> None:
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric import ec, padding  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric.utils import (  # noqa: PLC0415
        encode_dss_signature,
    )

    known = key.as_cryptography()
    if kind in _HASH_OF_RSA:
        known.verify(content, signed, padding.PKCS1v15(), getattr(hashes, _HASH_OF_RSA[kind])())
    elif "ecdsa" in kind:
        numbers = Reader(content)
        r, s = numbers.integer(), numbers.integer()
        numbers.end()
        curve = next(name for name in _CURVES if name in kind)
        known.verify(
            encode_dss_signature(r, s), signed, ec.ECDSA(getattr(hashes, _HASH_OF_CURVE[curve])())
        )
    elif "ed25519" in kind:
        known.verify(content, signed)
    else:
        raise WireError(f"a signature of the kind {kind} is not known")


def _check_plain(key: Any, signature: bytes, signed: bytes) -> None:
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa  # noqa: PLC0415

    if isinstance(key, rsa.RSAPublicKey):
        how = padding.PSS(padding.MGF1(hashes.SHA256()), padding.PSS.AUTO)
        key.verify(signature, signed, how, hashes.SHA256())
    elif isinstance(key, ec.EllipticCurvePublicKey):
        key.verify(signature, signed, ec.ECDSA(hash_of_curve(key.curve.key_size)))
    else:
        key.verify(signature, signed)


def hash_of_curve(bits: int) -> Any:
    """The hash that goes with a NIST curve of so many bits (FIPS 186-5, RFC 5656)."""
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415

    return getattr(hashes, _HASH_OF_CURVE[f"nistp{bits}"])()
