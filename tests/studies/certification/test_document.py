"""What makes a certificate a document: details, origin, parameters, hashes, acceptance tests, pages."""

import hashlib
import json
import re
from html import escape
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.core.errors import CaseError, InputError
from orchestrator.devices.acceptance.checks.all import CHECKS
from orchestrator.devices.acceptance.checks.base import failed, passed
from orchestrator.devices.acceptance.runner import AcceptanceReport
from orchestrator.linear.spectra.mode_tracking import ModeSet
from orchestrator.output.report.pdf import find_browser
from orchestrator.studies.certification import study as study_module
from orchestrator.studies.certification.details import Details, read_details
from orchestrator.studies.certification.environment import environment
from orchestrator.studies.certification.judgement import judge
from orchestrator.studies.certification.point import POWER, PointResult
from orchestrator.studies.certification.report_criteria import converter_model
from tests.studies.certification.fabricated import rings
from tests.support.late import LateLibrary

pypdf = LateLibrary("pypdf")

DETAILS = 'number = "7/2026"\napplicant = "Acme <Power>"\noperator = ""\ntester = "Lab 3"\ndate = 2026-11-22\n'


@pytest.fixture(scope="module")
def document(tmp_path_factory, gallery):
    """A certificate of a foreign FMU, with everything that can be given; its page and its figures."""
    folder = tmp_path_factory.mktemp("document")
    fmu, binding = gallery("converter_power_si")
    (folder / "details.toml").write_text(DETAILS, encoding="utf-8")
    report = AcceptanceReport(fmu, binding, [passed(name, "fine") for name in CHECKS])
    (folder / "report.json").write_text(json.dumps(report.as_dict()), encoding="utf-8")
    from orchestrator.face.cli import main  # noqa: PLC0415

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_module, "compute_point", rings)
        words = [
            "certify",
            fmu,
            "--binding",
            binding,
            "--reactances",
            "0.1",
            "--workers",
            1,
            "--out",
            folder,
            "--details",
            folder / "details.toml",
            "--check",
            folder / "report.json",
        ]
        assert main([*map(str, words), *(["--pdf"] if find_browser() else [])]) == 3
    content = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    return SimpleNamespace(
        folder=folder,
        content=content,
        binding=binding,
        page=(folder / "certificate.html").read_text(encoding="utf-8"),
    )


def test_details_stand_on_the_page_and_what_is_absent_is_a_line(document):
    for text in ("7/2026", "Acme &lt;Power&gt;", "Lab 3", "2026-11-22"):
        assert text in document.page
    blanks = re.findall(
        r"<td class=text>([^<]*)</td><td class=text><span class=\"blank\">", document.page
    )
    assert blanks == [
        "Network operator",
        "Place",
        "Signature of the tester",
        "Signature of the applicant",
    ]
    assert document.content["details"]["applicant"] == "Acme <Power>"


def test_the_fmu_its_binding_and_all_its_parameters_stand_there(document):
    text = document.binding.read_text(encoding="utf-8")
    assert hashlib.sha256(document.binding.read_bytes()).hexdigest() in document.page
    for line in text.splitlines():
        assert escape(line) in document.page
    rows = {row["name"]: row for row in document.content["parameters"]}
    assert set(rows) == {"S_n", "P_0", "Q_0", "v_0", "theta_0", "R_f", "tau"}
    assert rows["tau"] == {
        "name": "tau",
        "unit": "s",
        "start": 0.1,
        "used": 0.1,
        "changed_by": "",
        "description": "",
    }
    # [MW]: what the study's 0.9 pu are for this FMU
    assert rows["P_0"]["used"] == pytest.approx(1350.0)
    assert rows["P_0"]["changed_by"] == "the study, P_0 of the binding"
    for label in ("Author", "Version", "Description", "Made by", "Rating", "Voltage"):
        assert f"<td class=text>{label}</td>" in document.page
    assert "230 kV (V_n of the binding)" in document.page


def test_machine_versions_and_hashes_stand_there(document):
    for name, value in environment().items():
        assert f"<td class=text>{name}</td><td class=text>{value}</td>" in document.page
    for name, value in document.content["files"].items():
        assert hashlib.sha256((document.folder / name).read_bytes()).hexdigest() == value
        assert name in ("certificate.html", "certificate.pdf") or value in document.page
    assert {"converter.fmu", "vendor.toml", "case.toml", "responses.nc", "check.json"} < set(
        document.content["files"]
    )


def test_what_was_read_into_the_norm_and_what_this_does_not_prove_stand_there(document):
    page = " ".join(document.page.split())
    assert "norm&#x27;s own text was not at hand" in page
    assert "no protection against forgery" in page
    assert "White box: the FMU&#x27;s own states" in page


def test_the_navigation_breaks_its_line(document):
    """Without a place to break, its links run over the margin."""
    (rule,) = re.findall(r"\nnav \{([^}]*)\}", document.page)
    assert "flex-wrap: wrap" in rule
    assert "nowrap" not in re.findall(r"nav a \{([^}]*)\}", document.page)[0]


def test_every_printed_page_has_its_number(document):
    assert "counter(page)" in document.page
    if find_browser():  # a browser is no part of the program
        pages = pypdf.PdfReader(document.folder / "certificate.pdf").pages
        for number, sheet in enumerate(pages, start=1):
            assert f"{number} / {len(pages)}" in sheet.extract_text()


def one_mode(scenario, *modes):
    """A point of modes, each of a frequency and a damping ratio, that keep their shapes."""
    values = [2 * np.pi * f / np.sqrt(1 - d**2) * complex(-d, np.sqrt(1 - d**2)) for f, d in modes]
    shapes = np.eye(len(modes), dtype=complex)
    names = tuple(f"s{k}" for k in range(len(modes)))
    t = np.arange(0, 20, 0.01)
    signal = np.exp(-t) * np.sin(3 * t)
    modes = ModeSet(np.array(values), shapes, shapes, names)
    return PointResult(
        0.1,
        scenario,
        modes,
        ["sg1"] * len(names),
        -0.1,
        residual=0.0,
        power=1350.0,
        times=t,
        signals={POWER: signal},
        identified=5,
        fit_errors={"converter": 3e-4},
    )


def test_a_damping_that_is_lowered_is_remarked_and_modes_beside_are_listed():
    lacking = one_mode("without", (0.5, 0.2533), (1.0, 0.12), (2.0, 0.30), (0.07, 0.2))
    having = one_mode("with", (0.5, 0.0871), (1.0, 0.101), (2.0, 0.01), (0.07, 0.5))
    found = judge(having, lacking, "none", 1.0)
    assert [(m.before_percent, m.damping_percent) for m in found.lowered] == [
        pytest.approx((25.33, 8.71)),
        pytest.approx((30, 1)),
    ]
    assert found.eigenvalues_accepted
    assert [m.frequency_hz for m in found.neighbours] == pytest.approx([0.07, 2.0])
    assert converter_model([having]) == (
        "Black box: a model identified at its port, of order 5; largest relative fitting error 3.0e-04"
    )


# -- what is given ---------------------------------------------------------------------------------


def test_the_template_is_one(tmp_path, gfor):
    code, text, _ = gfor("certify", "--details-template")
    assert code == 0
    path = tmp_path / "details.toml"
    path.write_text(text, encoding="utf-8")
    assert read_details(path) == Details()


def test_what_is_wrong_with_details_is_said_with_its_line(tmp_path):
    path = tmp_path / "details.toml"
    path.write_text('number = 7\ndate = "soon"\napplicants = "A"\n', encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        read_details(path)
    text = str(caught.value)
    assert "line 1, number: 7 is given; write a text in quotes" in text
    assert "line 2, date: 'soon' is given; write a date" in text
    assert "line 3, applicants: this key is unknown; there are: number" in text
    with pytest.raises(InputError, match="--details-template"):
        read_details(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda r: r["sha256"].update(fmu="0" * 64), "it is of another FMU or binding"),
        (lambda r: r.update(tool="gfor-cosim 0.0.1"), "it was made by gfor-cosim 0.0.1"),
        (lambda r: r["checks"].pop(), "it does not hold memory"),
        (
            lambda r: r["checks"].append(failed("runs", "crash", "it died").as_dict()),
            "its checks say otherwise",
        ),
        (lambda r: r.pop("checks"), "it is no report"),
    ],
)
def test_a_report_of_checks_is_of_this_fmu_and_whole(tmp_path, fmu_path, gfor, change, text):
    fmu = fmu_path("gfor")
    report = AcceptanceReport(fmu, None, [passed(name, "fine") for name in CHECKS]).as_dict()
    change(report)
    (tmp_path / "report.json").write_text(json.dumps(report), encoding="utf-8")
    code, _, error = gfor(
        "certify", fmu, "--check", tmp_path / "report.json", "--out", tmp_path / "out"
    )
    assert code == 2
    assert text in error
