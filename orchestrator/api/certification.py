"""Certificates: a converter's FMU under a grid code, and whether a certificate still holds."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orchestrator.api.progress import shown_progress
from orchestrator.asked import number_in
from orchestrator.asked import path as path_of
from orchestrator.cases.given import binding_path, plain
from orchestrator.errors import InputError
from orchestrator.points.study import choose_executor
from orchestrator.results.lock import held
from orchestrator.safe_files import made_folder

if TYPE_CHECKING:
    from orchestrator.certification.compared import Verification


class IssuedCertificate:
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

    def __repr__(self) -> str:
        return f"<IssuedCertificate in {self.folder}: {self.verdict}>"


def certify(
    fmu: str | Path, code: str = "nts631", *, binding: str | Path | None = None,
    values: Mapping[str, Any] | None = None, declared: Mapping[str, float] | None = None, pod: str | None = None,
    reactances: Sequence[float] | None = None, black_box: bool = False, check: bool = True,
    folder: str | Path | None = None, into: str | Path | None = None, workers: int | None = 1, progress: bool = False,
) -> IssuedCertificate:  # fmt: skip
    """Test a converter's FMU under a grid code, and write its certificate.

    Parameters
    ----------
    fmu
        The converter.
    code
        ``"nts631"``, the damping test, or another that ``gfor certify --code`` names, with a verdict.
    binding
        File that says what the FMU's variables mean at our port.
    values
        Of the converter, such as ``{"pod_p.K": 150}``; or of the damping test's study, which makes it another test.
    declared
        What the applicant declares, for codes that compare the converter with that.
    pod
        Active damping controllers, ``"none"``, ``"p"``, ``"q"`` or ``"pq"``; as the FMU shows them by default.
    reactances
        Line reactances of the damping test [pu]; the norm's 13 by default, less is incomplete.
    black_box
        Do not use the converter's states for the modes, even if it shows them.
    check
        Whether the acceptance tests of the FMU are run.
    folder
        For the certificate; ``results/certify_<file>[_<code>]`` by default. Points that are there are kept.
    into
        Where the FMU is written with the certificate in it, and with experiments that any tool can repeat.
    workers
        Processes; one for each core where None.
    progress
        Whether a bar is shown.

    Raises
    ------
    InputError
        If there is no such code, or the FMU, the binding or a value cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.certify("vendor.fmu", "miso", folder="certificate").verdict  # doctest: +SKIP
    'passes'
    >>> gfor.certify("vendor.fmu", "misa")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    orchestrator.errors.InputError: code = 'misa'; choose from nts631, miso, ...
    """
    from orchestrator.certification.acceptance import run_checks  # noqa: PLC0415 - `verify` computes less
    from orchestrator.certification.codes.all_codes import NTS631  # noqa: PLC0415 - as above
    from orchestrator.certification.files import JSON, read_record, save  # noqa: PLC0415 - as above
    from orchestrator.certification.inside import check_target, put_inside  # noqa: PLC0415 - as above
    from orchestrator.certification.kinds import WITH_VERDICT, issue_of  # noqa: PLC0415 - as above
    from orchestrator.certification.request import PODS, REACTANCES  # noqa: PLC0415 - as above

    if code not in WITH_VERDICT:
        raise InputError(f"code = {code!r}; choose from {', '.join(WITH_VERDICT)}")
    if pod is not None and pod not in PODS:
        raise InputError(f"pod = {pod!r}; choose from {', '.join(PODS)}")
    file, given = path_of(fmu, "fmu"), plain(values)
    target = None if into is None else path_of(into, "into")
    rule = "line reactances in pu, such as (0.1, 0.2)"
    if isinstance(reactances, str) or not isinstance(reactances, Iterable | None):
        raise InputError(f"reactances = {reactances!r}; give {rule}")
    chosen = REACTANCES if reactances is None else tuple(number_in(x, "pu", "reactances", rule) for x in reactances)
    issue = issue_of(code, file, binding_path(binding), given, declared=plain(declared, "declared"), pod=pod,
                     reactances=chosen, black_box=black_box)  # fmt: skip
    if target is not None:
        check_target(file, target)
    usual = Path("results") / f"certify_{file.stem}{'' if code == NTS631 else f'_{code}'}"
    place = made_folder(usual if folder is None else path_of(folder, "folder", "folder"), "folder")
    with held(place), shown_progress(f"Certificate, {code}", shown=progress) as report:
        with closing(choose_executor(workers, None, [issue.parts.task.__module__])) as executor:
            found = issue.compute(executor, place, report)
        found.acceptance = run_checks(issue.request.fmu, issue.request.binding, place) if check else None
        save(found, place)
    if target is not None:
        put_inside(place, file, target)
    return IssuedCertificate(place, read_record(place / JSON))


def verify(
    certificate: str | Path, anew: Iterable[float | str] | None = None, *, every: bool = False, workers: int | None = 1
) -> "Verification":
    """Whether a certificate still holds: hashes, its judgement made again, and points or rows computed anew.

    Parameters
    ----------
    certificate
        Its folder, its ``certificate.json``, or an FMU with certificates in it, which are all verified.
    anew
        Line reactances [pu], or names of rows, that are computed anew; the least damped point, or the row with the
        narrowest margin and one by chance, where None; none where empty.
    every
        Compute all of them anew.
    workers
        Processes; one for each core where None.

    Returns
    -------
    Verification
        ``holds``, with what agreed and what did not.

    Raises
    ------
    InputError
        If it is no certificate, or has no such point or row.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> gfor.verify("certificate", anew=()).holds  # doctest: +SKIP
    True
    >>> try:
    ...     gfor.verify("nowhere")
    ... except gfor.CosimError as error:
    ...     print(type(error).__name__)
    InputError
    """
    from orchestrator.certification.compared import Verification  # noqa: PLC0415 - as above
    from orchestrator.certification.inside import laid_out  # noqa: PLC0415 - as above
    from orchestrator.certification.verification import verified  # noqa: PLC0415 - as above

    found, wanted = Verification(), None if anew is None else tuple(anew)
    with laid_out(path_of(certificate, "certificate")) as places:
        for place in places:
            one = verified(place, wanted, lambda imports: choose_executor(workers, None, imports), every=every)
            prefix = f"{place.name}: " if len(places) > 1 else ""
            found.faults += [prefix + text for text in one.faults]
            found.agreed += [prefix + text for text in one.agreed]
    return found
