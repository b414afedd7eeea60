"""Certificates: a converter's FMU under a grid code, and whether a certificate still holds."""

from collections.abc import Iterable
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import Any

from orchestrator.core.asked import path as path_of
from orchestrator.core.asked import seen
from orchestrator.core.errors import InputError
from orchestrator.core.safe_files import made_folder
from orchestrator.core.truth import NoTruth
from orchestrator.face.api.methods import function
from orchestrator.face.api.progress import shown_progress
from orchestrator.output.report.notebook import headline, page
from orchestrator.output.results.lock import hold_folder
from orchestrator.output.signatures.checking import State
from orchestrator.output.signatures.signing import check_key
from orchestrator.studies.certification.acceptance import run_checks
from orchestrator.studies.certification.compared import Verification
from orchestrator.studies.certification.files import JSON, read_record, save, spare_another
from orchestrator.studies.certification.inside import check_target, laid_out, put_inside
from orchestrator.studies.certification.kinds import CertifyRequest, usual_folder
from orchestrator.studies.certification.signed import Asked, sign_folder
from orchestrator.studies.certification.signed_file import is_signed_alone, look_at_file
from orchestrator.studies.certification.verification import verified
from orchestrator.studies.points.study import choose_executor


class IssuedCertificate(NoTruth, ask=".verdict"):
    """A certificate in its folder. `certify` makes it.

    Attributes
    ----------
    folder
        It holds the page, the figures, the responses and the FMU; `verify` takes it.
    content
        The figures, as ``certificate.json`` has them.
    """

    def __init__(self, folder: Path, content: dict[str, Any]) -> None:
        self.folder, self.content = folder, content

    @property
    def verdict(self) -> str:
        """``passes``, ``fails`` or ``incomplete``."""
        return str(self.content["verdict"])

    @property
    def sentence(self) -> str:
        """The verdict as a sentence, with what failed or was not tested."""
        return str(self.content["sentence"])

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor certify --json`` prints, as JSON's types."""
        return self.content

    def _repr_html_(self) -> str:
        good = {"passes": True, "fails": False}.get(self.verdict)
        top = headline(f"{self.verdict}: {self.sentence}", good)
        return page(f"Certificate in {self.folder}", verdict=top)

    def __repr__(self) -> str:
        return f"<IssuedCertificate in {self.folder}: {self.verdict}>"


def _certified(request: CertifyRequest) -> IssuedCertificate:
    issue, file = request.issue(), Path(request.fmu)
    target = None if request.into is None else Path(request.into)
    if target is not None:
        check_target(file, target)
    if request.sign is not None:
        check_key(Path(request.sign))
    place = made_folder(Path(request.folder or usual_folder(file.stem, request.code)), "folder")
    spare_another(place, request.code, issue.request.fmu, issue.request.binding)
    with (
        hold_folder(place),
        shown_progress(f"Certificate, {request.code}", shown=request.progress) as report,
    ):
        with closing(
            choose_executor(request.workers, None, [issue.parts.task.__module__])
        ) as executor:
            found = issue.compute(executor, place, report)
        asked = issue.request
        found.acceptance = run_checks(asked.fmu, asked.binding, place) if request.check else None
        save(found, place)
        if request.sign is not None:
            sign_folder(place, read_record(place / JSON), Path(request.sign))
    if target is not None:
        put_inside(place, file, target)
    return IssuedCertificate(place, read_record(place / JSON))


certify = function("certify", "certification", CertifyRequest, _certified)


def verify(
    certificate: str | Path,
    anew: Iterable[float | str] | None = None,
    *,
    every: bool = False,
    workers: int | None = 1,
    signers: str | Path | None = None,
    revoked: str | Path | None = None,
    at: str | datetime | None = None,
) -> Verification:
    """Return whether a certificate still holds, and who signed it: hashes and signature, its judgement made again, and
    points or rows computed anew.

    Parameters
    ----------
    certificate
        Its folder, its ``certificate.json``, or an FMU with certificates in it, which are all verified. Of another FMU
        or a report with a signature beside it only the signature is verified.
    anew
        Line reactances [pu], or names of rows, that are computed anew; the least damped point, or the row with the
        narrowest margin and one by chance, where None; none where empty.
    every
        Compute all of them anew.
    workers
        Processes; one for each core where None.
    signers
        The file of those who may have signed it, as OpenSSH's allowed_signers; then it holds only with a good signature
        of one of them.
    revoked
        A file of keys that count no longer: public keys, one a line, or a list of ``ssh-keygen -k``.
    at
        The time at which the signers' validity is judged, as YYYYMMDD, YYYYMMDDHHMM or YYYYMMDDHHMMSS, with Z for UTC,
        or a datetime; of this machine's zone where it names none; now where None.

    Returns
    -------
    Verification
        ``holds``, with what agreed, what did not and what is ``unproved``, and ``signature``, with its ``state`` and
        ``signer``.

    Raises
    ------
    InputError
        If it is no certificate, has no such point or row, or a file of signers or keys cannot be read.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.verify("certificate", anew=()).holds  # doctest: +SKIP
    True
    >>> gfor.verify("certificate", anew=(), signers="allowed").signature.state  # doctest: +SKIP
    'good'
    >>> try:
    ...     gfor.verify("nowhere")
    ... except gfor.CosimError as error:
    ...     print(type(error).__name__)
    InputError
    """
    if isinstance(anew, str) or not isinstance(anew, Iterable | None):
        raise InputError(
            f"anew = {anew!r}; give a list of line reactances [pu], or of names of rows, such as [0.1]"
        )
    found, wanted = Verification(), None if anew is None else tuple(anew)
    file, asked = path_of(certificate, "certificate"), _signature_request(signers, revoked, at)
    if is_signed_alone(file):
        return _verify_signature(file, asked)
    with laid_out(file) as places:
        for place in places:
            one = verified(
                place,
                wanted,
                lambda imports: choose_executor(workers, None, imports),
                every=every,
                asked=asked,
            )
            prefix = f"{place.name}: " if len(places) > 1 else ""
            found.faults += [prefix + text for text in one.faults]
            found.agreed += [prefix + text for text in one.agreed]
            found.views += [prefix + text for text in one.views]
            found.unproved += [prefix + text for text in one.unproved]
            found.signatures |= one.signatures
    return found


def _signature_request(
    signers: str | Path | None, revoked: str | Path | None, at: str | datetime | None
) -> Asked:
    if not isinstance(at, str | datetime | None):
        raise InputError(
            f"at = {seen(at)}; give a time, as YYYYMMDD[HHMM[SS]][Z] or a datetime, such as '20261130Z'"
        )
    files = [
        None if given is None else path_of(given, name)
        for name, given in (("signers", signers), ("revoked", revoked))
    ]
    return Asked.of_files(files[0], files[1], at)


def _verify_signature(file: Path, asked: Asked) -> Verification:
    """Verify the signature of a file that has no figures to compute anew."""
    signature = look_at_file(file, asked)
    said = [f"signature: {signature.sentence}"]
    found = Verification(signatures={file.name: signature})
    if signature.state is State.GOOD:
        found.agreed = said
    else:
        found.faults = said
    return found
