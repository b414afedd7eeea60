"""The process in which a foreign FMU is checked; started by `runner`, never by a person.

Each check's name is written before it begins and its result when it is done, so that whoever started this process knows
in which check the FMU ended it.
"""

import ctypes
import json
import mmap
import sys
import traceback
from pathlib import Path
from typing import Any

from orchestrator.errors import ComponentError, CosimError
from orchestrator.fmi.instance import compile_adapters
from orchestrator.fmi.limits import Limits, apply_limits
from orchestrator.fmi.messages import on_message
from orchestrator.vendor.binding import bound_fmu
from orchestrator.vendor.checks.all import CHECKS
from orchestrator.vendor.checks.base import Check, Result, failed, not_applicable
from orchestrator.vendor.checks.subject import Progress, Subject

PROGRESS_BYTES = 64

_REFUSED = {
    "fmi2Instantiate": "no instance",
    "fmi2EnterInitializationMode": "does not start",
    "fmi2ExitInitializationMode": "does not start",
    "fmi2DoStep": "error in a step",
}
"""Name of the fault where an FMU refuses what every FMU must be able to do."""


def progress_in(memory: mmap.mmap) -> Progress:
    """Progress that lies in shared memory."""
    return Progress(ctypes.c_double.from_buffer(memory, 0), ctypes.c_int64.from_buffer(memory, 8))


def main(request: dict[str, Any]) -> None:
    """Run checks on one FMU.

    Parameters
    ----------
    request
        fmu, binding, directory (extracted), folder (may be written in), checks (names), limits.
    """
    folder = Path(request["folder"])
    description = bound_fmu(request["fmu"], request["binding"])
    compile_adapters(description)
    with (
        (folder / "results").open("a", encoding="utf-8", buffering=1) as results,
        (folder / "progress").open("r+b") as shared,
    ):
        memory = mmap.mmap(shared.fileno(), PROGRESS_BYTES)
        limits = Limits(**request["limits"])
        missing = apply_limits(limits, folder)
        results.write(json.dumps({"unlimited": missing}) + "\n")
        subject = Subject(description, Path(request["directory"]), progress_in(memory))
        subject.memory.update(request["memory"])
        on_message(limits.messages, lambda: hash(subject.progress.time.value))
        for name in request["checks"]:
            results.write(json.dumps({"begin": name}) + "\n")
            result = answer(CHECKS[name], subject, request["failed"])
            if result.fault:
                request["failed"].append(name)
            kept = {k: v for k, v in subject.memory.items() if isinstance(v, float | int)}
            results.write(json.dumps({"result": result.as_dict(), "memory": kept}, default=str) + "\n")
        results.write(json.dumps({"end": True}) + "\n")


def answer(check: Check, subject: Subject, faulty: list[str]) -> Result:
    """The check's result; an FMU that refuses what every FMU must be able to do is at fault.

    Parameters
    ----------
    faulty
        Checks that failed before.
    """
    missing = [name for name in check.needs if name in faulty]
    if missing:
        return not_applicable(check.name, f"because it failed in {missing[0]!r}, without which this has no meaning")
    try:
        return check.run(subject)
    except ComponentError as error:
        return failed(check.name, _REFUSED.get(error.call, "refused call"), str(error))
    except CosimError as error:
        return failed(check.name, "refused call", str(error))
    except MemoryError:
        return failed(check.name, "memory limit", "the process has no memory left")
    except Exception as error:  # a check that fails by itself must not hide the others
        where = traceback.extract_tb(error.__traceback__)[-1]
        file = Path(where.filename).name
        return not_applicable(
            check.name, f"because the check failed by itself: {error!r} in {file}, line {where.lineno}"
        )


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
