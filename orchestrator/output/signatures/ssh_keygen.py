"""OpenSSH's own program: it signs with keys of an agent and in hardware, and checks where no library can."""

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from orchestrator.core.errors import InputError
from orchestrator.output.signatures.sshsig import as_armour, read_armour
from orchestrator.output.signatures.wire import WireError

_PROGRAM = "ssh-keygen"


def is_installed() -> bool:
    return shutil.which(_PROGRAM) is not None


def sign(key: Path, message: bytes, namespace: str) -> bytes:
    """Sign by a private key's file, or by the agent or hardware that has the private half of a public key.

    It asks for a passphrase or a touch where the key wants one.

    Raises
    ------
    InputError
        If OpenSSH does not sign; with its words."""
    done = _run(["-Y", "sign", "-q", "-f", str(key), "-n", namespace], message)
    if done.returncode != 0:
        said = " ".join(done.stderr.decode(errors="replace").split())
        raise InputError(
            f"{key}: ssh-keygen did not sign with it: {said or 'it gives no reason'}; give a private key that only "
            "you may read, with its passphrase at hand, or the public key of one that `ssh-add -l` lists"
        )
    try:
        return read_armour(done.stdout.decode("ascii"))
    except (WireError, UnicodeDecodeError) as error:
        raise InputError(f"{key}: what ssh-keygen wrote is no signature: {error}") from error


def check(content: bytes, message: bytes, namespace: str) -> bool:
    """Return whether a signature was made over a message by the key that it names, whoever that is."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "signature"
        file.write_text(as_armour(content), encoding="ascii")
        done = _run(["-Y", "check-novalidate", "-n", namespace, "-s", str(file)], message)
    return done.returncode == 0


def is_revoked(line: str, listed: Path) -> bool:
    """Return whether a revocation list in OpenSSH's own form has a public key."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / "key.pub"
        file.write_text(f"{line}\n", encoding="ascii")
        done = _run(["-Q", "-f", str(listed), str(file)], b"")
    return done.returncode != 0


def _run(words: list[str], message: bytes) -> "subprocess.CompletedProcess[bytes]":
    return subprocess.run([_PROGRAM, *words], input=message, capture_output=True, check=False)
