"""Results of checks for a CI server: JUnit's XML, one test case for each check."""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from orchestrator.core.errors import InputError, ResultsError
from orchestrator.core.options import Option
from orchestrator.core.safe_files import write_bytes
from orchestrator.devices.acceptance.checks.base import Verdict
from orchestrator.devices.acceptance.runner import AcceptanceReport


def write_junit(report: AcceptanceReport, path: Path) -> None:
    results = report.results
    suite = Element(
        "testsuite",
        name=f"gfor fmu check {report.fmu.name}",
        tests=str(len(results)),
        failures=str(len(report.failures)),
        skipped=str(sum(r.verdict is Verdict.NOT_APPLICABLE for r in results)),
        errors=str(sum(r.verdict is Verdict.NOT_SUPPORTED for r in results)),
    )
    for result in results:
        case = SubElement(suite, "testcase", classname=report.fmu.stem, name=result.check)
        # XML 1.0 has no others
        text = "".join(c if c in "\n\t" or c >= " " else "�" for c in result.evidence)
        if result.verdict is Verdict.FAIL:
            failure = SubElement(case, "failure", message=result.fault, type=result.fault)
            failure.text = f"{text}\nremedy: {result.remedy}"
        elif result.verdict is Verdict.NOT_SUPPORTED:
            error = SubElement(
                case, "error", message=f"not supported here: {result.fault}", type=result.fault
            )
            error.text = f"{text}\nremedy: {result.remedy}"
        elif result.verdict is Verdict.NOT_APPLICABLE:
            SubElement(case, "skipped", message=text)
        else:
            SubElement(case, "system-out").text = text + (
                f"\nremedy: {result.remedy}" if result.remedy else ""
            )
    indent(suite)
    try:
        write_bytes(
            path, b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(suite, encoding="utf-8")
        )
    except ResultsError as error:
        raise InputError(Option.JUNIT + f" {error}") from error
