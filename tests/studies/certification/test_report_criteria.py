"""What the pictures of a report tell apart."""

from types import SimpleNamespace

import numpy as np

from orchestrator.face.cli import certificate
from orchestrator.face.cli.terminal import make_console
from orchestrator.studies.certification import report_criteria


def test_marks_of_modes_with_the_converter_are_the_large_ones(monkeypatch):
    seen = []
    monkeypatch.setattr(
        report_criteria, "complex_plane", lambda title, marks, **_: seen.extend(marks) or ""
    )
    point = SimpleNamespace(
        modes=SimpleNamespace(eigenvalues=np.array([-0.1 + 3j, -0.1 + 60j])), components=["a", "b"]
    )
    certificate = SimpleNamespace(
        results={("with", 0.1): point, ("without", 0.1): point}, verdicts=[]
    )
    report_criteria.eigenvalues(
        certificate, SimpleNamespace(add=lambda picture, words: (picture, ""))
    )
    assert [(mark.large, mark.text.split()[0]) for mark in seen] == [
        (False, "without"),
        (True, "with"),
    ]


def test_the_findings_name_where_each_criterion_is_not_accepted(monkeypatch):
    monkeypatch.setattr(report_criteria, "converter_model", lambda *_: "")
    for name in ("_least_and_growth", "_remark"):
        monkeypatch.setattr(report_criteria, name, lambda c: [])
    good, bad = (SimpleNamespace(accepted=accepted) for accepted in (True, False))
    times = {
        0.1: (True, good),
        0.2: (True, None),
        0.3: (True, bad),
        0.4: (False, bad),
        0.5: (False, None),
    }
    verdicts = [
        SimpleNamespace(X_L=X, is_judged=judged, time=time, eigenvalues_accepted=X < 0.3)
        for X, (judged, time) in times.items()
    ]
    c = SimpleNamespace(
        verdicts=verdicts,
        results={("with", X): None for X in times},
        pod="none",
        signal="sg1.p",
        controllers=SimpleNamespace(source=""),
    )
    text = "\n".join(report_criteria.damping_findings(c))
    assert "Eigenvalue criterion: not accepted at X_L = 0.3 pu" in text
    assert "not accepted at X_L = 0.2, 0.3 pu" in text


def test_the_terminal_says_the_remark_of_the_page(monkeypatch, capsys, tmp_path):
    mode = SimpleNamespace(before_percent=25.33, damping_percent=4.0, frequency_hz=0.5)
    found = SimpleNamespace(
        verdicts=[SimpleNamespace(X_L=0.1, lowered=[mode])],
        verdict="incomplete",
        sentence=lambda: "It is accepted where it was judged.",
        is_by_rows=False,
        passed=False,
        refused=False,
    )
    remark = "Remark: the converter lowers a damping by more than 2 points at X_L = 0.1 pu"
    where = "the lowest of them at 0.1 pu and 0.500 Hz, from 25.33 to"
    (on_page,) = report_criteria._remark(found)
    assert on_page == f'<b>{remark}</b>; {where} <span class="bad">4.00</span> %'
    monkeypatch.setattr(certificate, "DampingCertificate", SimpleNamespace)
    monkeypatch.setattr(certificate, "_show_damping_test", lambda *_: None)
    certificate.show(found, [], tmp_path, make_console())
    assert f"judged.\n{remark}; {where} 4.00 %.\n" in capsys.readouterr().out
    found.verdicts[0].lowered = []
    certificate.show(found, [], tmp_path, make_console())
    assert "Remark" not in capsys.readouterr().out
