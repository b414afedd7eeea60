"""Checks of a controller DLL's time, of the order of its calls, and of inputs that are no numbers."""

import itertools
import math
import struct
from collections.abc import Sequence
from dataclasses import replace

from fmus.vendor_dll.state_trial import SAMPLES
from orchestrator.devices.acceptance.checks.base import CheckResult
from orchestrator.devices.acceptance.controller_dll.host import REAL_CODES, Heard
from orchestrator.devices.acceptance.controller_dll.results import (
    dll_check,
    failed,
    passed,
    remarked,
)
from orchestrator.devices.acceptance.controller_dll.subject import (
    DllSubject,
    differs,
)
from orchestrator.devices.sandbox.dll_process import DllEndedError

_LEAST_PERIODS = 5  # of a sample time of its own, from which it is told
_CLOSE = 1e-6  # part of an output's range in which two runs with slightly other times agree
_MOST_INPUTS = 12  # that are no numbers, one after the other
_NAN_AT = 50  # sample at which an input is no number
_REPLACED = {"not a number": math.nan, "infinite": math.inf}


def _moving(heard: Sequence[Heard]) -> list[int]:
    """Samples in which an output or a state is another one than in the sample before."""
    return [
        k
        for k, (before, now) in enumerate(itertools.pairwise(heard), start=1)
        if (before.outputs, before.states) != (now.outputs, now.states)
    ]


@dll_check("dll_sample_time")
def check_sample_time(subject: DllSubject) -> CheckResult:
    name, step = "dll_sample_time", subject.step
    samples = [h for h in subject.reference if h.call == "Outputs"]
    moving = _moving(samples)
    if not moving:
        return remarked(
            name,
            "none of its outputs and states moves, whatever its inputs do",
            "ask what it waits for; nothing is known of its sample time, and little of its states",
        )
    every = _regular_gap(moving)
    if every:
        return failed(
            name,
            "sample time not as declared",
            f"something moves in every {every}th sample alone: it works every {every * step:g} s, "
            f"and declares {step:g} s",
            works_every=every * step,
        )
    for words, times in _slightly_other_times(step).items():
        heard = _run_at(subject, times)
        worst = _apart(subject, heard, samples)
        if worst > _CLOSE:
            return failed(
                name,
                "misses samples",
                f"where the host's times {words}, an output differs by {worst:.2g} of its range",
            )
    rare = _regular_gap(_moving([replace(h, states=b"") for h in samples]))
    if rare:
        return remarked(
            name,
            f"its states move in every sample, and its outputs in every {rare}th alone",
            f"ask if it means that: with a sample time of {rare * step:g} s hosts would call it less often",
        )
    return passed(
        name, f"it works every {step:g} s, and in none of its samples twice or not at all"
    )


def _regular_gap(moving: Sequence[int]) -> int:
    """Number of samples between two in which it moves, where it is above one and always the same; else 0."""
    gaps = {b - a for a, b in itertools.pairwise(moving)}
    return min(gaps) if len(gaps) == 1 and min(gaps) > 1 and len(moving) >= _LEAST_PERIODS else 0


def _slightly_other_times(step: float) -> dict[str, list[float]]:
    """Times of samples as hosts have them, by what they do, in words."""
    added, time = [0.0], 0.0
    for _ in range(SAMPLES):
        time += step
        added.append(time)
    less = [k * step * (1 - 1e-12) for k in range(SAMPLES + 1)]
    more = [k * step * (1 + 1e-12) for k in range(SAMPLES + 1)]
    return {
        "are added up": added,
        "are a rounding error early": less,
        "are a rounding error late": more,
    }


def _run_at(subject: DllSubject, times: Sequence[float]) -> list[Heard]:
    with subject.other_process() as process:
        session, one = subject.begin(process)
        for sample in range(1, SAMPLES + 1):
            session.sample(one, sample, times[sample])
        return [h for h in subject.play(session) if h.call == "Outputs"]


def _apart(subject: DllSubject, heard: Sequence[Heard], reference: Sequence[Heard]) -> float:
    """The largest difference of a real output, as a part of its range."""
    found = 0.0
    for place in subject.instance().layouts[1].places:
        code = REAL_CODES.get(place.row.data_type)
        if code is None:
            continue
        one, other = (
            [struct.unpack_from(code, h.outputs, place.offset)[0] for h in run]
            for run in (heard, reference)
        )
        spread = max(other) - min(other)
        far = max(abs(a - b) for a, b in zip(one, other, strict=True))
        found = max(found, far / spread if spread > 0 else math.copysign(far, 1))
    return found


@dll_check("dll_not_a_number")
def check_not_a_number(subject: DllSubject) -> CheckResult:
    name = "dll_not_a_number"
    inputs = subject.instance().real_inputs[:_MOST_INPUTS]
    did: dict[str, list[str]] = {}
    with subject.other_process() as process:
        for place in range(len(inputs)):
            for words, value in _REPLACED.items():
                session, one = subject.begin(process, _NAN_AT)
                session.sample(
                    one, _NAN_AT + 1, inputs=bytes(one.with_not_a_number(_NAN_AT + 1, place, value))
                )
                session.samples(one, _NAN_AT + 2, 3)
                subject_words = f"{inputs[place].name} {words}"
                try:
                    heard = subject.play(session)
                except DllEndedError as error:
                    return failed(name, error.fault, f"with {subject_words}: {error}")
                did.setdefault(_what_it_did(subject, heard[-4]), []).append(subject_words)
        after = differs(subject.run(process), subject.reference)
    if after is not None:
        return failed(
            name,
            "not a number stays",
            f"another instance, begun after that, differs from Model_{after.call} at {after.time:g} s on",
        )
    if not inputs:
        return passed(name, "it has no input that could be")
    told = "; ".join(f"{what} ({', '.join(which[:3])})" for what, which in did.items())
    return passed(name, f"{told}; another instance is as sound as before")


def _what_it_did(subject: DllSubject, heard: Heard) -> str:
    if heard.code == 2:
        return "it refuses with an error"
    for place in subject.instance().layouts[1].places:
        code = REAL_CODES.get(place.row.data_type)
        if code and not math.isfinite(struct.unpack_from(code, heard.outputs, place.offset)[0]):
            return "it passes it on to its outputs"
    return "its outputs stay finite"


@dll_check("dll_call_order")
def check_call_order(subject: DllSubject) -> CheckResult:
    name = "dll_call_order"
    with subject.other_process() as process:
        session, one = subject.begin(process, SAMPLES // 2)
        heard = subject.play(session)
        process.do([["call", "GetInfo", 0]])
        for call in ("CheckParameters", "PrintInfo"):
            session.call(one, call, SAMPLES // 2 * session.step)
        subject.play(session)
        session.samples(one, SAMPLES // 2 + 1, SAMPLES - SAMPLES // 2)
        session.call(one, "Terminate", SAMPLES * session.step)
        heard += subject.play(session)
    other = differs(heard, subject.reference)
    if other is not None:
        return failed(
            name,
            "moved by a question",
            "after Model_GetInfo, Model_CheckParameters and Model_PrintInfo between two samples it differs from "
            f"{other.time:g} s on",
        )
    odd = [text for text in map(_ends_at, [subject] * len(_ODD), _ODD) if text]
    if odd:
        return remarked(
            name,
            f"questions between samples change nothing; {'; '.join(odd)}",
            "no host should call so; have it return 2 with a text",
        )
    return passed(name, "questions between samples change nothing; no other order ends its process")


_ODD = (
    ("Outputs",),
    ("Terminate",),
    ("Initialize", "Outputs"),
    ("FirstCall", "Terminate", "Terminate"),
)
"""Orders of calls that the interface does not foresee."""


def _ends_at(subject: DllSubject, calls: tuple[str, ...]) -> str:
    """The end of its process by an odd order of calls, in words; empty where it goes on."""
    with subject.other_process() as process:
        session, one = subject.session(process), subject.instance(process)
        for call in calls:
            session.call(one, call)
        try:
            session.play()
        except DllEndedError as error:
            return f"{', '.join(f'Model_{call}' for call in calls)} alone: {error}"
    return ""
