"""Every figure of a JSON or a page is one of the object that it was made from, in the unit that is said."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.linear.spectra.modes import Mode
from orchestrator.linear.spectra.stability import Cause, Hidden, Stability
from orchestrator.studies.certification import report_criteria
from orchestrator.studies.certification.criteria import PodEffect
from orchestrator.studies.modes.step_choice import Allowed, StepChoice, TriedStep, step_choice_json
from orchestrator.studies.modes.tables import COLUMNS, modes_table
from orchestrator.studies.runs.answer import ScenarioAnswer
from orchestrator.studies.runs.answers_table import answers_table
from tests.support.figures import foreign_in_json, foreign_in_text, unseen_slips

# no two of them are a simple multiple of each other
CRITICAL = np.array([-0.3137 + 3.7193j, -0.9071 + 7.3391j])


def test_the_walker_sees_a_unit_and_a_sign():
    source = {"eigenvalue": -0.3137 + 3.7193j, "share": 0.417}
    right = {"frequency_hz": 3.7193 / (2 * np.pi), "share_percent": 41.7, "share": 0.417}
    assert foreign_in_json(right, source) == []
    for wrong in (3.7193 * 2 * np.pi, -3.7193 / (2 * np.pi), 3.7193 / np.pi):
        assert foreign_in_json({"frequency_hz": wrong}, source) == [(".frequency_hz", wrong)]
    assert foreign_in_text("<td>−0.314 ± j3.719</td><td>0.5919</td>", source) == []
    assert foreign_in_text("<td>0.314</td><td>23.3690</td>", source) == ["0.314", "23.3690"]


def test_the_walker_sees_percent_that_are_none_and_a_lost_sign():
    source = {"share": 0.417, "change": -0.0123, "damping_percent": 8.43}
    assert foreign_in_json({"share": 41.7, "share_percent": 0.417}, source) == [
        (".share", 41.7),
        (".share_percent", 0.417),
    ]
    assert foreign_in_json({"change": 0.0123, "damping_percent": 843.0}, source) == [
        (".change", 0.0123),
        (".damping_percent", 843.0),
    ]
    assert foreign_in_text("41.7 % and 0.417, −0.012", source) == []
    assert foreign_in_text("41.7 and 0.417 %, 0.012", source) == ["41.7", "0.417", "0.012"]
    assert foreign_in_text("41.7", source, "Share [%]") == []


def test_of_a_choice_of_the_step():
    seen = CRITICAL + np.array([0.0123 + 0.0411j, -0.0057 + 0.0213j])
    trial = TriedStep(
        "gauss-seidel", 1.3e-4, np.array([0.0031, -0.0047]), np.array([0.19, -0.23]), seen, 0.71
    )
    choice = StepChoice(
        prepared=SimpleNamespace(name="base"),
        allowed=Allowed(0.0013, 0.29),
        critical=CRITICAL,
        growth=0.0371,
        trials=(trial,),
    )
    said = step_choice_json(choice)
    assert [one["frequency_hz"] for one in said["critical"]] == pytest.approx(
        CRITICAL.imag / (2 * np.pi)
    )
    assert foreign_in_json(said, choice) == []


def test_of_a_table_of_modes():
    modes = [
        SimpleNamespace(
            eigenvalue=complex(z),
            frequency_hz=z.imag / (2 * np.pi),
            damping_percent=-100 * z.real / abs(z),
            participation=(("a", 0.4173), ("b", 0.2819)),
        )
        for z in CRITICAL
    ]
    result = SimpleNamespace(
        prepared=SimpleNamespace(name="base"), name_of=lambda mode: "", modes=modes
    )
    for row in modes_table([result]).rows:
        for column in COLUMNS:
            cell = str(column.stored_value(row))
            assert foreign_in_text(cell, modes, column.file_heading) == [], column.file_heading


def test_of_a_certificates_page(monkeypatch):
    mode = SimpleNamespace(
        eigenvalue=complex(CRITICAL[0]),
        before=complex(CRITICAL[1]),
        doubt="",
        similarity=0.871,
        components="a",
        accepted=True,
    )
    neighbour = SimpleNamespace(
        eigenvalue=complex(CRITICAL[1]), before=complex(CRITICAL[0]), components="b"
    )
    verdict = SimpleNamespace(
        X_L=0.1, modes=[mode], neighbours=[neighbour], faults=[], unknown="", judged=True
    )
    headings = ("Eigenvalue [rad/s]", "f [Hz]", "Damping [%]")
    for heading, cell in zip(headings, report_criteria._mode(mode.eigenvalue), strict=True):
        assert foreign_in_text(cell, mode, heading) == []
    assert foreign_in_text(report_criteria.before(mode.before), mode) == []
    point = SimpleNamespace(
        modes=SimpleNamespace(eigenvalues=np.array([mode.eigenvalue])), components=["a"]
    )
    marks = []
    monkeypatch.setattr(
        report_criteria, "complex_plane", lambda title, shown, **_: marks.extend(shown) or ""
    )
    certificate = SimpleNamespace(results={("with", 0.1): point}, verdicts=[])
    report_criteria.eigenvalues(certificate, SimpleNamespace(add=lambda *_: ("", "")))
    (mark,) = marks
    assert "0.592 Hz" in mark.text
    assert foreign_in_text(mark.text, verdict) == []


def modes_of_figures():
    return [
        Mode(complex(z), (("sg1.omega", a), ("gfor.theta", b)), {"sg1.omega": 1.0 + 0j})
        for z, a, b in zip(CRITICAL, (0.4173, 0.3911), (0.2819, 0.2333), strict=True)
    ]


def test_of_a_runs_answer():
    """Before and after the events, in JSON and in the first table."""
    before, after = modes_of_figures()
    became = Mode(-0.1319 + 3.1171j, before.participation, before.shape)
    for same in (became, None):
        answer = ScenarioAnswer("gfor", True, "stable", before, "settles", after, "sg1", same)
        source = [before, after, became, before.by_component, after.by_component]
        said = answer.as_json()
        assert foreign_in_json(said, source) == []
        assert unseen_slips(said, source) == []
        table = answers_table([answer], (0.1, 2.5))
        for column in table.columns[2:4]:
            for cell in column.cells:
                assert foreign_in_text(str(cell), source, str(column.header)) == []
                wrong = str(cell).replace(".", "")
                assert foreign_in_text(wrong, source, str(column.header))


def test_of_a_stability_block():
    (mode, _) = modes_of_figures()
    stability = Stability(False, mode, 1, 1, 7, Cause.SYSTEM, -0.2719, 1.3e-3)
    said = stability.as_json()
    assert said["frequency_hz"] == pytest.approx(CRITICAL[0].imag / (2 * np.pi))
    assert foreign_in_json(said, stability) == []
    assert unseen_slips(said, stability) == []


def test_of_modes_outside_of_the_range():
    hidden = Hidden((0.13, 2.57), 3, complex(CRITICAL[1]), (complex(CRITICAL[0]),))
    said = hidden.as_json()
    assert foreign_in_json(said, hidden) == []
    assert unseen_slips(said, hidden) == []


def test_a_slip_that_would_pass_is_told():
    """An object that holds a figure and 100 times of it shows that the walker would not see that slip."""
    assert unseen_slips({"share": 0.417}, {"share": 0.417, "other": 41.7}) == [
        (".share", "100 times")
    ]
    assert unseen_slips({"share": 0.417}, {"share": 0.417}) == []


def test_of_a_certificates_damping_controller():
    """Modes without and with it, by how much it raises the damping, and what the response shows."""
    off, on = CRITICAL[0], CRITICAL[0] - 0.4177
    effect = PodEffect(CRITICAL, {"off": off, "on": on, "response": on + 0.0291j}, 0.0713)
    raised = 100 * (-on.real / abs(on) + off.real / abs(off))
    source = [effect, raised]
    said = effect.as_json()
    assert said["modal"]["raised"] == pytest.approx(raised)
    assert foreign_in_json(said, source) == []
    assert unseen_slips(said, source) == []
