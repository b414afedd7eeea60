"""The server of `gfor explore`: who may ask, and what comes of a process that computes."""

import errno
import http.client
import io
import json
import os
import queue
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tomllib
from contextlib import ExitStack, closing, nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest

import orchestrator as gfor
from fmus.toolchain.catalogue import build_model
from fmus.toolchain.exporter import cached
from fmus.toolchain.python_fmu import PythonFmu
from fmus.toolchain.temporary import own_folder, remove
from orchestrator.face.cli import main
from orchestrator.face.cli.explore import first_shown, way_to
from orchestrator.face.explore import computing as computing_module
from orchestrator.face.explore import copies, worker
from orchestrator.face.explore.computing import Computing
from orchestrator.face.explore.copies import Copy
from orchestrator.face.explore.files import FILES, SCRIPTS, content_of
from orchestrator.face.explore.server import LOOPBACK, Explorer
from orchestrator.face.explore.worker import Desk
from tests.studies.certification.sign_turned import turned

pytestmark = pytest.mark.usefixtures("undrawn")

BEGINNING = {"case": "two_area", "scenario": "pod_p", "values": {}, "range": [0.1, 2.0]}


@pytest.fixture
def explorer():
    found = Explorer("two_area", BEGINNING)
    threading.Thread(target=found.serve, daemon=True).start()
    yield found
    found.close()


def asked(explorer, path, method="GET", body=None, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", explorer.port, timeout=30)
    headers = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, headers)
    response = connection.getresponse()
    return response.status, response.read(), response.headers


def test_a_question_that_nests_too_deeply_is_refused(explorer, capfd):
    path = f"/{explorer.token}/ask"
    assert asked(explorer, path, "POST", "[" * 200_000)[0] == 400
    assert asked(explorer, f"/{explorer.token}/")[0] == 200
    assert capfd.readouterr().err == ""


def test_the_browser_is_led_to_the_token_by_a_file_of_ours(tmp_path):
    """Its command line can be read by every user of the machine."""
    page = way_to("http://127.0.0.1:5/secret/", own_folder("explore"))
    try:
        assert page.parent.stat().st_mode & 0o077 == 0
        assert "url=http://127.0.0.1:5/secret/" in page.read_text(encoding="utf-8")
        assert "secret" not in page.as_uri()
    finally:
        remove(page.parent)


# -- who may ask -----------------------------------------------------------------------------------


def test_the_page_and_its_files_are_there_for_who_knows_the_token(explorer):
    status, page, headers = asked(explorer, f"/{explorer.token}/")
    assert status == 200
    assert b"gfor explore" in page
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert headers["Referrer-Policy"] == "no-referrer"
    for name in FILES:
        assert asked(explorer, f"/{explorer.token}/{name}")[0] == 200
    assert json.loads(asked(explorer, f"/{explorer.token}/beginning")[1]) == BEGINNING


@pytest.mark.parametrize(
    "path", ["/", "//", "/page.html", "/wrong/", "/wrong/page.js", "/wrong/beginning", "/%C3%A9/"]
)
def test_nothing_is_said_without_the_token(explorer, path):
    status, content, _ = asked(explorer, path)
    assert (status, content) == (403, b"Forbidden")


def test_a_host_that_is_not_ours_is_refused(explorer):
    """A page elsewhere whose name leads here sends its own name."""
    path = f"/{explorer.token}/"
    assert asked(explorer, path, Host="evil.example")[0] == 403
    assert asked(explorer, path, Host=f"evil.example:{explorer.port}")[0] == 403
    assert asked(explorer, path, Host=f"localhost:{explorer.port}")[0] == 200


def test_a_question_from_another_origin_is_refused(explorer):
    path, body = f"/{explorer.token}/ask", json.dumps({"page": "p", "number": 1, "ask": "cancel"})
    assert asked(explorer, path, "POST", body, Origin="http://evil.example")[0] == 403
    assert asked(explorer, path, "POST", body, Origin=f"http://127.0.0.1:{explorer.port}")[0] == 200
    assert asked(explorer, "/wrong/ask", "POST", body)[0] == 403


@pytest.mark.parametrize("body", [b"", b"no JSON", b"[]", b"{}", b'"text"', b"\xff"])
def test_what_is_no_question_is_refused(explorer, body):
    assert asked(explorer, f"/{explorer.token}/ask", "POST", body)[0] == 400


@pytest.mark.parametrize("name", ["../server.py", "..%2fserver.py", "server.py", "page/page.js"])
def test_no_other_file_is_given(explorer, name):
    assert asked(explorer, f"/{explorer.token}/{name}")[0] == 404


def test_it_listens_on_loopback_alone(explorer):
    assert explorer._server.server_address[0] == "127.0.0.1"


def test_forty_questions_at_once_are_all_heard():
    """Nine of forty were reset."""
    explorer = Explorer("two_area", BEGINNING)
    place = (LOOPBACK, explorer.port)
    with closing(explorer._server.socket), ExitStack() as lines:
        for _ in range(40):  # nobody takes one yet
            lines.enter_context(socket.create_connection(place, timeout=5.0))


def test_a_process_of_whose_end_nobody_knows_has_no_exit_code():
    line, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    computing = Computing("two_area")
    computing._process = Copy(line, None, None)
    other.send(b"-1")
    other.close()
    assert "ended by itself (how is not known)" in computing._lost("")


def test_a_process_that_does_not_end_is_killed_and_waited_for(monkeypatch):
    """Processes lived some seconds longer than the explorer, and left their folders."""
    ends, swept = [], []

    def wait(timeout=None):
        if "kill" not in ends:
            raise subprocess.TimeoutExpired("worker", timeout)

    process = SimpleNamespace(
        terminate=lambda: ends.append("terminate"), kill=lambda: ends.append("kill"), wait=wait
    )
    monkeypatch.setattr(computing_module, "sweep", swept.append)
    computing = Computing("two_area")
    computing._process = process
    computing.close()
    computing.wait_for_its_end()
    assert ends == ["terminate", "kill"]
    assert swept == [Path(tempfile.gettempdir())]


def test_a_process_that_is_told_to_end_removes_its_folders(monkeypatch):
    done = []

    def interrupted():
        raise KeyboardInterrupt

    monkeypatch.setattr(worker, "calls", SimpleNamespace(terminable=lambda ending: nullcontext()))
    monkeypatch.setattr(worker, "main", interrupted)
    monkeypatch.setattr(worker, "remove_own", lambda: done.append("removed"))
    monkeypatch.setattr(os, "_exit", done.append)
    worker.serve()
    assert done == ["removed", 1]


def test_a_port_that_is_taken_is_said(explorer):
    with pytest.raises(gfor.CosimError, match=rf"--port {explorer.port}: nothing can listen there"):
        Explorer("two_area", BEGINNING, port=explorer.port)


def test_two_servers_have_different_tokens(explorer):
    other = Explorer("two_area", BEGINNING)
    assert other.token != explorer.token
    assert len(other.token) >= 32
    other._server.server_close()


def test_it_ends_a_while_after_its_last_page_was_closed():
    found = Explorer("two_area", BEGINNING, linger=0.5)
    serving = threading.Thread(target=found.serve, daemon=True)
    serving.start()
    told = found.opened("p")
    time.sleep(1.2)
    assert serving.is_alive()  # as long as one is open
    found.close_page("p", told)
    serving.join(60)
    assert not serving.is_alive()


def test_it_waits_for_its_first_page():
    found = Explorer("two_area", BEGINNING, linger=0.1)
    serving = threading.Thread(target=found.serve, daemon=True)
    serving.start()
    time.sleep(0.8)
    assert serving.is_alive()
    found.close_page("p", queue.SimpleQueue())
    serving.join(60)


def test_a_page_that_comes_again_is_answered(explorer):
    """Its stream of events broke off; the browser opens another by itself."""
    explorer.close_page("p", explorer.opened("p"))
    explorer.opened("p")
    assert "answer" in explorer.answer("p", {"ask": "open", "number": 1.0})


# -- the files of the page -------------------------------------------------------------------------


def test_the_page_loads_nothing_from_elsewhere():
    text = "".join(content_of(name).decode() for name in FILES).replace(
        "http://www.w3.org/2000/svg", ""
    )
    for part in ("http:", "https:", "//cdn", "@import", "import("):
        assert part not in text
    assert re.findall(r'<script src="([^"]+)">', content_of("page.html").decode()) == list(SCRIPTS)


def test_the_page_makes_no_markup_of_a_text():
    text = "".join(content_of(name).decode() for name in SCRIPTS)
    for part in (
        "innerHTML",
        "outerHTML",
        "insertAdjacentHTML",
        "document.write",
        "eval(",
        "DOMParser",
    ):
        assert part not in text


# -- the process that computes ---------------------------------------------------------------------

QUESTION = {"ask": "modes", "scenario": "pod_p", "values": {}, "range": [0.1, 2.0]}


@pytest.fixture(scope="module")
def computing():
    found = Computing("two_area")
    yield found
    found.close()


def answer(computing, page="p", say=lambda part: None, **more):
    return computing.ask(page, {**QUESTION, **more}, say)


@pytest.mark.parametrize(
    "values", [{}, {"gfor.pod_p.K": 137.25, "grid.X_L": 0.31}, {"gfor.pod_p.enabled": False}]
)
def test_figures_are_those_of_the_command_that_is_copied(computing, capsys, values):
    found = answer(computing, values=values)["answer"]
    words = found["copied"]["command"].split()
    assert words[:2] == ["gfor", "modes"]
    assert main([*words[1:], "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        **found["modes"],
        "questions": found["modes"]["questions"],
    }
    assert found["verdict"] == found["modes"]["scenarios"][0]["stability"]["sentence"]


@pytest.mark.slow
def test_the_scenario_and_the_python_that_are_copied_give_the_same_figures(
    computing, tmp_path, capsys
):
    values = {"gfor.pod_p.K": 137.25, "grid.X_L": 0.31}
    found = answer(computing, values=values)["answer"]
    file = gfor.load("two_area").file
    (tmp_path / "case.toml").write_text(f"{file.text}\n{found['copied']['toml']}", encoding="utf-8")
    modes = gfor.load(tmp_path / "case.toml").scenario("explored").modes()
    (before,), (after,) = (content["scenarios"] for content in (found["modes"], modes.as_json()))
    assert after["modes"] == before["modes"]
    names = {}
    exec(found["copied"]["python"], names)
    assert before["stability"]["sentence"] in capsys.readouterr().out
    assert names["modes"].as_json()["scenarios"][0]["modes"] == before["modes"]


@pytest.mark.slow
def test_slopes_are_those_of_the_sensitivities(computing):
    found = answer(computing, ask="slopes", parameter="gfor.pod_p.K")["answer"]
    row = (
        gfor.load("two_area")
        .scenario("pod_p")
        .sensitivities(parameters="gfor.pod_p.K")
        .table()
        .iloc[0]
    )
    (k,) = [
        k for k, (re_, im) in enumerate(found["eigenvalues"]) if abs(im / 6.283185 - 0.7633) < 1e-3
    ]
    assert found["slopes"][k] == pytest.approx(
        [row["real_per_unit"], row["imag_per_unit"]], rel=2e-3
    )


def test_a_value_that_cannot_be_is_refused_in_the_commands_words(computing, capsys):
    found = answer(computing, values={"gfor.pod_p.K": -5})
    assert main(["modes", "two_area", "--scenario", "pod_p", "--set", "gfor.pod_p.K=-5"]) == 2
    said = capsys.readouterr().err.removeprefix("error: ")
    assert found["error"].split() == said.split()
    assert "answer" in answer(computing)  # and the next one is answered


def test_a_value_that_cannot_act_is_told_in_the_pages_words_with_its_switch(computing):
    key, off = "gfor.pod_p.K", "gfor.pod_p.enabled"
    found = answer(computing, scenario="gfor", values={key: 100.0})["answer"]
    assert f"{key} cannot act: {off} is false" in found["warnings"]
    assert not any("--" in text for text in found["warnings"])
    listed = answer(computing, ask="parameters", scenario="gfor")["answer"]["parameters"]
    switches = {one["parameter"]: one["switches"] for one in listed}
    assert switches[key] == [off]
    assert switches[off] == switches["grid.X_L"] == []
    asked = {key: 100.0, off: True}
    acting = answer(computing, scenario="gfor", values=asked)["answer"]
    assert not any("cannot act" in text for text in acting["warnings"])


@pytest.mark.parametrize(
    ("case", "scenario"), [("two_area", "pod_pq"), ("ieee39", "pod_pq"), ("kundur", "pod_q")]
)
def test_a_page_opens_with_the_whole_grid_and_not_with_an_outage(case, scenario):
    assert first_shown(gfor.load(case)) == scenario


def test_parameters_have_units_bounds_and_words(computing):
    found = answer(computing, ask="parameters")["answer"]
    (gain,) = [p for p in found["parameters"] if p["parameter"] == "gfor.pod_p.K"]
    assert (gain["value"], gain["unit"], gain["minimum"], gain["variability"]) == (
        200.0,
        "pu",
        0.0,
        "tunable",
    )
    assert gain["description"].startswith("Gain")
    assert {line["name"] for line in found["diagram"]["lines"]} == {"L"}
    assert {unit["name"]: unit["machine"] for unit in found["diagram"]["units"]} == {
        "sg1": True,
        "sg2": True,
        "gfor": False,
    }


@pytest.mark.slow
def test_a_dead_process_ends_its_question_and_not_the_next(computing):
    assert "answer" in answer(computing)
    process = computing._process.pid
    slopes = {"ask": "slopes", "parameter": "gfor.pod_p.K"}  # it tells how far it is
    found = answer(computing, say=lambda part: os.kill(process, signal.SIGKILL), **slopes)
    assert "signal 9" in found["error"]
    assert "answer" in answer(computing)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no process is copied")
def test_what_later_questions_need_is_imported_once_while_nobody_asks(computing):
    """By the process that is copied, after the first question: each copy imported pandas and parts of SciPy anew."""
    assert "answer" in answer(computing)
    loaded = Path(f"/proc/{copies._original._process.pid}/maps")
    wait_until(
        lambda: (
            {"pandas", "scipy/optimize"}
            <= {*re.findall(r"site-packages/(pandas|scipy/optimize)/", loaded.read_text())}
        )
    )


@pytest.mark.slow
def test_the_process_that_was_copied_is_begun_anew_where_it_died(computing):
    assert "answer" in answer(computing)
    before = copies._original._process
    before.kill()
    before.wait()
    assert "answer" in answer(computing)  # of a copy, which outlives it
    other = Computing("two_area")
    assert "answer" in other.ask("p", {"ask": "open"}, lambda part: None)
    assert copies._original._process.pid != before.pid
    other.close()


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere no process is copied")
def test_what_another_thread_read_is_known_to_all_who_wait(monkeypatch):
    """Who was about to wait for a process' number slept on after another one had read it, and never ended it."""
    line, told = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    copy, select = copies.Copy(line, io.StringIO(), io.StringIO()), copies.select.select

    def overtaken(read, write, other, timeout):
        if timeout != 0.0 and not copy.is_there:
            told.send(b"7")
            assert copy.is_there
        return select(read, write, other, 5.0 if timeout is None else timeout)

    monkeypatch.setattr(copies.select, "select", overtaken)
    begin = time.monotonic()
    assert copy.pid == 7
    assert time.monotonic() - begin < 4.0
    told.close()


@pytest.mark.slow
def test_a_process_that_is_cancelled_before_it_has_begun_ends(computing):
    """Who cancels does not wait for it."""
    assert "answer" in answer(computing)
    original, found = copies._original._process.pid, Computing("two_area")
    os.kill(original, signal.SIGSTOP)  # as if it were at its imports
    at_work = in_background(answer, found, number=1)
    wait_until(lambda: found._process is not None)
    begun = found._process
    assert not begun.is_there
    waiting = [in_background(begun.wait), in_background(lambda: begun.pid)]
    time.sleep(0.1)  # until both wait
    found.cancel("p", 2)
    assert begun.poll() is None
    os.kill(original, signal.SIGCONT)
    assert at_work() == {"cancelled": True}
    assert begun.wait(30) != 0
    assert [one() for one in waiting] == [begun.returncode, begun.pid]
    found.close()


@pytest.mark.slow
def test_where_no_process_is_copied_each_does_its_imports(monkeypatch):
    elsewhere = SimpleNamespace(platform="darwin", executable=sys.executable)
    monkeypatch.setattr(copies, "sys", elsewhere)
    found = Computing("two_area")
    assert "answer" in found.ask("p", {"ask": "open"}, lambda part: None)
    assert isinstance(found._process, subprocess.Popen)
    found.close()


@pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")
def test_a_copy_that_cannot_be_made_leaves_no_descriptor(monkeypatch):
    """An environment that is too long for a message, or a folder that is no more."""

    def unsent(*given):
        raise OSError(errno.EMSGSIZE, "too long")

    original = copies._Original()
    original.begin()
    before = len(os.listdir("/proc/self/fd"))
    monkeypatch.setattr(copies.socket, "send_fds", unsent)
    for _ in range(3):
        with pytest.raises(OSError, match="too long"):
            original.copied()
    monkeypatch.undo()
    assert len(os.listdir("/proc/self/fd")) == before
    original.close()


@pytest.mark.parametrize("running", [False, True])
def test_a_cancel_as_a_question_begins_ends_it(computing, monkeypatch, running):
    """Before it is given to the process."""
    assert "answer" in answer(computing)
    begin, page = computing._running, f"cancels {running}"

    def overtaken():
        process = begin() if running else None
        computing.cancel(page, 2)
        return process or begin()

    monkeypatch.setattr(computing, "_running", overtaken)
    assert answer(computing, page, number=1) == {"cancelled": True}
    assert computing._process is None
    monkeypatch.undo()
    assert "answer" in answer(computing, page, number=3)


@pytest.mark.slow
def test_a_hanging_process_is_ended_by_the_user(computing):
    assert "answer" in answer(computing)
    os.kill(computing._process.pid, signal.SIGSTOP)
    at_work = in_background(answer, computing, ask="parameters", number=1)
    wait_until(lambda: computing._at_work is not None)
    waiting = in_background(answer, computing, number=2)
    wait_until(lambda: ("p", "modes") in computing._newest)
    computing.cancel("p", 4)
    overtaken = in_background(answer, computing, number=3)
    assert at_work() == waiting() == overtaken() == {"cancelled": True}
    assert "answer" in answer(computing, number=5)


@pytest.mark.slow
def test_a_hanging_process_is_ended_after_a_while():
    computing = Computing("two_area", longest=1.0)
    computing.ask("p", {"ask": "open"}, lambda part: None)
    computing._longest = 60.0
    assert "answer" in answer(computing)
    os.kill(computing._process.pid, signal.SIGSTOP)
    computing._longest = 1.0
    assert "more than 1 s" in answer(computing)["error"]
    computing.close()


@pytest.mark.slow
def test_of_several_questions_of_a_page_the_last_one_wins(computing):
    assert "answer" in answer(computing)
    process = computing._process.pid
    os.kill(process, signal.SIGSTOP)  # until all are asked
    asked = []
    for length in (0.21, 0.22, 0.23):
        before = computing._newest.get(("p", "modes"))
        asked.append(in_background(answer, computing, values={"grid.X_L": length}))
        wait_until(lambda before=before: computing._newest.get(("p", "modes")) != before)
    os.kill(process, signal.SIGCONT)
    first, second, third = asked
    assert first() == second() == {"superseded": True}
    assert "grid.X_L=0.23" in third()["answer"]["copied"]["command"]


@pytest.mark.slow
def test_two_pages_do_not_disturb_each_other(computing):
    first = in_background(answer, computing, page="one", values={"grid.X_L": 0.21})
    second = in_background(answer, computing, page="two", values={"grid.X_L": 0.22})
    assert "grid.X_L=0.21" in first()["answer"]["copied"]["command"]
    assert "grid.X_L=0.22" in second()["answer"]["copied"]["command"]


class in_background:  # noqa: N801 - reads as what it does
    """A function in a thread of its own; a call gives what it returned."""

    def __init__(self, function, *arguments, **more):
        self._found = []
        self._thread = threading.Thread(
            target=lambda: self._found.append(function(*arguments, **more)), daemon=True
        )
        self._thread.start()

    def __call__(self):
        self._thread.join(60)
        return self._found[0]


def wait_until(holds, seconds=30):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.mark.slow
def test_a_case_that_changes_on_disk_is_read_again(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(gfor.load("infinite_bus").file.text, encoding="utf-8")
    computing = Computing(str(path))
    before = computing.ask("p", {"ask": "open"}, lambda part: None)["answer"]
    path.write_text(
        path.read_text(encoding="utf-8").replace("[scenarios.dip]", "[scenarios.sag]"),
        encoding="utf-8",
    )
    after = computing.ask("p", {"ask": "open"}, lambda part: None)["answer"]
    assert set(after["scenarios"]) - set(before["scenarios"]) == {"sag"}
    assert after["stamp"] != before["stamp"]
    computing.close()


@pytest.mark.slow
def test_a_run_is_streamed_and_kept_as_that_of_the_command(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = gfor.load("infinite_bus").file.text
    case = re.sub(r'stop_time = "[^"]*"', 'stop_time = "1.2 s"', text)
    (tmp_path / "short.toml").write_text(case, encoding="utf-8")
    computing, parts = Computing("short.toml"), []
    found = computing.ask(
        "p", {"ask": "run", "scenario": "dip", "signals": ["grid.v"]}, parts.append
    )["answer"]
    computing.close()
    assert found["folder"].startswith(os.path.join("results", "explore"))
    assert tomllib.loads((tmp_path / found["folder"] / "case.toml").read_text(encoding="utf-8"))
    assert main(["run", "short.toml", "--scenario", "dip", "--out", "run"]) == 0
    capsys.readouterr()
    comparison = gfor.compare(f"{found['folder']}/dip", "run/dip").table()
    assert (comparison["largest_difference"] == 0).all()
    times = [t for part in parts for t in part["part"]["time"]]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(1.2)
    assert main(["report", found["folder"]]) == 0


# -- the command -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_the_command_prints_its_address_and_ends_by_ctrl_c():
    words = [
        sys.executable,
        "-m",
        "orchestrator.face.cli",
        "explore",
        "infinite_bus",
        "--no-browser",
    ]
    with subprocess.Popen(
        words,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # noqa: PLW1509
    ) as process:
        address = process.stdout.readline().split()[0]
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{32}/", address)
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 130
        assert process.stderr.read() == "interrupted\n"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["nothing"], "nothing"),
        (
            ["two_area", "--scenario", "none"],
            "there is no scenario 'none'; the case has: base, gfor",
        ),
        (
            ["two_area", "--scenario", "pod_x"],
            "there is no scenario 'pod_x'; did you mean pod_q or pod_p or pod_pq? the case has: base",
        ),
    ],
)
def test_what_cannot_be_shown_is_said_at_once(words, says, capsys):
    assert main(["explore", *words, "--no-browser"]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.parametrize("port", ["0", "65536", "x", "-1"])
def test_a_port_is_a_number(port, capsys):
    with pytest.raises(SystemExit):
        main(["explore", "two_area", "--port", port])
    assert "is not a port" in capsys.readouterr().err or port == "-1"


@pytest.mark.parametrize("name", ["own.fmu", "other.fmu"])
def test_fmus_serve_the_next_question_and_an_exchanged_file_is_read_anew(tmp_path, name):
    """To the last digit: a value back and forth, and another FMU in the place of the one that is open."""
    first, second = (cached(PythonFmu(model)) for model in (build_model("gfor"), turned("pod_p")))
    shutil.copy(first, tmp_path / "own.fmu")
    case = tmp_path / "case.toml"
    text = gfor.load("infinite_bus").file.text.replace('model = "gfor"', 'fmu = "own.fmu"')
    assert "own.fmu" in text
    case.write_text(text, encoding="utf-8")
    desk = Desk(str(case), False)
    values = {"gfor.pod_p.enabled": True}

    def found(**more):
        asked = {"ask": "modes", "scenario": "dip", "values": values | more, "range": [0.05, 5.0]}
        mine = json.loads(json.dumps(desk.answer(asked, print)["modes"]))
        fresh = gfor.load(str(case)).scenario("dip", values | more).modes((0.05, 5.0)).as_json()
        assert mine == json.loads(json.dumps(fresh))
        return mine["scenarios"][0]["modes"]

    before = found()
    assert found(**{"gfor.P_0": 0.5}) != before
    assert found() == before
    shutil.copy(second, tmp_path / name)
    if name == "other.fmu":
        case.write_text(text.replace("own.fmu", name), encoding="utf-8")
    assert found() != before


def test_an_ssp_is_opened_and_its_modes_are_those_of_the_case(tmp_path):
    scenario = gfor.load("infinite_bus").scenario("dip")
    (archive,) = gfor.export(scenario, "ssp", tmp_path / "bus.ssp")
    desk = Desk(str(archive), False)
    assert list(desk.answer({"ask": "open"}, print)["scenarios"]) == ["dip"]
    asked = {"ask": "modes", "scenario": "dip", "values": {}, "range": [0.05, 50.0]}
    mine, own = (
        desk.answer(asked, print)["modes"]["scenarios"][0],
        scenario.modes((0.05, 50.0)).as_json()["scenarios"][0],
    )
    assert [m["imag"] for m in mine["modes"]] == pytest.approx(
        [m["imag"] for m in own["modes"]], rel=1e-9
    )
    assert str(archive) in desk.answer(asked, print)["copied"]["command"]
