"""What the pictures of a report tell apart."""

from types import SimpleNamespace

import numpy as np

from orchestrator.certification import report_criteria


def test_marks_of_modes_with_the_converter_are_the_large_ones(monkeypatch):
    seen = []
    monkeypatch.setattr(report_criteria, "complex_plane", lambda title, marks, **_: seen.extend(marks) or "")
    point = SimpleNamespace(modes=SimpleNamespace(eigenvalues=np.array([-0.1 + 3j, -0.1 + 60j])), components=["a", "b"])
    certificate = SimpleNamespace(results={("with", 0.1): point, ("without", 0.1): point}, verdicts=[])
    report_criteria.eigenvalues(certificate, SimpleNamespace(add=lambda picture, words: (picture, "")))
    assert [(mark.large, mark.text.split()[0]) for mark in seen] == [(False, "without"), (True, "with")]
