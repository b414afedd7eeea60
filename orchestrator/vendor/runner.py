"""Acceptance tests of one FMU, run in processes that it may crash, hang or flood without harm to anyone else."""

import json
import mmap
import signal
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, field
from pathlib import Path
from shutil import rmtree
from time import monotonic, sleep
from typing import Any

from orchestrator.errors import BindingError, FmuFileError, HostileFmuError, InputError
from orchestrator.fmi.archive import extract
from orchestrator.fmi.description import FmuDescription, read_description
from orchestrator.fmi.instance import compile_adapters
from orchestrator.fmi.limits import TO_BEGIN, Limits
from orchestrator.fmi.messages import FLOODED
from orchestrator.fmi.port import BoundDescription
from orchestrator.vendor.binding import bind, read_table
from orchestrator.vendor.checks.all import CHECKS
from orchestrator.vendor.checks.base import Result, Verdict, failed, not_applicable, passed
from orchestrator.vendor.checks.running import RUN_FOR
from orchestrator.vendor.checks.subject import CALLS, Progress
from orchestrator.vendor.worker import PROGRESS_BYTES, progress_in

_PATIENCE = 10
"""A check may take this many times the limit for one call."""


@dataclass
class Report:
    """What all checks found.

    Attributes
    ----------
    unlimited
        What could not be limited in the FMU's process, in words.
    """

    fmu: Path
    binding: Path | None
    results: list[Result] = field(default_factory=list)
    unlimited: tuple[str, ...] = ()

    @property
    def failures(self) -> list[Result]:
        return [r for r in self.results if r.verdict is Verdict.FAIL]

    @property
    def faults(self) -> list[str]:
        """Names of what is wrong, each once."""
        return list(dict.fromkeys(r.fault for r in self.failures))

    @property
    def trusted(self) -> bool:
        """Whether nothing failed."""
        return not self.failures

    def as_dict(self) -> dict[str, Any]:
        return {
            "fmu": str(self.fmu),
            "binding": None if self.binding is None else str(self.binding),
            "trusted": self.trusted,
            "faults": self.faults,
            "not_limited": list(self.unlimited),
            "checks": [{"question": question_of(r.check), **r.as_dict()} for r in self.results],
        }


FILE_CHECKS = {
    "archive": "Can the file be unpacked and read without harm?",
    "binding": "Does the binding fit the file?",
}
"""What is asked before there is anything to run."""


def question_of(name: str) -> str:
    return FILE_CHECKS[name] if name in FILE_CHECKS else CHECKS[name].question


def check_fmu(
    fmu: Path,
    binding: Path | None = None,
    limits: Limits | None = None,
    only: tuple[str, ...] = (),
    run_for: float = RUN_FOR,
) -> Report:
    """Run the acceptance tests.

    Parameters
    ----------
    run_for
        Wall-clock time for which it is made to run [s].
    only
        Names of checks; all of them where empty.

    Raises
    ------
    InputError
        If there is no such file or no such check, or the binding is not TOML, not of its form or not filled in.
    """
    unknown = [name for name in only if name not in CHECKS]
    if unknown:
        raise InputError(f"there is no check {', '.join(map(repr, unknown))}; there are: {', '.join(CHECKS)}")
    if not fmu.is_file():
        raise InputError(f"{fmu}: there is no such file; give the path of an .fmu")
    if binding is not None:
        read_table(binding)  # what is wrong with its form is not the FMU's fault
    report = Report(fmu, binding)
    try:
        native = read_description(fmu)
        directory = extract(fmu)
    except FmuFileError as error:
        fault = error.kind if isinstance(error, HostileFmuError) else "unreadable"
        report.results.append(failed("archive", fault, str(error)))
        return report
    try:
        report.results.append(passed("archive", "unpacked within limits, and read"))
        bound = None if binding is None else _bound(report, native, binding)
        compile_adapters(bound or native)  # here, where nobody waits for the FMU
        checked = binding if bound else None
        with tempfile.TemporaryDirectory(prefix="gfor_check_", ignore_cleanup_errors=True) as folder:
            _Runner(report, checked, directory, Path(folder), limits or Limits(), run_for).run(list(only or CHECKS))
    finally:
        rmtree(directory, ignore_errors=True)
    return report


def _bound(report: Report, native: FmuDescription, binding: Path) -> BoundDescription | None:
    """The FMU behind its binding; None, with a failure in the report, where that does not fit."""
    try:
        bound = bind(native, binding)
    except BindingError as error:
        unit = any("the FMU declares" in p.text or "needs the key 'value'" in p.text for p in error.problems)
        report.results.append(failed("binding", "wrong units" if unit else "binding does not fit", str(error)))
        return None
    report.results.append(passed("binding", "all variables are there, with the units that it says"))
    return bound


class _Runner:
    """Starts workers until every check has a result."""

    def __init__(
        self, report: Report, binding: Path | None, directory: Path, folder: Path, limits: Limits, run_for: float
    ) -> None:
        self._report, self._limits, self._folder = report, limits, folder
        self._request = {
            "fmu": str(report.fmu.resolve()),
            "binding": None if binding is None else str(binding.resolve()),
            "directory": str(directory),
            "folder": str(folder),
            "limits": asdict(limits),
            "memory": {"run_for": run_for},
        }

    def run(self, names: list[str]) -> None:
        pending = list(names)
        while pending:
            ended = self._one_process(pending)
            if ended is None:
                return
            name, result = ended
            self._report.results.append(result)
            pending = pending[pending.index(name) + 1 :]
            if name == "runs":
                self._report.results += [not_applicable(n, f"because it ended its process in 'runs' ({result.fault})")
                                         for n in pending]  # fmt: skip
                return

    def _one_process(self, names: list[str]) -> tuple[str, Result] | None:
        """Run checks in a new process; the check that it did not survive, or None."""
        results, shared = self._folder / "results", self._folder / "progress"
        results.write_bytes(b"")
        shared.write_bytes(bytes(PROGRESS_BYTES))
        request = json.dumps({**self._request, "checks": names, "failed": [r.check for r in self._report.failures]})
        with (self._folder / "output").open("wb") as output, shared.open("r+b") as file:
            progress = progress_in(mmap.mmap(file.fileno(), PROGRESS_BYTES))
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "orchestrator.vendor.worker", request],
                stdin=subprocess.DEVNULL, stdout=output, stderr=output, start_new_session=True,
            )  # fmt: skip
            try:
                hung = self._watch(process, progress, results)
            finally:
                if process.poll() is None:
                    process.kill()
                process.wait()
        running, finished = self._collect(results)
        if finished:
            return None
        if running is None:
            raise InputError(f"the FMU's process did not start: {self._said()}")
        where = f"{CALLS[progress.call.value]}, at t = {progress.time.value:.6g} s"
        return running, self._death(running, process.returncode, hung, where)

    def _watch(self, process: "subprocess.Popen[bytes]", progress: Progress, results: Path) -> bool:
        """Wait for the process; True if it had to be given up."""
        state: Any = None
        moved = begun = monotonic()
        size = 0
        while process.poll() is None:
            now, written = (progress.time.value, progress.call.value), results.stat().st_size
            if written != size:
                size, begun = written, monotonic()
            if now != state or begun > moved:
                state, moved = now, monotonic()
            patience = self._limits.seconds if size else TO_BEGIN
            if monotonic() - moved > patience or monotonic() - begun > _PATIENCE * patience:
                return True
            sleep(0.02)
        return False

    def _collect(self, results: Path) -> tuple[str | None, bool]:
        """Take over what was finished; the check that was running, and whether all is done."""
        running = None
        for line in results.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                entry = json.loads(line)
            except ValueError:
                continue  # cut off in the middle
            if "unlimited" in entry:
                self._report.unlimited = tuple(entry["unlimited"])
            elif "begin" in entry:
                running = entry["begin"]
            elif "result" in entry:
                self._report.results.append(Result.of_dict(entry["result"]))
                self._request["memory"] = entry["memory"]
                running = None
            elif "end" in entry:
                return None, True
        return running, False

    def _death(self, name: str, code: int, hung: bool, where: str) -> Result:
        said = self._said()
        tail = f"; it wrote: {said}" if said else ""
        if hung:
            return failed(name, "hang", f"no answer within {self._limits.seconds:g} s in {where}")
        if code == FLOODED:
            return failed(name, "output flood", f"more than {self._limits.messages} log messages in {where}")
        if code < 0 and -code == getattr(signal, "SIGXFSZ", None):
            return failed(name, "output flood", f"more than {self._limits.output} bytes written in {where}")
        if code < 0 or code > 0x80000000:
            kind = signal.Signals(-code).name if code < 0 else f"code {code:#x}"
            return failed(name, "crash", f"its process died with {kind} in {where}{tail}")
        return failed(name, "exit", f"it ended its process with exit code {code} in {where}{tail}")

    def _said(self) -> str:
        """The end of what the process wrote."""
        with (self._folder / "output").open("rb") as output:
            output.seek(max(0, output.seek(0, 2) - 2000))
            lines = output.read().decode("utf-8", "replace").strip().splitlines()
        return " ".join(lines[-1:])[:300]
