"""``gfor run --resume`` and signals, with real processes that are killed at any moment."""

import json
import os
import random
import re
import signal
import subprocess
import sys
import time

import pytest
import xarray as xr

from orchestrator.cases.case import BUILT_IN
from orchestrator.face.cli.checkpoints import StudyCheckpoints
from orchestrator.output.results.staging import mend, staged
from tests.support.undrawn import DRAWN, UNDRAWN

pytestmark = [
    pytest.mark.usefixtures("undrawn"),
    pytest.mark.skipif(
        sys.platform == "win32", reason="no process can be sent these signals there"
    ),
]

EVENT = """
[[events]]
type = "load_change"
time = "{time} s"
component = "grid"
load = "load_2"
scale = {scale}
"""


TIMES = (0.2, 0.7, 0.7005, 0.9333, 1.1)
SCALES = (1.05, 0.98, 0.97, 1.0, 1.02)


def write_case(path, stop=1.25, times=TIMES):
    """The two areas, five events, short, to be ended at any moment."""
    text = (BUILT_IN / "two_area" / "case.toml").read_text(encoding="utf-8")
    head, _, tail = text.partition("[[events]]")
    tail = tail[tail.index("\n[") :]
    events = "".join(EVENT.format(time=t, scale=s) for t, s in zip(times, SCALES, strict=True))
    head = head.replace('stop_time = "20 s"', f'stop_time = "{stop:g} s"')
    path.write_text(f"{head}{events}{tail}", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return write_case(tmp_path_factory.mktemp("case") / "events.toml")


def started(tmp, *words, drawn=False, warm=None):
    """From its very beginning; if ``warm`` is given, with its imports behind it."""
    tmp.mkdir(parents=True, exist_ok=True)
    env = os.environ | {"TMPDIR": str(tmp)}
    if warm:
        return warm.started("run", *words, env=env, drawn=drawn)
    return subprocess.Popen(
        [*(DRAWN if drawn else UNDRAWN), "run", *map(str, words)],
        env=env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finished(tmp, *words, drawn=False, warm=None):
    process = started(tmp, *words, drawn=drawn, warm=warm)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 0, error
    return error


def values_of(folder, *, drawn=False):
    """Every file of a run without the figures of its speed and the run's id; pictures only where they were drawn.

    A kill after the last file leaves the lock and checkpoints that were being removed, under hidden names: the next
    start removes them (`test_a_kill_while_the_checkpoints_go_leaves_whole_results`).
    """
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if (
            path.is_dir()
            or path.name == "manifest.json"
            or name == ".lock"
            or DONE_WITH.match(name)
            or (path.suffix == ".png" and not drawn)
        ):
            continue
        if path.suffix == ".nc":
            with xr.open_dataset(path) as data:
                attributes = {
                    key: value for key, value in data.attrs.items() if key not in ("run", "date")
                }
                found[name] = attributes, {str(n): data[n].values.tobytes() for n in data.variables}
        elif path.name == "summary.json":
            found[name] = json.loads(path.read_text(encoding="utf-8"))
            for scenario in found[name]["scenarios"]:
                for speed in ("steps_per_second", "share_in_fmus", "real_time_factor", "threads"):
                    del scenario[speed]
        else:
            found[name] = path.read_bytes()
    return found


DONE_WITH = re.compile(r"\.part-[^/]+\.done-with/")
WORDS = ("--scenario", "gfor", "--scenario", "pod_pq")


@pytest.fixture(scope="module")
def undisturbed(case, warm, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    begun = time.monotonic()
    finished(folder / "tmp", case, *WORDS, "--out", folder / "out", warm=warm)
    return folder / "out", time.monotonic() - begun


def checkpoints_in(out):
    """The whole ones: one that is being written has a hidden name until then, which ends in the same way."""
    return list(out.glob(".checkpoints/[!.]*.checkpoint"))


def stopped_at_random(process, folder, longest, number):
    """Wait for the first checkpoint, and a little longer; send the signal."""
    end = time.monotonic() + 120
    while not checkpoints_in(folder) and process.poll() is None and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(random.uniform(0, 0.5 * longest))
    process.send_signal(number)
    return process.communicate(timeout=120)


@pytest.mark.slow
@pytest.mark.parametrize("attempt", range(5))
def test_a_killed_run_goes_on_to_the_last_bit(case, undisturbed, warm, tmp_path, attempt):
    """By night, what goes on is a process from its very beginning."""
    out = tmp_path / "out"
    words = (case, *WORDS, "--out", out, "--checkpoint", "0.05")
    process = started(tmp_path / "tmp", *words, warm=warm)
    stopped_at_random(process, out, undisturbed[1], signal.SIGKILL)
    if process.returncode == -signal.SIGKILL and (out / ".checkpoints").exists():
        finished(tmp_path / "tmp", "--resume", out, warm=None if attempt else warm)
    assert values_of(out) == values_of(undisturbed[0])
    assert not (out / ".checkpoints").exists()


@pytest.mark.slow
@pytest.mark.parametrize("attempt", range(3))
def test_sigterm_leaves_nothing_behind_and_the_run_goes_on(
    case, undisturbed, warm, tmp_path, attempt
):
    """What is ended is a process from its very beginning."""
    out = tmp_path / "out"
    process = started(tmp_path / "tmp", case, *WORDS, "--out", out, "--checkpoint", "0.05")
    _, error = stopped_at_random(process, out, undisturbed[1], signal.SIGTERM)
    assert list((tmp_path / "tmp").iterdir()) == []
    with pytest.raises(ProcessLookupError):
        os.killpg(process.pid, 0)
    if process.returncode != 0:
        assert process.returncode == 143, error
        assert "ended by SIGTERM" in error
        finished(tmp_path / "tmp", "--resume", out, warm=warm)
    assert values_of(out) == values_of(undisturbed[0])


@pytest.mark.slow
def test_a_killed_run_on_several_threads_goes_on_with_another_number_of_them(warm, tmp_path):
    """And with pictures, which are the same as well."""
    case = write_case(tmp_path / "events.toml", stop=3.0)
    words = (case, "--native", "--scenario", "pod_pq", "--threads")
    finished(tmp_path / "tmp", *words, 1, "--out", tmp_path / "whole", drawn=True, warm=warm)
    out = tmp_path / "out"
    process = started(tmp_path / "tmp", *words, 3, "--out", out, "--checkpoint", "0.01", warm=warm)
    stopped_at_random(process, out, 0.1, signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    words = ("--resume", out, "--threads", 2)
    assert "it goes on from t = " in finished(tmp_path / "tmp", *words, drawn=True, warm=warm)
    assert values_of(out, drawn=True) == values_of(tmp_path / "whole", drawn=True)


@pytest.mark.slow
def test_a_run_killed_before_its_first_checkpoint_says_that_it_begins_anew(warm, tmp_path):
    words, out = ("infinite_bus", "--scenario", "dip", "--stop", "1.5"), tmp_path / "out"
    process = started(tmp_path / "tmp", *words, "--out", out, "--checkpoint", "600", warm=warm)
    while not (out / ".checkpoints" / "request.json").exists() and process.poll() is None:
        time.sleep(0.001)
    process.kill()
    process.communicate(timeout=120)
    error = finished(tmp_path / "tmp", "--resume", out, warm=warm)
    assert "scenario 'dip': nothing of it was kept, so it begins at t = 0" in error
    finished(tmp_path / "tmp", *words, "--out", tmp_path / "whole", warm=warm)
    assert values_of(out) == values_of(tmp_path / "whole")


@pytest.mark.slow
def test_an_isolated_fmu_goes_on_in_a_new_process(warm, tmp_path):
    text = (BUILT_IN / "infinite_bus" / "case.toml").read_text(encoding="utf-8")
    own = tmp_path / "isolated.toml"
    own.write_text(
        text.replace("[components.gfor]\n", "[components.gfor]\nisolated = true\n"),
        encoding="utf-8",
    )
    assert own.read_text(encoding="utf-8") != text
    words = (own, "--scenario", "dip", "--stop", "2", "--out")
    finished(tmp_path / "tmp", *words, tmp_path / "whole", warm=warm)
    out = tmp_path / "out"
    process = started(tmp_path / "tmp", *words, out, "--checkpoint", "0.02", warm=warm)
    _, error = stopped_at_random(process, out, 0.2, signal.SIGTERM)
    assert process.returncode == 143, error
    assert list((tmp_path / "tmp").iterdir()) == []
    assert "gfor run --resume" in error
    assert "it goes on from t = " in finished(tmp_path / "tmp", "--resume", out, warm=warm)
    assert values_of(out) == values_of(tmp_path / "whole")


# -- what is asked -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "the case is missing: gfor run CASE"),
        (("--resume", "{}"), "there is no interrupted run in it"),
        (
            ("two_area", "--resume", "{}"),
            "goes on with the run as it was asked for, so CASE cannot go with it",
        ),
        (("--resume", "{}", "--set", "a.b=1", "--no-csv"), "so --set, --no-csv cannot go with it"),
        (("--resume", "{}", "--checkpoint", "0"), "so --checkpoint 0 cannot go with it"),
    ],
)
def test_what_cannot_be_resumed_is_refused(gfor, tmp_path, words, said):
    code, _, error = gfor("run", *(word.format(tmp_path) for word in words))
    assert code == 2
    assert said in " ".join(error.split())


def test_a_request_that_cannot_be_read_is_refused(gfor, tmp_path):
    (tmp_path / ".checkpoints").mkdir()
    (tmp_path / ".checkpoints" / "request.json").write_text('{"case": 1')
    code, _, error = gfor("run", "--resume", tmp_path)
    assert code == 2
    assert "cannot be read" in error
    assert "start the run anew, without --resume" in " ".join(error.split())


def test_a_run_that_came_to_its_end_leaves_nothing_to_resume(gfor, tmp_path):
    code, _, _ = gfor(
        "run", "infinite_bus", "--scenario", "dip", "--stop", "0.1", "--out", tmp_path
    )
    assert code == 0
    assert not (tmp_path / ".checkpoints").exists()


def test_fmus_without_serialised_states_are_named_or_refused(gfor, tmp_path, monkeypatch):
    from orchestrator.studies.runs import checkpoints  # noqa: PLC0415

    monkeypatch.setattr(
        checkpoints, "why_not_kept", lambda fmu: "it declares no canSerializeFMUstate"
    )
    words = ("run", "infinite_bus", "--scenario", "dip", "--stop", "0.1", "--out", tmp_path)
    code, _, error = gfor(*words)
    assert code == 0
    assert "if it is interrupted, it starts again at t = 0, because of component 'gfor' (" in error
    code, _, error = gfor(*words, "--require-checkpoint")
    assert code == 2
    assert "leave --require-checkpoint out" in error
    code, _, error = gfor(*words, "--checkpoint", "0")
    assert (code, "interrupted" in error) == (0, False)


def test_a_sigterm_after_all_was_done_does_not_change_the_exit_code():
    end = "import atexit, os, sys; from orchestrator.face.cli import main; atexit.register(os.kill, os.getpid(), 15)"
    call = [sys.executable, "-c", f"{end}; sys.argv[1:] = ['--version']; sys.exit(main())"]
    assert subprocess.run(call, check=False, capture_output=True).returncode == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_while_the_checkpoints_go_finds_the_run_done(gfor, tmp_path, monkeypatch, number):
    end = StudyCheckpoints.end

    def interrupted(self, *, whole):
        os.kill(os.getpid(), number)
        end(self, whole=whole)

    monkeypatch.setattr(StudyCheckpoints, "end", interrupted)
    code, _, error = gfor(
        "run", "infinite_bus", "--scenario", "dip", "--stop", "0.1", "--out", tmp_path
    )
    assert code == 0, error
    assert not [path.name for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_what_a_kill_left_before_the_first_rows_goes_with_the_next_start(gfor, tmp_path):
    """Three killed runs: before any row, while the first rows were written, and with rows, which stay."""
    for number, left in enumerate(("", ".part-7-000000000000.nc", "000000000000.nc")):
        folder = tmp_path / f"dip.part-20260101T00000{number}-0" / "recording"
        folder.mkdir(parents=True)
        if left:
            (folder / left).touch()
    _, _, error = gfor(
        "run", "infinite_bus", "--scenario", "dip", "--stop", "0.1", "--out", tmp_path
    )
    assert "that did not end, or still go on: dip.part-20260101T000002-0;" in error
    assert [path.name for path in tmp_path.glob("*.part-*")] == ["dip.part-20260101T000002-0"]


@pytest.mark.slow
def test_a_kill_while_the_checkpoints_go_leaves_whole_results(warm, tmp_path):
    words = ("infinite_bus", "--scenario", "dip", "--stop", "0.1")
    finished(tmp_path / "tmp", *words, "--out", tmp_path / "whole", warm=warm)
    out = tmp_path / "out"
    process = started(tmp_path / "tmp", *words, "--out", out, warm=warm)
    kept = out / ".checkpoints"
    while not kept.exists() and process.poll() is None:
        time.sleep(0.001)
    while kept.exists() and process.poll() is None:
        time.sleep(0.0002)  # as short as what follows takes, and no processor's time
    process.kill()
    process.communicate(timeout=120)
    assert values_of(out) == values_of(tmp_path / "whole")
    finished(tmp_path / "tmp", *words, "--out", out, warm=warm)
    assert [path.name for path in out.iterdir() if path.name.startswith(".")] == []


def test_results_that_a_kill_left_half_written_give_way(tmp_path):
    (tmp_path / ".part-r1").mkdir()
    (tmp_path / ".part-r1" / "half.csv").write_text("a")
    (tmp_path / ".part-r0.done-with").mkdir()
    mend(tmp_path)
    with staged(tmp_path, "r1") as folder:
        (folder / "whole.csv").write_text("a")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["manifest.json", "whole.csv"]
