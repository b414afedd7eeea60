"""Signing with what engineers have: a key of SSH, also in an agent or in hardware, or a PEM key."""

import sys
from dataclasses import dataclass
from getpass import getpass
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes
from orchestrator.core.options import Option
from orchestrator.output.signatures import ssh_keygen
from orchestrator.output.signatures.dsse import EnvelopeSignature
from orchestrator.output.signatures.public_key import (
    PublicKey,
    hash_of_curve,
    public_key_of,
    require_cryptography,
)
from orchestrator.output.signatures.sshsig import MAGIC, read_content, sign_with
from orchestrator.output.signatures.wire import WireError

_OPENSSH = b"-----BEGIN OPENSSH PRIVATE KEY-----"
_PUBLIC = (b"ssh-", b"ecdsa-", b"sk-")  # begin a public key, whose private half an agent has
_MOST = 1024**2  # bytes of a file with a key


@dataclass(frozen=True)
class Made:
    """A signature with the key that made it."""

    key: PublicKey
    content: bytes

    @property
    def in_envelope(self) -> EnvelopeSignature:
        public = "" if self.content.startswith(MAGIC) else self.key.line
        return EnvelopeSignature(self.key.fingerprint, self.content, public)


def check_key(key: Path) -> None:
    """Refuse a key that cannot be read, before anything is computed.

    Raises
    ------
    InputError
        If there is no such file, or it holds no key."""
    _content(key)


def sign(key: Path, message: bytes, namespace: str) -> Made:
    """Sign a message.

    A key of SSH signs in SSH's form (SSHSIG), which ``ssh-keygen -Y verify`` reads; a PEM key signs the bytes
    themselves, as DSSE's libraries have it: Ed25519, ECDSA, or RSA with PSS.

    Raises
    ------
    InputError
        If the key cannot be read, or does not sign.
    MissingLibraryError
        If it needs ``cryptography``, the extra ``sign``."""
    content = _content(key)
    if content.startswith(_OPENSSH) or content.startswith(_PUBLIC):
        return _signed_as_ssh(key, content, message, namespace)
    require_cryptography("signing with a PEM key")
    from cryptography.hazmat.primitives.serialization import (  # noqa: PLC0415 - the extra `sign`
        load_pem_private_key,
    )

    private = _loaded(key, content, load_pem_private_key)
    return Made(public_key_of(private), _sign_plain(private, message))


def _content(key: Path) -> bytes:
    try:
        content = read_bytes(key, _MOST).lstrip()
    except OSError as error:
        raise InputError(
            Option.SIGN
            + f" {key}: the key cannot be read: {error.strerror}; a key that is lost cannot "
            "be had again: make a new one (`ssh-keygen -t ed25519`), and have its public "
            "half entered where signers are known"
        ) from error
    begins = (_OPENSSH, *_PUBLIC, b"-----BEGIN ")
    if not content.startswith(begins) or b"PUBLIC KEY-----" in content or b"BEGIN CERT" in content:
        raise InputError(
            Option.SIGN
            + f" {key}: it holds no private key of OpenSSH or PEM; give the file without "
            ".pub, or the public key of one that the agent has"
        )
    return content


def _signed_as_ssh(key: Path, content: bytes, message: bytes, namespace: str) -> Made:
    if ssh_keygen.is_installed():
        made = ssh_keygen.sign(key, message, namespace)
        return Made(read_content(made).key, made)
    if not content.startswith(_OPENSSH):
        raise InputError(
            Option.SIGN
            + f" {key}: it is a public key, whose private half the agent has; ssh-keygen "
            "asks the agent, and is not installed"
        )
    require_cryptography("signing without ssh-keygen")
    from cryptography.hazmat.primitives.serialization import (  # noqa: PLC0415
        load_ssh_private_key,
    )

    private = _loaded(key, content, load_ssh_private_key)
    try:
        return Made(public_key_of(private), sign_with(private, message, namespace))
    except WireError as error:
        raise InputError(Option.SIGN + f" {key}: {error}") from error


def _loaded(key: Path, content: bytes, load: Any) -> Any:
    """A private key; a passphrase is asked for on a terminal."""
    try:
        return load(content, None)
    except TypeError as error:
        if not sys.stdin.isatty():
            raise InputError(
                Option.SIGN
                + f" {key}: it has a passphrase, and there is no terminal to ask for it; give a "
                "key of an agent"
            ) from error
    except Exception as error:
        raise InputError(
            Option.SIGN + f" {key}: it cannot be read as a private key: {error}"
        ) from error
    try:
        return load(content, getpass(f"Passphrase of {key}: ").encode())
    except Exception as error:
        raise InputError(Option.SIGN + f" {key}: it cannot be opened: {error}") from error


def _sign_plain(key: Any, message: bytes) -> bytes:
    from cryptography.hazmat.primitives import hashes  # noqa: PLC0415
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519, padding, rsa  # noqa: PLC0415

    if isinstance(key, ed25519.Ed25519PrivateKey):
        return key.sign(message)
    if isinstance(key, ec.EllipticCurvePrivateKey):
        return key.sign(message, ec.ECDSA(hash_of_curve(key.curve.key_size)))
    if isinstance(key, rsa.RSAPrivateKey):
        salt = padding.PSS(padding.MGF1(hashes.SHA256()), padding.PSS.DIGEST_LENGTH)
        return key.sign(message, salt, hashes.SHA256())
    raise InputError(
        Option.SIGN + f": a key of the kind {type(key).__name__} signs no certificate; give "
        "Ed25519, ECDSA or RSA"
    )
