"""How the process that reads a DLL ends: the DLL's own doing lasts as a verdict, want of time does not."""

import contextlib
import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fmus.vendor_dll import answer_file, asking
from fmus.vendor_dll import fmu as dll_module
from fmus.vendor_dll.fmu import DllError, read_dll
from fmus.vendor_dll.interface import DllInterface
from fmus.vendor_dll.state_trial import Trial
from orchestrator.devices.fmi import vendor_files
from orchestrator.devices.fmi.description import read_description
from orchestrator.devices.fmi.vendor_files import as_fmu
from orchestrator.devices.sandbox.dll_process import DllNotLoadedError, DllProcess
from orchestrator.devices.sandbox.process_tree import descendants
from tests.devices.sandbox.test_sandbox import all_end
from tests.support.vendor_dlls import compiled, lag

SLOW = lag(begin="usleep(1500000);", head="\n#include <unistd.h>\n")


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    """So that nothing was kept; what is compiled is found where it was."""
    real = vendor_files.cache_directory
    monkeypatch.setattr(vendor_files, "cache_directory", lambda kind: tmp_path / real(kind).name)
    monkeypatch.setattr(vendor_files, "_tried_now", {})


def test_a_trial_that_lacked_time_is_told_not_kept_and_tried_anew(
    empty_cache, tmp_path, monkeypatch, caplog
):
    library = compiled(SLOW, tmp_path)
    monkeypatch.setattr(dll_module, "_LONGEST", 1.0)
    first = as_fmu(library)
    description = read_description(first)
    assert description.kept_in == "not tried"
    assert (
        "does not end within 1 s while Model_Initialize runs: time ran out" in description.kept_why
    )
    assert "the next call tries it anew" in caplog.text
    assert as_fmu(library) == first  # not twice in one process
    vendor_files._tried_now.clear()
    monkeypatch.setattr(dll_module, "_LONGEST", 60)
    second = as_fmu(library)
    assert second != first
    assert read_description(second).kept_in == "arrays"
    assert as_fmu(library) == second


def test_a_dll_that_never_comes_back_is_told_as_such_every_time(empty_cache, tmp_path, monkeypatch):
    monkeypatch.setattr(dll_module, "_LONGEST", 2.0)
    monkeypatch.setattr(asking, "_OWN_DOING", 0.02)  # other tests may have the processors
    library = compiled(lag(do="for (volatile int go = 1; go;) {}"), tmp_path)
    for _ in range(2):
        vendor_files._tried_now.clear()
        description = read_description(as_fmu(library))
        assert description.kept_in == "not tried"
        assert "while Model_Outputs runs: the DLL does not come back" in description.kept_why


def test_a_trial_that_was_killed_from_outside_is_no_lasting_verdict(tmp_path):
    trial = read_dll(
        compiled(lag(do="raise(SIGKILL);", head="\n#include <signal.h>\n"), tmp_path)
    ).trial
    assert trial.passing
    assert "ends with SIGKILL while Model_Outputs runs: something else ended it" in trial.why
    trial = read_dll(compiled(lag(do="abort();"), tmp_path)).trial
    assert not trial.passing


def test_a_start_that_takes_too_long_is_not_laid_on_the_dll(tmp_path, monkeypatch):
    monkeypatch.setattr(asking, "BEFORE_IT_STARTS", 0.0)
    monkeypatch.setattr(asking, "note_beside", lambda answer: answer.with_name("not there yet"))
    with pytest.raises(DllError, match=r"time ran out before the DLL was loaded.*try again"):
        read_dll(
            compiled(
                lag(head="__attribute__((constructor)) static void b(void) { for (;;) {} } "),
                tmp_path,
            )
        )


def test_a_crash_names_the_function_that_was_called(tmp_path):
    source = lag().replace("{ return &INFO; }", "{ abort(); return &INFO; }")
    with pytest.raises(
        DllError, match="ends with SIGABRT while Model_GetInfo runs: it crashes there"
    ):
        read_dll(compiled(source, tmp_path))


# -- answers that the DLL's code writes --------------------------------------------------------------

FORGES = r"""
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <sys/stat.h>
__attribute__((constructor)) static void forge(void) {
    static char words[65536];
    FILE *line = fopen("/proc/self/cmdline", "rb");
    size_t n = fread(words, 1, sizeof words - 1, line);
    fclose(line);
    for (char *word = words; word < words + n; word += strlen(word) + 1)
        if (strstr(word, "answer.json")) { CONTENT }
    _exit(0);
}
"""
WRITES = 'FILE *f = fopen(word, "wb"); fputs({}, f); fclose(f);'
ERROR = r'"{\"error\": \"the model \\u001b[2Jis fine\"}"'


@pytest.mark.parametrize(
    "what",
    [
        WRITES.format('"[1, 2]"'),
        WRITES.format('"\\xff\\xfe"'),
        WRITES.format('""'),
        WRITES.format('"{\\"interface\\": {}, \\"trial\\": 3}"'),
        'FILE *f = fopen(word, "wb"); for (int k = 0; k < 200000; ++k) putc(91, f); fclose(f);',
        "mkfifo(word, 0600);",
        'symlink("/dev/zero", word);',
        "mkdir(word, 0700);",
    ],
)
def test_an_answer_that_the_dll_wrote_is_refused_in_words(what, tmp_path):
    library = compiled(lag(head=FORGES.replace("CONTENT", what)), tmp_path)
    with pytest.raises(DllError, match=r"gives no answer of its form .* do not run this file"):
        read_dll(library)


def honest():
    text = dict.fromkeys(answer_file.TEXTS, "a")
    signal = {"name": "u", "description": "", "unit": "", "data_type": 9, "width": 1}
    parameter = {
        "name": "K",
        "group": "",
        "description": "",
        "unit": "",
        "data_type": 9,
        "fixed": False,
        "default": 1.0,
        "minimum": None,
        "maximum": None,
    }
    return {
        "interface": {
            "texts": text,
            "interface_version": [1, 0, 0, 0],
            "sample_time": 1e-4,
            "mode": 1,
            "inputs": [signal],
            "outputs": [signal],
            "parameters": [parameter],
            "states": [0, 0, 1],
            "calls": ["Initialize"],
        },
        "trial": {
            "state": "library",
            "doubles": [8],
            "floats": [],
            "regions": [[0, 64]],
            "why": "",
            "passing": False,
        },
    }


def test_an_honest_answer_is_taken_as_it_is(tmp_path):
    path = tmp_path / "answer.json"
    path.write_text(json.dumps(honest()))
    assert answer_file.read_answer(path) == honest()
    read = answer_file.read_answer(path)
    assert DllInterface.from_json(read["interface"]).as_json()["states"] == (0, 0, 1)
    assert Trial.from_json(read["trial"]).regions == ((0, 64),)


def places(value, path=()):
    yield path
    entries = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    for key, inner in entries:
        yield from places(inner, (*path, key))


@pytest.mark.parametrize("wrong", [[], {}, "9" * 100_001, 10**30, -1, True, ["x"], {"a": 1}, 1.5])
def test_no_wrong_value_at_any_place_is_a_traceback(wrong, tmp_path):
    path = tmp_path / "answer.json"
    for place in places(honest()):
        if not place:
            continue
        content = honest()
        table = content
        for key in place[:-1]:
            table = table[key]
        table[place[-1]] = wrong
        path.write_text(json.dumps(content))
        with contextlib.suppress(answer_file.ForeignAnswerError):
            read = answer_file.read_answer(path)
            DllInterface.from_json(read["interface"]).faults()
            Trial.from_json(read["trial"])


def test_no_control_character_of_a_dll_reaches_a_file_or_a_terminal(tmp_path):
    """A name with ESC made a model description that is no XML: "export it again", of our own file."""
    source = lag().replace('"lag"', '"l\\x1b[2Ja\\x01g"', 1)
    assert source != lag()
    found = read_dll(compiled(source, tmp_path))
    assert "\x1b" not in json.dumps(found.interface.as_json(), ensure_ascii=False)
    assert read_description(as_fmu(found.path)).variables
    library = compiled(lag(head=FORGES.replace("CONTENT", WRITES.format(ERROR))), tmp_path)
    with pytest.raises(DllError, match="the model \ufffd"):
        read_dll(library)


def test_a_text_that_never_ends_is_told_as_such(tmp_path):
    """300 MB of a name became "zip bomb", of our own file."""
    source = lag().replace('"lag"', "endless", 1)
    head = (
        "#include <string.h>\nstatic char endless[300000001];\n"
        "__attribute__((constructor)) static void fill(void) { memset(endless, 97, 300000000); }\n"
    )
    with pytest.raises(DllError, match="declares a text of 300000000 bytes; at most 100000"):
        read_dll(compiled(head + source, tmp_path))


@pytest.mark.skipif(sys.platform != "linux", reason="Landlock, which binds one thread, is Linux's")
def test_no_dll_is_loaded_by_a_process_that_had_a_second_thread_before(tmp_path, monkeypatch):
    """Landlock would not bind it, and nobody would be told."""
    library = compiled(lag(), tmp_path)
    begun = "import threading, time\nthreading.Thread(target=time.sleep, args=(60,), daemon=True).start()\n"
    (tmp_path / "sitecustomize.py").write_text(begun, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(DllError, match="second thread before it closed itself off"):
        read_dll(library, vendor_files.READER)
    with pytest.raises(DllNotLoadedError, match="second thread before it closed itself off"):
        DllProcess(library)


_READING = """
import sys
from pathlib import Path
from orchestrator.devices.fmi.vendor_files import as_fmu
as_fmu(Path(sys.argv[1]))
"""
_HOLDING = """
import sys
from pathlib import Path
from orchestrator.devices.sandbox.dll_process import DllProcess
held = DllProcess(Path(sys.argv[1]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel ends it, Linux's alone")
@pytest.mark.parametrize("script", [_READING, _HOLDING])
def test_nothing_outlives_gfor_that_is_killed_while_a_dll_hangs(script, tmp_path):
    never = (
        "__attribute__((constructor)) static void hang(void) { for (volatile int go = 1; go;) {} }"
    )
    library = compiled(lag(head=f"\n{never}\n"), tmp_path)
    with subprocess.Popen([sys.executable, "-c", script, str(library)]) as gfor:
        holder = process_with(library, gfor.pid)
        gfor.kill()
    assert all_end([holder])


def process_with(library, begin):
    """The process below another one that has loaded a library."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        for process in descendants(begin):
            with contextlib.suppress(OSError):
                if str(library) in Path(f"/proc/{process}/maps").read_text(encoding="utf-8"):
                    return process
        time.sleep(0.02)
    raise AssertionError("no process loaded the library")
