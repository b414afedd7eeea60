"""Scenarios of ``gfor run`` in several processes: the same results, and nothing left when they are ended."""

import json
import os
import pickle
import re
import signal
import sys
import threading
import time
from pathlib import Path

import pytest

from orchestrator.cases.case import BUILT_IN
from orchestrator.core.errors import (
    CaseError,
    ComponentError,
    CosimError,
    ErrorKind,
    InputError,
    NotFiniteError,
    Problem,
)
from orchestrator.core.interrupts import calls
from orchestrator.face.cli import run, side_by_side
from orchestrator.face.cli.side_by_side import SideBySide, number_of_workers
from tests.face.cli.test_resume import checkpoints_in, finished, started, values_of, write_case

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="elsewhere scenarios run one after the other"
)

ERRORS = (
    ComponentError("gfor", "fmi2DoStep", "fmi2Error", "it diverges", 1.5, ErrorKind.HANG),
    NotFiniteError("gfor", "p", float("inf"), 2.0),
    CaseError("case.toml", [Problem("[solver]", "it is missing", ErrorKind.INPUT)]),
    InputError("no"),
)


@pytest.mark.parametrize("error", ERRORS, ids=lambda error: type(error).__name__)
def test_errors_come_through_a_pipe_as_they_are(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert (str(again), again.kind, again.exit_code) == (str(error), error.kind, error.exit_code)
    assert {**vars(again)} == {**vars(error)}


def printed(process):
    text, error = process.communicate(timeout=300)
    return process.returncode, text, error


def untimed(text, folder):
    """What a run printed, without its speed and the folder."""
    lines, count = re.subn(r"[\d.]+( to [\d.]+)? times as fast as real time", "", text)
    assert count == 1
    return lines.replace(str(folder), "")


@pytest.mark.slow
@pytest.mark.parametrize("own", ["", "isolated = true\n"])
def test_all_files_are_those_of_one_after_the_other(warm, tmp_path, own):
    text = (BUILT_IN / "infinite_bus" / "case.toml").read_text(encoding="utf-8")
    case = tmp_path / "case.toml"
    case.write_text(
        text.replace("[components.gfor]\n", f"[components.gfor]\n{own}"), encoding="utf-8"
    )
    assert own in case.read_text(encoding="utf-8")
    found, drawn = [], not own
    for workers in (1, 2):
        out = tmp_path / str(workers)
        words = (case, "--stop", "1.3", "--linear", "--out", out, "--workers", workers)
        process = started(tmp_path / "tmp", *words, drawn=drawn, warm=warm)
        code, said, error = printed(process)
        assert code == 0, error
        assert list((tmp_path / "tmp").iterdir()) == []
        found.append((values_of(out, drawn=drawn), untimed(said, out), error.replace(str(out), "")))
    assert len([name for name in found[0][0] if name.endswith("trajectory.nc")]) > 1
    assert found[0] == found[1]


def processes_of(group):
    return [p for p in os.listdir("/proc") if p.isdigit() and _group(p) == group]


def _group(process):
    try:
        with open(f"/proc/{process}/stat", encoding="utf-8", errors="replace") as file:
            state, _, group = file.read().rpartition(")")[2].split()[:3]
    except OSError:
        return None
    return None if state == "Z" else int(group)


def both_under_way(process, out):
    end = time.monotonic() + 240
    while len(checkpoints_in(out)) < 2 and process.poll() is None and time.monotonic() < end:
        time.sleep(0.01)
    assert process.poll() is None, process.communicate()


@pytest.fixture(scope="module")
def long(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("long") / "events.toml", stop=30.0)


WORDS = ("--scenario", "gfor", "--scenario", "pod_pq", "--workers", "2")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_all_and_the_run_goes_on(long, warm, tmp_path, number):
    """Ctrl-C of a terminal reaches all processes of the group, SIGTERM the command alone."""
    out = tmp_path / "out"
    process = started(
        tmp_path / "tmp", long, *WORDS, "--out", out, "--checkpoint", "0.05", warm=warm
    )
    both_under_way(process, out)
    (os.killpg if number == signal.SIGINT else os.kill)(process.pid, number)
    code, text, error = printed(process)
    how = "interrupted" if number == signal.SIGINT else "ended by SIGTERM"
    assert code == (130 if number == signal.SIGINT else 143), error
    assert f"scenario 'gfor': {how} at t = " in error
    assert f"scenario 'pod_pq': {how} at t = " in error
    assert "gfor run --resume" in error
    assert "Traceback" not in error
    assert text.startswith("interrupted in SG + GFOR, SG + GFOR POD-PQ\n")
    assert list((tmp_path / "tmp").iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert [one["interrupted"] for one in summary["scenarios"]] == [True, True]


@pytest.mark.slow
def test_a_killed_command_takes_its_copies_along_and_goes_on(case, warm, tmp_path):
    out = tmp_path / "out"
    process = started(
        tmp_path / "tmp", case, *WORDS, "--out", out, "--checkpoint", "0.05", warm=warm
    )
    both_under_way(process, out)
    assert len(processes_of(process.pid)) == 3
    process.kill()
    process.communicate()
    end = time.monotonic() + 60
    while processes_of(process.pid) and time.monotonic() < end:
        time.sleep(0.01)
    assert processes_of(process.pid) == []
    finished(tmp_path / "tmp", "--resume", out, "--workers", "2", warm=warm)
    finished(tmp_path / "tmp", case, *WORDS, "--out", tmp_path / "whole", warm=warm)
    assert values_of(out) == values_of(tmp_path / "whole")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("case") / "events.toml", stop=3.0)


# -- the copies themselves -----------------------------------------------------------------------------


def copies_of(process):
    return [
        int(pid) for pid in Path(f"/proc/{process}/task/{process}/children").read_text().split()
    ]


def outcomes_of(work, workers=2, count=4):
    seen, before = [], copies_of(os.getpid())
    with SideBySide(workers, work) as copies:
        outcomes = copies.outcomes(count, lambda *told: seen.append(told))
    left = [pid for pid in copies_of(os.getpid()) if pid not in before]
    assert not left
    return outcomes, seen


def test_each_tells_its_progress_and_they_come_in_order():
    def work(index, report):
        report(index, 10)
        time.sleep(0.1 if index == 0 else 0.0)
        return (
            CosimError(f"number {index} of process {os.getpid()}") if index > 2 else KeyError(index)
        )

    outcomes, seen = outcomes_of(work, workers=4)
    assert [index for index, _ in outcomes] == [0, 1, 2, 3]
    assert sorted(seen) == [(index, index, 10) for index in range(4)]
    assert str(os.getpid()) not in str(outcomes[3][1])


def test_after_a_failure_no_other_begins_and_those_under_way_end():
    def work(index, report):
        time.sleep(0.3 * index)
        return CosimError(str(index))

    outcomes, _ = outcomes_of(work)
    assert [index for index, _ in outcomes] == [0, 1]


def test_a_copy_that_dies_is_named_with_a_way_out():
    def work(index, report):
        os.kill(os.getpid(), signal.SIGKILL)

    outcomes, _ = outcomes_of(work, count=1)
    ((_, error),) = outcomes
    assert error.kind is ErrorKind.WORKER_LOST
    assert "ended by SIGKILL" in str(error)
    assert "--workers 1" in str(error)


def test_an_error_of_ours_ends_the_copy_with_its_place(capfd):
    outcomes, _ = outcomes_of(lambda index, report: 1 / index, count=1)
    assert "with exit code 1" in str(outcomes[0][1])
    assert "ZeroDivisionError" in capfd.readouterr().err


def test_an_interrupt_is_passed_on_once():
    def work(index, report):
        try:
            report(0, 1)
            time.sleep(60)
        except KeyboardInterrupt:
            return CosimError(calls.how)

    began = set()

    def interrupt(index, *_):
        began.add(index)
        if began == {0, 1}:
            os.kill(os.getpid(), signal.SIGINT)

    with calls.terminable(), SideBySide(2, work) as copies:
        outcomes = copies.outcomes(3, interrupt)
    assert [(index, str(error)) for index, error in outcomes] == [
        (0, "interrupted"),
        (1, "interrupted"),
        (2, ""),
    ]
    assert isinstance(outcomes[2][1], KeyboardInterrupt)


def test_a_signal_while_the_copies_are_made_leaves_none(monkeypatch):
    before, fork = copies_of(os.getpid()), os.fork

    def interrupted():
        process = fork()
        if process:
            os.kill(os.getpid(), signal.SIGTERM)  # it waits until all are made
        return process

    monkeypatch.setattr(side_by_side.os, "fork", interrupted)
    with calls.terminable(), pytest.raises(KeyboardInterrupt), SideBySide(1, lambda *_: None):
        pass
    end = time.monotonic() + 10.0  # on a busy machine the end of a process takes a moment
    while copies_of(os.getpid()) != before and time.monotonic() < end:
        time.sleep(0.01)
    assert copies_of(os.getpid()) == before


def test_a_signal_that_another_thread_takes_waits_for_the_copies_as_well(monkeypatch):
    """The mask of the main thread does not hold it back: BLAS or a progress bar may have threads of their own."""
    before, fork = copies_of(os.getpid()), os.fork
    ready, over = threading.Event(), threading.Event()
    other = threading.Thread(target=lambda: (ready.set(), over.wait()))
    other.start()
    ready.wait()

    def interrupted():
        process = fork()
        if process:
            signal.pthread_kill(other.ident, signal.SIGTERM)
            time.sleep(0.05)  # Python handles it in the main thread, here at the latest
        return process

    monkeypatch.setattr(side_by_side.os, "fork", interrupted)
    with calls.terminable(), pytest.raises(KeyboardInterrupt), SideBySide(2, lambda *_: None):
        pass
    over.set()
    other.join()
    assert [pid for pid in copies_of(os.getpid()) if pid not in before] == []


def test_an_interrupt_when_all_is_done_is_not_lost():
    def work(index, report):
        try:
            report(0, 1)
            time.sleep(60)
        except KeyboardInterrupt:
            return CosimError("its last step was done")

    with pytest.raises(KeyboardInterrupt), calls.terminable(), SideBySide(1, work) as copies:
        copies.outcomes(1, lambda *_: os.kill(os.getpid(), signal.SIGINT))


@pytest.mark.parametrize(
    ("own", "words", "made"),
    [
        ("", (), [2]),
        ("isolated = true\n", (), []),
        ("isolated = true\n", ("--workers", 2), [2]),
    ],
)
def test_others_fmus_run_one_scenario_after_the_other_unless_it_is_asked_for(
    gfor, monkeypatch, tmp_path, own, words, made
):
    monkeypatch.setattr(side_by_side, "number_of_cores", lambda: 2)
    text = (BUILT_IN / "infinite_bus" / "case.toml").read_text(encoding="utf-8")
    (tmp_path / "case.toml").write_text(
        text.replace("[components.gfor]\n", f"[components.gfor]\n{own}")
    )
    seen = []

    class Seen(SideBySide):
        def __enter__(self):
            seen.append(self._number)
            raise InputError("that is enough")

    monkeypatch.setattr(run, "SideBySide", Seen)
    monkeypatch.setattr(run, "_run_into", _stop)
    gfor("run", tmp_path / "case.toml", "--stop", "0.1", "--out", tmp_path / "out", *words)
    assert seen == made


def _stop(*_):
    raise InputError("that is enough")


def test_how_many(monkeypatch):
    monkeypatch.setattr(side_by_side, "number_of_cores", lambda: 2)
    assert [number_of_workers(None, n) for n in (1, 2, 5)] == [1, 2, 2]
    assert [number_of_workers(w, 5) for w in (1, 3, 9)] == [1, 3, 5]
    monkeypatch.setattr(side_by_side.sys, "platform", "win32")
    assert number_of_workers(4, 5) == 1
