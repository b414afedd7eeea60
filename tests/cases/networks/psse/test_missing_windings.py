"""X'' = X' says that an axis has no damper winding: its time constant has no effect, whatever a file writes for it."""

import pytest

from orchestrator.cases.new.new_case import write_case
from orchestrator.cases.new.wanted_case import WantedCase
from orchestrator.studies.modes.modes import compute_modes
from tests.cases.networks.psse.test_machine_bases import dynamics, network
from tests.support.scenarios import prepare_one

WITHOUT = "3 'GENSAL' 1 8.0 {fast} 0.05 5.0 0.0 1.8 1.7 0.3 {X2} {X_l} 0.03 0.2 /\n"


@pytest.fixture
def prepared(tmp_path):
    """T''do, X'' and X_l of the second machine → the scenario base of the case that gfor writes."""

    def scenario(fast=0.03, X2=0.3, X_l=0.2):
        (tmp_path / "grid.raw").write_text(network())
        record = WITHOUT.format(fast=fast, X2=X2, X_l=X_l)
        (tmp_path / "grid.dyr").write_text(dynamics(1, 6.5, 900.0, 900.0) + record)
        out = tmp_path / "case.toml"
        files = (tmp_path / "grid.raw", tmp_path / "grid.dyr")
        out.write_text(write_case(WantedCase(files, out)).text, encoding="utf-8")
        return prepare_one(out, "base")

    return scenario


def oscillations(scenario):
    found = (mode.eigenvalue for mode in compute_modes(scenario).modes)
    return sorted((x for x in found if x.imag > 0.1), key=lambda x: x.imag)


def test_a_time_constant_without_a_winding_moves_nothing_and_is_not_judged(prepared):
    slow = prepared(fast=999.0)
    assert oscillations(slow) == pytest.approx(oscillations(prepared(fast=0.03)), rel=1e-6)
    assert "T_d20" not in " ".join(question.text for question in slow.questions)


def test_the_time_constant_of_a_winding_is_judged(prepared):
    questions = " ".join(question.text for question in prepared(fast=999.0, X2=0.25).questions)
    assert "T_d20 = 999 s must be less than" in questions


def test_a_leakage_reactance_of_zero_is_asked_about(prepared):
    """As of a very small one, beside which nothing is singular."""
    none = prepared(X_l=0.0)
    assert oscillations(none) == pytest.approx(oscillations(prepared(X_l=1e-6)), rel=1e-4)
    assert "machine.X_l = 0 pu is outside of" in " ".join(q.text for q in none.questions)
