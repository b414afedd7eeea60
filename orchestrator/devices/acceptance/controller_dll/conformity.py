"""Run the checks of a controller DLL."""

from collections.abc import Collection, Mapping
from pathlib import Path

from orchestrator.devices.acceptance.checks.base import CheckResult, Verdict
from orchestrator.devices.acceptance.controller_dll import declared, kept, timed
from orchestrator.devices.acceptance.controller_dll.questions import DLL_QUESTIONS
from orchestrator.devices.acceptance.controller_dll.results import (
    DLL_CHECKS,
    failed,
    not_applicable,
)
from orchestrator.devices.acceptance.controller_dll.subject import DllSubject, ErrorInRunError
from orchestrator.devices.sandbox.dll_process import DllEndedError, DllNotLoadedError

_MODULES = (declared, kept, timed)  # which enter their checks
_BEFORE_ALL = ("dll_file", "dll_declarations", "dll_first_call")
"""Without these nothing else can be asked."""


def check_dll(
    path: Path,
    only: Collection[str] = (),
    texts: Mapping[str, str] | None = None,
    seconds: float = 30.0,
) -> list[CheckResult]:
    """Check if a controller DLL keeps the IEEE/CIGRE interface.

    ``only``: names of checks; all of them where empty. ``texts``: values of its text parameters.
    ``seconds``: wall-clock time for one batch of its calls [s]."""
    subject = DllSubject(path, texts, seconds)
    results: list[CheckResult] = []
    stopped = ""
    try:
        for name in DLL_QUESTIONS:
            wanted = not only or name in only
            if stopped or not (wanted or name in _BEFORE_ALL):
                if wanted:
                    results.append(not_applicable(name, stopped))
                continue
            result = _answer(name, subject)
            bad = result.verdict in (Verdict.FAIL, Verdict.NOT_SUPPORTED)
            if wanted or bad:
                results.append(result)
            if bad and name in _BEFORE_ALL:
                stopped = f"because of what was found in {name!r}"
    finally:
        subject.close()
    return results


def _answer(name: str, subject: DllSubject) -> CheckResult:
    try:
        return DLL_CHECKS[name].run(subject)
    except ErrorInRunError as error:
        return not_applicable(name, f"because it ends with an error whatever its inputs: {error}")
    except DllNotLoadedError as error:
        return failed(name, "not loadable", str(error))
    except DllEndedError as error:
        return failed(name, error.fault, str(error))
