"""The acceptance tests of the FMU that is certified: run, or read from a report of `gfor fmu check --json`."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from fmus.toolchain.extras import installed_version
from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.core.options import Option, command
from orchestrator.core.safe_files import write_text

KEPT = "check.json"  # name of the report's file in a certificate's folder


@dataclass(frozen=True)
class Acceptance:
    trusted: bool
    faults: tuple[str, ...]
    report: Mapping[str, Any] = field(repr=False)

    @property
    def checks(self) -> list[dict[str, Any]]:
        return list(self.report["checks"])

    def keep(self, folder: Path) -> None:
        text = json.dumps(self.report, indent=1, ensure_ascii=False)
        write_text(folder / KEPT, text + "\n")


def run_checks(fmu: Path, binding: Path | None, folder: Path) -> Acceptance:
    """Run the tests and write the report into the folder; a report of an earlier start is used if it fits."""
    kept = folder / KEPT
    if kept.is_file():
        try:
            return read_checks(kept, fmu, binding)
        except InputError:
            pass  # of another FMU or version, or cut off: it is made anew
    from orchestrator.devices.acceptance.runner import check_fmu  # noqa: PLC0415 - `gfor verify` runs no checks

    report = check_fmu(fmu, binding)
    faults = tuple(report.faults) or _unknown(report.reasons)
    found = Acceptance(report.trusted, faults, report.as_dict())
    found.keep(folder)
    return found


def read_checks(path: Path, fmu: Path, binding: Path | None) -> Acceptance:
    remedy = (
        "write it with "
        + command("fmu check FILE.fmu", Option.JSON)
        + ", or leave "
        + Option.CHECK
        + " away to have the tests run"
    )
    try:
        report = json.loads(path.read_text(encoding="utf-8"))
        hashes = report["sha256"]["fmu"], report["sha256"]["binding"]
        said, found = (
            bool(report["trusted"]),
            [(r["verdict"], r["fault"], r["check"]) for r in report["checks"]],
        )
        reasons = [
            str(r["figures"]["not_judged"])
            for r in report["checks"]
            if r.get("figures", {}).get("reason")
        ]
        tool = report["tool"]
    except OSError as error:
        raise InputError(
            Option.CHECK + f" {path}: it cannot be read: {error.strerror}; {remedy}"
        ) from error
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            Option.CHECK
            + f" {path}: it is no report of "
            + command("fmu check", Option.JSON)
            + f"; {remedy}"
        ) from error
    if hashes != (sha256_of(fmu), binding and sha256_of(binding)):
        raise InputError(
            Option.CHECK + f" {path}: it is of another FMU or binding than {fmu}; {remedy}"
        )
    if tool != _tool():
        raise InputError(
            Option.CHECK + f" {path}: it was made by {tool}, this is {_tool()}; {remedy}"
        )
    faults = tuple(dict.fromkeys(fault for verdict, fault, _ in found if verdict == "fail"))
    if said != (not faults and not reasons):
        raise InputError(
            Option.CHECK + f" {path}: its checks say otherwise than its 'trusted'; {remedy}"
        )
    from orchestrator.devices.acceptance.checks.all import CHECKS  # noqa: PLC0415 - as above

    there = {name for *_, name in found}
    left = [name for name in CHECKS if name not in there]
    if not faults and left:
        raise InputError(Option.CHECK + f" {path}: it does not hold {', '.join(left)}; {remedy}")
    if not faults and not any(verdict == "pass" for verdict, *_ in found):
        raise InputError(
            Option.CHECK
            + f" {path}: none of its checks was passed, so that it says nothing of the FMU; "
            f"{remedy}"
        )
    return Acceptance(not faults and not reasons, faults or _unknown(reasons), report)


def _unknown(reasons: Sequence[str]) -> tuple[str, ...]:
    return tuple(f"not judged: {reason}" for reason in reasons)


def _tool() -> str:
    return f"gfor-cosim {installed_version('gfor-cosim')}"
