"""Checks of what a controller DLL is and declares: file, structures, start, messages."""

import re
import sys

from fmus.vendor_dll.interface import CALLS, NEEDED, DllInterface, DllParameter, Signal
from orchestrator.devices.acceptance.checks.base import CheckResult, Verdict, Whose
from orchestrator.devices.acceptance.controller_dll.file_head import FileHead
from orchestrator.devices.acceptance.controller_dll.host import START, Heard
from orchestrator.devices.acceptance.controller_dll.results import (
    dll_check,
    failed,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.controller_dll.subject import DllSubject
from orchestrator.devices.sandbox.dll_process import DllNotLoadedError

_NAME_IN_C = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_LOADED_HERE = {"linux": ("ELF", "PE"), "win32": ("PE",), "darwin": ("Mach-O",)}
"""Kinds of files that are run, those for Windows under Wine on Linux."""
_MODES = (0, 1, 2, 3)  # that the interface knows: said nothing, EMT, RMS, both
_BITS = 64  # of the processes that load a DLL here
_SAMPLES_OF_CHANGE = 50  # after which what it declares is asked for again


@dll_check("dll_file")
def check_file(subject: DllSubject) -> CheckResult:
    name, head = "dll_file", subject.head
    if not head.kind:
        return failed(name, "no library", "it is neither an ELF file nor a Windows DLL")
    wrong = _wrong_names(name, head)
    if wrong is not None:
        return wrong
    about = f"{head.kind}, {head.bits} bit{f', {head.processor}' if head.processor else ''}"
    if head.bits != _BITS:
        exported = _exports_in_words(head)
        return CheckResult(
            name,
            Verdict.NOT_SUPPORTED,
            f"{about}{exported}; a host of {head.bits} bit must load it, and processes here have {_BITS}",
            f"{head.bits} bit",
            f"check the author's build for {_BITS} bit, and this one in a program of {head.bits} bit",
            whose=Whose.HERE,
        )
    if head.kind not in _LOADED_HERE.get(sys.platform, ()):
        return failed(name, "other processor", f"{about}, and this system is {sys.platform}")
    try:
        process = subject.process()
    except DllNotLoadedError as error:
        return failed(name, "not loadable", str(error))
    functions = ("GetInfo", *CALLS)
    there = process.do([["has", f"Model_{call}"] for call in functions])
    absent = [call for call, has in zip(functions, there, strict=True) if not has]
    missing = [f"Model_{call}" for call in absent if call in ("GetInfo", *NEEDED)]
    if missing:
        return failed(name, "missing function", f"it has no {' and no '.join(missing)}")
    others = [f"Model_{call}" for call in absent if call not in ("PrintInfo", "Iterate")]
    if others:
        return remarked(
            name,
            f"{about}; it has no {', '.join(others)}",
            "hosts here do without; some programs ask for every function of the header",
        )
    return passed(name, f"{about}; its functions stand under their own names")


def _exports_in_words(head: FileHead) -> str:
    """Exports of the interface in the file of another host, in words."""
    if head.exports is None:
        return ""
    needed = [f"Model_{call}" for call in ("GetInfo", *NEEDED)]
    absent = [name for name in needed if name not in head.exports]
    if absent:
        return f"; it exports no {', '.join(absent)}"
    return "; it exports what every host calls"


def _wrong_names(name: str, head: FileHead) -> CheckResult | None:
    """The fault of a file that has the functions under other names."""
    plain = head.exports or ()
    decorated = [call for call in head.decorated if call not in plain]
    if decorated:
        return failed(
            name, "decorated names", f"{', '.join(decorated[:3])} stand there as of __stdcall"
        )
    mangled = [call for call in head.mangled if call not in plain]
    needed = ["Model_GetInfo", *(f"Model_{call}" for call in NEEDED)]
    if (set(mangled) & set(needed) and head.exports is not None) or set(needed) <= set(mangled):
        return failed(name, "mangled names", f"{', '.join(mangled[:3])} stand there as of C++")
    if head.exports is not None and not set(needed) <= set(plain):
        absent = [call for call in needed if call not in plain]
        return failed(name, "missing function", f"it has no {' and no '.join(absent)}")
    return None


@dll_check("dll_declarations")
def check_declarations(subject: DllSubject) -> CheckResult:
    name = "dll_declarations"
    try:
        interface = subject.interface
    except ValueError as error:
        return failed(name, "another layout", str(error))
    faults = interface.faults()
    if faults:
        fault = "bad declaration" if interface.outputs else "another layout"
        return failed(name, fault, "; ".join(faults[:3]))
    outside = _outside_of_bounds(interface)
    if interface.mode not in _MODES:
        outside.append(f"EMT_RMS_Mode is {interface.mode}, which is none of 0 to 3")
    if outside:
        return failed(name, "bad declaration", "; ".join(outside[:3]))
    doubtful = _doubtful(interface)
    counts = (
        f"{len(interface.inputs)} inputs, {len(interface.outputs)} outputs, {len(interface.parameters)} parameters, "
        f"{sum(interface.states)} states"
    )
    if doubtful:
        return remarked(name, f"{counts}; {'; '.join(doubtful[:3])}", "ask its author to mend that")
    return passed(name, f"{counts}; sample time {interface.sample_time:g} s")


def _outside_of_bounds(interface: DllInterface) -> list[str]:
    found = []
    for row in interface.parameters:
        low, high = row.minimum, row.maximum
        if isinstance(row.default, str) or (low is None and high is None):
            continue
        if not (low or 0) <= row.default <= (high or 0):
            found.append(
                f"the default {row.default:g} of {row.name!r} is outside of its bounds {low or 0:g} to {high or 0:g}"
            )
    return found


def _doubtful(interface: DllInterface) -> list[str]:
    named: tuple[Signal | DllParameter, ...] = (
        *interface.inputs,
        *interface.outputs,
        *interface.parameters,
    )
    names = [row.name for row in named]
    found = [f"{name!r} is no name in C" for name in names if not _NAME_IN_C.fullmatch(name)]
    if interface.sample_time <= 0:
        found.append("it declares no sample time, so that a host chooses one")
    if not interface.texts["ModelName"]:
        found.append("it declares no ModelName")
    return found


@dll_check("dll_first_call")
def check_first_call(subject: DllSubject) -> CheckResult:
    name = "dll_first_call"
    before = subject.interface
    with subject.other_process() as process:
        session = subject.session(process)
        one = subject.instance(process, largest=0.0)
        session.start(one)
        heard = subject.play(session)
        bad = next((h for h in heard if h.code == 2), None)
        if bad is not None:
            said = bad.text or "(no message)"
            return failed(name, "does not start", f"Model_{bad.call} returns an error: {said}")
        odd = _unknown_code(heard)
        if odd is not None:
            return failed(name, "unknown return value", odd)
        session.samples(one, 1, _SAMPLES_OF_CHANGE)
        subject.play(session)
        changed, of_parameters = one.changes()
        if changed:
            return failed(
                name, "changes the host's", f"in its structure it has changed {', '.join(changed)}"
            )
        (after,) = process.do([["interface"]])
    if after != before.as_json() and repr(after) != repr(before.as_json()):
        now = type(before).from_json(after)
        if now != before and repr(now) != repr(before):
            return failed(
                name, "declarations change", "Model_GetInfo tells something else after a run"
            )
    if of_parameters:
        return remarked(
            name,
            "it has changed the values of its parameters, which the host does not see",
            "have it return a message that says which value it takes instead",
        )
    called = [f"Model_{call}" for call in START if call in before.calls]
    return passed(name, f"{', '.join(called)} and {_SAMPLES_OF_CHANGE} samples go well")


def _unknown_code(heard: list[Heard]) -> str | None:
    bad = next((h for h in heard if h.code not in (0, 1, 2)), None)
    if bad is None:
        return None
    return f"Model_{bad.call} returns {bad.code} at {bad.time:g} s; the interface knows 0, 1 and 2"


@dll_check("dll_messages")
def check_messages(subject: DllSubject) -> CheckResult:
    name = "dll_messages"
    subject.run()
    odd = _unknown_code(subject.heard)
    if odd is not None:
        return failed(name, "unknown return value", odd)
    silent = next(
        (h for h in subject.heard if h.code in (1, 2) and not (h.text or "").strip()), None
    )
    if silent is not None:
        return failed(
            name,
            "no message",
            f"Model_{silent.call} returns {silent.code} at {silent.time:g} s, and sets no text",
        )
    messages = [h for h in subject.reference if h.code == 1]
    samples = sum(h.call == "Outputs" for h in subject.reference)
    if len(messages) > samples / 2:
        return remarked(
            name,
            f"it has a message in {len(messages)} of {samples} samples: {messages[0].text}",
            "have it say something once: a host shows each",
        )
    texts = sorted({h.text for h in subject.heard if h.text})
    return passed(
        name, f"{len(texts)} different texts" if texts else "it says nothing, and returns 0"
    )
