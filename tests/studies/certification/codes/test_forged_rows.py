"""Certificates of codes from which rows were taken, or into which some were put, with all hashes made to fit."""

import json
import shutil
from dataclasses import replace
from html import escape

import numpy as np
import pytest
import xarray as xr

from orchestrator.cases.case import load_case
from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.devices.binding.binding import bound_fmu
from orchestrator.output.results.file_writers import save_netcdf
from orchestrator.studies.certification.case_file import BINDING
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.bench_point import (
    BenchResult,
    case_name,
    declared_limit,
    write_row,
)
from orchestrator.studies.certification.codes.known import KNOWN
from orchestrator.studies.certification.codes.row_verdict import judge_row
from orchestrator.studies.certification.files import (
    HTML,
    JSON,
    RESPONSES,
    figures_hash,
    save,
    seal_of,
)
from orchestrator.studies.certification.request import CertificationRequest
from orchestrator.studies.certification.verdict import verdicts_on_page
from orchestrator.studies.certification.verification import read_certificate, verify_files
from tests.support.bindings import GFOR
from tests.support.grid_codes import replace_code

CODE = CODES["fingrid"]


@pytest.fixture(scope="module")
def original(tmp_path_factory, fmu_path):
    """A certificate of Fingrid's table on powers that never move: jumps are not opposed, and the rest is met."""
    return issued_in(tmp_path_factory.mktemp("issued"), fmu_path("gfor"))


@pytest.fixture
def fails(original, tmp_path):
    """A copy of that certificate, to be changed."""
    return shutil.copytree(original, tmp_path / "certificate")


def issued_in(folder, tested, declared=None):
    """Issue that certificate; ``declared``: the limit of the current in the converter's binding [pu]."""
    results, fmu, binding = {}, folder / "converter.fmu", None
    shutil.copyfile(tested, fmu)
    if declared is not None:
        binding = folder / BINDING
        binding.write_text(GFOR.replace("[rating]", f"[rating]\nI_max = {declared}"), "utf-8")
    description = bound_fmu(fmu, binding)
    assert declared_limit(description) == declared
    request = CertificationRequest(fmu, binding)
    for row in CODE.rows:
        programme = row.programme(50.0)
        times = np.arange(0, programme.stop + 1e-3, 1e-3)
        one, angle = np.ones(times.shape), programme.source_angle(times, 50.0)
        signals = {
            "p": 0.5 * one,
            "q": 0.1 * one,
            "v": one,
            "v_re": np.cos(angle),
            "v_im": np.sin(angle),
        }
        results[row.name] = BenchResult(row.name, times, signals, current_limit=declared)
        write_row(request, row.name, row.title, programme, 50.0, folder)
    verdicts = [judge_row(row, results[row.name], 50.0) for row in CODE.rows]
    case = folder / case_name(CODE.rows[0].name)
    issued = Certificate(request, description, CODE, 50.0, verdicts, results, case)
    issued.values = load_case(case).prepare()[0].values
    save(issued, folder)
    found = verify_files(*read_certificate(folder))
    assert found.holds, found.faults
    return folder


def sealed(folder, content):
    """Make the page's mark and all hashes fit."""
    page = folder / HTML
    old = json.loads((folder / JSON).read_text(encoding="utf-8"))
    text = page.read_text(encoding="utf-8")
    said, says = (verdicts_on_page(one["sentence"]) for one in (old, content))
    for former, now in zip(said, says, strict=True):
        text = text.replace(escape(former), escape(now))
    page.write_text(text.replace(figures_hash(old), figures_hash(content)), encoding="utf-8")
    content["files"] = {name: sha256_of(folder / name) for name in content["files"]}
    content["seal"] = seal_of(content)
    (folder / JSON).write_text(json.dumps(content), encoding="utf-8")
    return " ".join(verify_files(*read_certificate(folder)).faults)


def without(content, name):
    """The record without a row, and with the verdict, sentence and missing parts to which the others come."""
    content["rows"] = [row for row in content["rows"] if row["row"] != name]
    content["verdict"], content["missing"] = "incomplete", [f"row {name}", *CODE.left_out]
    content["sentence"] = (
        f"The test is incomplete: 2 parts of {CODE.title} were not tested. "
        "The converter 'gfor': 3 of 3 judged rows are accepted."
    )
    return content


def test_verify_knows_the_declared_limit_of_the_current(tmp_path, fmu_path):
    """The margin is that to 1.05 times the binding's I_max, of a current of hypot(0.5, 0.1) pu; nobody widens it."""
    folder = issued_in(tmp_path, fmu_path("gfor"), 1.3)
    _, content = read_certificate(folder)
    told = [c for row in content["rows"] for c in row["criteria"] if c["criterion"] == "current"]
    assert told
    for current in told:
        assert current["limit"] == pytest.approx(1.365)
        assert current["margin"] == pytest.approx(1 - np.hypot(0.5, 0.1) / 1.365)
        current |= {"limit": 3.3, "margin": 1 - np.hypot(0.5, 0.1) / 3.3}
    assert "'criteria" in sealed(folder, content)


def test_a_failed_row_that_was_taken_out_is_named(fails, request):
    _, content = read_certificate(fails)
    assert content["verdict"] == "fails"
    faults = sealed(fails, without(content, "jumps"))
    for what in ("of the code's table that", "of rows that", f"of {RESPONSES} that"):
        assert f"{what} the record has not: jumps" in faults
    code, said, _ = request.getfixturevalue("gfor")("verify", fails, "--files-only")
    assert code == 5
    assert "The certificate does not hold" in said


def issued_by(content, version):
    content["environment"] |= {"gfor-cosim": version, "Code": f"that of {version or 'no version'}"}
    return content


@pytest.fixture
def without_jumps(fails):
    """A record of a table without the row of the jumps, as an earlier version would have written it."""
    _, content = read_certificate(fails)
    del content["files"][case_name("jumps")]
    (fails / case_name("jumps")).unlink()
    with xr.open_dataset(fails / RESPONSES, engine="scipy") as data:
        rest = data.load().drop_vars([n for n in data.variables if "jumps" in str(n)])
    save_netcdf(rest, fails / RESPONSES)
    content = without(content, "jumps")
    content["missing"], rows = (
        list(CODE.left_out),
        "The converter 'gfor': 3 of 3 judged rows are accepted.",
    )
    content["sentence"] = f"The test is incomplete: 1 parts of {CODE.title} were not tested. {rows}"
    return fails, content


def since(monkeypatch, version):
    rows = tuple(replace(row, since=version if row.name == "jumps" else "") for row in CODE.rows)
    replace_code(monkeypatch, replace(CODE, rows=rows))


@pytest.mark.parametrize(
    ("first", "issued", "holds"),
    [
        ("0.4.0", "0.3.0", True),
        ("0.10.0", "0.9.2", True),
        ("0.3.0", "0.3.0", False),
        ("", "0.2.0", False),
        ("0.3.0", "0.10.0", False),
        ("0.4.0", "", False),
    ],
)
def test_a_row_that_came_later_is_no_row_that_was_taken_out(
    without_jumps, monkeypatch, gfor, first, issued, holds
):
    """Only a row that the table has since a later version than that of the record may be absent."""
    folder, content = without_jumps
    since(monkeypatch, first)
    faults = sealed(folder, issued_by(content, issued))
    assert ("of the code's table that the record has not: jumps" in faults) is not holds
    assert bool(faults) is not holds
    code, said, _ = gfor("verify", folder, "--files-only")
    told = f"issued by gfor-cosim {issued}, whose table had not jumps: this version"
    assert (code, told in " ".join(said.split())) == ((3, True) if holds else (5, False))


def test_what_passed_before_a_row_came_is_incomplete(without_jumps, monkeypatch, gfor):
    """So nobody gets a pass by an older version than the one that wrote the record."""
    folder, content = without_jumps
    since(monkeypatch, "0.4.0")
    replace_code(monkeypatch, replace(KNOWN["fingrid"], left_out=()))
    content |= {"left_out": [], "missing": [], "verdict": "passes"}
    content["sentence"] = (
        f"The converter 'gfor' passes {CODE.title}: 3 of 3 judged rows are accepted."
    )
    assert sealed(folder, issued_by(content, "0.3.0")) == ""
    code, said, _ = gfor("verify", folder, "--files-only")
    assert (code, "Its verdict: incomplete; jumps was not in its table" in said) == (3, True)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("more", "that do not come out anew: row more"),
        ("dip", "that the record has twice: row dip"),
    ],
)
def test_a_row_that_is_too_much_is_named(fails, name, words):
    _, content = read_certificate(fails)
    content["rows"].append(content["rows"][0] | {"row": name})
    (fails / case_name("more")).write_text("", encoding="utf-8")
    content["files"][case_name(name)] = ""
    assert words in sealed(fails, content)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        (
            "sentence",
            "The converter 'gfor' fails: 9 of 9 judged rows are accepted.",
            "'sentence' is",
        ),
        ("missing", [], "'missing' is"),
        ("left_out", [], "'left_out' is"),
    ],
)
def test_a_count_or_a_part_that_is_not_of_the_rows_is_named(fails, key, value, words):
    _, content = read_certificate(fails)
    content[key] = value
    assert words in sealed(fails, content)


def test_a_key_that_stands_twice_is_refused(fails):
    """Readers that take the first of two verdicts read a pass."""
    path = fails / JSON
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace('"verdict":', '"verdict": "passes",\n "verdict":', 1), encoding="utf-8"
    )
    with pytest.raises(InputError, match="'verdict' stands twice"):
        read_certificate(fails)


def test_a_row_file_that_the_record_does_not_know_is_told(fails):
    other = next(row.name for row in CODES["ercot"].rows)
    (fails / case_name(other)).write_text("", encoding="utf-8")  # of an earlier certificate
    assert verify_files(*read_certificate(fails)).holds
    (fails / "row_more.toml").write_text("", encoding="utf-8")
    assert verify_files(*read_certificate(fails)).faults == [
        "row_more.toml: the record does not know it; take it away, or certify anew"
    ]
