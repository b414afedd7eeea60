"""Controller DLLs that keep the interface, and ones with one planted fault each, which must be named."""

import struct
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import pytest

import orchestrator as gfor
from orchestrator.core.errors import InputError
from orchestrator.devices.acceptance.checks.base import Verdict
from orchestrator.devices.acceptance.controller_dll import conformity
from orchestrator.devices.acceptance.controller_dll.conformity import check_dll
from orchestrator.devices.acceptance.controller_dll.file_head import read_head
from orchestrator.devices.acceptance.controller_dll.questions import DLL_QUESTIONS, REMEDIES
from orchestrator.devices.acceptance.controller_dll.subject import ErrorInRunError
from orchestrator.devices.sandbox.dll_process import DllEndedError, DllNotLoadedError
from tests.support.vendor_dlls import CALLS, compiled, lag

LATE = "if (s->time > 0.005) "
FIRST = "int32_t Model_FirstCall(struct instance *s) { %s return 0; } "
OUT = "((double *)s->out)"
IN = "((double *)s->in)"

FAULTY = {
    # what is planted: (source, check, fault, words of the evidence)
    "no Model_Outputs": (
        lag(calls=CALLS.replace("Model_Outputs", "Model_Output")),
        *("dll_file", "missing function", "no Model_Outputs"),
    ),
    "names as of C++": (
        lag(calls=CALLS.replace("Model_Initialize", "_Z16Model_InitializeP8instance"))
        .replace("Model_Outputs", "_Z13Model_OutputsP8instance")
        .replace("Model_GetInfo", "_Z13Model_GetInfov"),
        *("dll_file", "mangled names", "Model_GetInfo"),
    ),
    "packed structures": (
        "#pragma pack(1)\n" + lag(),
        *("dll_declarations", "another layout", ""),
    ),
    "a default outside of its bounds": (
        lag().replace("{.d = 0.01}, {.d = 0.001}", "{.d = 50}, {.d = 0.001}"),
        *("dll_declarations", "bad declaration", "'T' is outside of its bounds"),
    ),
    "a mode that does not exist": (
        lag().replace(", 1, 1, IN", ", 9, 1, IN"),
        *("dll_declarations", "bad declaration", "EMT_RMS_Mode is 9"),
    ),
    "another sample time after a run": (
        lag(do="INFO.sample_time = 2e-4;").replace(
            "static const struct info", "static struct info"
        ),
        *("dll_first_call", "declarations change", ""),
    ),
    "no start": (
        lag(begin='{ s->error = "no licence"; return 2; }'),
        *("dll_first_call", "does not start", "no licence"),
    ),
    "another array in place of the host's": (
        lag(head="static double own[9]; ", do="s->doubles = own;"),
        *("dll_first_call", "changes the host's", "doubles"),
    ),
    "a crash in a sample": (
        lag(do="if (s->time > 1e-3) abort();"),
        *("dll_first_call", "crash", "Model_Outputs runs"),
    ),
    "an end of the process": (
        lag(do="if (s->time > 1e-3) exit(0);"),
        *("dll_first_call", "exit", "Model_Outputs runs"),
    ),
    "an unknown return value": (
        lag(do=LATE + "return 7;"),
        *("dll_messages", "unknown return value", "returns 7"),
    ),
    "a message without a text": (
        lag(do=LATE + "return 1;"),
        *("dll_messages", "no message", "returns 1"),
    ),
    "a write behind its states": (
        lag(do="s->doubles[1] = 1;"),
        *("dll_memory", "writes outside its arrays", "double states"),
    ),
    "a write before its inputs": (
        lag(do=f"{IN}[-1] = 1;"),
        *("dll_memory", "writes outside its arrays", "inputs"),
    ),
    "a read behind its inputs": (
        lag(do=f"{OUT}[0] += 1e-300 * (int)(((char *)s->in)[8]);"),
        *("dll_memory", "reads outside its arrays", "behind its inputs"),
    ),
    "a read before its outputs": (
        lag(do=f"{OUT}[0] += 1e-300 * ((char *){OUT})[-1];"),
        *("dll_memory", "reads outside its arrays", "before its outputs"),
    ),
    "a sample time of its own": (
        lag(
            calls=CALLS.replace(
                "    STATE +=", "    if (fmod(s->time + 1e-9, 1e-3) > 5e-5) return 0;\n    STATE +="
            )
        ),
        *("dll_sample_time", "sample time not as declared", "every 0.001 s"),
    ),
    "times compared without a tolerance": (
        lag(
            doubles=2,
            begin="s->doubles[1] = -1;",
            calls=CALLS.replace(
                "    STATE +=",
                "    if (s->time - s->doubles[1] < INFO.sample_time) return 0;\n    s->doubles[1] = s->time; STATE +=",
            ),
        ),
        *("dll_sample_time", "misses samples", "are added up"),
    ),
    "its process's number in an output": (
        lag(head="#include <unistd.h>\n", do=f"{OUT}[0] += 1e-9 * getpid();"),
        *("dll_repeatability", "not repeatable", "Model_Outputs"),
    ),
    "a static variable, beside another instance": (
        lag(state="own", doubles=0, head="static double own; "),
        *("dll_instances", "shared between instances", "Model_Outputs"),
    ),
    "a static variable, put back": (
        lag(state="own", doubles=0, head="static double own; "),
        *("dll_states", "hidden state", "variables of the library itself"),
    ),
    "memory that it allocates": (
        lag(
            state="(*own)",
            doubles=0,
            head="static double *volatile own; " + FIRST % "own = malloc(8); *own = 0;",
        ),
        *("dll_states", "hidden state", "memory that it allocates"),
    ),
    "a variable of its thread": (
        lag(state="own", doubles=0, head="static _Thread_local double own; "),
        *("dll_threads", "hidden state", "in its thread"),
    ),
    "a counter of its runs": (
        lag(head="static int runs; ", begin="++runs;", do=f"{OUT}[0] += runs;"),
        *("dll_restart", "left from the run before", "second simulation"),
    ),
    "an initialisation that adds": (
        lag(doubles=2, begin="s->doubles[1] += 1;", do=f"{OUT}[0] += s->doubles[1];"),
        *("dll_restart", "initialises by adding", "six times"),
    ),
    "no end where an input is no number": (
        lag(do=f"while (!({IN}[0] < 9)) ++*(volatile double *)s->out;"),
        *("dll_not_a_number", "hang", "u not a number"),
    ),
    "a crash where an input is no number": (
        lag(do=f"if (isnan({IN}[0])) abort();"),
        *("dll_not_a_number", "crash", "u not a number"),
    ),
    "no number that stays": (
        lag(head="static int bad; ", do=f"if (isnan({IN}[0])) bad = 1; if (bad) {OUT}[0] = 0;"),
        *("dll_not_a_number", "not a number stays", ""),
    ),
    "a question that starts it anew": (
        lag(
            head="int32_t Model_CheckParameters(struct instance *s) { s->doubles[0] = 0; return 0; } "
        ),
        *("dll_call_order", "moved by a question", "Model_CheckParameters"),
    ),
    "memory for each sample": (
        lag(do="*(void *volatile *)&(void *){0} = malloc(48);"),
        *("dll_leaks", "memory leak", "each sample"),
    ),
    "memory for each simulation": (
        lag(head="static void *volatile kept; " + FIRST % "kept = malloc(4000);"),
        *("dll_leaks", "memory leak", "each simulation"),
    ),
    "a file for each simulation": (
        lag(head="#include <fcntl.h>\n" + FIRST % 'open("/dev/null", 0);'),
        *("dll_leaks", "files stay open", ""),
    ),
}

HONEST = {
    # kind: (source, checks that it could fail; all where empty)
    "a lag": (lag(), ()),
    "one that says something at each start": (
        lag(begin='{ s->message = "starts"; return 1; }'),
        ("dll_messages", "dll_restart"),
    ),
    "outputs of a slower task": (
        lag(
            calls=CALLS.replace("    STATE +=", "    if (++*s->ints % 10) return 0;\n    STATE +=")
        ).replace("0, 0, 1}", "1, 0, 1}"),
        ("dll_sample_time", "dll_states"),
    ),
    "memory of its own that is no state": (
        lag(
            head="static const double *table; "
            + FIRST % "if (!table) { double *t = malloc(8); *t = 1; table = t; }",
            do=f"{OUT}[0] *= *table;",
        ),
        ("dll_instances", "dll_states", "dll_leaks"),
    ),
}


@cache
def _library(source):
    with TemporaryDirectory() as folder:
        return compiled(source, Path(folder)).read_bytes()


@pytest.fixture
def written(tmp_path):
    def write(source, name="controller.so"):
        library = tmp_path / name
        library.write_bytes(_library(source))
        return library

    return write


@pytest.mark.parametrize("planted", FAULTY)
def test_a_planted_fault_is_named(written, planted):
    source, check, fault, words = FAULTY[planted]
    bad = [
        r for r in check_dll(written(source), (check,), seconds=0.5) if r.verdict is Verdict.FAIL
    ]
    assert [(r.check, r.fault) for r in bad] == [(check, fault)]
    assert words in bad[0].evidence
    assert bad[0].remedy == REMEDIES[fault]


@pytest.mark.parametrize("kind", HONEST)
def test_an_honest_one_fails_in_nothing(written, kind):
    source, checks = HONEST[kind]
    results = check_dll(written(source), checks)
    assert [r.check for r in results] == list(checks or DLL_QUESTIONS)
    assert not [(r.check, r.evidence) for r in results if r.verdict is Verdict.FAIL]


def test_what_ends_with_an_error_whatever_its_inputs_is_not_judged(written):
    """A file that is missing, say: what it would do with it is not known, and is no fault."""
    source = lag(do=LATE + '{ s->error = "no file"; return 2; }')
    (result,) = check_dll(written(source), ("dll_restart",), seconds=0.5)
    assert (result.check, result.verdict) == ("dll_restart", Verdict.NOT_APPLICABLE)
    assert "it ends with an error whatever its inputs: Model_Outputs at 0.00" in result.evidence
    assert "no file" in result.evidence


@pytest.mark.parametrize(
    ("error", "verdict", "fault", "evidence"),
    [
        (
            ErrorInRunError("no file"),
            Verdict.NOT_APPLICABLE,
            "",
            "because it ends with an error whatever its inputs: no file",
        ),
        (DllNotLoadedError("no symbol"), Verdict.FAIL, "not loadable", "no symbol"),
        (DllEndedError("crash", "it died", ""), Verdict.FAIL, "crash", "it died"),
    ],
)
def test_an_error_in_a_check_is_its_result(error, verdict, fault, evidence, monkeypatch):
    def run(subject):
        raise error

    monkeypatch.setitem(conformity.DLL_CHECKS, "dll_restart", SimpleNamespace(run=run))
    result = conformity._answer("dll_restart", None)
    assert (result.check, result.verdict, result.fault) == ("dll_restart", verdict, fault)
    assert evidence in result.evidence


def test_a_thread_left_behind_and_other_rounding_are_remarks(written):
    source = lag(
        head="#include <pthread.h>\n#include <unistd.h>\n#include <fenv.h>\n"
        "static void *wait(void *p) { for (;;) sleep(9); return p; } "
        + FIRST
        % "pthread_t t; pthread_create(&t, 0, wait, 0); fesetround(FE_UPWARD);"
    )
    results = check_dll(written(source), ("dll_threads", "dll_arithmetic"))
    assert {r.check: r.verdict for r in results} == dict.fromkeys(
        ("dll_threads", "dll_arithmetic"), Verdict.REMARK
    )


def test_an_address_in_the_states_is_a_remark(written):
    source = lag(
        doubles=2,
        head=FIRST % "void *p = malloc(1 << 20); memcpy(s->doubles + 1, &p, 8);",
        calls=CALLS.replace(
            "    STATE +=",
            "    double *own; memcpy(&own, s->doubles + 1, 8); *own = 1;\n    STATE +=",
        ),
    )
    (result,) = check_dll(written(source), ("dll_states",))
    assert result.verdict in (Verdict.REMARK, Verdict.PASS)
    assert result.verdict is Verdict.REMARK or "also in a new process" in result.evidence


def windows_dll(names, bits=32):
    """The head of a Windows DLL that exports names, without code."""
    optional = 96 if bits == 32 else 112
    head = bytearray(64)
    head[:2], head[60:64] = b"MZ", struct.pack("<I", 64)
    size = optional + 16
    coff = struct.pack("<HHIIIHH", 0x14C if bits == 32 else 0x8664, 1, 0, 0, 0, size, 0x2102)
    table = bytearray(size)
    struct.pack_into("<H", table, 0, 0x10B if bits == 32 else 0x20B)
    struct.pack_into("<I", table, optional, 0x1000)
    texts = [name.encode() + b"\0" for name in names]
    body, places = bytearray(40 + 4 * len(names)), []
    for text in texts:
        places.append(0x1000 + len(body))
        body += text
    struct.pack_into("<3I", body, 24, len(names), 0, 0x1000 + 40)
    struct.pack_into(f"<{len(names)}I", body, 40, *places)
    raw = 64 + 4 + 20 + size + 40
    section = struct.pack("<8s6I", b".edata", len(body), 0x1000, len(body), raw, 0, 0) + bytes(8)
    return bytes(head) + b"PE\0\0" + coff + bytes(table) + section + bytes(body)


PLAIN = ["Model_GetInfo", "Model_Initialize", "Model_Outputs"]


def test_decorated_names_of_a_32_bit_dll_are_named(tmp_path):
    library = tmp_path / "controller.dll"
    library.write_bytes(windows_dll([f"{name}@4" for name in PLAIN]))
    (first, *_) = check_dll(library)
    assert (first.check, first.fault) == ("dll_file", "decorated names")


def test_a_32_bit_dll_is_looked_at_and_not_run(tmp_path):
    library = tmp_path / "controller.dll"
    library.write_bytes(windows_dll(PLAIN))
    assert read_head(library).exports == tuple(PLAIN)
    found = gfor.check(library)
    assert found.not_supported == ["32 bit"]
    assert not found.faults
    assert not found.trusted
    assert "it exports what every host calls" in found.report.results[0].evidence


@pytest.mark.parametrize("content", [b"MZ", b"MZ" + bytes(62), b"\x7fELF", b"text", b""])
def test_what_is_no_library_is_said_to_be_none(tmp_path, content):
    library = tmp_path / "controller.dll"
    library.write_bytes(content)
    (first, *_) = check_dll(library)
    assert (first.check, first.fault) == ("dll_file", "no library")


def test_check_asks_the_interface_first_and_stops_there_where_it_fails(written):
    library = written(lag(state="own", doubles=0, head="static double own; "))
    found = gfor.check(library, only=["dll_states", "runs"])
    assert found.faults == ["hidden state"]
    assert "runs" not in found.table().index
    assert found.as_json()["checks"][0]["figures"]["source"].startswith("header")


def test_check_goes_on_with_the_fmu_around_a_dll_that_keeps_the_interface(written):
    found = gfor.check(written(lag()), only=["dll_states", "loads"])
    assert found.trusted
    assert found.table()["verdict"].to_dict() == dict.fromkeys(
        ("dll_states", "archive", "loads"), "pass"
    )


def test_a_check_of_dlls_is_refused_for_an_fmu(tmp_path):
    with pytest.raises(InputError, match="is of controller DLLs"):
        gfor.check(gfor.build("infinite_bus", tmp_path), only=["dll_states"])
