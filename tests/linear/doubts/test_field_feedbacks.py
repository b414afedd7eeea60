"""A feedback of the field voltage that is at its limit where the machine starts is told, with its figures."""

import re

import pytest

from orchestrator.linear.doubts.field_feedbacks import feedback_warnings
from orchestrator.studies.modes.modes import running
from tests.support.scenarios import prepare_one


def told(values):
    plain = {"models": "phasor", **{f"sg1.{name}": value for name, value in values.items()}}
    with running(prepare_one("kundur", "pss", plain, step_size=1e-3)) as master:
        field = master.components["sg1"].values(["E_fd"])["E_fd"]
        return field, feedback_warnings(master)


@pytest.mark.parametrize(
    ("exciter", "K_G", "V_GMAX", "is_open"),
    [
        ("esst3a", 1.0, 1.5, True),
        ("exst3", 1.0, 1.5, True),
        ("esst3a", 1.0, 2.5, False),
        ("esst3a", 0.5, 1.5, False),
    ],
)
def test_a_feedback_at_its_limit_is_told_and_the_value_it_names_lets_it_act(
    exciter, K_G, V_GMAX, is_open
):
    given = {"exciter": exciter, "exciter.K_G": K_G, "exciter.V_GMAX": V_GMAX}
    field, warnings = told(given)
    assert field == pytest.approx(2.035, abs=0.01)
    assert len(warnings) == is_open
    for text in warnings:
        assert f"exciter.K_G = 1 times E_fd = {field:.4g} pu is {field:.4g} pu, above" in text
        assert "its limit exciter.V_GMAX = 1.5 pu" in text
        ((name, value),) = re.findall(r"--set sg1\.(\S+)=(\S+)$", text)
        assert told(given | {name: float(value)})[1] == ()
