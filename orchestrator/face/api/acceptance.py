"""Acceptance tests of an FMU."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from orchestrator.cases.form.given import Time, binding_path, in_megabytes, in_seconds
from orchestrator.cases.use import use_in_case
from orchestrator.core.asked import Names, names, text_or_none
from orchestrator.core.asked import path as path_of
from orchestrator.core.errors import InputError
from orchestrator.core.truth import NoTruth
from orchestrator.devices.acceptance.checks.base import CheckResult, Verdict
from orchestrator.devices.acceptance.checks.subject import Use
from orchestrator.devices.acceptance.controller_dll.questions import DLL_QUESTIONS
from orchestrator.devices.acceptance.junit import write_junit
from orchestrator.devices.acceptance.runner import AcceptanceReport, check_fmu, question_of
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.vendor_files import as_fmu, controller_dll
from orchestrator.devices.sandbox.resource_limits import LEAST_MEMORY, Limits
from orchestrator.face.api.case import Case

DataFrame = Any
"""``pandas.DataFrame``; importing the class takes 0.3 s, which ``gfor fmu check`` saves."""


class Acceptance(NoTruth, ask=".trusted"):
    """Findings of the acceptance tests of an FMU. `check` makes it.

    Attributes
    ----------
    report
        Every result with evidence, remedy and figures.
    """

    def __init__(self, report: AcceptanceReport) -> None:
        self.report = report

    @property
    def trusted(self) -> bool:
        """Return whether it was checked, and nothing failed."""
        return self.report.trusted

    @property
    def faults(self) -> list[str]:
        """Names of what is wrong, each once."""
        return self.report.faults

    @property
    def not_supported(self) -> list[str]:
        """Names of what this program or machine lacks for this FMU, each once."""
        return self.report.not_supported

    def table(self) -> DataFrame:
        """One row a check: its question, verdict, evidence and remedy."""
        import pandas as pd  # noqa: PLC0415 - see `DataFrame`

        rows = {
            r.check: (str(r.verdict), question_of(r.check), r.evidence, r.remedy)
            for r in self.report.results
        }
        return pd.DataFrame.from_dict(
            rows, orient="index", columns=["verdict", "question", "evidence", "remedy"]
        )

    def as_json(self) -> dict[str, Any]:
        """The same as ``gfor fmu check --json`` prints, as JSON's types."""
        return self.report.as_dict()

    def save_junit(self, path: str | Path) -> Path:
        """Write the results as JUnit's XML for a CI server, as ``gfor fmu check --junit``; returns the path.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        write_junit(self.report, Path(path))
        return Path(path)

    def __repr__(self) -> str:
        return f"<Acceptance of {self.report.fmu.name}: {self.report.sentence}>"

    def _repr_html_(self) -> str:
        from orchestrator.output.report.notebook import headline, page  # noqa: PLC0415 - imports pandas

        report = self.report
        refused = report.failures or report.reasons
        top = headline(report.sentence, report.trusted if refused or report.trusted else None)
        return page(f"Check of {report.fmu.name}", table=self.table(), verdict=top)


def check(
    path: str | Path,
    binding: str | Path | None = None,
    *,
    step: Time | None = None,
    only: Names = (),
    case: str | Path | Case | None = None,
    component: str | None = None,
    scenario: str | None = None,
    seed: int | None = None,
    frequency: float | None = None,
    time_limit: Time | None = None,
    memory_limit: float | str | None = None,
    report: Callable[[int, int], None] | None = None,
) -> Acceptance:
    """Run the acceptance tests of an FMU: can it be trusted in a co-simulation?

    A controller DLL, or the DLL that a device's file names, is first asked if it keeps the IEEE/CIGRE interface; where
    it does, the FMU around it is tried as every other.

    Parameters
    ----------
    path
        Path of the FMU, of a controller DLL, or of a device's file.
    binding
        File that says what the FMU's variables mean at our port (``gfor fmu bind`` drafts one); by default the case's.
    step
        Communication step of use [s]; by default the case's, and without a case the one that the FMU declares.
    only
        Names of checks; all of them where empty.
    case
        A case that uses the FMU, or its name or path: its step, operating point, values and binding are taken.
    component
        Name of the component of the case that is this FMU; by default the component with this file.
    scenario
        Name of the case's scenario; by default the first one with the component.
    seed
        Whole number, at least 0, from which dips, jumps and operating points are drawn; by default it follows from the
        file's bytes, and the report states it.
    frequency
        Of the network [Hz], where the FMU has a parameter f_n, as the FMU of a device's file has; by default its own.
    time_limit
        Wall-clock time that one call of the FMU may take [s]; 30 s by default.
    memory_limit
        Memory that the FMU's process may take [MB], or text such as ``"4 GB"``; 4096 MB by default, at least 32 MB.
    report
        Called with how many checks are done, and how many there are.

    Raises
    ------
    InputError
        If there is no such file, check, case, component or scenario, or the binding cannot be used.

    Examples
    --------
    >>> import orchestrator as gfor
    >>> fmu = gfor.build("infinite_bus")
    >>> report = gfor.check(fmu, only=["runs"])
    >>> report.trusted
    True
    >>> report.table()["verdict"].to_dict()
    {'archive': 'pass', 'runs': 'pass'}

    With the step, the operating point and the values of a case:

    >>> report = gfor.check(fmu, case="infinite_bus", component="grid", only=["runs"])
    >>> report.report.used_as
    "component 'grid' in scenario 'dip' of case.toml: P_0 = 9, Q_0 = 0.75, v_0 = 1, theta_0 = 0 (default)"
    """
    limits, step_size = _limits(time_limit, memory_limit), in_seconds(step, "step")
    file, use, bound_by = path_of(path, "path"), Use(step_size), binding_path(binding)
    for argument, given in (("component", component), ("scenario", scenario)):
        text_or_none(given, argument, "give one name, or leave it out")
    if seed is not None and (isinstance(seed, bool) or not isinstance(seed, int) or seed < 0):
        raise InputError(
            f"seed = {seed!r} is no whole number of at least 0; give one such as the report states"
        )
    if case is not None:
        place = case.file.path if isinstance(case, Case) else path_of(case, "case")
        use, of_case = use_in_case(str(place), component, file, step_size, scenario)
        bound_by = bound_by or of_case
    elif component or scenario:
        kind, name = ("component", component) if component else ("scenario", scenario)
        raise InputError(f"{kind} = {name!r} names a {kind} of a case; give case as well")
    wanted = names(only, "only")
    of_the_dll = _conformity(file, wanted, limits)
    others = tuple(name for name in wanted if name not in DLL_QUESTIONS)
    bad = any(r.verdict in (Verdict.FAIL, Verdict.NOT_SUPPORTED) for r in of_the_dll)
    if bad or (wanted and not others):
        return Acceptance(AcceptanceReport(file, bound_by, of_the_dll))
    fmu = as_fmu(file)
    if frequency is not None:
        if "f_n" not in read_description(fmu).variables:
            raise InputError(
                f"frequency = {frequency}: {file.name} has no parameter f_n; a binding's [rating] has one"
            )
        use = replace(use, values={**use.values, "f_n": float(frequency)})
    found = check_fmu(fmu, bound_by, limits, others, use=use, seed=seed, told=report)
    found.results[:0] = of_the_dll
    return Acceptance(found)


def _conformity(file: Path, only: tuple[str, ...], limits: Limits) -> list[CheckResult]:
    """Results of the checks of a controller DLL that were asked for; none for other files."""
    asked = [name for name in only if name in DLL_QUESTIONS]
    found = controller_dll(file)
    if found is None and asked:
        raise InputError(
            f"the check {asked[0]!r} is of controller DLLs, and {file.name} is none; "
            "give a .dll, a .so or a device's file"
        )
    if found is None or (only and not asked):
        return []
    from orchestrator.devices.acceptance.controller_dll.conformity import check_dll  # noqa: PLC0415 - most files are FMUs

    library, texts = found
    return check_dll(library, asked, texts, limits.seconds)


def _limits(time_limit: Time | None, memory_limit: float | str | None) -> Limits:
    """The usual limits, with those replaced that are given."""
    limits = Limits()
    seconds = in_seconds(time_limit, "time_limit")
    if seconds is not None:
        limits = replace(limits, seconds=seconds)
    if memory_limit is not None:
        megabytes = in_megabytes(memory_limit, "memory_limit", LEAST_MEMORY)
        limits = replace(limits, memory=int(megabytes * 1024**2))
    return limits
