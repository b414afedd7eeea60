"""Several devices under several codes: cells, margins, exit codes and files."""

import json
import re
import shutil

import numpy as np
import pytest

import orchestrator as gfor_api
from orchestrator.face.cli import certify_matrix
from orchestrator.linear.signals.identification import IdentifiedMode
from orchestrator.studies.certification.certificate import Certificate
from orchestrator.studies.certification.codes.all_codes import CODES
from orchestrator.studies.certification.codes.row import RowFinding
from orchestrator.studies.certification.codes.row_verdict import RowVerdict
from orchestrator.studies.certification.criteria import ModalTest, ModeVerdict
from orchestrator.studies.certification.judgement import PointVerdict, TimeVerdict
from orchestrator.studies.certification.margins import CriterionMargin, narrowest
from orchestrator.studies.certification.matrix import (
    CertificateMatrix,
    MatrixCell,
    in_words,
    matrix_json,
    matrix_page,
)
from orchestrator.studies.certification.swings import SwingTest


def cell(device="a", code="miso", verdict="passes", **given):
    return MatrixCell(device, code, f"{device}/{code}", verdict=verdict, **given)


def matrix(*cells):
    devices, codes = (
        tuple(dict.fromkeys(getattr(c, n) for c in cells)) for n in ("device", "code")
    )
    return CertificateMatrix(devices, codes, {(c.device, c.code): c for c in cells})


PASSES, FAILS, INCOMPLETE = (
    cell(),
    cell(code="aemo", verdict="fails"),
    cell(code="ercot", verdict="incomplete"),
)
REFUSED, LOST = (
    cell(code="fingrid", refused=True),
    cell("b", "miso", "not tested", failure="no licence"),
)


@pytest.mark.parametrize(
    ("cells", "code"),
    [
        ((PASSES,), 0),
        ((PASSES, REFUSED), 4),
        ((REFUSED, INCOMPLETE, PASSES), 3),
        ((INCOMPLETE, LOST), 2),
        ((PASSES, LOST), 2),
        ((LOST, INCOMPLETE, REFUSED, FAILS), 1),
    ],
)
def test_the_worst_certificate_decides_the_exit_code(cells, code):
    assert matrix(*cells).exit_code == code


def test_the_sentence_counts_every_kind():
    said = matrix(PASSES, FAILS, INCOMPLETE, REFUSED).sentence()
    assert (
        said == "Of 4 certificates: 2 passed, 1 failed, 1 incomplete. Acceptance tests failed: a."
    )
    assert matrix(LOST).sentence() == "Of 1 certificate: 1 not tested."


def margin(value, accepted=None, criterion="settles"):
    good = value is not None and value >= 0 if accepted is None else accepted
    return CriterionMargin("row", criterion, value, good, "found")


def test_a_failure_without_a_figure_is_not_hidden_by_good_margins():
    bad = cell(
        verdict="fails",
        margins=[margin(0.3), margin(None, accepted=False, criterion="stable"), margin(0.1)],
    )
    assert bad.narrowest == margin(0.1)
    assert [m.criterion for m in bad.failed] == ["stable"]
    assert in_words(bad) == ["fails", "row: stable", "+10 % row: settles"]


def test_the_narrowest_margin_is_the_least_and_may_be_missing():
    assert narrowest([margin(0.2), margin(-3.0), margin(None)]).margin == -3.0
    assert narrowest([margin(0.0), margin(0.4)]).margin == 0.0
    assert narrowest([margin(None)]) is None


def mode(percent, hz=0.6, before=None):
    w = 2 * np.pi * hz
    zeta = percent / 100
    value = complex(-zeta * w / np.sqrt(1 - zeta**2), w)
    accepted = percent >= 5 or (before is not None and before < 5)
    return ModeVerdict(value, None, 1.0, accepted, f"{percent} %")


def response(ratio, least=None, *, swings=True, modal=True):
    modes = () if least is None else (IdentifiedMode(complex(-least / 100, 1.0) * 4, 1.0),)
    swing = SwingTest(None, (), ratio, swings, "by its swings")
    return TimeVerdict("sg1.p", swing, swing, ModalTest(modes, modal, "by its modes"))


def norm(modes, time, faults=()):
    point = PointVerdict(0.1, modes, time, None, tuple(faults))
    made = object.__new__(Certificate)
    made.verdicts = [point]
    return made.margins


def test_the_norms_margins_are_in_parts_of_5_percent_and_of_the_ratio_of_swings():
    damping, swings = norm((mode(8.0),), response(0.1))
    assert damping.margin == pytest.approx(0.6)
    assert damping.criterion == "damping at 0.600 Hz"
    assert swings.margin is None  # its modes accept it without a figure, which is the better way
    _, swings = norm((mode(8.0),), response(0.1, least=4.0, modal=False))
    assert swings.margin == pytest.approx(0.6)
    _, swings = norm((mode(8.0),), response(0.5, least=8.0, swings=False))
    assert swings.margin == pytest.approx(0.6, abs=0.01)  # by its modes: 8 % where 5 are asked for
    low, _ = norm((mode(2.0),), response(0.1), ["low"])
    assert low.margin == pytest.approx(-0.6)
    assert not low.accepted


def test_a_row_without_a_verdict_or_an_answer_gives_no_margin():
    """AEMO's ±60° are shown only: a failure there must not stand as the narrowest margin."""
    bad, good = (
        RowFinding("settles", "", "code", 1.0, 1.0, m, m >= 0, "found") for m in (-5.0, 0.2)
    )
    rows = {row.name: row for row in CODES["aemo"].rows}
    made = object.__new__(Certificate)
    made.verdicts = [
        RowVerdict(rows["jump_60"], (bad,)),
        RowVerdict(rows["jump_10"], (good,)),
        RowVerdict(rows["rocof"], unknown="no licence"),
    ]
    assert [(m.place, m.margin) for m in made.margins] == [("jump_10", 0.2)]


def test_a_mode_that_was_low_without_the_converter_has_no_margin():
    assert [m.criterion for m in norm((mode(2.0, before=1.0),), response(0.1))] == ["response"]


def test_a_point_that_is_refused_for_something_else_has_no_figure():
    found = norm((mode(8.0),), response(0.1), ["synchronism is lost"])
    assert [(m.criterion, m.margin, m.text) for m in found if not m.accepted] == [
        ("stable", None, "synchronism is lost")
    ]


def test_the_page_links_every_certificate_and_escapes_foreign_names():
    whole = matrix(
        cell("<b>", margins=[margin(0.1)]), cell("<b>", "aemo", "fails", margins=[margin(-0.2)])
    )
    page = matrix_page(whole, [], None)
    assert "&lt;b&gt;" in page
    assert "<b>/" not in page
    assert 'href="%3Cb%3E/miso/certificate.html"' in page
    assert "−20 % row: settles" in page


def test_figures_without_a_verdict_stand_in_the_matrix_and_decide_nothing():
    """Also where they could not be measured."""
    shown = cell("b", "gb", "no verdict", figures=["least |P/theta|: 9.1", "not met"])
    lost = cell("a", "gb", "not tested", figures=(), failure="it does not come to rest")
    whole = matrix(cell("a", "gb"), PASSES, shown, cell("b"))
    whole.cells["a", "gb"] = lost
    assert whole.exit_code == 0
    assert whole.sentence() == "Of 2 certificates: 2 passed. Figures without a verdict: gb."
    assert (
        matrix(shown).sentence() == "No certificate was asked for. Figures without a verdict: gb."
    )
    assert in_words(shown) == ["no verdict", "least |P/theta|: 9.1", "not met"]
    page = matrix_page(whole, [], None)
    assert 'href="b/gb/frequency.png"' in page
    assert '<span class="bad">not tested</span>' in page
    assert "it does not come to rest" in page
    assert "gb/certificate" not in page
    first, _, third, _ = matrix_json(whole, [])["cells"]
    assert (first["certificate"], first["figures"], first["exit_code"]) == (None, None, 0)
    assert (third["certificate"], third["figures"]) == (None, "b/gb/frequency.json")


@pytest.mark.parametrize(
    ("verdict", "word", "code"),
    [(True, "passed", 0), (False, "failed", 1), (None, "incomplete", 3)],
)
def test_the_behaviour_in_frequency_counts_beside_the_certificates(verdict, word, code):
    found = cell("b", "frequency")
    figures = {"verdict": verdict, "sentence": "as measured", "points": [{}, {}]}
    found.take_behaviour(figures, "frequency.json", "impedance.png")
    whole = matrix(cell("b"), found)
    assert whole.exit_code == code
    assert whole.sentence() == f"Of 1 certificate: 1 passed. Voltage source in frequency: b {word}."
    _, of_it = matrix_json(whole, [])["cells"]
    assert (of_it["certificate"], of_it["figures"]) == (None, "b/frequency/frequency.json")
    assert (of_it["sentence"], of_it["judged"]) == ("as measured", 2)
    assert 'href="b/frequency/impedance.png"' in matrix_page(whole, [], None)


def test_several_devices_are_judged_in_frequency_beside_each_other(tmp_path, gfor, monkeypatch):
    def measured(device, folder):
        figures = {"verdict": device.name == "a", "sentence": f"of {device.name}", "points": []}
        return figures, [folder / "frequency.json"]

    monkeypatch.setattr(certify_matrix, "measured_behaviour", measured)
    words = ["certify", tmp_path / "a.fmu", tmp_path / "b.fmu", "--code", "frequency", "--json"]
    code, text, _ = gfor(*words, "--out", tmp_path / "out")
    cells = json.loads(text)["cells"]
    assert (code, [cell["verdict"] for cell in cells]) == (1, ["passes", "fails"])
    assert [cell["sentence"] for cell in cells] == ["of a", "of b"]
    assert gfor(*words, "--declare", "D=2", "--out", tmp_path / "out")[0] == 2


@pytest.mark.slow
def test_devices_of_one_file_name_keep_their_results_beside_one_that_cannot_be_used(tmp_path, gfor):
    """Ours and a grid-following converter in files of one name, each with the figures that it has alone."""
    for name in ("gfor", "gfl"):
        (tmp_path / name).mkdir()
        shutil.copyfile(gfor_api.build(name, tmp_path / "fmu"), tmp_path / name / "device.fmu")
    (tmp_path / "broken.fmu").write_text("no archive")
    files = [
        tmp_path / "gfor" / "device.fmu",
        tmp_path / "gfl" / "device.fmu",
        tmp_path / "broken.fmu",
    ]
    words = ["--code", "ercot", "--no-check", "--workers", 1]
    code, text, error = gfor("certify", *files, *words, "--out", tmp_path / "out", "--json")
    assert code == 1
    content = json.loads(text)
    ours, follower, broken = content["cells"]
    assert [c["device"] for c in content["cells"]] == ["gfor_device", "gfl_device", "broken"]
    assert [c["verdict"] for c in content["cells"]] == ["incomplete", "fails", "not tested"]
    assert "it is not an FMU" in broken["failure"]
    assert "broken, ercot" in error
    assert ours["narrowest"]["margin"] > 0 > follower["narrowest"]["margin"]
    for found, device in ((ours, "gfor"), (follower, "gfl")):
        certificate = json.loads(
            (tmp_path / "out" / found["certificate"]).read_text(encoding="utf-8")
        )
        assert certificate["model"] == device
        least = min(
            c["margin"]
            for r in certificate["rows"]
            for c in r["criteria"]
            if c["margin"] is not None
        )
        assert found["narrowest"]["margin"] == least
    assert (
        json.loads((tmp_path / "out" / "matrix.json").read_text(encoding="utf-8"))["cells"]
        == content["cells"]
    )
    page = (tmp_path / "out" / "matrix.html").read_text(encoding="utf-8")
    for link in re.findall(r'href="([^"#:]+certificate[^"]*)"', page):
        assert (tmp_path / "out" / link).is_file()
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("points/*.npz")}
    assert len(before) == 6
    assert gfor("certify", *files, *words, "--out", tmp_path / "out")[0] == 1
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("points/*.npz")} == before
    code, _, _ = gfor("verify", tmp_path / "out" / "gfl_device" / "ercot")
    assert code == 1  # it holds, and says that the converter fails


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a.fmu", "b.fmu"], "there is no such file"),
        (["x.fmu", "--code", "all"], "there is no such file"),
        (
            ["a.fmu", "b.fmu", "--check", "report.json"],
            "a report of `gfor fmu check` is of one FMU",
        ),
        (["a.fmu", "b.fmu", "--binding", "v.toml"], "does not say whose it is"),
        (["a.fmu", "--code", "all", "--pod", "p"], "only --code nts631 has it"),
        (
            ["a.fmu", "--code", "all", "--set", "sg1.machine.H=4"],
            "the test bench has no such component",
        ),
    ],
)
def test_nothing_that_can_be_tested_is_one_error(gfor, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    code, out, error = gfor("certify", *words)
    assert (code, out) == (2, "")
    assert said in " ".join(error.split())
    assert error.count("error:") == 1
    assert "not tested" not in error
    assert "Traceback" not in error
    assert not list(tmp_path.rglob("matrix.*"))


def test_the_cells_of_the_json_tell_what_could_not_be_tested():
    lost, passed = matrix_json(matrix(LOST, cell("b", "aemo")), [])["cells"]
    assert (lost["failure"], lost["certificate"], lost["exit_code"]) == ("no licence", None, 2)
    assert (passed["failure"], passed["certificate"]) == (None, "b/aemo/certificate.json")
