"""Acceptance tests of one FMU.

The checks run here; the FMU runs in a process of its own, which it may crash, hang or flood, and from which nothing but
measurements come. So it reaches no verdict."""

import hashlib
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from time import monotonic
from typing import Any

from fmus.toolchain.extras import installed_version
from fmus.toolchain.removal import remove_tree
from orchestrator.core.errors import (
    BindingError,
    ComponentError,
    CosimError,
    EndedError,
    ErrorKind,
    FmuFileError,
    HostileFmuError,
    InputError,
    UnsupportedFmuError,
)
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.options import Option
from orchestrator.core.threads import one_thread
from orchestrator.devices.acceptance.checks import base
from orchestrator.devices.acceptance.checks.all import CHECKS, ORDER
from orchestrator.devices.acceptance.checks.running import RUN_FOR
from orchestrator.devices.acceptance.checks.subject import Subject, Use
from orchestrator.devices.acceptance.controller_dll.questions import DLL_QUESTIONS
from orchestrator.devices.acceptance.process import FmuProcess, ProcessEndedError
from orchestrator.devices.binding.binding import bind, read_table
from orchestrator.devices.binding.misfits import is_consequence, likely_cause
from orchestrator.devices.fmi.archive import extract, listed_twice
from orchestrator.devices.fmi.description import FmuDescription, read_description
from orchestrator.devices.fmi.instance import compile_adapters
from orchestrator.devices.fmi.port_mapping import BoundDescription
from orchestrator.devices.sandbox.process_end import ProcessFault
from orchestrator.devices.sandbox.protections_in_force import Protection, missing
from orchestrator.devices.sandbox.resource_limits import Limits, crowded

CRASH = "crash"  # fault of a process that dies
_LAST = 3  # checks before a crash that are named
_PATIENCE = 10  # A check may take this many times the limit for one call


@dataclass
class AcceptanceReport:
    fmu: Path
    binding: Path | None
    results: list[base.CheckResult] = field(default_factory=list)
    # what kept the FMU's process from the rest of the machine; empty where it was not started
    protections: tuple[Protection, ...] = ()
    used_as: str = ""  # component, scenario and operating point of the case, in words
    seed: int = 0  # of the dips, jumps and operating points that were drawn at random

    @property
    def failures(self) -> list[base.CheckResult]:
        return [r for r in self.results if r.verdict is base.Verdict.FAIL]

    @property
    def faults(self) -> list[str]:
        return list(dict.fromkeys(r.fault for r in self.failures))

    @property
    def not_supported(self) -> list[str]:
        """Names of what this program or machine lacks for this FMU, each once."""
        return list(
            dict.fromkeys(r.fault for r in self.results if r.verdict is base.Verdict.NOT_SUPPORTED)
        )

    @property
    def not_judged(self) -> list[str]:
        """Return what passed or was remarked on without being judged as a whole, in words."""
        return [str(r.figures["not_judged"]) for r in self.results if "not_judged" in r.figures]

    @property
    def binding_fails(self) -> bool:
        """Return whether the binding is what failed, so that nothing is known of the FMU behind it."""
        return any(r.whose is base.Whose.BINDING for r in self.failures)

    @property
    def reasons(self) -> list[str]:
        """Reasons not to accept it although nothing failed: what an honest one shows and this one did not, in words."""
        return [str(r.figures["not_judged"]) for r in self.results if r.figures.get("reason")]

    @property
    def trusted(self) -> bool:
        return not self.failures and not self.not_supported and not self.reasons

    @property
    def drawn(self) -> bool:
        """Return whether something was asked of it that is drawn at random."""
        return any(r.check in CHECKS for r in self.results)

    @property
    def sentence(self) -> str:
        """The verdict; the frequency that it is made for is told where this shows."""
        if self.trusted:
            return f"no check failed; not judged: {', and '.join(self.not_judged)}".removesuffix(
                "; not judged: "
            )
        if self.reasons and not self.failures and not self.not_supported:
            return f"no check failed, and not to be accepted as it is: not judged: {', and '.join(self.not_judged)}"
        if not self.failures:
            what = "the FMU" if self.fmu.suffix == ".fmu" else "the DLL"
            return f"not supported here: {', '.join(self.not_supported)}; that says nothing about {what}"
        if self.binding_fails and self.binding is not None:
            return f"nothing is known yet of it behind {self.binding.name}: mend it and check again"
        made = next((r for r in self.failures if "made_for_hz" in r.figures), None)
        hertz = f" (made for {made.figures['made_for_hz']:.4g} Hz): {made.remedy}" if made else ""
        return f"do not use it as it is: {', '.join(self.faults)}{hertz}"

    def as_dict(self) -> dict[str, Any]:
        checks = [{"question": question_of(r.check), **r.as_dict()} for r in self.results]
        return {
            "tool": f"gfor-cosim {installed_version('gfor-cosim')}",
            "fmu": str(self.fmu),
            "binding": None if self.binding is None else str(self.binding),
            "sha256": {
                "fmu": sha256_of(self.fmu),
                "binding": self.binding and sha256_of(self.binding),
            },
            "trusted": self.trusted,
            "faults": self.faults,
            "reasons": self.reasons,
            "not_supported": self.not_supported,
            "not_limited": missing(self.protections),
            "protections": [asdict(protection) for protection in self.protections],
            "used_as": self.used_as,
            "seed": self.seed,
            "checks": checks,
        }


FILE_CHECKS = {
    "archive": "Can the file be unpacked and read without harm?",
    "binding": "Does the binding fit the file?",
}


def question_of(name: str) -> str:
    """The question of a check."""
    for questions in (FILE_CHECKS, DLL_QUESTIONS):
        if name in questions:
            return questions[name]
    return CHECKS[name].question


def check_fmu(
    fmu: Path,
    binding: Path | None = None,
    limits: Limits | None = None,
    only: tuple[str, ...] = (),
    run_for: float = RUN_FOR,
    use: Use | None = None,
    seed: int | None = None,
    told: Callable[[int, int], None] | None = None,
) -> AcceptanceReport:
    """Run the acceptance tests.

    ``limits``: what the FMU may take; the usual limits where None.
    ``only``: names of checks; all of them where empty.
    ``run_for``: wall-clock time for which it is made to run [s].
    ``use``: step, operating point and values with which it is used; what the file declares where None.
    ``seed``: of what is drawn at random; from the file's own bytes where None, so that its author cannot know it
    before.
    ``told``: called with how many checks are done, and how many there are.
    Raises an `InputError` if there is no such file or no such check, or the binding is not TOML, not of its form or not
    filled in."""
    unknown = [name for name in only if name not in CHECKS and name not in FILE_CHECKS]
    if unknown:
        known = ", ".join([*FILE_CHECKS, *CHECKS])
        raise InputError(f"there is no check {', '.join(map(repr, unknown))}; there are: {known}")
    if "binding" in only and binding is None:
        raise InputError(
            "the check 'binding' needs a binding; give one with "
            + Option.BINDING
            + " (`gfor fmu bind` drafts one)"
        )
    if fmu.is_dir():
        raise InputError(f"{fmu}: it is a folder; give the path of an .fmu")
    if not fmu.is_file():
        raise InputError(f"{fmu}: there is no such file; give the path of an .fmu")
    if binding is not None:
        read_table(binding)  # what is wrong with its form is not the FMU's fault
    seed = int(hashlib.sha256(fmu.read_bytes()).hexdigest()[:6], 16) if seed is None else seed
    report = AcceptanceReport(fmu, binding, used_as=use.said if use else "", seed=seed)
    try:
        described = read_description(fmu)
        directory = extract(fmu)
    except UnsupportedFmuError as error:
        report.results.append(base.not_supported("archive", error))
        return report
    except FmuFileError as error:
        fault = error.fault if isinstance(error, HostileFmuError) else "unreadable"
        report.results.append(base.failed("archive", fault, str(error)))
        return report
    try:
        report.results.append(_unpacked(fmu))
        bound = None if binding is None else _bound(report, described, binding)
        wanted = [name for name in only if name in CHECKS] if only else list(CHECKS)
        if binding is not None and bound is None:
            # Without its port the FMU is asked in vain; what is wrong stands in a file that the user can mend at once.
            report.results += [
                base.not_applicable(name, "because the binding does not fit") for name in wanted
            ]
            return report
        if not wanted:
            return report
        compile_adapters(bound or described)  # here, where nobody waits for the FMU
        subject = Subject(bound or described, directory, use, seed)
        subject.memory["run_for"] = run_for
        runner = _Runner(report, subject, limits or Limits())
        try:
            with one_thread():  # products of thousands of steps with two numbers: threads only wait
                runner.run(wanted, told or _nobody)
        finally:
            runner.close()
        report.results = without_consequences(report, subject.description)
    finally:
        remove_tree(directory)
    return report


def _nobody(done: int, total: int) -> None:
    """Tell nobody how many checks are done."""


def _unpacked(fmu: Path) -> base.CheckResult:
    twice = listed_twice(fmu)
    if not twice:
        return base.passed("archive", "unpacked within limits, and read")
    more = f" and {len(twice) - 3} more" if len(twice) > 3 else ""
    return base.remarked(
        "archive",
        f"it lists {', '.join(twice[:3])}{more} twice, with equal bytes",
        "does no harm; other tools may refuse the file, tell whoever packed it",
    )


def without_consequences(
    report: AcceptanceReport, described: FmuDescription
) -> list[base.CheckResult]:
    """The results, without faults that follow from another one."""
    faults = [r.fault for r in report.failures]
    because = "because the rating in the binding does not fit, which comes first"
    return [
        base.not_applicable(r.check, because)
        if r.fault and is_consequence(described, r.fault, faults)
        else r
        for r in report.results
    ]


def _bound(
    report: AcceptanceReport, described: FmuDescription, binding: Path
) -> BoundDescription | None:
    """The FMU behind its binding; None, with a failure in the report, where that does not fit."""
    try:
        bound = bind(described, binding)
    except BindingError as error:
        differ = any(p.kind is ErrorKind.UNITS for p in error.problems)
        says = "; ".join(map(str, error.problems))
        result = base.failed(
            "binding",
            "wrong units" if differ else "binding does not fit",
            f"{binding.name}: {says}",
        )
        remedy = (
            "give the unit that the FMU declares, or have modelDescription.xml corrected"
            if differ
            else result.remedy
        )
        report.results.append(replace(result, remedy=remedy, whose=base.Whose.BINDING))
        return None
    unlike = [f"the binding has {text}" for text in bound.unlike_delivered().values()]
    report.results.append(
        base.remarked("binding", "; ".join(unlike), "give [rating] that of one unit as delivered")
        if unlike
        else base.passed("binding", "all variables are there, with the units that it says")
    )
    return bound


class _Runner:
    """Asks every question, in this process, of an FMU that is in another."""

    def __init__(self, report: AcceptanceReport, subject: Subject, limits: Limits) -> None:
        self._report, self._subject, self._limits = report, subject, limits
        self._process: FmuProcess | None = None
        self._asked: list[str] = []
        self._deadline = 0.0
        subject.process = self.process
        subject.process_at = self._process_at

    def process(self) -> FmuProcess:
        """The FMU's process; a new one where it has ended the last one."""
        if self._process is None or not self._process.alive:
            self.close()
            subject = self._subject
            self._process = FmuProcess(subject.description, subject.directory, self._limits)
            self._asked = []
            self._report.protections = self._process.protections
        self._process.deadline = self._deadline
        return self._process

    @contextmanager
    def _process_at(self, clock_shift: int) -> Iterator[FmuProcess]:
        """A process of its own with another date and time of day."""
        subject = self._subject
        process = FmuProcess(subject.description, subject.directory, self._limits, clock_shift)
        process.deadline = self._deadline
        try:
            yield process
        finally:
            process.close()

    def run(self, names: list[str], told: Callable[[int, int], None]) -> None:
        results = self._report.results
        for place, name in enumerate(names):
            told(place, len(names))
            self._deadline = monotonic() + _PATIENCE * crowded() * self._limits.seconds
            result = self._answer(CHECKS[name])
            cause = likely_cause(self._subject.description, result.fault)
            if cause:
                result = replace(
                    result, evidence=f"{result.evidence}; {cause}", whose=base.Whose.BINDING
                )
            results.append(self._with_whom(result))
            self._asked.append(name)
            because = self._harmful(result)
            if because or (name == "runs" and (because := self._too_bad(result))):
                results += [base.not_applicable(later, because) for later in names[place + 1 :]]
                return

    def _with_whom(self, result: base.CheckResult) -> base.CheckResult:
        """A crash, with the checks before it where it does not come without them.

        A call that damages the FMU's memory is often survived; the process then ends in a later one."""
        before = self._asked
        if result.fault != CRASH or not before or self._process is None or self._process.alive:
            return result
        self._deadline = monotonic() + _PATIENCE * crowded() * self._limits.seconds
        if self._answer(CHECKS[result.check]).fault == CRASH:
            return result
        says = f"not so in a new process: what came before it, {', '.join(before[-_LAST:])}, damaged the FMU's memory"
        return replace(result, evidence=f"{result.evidence}; {says}")

    def _harmful(self, result: base.CheckResult) -> str:
        """Why nothing else is asked of an FMU that would fill the machine with its processes."""
        if result.fault != ProcessFault.LEFT:
            return ""
        return f"because it left a process behind in {result.check!r}, and would again"

    def _too_bad(self, result: base.CheckResult) -> str:
        """Why nothing else is asked of an FMU that ran so; "" where there is more to learn."""
        if self._process is not None and not self._process.alive:
            return f"because it ended its process in 'runs' ({result.fault})"
        return "because it ends before it shows anything" if result.fault == "ends at once" else ""

    def _answer(self, check: base.Check) -> base.CheckResult:
        """The check's result; an FMU that refuses what every FMU must be able to do is at fault."""
        faulty = [r.check for r in self._report.results if r.fault]
        asked_of_the_file = ORDER.index(check.name) <= ORDER.index("loads")
        missing = [
            name for name in ("loads", *check.needs) if name in faulty and not asked_of_the_file
        ]
        if missing == ["loads"] and self._report.not_supported:
            return base.not_applicable(check.name, "because the FMU cannot run here")
        if missing:
            return base.not_applicable(
                check.name,
                f"because it failed in {missing[0]!r}, without which this has no meaning",
            )
        self._subject.doing = ""
        try:
            return check.run(self._subject)
        except ProcessEndedError as error:
            doing = self._subject.doing
            return base.failed(
                check.name, error.fault, f"{doing}: {error.how}" if doing else error.how
            )
        except EndedError as error:
            return _ended(check.name, self._subject, error)
        except UnsupportedFmuError as error:
            return base.not_supported(check.name, error)
        except ComponentError as error:
            return base.failed(check.name, _REFUSED.get(error.call, "refused call"), str(error))
        except InputError:
            raise
        except CosimError as error:
            return base.failed(check.name, "refused call", str(error))
        except (
            Exception
        ) as error:  # a check that fails by itself must not hide the others, nor count as passed
            where = traceback.extract_tb(error.__traceback__)[-1]
            says = f"the check failed by itself: {error!r} in {Path(where.filename).name}, line {where.lineno}"
            return base.failed(check.name, "no verdict", says)

    def close(self) -> None:
        if self._process is not None:
            self._process.close()


def _ended(name: str, subject: Subject, error: EndedError) -> base.CheckResult:
    """An orderly end is no fault; one that comes earlier than before is worth a word."""
    if subject.ends is None or error.ended_at < subject.ends * (1 - 1e-9):
        says = f"it ended its simulation by itself at t = {error.ended_at:.6g} s"
        return base.remarked(
            name,
            f"{says}, earlier than otherwise",
            "no error, but this could not be checked; ask why it ends",
        )
    return base.not_applicable(
        name, f"because it takes longer than the FMU runs, which is {error.ended_at:.6g} s"
    )


_REFUSED = {
    "fmi2Instantiate": "no instance",
    "fmi2EnterInitializationMode": "does not start",
    "fmi2ExitInitializationMode": "does not start",
    "fmi2DoStep": "error in a step",
}
"""Name of the fault where an FMU refuses what every FMU must be able to do."""
