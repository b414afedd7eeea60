"""Where the files of signatures lie: beside what is signed, as DSSE's libraries and as ssh-keygen read them."""

from dataclasses import dataclass
from pathlib import Path

from orchestrator.core.errors import InputError
from orchestrator.core.foreign_files import read_bytes, read_text
from orchestrator.core.safe_files import write_bytes, write_text
from orchestrator.output.signatures.dsse import IN_TOTO, SignedEnvelope, read_envelope
from orchestrator.output.signatures.signing import Made, sign
from orchestrator.output.signatures.sshsig import MAGIC, as_armour
from orchestrator.output.signatures.wire import WireError

NAMESPACE = "certificate@gfor-cosim"
"""For what SSH's signatures are made, so that one of something else is none of ours."""


@dataclass(frozen=True)
class Beside:
    """The files of the signatures of one thing; ``stem`` begins their names."""

    folder: Path
    stem: str

    @property
    def envelope(self) -> str:
        """Name of DSSE's envelope."""
        return f"{self.stem}.intoto.json"

    @property
    def signed(self) -> str:
        """Name of the file with the bytes that are signed."""
        return f"{self.stem}.pae"

    def names(self) -> list[str]:
        """Names of the files that are there, links among them."""
        armoured = sorted(path.name for path in self.folder.glob(f"{self.signed}*.sig"))
        paths = [self.folder / name for name in (self.envelope, self.signed, *armoured)]
        return [path.name for path in paths if path.is_symlink() or path.is_file()]

    def remove(self) -> None:
        """Take the signatures of an earlier content away."""
        for name in self.names():
            (self.folder / name).unlink()

    def read(self) -> SignedEnvelope:
        """Read the envelope.

        Raises
        ------
        WireError
            If it is none, or one of its files is a link or not that of the envelope: whoever checks that file would
            check something else."""
        names = self.names()
        if self.envelope not in names:
            raise WireError(f"{self.envelope} is missing, and {', '.join(names)} is there")
        linked = [name for name in names if (self.folder / name).is_symlink()]
        if linked:
            raise WireError(f"{', '.join(linked)}: a link is no signature's file")
        try:
            found = read_envelope(read_text(self.folder / self.envelope))
        except UnicodeDecodeError as error:
            raise WireError(f"{self.envelope}: it is no text") from error
        if found.kind != IN_TOTO:
            raise WireError(f"{self.envelope}: it holds {found.kind!r}, and not {IN_TOTO}")
        wanted = self._further(found)
        apart = [name for name in wanted if name not in names]
        for name in names:
            if name != self.envelope and read_bytes(self.folder / name) != wanted.get(name):
                apart.append(name)
        if apart:
            raise WireError(f"{', '.join(sorted(apart))}: not as {self.envelope} has it")
        return found

    def _further(self, envelope: SignedEnvelope) -> dict[str, bytes]:
        """Return what ssh-keygen reads: the bytes that are signed, and each signature of an SSH key."""
        own = [one.content for one in envelope.signatures if one.content.startswith(MAGIC)]
        names = (f"{self.signed}.sig", *(f"{self.signed}.{k}.sig" for k in range(2, len(own) + 1)))
        armoured = {name: as_armour(one).encode() for name, one in zip(names, own, strict=False)}
        return {self.signed: envelope.signed, **armoured}

    def add(self, payload: bytes, key: Path) -> Made:
        """Sign; signatures of the same by other keys stay.

        Raises
        ------
        InputError
            If the key does not sign, or what others have signed is something else."""
        envelope = self._there(payload) if self.names() else SignedEnvelope(IN_TOTO, payload, ())
        made = sign(key, envelope.signed, NAMESPACE)
        others = tuple(one for one in envelope.signatures if one.key != made.key.fingerprint)
        whole = SignedEnvelope(IN_TOTO, payload, (*others, made.in_envelope))
        self.remove()
        for name, content in self._further(whole).items():
            write_bytes(self.folder / name, content)
        write_text(self.folder / self.envelope, whole.as_text())
        return made

    def _there(self, payload: bytes) -> SignedEnvelope:
        remedy = (
            f"take {self.envelope} and {self.signed}* away, and have all of its signers sign anew"
        )
        try:
            found = self.read()
        except WireError as error:
            raise InputError(f"{self.folder}: {error}; {remedy}") from error
        if found.payload != payload:
            raise InputError(
                f"{self.folder / self.envelope}: what was signed is not what is there now, which was changed since; "
                f"{remedy}"
            )
        return found
