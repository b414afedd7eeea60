"""`gfor verify` says of every planted change what no longer agrees, and holds what nobody touched."""

import json
import shutil
import zipfile
from dataclasses import replace
from html import escape

import numpy as np
import pytest
import xarray as xr

from orchestrator.core.errors import InputError
from orchestrator.core.file_hashes import sha256_of
from orchestrator.devices.acceptance.checks.all import CHECKS
from orchestrator.face.cli import main
from orchestrator.studies.certification import acceptance, kinds, points_again
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.case_file import write_case
from orchestrator.studies.certification.compared import Verification
from orchestrator.studies.certification.files import figures_hash, write_sealed
from orchestrator.studies.certification.point import POWER
from orchestrator.studies.certification.request import REACTANCES, CertificationRequest
from orchestrator.studies.certification.verdict import verdicts_on_page
from orchestrator.studies.certification.verification import _compare_page
from tests.studies.certification.fabricated import rings
from tests.studies.certification.test_recomputing import BOUND


@pytest.fixture(scope="module")
def original(tmp_path_factory, fmu_path):
    """A certificate of two fabricated points."""
    folder = tmp_path_factory.mktemp("certificate")
    binding = folder / "mine.toml"
    binding.write_text(BOUND, encoding="utf-8")
    arguments = ["--no-check", "--reactances", "0.1,0.3", "--workers", "1", "--pod", "q"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "compute_point", rings)
        words = [
            "certify",
            str(fmu_path("gfor")),
            "--binding",
            str(binding),
            *arguments,
            "--out",
            str(folder / "out"),
        ]
        assert main(words) == 3
    return folder / "out"


@pytest.fixture
def certificate(original, tmp_path, monkeypatch):
    monkeypatch.setattr(kinds.POINTS, "compute", rings)
    return shutil.copytree(original, tmp_path / "certificate")


def edited(folder, change, *, sealed=False):
    """Change the JSON; whoever knows how gives it a new seal."""
    path = folder / "certificate.json"
    content = json.loads(path.read_text(encoding="utf-8"))
    change(content)
    if sealed:
        del content["seal"]
        write_sealed(content, path)
    else:
        path.write_text(json.dumps(content), encoding="utf-8")


def replaced(folder, name, old, new):
    path = folder / name
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def another_fmu(folder):
    with zipfile.ZipFile(folder / "converter.fmu", "a") as archive:
        archive.writestr("resources/tables.csv", "1,2")


def a_sample(folder):
    data = xr.load_dataset(folder / "responses.nc", engine="scipy")
    data[POWER].loc[{"scenario": "with", "X_L": 0.3}][175] += 1e-9
    data.to_netcdf(folder / "responses.nc", engine="scipy")


def verified(gfor, folder, *arguments):
    code, text, error = gfor("verify", folder, "--json", "--workers", 1, *arguments)
    assert code in (0, 1, 3, 5), error
    return code, json.loads(text)


def test_what_nobody_touched_holds(certificate, gfor):
    for path in (certificate, certificate / "certificate.json"):
        code, found = verified(gfor, path, "--all")
        assert (code, found["faults"], found["computed"]) == (3, [], [0.1, 0.3])
        assert sum("the same to the last digit" in text for text in found["agreed"]) == 8
    code, text, _ = gfor("verify", certificate, "--points", "0.3", "--workers", 1)
    assert code == 3
    assert "X_L = 0.3 pu, with the converter: modes: the same to the last digit" in text
    assert "no proof of who made it" in text


@pytest.mark.parametrize(
    ("reactances", "other", "verdict", "points", "code"),
    [
        ("0.1,0.3", {}, "incomplete", "2 of 13", 3),
        ("0.1", {"power": 0.0}, "fails", "1 of 13", 1),
        (
            "0.1",
            {"stability": {"stable": None, "sentence": "not known: it differs"}},
            "incomplete",
            "0 of 13",
            3,
        ),
        (",".join(map(str, REACTANCES)), {}, "passes", "13 of 13", 0),
    ],
)
def test_a_certificate_that_holds_is_no_pass(
    tmp_path, fmu_path, gfor, monkeypatch, reactances, other, verdict, points, code
):
    monkeypatch.setattr(study_module, "compute_point", lambda task: replace(rings(task), **other))
    assert (
        gfor(
            "certify",
            fmu_path("gfor"),
            "--no-check",
            "--pod",
            "q",
            "--reactances",
            reactances,
            "--workers",
            1,
            "--out",
            tmp_path,
        )[0]
        == code
    )
    got, found = verified(gfor, tmp_path, "--files-only")
    assert (got, found["holds"]) == (code, True)
    assert (found["verdict"], found["points"], found["passes"]) == (verdict, points, code == 0)
    got, text, _ = gfor("verify", tmp_path, "--files-only")
    assert got == code
    assert (
        text.strip().splitlines()[-1]
        == f"Its verdict: {verdict}, {points} line reactances of the norm judged."
    )


@pytest.mark.parametrize("pod", ["p", "pq", "none"])
def test_what_is_only_declared_holds_as_well(tmp_path, gallery, gfor, monkeypatch, pod):
    """The FMU shows no damping controller, so that the sentence says whose word it is."""
    monkeypatch.setattr(study_module, "compute_point", rings)
    fmu, binding = gallery("converter_power_si")
    arguments = (
        "--binding",
        binding,
        "--pod",
        pod,
        "--no-check",
        "--reactances",
        "0.1",
        "--workers",
        1,
    )
    assert gfor("certify", fmu, *arguments, "--out", tmp_path)[0] == 3
    assert (
        "as declared by the applicant"
        in json.loads((tmp_path / "certificate.json").read_text("utf-8"))["sentence"]
    )
    assert verified(gfor, tmp_path, "--files-only")[1]["faults"] == []


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("converter.fmu", another_fmu),
        ("vendor.toml", lambda f: replaced(f, "vendor.toml", "0.03", "0.04")),
        ("case.toml", lambda f: replaced(f, "case.toml", "governor", "other")),
        ("responses.nc", a_sample),
        ("certificate.html", lambda f: replaced(f, "certificate.html", "12.34"[:1], "9")),
        ("vendor.toml", lambda f: (f / "vendor.toml").rename(f / "binding.toml")),
        ("responses.nc", lambda f: (f / "responses.nc").unlink()),
    ],
)
def test_a_file_that_is_another_is_named(certificate, gfor, name, change):
    change(certificate)
    code, found = verified(gfor, certificate)
    assert code == 5
    assert any(text.startswith(f"{name}: ") for text in found["faults"])
    assert found["computed"] == []


def set_verdict(content):
    content.update(verdict="passes", passed=True)


def set_sentence(content):
    content["sentence"] = content["sentence"].replace("incomplete", "passes")


def set_damping(content):
    content["points"][0]["modes"][0]["damping_percent"] += 1.0


def set_growth(content):
    content["points"][0]["growth"]["with"] = 3.0


def set_power(content):
    content["points"][0]["power"] = 0.0


def set_ratio(content):
    content["points"][0]["time"]["swings"]["ratio"] = 0.0123


def drop_departures(content):
    content["missing"], content["judged"] = [], "13 of 13"


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize(
    "change", [set_verdict, set_sentence, set_damping, set_growth, set_power, set_ratio]
)
def test_an_edited_figure_or_word_does_not_agree(certificate, gfor, change, sealed):
    """Also where the JSON's own hash was computed again: the words follow from the figures."""
    edited(certificate, change, sealed=sealed)
    code, found = verified(gfor, certificate, "--files-only")
    assert code == 5
    assert any("its own hash differs" in text for text in found["faults"]) != sealed


def test_a_figure_without_words_is_held_by_the_hash(certificate, gfor):
    edited(certificate, drop_departures)
    assert verified(gfor, certificate, "--files-only")[0] == 5


@pytest.mark.parametrize(
    ("damping", "signal", "code", "said"),
    [
        (1e-9, 1e-9, 3, "the digits differ"),
        (1e-4, 0.0, 5, "comes out and"),
        (0.0, 1e-3, 5, "of its range"),
    ],
)
def test_points_that_come_out_otherwise(
    certificate, gfor, monkeypatch, damping, signal, code, said
):
    """Rounding is said and allowed; more is a disagreement."""

    def compute(task):
        found = rings(task)
        modes = replace(found.modes, eigenvalues=found.modes.eigenvalues * (1 + damping))
        signals = {name: values + signal * np.ptp(values) for name, values in found.signals.items()}
        return replace(found, modes=modes, signals=signals)

    monkeypatch.setattr(kinds.POINTS, "compute", compute)
    got, found = verified(gfor, certificate)
    assert got == code
    assert any(said in text for text in (found["faults"] if code == 5 else found["agreed"]))
    assert len(found["computed"]) == 1


def test_what_cannot_be_verified_is_said(certificate, gfor, tmp_path):
    code, _, error = gfor("verify", certificate, "--points", "0.2")
    assert (code, "it has: 0.1, 0.3" in error) == (2, True)
    code, _, error = gfor("verify", tmp_path / "nowhere")
    assert (code, "cannot be read" in error) == (2, True)
    edited(certificate, lambda content: content.pop("format"))
    code, _, error = gfor("verify", certificate)
    assert (code, "no certificate of format 2" in error) == (2, True)


def test_equal_modes_agree_and_one_that_is_no_number_does_not():
    """Equal differences leave complex numbers to be compared, which have no order."""
    modes = [-1 + 2j, -1 + 3j]
    assert points_again._differ_modes(modes, list(modes), 1e-5)[0] == ""
    assert points_again._differ_modes(modes, [-1 + 2j, complex("nan")], 1e-5)[0]
    assert points_again._differ_modes(modes, [complex("nan"), -1 + 3j], 1e-5)[0]


def at(*place, value):
    """Sets one entry."""

    def change(content):
        for key in place[:-1]:
            content = content[key]
        content[place[-1]] = value

    return change


FORGED = {
    "pod": at("pod", value="none"),
    "pod_values": at("pod_values", value={}),
    "pod_source": at("pod_source", value="as declared"),
    "values": at("values", value={"droop.R_f": 0.05}),
    "departures": at("departures", value=["grid.x = 1"]),
    "judged": at("judged", value="13 of 13"),
    "missing": at("missing", value=[]),
    "author": at("fmu", "author", value="Somebody Else"),
    "sentence": lambda c: c.update(sentence=c["sentence"][:30]),
    "growth": at("points", 0, "growth", "with", value=-9.9),
    "stability": at("points", 0, "stability", "with", "sentence", value="xx"),
    "power": at("points", 0, "power", value=1351.0),
    "lowered": at(
        "points",
        0,
        "lowered",
        value=[{"frequency_hz": 1.0, "from_percent": 9.0, "to_percent": 1.0}],
    ),
    "modes_without": at("points", 0, "modes_without", value=[]),
    "without": at("points", 0, "modes", 0, "without", value=None),
    "swings": at("points", 0, "time", "swings", "swings", value=[]),
    "modal": at("points", 0, "time", "modal", "modes", value=[]),
    "used": at("parameters", 0, "used", value=123456.0),
    "fit_errors": at("fit_errors", value={"converter": 0.5}),
    "converter_model": at("points", 0, "converter_model", "source", value="identified"),
    "applicant": at("details", "applicant", value="Other GmbH"),
    "commit": at("environment", "Commit", value="deadbeef"),
}


@pytest.mark.parametrize("name", FORGED)
def test_no_entry_can_be_changed_and_sealed_again(certificate, gfor, name):
    edited(certificate, FORGED[name], sealed=True)
    code, found = verified(gfor, certificate, "--files-only")
    assert code == 5
    assert any("it was made of other figures" in text for text in found["faults"])


@pytest.mark.parametrize(
    "name",
    [
        "pod",
        "pod_values",
        "pod_source",
        "values",
        "departures",
        "judged",
        "missing",
        "author",
        "sentence",
        "lowered",
    ],
)
def test_what_follows_from_the_files_is_derived_again(certificate, gfor, name):
    """Also where the page was given the hash of the other figures."""
    path = certificate / "certificate.json"
    before = figures_hash(json.loads(path.read_text(encoding="utf-8")))
    edited(certificate, FORGED[name], sealed=True)
    after = figures_hash(json.loads(path.read_text(encoding="utf-8")))
    replaced(certificate, "certificate.html", before, after)
    edited(
        certificate,
        lambda c: c["files"].update(
            {"certificate.html": sha256_of(certificate / "certificate.html")}
        ),
        sealed=True,
    )
    code, found = verified(gfor, certificate, "--files-only")
    assert code == 5
    assert not any("hash" in text or "SHA" in text for text in found["faults"])


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (at("points", value=[]), "points"),
        (at("points", value={}), "points"),
        (at("points", value=[1]), "points.0"),
        (lambda c: c.pop("points"), "points is missing"),
        (at("files", value=[1]), "files"),
        (at("files", value="abc"), "files"),
        (at("points", 0, "modes", value=None), "points.0.modes"),
        (
            at("points", 0, "modes", 0, "damping_percent", value="abc"),
            "points.0.modes.0.damping_percent",
        ),
        (at("points", 0, "X_L", value=None), "points.0.X_L"),
        (at("acceptance", value=3), "acceptance"),
        (at("sentence", value="\ud800"), "half a character"),
    ],
)
def test_a_damaged_certificate_is_one_error(certificate, gfor, change, place):
    edited(certificate, change)
    code, _, error = gfor("verify", certificate)
    assert (code, place in error, "damaged" in error) == (2, True, True), error


def test_deep_json_and_a_page_of_other_bytes_are_no_traceback(certificate, gfor):
    (certificate / "certificate.html").write_bytes(b"\xff\xff")
    code, found = verified(gfor, certificate)
    assert (code, any(text.startswith("certificate.html") for text in found["faults"])) == (5, True)
    (certificate / "certificate.json").write_text("[" * 200_000, encoding="utf-8")
    code, _, error = gfor("verify", certificate)
    assert (code, "it is not JSON" in error) == (2, True)


def test_a_refused_request_leaves_a_finished_certificate_as_it_was(certificate, gfor):
    files = {p.name: p.read_bytes() for p in certificate.iterdir() if p.is_file()}
    words = [
        "certify",
        certificate / "converter.fmu",
        "--set",
        "nosuch=1",
        "--no-check",
        "--out",
        certificate,
    ]
    code, _, error = gfor(*words)
    assert (code, "has no variable 'nosuch'" in error, "makes from the request" in error) == (
        2,
        True,
        True,
    )
    assert {p.name: p.read_bytes() for p in certificate.iterdir() if p.is_file()} == files
    assert not list(certificate.glob(".request_*"))


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"growth": -0.6}, "largest growth rate"),
        ({"growth": float("nan")}, "largest growth rate"),
        ({"stability": {"stable": False, "sentence": ""}}, "stable = False"),
        ({"power": 1349.0}, "it feeds in"),
        ({"identified": 3}, "its linear model"),
    ],
)
def test_figures_of_a_point_that_come_out_otherwise(certificate, gfor, monkeypatch, other, said):
    monkeypatch.setattr(kinds.POINTS, "compute", lambda task: replace(rings(task), **other))
    code, found = verified(gfor, certificate)
    assert (code, any(said in text for text in found["faults"])) == (5, True)


def test_a_name_with_a_new_line_is_escaped_in_the_case_file(tmp_path, fmu_path):
    named = tmp_path / "a\nb = 1.fmu"
    shutil.copyfile(fmu_path("gfor"), named)
    (tmp_path / "out").mkdir()
    case = write_case(CertificationRequest(named), {}, tmp_path / "out")
    assert r"'a\nb = 1.fmu'" in case.text.splitlines()[0]


def test_a_report_in_which_nothing_was_passed_is_refused(tmp_path, fmu_path):
    fmu = fmu_path("gfor")
    checks = [{"check": name, "verdict": "not applicable", "fault": ""} for name in CHECKS]
    report = {
        "tool": acceptance._tool(),
        "trusted": True,
        "checks": checks,
        "sha256": {"fmu": sha256_of(fmu), "binding": None},
    }
    path = tmp_path / "check.json"
    path.write_text(json.dumps(report), encoding="utf-8")
    with pytest.raises(InputError, match="none of its checks was passed"):
        acceptance.read_checks(path, fmu, None)
    checks[0]["verdict"] = "pass"
    path.write_text(json.dumps(report), encoding="utf-8")
    assert acceptance.read_checks(path, fmu, None).trusted


@pytest.mark.parametrize(
    ("lost", "faults"),
    [
        ("", 0),
        ("3 of 5 judged rows are accepted.", 1),
        ("ACCEPTANCE TESTS FAILED: crash; do not rely on the FMU as it is.", 1),
    ],
)
def test_a_page_that_hides_a_verdict_or_failed_acceptance_tests_is_found(tmp_path, lost, faults):
    content = {
        "sentence": "The converter 'x' fails MISO: 3 of 5 judged rows are accepted. Not accepted: rocof: settles. "
        "Acceptance tests failed: crash; do not rely on the FMU as it is."
    }
    shown = "".join(f"<b>{escape(one)}</b>" for one in verdicts_on_page(content["sentence"]))
    page = tmp_path / "certificate.html"
    page.write_text(f"{shown.replace(lost, '')}{figures_hash(content)}", encoding="utf-8")
    found = Verification()
    _compare_page(page, content, found)
    assert len(found.faults) == faults
    assert "rocof" not in shown  # the rows' table says it
