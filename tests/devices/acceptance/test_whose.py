"""Whose matter a finding is: the FMU's, this machine's, or that of a forbidden call. Each with its wrong twin."""

import ast
import json
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import pytest

from fmus.toolchain.compiler import host_platform
from orchestrator.core.errors import ComponentError, HostileFmuError
from orchestrator.devices.acceptance.checks.base import REMEDIES, failed
from orchestrator.devices.acceptance.controller_dll.questions import REMEDIES as OF_DLLS
from orchestrator.devices.acceptance.runner import _REFUSED, check_fmu
from orchestrator.devices.fmi.archive import extract
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.instance import open_component
from orchestrator.devices.sandbox.resource_limits import Limits
from tests.devices.acceptance.gallery.build import build
from tests.devices.acceptance.gallery.hostile import other_bytes, same_bytes
from tests.devices.acceptance.gallery.members import converter

linux = pytest.mark.skipif(host_platform() != "linux64", reason="its loader is asked")


def checked(path, *only):
    return check_fmu(path, None, Limits(seconds=10.0), only, run_for=0.3)


def result(report, name):
    return next(r for r in report.results if r.check == name)


def changed(path, folder, *, xml=None, binary=None, extra=()):
    """A copy of an FMU with another description, binary, or further files beside it."""
    copy = folder / path.name
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(copy, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "modelDescription.xml" and xml:
                content = xml(content)
            if name.endswith(".so"):
                for beside in extra:
                    target.writestr(f"{name.rpartition('/')[0]}/{beside}", b"")
                content = binary(content) if binary else content
            target.writestr(name, content)
    return copy


# -- an orderly end ---------------------------------------------------------------------------------


def test_an_orderly_end_is_a_remark_and_what_fits_is_checked(gallery):
    report = checked(gallery("converter_that_ends")[0], "loads", "runs", "repeatability", "state")
    assert report.trusted
    runs = result(report, "runs")
    assert runs.verdict == "remark"
    assert (
        runs.evidence
        == "it ended its simulation at t = 0.8 s by itself, before the 1 s that it declares"
    )
    assert [result(report, name).verdict for name in ("repeatability", "state")] == ["pass", "pass"]


def test_a_step_that_is_discarded_is_no_end(gallery):
    report = checked(gallery("discards")[0], "runs")
    assert report.faults == ["error in a step"]
    assert (
        "it logs no text; by FMI it did not compute the whole step"
        in result(report, "runs").evidence
    )


def test_an_end_with_an_error_in_the_log_is_no_orderly_one(gallery):
    """Exporters set fmi2Terminated whenever a step failed."""
    report = checked(gallery("ends_of_an_error")[0], "runs")
    assert report.faults == ["error in a step"]
    assert (
        "fmi2DoStep returned fmi2Discard: the solver does not converge"
        in result(report, "runs").evidence
    )


@pytest.mark.parametrize(
    ("fault", "time", "words"),
    [
        (
            {"FAULT_DISCARD_AT": 0.0},
            0.0,
            "fmi2DoStep returned fmi2Discard: it logs no text; by FMI it did not compute",
        ),
        (
            {"FAULT_DISCARD_AT": 0.0, "FAULT_DISCARD_PART": 0.25},
            0.0,
            r"it computed the step up to t = 2\.5e-05 s only",
        ),
        (
            {"STRICT_TIME": 1},
            0.5,
            "fmi2DoStep returned fmi2Error: it logs no text; by FMI it cannot go on from here",
        ),
    ],
)
@pytest.mark.parametrize("isolated", [False, True])
def test_a_status_without_a_word_is_told_in_those_of_fmi(fault, time, words, isolated, tmp_path):
    description = read_description(build(converter("silent", **fault), tmp_path))
    with open_component("c", description, isolated=isolated) as c:
        c.setup(0.0, None)
        c.enter_initialization_mode()
        c.exit_initialization_mode()
        with pytest.raises(ComponentError, match=words):
            c.step(time, 1e-4)


def test_an_end_that_comes_at_once_is_a_fault_and_said_once(gallery):
    report = checked(gallery("ends_at_once")[0], "runs", "repeatability", "memory")
    assert [r.fault for r in report.results if r.fault] == ["ends at once"]
    assert {r.verdict for r in report.results[2:]} == {"not applicable"}


# -- what the machine or this program lacks ----------------------------------------------------------


def without_libm(content):
    """A binary that needs a library which is nowhere."""
    assert b"libm.so.6\0" in content
    return content.replace(b"libm.so.6\0", b"libq.so.3\0")


@linux
def test_a_missing_system_library_is_named_and_said_once(gallery, gfor, tmp_path):
    fmu = changed(gallery("converter")[0], tmp_path, binary=without_libm)
    code, text, _ = gfor("fmu", "check", fmu, "--junit", tmp_path / "out.xml")
    assert code == 2
    assert text.count("it needs libq.so.3, which this machine has not") == 1
    assert "install it" in text
    assert "not supported here: missing system library; that says nothing about the FMU" in text
    assert "ask the author" not in text
    suite = ElementTree.parse(tmp_path / "out.xml").getroot()
    assert (suite.get("failures"), suite.get("errors")) == ("0", "1")
    report = json.loads(gfor("fmu", "check", fmu, "--json")[1])
    assert (report["trusted"], report["faults"]) == (False, [])
    assert report["not_supported"] == ["missing system library"]
    (said,) = [c for c in report["checks"] if c["whose"]]
    assert (said["check"], said["verdict"], said["whose"]) == (
        "loads",
        "not supported",
        "not supported here",
    )


@linux
def test_a_library_that_the_fmu_brings_and_does_not_find_is_its_own_fault(gallery, tmp_path):
    fmu = changed(gallery("converter")[0], tmp_path, binary=without_libm, extra=["libq.so.3"])
    report = checked(fmu, "loads")
    assert report.faults == ["binary not loadable"]
    assert (
        "libq.so.3, which lies beside it and where it does not look"
        in result(report, "loads").evidence
    )


@linux
def test_a_binary_that_is_none_is_the_fmus_fault(gallery, tmp_path):
    fmu = changed(gallery("converter")[0], tmp_path, binary=lambda content: b"no library")
    assert checked(fmu, "loads", "runs").faults == ["binary not loadable"]


@pytest.mark.parametrize(
    ("old", "new", "kind", "words"),
    [
        (b'fmiVersion="2.0"', b'fmiVersion="1.0"', "another version of FMI", "an FMU of FMI 1.0"),
        (b"<CoSimulation", b"<ModelExchange", "no co-simulation", "(for Model Exchange only)"),
    ],
)
def test_what_this_program_does_not_run(old, new, kind, words, gallery, tmp_path):
    fmu = changed(gallery("gain")[0], tmp_path, xml=lambda text: text.replace(old, new))
    report = checked(fmu)
    (only,) = report.results
    assert (only.verdict, only.fault, report.faults) == ("not supported", kind, [])
    assert words in only.evidence


def test_a_description_that_cannot_be_read_is_the_fmus_fault(gallery, tmp_path):
    fmu = changed(gallery("gain")[0], tmp_path, xml=lambda text: text[:300])
    assert checked(fmu).faults == ["unreadable"]


# -- functions that nobody needs ---------------------------------------------------------------------


def test_an_absent_function_matters_where_it_is_declared(gallery):
    fine = checked(gallery("converter_without_a_function")[0], "loads", "repeatability", "reset")
    assert fine.trusted
    loads = result(fine, "loads")
    assert (loads.verdict, result(fine, "reset").verdict) == ("remark", "pass")
    assert (
        loads.evidence
        == "its binary has no fmi2DeSerializeFMUstate, which nothing that it declares needs"
    )
    broken = checked(gallery("missing_function")[0], "loads", "runs", "state")
    assert broken.faults == ["missing function"]
    assert {r.verdict for r in broken.results[2:]} == {"not applicable"}


# -- the archive -------------------------------------------------------------------------------------


def test_a_file_listed_twice_matters_where_its_bytes_differ(gallery, tmp_path):
    plain = gallery("gain")[0]
    with pytest.warns(UserWarning, match="Duplicate name"):
        same, other = same_bytes(tmp_path, plain), other_bytes(tmp_path, plain)
    report = checked(same, "loads")
    assert report.trusted
    archive = result(report, "archive")
    assert (archive.verdict, archive.evidence) == (
        "remark",
        "it lists extra/a.txt twice, with equal bytes",
    )
    assert (extract(same, tmp_path / "out") / "extra" / "a.txt").read_bytes() == b"1"
    assert checked(other).faults == ["hostile archive"]
    with pytest.raises(HostileFmuError, match=r"the same file as 'extra/a\.txt', with other bytes"):
        extract(other)


# -- calls that only we make -------------------------------------------------------------------------


def test_a_crash_of_a_forbidden_call_is_a_remark_with_its_place(gallery):
    report = checked(
        gallery("converter_that_forbidden_calls_crash")[0], "call_order", "repeatability"
    )
    assert report.trusted
    said = result(report, "call_order")
    assert (said.verdict, said.whose) == ("remark", "provoked by a forbidden call")
    assert (
        "after a step before initialisation, crash: its process died with SIGSEGV in fmi2DoStep"
        in said.evidence
    )
    assert result(report, "repeatability").verdict == "pass"


def test_a_crash_of_an_allowed_call_in_the_same_check_is_a_fault(gallery):
    report = checked(gallery("crash_at_once")[0], "call_order")
    assert report.faults == ["crash"]
    assert result(report, "call_order").whose == "the FMU"


# -- relays ------------------------------------------------------------------------------------------


def test_a_relay_switches_when_the_step_lets_it(gallery):
    only = ("delay", "step_invariance", "internal_step")
    report = checked(gallery("tank")[0], *only)
    assert report.trusted
    said = result(report, "step_invariance")
    assert said.evidence.startswith(
        "relay switches at other moments with another step, and nothing else differs"
    )
    assert result(report, "internal_step").verdict == "not applicable"
    for wrong in ("tank_by_calls", "tank_beside_a_counter"):
        assert checked(gallery(wrong)[0], *only).faults == ["step-dependent answer"], wrong


# -- every fault has a remedy ------------------------------------------------------------------------


@linux
def test_an_fmu_that_leaves_a_process_with_each_instance_gets_a_verdict(tmp_path):
    path = build(converter("forks", FAULT_FORK=1), tmp_path)
    found = check_fmu(
        path, None, Limits(seconds=10.0, tasks=20), ("independence", "memory"), run_for=0.3
    )
    first, then = found.results[-2:]
    assert first.fault == "process left behind"
    assert first.evidence.startswith("after its last instance was freed, ")
    assert "ends with its instance" in first.remedy
    assert then.verdict == "not applicable"
    assert then.evidence == "because it left a process behind in 'independence', and would again"


def faults_of(function):
    """Names of faults that calls of a function state, in all modules: one, or one of two by a condition."""
    rooms = ("acceptance", "binding", "fmi")
    for path in (p for room in rooms for p in Path("orchestrator", "devices", room).rglob("*.py")):
        for call in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(call, ast.Call) and getattr(call.func, "id", "") == function:
                inside = [part for a in call.args[1:2] for part in (a, *ast.walk(a))]
                choices = [
                    c
                    for part in inside
                    if isinstance(part, ast.IfExp)
                    for c in (part.body, part.orelse)
                ]
                yield from (
                    c.value for c in (*call.args[1:2], *choices) if isinstance(c, ast.Constant)
                )


def faults_returned():
    """First words of pairs of texts that functions of the checks return: a fault, and what shows it."""
    for path in (
        *Path("orchestrator/devices/acceptance/checks").glob("*.py"),
        *Path("orchestrator/devices/binding").glob("*.py"),
    ):
        for part in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(part, ast.FunctionDef) and "tuple[str, str]" in ast.unparse(
                part.returns or ast.Constant("")
            ):
                for end in ast.walk(part):
                    pair = end.value if isinstance(end, ast.Return) else None
                    if isinstance(pair, ast.Tuple) and isinstance(pair.elts[0], ast.Tuple):
                        pair = pair.elts[0]
                    if (
                        isinstance(pair, ast.Tuple)
                        and isinstance(pair.elts[0], ast.Constant)
                        and pair.elts[0].value
                    ):
                        yield pair.elts[0].value


def test_every_fault_that_is_named_has_a_remedy():
    returned = {fault for fault in faults_returned() if fault is not None}
    assert {"wrong sign", "keeps moving", "wrong axes"} <= returned
    named = {
        *returned,
        *faults_of("failed"),
        *faults_of("HostileFmuError"),
        "hostile archive",
        *_REFUSED.values(),
    }
    assert len(named) > 40
    assert named - set(REMEDIES) - set(OF_DLLS) == set()


def test_a_fault_without_a_remedy_is_named_with_the_way_to_give_it_one():
    with pytest.raises(ValueError, match=r"'drifts' has no remedy; give it one with add_remedies"):
        failed("rest", "drifts", "it moves by 0.1 pu")
