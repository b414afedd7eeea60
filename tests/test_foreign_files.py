"""What a case, an option or a caller names: no pipe hangs a command, no device fills the memory, no text steers."""

import ast
import os
import pickle
import sys
import zipfile
from pathlib import Path

import pytest

from orchestrator.cases.case import load_case
from orchestrator.cases.form.csv_rows import rows_of
from orchestrator.cases.networks.psse.dyr_file import read_dyr
from orchestrator.cases.networks.psse.raw_records import read_records
from orchestrator.cases.networks.source_changes import Changes, Remark
from orchestrator.core import foreign_files
from orchestrator.core.errors import CaseError, InputError
from orchestrator.core.file_hashes import remembered_sha256, sha256_of
from orchestrator.core.foreign_files import check_regular, one_line, read_bytes, read_text, visible
from orchestrator.core.question_kinds import by_kind
from orchestrator.core.toml_files import read_toml
from orchestrator.devices.fmi.vendor_files import as_fmu
from orchestrator.output.results.comtrade.reading import read_comtrade
from orchestrator.output.results.csv_recording import read_table
from orchestrator.simulation.interop.probe_result import read_probe_result
from orchestrator.studies.immittance.scan_files import read_scan
from orchestrator.systems.ssp.archive import SspArchive
from tests.support.all_code import asked_of_all_code
from tests.support.source_files import product_files

ROOT = Path(__file__).parents[1]
unix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no named pipes among files")

CASE = """name = "small"
[components.gfor]
model = "infinite_bus"
{component}
[scenarios.base]
title = {title}
{scenario}
[[plots]]
name = "power"
title = {plot}
panels = [{{ signal = "gfor.p", label = {label} }}]
"""
PLAIN = {"component": "", "title": '"one"', "scenario": "", "plot": '"P"', "label": '"P"'}


@pytest.fixture
def pipe(tmp_path):
    def make(name):
        os.mkfifo(tmp_path / name)
        return tmp_path / name

    return make


def case(folder, **parts):
    path = folder / "case.toml"
    path.write_text(CASE.format(**PLAIN | parts), encoding="utf-8")
    return path


# -- regular files -----------------------------------------------------------------------------------


@unix
@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("a.toml", lambda path: read_toml(path, "it", "")),
        ("a.csv", lambda path: rows_of(path, ())),
        ("a.raw", read_records),
        ("a.dyr", read_dyr),
        ("a.txt", lambda path: read_scan(path, 50.0)),
        ("a.csv", read_table),
        ("a.cfg", read_comtrade),
        ("a.csv", read_probe_result),
        ("a.dll", as_fmu),
        ("a.fmu", sha256_of),
        ("a.fmu", remembered_sha256),
        ("a.toml", load_case),
    ],
)
def test_no_reader_waits_for_a_pipe(pipe, name, read):
    with pytest.raises(InputError, match=r"a named pipe|no such file"):
        read(pipe(name))


@unix
@pytest.mark.parametrize("words", [("verify",), ("modes", "infinite_bus", "--parameters")])
@pytest.mark.parametrize("device", ["a pipe", "/dev/zero"])
def test_no_option_names_a_pipe_or_a_device(gfor, pipe, words, device):
    path = pipe("p") if device == "a pipe" else Path(device)
    code, _, error = gfor(*words, path)
    assert code == 2
    kind = "a named pipe" if device == "a pipe" else "a device"
    assert f"{path}: it is {kind}, and no file; write its content into a file" in error


@unix
@pytest.mark.parametrize(
    "parts",
    [
        {"scenario": 'parameters = ["/dev/zero"]'},
        {"component": 'binding = "/dev/zero"'},
        {"component": 'scan = "/dev/zero"\\nvoltage = "1 kV"'},
        {"component": 'fmu = "/dev/zero"'},
        {"component": 'dll = "/dev/zero"'},
    ],
)
def test_no_key_of_a_case_names_a_device(tmp_path, parts):
    """A list of parameters that named /dev/zero filled the memory."""
    with pytest.raises((InputError, CaseError)):
        load_case(case(tmp_path, **parts)).prepare()


def test_a_text_has_a_size_that_is_read(tmp_path):
    path = tmp_path / "text"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    with pytest.raises(InputError, match="it has 5 bytes; at most 4 are read"):
        read_bytes(path, 4)
    path.write_bytes(b"a\r\nb\rc")
    assert read_text(path) == "a\nb\nc"
    check_regular(tmp_path)
    check_regular(tmp_path / "absent")


OWN = {
    "devices.acceptance.runner": "is_file before it",
    "devices.acceptance.worker": "/proc",
    "face.api.saved": "results",
    "face.cli.completion": "the tables of our own cases",
    "cases.form.definition": "is_file before it",
    "cases.networks.psse.dyr_model_list": "our own table",
    "devices.acceptance.controller_dll.file_head": "is_file before it",
    "devices.sandbox.copied_process": "/proc",
    "devices.sandbox.dll_process_worker": "the library that this process is started for",
    "cases.networks.psse.missing_models": "our own table",
    "cases.networks.kept_tables": "the cache and our own tables",
    "studies.certification.acceptance": "is_file before it",
    "studies.certification.files": "what was read before",
    "studies.certification.inside": "a copy in a folder of ours",
    "studies.certification.points_again": "a copy in a folder of ours",
    "studies.certification.codes.rows_again": "a copy in a folder of ours",
    "studies.certification.kinds": "results",
    "studies.certification.report": "a copy in the certificate's folder",
    "studies.certification.case_file": "our own case",
    "studies.certification.study": "our own case",
    "studies.certification.verification": "is_file before it",
    "face.agents.verbs": "our own cases",
    "face.cli.certificate": "results",
    "face.cli.design": "is_file before it",
    "face.cli.run_request": "results",
    "face.explore.files": "our own pages",
    "face.explore.opened": "results",
    "devices.fmi.brought_modules": "what an FMU's archive held",
    "devices.sandbox.dll_reading_process": "is_file before it",
    "devices.fmi.vendor_files": "is_file before it",
    "studies.added": "the code of an installed distribution",
    "studies.points.code": "our own code",
    "output.report.explorer_cells": "results",
    "output.report.html.chapters.files": "results",
    "output.report.html.chapters.devices": "pictures beside a result",
    "output.report.html.chapters.studies": "results",
    "output.report.html.elements": "our own pages",
    "output.report.html.folder": "results",
    "output.report.html.origins": "results",
    "output.report.html.page": "results",
    "output.results.checkpoint_file": "results",
    "output.results.manifest": "results",
    "systems.ssp.writing": "FMUs that were read before",
    "studies.signals.ambient": "a picture that it has drawn",
    "studies.runs.checkpoints": "results",
    "core.toml_files": "check_regular before it",
    "devices.sandbox.resource_limits": "/proc",
    "devices.sandbox.process_tree": "/proc",
}
"""Modules that read files by themselves, and why no pipe or device can be there."""


def reads_by_itself(source):
    """Calls that read a file which does not lie beside the code; a mailbox is memory."""
    for node in source.of(ast.Call):
        if getattr(node.func, "attr", "") in ("read_text", "read_bytes"):
            whose = ast.unparse(node.func.value)
            if not ("__file__" in whose or whose.endswith("box")):
                yield node.lineno


@asked_of_all_code
def reads_by_module():
    """Module → lines in which it reads by itself."""
    found = {source.module: [*reads_by_itself(source)] for source in product_files("orchestrator")}
    return {name.removeprefix("orchestrator."): lines for name, lines in found.items() if lines}


def test_whoever_reads_a_named_file_asks_here():
    """A reader that opens what a user names by itself hangs at a pipe."""
    found = reads_by_module()
    new = {name: lines for name, lines in found.items() if name not in OWN}
    assert not new, "use orchestrator.core.foreign_files, or say in OWN why it need not"
    assert not set(OWN) - set(found), "these read nothing any more"


# -- characters that steer ---------------------------------------------------------------------------

HOSTILE = '"UNSTABLE\\u001b[2K\\rstable"'


def test_the_case_is_sound_without_them(tmp_path):
    assert not load_case(case(tmp_path)).problems


@pytest.mark.parametrize(
    ("part", "line"),
    [("title", "line 6"), ("plot", "line 10"), ("label", "line 11")],
)
@pytest.mark.parametrize("text", [HOSTILE, '"\\u202Eelbats"', '"\\u009b2K"'])
def test_a_text_of_a_case_steers_no_terminal(tmp_path, part, line, text):
    """A title erased the row of the verdict and wrote another one in its place."""
    (problem,) = load_case(case(tmp_path, **{part: text})).problems
    assert problem.place.startswith(line)
    assert "which steers the terminal or browser that shows it" in problem.text
    assert problem.text.isprintable()


def test_nor_does_one_of_another_table(tmp_path):
    path = tmp_path / "binding.toml"
    path.write_text(f"[source]\ntext = {HOSTILE}\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"source\.text: the text holds the character '\\x1b'"):
        read_toml(path, "it", "")


def test_names_in_tables_of_others_are_written_out(tmp_path):
    path = tmp_path / "units.csv"
    path.write_text("bus\n1\x1b[2K\n", encoding="utf-8")
    assert rows_of(path, ("bus",))[0]["bus"] == "1\\x1b[2K"
    assert visible("a\tb\n\u202e\x9b\x1a") == "a\tb\n\\u202e\\x9b\\x1a".replace("\\x1a", "\x1a")


# -- names ------------------------------------------------------------------------------------------


@unix
def test_a_folder_whose_name_is_no_utf_8_is_named_before_anything_is_computed(
    gfor, tmp_path, monkeypatch
):
    """Two scenarios were computed, and then the manifest could not be written."""
    folder = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9"))
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system takes UTF-8 alone")
    path = case(folder)
    said = "its name has the byte 0xe9, which is no UTF-8"
    with pytest.raises(InputError, match=said):
        load_case(path)
    code, _, error = gfor("run", path, "--out", tmp_path / "out")
    assert (code, said in error, error.count("\n")) == (2, True, 1)
    assert not (tmp_path / "out").exists()
    monkeypatch.chdir(folder)
    code, _, error = gfor("run", "case.toml", "--out", tmp_path / "out")
    assert (code, said in error, error.count("\n")) == (2, True, 1)


def test_the_characters_are_named_once():
    assert foreign_files.may_steer("\x1b")
    assert not foreign_files.may_steer("plain, with ä and\ttabs\n")


def test_a_name_has_one_line():
    assert one_line("a\nb\t\r\x1b[2K\x85\u2028é\xa0→") == "a\\nb\\t\\r\\x1b[2K\\x85\\u2028é\xa0→"


def test_what_a_networks_source_calls_its_elements_is_shown_in_one_line():
    changes = Changes("grid.zip", "element")
    changes.note("L1\nUNSTABLE\x1b[2K", "held")
    (problem,) = changes.as_problems()
    assert str(problem) == "grid.zip, element L1\\nUNSTABLE\\x1b[2K: held"


def test_a_question_about_many_records_names_the_first_of_them_and_its_details_all():
    """A network of 240 buses had 133 line numbers in every answer and every refusal."""
    changes = Changes("own.raw")
    for line in range(1, 14):
        changes.note(line, "held")
    for line in range(1, 13):
        changes.note(line, "left out")
    many, few = changes.as_problems()
    assert str(many) == f"own.raw, lines {', '.join(map(str, range(1, 14)))}: held"
    lines = by_kind({str(many): many, str(few): few}, "gfor modes x --details")
    short = "own.raw, lines 1, 2, 3, 4 and 9 more: held [gfor modes x --details lists all of them]"
    assert [*lines.values()] == [short, str(few)]
    assert [*by_kind({str(many): many}).values()] == [short.partition(" [")[0]]


def test_changes_are_of_one_kind_by_what_is_said_of_them_and_not_by_their_figures():
    changes = Changes("own.raw")
    for line, power in ((4, 1.5), (7, 20.0)):
        changes.note(line, Remark(f"draws GL = {power:g} MW at 'B{line}'", "a shunt that draws"))
    changes.note(9, "IDE = 3: held at its own voltage, as 'B9' is")
    kinds = [problem.topic.kind for problem in changes.as_problems()]
    assert kinds == ["a shunt that draws"] * 2 + ["IDE = 3: held at its own voltage, as 'B9' is"]
    assert pickle.loads(pickle.dumps(Remark("x 5", "x"))).kind == "x"


def test_names_of_an_ssp_are_shown_in_one_line_and_its_values_stay(tmp_path):
    path = tmp_path / "a.ssp"
    text = '<S name="a&#10;b\u202e"><P name="k" description="\x9b" value="x&#10;y"/></S>'
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
    root = SspArchive(path).xml("SystemStructure.ssd")
    assert root.attrib == {"name": "a\\nb\\u202e"}
    assert root[0].attrib == {"name": "k", "description": "\\x9b", "value": "x\ny"}


RUNS_CODE = {
    "read_pickle",
    "read_hdf",
    "eval",
    "Unpickler",
}
"""Functions of the libraries that read files here, which run code or build any object out of a file."""

FROM_OUR_OWN_PROCESS = {"orchestrator/simulation/federation/federate.py"}
"""Modules that unpickle what another process of the same run wrote."""


def _called(source):
    """Names that a module calls, and the keyword arguments that it gives there."""
    for node in source.of(ast.Call):
        function = node.func
        name = getattr(function, "attr", getattr(function, "id", ""))
        owner = getattr(getattr(function, "value", None), "id", "")
        yield owner, name, {word.arg: word.value for word in node.keywords}


@asked_of_all_code
def calls_that_run_code():
    """File and function of each call that builds any object out of a file."""
    found = []
    for source in product_files():
        for owner, name, words in _called(source):
            allowed = words.get("allow_pickle")
            pickles = allowed is not None and getattr(allowed, "value", True) is not False
            unpickles = owner in {"pickle", "dill", "joblib", "skrf", "rf"} and name in {
                "load",
                "loads",
                "read",
            }
            if (name in RUNS_CODE and owner in {"pd", "pickle"}) or pickles or unpickles:
                found.append((source.place, f"{owner}.{name}".lstrip(".")))
    return found


def test_no_reader_is_called_that_runs_code_out_of_a_file():
    found = calls_that_run_code()
    assert [one for one in found if one[0] not in FROM_OUR_OWN_PROCESS] == []
    assert {place for place, _ in found} == FROM_OUR_OWN_PROCESS
