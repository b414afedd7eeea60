"""A question's process reads and writes where it may, and ends in time."""

import io
import json
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import chdir, redirect_stderr, redirect_stdout, suppress

import pytest

import orchestrator as gfor
from orchestrator.cases.case import BUILT_IN
from orchestrator.face.agents import question, verbs
from orchestrator.face.agents.answers import BusStrengthAnswer, ScreenedModeAnswer
from orchestrator.face.agents.question import Allowance, NoAnswerError, ask
from orchestrator.face.agents.verbs import Verbs, _deciding, _growth_elsewhere
from orchestrator.face.cli import main

WITHIN = """
import json, os, sys
from pathlib import Path
from orchestrator.face.agents.guard import keep_within
root, results, outside = map(Path, sys.argv[1:])
cache = Path(os.environ["XDG_CACHE_HOME"])
keep_within([root], results)
def tried(do):
    try:
        do()
    except PermissionError:
        return "refused"
    return "done"
print(json.dumps({
    "read inside": tried(lambda: (root / "a").read_text()),
    "read outside": tried(lambda: (outside / "a").read_text()),
    "read by a link": tried(lambda: (root / "link").read_text()),
    "read secrets": tried(lambda: Path("/proc/self/environ").read_bytes()),
    "read caches": tried(lambda: (cache / "of_another").read_text()),
    "read own cache": tried(lambda: (cache / "gfor-cosim" / "a").read_text()),
    "write inside": tried(lambda: (root / "b").write_text("b")),
    "write results": tried(lambda: (results / "b").write_text("b")),
    "remove": tried(lambda: os.remove(root / "a")),
    "remove result": tried(lambda: os.remove(results / "b")),
}))
"""


def test_files_are_read_in_roots_and_written_in_results_alone(tmp_path, monkeypatch):
    # the folder of temporary files may be written, and this test stands in it
    elsewhere = tmp_path / "temporary"
    folders = [tmp_path / name for name in ("root", "results", "outside")]
    for folder in [elsewhere, *folders]:
        folder.mkdir()
    root, _, outside = folders
    for folder in (root, outside):
        (folder / "a").write_text("a", encoding="utf-8")
    (root / "link").symlink_to(outside / "a")
    caches = tmp_path / "caches"
    (caches / "gfor-cosim").mkdir(parents=True)
    for file in (caches / "of_another", caches / "gfor-cosim" / "a"):
        file.touch()
    monkeypatch.setenv("TMPDIR", str(elsewhere))
    monkeypatch.setenv("XDG_CACHE_HOME", str(caches))
    monkeypatch.delenv("GFOR_COSIM_CACHE", raising=False)
    done = subprocess.run(
        [sys.executable, "-c", WITHIN, *map(str, folders)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == {
        "read inside": "done",
        "read outside": "refused",
        "read by a link": "refused",
        "read secrets": "refused",
        "read caches": "refused",
        "read own cache": "done",
        "write inside": "refused",
        "write results": "done",
        "remove": "refused",
        "remove result": "done",
    }


def allowance(folder, seconds=60.0):
    return Allowance((folder,), folder / "results", seconds)


@pytest.fixture
def here(monkeypatch):
    """Let commands run in this process, for tests of what is made of what they say."""

    def run(task, allowance, temporary):
        out, err = io.StringIO(), io.StringIO()
        told = redirect_stdout(out), redirect_stderr(err)
        with chdir(temporary), told[0], told[1], suppress(SystemExit):  # argparse's way out
            main(task["words"])
        return out.getvalue().encode(), err.getvalue().encode(), 0

    monkeypatch.setattr(question, "_run", run)


def test_a_case_cannot_read_what_lies_outside(tmp_path):
    root = tmp_path / "root"
    root.mkdir()
    (tmp_path / "secret.csv").write_text("bus,rating_mva\nA,1\n", encoding="utf-8")
    (root / "case.toml").write_text(
        """
name = "curious"
[solver]
step_size = "5 ms"
[power_flow]
grid = "grid"
[components.grid]
model = "phasor_grid"
[network]
pandapower = "case9"
[units]
file = "../secret.csv"
alpha = 0.25
generator = "synchronous_generator_ac4a_phasor"
converter = "gfor_phasor"
[scenarios.base]
""",
        encoding="utf-8",
    )
    with pytest.raises(NoAnswerError, match=r"secret\.csv: it lies outside"):
        Verbs(allowance(root)).modes("case.toml")


def test_a_cache_elsewhere_serves_as_well(tmp_path, monkeypatch):
    monkeypatch.setenv("GFOR_COSIM_CACHE", str(tmp_path / "cache"))
    (weakest, *_) = Verbs(allowance(tmp_path)).scr("wscc9").buses  # of few FMUs
    assert weakest.s_sc_mva > 0


def test_a_command_that_a_signal_ends_says_so(tmp_path, monkeypatch):
    """Not what it said last, such as that it is at work."""
    monkeypatch.setattr(question, "_run", lambda *given: (b"", b"modes: at work, 30 s", -9))
    with pytest.raises(NoAnswerError, match=r"gfor modes two_area .* was ended by signal 9"):
        Verbs(allowance(tmp_path)).modes("two_area")


@pytest.mark.parametrize("name", ["a" * 5_000, "a\0b", "-h", "", "../" * 300 + "etc/passwd"])
def test_what_is_no_name_is_refused_before_anything_starts(tmp_path, name):
    verbs = Verbs(Allowance((tmp_path,), tmp_path / "results", 0.0))
    with pytest.raises(NoAnswerError) as refused:
        verbs.modes(name)
    with pytest.raises(NoAnswerError):
        verbs.check(name)
    assert len(str(refused.value)) < 1_500
    assert not (tmp_path / "results").exists()


def test_a_long_question_is_refused(tmp_path):
    values = {f"grid.{number}": "1" * 900 for number in range(30)}
    with pytest.raises(NoAnswerError, match="at most 20000 are taken"):
        Verbs(allowance(tmp_path)).modes("two_area", "base", values)


def test_a_refusal_comes_without_the_usage(tmp_path, here):
    with pytest.raises(NoAnswerError, match=r"^argument --stop: '-1\.0' must exceed 0"):
        Verbs(allowance(tmp_path)).run_summary("two_area", "base", -1.0)


def test_cases_are_looked_for_where_they_can_be(tmp_path):
    (tmp_path / "own").mkdir()
    (tmp_path / ".hidden").mkdir()
    for place in ("own/case.toml", ".hidden/case.toml"):
        (tmp_path / place).write_text("[components.grid]\n", encoding="utf-8")
    (tmp_path / "other.toml").write_text("[tool]\n", encoding="utf-8")
    (tmp_path / "loop.toml").symlink_to("loop.toml")
    verbs = Verbs(allowance(tmp_path))
    assert verbs.cases().files == [str(tmp_path / "own" / "case.toml")]
    with pytest.raises(NoAnswerError, match=r"loop\.toml: there is no such file"):
        verbs.modes("loop.toml")


def test_each_of_two_servers_writes_into_its_own_folder(tmp_path, monkeypatch):
    written = []

    def asked(words, _):
        written.append(words[words.index("--out") + 1])
        raise NoAnswerError("nobody answers")

    monkeypatch.setattr("orchestrator.face.agents.verbs.ask", asked)
    one, other = Verbs(allowance(tmp_path)), Verbs(allowance(tmp_path))
    for server in (one, other, one):
        with pytest.raises(NoAnswerError, match="nobody answers"):
            server.run_summary("two_area", "base")
    results = tmp_path / "results"
    assert written == [str(results / name) for name in ("run", "server_2/run", "run")]


def test_a_small_question_is_not_stuck_behind_a_large_one_and_makes_no_folder(
    tmp_path, monkeypatch
):
    """Questions that write still take turns."""
    at_work, most, both = [], [], threading.Barrier(2, timeout=10)

    def run(task, allowance, temporary):
        writes = "--out" in task["words"]
        at_work.append(writes)
        most.append(at_work.count(True))
        if not writes:
            both.wait()
        at_work.remove(writes)
        return b"1", b"", 0

    monkeypatch.setattr(question, "_run", run)
    asked = [["modes"], ["scr"], ["run", "--out", "a"], ["screen", "--out", "b"]]
    with ThreadPoolExecutor() as threads:
        assert [*threads.map(lambda words: ask(words, allowance(tmp_path)), asked)] == [1] * 4
    assert max(most) == 1
    assert not (tmp_path / "results").exists()


def test_who_waits_too_long_for_a_turn_is_told(tmp_path, monkeypatch):
    monkeypatch.setattr(question, "_turns", threading.BoundedSemaphore(1))
    with question._turns, pytest.raises(NoAnswerError, match=r"for more than 0\.01 s now"):
        ask(["modes"], allowance(tmp_path, 0.01))


def test_a_question_ends_in_time(tmp_path):
    with pytest.raises(NoAnswerError, match=r"no answer within 0\.05 s"):
        ask(["modes", "two_area", "--json"], allowance(tmp_path, 0.05))


def test_an_error_is_the_commands_own(tmp_path, here):
    with pytest.raises(NoAnswerError, match="scenario") as refused:
        Verbs(allowance(tmp_path)).modes("two_area", "no_such")
    assert str(BUILT_IN) not in str(refused.value)  # where it is installed is nobody's business


def test_a_slip_in_a_cases_name_gets_the_name_that_is_near(tmp_path):
    with pytest.raises(
        NoAnswerError, match=r"did you mean kundur\? the built-in cases: .*two_area"
    ):
        Verbs(allowance(tmp_path)).modes("kundr")


def test_modes_outside_of_the_range_are_counted_and_can_be_asked_for(tmp_path, monkeypatch):
    asked = []
    stability = {"sentence": "stable", "eigenvalues": 82}
    least = {"frequency_hz": 3.123456789, "damping_percent": 1.0}
    outside = {"oscillatory_modes": 9, "least_damped": least}
    scenario = {"name": "manual", "stable": True, "stability": stability, "modes": []}
    content = {"case": "kundur", "scenarios": [scenario | {"outside_range": outside}]}
    monkeypatch.setattr(
        verbs, "ask", lambda words, _: asked.append(words) or content | {"questions": []}
    )
    (usual,) = Verbs(allowance(tmp_path)).modes("kundur").scenarios
    assert usual.frequency_range_hz == (0.1, 2.0)
    assert (usual.outside_range, usual.least_damped_outside.frequency_hz) == (9, 3.12346)
    Verbs(allowance(tmp_path)).modes("kundur", frequencies_hz=(0.5, 60.0))
    assert [words[words.index("--range") + 1] for words in asked] == ["0.1:2.0", "0.5:60.0"]


def test_an_answer_lists_the_worst_modes_and_counts_the_rest(tmp_path, monkeypatch):
    """An answer on the 118-bus system had 44,734 characters."""
    machines = [
        {"state": f"sg{k}.machine.omega", "magnitude": 1 / k, "angle_deg": 0.0} for k in (1, 2, 3)
    ]
    parts = [{"state": row["state"], "factor": row["magnitude"] / 2} for row in machines]
    modes = [
        {"name": "named" if k == 8 else None, "damping_percent": float(k), "frequency_hz": 1.0}
        | {"real": -1.0, "imag": 6.0, "participation": parts, "shape": machines}
        for k in range(9)
    ]
    one = {"name": "gfor", "stable": True, "modes": modes}
    one["stability"] = {"sentence": "stable", "eigenvalues": 82}
    content = {"case": "ieee118", "scenarios": [one], "questions": []}
    monkeypatch.setattr(verbs, "ask", lambda words, _: content)
    asked = Verbs(allowance(tmp_path))
    (usual,) = asked.modes("ieee118", parts=2).scenarios
    assert [mode.damping_percent for mode in usual.modes] == [0, 1, 2, 3, 8]
    assert usual.left_out == 4
    assert list(usual.modes[0].shape) == ["sg1", "sg2"]
    assert (len(usual.modes[0].participation), usual.modes[0].machines_left_out) == (2, 1)
    (every,) = asked.modes("ieee118", most=200).scenarios
    assert (len(every.modes), every.left_out, every.modes[0].machines_left_out) == (9, 0, 0)
    with pytest.raises(NoAnswerError, match="most = 0: give a whole number from 1 to 200"):
        asked.modes("ieee118", most=0)


@pytest.fixture
def unwanted():
    """A question that its client has cancelled."""
    event = threading.Event()
    event.set()
    token = question.cancelled.set(event)
    yield
    question.cancelled.reset(token)


def test_a_cancelled_question_ends_and_gives_its_turn_away(tmp_path, unwanted):
    """It went on computing for 92 s, and kept its turn."""
    sleeping = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        with pytest.raises(NoAnswerError, match="it was cancelled"):
            question._answered(sleeping, 60.0)
    finally:
        sleeping.kill()
        sleeping.wait()
    taken = threading.BoundedSemaphore(1)
    with (
        taken,
        pytest.raises(NoAnswerError, match="it was cancelled"),
        question._turn(taken, time.monotonic() + 60.0, allowance(tmp_path)),
    ):
        pass


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        (["screen", "two_area", "--scenario", "gfor"], "goes on from what is done"),
        (["modes", "two_area", "--json"], "name one scenario: without it all are computed; "),
        (["modes", "two_area", "--scenario", "gfor"], ""),
        (["fmu", "check", "a.fmu"], "`only` with one check's name takes less; "),
        (["run", "two_area"], "a smaller `stop` takes less; "),
    ],
)
def test_a_question_that_took_too_long_gets_a_remedy_that_is_left(words, remedy):
    told = question._remedy(words)
    assert remedy in told
    assert bool(remedy) == bool(told)


def test_every_figure_of_an_answer_has_six_digits():
    strength = BusStrengthAnswer(bus="bus_1", s_sc_mva=1234.56789, scr=None)
    assert strength.s_sc_mva == 1234.57
    parts = ScreenedModeAnswer(
        name="",
        frequency_hz=1 / 3,
        damping_percent=-1 / 3,
        point="",
        outage="",
        participation={"sg1": 2 / 3},
    )
    assert (parts.frequency_hz, parts.participation) == (0.333333, {"sg1": 0.666667})


def test_an_explanation_names_who_swings(tmp_path, here):
    told = Verbs(allowance(tmp_path)).explain("two_area", "base")
    assert told.stable is False
    assert told.verdict.startswith("UNSTABLE")
    (why,) = told.because  # one mode grows; the two that are damped decide nothing
    assert "sg1" in why
    assert "-0.9" in why
    assert told.doubts == []


def test_a_doubt_is_told_once(tmp_path, here):
    told = Verbs(allowance(tmp_path)).explain("two_area_rms", "base", {"gfor.pod_p.K": 100})
    assert [text for text in told.doubts if "cannot act" in text] == [
        "--set gfor.pod_p.K: gfor.pod_p.K cannot act: the scenario has no gfor"
    ]


def test_a_stable_scenario_is_explained_by_its_least_damped_mode(tmp_path, here):
    told = Verbs(allowance(tmp_path)).explain("two_area", "pod_p")
    (least, *_) = sorted(
        gfor.load("two_area").scenario("pod_p").modes(), key=lambda mode: mode.damping_percent
    )
    (why,) = told.because
    assert f"the mode of {least.frequency_hz:.3f} Hz" in why


def test_growth_outside_of_the_listed_frequencies_is_explained(tmp_path, here):
    """Something of WSCC's base case grows without an oscillation, and both swings decay."""
    told = Verbs(allowance(tmp_path)).explain("wscc9", "base")
    assert told.stable is False
    own = gfor.load("wscc9").scenario("base").modes().stability
    (why,) = [text for text in told.because if "grows fastest" in text]
    assert f"{own.largest_growth_rate:+.3g} 1/s without an oscillation" in why
    assert why.endswith(
        "all machines alike: sg1.machine.omega, sg2.machine.omega, sg3.machine.omega"
    )
    assert not [text for text in told.because if "the mode of" in text]


def test_growth_is_not_told_twice():
    swing = {"real": 0.1}
    stability = {
        "largest_growth_rate": 0.1,
        "frequency_hz": 0.6,
        "participation": [],
        "common_speed": [],
    }
    told = {"modes": [swing], "stable": False, "stability": stability}
    assert _growth_elsewhere(told) == ""
    faster = stability | {"largest_growth_rate": 0.2, "frequency_hz": 3.0}
    assert "+0.2 1/s at 3 Hz" in _growth_elsewhere(told | {"stability": faster})
    assert _growth_elsewhere(told | {"stability": faster, "stable": None}) == ""


def test_what_grows_elsewhere_is_not_explained_by_a_damped_swing():
    swing = {"damping_percent": 3.0, "real": -0.1}
    listed = {"modes": [swing], "stable": False}
    assert _deciding(listed) == []
    assert _deciding(listed | {"stable": True}) == [swing]
    assert _deciding(listed | {"stable": None}) == []
    growing = {"damping_percent": -2.0, "real": 0.1}
    assert _deciding({"modes": [swing, growing], "stable": False}) == [growing]
