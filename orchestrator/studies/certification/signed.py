"""The signature of a certificate: written beside it, and looked at again."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from orchestrator.core.errors import InputError
from orchestrator.core.options import Option
from orchestrator.output.signatures.allowed_signers import Signers, read_signers, read_time
from orchestrator.output.signatures.beside import NAMESPACE, Beside
from orchestrator.output.signatures.checking import (
    Signatory,
    SignatureSeen,
    State,
    check_signatures,
    worst_of,
)
from orchestrator.output.signatures.dsse import SignedEnvelope, read_once
from orchestrator.output.signatures.signing import Made
from orchestrator.output.signatures.wire import WireError
from orchestrator.studies.certification.compared import Content
from orchestrator.studies.certification.files import signatures_of
from orchestrator.studies.certification.statement import as_bytes, differences_of, statement_of

_CLOCKS = timedelta(minutes=5)
"""By so much two clocks may differ."""

_YEARS = (1980, 9998)
"""First and last year at which a signature may be asked for: those that archives and clocks have, with room for a time
zone."""

Differences = Callable[[Mapping[str, Any]], Sequence[str]]
"""Gives, of a signed statement, what it says otherwise than what lies there."""


@dataclass(frozen=True)
class Asked:
    """Who may sign, and at which time that is asked."""

    signers: Signers | None = None
    at: datetime = field(default_factory=lambda: datetime.now(UTC))

    @classmethod
    def of_files(
        cls, signers: Path | None, revoked: Path | None, at: datetime | str | None
    ) -> "Asked":
        """Read who may sign from OpenSSH's files.

        Raises
        ------
        InputError
            If a file cannot be read, ``at`` is no time, or the signers are missing to whom the others belong."""
        if signers is None:
            if revoked is not None or at is not None:
                raise InputError(
                    Option.REVOKED
                    + ", "
                    + Option.AT
                    + ": they say more of the signers of "
                    + Option.SIGNERS
                    + "; give that file as well"
                )
            return cls()
        listed = read_signers(signers, revoked)
        if at is None:
            return cls(listed)
        time = read_time(at) if isinstance(at, str) else at
        if not _YEARS[0] <= time.year <= _YEARS[1]:
            raise InputError(
                Option.AT + f" {time:%Y-%m-%d}: no certificate is of that time; give a year from "
                f"{_YEARS[0]} to {_YEARS[1]}"
            )
        return cls(listed, time.astimezone(UTC))


def sign_folder(folder: Path, content: Content, key: Path) -> Made:
    """Sign a certificate.

    Raises
    ------
    InputError
        If the key does not sign, or what others have signed is another statement."""
    return signatures_of(folder).add(as_bytes(statement_of(folder, content)), key)


def look_at_signature(folder: Path, content: Content, asked: Asked) -> SignatureSeen:
    """Say whether a certificate is signed, by whom, and whether it is what was signed."""
    found = look_beside(
        signatures_of(folder), lambda signed: differences_of(signed, folder, content), asked
    )
    late = _made_later(content, asked.at)
    if late and found.state in (State.GOOD, State.UNKNOWN):
        return SignatureSeen(State.UNKNOWN, late, found.signer, found.signatures)
    return found


def look_beside(beside: Beside, differences: Differences, asked: Asked) -> SignatureSeen:
    """Say of anything whether it is signed, by whom, and whether it is what was signed."""
    if not beside.names():
        return SignatureSeen(State.UNSIGNED, "it is not signed: nothing says who made it")
    try:
        envelope = beside.read()
        changed = differences(_statement_in(envelope))
    except WireError as error:
        return SignatureSeen(State.CHANGED, str(error))
    found = check_signatures(envelope, NAMESPACE, asked.signers, asked.at)
    if changed:
        return SignatureSeen(State.CHANGED, "; ".join(changed), signatures=found)
    least = worst_of(found)
    return SignatureSeen(least.state, _words_of(found), least.signer, found)


def _words_of(found: Sequence[Signatory]) -> str:
    """Tell of each signature; the one that decides stands first."""
    if len(found) == 1:
        return found[0].sentence
    told = [f"signature {k} of {len(found)}: {one.sentence}" for k, one in enumerate(found, 1)]
    first = found.index(worst_of(found))
    return "; ".join([told[first], *told[:first], *told[first + 1 :]])


def _statement_in(envelope: SignedEnvelope) -> dict[str, Any]:
    try:
        found = json.loads(envelope.payload, object_pairs_hook=read_once)
    except (ValueError, RecursionError) as error:
        raise WireError(f"what was signed is no JSON: {error}") from error
    if not isinstance(found, dict):
        raise WireError("what was signed is no statement")
    return found


def _made_later(content: Content, at: datetime) -> str:
    given = content.get("made")
    try:
        made = datetime.fromisoformat(str(given))
    except ValueError:
        return f"the certificate says that it was made at {given!r}, which is no time"
    made = made if made.tzinfo else made.replace(tzinfo=UTC)
    if made <= at + _CLOCKS:
        return ""
    days = [f"{time.astimezone(UTC):%Y-%m-%d %H:%M} UTC" for time in (made, at)]
    return (
        f"the certificate says that it was made on {days[0]}, and it is {days[1]}: a clock is wrong, here or where it "
        "was made, so that nothing says whether its signer was one then"
    )
